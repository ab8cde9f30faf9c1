/* The ceiling follows the declared network by power alone, and nothing that is done to the model
 * lowers it. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "temperature_ceiling.h"
#include "unity.h"

static thermal_model_parameters_t parameters;
static thermal_model_t model;
static temperature_ceiling_t ceiling;

void setUp(void)
{
    thermal_model_parameters_default(&parameters);
    TEST_ASSERT_EQUAL(THERMAL_MODEL_OK, thermal_model_init(&model, &parameters, NULL));
    temperature_ceiling_begin(&ceiling, 20 * 128);
}

void tearDown(void) {}

/* power_w into every spring of the ceiling; the model is stepped with its own. */
static void run(float power_w, uint32_t model_uw, float seconds)
{
    uint32_t power_uw[THERMAL_MODEL_MAX_SPRINGS];
    for (uint8_t k = 0; k < THERMAL_MODEL_MAX_SPRINGS; k++) {
        power_uw[k] = model_uw;
    }
    for (float s = 0.0f; s < seconds; s += TEMPERATURE_CEILING_TURN_S) {
        for (uint8_t n = 0; n < 6; n++) {
            thermal_model_step(&model, power_uw);
        }
        for (uint8_t k = 0; k < model.springs; k++) {
            temperature_ceiling_step(&ceiling, &model, k, power_w);
        }
    }
}

static float model_c(uint8_t k)
{
    return (float)thermal_model_temperature_c7(&model, k) / 128.0f;
}

/* Heated through the transformation and cooled again: within 3 K of the exact network, whose
 * kinetics are a cosine. */
static void it_follows_the_declared_network(void)
{
    for (int phase = 0; phase < 40; phase++) {
        const bool heats = phase < 20;
        run(heats ? 0.6f : 0.1f, heats ? 600000u : 100000u, 6.0f);
        for (uint8_t k = 0; k < 9; k++) {
            TEST_ASSERT_FLOAT_WITHIN(3.0f, model_c(k), temperature_ceiling_c(&ceiling, k));
        }
    }
}

static void no_correction_of_the_model_lowers_it(void)
{
    run(0.6f, 600000u, 60.0f);
    temperature_ceiling_t untouched = ceiling;
    for (int n = 0; n < 100; n++) {
        for (uint8_t k = 0; k < 9; k++) {
            thermal_model_set_temperature(&model, k, 20 * 128); /* it is talked away */
        }
        for (uint8_t k = 0; k < 9; k++) {
            temperature_ceiling_step(&ceiling, &model, k, 0.6f);
        }
    }
    for (uint8_t k = 0; k < 9; k++) {
        TEST_ASSERT_TRUE(temperature_ceiling_c(&ceiling, k) > temperature_ceiling_c(&untouched, k));
    }
}

/* Other losses are declared, by settings that arrive now. */
static void declare_loss(float factor)
{
    int32_t held_uw[THERMAL_MODEL_MAX_SPRINGS];
    thermal_model_state_t state;
    for (uint8_t k = 0; k < model.springs; k++) {
        held_uw[k] = temperature_ceiling_hold_uw(&ceiling, &model, k);
    }
    thermal_model_get_state(&model, &state);
    parameters.loss_uw_per_k = (uint16_t)(factor * (float)parameters.loss_uw_per_k);
    TEST_ASSERT_EQUAL(THERMAL_MODEL_OK, thermal_model_init(&model, &parameters, NULL));
    TEST_ASSERT_TRUE(thermal_model_set_state(&model, &state));
    for (uint8_t k = 0; k < model.springs; k++) {
        temperature_ceiling_keep_loss(&ceiling, &model, k, held_uw[k],
                                      temperature_ceiling_hold_uw(&ceiling, &model, k));
    }
}

/* Beside a twin to which nothing was declared: what was there cools no faster than it does there,
 * also where settings arrive twice. */
static void heat_of_before_goes_no_faster_by_another_loss(void)
{
    for (int twice = 0; twice < 2; twice++) {
        setUp();
        run(0.6f, 600000u, 60.0f);
        float twin_c[40];
        for (int n = 0; n < 40; n++) {
            run(0.0f, 0, 6.0f);
            twin_c[n] = temperature_ceiling_c(&ceiling, 4);
        }
        setUp();
        run(0.6f, 600000u, 60.0f);
        declare_loss(1.4f);
        for (int n = 0; n < 40; n++) {
            if (twice != 0 && n == 3) {
                declare_loss(1.3f);
            }
            run(0.0f, 0, 6.0f);
            TEST_ASSERT_TRUE(temperature_ceiling_c(&ceiling, 4) > twin_c[n] - 2.0f);
        }
    }
}

/* Who uploads settings to warm springs and drives at once is not told that they burn: after a few
 * minutes all heat that is there was given since. */
static void heat_given_afterwards_goes_by_the_loss_of_now(void)
{
    run(0.6f, 600000u, 60.0f);
    declare_loss(1.4f);
    run(0.75f, 750000u, 400.0f);
    const float told_warm_c = temperature_ceiling_c(&ceiling, 4);
    temperature_ceiling_begin(&ceiling, 20 * 128);
    run(0.75f, 750000u, 1000.0f);
    TEST_ASSERT_FLOAT_WITHIN(2.0f, temperature_ceiling_c(&ceiling, 4), told_warm_c);
}

/* A smaller loss needs no such account. */
static void a_smaller_loss_counts_at_once(void)
{
    run(0.6f, 600000u, 60.0f);
    declare_loss(0.7f);
    for (uint8_t k = 0; k < model.springs; k++) {
        TEST_ASSERT_EQUAL_FLOAT(0.0f, ceiling.spared_w[k]);
    }
}

/* As hot as the model may be at rest, it does not trip; with a fifth more power it does. */
static void it_trips_a_ninth_above_the_model(void)
{
    run(0.0058f * 110.0f, 638000u, 1200.0f); /* all alike: nothing flows between them */
    TEST_ASSERT_FLOAT_WITHIN(0.5f, 130.0f, temperature_ceiling_c(&ceiling, 4));
    TEST_ASSERT_FALSE(temperature_ceiling_trips(&ceiling, 4, 13000));
    TEST_ASSERT_FALSE(temperature_ceiling_trips(&ceiling, 4, 12000)); /* 131.1 degC */
    TEST_ASSERT_TRUE(temperature_ceiling_trips(&ceiling, 4, 11800));  /* 128.9 degC */
    run(1.2f * 0.0058f * 110.0f, 638000u, 1200.0f);
    TEST_ASSERT_TRUE(temperature_ceiling_trips(&ceiling, 4, 13000));
}

static void a_trip_beyond_the_model_still_trips(void)
{
    TEST_ASSERT_FALSE(temperature_ceiling_trips(&ceiling, 0, 25000));
    run(8.0f, 0, 600.0f);
    TEST_ASSERT_TRUE(temperature_ceiling_trips(&ceiling, 0, 25000));
}

/* 0.64 of I^2 R with 5 V, 0.18 ohm and the austenite's 0.219. */
static void duty_and_supply_bound_the_power_from_below(void)
{
    current_control_parameters_t circuit;
    current_control_parameters_default(&circuit);
    temperature_ceiling_prepare(&ceiling, &model, &circuit);
    const float power_w = temperature_ceiling_power_w(&ceiling, 100.0f);
    TEST_ASSERT_FLOAT_WITHIN(1e-3f, 0.64f * 0.219f * 1.5664f * 1.5664f, power_w);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, temperature_ceiling_power_w(&ceiling, 0.0f));
    /* an honest reading at 4.2 V, 0.22 ohm is a tenth below */
    const float least_a = 4.2f / 8.0f / (0.219f + 0.22f);
    TEST_ASSERT_TRUE(least_a * least_a * 0.219f > 0.85f * power_w);
    circuit.freewheel_mv = 500;
    temperature_ceiling_prepare(&ceiling, &model, &circuit);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, temperature_ceiling_power_w(&ceiling, 10.0f));
}

/* The smallest heat capacity that the model takes: a step of 0.6 s is far longer than its time. */
static void it_is_stable_whatever_the_heat_capacity(void)
{
    parameters.heat_capacity_mj_per_k = 20;
    parameters.latent_heat_mj = 0;
    TEST_ASSERT_EQUAL(THERMAL_MODEL_OK, thermal_model_init(&model, &parameters, NULL));
    temperature_ceiling_begin(&ceiling, 20 * 128);
    run(0.3f, 300000u, 60.0f);
    TEST_ASSERT_FLOAT_WITHIN(0.5f, 20.0f + 0.3f / 0.0058f, temperature_ceiling_c(&ceiling, 4));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(it_follows_the_declared_network);
    RUN_TEST(no_correction_of_the_model_lowers_it);
    RUN_TEST(heat_of_before_goes_no_faster_by_another_loss);
    RUN_TEST(heat_given_afterwards_goes_by_the_loss_of_now);
    RUN_TEST(a_smaller_loss_counts_at_once);
    RUN_TEST(it_trips_a_ninth_above_the_model);
    RUN_TEST(a_trip_beyond_the_model_still_trips);
    RUN_TEST(duty_and_supply_bound_the_power_from_below);
    RUN_TEST(it_is_stable_whatever_the_heat_capacity);
    return UNITY_END();
}
