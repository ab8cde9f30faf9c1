/* The on-chip model by hand; and whatever the parameters, the pattern and the state: nothing wraps,
 * nothing comes from nothing. */
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "../run_tests.h"
#include "thermal_model.h"

static thermal_model_parameters_t parameters;
static thermal_model_t model;
static uint32_t power_uw[THERMAL_MODEL_MAX_SPRINGS];
static uint32_t random_state;

void setUp(void)
{
    thermal_model_parameters_default(&parameters);
    memset(power_uw, 0, sizeof power_uw);
    random_state = 11;
}

static uint32_t random_bits(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 17;
    random_state ^= random_state << 5;
    return random_state;
}

/* The model with `parameters`, which it must take. */
static void start(void)
{
    uint16_t bad = PARAMETER_COUNT;
    thermal_model_status_t status = thermal_model_init(&model, &parameters, &bad);
    TEST_ASSERT_EQUAL_MESSAGE(THERMAL_MODEL_OK, status,
                              bad < PARAMETER_COUNT ? parameter_row(bad).name : "");
}

static void run(uint32_t steps)
{
    while (steps-- > 0) {
        thermal_model_step(&model, power_uw);
    }
}

static double degrees(uint8_t spring)
{
    return thermal_model_temperature_c7(&model, spring) / 128.0;
}

static double phase(uint8_t spring)
{
    return thermal_model_austenite(&model, spring) / 32768.0;
}

static int16_t c7(double temperature_c)
{
    return (int16_t)(temperature_c * 128.0);
}

/* ---- figures by hand ---- */

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

/* ---- phase ---- */

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

/* ---- conservation, symmetry ---- */

TEST(no_heat_from_nothing)
{
    parameters.loss_rise_ppm_per_k = 3000;
    parameters.radiating_area_cmm2 = 11080;
    parameters.air_exchange_uw_per_k = 60000;
    parameters.plate_coupling_uw_per_k = 500;
    parameters.wake_uw_per_k = 1000;
    start();
    thermal_model_set_fan(&model, 60);
    thermal_model_state_t before, after;
    thermal_model_get_state(&model, &before);
    run(36000); /* an hour at ambient: not one bit */
    thermal_model_get_state(&model, &after);
    TEST_ASSERT_EQUAL_MEMORY(&before, &after, sizeof before);
}

/* ---- an effect at zero is no effect ---- */

TEST(an_absent_effect_leaves_no_trace)
{
    thermal_model_state_t state[5];
    for (int k = 0; k < 5; k++) {
        setUp();
        switch (k) {
        case 1: /* no shared air: its capacity does not matter */
            parameters.air_heat_capacity_mj_per_k = 1234;
            break;
        case 2: /* no plate: neither does its */
            parameters.plate_heat_capacity_mj_per_k = 17;
            parameters.plate_loss_uw_per_k = 65535;
            break;
        case 3: /* no wake: nor its direction */
            parameters.wake_direction = THERMAL_MODEL_WAKE_NORTH;
            break;
        case 4: /* fan off: nor what the fan would do */
            parameters.wake_uw_per_k = 2000;
            parameters.loss_fan_uw_per_k = 9000;
            parameters.orthogonal_fan_uw_per_k = 1;
            parameters.diagonal_fan_uw_per_k = 999;
            break;
        default:
            break;
        }
        start();
        for (int n = 0; n < 3000; n++) {
            if (n % 200 == 0) {
                for (int i = 0; i < 9; i++) {
                    power_uw[i] = random_bits() % 900000u;
                }
            }
            run(1);
        }
        thermal_model_get_state(&model, &state[k]);
        TEST_ASSERT_EQUAL_MEMORY(&state[0], &state[k], sizeof state[0]);
    }
}

/* ---- corners ---- */

static void corner(unsigned bits)
{
    thermal_model_parameters_default(&parameters);
    parameters.step_ms = bits & 1u ? 1000 : 1;
    parameters.heat_capacity_mj_per_k = bits & 2u ? 65535 : 200;
    parameters.loss_uw_per_k = bits & 4u ? 30000 : 0;
    parameters.loss_fan_uw_per_k = bits & 8u ? 60000 : 0;
    parameters.orthogonal_uw_per_k = bits & 16u ? 7000 : 0;
    parameters.diagonal_uw_per_k = bits & 32u ? 3000 : 0;
    parameters.loss_rise_ppm_per_k = bits & 64u ? 2000 : 0;
    parameters.radiating_area_cmm2 = bits & 128u ? 20000 : 0;
    parameters.latent_heat_mj = bits & 256u ? 65535 : 0;
    parameters.air_exchange_uw_per_k = bits & 512u ? 16000000 : 0;
    parameters.air_heat_capacity_mj_per_k = bits & 1024u ? 2000000 : 0;
    parameters.plate_coupling_uw_per_k = bits & 2048u ? 10000 : 0;
    parameters.plate_heat_capacity_mj_per_k = bits & 4096u ? 2000000 : 300;
    parameters.plate_loss_uw_per_k = bits & 8192u ? 65535 : 0;
    parameters.wake_uw_per_k = bits & 16384u ? 20000 : 0;
    if (bits & 32768u) {
        parameters.martensite_finish_cc = -3000;
        parameters.martensite_start_cc = -2800;
        parameters.austenite_start_cc = 9000;
        parameters.austenite_finish_cc = 19000;
    }
}

/* Hot neighbours must not cool a spring, cold ones not heat it, whatever the parameters: a wrapped
 * flow would. */
TEST(no_accepted_corner_wraps)
{
    unsigned accepted = 0;
    for (unsigned bits = 0; bits < 65536u; bits++) {
        corner(bits);
        if (thermal_model_init(&model, &parameters, 0) != THERMAL_MODEL_OK) {
            continue;
        }
        accepted++;
        thermal_model_set_fan(&model, (uint8_t)(bits % 3u * 50u));
        /* the hottest everything around the coldest spring, full power in it */
        thermal_model_set_ambient(&model, INT16_MAX);
        thermal_model_reset(&model, INT16_MAX);
        thermal_model_set_temperature(&model, 4, INT16_MIN);
        for (int i = 0; i < 9; i++) {
            power_uw[i] = UINT32_MAX;
        }
        int16_t before = thermal_model_temperature_c7(&model, 4);
        run(1);
        TEST_ASSERT_TRUE(thermal_model_temperature_c7(&model, 4) >= before);
        TEST_ASSERT_EQUAL_INT16(THERMAL_MODEL_HIGHEST_C7, thermal_model_temperature_c7(&model, 0));
        run(2);
        TEST_ASSERT_TRUE(thermal_model_is_consistent(&model));
        /* the coldest everything around the hottest spring, without power */
        thermal_model_set_ambient(&model, INT16_MIN);
        thermal_model_reset(&model, INT16_MIN);
        thermal_model_set_temperature(&model, 4, INT16_MAX);
        memset(power_uw, 0, sizeof power_uw);
        before = thermal_model_temperature_c7(&model, 4);
        run(1);
        TEST_ASSERT_TRUE(thermal_model_temperature_c7(&model, 4) <= before);
        TEST_ASSERT_TRUE(thermal_model_temperature_c7(&model, 0) >= THERMAL_MODEL_LOWEST_C7);
        run(2);
        TEST_ASSERT_TRUE(thermal_model_is_consistent(&model));
    }
    TEST_ASSERT_TRUE(accepted > 5000u);
}

TEST(too_much_power_counts_as_the_highest)
{
    static const uint32_t much[] = {THERMAL_MODEL_HIGHEST_POWER_UW + 1u, 0x01000000u, 0x04000001u,
                                    UINT32_MAX};
    start();
    power_uw[0] = THERMAL_MODEL_HIGHEST_POWER_UW;
    run(1);
    int16_t highest = thermal_model_temperature_c7(&model, 0);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 20.0 + 8.388607 / 3.0, highest / 128.0);
    for (int k = 0; k < 4; k++) {
        start();
        power_uw[0] = much[k];
        run(1);
        TEST_ASSERT_EQUAL_INT16(highest, thermal_model_temperature_c7(&model, 0));
    }
}

/* ---- refusals ---- */

static void refused(thermal_model_status_t status, uint16_t row)
{
    thermal_model_t before = model;
    uint16_t bad = UINT16_MAX;
    const char *const name = row < PARAMETER_COUNT ? parameter_row(row).name : "step_ms";
    TEST_ASSERT_EQUAL_MESSAGE(status, thermal_model_init(&model, &parameters, &bad), name);
    TEST_ASSERT_EQUAL_UINT16_MESSAGE(row, bad, name);
    TEST_ASSERT_EQUAL_MEMORY(&before, &model, sizeof model);
    setUp();
}

#define REFUSED(status, name, field, value)                                                        \
    parameters.field = (value);                                                                    \
    refused(THERMAL_MODEL_ERROR_##status, PARAMETER_##name)

/* A value outside its own limits: test_parameters has each of them. */
TEST(what_does_not_fit_together_is_refused_by_name)
{
    start();
    REFUSED(RANGE, rows, rows, 0);
    REFUSED(RANGE, columns, columns, 30);
    parameters.step_ms = 0;
    refused(THERMAL_MODEL_ERROR_RANGE, PARAMETER_COUNT);
    parameters.step_ms = 1001;
    refused(THERMAL_MODEL_ERROR_RANGE, PARAMETER_COUNT);
    REFUSED(RANGE, heat_capacity_j_per_k, heat_capacity_mj_per_k, 13);
    REFUSED(OVERFLOW, loss_w_per_k, loss_uw_per_k, 65535);
    REFUSED(OVERFLOW, loss_fan_w_per_k, loss_fan_uw_per_k, 65535);
    REFUSED(OVERFLOW, orthogonal_w_per_k, orthogonal_uw_per_k, 20000);
    REFUSED(OVERFLOW, orthogonal_fan_w_per_k, orthogonal_fan_uw_per_k, 20000);
    REFUSED(OVERFLOW, diagonal_w_per_k, diagonal_uw_per_k, 20000);
    REFUSED(OVERFLOW, diagonal_fan_w_per_k, diagonal_fan_uw_per_k, 20000);
    parameters.loss_uw_per_k = 20000;
    REFUSED(OVERFLOW, loss_rise_per_k, loss_rise_ppm_per_k, 20000);
    parameters.loss_uw_per_k = parameters.loss_fan_uw_per_k = 60000;
    parameters.orthogonal_uw_per_k = parameters.orthogonal_fan_uw_per_k = 9500;
    refused(THERMAL_MODEL_ERROR_OVERFLOW, PARAMETER_loss_w_per_k);
    REFUSED(RANGE, latent_heat_j, latent_heat_mj, 30100);
    parameters.austenite_start_cc = 9000;
    parameters.austenite_finish_cc = 9400;
    parameters.latent_heat_mj = 25000;
    refused(THERMAL_MODEL_ERROR_RANGE, PARAMETER_latent_heat_j);
    parameters.martensite_finish_cc = -100; /* with the shift the last spring's is below -30 */
    REFUSED(RANGE, transformation_shift_k, transformation_shift_cc[8], -2901);
    parameters.austenite_finish_cc = 18000; /* and 10 K of latent heat above 200 */
    parameters.austenite_start_cc = 17000;
    parameters.latent_heat_mj = 3000;
    REFUSED(RANGE, transformation_shift_k, transformation_shift_cc[8], 1001);
    REFUSED(ORDER, martensite_start_c, martensite_start_cc, 6800);
    REFUSED(RANGE, martensite_start_c, martensite_start_cc, 6900);
    REFUSED(ORDER, austenite_start_c, austenite_start_cc, 7799);
    REFUSED(ORDER, austenite_finish_c, austenite_finish_cc, 8800);
    REFUSED(RANGE, austenite_finish_c, austenite_finish_cc, 8900);
    parameters.plate_coupling_uw_per_k = 1000;
    REFUSED(RANGE, plate_heat_capacity_j_per_k, plate_heat_capacity_mj_per_k, 0);
    parameters.plate_coupling_uw_per_k = 1000;
    REFUSED(UNSTABLE, plate_heat_capacity_j_per_k, plate_heat_capacity_mj_per_k, 5);
    REFUSED(OVERFLOW, plate_coupling_w_per_k, plate_coupling_uw_per_k, 64000);
    REFUSED(RANGE, wake_w_per_k, wake_uw_per_k, 11301);
    REFUSED(RANGE, loss_scale, loss_scale_permille[8], 0);
    parameters.heat_capacity_mj_per_k = 40;
    parameters.latent_heat_mj = 0;
    parameters.loss_uw_per_k = 60000;
    parameters.orthogonal_uw_per_k = 8000;
    parameters.step_ms = 300;
    refused(THERMAL_MODEL_ERROR_UNSTABLE, PARAMETER_heat_capacity_j_per_k);
}

TEST(state_survives_and_garbage_does_not_enter)
{
    start();
    power_uw[0] = 600000;
    power_uw[4] = 900000;
    run(400);
    thermal_model_state_t state, again;
    thermal_model_get_state(&model, &state);
    double kept[2] = {degrees(0), degrees(4)};
    run(300);
    TEST_ASSERT_TRUE(thermal_model_set_state(&model, &state));
    thermal_model_get_state(&model, &again);
    TEST_ASSERT_EQUAL_MEMORY(&state, &again, sizeof state);
    TEST_ASSERT_DOUBLE_WITHIN(0.001, kept[0], degrees(0));
    TEST_ASSERT_DOUBLE_WITHIN(0.001, kept[1], degrees(4));
    run(1);
    TEST_ASSERT_TRUE(thermal_model_is_consistent(&model));
    thermal_model_t before = model;
    unsigned taken = 0;
    for (int k = 0; k < 20000; k++) {
        thermal_model_state_t garbage = state;
        uint8_t *bytes = (uint8_t *)&garbage;
        for (int n = 0; n < 40; n++) {
            bytes[random_bits() % (9u * sizeof garbage.spring[0])] = (uint8_t)random_bits();
        }
        if (thermal_model_set_state(&model, &garbage)) {
            taken++;
            run(3);
            TEST_ASSERT_TRUE(thermal_model_is_consistent(&model));
            model = before;
        } else {
            TEST_ASSERT_EQUAL_MEMORY(&before, &model, sizeof model);
        }
    }
    TEST_ASSERT_TRUE(taken < 2000u);
}

/* From any phase and temperature of one transformation into any other: where that has room for it,
 * all is as it was; what it cannot be is at its nearest. */
TEST(another_declaration_keeps_phase_and_temperature)
{
    static const int16_t points_cc[][4] = {
        {6800, 7800, 8800, 9800}, {6600, 7600, 8500, 9800}, {4000, 9000, 9000, 12000}};
    unsigned kept = 0;
    parameters.air_exchange_uw_per_k = 60000;
    for (unsigned n = 0; n < 6000; n++) {
        uint16_t austenite = 0;
        int16_t was_c7 = 0;
        for (unsigned side = 0; side < 2; side++) {
            const int16_t *const cc = points_cc[random_bits() % 3u];
            parameters.martensite_finish_cc = cc[0];
            parameters.martensite_start_cc = cc[1];
            parameters.austenite_start_cc = cc[2];
            parameters.austenite_finish_cc = cc[3];
            parameters.latent_heat_mj = (uint16_t)(random_bits() % 9000u);
            if (side == 0) {
                TEST_ASSERT_EQUAL(THERMAL_MODEL_OK, thermal_model_init(&model, &parameters, NULL));
                thermal_model_set_ambient(&model, 30 * 128);
                thermal_model_set_fan(&model, 60);
                for (unsigned turn = 0; turn < 4; turn++) {
                    was_c7 = (int16_t)(30 * 128 + random_bits() % 14000u);
                    thermal_model_set_temperature(&model, 8, was_c7);
                }
                was_c7 = thermal_model_temperature_c7(&model, 8);
                austenite = thermal_model_austenite(&model, 8);
                model.state.air_c23 = 45 * 128 * 65536;
            }
        }
        TEST_ASSERT_EQUAL(THERMAL_MODEL_OK, thermal_model_declare(&model, &parameters, NULL));
        TEST_ASSERT_TRUE(thermal_model_is_consistent(&model));
        TEST_ASSERT_EQUAL_INT16(was_c7, thermal_model_temperature_c7(&model, 8));
        TEST_ASSERT_EQUAL_INT16(45 * 128, thermal_model_air_c7(&model));
        TEST_ASSERT_EQUAL_INT16(30 * 128, thermal_model_ambient_c7(&model));
        const uint16_t now = thermal_model_austenite(&model, 8);
        const int32_t latent_c23 = (int32_t)((uint32_t)model.latent_full_c8 * now);
        TEST_ASSERT_EQUAL_INT32(latent_c23, model.state.spring[8].latent_c23);
        thermal_model_t end = model; /* the most, or least, that there is at that temperature */
        thermal_model_set_temperature(&end, 8, now > austenite ? -40 * 128 : 150 * 128);
        thermal_model_set_temperature(&end, 8, was_c7);
        if (abs(now - austenite) <= 4) {
            kept++;
        } else {
            TEST_ASSERT_UINT16_WITHIN(4, thermal_model_austenite(&end, 8), now);
        }
        thermal_model_set_temperature(&model, 8, was_c7); /* and rests there */
        TEST_ASSERT_UINT16_WITHIN(1, now, thermal_model_austenite(&model, 8));
        thermal_model_t anew; /* all that is derived is that of these parameters */
        TEST_ASSERT_EQUAL(THERMAL_MODEL_OK, thermal_model_init(&anew, &parameters, NULL));
        thermal_model_set_fan(&anew, 60);
        thermal_model_set_ambient(&anew, 30 * 128);
        TEST_ASSERT_TRUE(thermal_model_set_state(&anew, &model.state));
        TEST_ASSERT_EQUAL_MEMORY(&anew, &model, offsetof(thermal_model_t, state));
        TEST_ASSERT_EQUAL_MEMORY(anew.spring, model.spring, sizeof anew.spring);
    }
    TEST_ASSERT_TRUE(kept > 4500u);
    parameters.latent_heat_mj = 60000; /* refused: nothing is changed */
    const thermal_model_t before = model;
    TEST_ASSERT_EQUAL(THERMAL_MODEL_ERROR_RANGE, thermal_model_declare(&model, &parameters, NULL));
    TEST_ASSERT_EQUAL_MEMORY(&before, &model, sizeof before);
}
