#include <stdio.h>

#include "driven_model.h"

/* ---- figures by hand ---------------------------------------------------------------------------
 */

/* 5.8 mW/K x 50 K x 1.2, and 1.108e-4 m2 sigma (343.15^4 - 293.15^4) = 40.71 mW. All else that a
 * network has against another integration: test/host_fixed_vs_double. */
TEST(a_loss_that_rises_and_what_is_radiated_come_to_what_is_computed_by_hand)
{
    parameters.rows = parameters.columns = 1;
    parameters.loss_rise_ppm_per_k = 4000;
    parameters.radiating_area_cmm2 = 11080;
    start();
    power_uw[0] = 388710;
    run(10000);
    TEST_ASSERT_DOUBLE_WITHIN(0.03, 70.0, degrees(0));
}

TEST(air_without_capacity_follows_at_once)
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
TEST(air_quicker_than_a_step_does_not_ring)
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

/* ---- phase -------------------------------------------------------------------------------------
 */

/* Liang and Rogers: 78, 88 and 68, 98: halfway up at 93, halfway down at 73; and so much higher
 * where a spring's loop is shifted. */
TEST(phase_follows_the_cosine_and_its_minor_loops)
{
    static const double path[][2] = {
        {87.9, 0},      {93, 0.5},   {95.5, 0.85355}, /* (1 - cos 135) / 2 */
        {98, 1},        {78, 1},     {70.5, 0.14645}, {68, 0},
        {93, 0.5},      {80, 0.5},   {92, 0.5}, /* between, and below the turn: rests */
        {73, 0.25},     {76, 0.25},             /* half of the half */
        {93, 0.625},    {90, 0.625},            /* 1 - 0.75 / 2 */
        {95.5, 0.89016}                         /* the same branch: 1 - 0.75 x 0.14645 */
    };
    static const double shift_k[] = {0.0, 12.5, -40.0};
    parameters.transformation_shift_cc[1] = 1250;
    parameters.transformation_shift_cc[2] = -4000;
    start();
    for (uint8_t k = 0; k < 3; k++) {
        TEST_ASSERT_EQUAL_INT16(c7(68 + shift_k[k]),
                                thermal_model_transformation(&model, k).martensite_finish_c7);
        TEST_ASSERT_EQUAL_INT16(c7(88 + shift_k[k]),
                                thermal_model_transformation(&model, k).austenite_start_c7);
        for (size_t n = 0; n < ROWS(path); n++) {
            thermal_model_set_temperature(&model, k, c7(path[n][0] + shift_k[k]));
            here("spring %d at %.1f", k + 1, path[n][0]);
            TEST_ASSERT_DOUBLE_WITHIN(0.002, path[n][1], phase(k));
        }
    }
}

/* By phase, with either sign; 1500 ppm/K of 175 mohm over 60 K is 15.75 mohm, 500 ppm/K of 219 mohm
 * over 90 K 9.855 mohm. */
TEST(resistance_follows_phase_and_temperature)
{
    static const struct {
        uint32_t martensite_uohm, austenite_uohm;
        int16_t rise_ppm[2];
        double c;
        uint32_t is_uohm;
    } table[] = {{175000, 219000, {0, 0}, 20, 175000},
                 {175000, 219000, {0, 0}, 93, 197000},
                 {175000, 219000, {0, 0}, 110, 219000},
                 {16000000, 1, {0, 0}, 93, 8000000},
                 {16000000, 1, {0, 0}, 110, 1},
                 {175000, 219000, {1500, 500}, 20, 175000},
                 {175000, 219000, {1500, 500}, 80, 190750},
                 {175000, 219000, {1500, 500}, 110, 228855},
                 {175000, 219000, {-3000, 500}, 80, 143500},
                 {175000, 175000, {0, 0}, 110, 175000}};
    for (size_t n = 0; n < ROWS(table); n++) {
        parameters.resistance_martensite_uohm = table[n].martensite_uohm;
        parameters.resistance_austenite_uohm = table[n].austenite_uohm;
        parameters.resistance_martensite_rise_ppm_per_k = table[n].rise_ppm[0];
        parameters.resistance_austenite_rise_ppm_per_k = table[n].rise_ppm[1];
        start();
        thermal_model_set_temperature(&model, 0, c7(table[n].c));
        here("row %u", (unsigned)n);
        TEST_ASSERT_UINT32_WITHIN(20u + table[n].is_uohm / 1000u, table[n].is_uohm,
                                  thermal_model_resistance_uohm(&model, 0));
    }
    parameters.resistance_austenite_uohm = 219000; /* half of each, at 60 degC */
    parameters.resistance_martensite_rise_ppm_per_k = 1500;
    parameters.resistance_austenite_rise_ppm_per_k = 500;
    start();
    TEST_ASSERT_UINT32_WITHIN(20, (185500 + 223380) / 2,
                              thermal_model_resistance_uohm_at(&model, 0, 16384, c7(60)));
}

/* 1 A through 20 mohm: 20 mV and 20 mW that the spring does not get. */
TEST(contact_is_seen_in_the_resistance_and_not_in_the_heat)
{
    parameters.contact_uohm[2] = 20000;
    start();
    TEST_ASSERT_EQUAL_UINT32(195000, thermal_model_resistance_uohm(&model, 2));
    TEST_ASSERT_EQUAL_UINT32(175000, thermal_model_resistance_uohm(&model, 1));
    TEST_ASSERT_UINT32_WITHIN(1000, 175000, thermal_model_heating_uw(&model, 2, 1000, 195));
    TEST_ASSERT_EQUAL_UINT32(195000, thermal_model_heating_uw(&model, 1, 1000, 195));
    TEST_ASSERT_EQUAL_UINT32(0, thermal_model_heating_uw(&model, 2, 1000, 10));
}

TEST(power_to_hold_holds)
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
