#include <string.h>

#include "driven_model.h"

/* ---- figures by hand ---------------------------------------------------------------------------
 */

static void one_spring_settles_where_power_equals_loss(void)
{
    parameters.rows = parameters.columns = 1;
    start();
    power_uw[0] = 290000; /* 0.29 W / 5.8 mW/K = 50 K */
    run(10000);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 70.0, degrees(0));
}

static void one_spring_warms_by_its_time_constant(void)
{
    parameters.rows = parameters.columns = 1;
    start();
    power_uw[0] = 290000;
    run(517); /* tau = 0.3 / 0.0058 = 51.7 s: 1 - 1/e of 50 K is 31.61 */
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 20.0 + 31.61, degrees(0));
}

static void fan_full_and_half_are_the_given_and_the_mean_loss(void)
{
    parameters.rows = parameters.columns = 1;
    start();
    power_uw[0] = 226000;
    thermal_model_set_fan(&model, 100);
    run(10000);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 40.0, degrees(0)); /* 0.226 / 0.0113 = 20 K */
    thermal_model_set_fan(&model, 50);
    run(10000);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 20.0 + 0.226 / 0.00855, degrees(0));
}

/* As printed of printers' fans: 70 to 77 % of the extra loss at half the command. */
static void half_a_fan_cools_by_most_of_it(void)
{
    parameters.rows = parameters.columns = 1;
    parameters.fan_half_share_permille = 735;
    start();
    power_uw[0] = 226000;
    thermal_model_set_fan(&model, 50);
    run(10000);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 20.0 + 0.226 / (0.0058 + 0.735 * 0.0055), degrees(0));
}

/* Whatever the curve: what was declared at 0 and 100 %, between ever more. */
static void a_fan_that_blows_harder_never_cools_less(void)
{
    parameters.rows = parameters.columns = 1;
    parameters.wake_uw_per_k = 1000;
    for (uint16_t half = 100; half <= 900; half = (uint16_t)(half + 100u)) {
        parameters.fan_half_share_permille = half;
        start();
        TEST_ASSERT_EQUAL_UINT16(5800, model.spring[0].loss_uw_per_k);
        uint16_t before = 0;
        for (uint8_t percent = 0; percent <= 100; percent++) {
            thermal_model_set_fan(&model, percent);
            TEST_ASSERT_TRUE(model.spring[0].loss_uw_per_k >= before);
            before = model.spring[0].loss_uw_per_k;
            if (percent == 50) {
                TEST_ASSERT_DOUBLE_WITHIN(1.0, 5800.0 + 5.5 * half, before);
                TEST_ASSERT_DOUBLE_WITHIN(1.0, 586.0 + 0.072 * half, model.orthogonal_uw_per_k);
                TEST_ASSERT_DOUBLE_WITHIN(1.0, half, model.wake_uw_per_k);
            }
        }
        TEST_ASSERT_EQUAL_UINT16(11300, before);
        TEST_ASSERT_EQUAL_UINT16(658, model.orthogonal_uw_per_k);
    }
}

static void two_springs_share_heat_by_their_coupling(void)
{
    parameters.rows = 1;
    parameters.columns = 2;
    start();
    power_uw[0] = 300000;
    run(20000);
    /* sum 0.3/G; difference 0.3/(G + 2 g) */
    double sum = 0.3 / 0.0058, difference = 0.3 / (0.0058 + 2 * 0.000586);
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 20.0 + (sum + difference) / 2, degrees(0));
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 20.0 + (sum - difference) / 2, degrees(1));
}

static void loss_that_rises_and_radiation_settle_where_computed(void)
{
    parameters.rows = parameters.columns = 1;
    parameters.loss_rise_ppm_per_k = 4000;
    parameters.radiating_area_cmm2 = 11080;
    start();
    /* at 70 degC: 5.8 mW/K x 50 K x 1.2 = 348 mW; 1.108e-4 m2 sigma (343.15^4 - 293.15^4) = 40.71
     * mW */
    power_uw[0] = 348000 + 40710;
    run(10000);
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 70.0, degrees(0));
    TEST_ASSERT_INT32_WITHIN(300, 388710, thermal_model_power_to_hold_uw(&model, 0, c7(70)));
}

static void shared_air_and_plate_settle_where_computed(void)
{
    parameters.rows = parameters.columns = 1;
    parameters.air_exchange_uw_per_k = 5800;
    parameters.air_heat_capacity_mj_per_k = 100;
    start();
    power_uw[0] = 145000;
    run(20000);
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 70.0, degrees(0)); /* two equal resistances in a row */
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 45.0, thermal_model_air_c7(&model) / 128.0);

    parameters.air_exchange_uw_per_k = 0;
    parameters.plate_coupling_uw_per_k = 2000;
    parameters.plate_loss_uw_per_k = 2000;
    parameters.plate_heat_capacity_mj_per_k = 1000;
    start();
    power_uw[0] = 340000; /* 5.8 + 1 mW/K */
    run(60000);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 70.0, degrees(0));
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 45.0, thermal_model_plate_c7(&model) / 128.0);
}

static void air_without_capacity_follows_at_once(void)
{
    parameters.air_exchange_uw_per_k = 60000;
    parameters.air_heat_capacity_mj_per_k = 0;
    start();
    thermal_model_reset(&model, c7(60));
    run(20);
    /* 9 x 5.8 = 52.2 against 60 mW/K; the springs have hardly moved */
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 20.0 + 40.0 * 52.2 / 112.2,
                              thermal_model_air_c7(&model) / 128.0);
}

/* the air's own time is 0.07 s, a step 0.1 s: it must neither overshoot nor ring */
static void air_quicker_than_a_step_does_not_ring(void)
{
    parameters.air_exchange_uw_per_k = 60000;
    parameters.air_heat_capacity_mj_per_k = 8;
    parameters.loss_fan_uw_per_k = 5800;
    start();
    thermal_model_reset(&model, c7(60));
    int16_t before = thermal_model_air_c7(&model);
    for (int k = 0; k < 50; k++) {
        run(1);
        TEST_ASSERT_TRUE(thermal_model_air_c7(&model) <= before);
        before = thermal_model_air_c7(&model);
    }
    TEST_ASSERT_TRUE(before > c7(37));
}

/* all that goes in leaves through the air: what the wake brings was taken from it, not made */
static void wake_makes_no_heat(void)
{
    parameters.rows = 1;
    parameters.columns = 3;
    parameters.air_exchange_uw_per_k = 20000;
    parameters.wake_uw_per_k = 5000;
    start();
    thermal_model_set_fan(&model, 100);
    power_uw[0] = 500000;
    run(20000);
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 45.0,
                              thermal_model_air_c7(&model) / 128.0); /* 0.5 W / 20 mW/K */
}

static void wake_carries_heat_one_way(void)
{
    parameters.rows = 1;
    parameters.columns = 3;
    parameters.orthogonal_uw_per_k = parameters.orthogonal_fan_uw_per_k = 0;
    parameters.wake_uw_per_k = 1130;
    start();
    thermal_model_set_fan(&model, 100);
    power_uw[1] = 565000; /* 50 K at 11.3 mW/K */
    run(10000);
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 20.0, degrees(0));
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 70.0, degrees(1));
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 25.0, degrees(2)); /* a tenth of it */
    parameters.wake_direction = THERMAL_MODEL_WAKE_WEST;
    start();
    thermal_model_set_fan(&model, 100);
    run(10000);
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 25.0, degrees(0));
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 20.0, degrees(2));
}

/* ---- phase -------------------------------------------------------------------------------------
 */

/* Liang and Rogers: 78, 88 and 68, 98: halfway up at 93, halfway down at 73. */
static void full_loop_follows_the_cosine(void)
{
    parameters.rows = parameters.columns = 1;
    start();
    thermal_model_set_temperature(&model, 0, c7(87.9));
    TEST_ASSERT_EQUAL_UINT16(0, thermal_model_austenite(&model, 0));
    thermal_model_set_temperature(&model, 0, c7(93));
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 0.5, phase(0));
    thermal_model_set_temperature(&model, 0, c7(95.5));
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 0.85355, phase(0)); /* (1 - cos 135) / 2 */
    thermal_model_set_temperature(&model, 0, c7(98));
    TEST_ASSERT_EQUAL_UINT16(THERMAL_MODEL_AUSTENITE_FULL, thermal_model_austenite(&model, 0));
    thermal_model_set_temperature(&model, 0, c7(78));
    TEST_ASSERT_EQUAL_UINT16(THERMAL_MODEL_AUSTENITE_FULL, thermal_model_austenite(&model, 0));
    thermal_model_set_temperature(&model, 0, c7(70.5));
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 0.14645, phase(0));
    thermal_model_set_temperature(&model, 0, c7(68));
    TEST_ASSERT_EQUAL_UINT16(0, thermal_model_austenite(&model, 0));
}

static void minor_loop_by_hand(void)
{
    parameters.rows = parameters.columns = 1;
    start();
    thermal_model_set_temperature(&model, 0, c7(93)); /* 0.5 */
    thermal_model_set_temperature(&model, 0, c7(80)); /* between: rests */
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 0.5, phase(0));
    thermal_model_set_temperature(&model, 0, c7(92)); /* below the turn: still rests */
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 0.5, phase(0));
    thermal_model_set_temperature(&model, 0, c7(73)); /* half of the half */
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 0.25, phase(0));
    thermal_model_set_temperature(&model, 0, c7(76));
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 0.25, phase(0));
    thermal_model_set_temperature(&model, 0, c7(93)); /* 1 - 0.75 / 2 */
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 0.625, phase(0));
    thermal_model_set_temperature(&model, 0, c7(90));
    thermal_model_set_temperature(&model, 0, c7(95.5)); /* the same branch: 1 - 0.75 x 0.14645 */
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 0.89016, phase(0));
}

static void stepping_takes_the_same_loop_as_setting(void)
{
    for (int with_latent = 0; with_latent < 2; with_latent++) {
        setUp();
        parameters.rows = parameters.columns = 1;
        if (!with_latent) {
            parameters.latent_heat_mj = 0;
        }
        start();
        power_uw[0] = 800000;
        while (degrees(0) < 93.0) {
            run(1);
        }
        TEST_ASSERT_DOUBLE_WITHIN(0.15, 93.0, degrees(0) - 0.1);
        double reached = phase(0);
        TEST_ASSERT_DOUBLE_WITHIN(0.04, 0.5, reached);
        thermal_model_state_t state;
        thermal_model_get_state(&model, &state);
        TEST_ASSERT_TRUE((state.spring[0].latent_c23 != 0) == (with_latent != 0));
        power_uw[0] = 0;
        while (degrees(0) > 73.0) {
            run(1);
        }
        TEST_ASSERT_DOUBLE_WITHIN(0.01, reached / 2, phase(0));
        TEST_ASSERT_TRUE(thermal_model_is_consistent(&model));
    }
}

static void latent_heat_delays_by_its_energy(void)
{
    parameters.rows = parameters.columns = 1;
    parameters.loss_uw_per_k = parameters.loss_fan_uw_per_k = 1;
    start();
    power_uw[0] = 1000000;
    uint32_t steps = 0;
    while (thermal_model_austenite(&model, 0) < THERMAL_MODEL_AUSTENITE_FULL) {
        run(1);
        steps++;
    }
    /* 0.3 J/K x 78 K + 8.65 J = 32.05 J at 1 W */
    TEST_ASSERT_UINT32_WITHIN(3, 321, steps);
}

static void resistance_follows_phase_with_either_sign(void)
{
    start();
    TEST_ASSERT_EQUAL_UINT32(175000, thermal_model_resistance_uohm(&model, 0));
    thermal_model_set_temperature(&model, 0, c7(93));
    TEST_ASSERT_UINT32_WITHIN(100, 197000, thermal_model_resistance_uohm(&model, 0));
    thermal_model_set_temperature(&model, 0, c7(110));
    TEST_ASSERT_EQUAL_UINT32(219000, thermal_model_resistance_uohm(&model, 0));
    parameters.resistance_martensite_uohm = 16000000;
    parameters.resistance_austenite_uohm = 1;
    start();
    thermal_model_set_temperature(&model, 0, c7(93));
    TEST_ASSERT_UINT32_WITHIN(10000, 8000000, thermal_model_resistance_uohm(&model, 0));
    thermal_model_set_temperature(&model, 0, c7(110));
    TEST_ASSERT_EQUAL_UINT32(1, thermal_model_resistance_uohm(&model, 0));
}

/* 1500 ppm/K of 175 mohm over 60 K is 15.75 mohm, 500 ppm/K of 219 mohm over 90 K 9.855 mohm. */
static void resistance_of_each_phase_rises_from_20_degrees(void)
{
    parameters.resistance_martensite_rise_ppm_per_k = 1500;
    parameters.resistance_austenite_rise_ppm_per_k = 500;
    start();
    TEST_ASSERT_UINT32_WITHIN(2, 175000, thermal_model_resistance_uohm(&model, 0));
    thermal_model_set_temperature(&model, 0, c7(80));
    TEST_ASSERT_UINT32_WITHIN(20, 190750, thermal_model_resistance_uohm(&model, 0));
    thermal_model_set_temperature(&model, 0, c7(110));
    TEST_ASSERT_UINT32_WITHIN(20, 228855, thermal_model_resistance_uohm(&model, 0));
    /* half of each, at 60 degC: (185500 + 223380) / 2 */
    TEST_ASSERT_UINT32_WITHIN(20, 204440,
                              thermal_model_resistance_uohm_at(&model, 0, 16384, c7(60)));
    parameters.resistance_martensite_rise_ppm_per_k = -3000;
    start();
    thermal_model_set_temperature(&model, 0, c7(80));
    TEST_ASSERT_UINT32_WITHIN(20, 143500, thermal_model_resistance_uohm(&model, 0));
}

/* 1 A through 20 mohm: 20 mV and 20 mW that the spring does not get. */
static void contact_is_seen_in_the_resistance_and_not_in_the_heat(void)
{
    parameters.contact_uohm[2] = 20000;
    start();
    TEST_ASSERT_EQUAL_UINT32(195000, thermal_model_resistance_uohm(&model, 2));
    TEST_ASSERT_EQUAL_UINT32(175000, thermal_model_resistance_uohm(&model, 1));
    TEST_ASSERT_UINT32_WITHIN(1000, 175000, thermal_model_heating_uw(&model, 2, 1000, 195));
    TEST_ASSERT_EQUAL_UINT32(195000, thermal_model_heating_uw(&model, 1, 1000, 195));
    TEST_ASSERT_EQUAL_UINT32(0, thermal_model_heating_uw(&model, 2, 1000, 10));
}

/* The whole loop of one spring lies 12.5 K higher, its neighbours' does not. */
static void a_shifted_spring_transforms_higher(void)
{
    parameters.transformation_shift_cc[1] = 1250;
    parameters.transformation_shift_cc[2] = -4000;
    start();
    TEST_ASSERT_EQUAL_INT16(c7(88), thermal_model_transformation(&model, 0).austenite_start_c7);
    TEST_ASSERT_EQUAL_INT16(c7(80.5), thermal_model_transformation(&model, 1).martensite_finish_c7);
    TEST_ASSERT_EQUAL_INT16(c7(38), thermal_model_transformation(&model, 2).martensite_start_c7);
    thermal_model_set_temperature(&model, 1, c7(100.4));
    TEST_ASSERT_EQUAL_UINT16(0, thermal_model_austenite(&model, 1));
    thermal_model_set_temperature(&model, 1, c7(105.5));
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 0.5, phase(1));
    thermal_model_set_temperature(&model, 1, c7(110.6));
    thermal_model_set_temperature(&model, 1, c7(85.5));
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 0.5, phase(1));
    for (uint8_t k = 0; k < 3; k++) { /* the same by heat: 5 K above each one's austenite start */
        start();
        memset(power_uw, 0, sizeof power_uw);
        power_uw[k] = 800000;
        const int16_t half_c7 =
            (int16_t)(thermal_model_transformation(&model, k).austenite_start_c7 + c7(5));
        while (thermal_model_temperature_c7(&model, k) < half_c7) {
            run(1);
        }
        TEST_ASSERT_DOUBLE_WITHIN(0.02, 0.5, phase(k));
    }
}

static void power_to_hold_holds(void)
{
    parameters.air_exchange_uw_per_k = 60000;
    parameters.plate_coupling_uw_per_k = 500;
    parameters.radiating_area_cmm2 = 11080;
    parameters.loss_rise_ppm_per_k = 2000;
    parameters.wake_uw_per_k = 1000;
    start();
    thermal_model_set_fan(&model, 30);
    thermal_model_reset(&model, c7(40));
    thermal_model_set_temperature(&model, 4, c7(100));
    thermal_model_set_temperature(&model, 4, c7(80)); /* in the hysteresis band */
    power_uw[0] = 700000;
    power_uw[7] = 300000;
    for (int k = 0; k < 6000; k++) {
        int32_t hold = thermal_model_power_to_hold_uw(&model, 4, c7(80));
        TEST_ASSERT_TRUE(hold > 0);
        power_uw[4] = (uint32_t)hold;
        run(1);
        TEST_ASSERT_DOUBLE_WITHIN(0.05, 80.0, degrees(4));
    }
    TEST_ASSERT_EQUAL_UINT16(THERMAL_MODEL_AUSTENITE_FULL, thermal_model_austenite(&model, 4));
    TEST_ASSERT_TRUE(thermal_model_power_to_hold_uw(&model, 4, c7(0)) < 0);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(one_spring_settles_where_power_equals_loss);
    RUN_TEST(one_spring_warms_by_its_time_constant);
    RUN_TEST(fan_full_and_half_are_the_given_and_the_mean_loss);
    RUN_TEST(half_a_fan_cools_by_most_of_it);
    RUN_TEST(a_fan_that_blows_harder_never_cools_less);
    RUN_TEST(two_springs_share_heat_by_their_coupling);
    RUN_TEST(loss_that_rises_and_radiation_settle_where_computed);
    RUN_TEST(shared_air_and_plate_settle_where_computed);
    RUN_TEST(air_without_capacity_follows_at_once);
    RUN_TEST(air_quicker_than_a_step_does_not_ring);
    RUN_TEST(wake_makes_no_heat);
    RUN_TEST(wake_carries_heat_one_way);
    RUN_TEST(full_loop_follows_the_cosine);
    RUN_TEST(minor_loop_by_hand);
    RUN_TEST(stepping_takes_the_same_loop_as_setting);
    RUN_TEST(latent_heat_delays_by_its_energy);
    RUN_TEST(resistance_follows_phase_with_either_sign);
    RUN_TEST(resistance_of_each_phase_rises_from_20_degrees);
    RUN_TEST(contact_is_seen_in_the_resistance_and_not_in_the_heat);
    RUN_TEST(a_shifted_spring_transforms_higher);
    RUN_TEST(power_to_hold_holds);
    run_consistency_tests();
    return UNITY_END();
}
