#include "drive_policy.h"

uint16_t drive_policy_limits(const drive_policy_t *policy, uint8_t spring)
{
    return policy->spring[spring].limits;
}

uint16_t drive_policy_cut_ma(const drive_policy_t *policy, uint8_t spring)
{
    const drive_policy_spring_t *s = &policy->spring[spring];
    const uint16_t cutting = DRIVE_POLICY_LIMIT_CURRENT | DRIVE_POLICY_LIMIT_SUPPLY |
                             DRIVE_POLICY_LIMIT_TEMPERATURE | DRIVE_POLICY_LIMIT_UNDRIVEN |
                             DRIVE_POLICY_LIMIT_OVERLOAD;
    return (s->limits & cutting) != 0 && s->wanted_ma > s->target_ma
               ? (uint16_t)(s->wanted_ma - s->target_ma)
               : 0;
}

drive_policy_stage_t drive_policy_stage(const drive_policy_t *policy, uint8_t spring)
{
    return (drive_policy_stage_t)policy->spring[spring].stage;
}
