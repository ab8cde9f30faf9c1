#include "selftest.h"

void selftest_start(selftest_t *selftest, controller_t *controller)
{
    const drive_policy_parameters_t *const p = &controller->policy.parameters;
    *selftest = (selftest_t){.open_current_ma = p->open_current_ma, .policy = p->policy};
    (void)controller_set_open(controller, DRIVE_POLICY_OPEN, SELFTEST_CURRENT_MA);
}

static void judge(const controller_t *controller, uint8_t spring, uint8_t sensor,
                  selftest_result_t *result)
{
    const int16_t current_ma = controller_measured_ma(controller, spring);
    const uint16_t half_ma = controller_target_ma(controller, spring) / 2u;
    const uint16_t least_ma = half_ma > SELFTEST_LEAST_MA ? half_ma : SELFTEST_LEAST_MA;
    *result = (selftest_result_t){.spring = spring,
                                  .sensor = (controller_sensor_status_t)sensor,
                                  .fault = controller_fault(controller, spring)};
    result->sound = result->sensor == CONTROLLER_SENSOR_OK && result->fault == SAFETY_FAULT_NONE &&
                    current_ma > (int16_t)least_ma;
    if (result->sound) {
        const int16_t voltage_mv = controller_measured_mv(controller, spring);
        result->resistance_mohm = (int32_t)voltage_mv * 1000 / current_ma;
        result->fault = safety_resistance_fault(&controller->safety.parameters,
                                                (uint16_t)current_ma, voltage_mv);
        result->sound = result->fault == SAFETY_FAULT_NONE;
    }
}

selftest_step_t selftest_step(selftest_t *selftest, controller_t *controller, uint32_t tick,
                              const uint8_t sensor_status[], selftest_result_t *result)
{
    const uint8_t spring = selftest->spring;
    if (spring >= controller_springs(controller)) {
        selftest_end(selftest, controller);
        return SELFTEST_ENDED;
    }
    if (!selftest->driven) {
        (void)controller_set_target(controller, spring, DRIVE_POLICY_LEVEL_FULL);
        selftest->since_tick = tick;
        selftest->driven = true;
        return SELFTEST_WAITS;
    }
    if (tick - selftest->since_tick < SELFTEST_TICKS) {
        return SELFTEST_WAITS;
    }
    judge(controller, spring, sensor_status[spring], result);
    (void)controller_set_target(controller, spring, 0);
    selftest->failures = (uint8_t)(selftest->failures + (result->sound ? 0u : 1u));
    selftest->driven = false;
    selftest->spring++;
    return SELFTEST_JUDGED;
}

void selftest_end(selftest_t *selftest, controller_t *controller)
{
    controller_stop(controller);
    (void)controller_set_open(controller, (drive_policy_kind_t)selftest->policy,
                              selftest->open_current_ma);
}
