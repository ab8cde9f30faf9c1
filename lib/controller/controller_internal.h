/* What it is for: what the files of the controller share.
 * What it owns: nothing.
 * What it never does: serve anybody outside this folder. */
#ifndef CONTROLLER_INTERNAL_H
#define CONTROLLER_INTERNAL_H

#include "controller.h"

/* What flows, 0..CURRENT_MOST_MA. The sensor ends at 3200: a step's sum of power fits 32 bits. */
#define CURRENT_MOST_MA 4095
static inline uint16_t controller_flowing_ma(int16_t current_ma)
{
    if (current_ma <= 0) {
        return 0;
    }
    return current_ma > CURRENT_MOST_MA ? CURRENT_MOST_MA : (uint16_t)current_ma;
}

static inline uint16_t controller_positive_mv(int16_t voltage_mv)
{
    return voltage_mv > 0 ? (uint16_t)voltage_mv : 0u;
}

static inline uint8_t controller_bit_of(uint8_t spring)
{
    return (uint8_t)(1u << (spring & 7u));
}

/* It was warm as the board was reset, and is driven by no belief until it has cooled. */
static inline bool controller_waits_anew(const controller_t *controller, uint8_t spring)
{
    return (controller->resumed[spring / 8u] & controller_bit_of(spring)) != 0 &&
           controller->policy.parameters.policy != DRIVE_POLICY_OPEN;
}

/* A scrub_stretches_t of a controller_t. */
scrub_stretch_t controller_fixed(const void *owner, uint8_t index);

#endif
