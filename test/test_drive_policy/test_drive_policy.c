/* The drive policy against hand-made situations: its inverse, its limits, its queue, its observer.
 */
#include <stddef.h>
#include <string.h>

#include "fixture.h"
#include "unity.h"

#define RESERVED_MA   14800u /* supply 15 A less the default reserve */
#define FULL_BOOST_MA 3000u

thermal_model_t model;
drive_policy_t policy;
drive_policy_parameters_t parameters;
uint16_t level[SPRINGS];
static bool allowed[SPRINGS];
bool valid[SPRINGS];
int16_t measured_ma[SPRINGS];
int16_t measured_mv[SPRINGS];
uint16_t target_ma[SPRINGS];
uint16_t supply_limit_ma;

void make(uint8_t rows, uint8_t columns)
{
    thermal_model_parameters_t p;
    thermal_model_parameters_default(&p);
    p.rows = rows;
    p.columns = columns;
    TEST_ASSERT_EQUAL(THERMAL_MODEL_OK, thermal_model_init(&model, &p, NULL));
    TEST_ASSERT_TRUE(drive_policy_init(&policy, &parameters, (uint8_t)(rows * columns), NULL));
    drive_policy_prepare(&policy, &model);
    for (uint8_t k = 0; k < SPRINGS; k++) {
        level[k] = 0;
        allowed[k] = true;
        valid[k] = false;
        measured_ma[k] = measured_mv[k] = 0;
        target_ma[k] = 0;
    }
}

void setUp(void)
{
    drive_policy_parameters_default(&parameters);
    parameters.policy = DRIVE_POLICY_PRECOMPENSATE;
    supply_limit_ma = 15000;
}

void tearDown(void) {}

uint32_t tick(void)
{
    drive_policy_input_t input = {.model = &model,
                                  .level_permille = level,
                                  .allowed = allowed,
                                  .maximum_current_ma = 3000,
                                  .supply_limit_ma = supply_limit_ma,
                                  .measured_ma = measured_ma,
                                  .measured_mv = measured_mv,
                                  .valid = valid};
    drive_policy_tick(&policy, &input, target_ma);
    uint32_t sum = 0;
    for (uint8_t k = 0; k < policy.springs; k++) {
        sum += target_ma[k];
    }
    return sum;
}

/* 0.25 s are 12.5 ticks, in which each spring is updated once. */
static void ticks(unsigned count)
{
    while (count-- != 0) {
        (void)tick();
    }
}

static void put(uint8_t spring, int16_t temperature_c, bool austenite)
{
    if (austenite) {
        thermal_model_set_temperature(&model, spring, 110 * 128);
    }
    thermal_model_set_temperature(&model, spring, (int16_t)(temperature_c * 128));
}

static uint32_t random_state = 7;
static uint32_t random_below(uint32_t limit)
{
    random_state = random_state * 1664525u + 1013904223u;
    return (random_state >> 8) % limit;
}

/* ---- inverse ---- */

static void two_springs_hold_by_the_hand_computed_inverse(void)
{
    parameters.hold_margin_cc = parameters.unsure_margin_cc = 200; /* holds at 80 degC */
    parameters.dither_ma = 0;
    parameters.observer = 0;
    make(1, 2);
    put(0, 80, true);
    level[0] = 1000;
    ticks(39);
    /* 60 K x (5.8 + 0.586) mW/K = 0.38316 W through 0.175 ohm: 1.4797 A */
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, drive_policy_stage(&policy, 0));
    TEST_ASSERT_UINT16_WITHIN(6, 1480, target_ma[0]);
    put(1, 70, false); /* and now 10 K x 0.586 mW/K = 0.35386 W: 1.4220 A */
    ticks(40);
    TEST_ASSERT_UINT16_WITHIN(6, 1422, target_ma[0]);
}

static void hotter_neighbour_reduces_drive_of_every_spring_of_nine(void)
{
    parameters.observer = 0;
    parameters.dither_ma = 0;
    make(3, 3);
    for (uint8_t k = 0; k < SPRINGS; k++) {
        put(k, 90, true);
    }
    put(4, 20, false);
    for (uint8_t k = 0; k < SPRINGS; k++) {
        level[k] = k == 4 ? 0 : 1000;
    }
    ticks(39);
    uint16_t before[SPRINGS];
    memcpy(before, target_ma, sizeof before);
    put(4, 75, false);
    ticks(26);
    for (uint8_t k = 0; k < SPRINGS; k++) {
        if (k != 4) {
            TEST_ASSERT_LESS_THAN_UINT16(before[k], target_ma[k]);
        }
    }
}

static void current_for_power_is_the_square_root_to_half_a_percent(void)
{
    static const uint32_t resistance_uohm[] = {20000, 175000, 1000000, 16000000};
    for (unsigned n = 0; n < 4; n++) {
        resistance_alloy_t alloy;
        resistance_alloy_prepare(&alloy, resistance_uohm[n], resistance_uohm[n] * 5 / 4);
        for (uint16_t current_ma = 100; current_ma <= 3000;
             current_ma = (uint16_t)(current_ma + 145)) {
            /* uW/64 of current_ma through the martensite */
            double power =
                (double)current_ma * current_ma * (resistance_uohm[n] / 1e3) / 1e3 / 64.0;
            if (power > 65000.0 || power < 500.0) {
                continue;
            }
            uint16_t found_ma = resistance_current_for_power_ma(&alloy, RESISTANCE_OBSERVER_ONE_Q14,
                                                                (uint16_t)power);
            TEST_ASSERT_UINT16_WITHIN(2 + current_ma / 200, current_ma, found_ma);
        }
    }
}

/* ---- limits ---- */

static void boosts_are_staggered_not_diluted(void)
{
    make(3, 3);
    for (uint8_t k = 0; k < SPRINGS; k++) {
        level[k] = 1000;
    }
    ticks(26);
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(RESERVED_MA, tick());
    unsigned full = 0, none = 0;
    for (uint8_t k = 0; k < SPRINGS; k++) {
        full += target_ma[k] > FULL_BOOST_MA - 30u;
        none += target_ma[k] == 0;
        if (target_ma[k] == 0) {
            TEST_ASSERT_BITS_HIGH(DRIVE_POLICY_LIMIT_SUPPLY, drive_policy_limits(&policy, k));
            TEST_ASSERT_UINT16_WITHIN(30, FULL_BOOST_MA, drive_policy_cut_ma(&policy, k));
        }
    }
    TEST_ASSERT_EQUAL_UINT(4, full);
    TEST_ASSERT_EQUAL_UINT(4, none); /* the ninth has what is left */
}

static void who_waits_longest_is_next(void)
{
    supply_limit_ma = 3300;
    make(3, 3);
    level[7] = 1000;
    ticks(13);
    level[1] = 1000;
    ticks(26);
    TEST_ASSERT_GREATER_THAN_UINT16(2900, target_ma[7]);
    TEST_ASSERT_EQUAL_UINT16(0, target_ma[1]);
    level[3] = 1000;
    ticks(26);
    level[7] = 0;
    ticks(13);
    TEST_ASSERT_EQUAL_UINT16(0, target_ma[7]);
    TEST_ASSERT_GREATER_THAN_UINT16(2900, target_ma[1]);
    TEST_ASSERT_EQUAL_UINT16(0, target_ma[3]);
}

static void holds_come_before_boosts(void)
{
    supply_limit_ma = 4000;
    parameters.observer = 0;
    make(3, 3);
    level[0] = 1000;
    ticks(26); /* this one heats first */
    put(8, 88, true);
    level[8] = 1000;
    ticks(39);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, drive_policy_stage(&policy, 8));
    TEST_ASSERT_EQUAL_UINT16(0, drive_policy_limits(&policy, 8) & DRIVE_POLICY_LIMIT_SUPPLY);
    TEST_ASSERT_GREATER_THAN_UINT16(1000, target_ma[8]);
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(3800, (uint32_t)target_ma[0] + target_ma[8]);
}

static void cap_fits_and_comes_within_a_milliampere_each(void)
{
    for (unsigned n = 0; n < 300; n++) {
        uint16_t wanted_ma[SPRINGS];
        uint32_t sum = 0;
        for (uint8_t k = 0; k < SPRINGS; k++) {
            wanted_ma[k] = (uint16_t)random_below(3201);
            sum += wanted_ma[k];
        }
        uint16_t budget_ma = (uint16_t)(1000u + random_below(14000));
        uint16_t cap_ma = (uint16_t)random_below(3201); /* what another call left */
        for (unsigned call = 0; call < 8; call++) {
            cap_ma = supply_share_cap_ma(wanted_ma, SPRINGS, budget_ma, cap_ma);
            uint32_t given = 0;
            for (uint8_t k = 0; k < SPRINGS; k++) {
                given += wanted_ma[k] < cap_ma ? wanted_ma[k] : cap_ma;
            }
            TEST_ASSERT_LESS_OR_EQUAL_UINT32(budget_ma, given);
            if (call == 7) {
                uint32_t best = sum < budget_ma ? sum : budget_ma;
                TEST_ASSERT_GREATER_OR_EQUAL_UINT32(best - 2u * SPRINGS, given);
            }
        }
    }
}

static void held_springs_coast_on_while_others_wait(void)
{
    parameters.dither_ma = 0;
    make(3, 3);
    put(0, 88, true);
    level[0] = 1000;
    ticks(52);
    TEST_ASSERT_EQUAL_INT(12 * 128, policy.spring[0].margin_c7);
    TEST_ASSERT_GREATER_THAN_UINT16(1000, target_ma[0]);
    policy.spring[0].observer.learnt = 100; /* its reading counts */
    policy.spring[0].observer.ratio_q14 = (uint16_t)(16384u * 219u / 175u);
    policy.spring[0].observer.phase_permille = 1000;
    policy.spring[0].fresh = 100;
    for (uint8_t k = 1; k < SPRINGS; k++) {
        level[k] = 1000;
    }
    uint16_t held_ma = target_ma[0];
    ticks(39);
    TEST_ASSERT_LESS_THAN_UINT16(held_ma / 2, target_ma[0]); /* above its margin: it coasts */
    for (uint8_t k = 1; k < SPRINGS; k++) {
        level[k] = 0;
    }
    ticks(39);
    TEST_ASSERT_UINT16_WITHIN(100, held_ma, target_ma[0]);
}

static void own_temperature_derates_linearly_then_trips(void)
{
    parameters.dither_ma = 0;
    parameters.trip_time_s = 2;
    make(3, 3);
    level[0] = 1000;
    ticks(26);
    put(0, 87, false);
    policy.limit_c7 = 92 * 128; /* half of the band of 10 K is left */
    ticks(26);
    TEST_ASSERT_UINT16_WITHIN(20, FULL_BOOST_MA / 2, target_ma[0]);
    TEST_ASSERT_BITS_HIGH(DRIVE_POLICY_LIMIT_TEMPERATURE, drive_policy_limits(&policy, 0));
    policy.limit_c7 = 80 * 128;
    ticks(26);
    TEST_ASSERT_EQUAL_UINT16(0, target_ma[0]);
    TEST_ASSERT_BITS_LOW(DRIVE_POLICY_LIMIT_TRIP, drive_policy_limits(&policy, 0));
    ticks(120);
    policy.limit_c7 = 110 * 128; /* the cause is gone, the latch stays */
    ticks(50);
    TEST_ASSERT_EQUAL_UINT16(0, target_ma[0]);
    TEST_ASSERT_BITS_HIGH(DRIVE_POLICY_LIMIT_TRIP, drive_policy_limits(&policy, 0));
    drive_policy_clear(&policy);
    ticks(26);
    TEST_ASSERT_GREATER_THAN_UINT16(2900, target_ma[0]);
}

static void hot_undriven_spring_derates_its_neighbours_only(void)
{
    parameters.dither_ma = 0;
    make(3, 3);
    level[0] = level[8] = 1000;
    ticks(26);
    put(1, 80, false); /* limit 83, band 5: it begins at 78 */
    ticks(39);
    TEST_ASSERT_BITS_HIGH(DRIVE_POLICY_LIMIT_UNDRIVEN, drive_policy_limits(&policy, 0));
    TEST_ASSERT_UINT16_WITHIN(60, FULL_BOOST_MA * 3 / 5, target_ma[0]);
    TEST_ASSERT_BITS_LOW(DRIVE_POLICY_LIMIT_UNDRIVEN, drive_policy_limits(&policy, 8));
    TEST_ASSERT_GREATER_THAN_UINT16(2900, target_ma[8]);
    put(1, 84, false);
    ticks(39);
    TEST_ASSERT_EQUAL_UINT16(0, target_ma[0]);
}

static void spring_just_released_is_no_false_actuation(void)
{
    make(3, 3);
    level[0] = level[1] = 1000;
    put(1, 95, true);
    ticks(26);
    level[1] = 0;
    ticks(39);
    TEST_ASSERT_BITS_LOW(DRIVE_POLICY_LIMIT_UNDRIVEN, drive_policy_limits(&policy, 0));
}

static void overload_takes_the_excess_away_in_time(void)
{
    parameters.overload_current_ma = 6000;
    parameters.overload_time_s = 4;
    make(3, 3);
    for (uint8_t k = 0; k < SPRINGS; k++) {
        level[k] = 1000;
    }
    ticks(100);
    TEST_ASSERT_GREATER_THAN_UINT32(14000, tick()); /* half of the time is free */
    ticks(60);
    uint32_t sum = tick();
    TEST_ASSERT_LESS_THAN_UINT32(12500, sum);
    TEST_ASSERT_GREATER_THAN_UINT32(6500, sum);
    ticks(100);
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(6200, tick());
    TEST_ASSERT_BITS_HIGH(DRIVE_POLICY_LIMIT_OVERLOAD, drive_policy_limits(&policy, 8));
}

static void budget_holds_in_every_tick_whatever_is_asked(void)
{
    make(3, 3);
    for (unsigned n = 0; n < 40000; n++) {
        if (random_below(20) == 0) {
            level[random_below(SPRINGS)] = (uint16_t)(random_below(3) * 500);
        }
        if (random_below(50) == 0) {
            allowed[random_below(SPRINGS)] = random_below(2) != 0;
        }
        if (random_below(100) == 0) {
            put((uint8_t)random_below(SPRINGS), (int16_t)(20 + random_below(85)),
                random_below(2) != 0);
        }
        if (random_below(400) == 0) {
            parameters.policy ^= 1u;
            TEST_ASSERT_TRUE(drive_policy_apply(&policy, &parameters, NULL));
            drive_policy_prepare(&policy, &model);
        }
        for (uint8_t k = 0; k < SPRINGS; k++) { /* any reading */
            valid[k] = random_below(4) != 0;
            measured_ma[k] = (int16_t)(random_below(65536) - 32768);
            measured_mv[k] = (int16_t)(random_below(65536) - 32768);
        }
        TEST_ASSERT_LESS_OR_EQUAL_UINT32(RESERVED_MA, tick());
        for (uint8_t k = 0; k < SPRINGS; k++) {
            TEST_ASSERT_LESS_OR_EQUAL_UINT16(3000, target_ma[k]);
            if (level[k] == 0 || !allowed[k]) {
                TEST_ASSERT_EQUAL_UINT16(0, target_ma[k]);
            }
        }
    }
    TEST_ASSERT_TRUE(thermal_model_is_consistent(&model));
}

static void policy_switch_never_jumps(void)
{
    parameters.dither_ma = 0;
    make(3, 3);
    level[0] = level[4] = level[5] = 1000;
    for (unsigned at = 1; at < 300; at += 37) {
        ticks(at);
        uint16_t last[SPRINGS];
        parameters.policy ^= 1u;
        TEST_ASSERT_TRUE(drive_policy_apply(&policy, &parameters, NULL));
        drive_policy_prepare(&policy, &model);
        for (unsigned n = 0; n < 60; n++) {
            memcpy(last, target_ma, sizeof last);
            (void)tick();
            for (uint8_t k = 0; k < SPRINGS; k++) {
                TEST_ASSERT_UINT16_WITHIN(20, last[k], target_ma[k]);
            }
        }
    }
}

static void parameters_outside_their_range_are_refused_whole(void)
{
    make(3, 3);
    drive_policy_parameters_t wrong = parameters;
    uint16_t bad = 0;
    wrong.boost_current_ma = 3300;
    TEST_ASSERT_FALSE(drive_policy_apply(&policy, &wrong, &bad));
    TEST_ASSERT_EQUAL_UINT16(PARAMETER_boost_current_a, bad);
    TEST_ASSERT_EQUAL_UINT16(3000, policy.parameters.boost_current_ma);
    wrong = parameters;
    wrong.unsure_margin_cc = (uint16_t)(wrong.hold_margin_cc - 1);
    TEST_ASSERT_FALSE(drive_policy_check(&wrong, &bad));
    wrong = parameters;
    wrong.policy = 2;
    TEST_ASSERT_FALSE(drive_policy_check(&wrong, &bad));
    TEST_ASSERT_FALSE(drive_policy_init(&policy, &parameters, 0, NULL));
}

/* ---- the resistance observer ---- */

static resistance_alloy_t alloy;
static resistance_observer_t observer;

/* One window at a current, with the sensor's 4 mV steps. */
static bool window(double current_a, double resistance_ohm)
{
    for (unsigned n = 0; n < 12; n++) {
        int mv = (int)(current_a * resistance_ohm * 1000.0 / 4.0 + 0.5) * 4;
        resistance_observer_take(&observer, (int16_t)(current_a * 1000.0 + 0.5), (int16_t)mv);
    }
    return resistance_observer_update(&observer, &alloy, true);
}

static void start_observer(uint32_t martensite_uohm, uint32_t austenite_uohm, double scale)
{
    resistance_alloy_prepare(&alloy, martensite_uohm, austenite_uohm);
    resistance_observer_reset(&observer);
    for (unsigned n = 0; n < 40; n++) {
        TEST_ASSERT_TRUE(window(3.0, scale * martensite_uohm / 1e6));
        if (n > 8) {
            resistance_observer_learn_martensite(&observer, &alloy);
        }
    }
}

static void check_phase(double martensite_ohm, double austenite_ohm, double scale)
{
    start_observer((uint32_t)(martensite_ohm * 1e6), (uint32_t)(austenite_ohm * 1e6), scale);
    for (unsigned percent = 0; percent <= 100; percent += 20) {
        double ohm = scale * (martensite_ohm + (austenite_ohm - martensite_ohm) * percent / 100.0);
        for (unsigned n = 0; n < 30; n++) {
            (void)window(3.0, ohm);
        }
        TEST_ASSERT_INT_WITHIN(45, (int)(percent * 10), observer.phase_permille);
        TEST_ASSERT_TRUE(resistance_observer_is_plausible(&observer, &alloy));
    }
}

static void phase_is_read_with_either_sign_and_any_scale(void)
{
    check_phase(0.175, 0.219, 1.0);
    check_phase(0.175, 0.219, 1.15);
    check_phase(0.175, 0.219, 0.85);
    check_phase(0.219, 0.175, 1.0); /* austenite below martensite */
    check_phase(0.219, 0.175, 1.15);
}

static void implausible_reading_is_not_believed(void)
{
    start_observer(175000, 219000, 1.0);
    for (unsigned n = 0; n < 30; n++) {
        (void)window(3.0, 0.13); /* falls where it should rise: the sign is wrong */
    }
    TEST_ASSERT_FALSE(resistance_observer_is_plausible(&observer, &alloy));
}

static void stuck_voltage_is_not_believed_once_the_current_moves(void)
{
    start_observer(175000, 219000, 1.0);
    TEST_ASSERT_TRUE(resistance_observer_is_plausible(&observer, &alloy));
    for (unsigned n = 0; n < 20; n++) {
        (void)window(1.3, 0.175 * 3.0 / 1.3);
    }
    TEST_ASSERT_FALSE(resistance_observer_is_plausible(&observer, &alloy));
}

static void noisy_reading_is_not_believed_and_a_quiet_one_is_again(void)
{
    start_observer(175000, 219000, 1.0);
    for (unsigned n = 0; n < 60; n++) {
        (void)window(1.3, n % 2 == 0 ? 0.16 : 0.19);
    }
    TEST_ASSERT_FALSE(resistance_observer_is_plausible(&observer, &alloy));
    for (unsigned n = 0; n < 60; n++) {
        (void)window(1.3, 0.175);
    }
    TEST_ASSERT_TRUE(resistance_observer_is_plausible(&observer, &alloy));
}

static void short_or_weak_window_says_nothing(void)
{
    start_observer(175000, 219000, 1.0);
    for (unsigned n = 0; n < 3; n++) {
        resistance_observer_take(&observer, 3000, 525);
    }
    TEST_ASSERT_FALSE(resistance_observer_update(&observer, &alloy, true));
    TEST_ASSERT_FALSE(window(0.1, 0.175));
    for (unsigned n = 0; n < 12; n++) {
        resistance_observer_take(&observer, -1, 525);
        resistance_observer_take(&observer, 3000, -1);
    }
    TEST_ASSERT_FALSE(resistance_observer_update(&observer, &alloy, true));
    TEST_ASSERT_TRUE(window(0.2, 0.175));
}

static void readings_beside_a_jump_of_the_current_are_left_out(void)
{
    start_observer(175000, 219000, 1.0);
    uint16_t ratio_q14 = observer.ratio_q14;
    resistance_observer_disturb(&observer);
    for (unsigned n = 0; n < RESISTANCE_OBSERVER_SETTLING; n++) {
        resistance_observer_take(&observer, 3000, 2000);
    }
    TEST_ASSERT_TRUE(window(3.0, 0.175));
    TEST_ASSERT_UINT16_WITHIN(20, ratio_q14, observer.ratio_q14);
}

static void window_that_no_longer_fits_keeps_what_it_has(void)
{
    start_observer(4000000, 5000000, 1.0);
    for (unsigned n = 0; n < 200; n++) { /* 800 V in all, 65 fit */
        resistance_observer_take(&observer, 1000, 4000);
    }
    TEST_ASSERT_TRUE(resistance_observer_update(&observer, &alloy, true));
    TEST_ASSERT_INT_WITHIN(30, 0, observer.phase_permille);
}

/* Feeds spring 0 with what a resistance makes of its targets. */
static void feed(double ohm, unsigned count)
{
    while (count-- != 0) {
        valid[0] = true;
        measured_ma[0] = (int16_t)target_ma[0];
        measured_mv[0] = (int16_t)(4 * (int)(target_ma[0] * ohm / 4.0 + 0.5));
        (void)tick();
    }
}

static void heating_that_starts_half_way_takes_the_phase_from_the_resistance(void)
{
    make(3, 3);
    level[0] = 1000;
    feed(0.175, 200);  /* cold: learns its martensite */
    put(0, 83, false); /* the model has it as martensite, in truth it is 60 % austenite */
    level[0] = 0;
    feed(0.2014, 20);
    level[0] = 1000;
    feed(0.2014, 100);
    TEST_ASSERT_INT_WITHIN(60, 600, thermal_model_austenite(&model, 0) * 1000 / 32768);
    TEST_ASSERT_EQUAL_INT16(83 * 128, thermal_model_temperature_c7(&model, 0));
    TEST_ASSERT_TRUE(drive_policy_observes(&policy, 0));
}

static void alloy_without_a_change_of_resistance_is_never_trusted(void)
{
    start_observer(175000, 176000, 1.0);
    TEST_ASSERT_FALSE(resistance_observer_is_plausible(&observer, &alloy));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(two_springs_hold_by_the_hand_computed_inverse);
    RUN_TEST(hotter_neighbour_reduces_drive_of_every_spring_of_nine);
    RUN_TEST(current_for_power_is_the_square_root_to_half_a_percent);
    RUN_TEST(boosts_are_staggered_not_diluted);
    RUN_TEST(who_waits_longest_is_next);
    RUN_TEST(holds_come_before_boosts);
    RUN_TEST(cap_fits_and_comes_within_a_milliampere_each);
    RUN_TEST(held_springs_coast_on_while_others_wait);
    RUN_TEST(own_temperature_derates_linearly_then_trips);
    RUN_TEST(hot_undriven_spring_derates_its_neighbours_only);
    RUN_TEST(spring_just_released_is_no_false_actuation);
    RUN_TEST(overload_takes_the_excess_away_in_time);
    RUN_TEST(budget_holds_in_every_tick_whatever_is_asked);
    RUN_TEST(policy_switch_never_jumps);
    RUN_TEST(parameters_outside_their_range_are_refused_whole);
    RUN_TEST(phase_is_read_with_either_sign_and_any_scale);
    RUN_TEST(implausible_reading_is_not_believed);
    RUN_TEST(stuck_voltage_is_not_believed_once_the_current_moves);
    RUN_TEST(noisy_reading_is_not_believed_and_a_quiet_one_is_again);
    RUN_TEST(short_or_weak_window_says_nothing);
    RUN_TEST(readings_beside_a_jump_of_the_current_are_left_out);
    RUN_TEST(window_that_no_longer_fits_keeps_what_it_has);
    RUN_TEST(heating_that_starts_half_way_takes_the_phase_from_the_resistance);
    RUN_TEST(alloy_without_a_change_of_resistance_is_never_trusted);
    run_hold_tests();
    return UNITY_END();
}
