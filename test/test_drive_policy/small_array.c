#include "small_array.h"

#include "../run_tests.h"

thermal_model_t model;
spring_estimator_t belief;
drive_policy_t policy;
drive_policy_parameters_t parameters;
uint16_t level[SPRINGS];
bool allowed[SPRINGS];
uint16_t target_ma[SPRINGS];
uint16_t supply_limit_ma, maximum_current_ma;

/* Nothing flows and nothing is read. */
static const int16_t nothing[SPRINGS];
static const bool unread[SPRINGS];

void setUp(void)
{
    drive_policy_parameters_default(&parameters);
    parameters.policy = DRIVE_POLICY_PRECOMPENSATE;
    supply_limit_ma = 15000;
    maximum_current_ma = 3000;
}

void tearDown(void)
{
    TEST_ASSERT_EQUAL_UINT8(0, spring_estimator_broken_seals(&belief));
}

/* Currents of a test are exact where it asks for no sweep, which no setting may. */
static drive_policy_parameters_t swept_enough(const drive_policy_parameters_t *asked)
{
    drive_policy_parameters_t swept = *asked;
    swept.dither_ma = asked->dither_ma < 200 ? 200 : asked->dither_ma;
    return swept;
}

void restart(void)
{
    const drive_policy_parameters_t swept = swept_enough(&parameters);
    TEST_ASSERT_TRUE(drive_policy_init(&policy, &swept, &model, NULL));
    policy.parameters.dither_ma = parameters.dither_ma;
}

void begin_cold(uint8_t rows, uint8_t columns)
{
    thermal_model_parameters_t p;
    thermal_model_parameters_default(&p);
    p.rows = rows;
    p.columns = columns;
    p.diagonal_uw_per_k = 0;
    TEST_ASSERT_EQUAL(THERMAL_MODEL_OK, thermal_model_init(&model, &p, NULL));
    spring_estimator_init(&belief, &model);
    restart();
    spring_estimator_prepare(&belief, &model, parameters.observer != 0);
    for (uint8_t k = 0; k < SPRINGS; k++) {
        level[k] = target_ma[k] = 0;
        allowed[k] = true;
    }
    thermal_model_reset(&model, 20 * 128);
    spring_estimator_trust_model(&belief, &model);
}

void believe(uint8_t spring, int16_t temperature_c, bool austenite)
{
    if (austenite) {
        thermal_model_set_temperature(&model, spring, 110 * 128);
    }
    thermal_model_set_temperature(&model, spring, (int16_t)(temperature_c * 128));
    spring_estimator_trust_model(&belief, &model);
}

void apply(const drive_policy_parameters_t *other)
{
    const drive_policy_parameters_t swept = swept_enough(other);
    TEST_ASSERT_TRUE(drive_policy_apply(&policy, &swept, &model, NULL));
    policy.parameters.dither_ma = other->dither_ma;
    spring_estimator_prepare(&belief, &model, other->observer != 0);
}

void policy_tick(void)
{
    const drive_policy_input_t input = {.belief = &belief,
                                        .model = &model,
                                        .level_permille = level,
                                        .allowed = allowed,
                                        .maximum_current_ma = maximum_current_ma,
                                        .supply_limit_ma = supply_limit_ma};
    drive_policy_tick(&policy, &input, target_ma);
}

uint32_t decide(void)
{
    uint32_t sum_ma = 0;
    spring_estimator_tick(&belief, &model, nothing, nothing, unread);
    policy_tick();
    for (uint8_t k = 0; k < policy.springs; k++) {
        sum_ma += target_ma[k];
    }
    return sum_ma;
}

void decisions(unsigned n)
{
    while (n-- != 0) {
        (void)decide();
    }
}
