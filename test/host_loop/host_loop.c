/* Controller and plant together: currents and temperatures of the paper's patterns, failures,
 * resets, determinism. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#include "../run_tests.h"
#include "loop.h"

static controller_settings_t settings;
static plant_t *plant;
static loop_t *loop;

/* The chip's default parameters in the plant: pitch 4 mm, with phase. */
void setUp(void)
{
    controller_settings_default(&settings);
    settings.policy.policy = DRIVE_POLICY_OPEN;
    plant = plant_create(3, 3);
    TEST_ASSERT_NOT_NULL(plant);
    TEST_ASSERT_EQUAL(PLANT_OK, plant_set_effect(plant, "latent_heat", true));
    TEST_ASSERT_EQUAL(PLANT_OK, plant_set_effect(plant, "resistance_phase", true));
    loop = NULL;
}

void tearDown(void)
{
    loop_destroy(loop);
    plant_destroy(plant);
}

static void start_with(const loop_options_t *options, uint64_t seed)
{
    loop_destroy(loop);
    loop = loop_create(&settings, plant, options, seed, NULL);
    TEST_ASSERT_NOT_NULL(loop);
}

static void start(void)
{
    start_with(NULL, 1);
}

/* With the hint `model cold`, for what is about the model: with the power it knows nothing. */
static void start_cold(void)
{
    start();
    controller_set_temperature(loop_controller(loop), 20 * 128);
}

static void command(unsigned pattern)
{
    bool on[CONTROLLER_MAX_SPRINGS] = {false};
    for (int k = 0; k < 9; k++) {
        on[k] = (pattern >> k & 1u) != 0;
    }
    controller_set_pattern(loop_controller(loop), on);
}

static double chip_c(int spring)
{
    return controller_temperature_c7(loop_controller(loop), (uint8_t)spring) / 128.0;
}

static double hottest_c(int spring)
{
    return (double)controller_temperature_bounds_c(loop_controller(loop), (uint8_t)spring).high;
}

static double true_c(int spring)
{
    return plant_temperature_c(loop_plant(loop), spring);
}

/* The model alone: what readings correct is test_spring_estimator's. */
TEST(estimate_follows_through_the_transformation)
{
    settings.policy.observer = 0;
    settings.policy.open_current_ma = 1800;
    start_cold();
    command(0x1EF);
    double worst_c = 0.0;
    double hottest_c = 0.0;
    for (int tenth = 0; tenth < 3000; tenth++) {
        if (tenth == 2000) {
            command(0);
        }
        loop_advance(loop, 0.1);
        for (int k = 0; k < 9; k++) {
            worst_c = fmax(worst_c, fabs(chip_c(k) - true_c(k)));
            hottest_c = fmax(hottest_c, true_c(k));
        }
    }
    TEST_ASSERT_TRUE(hottest_c > 98.0); /* it did transform */
    TEST_ASSERT_TRUE(worst_c < 0.5);
}

TEST(coarser_plant_steps_change_little)
{
    loop_options_t options;
    loop_options_default(&options);
    options.plant_ticks = 1;
    settings.policy.open_current_ma = 1700;
    start_with(&options, 1);
    loop_t *coarse = loop_create(&settings, plant, NULL, 1, NULL);
    TEST_ASSERT_NOT_NULL(coarse);
    command(0x1EF);
    bool on[CONTROLLER_MAX_SPRINGS] = {true, true, true, true, false, true, true, true, true};
    controller_set_pattern(loop_controller(coarse), on);
    for (int tenth = 0; tenth < 2000; tenth++) {
        loop_advance(loop, 0.1);
        loop_advance(coarse, 0.1);
        for (int k = 0; k < 9; k++) {
            TEST_ASSERT_DOUBLE_WITHIN(0.05, true_c(k), plant_temperature_c(loop_plant(coarse), k));
        }
    }
    loop_destroy(coarse);
}

/* The same current takes more of a lower supply, and more for a longer wire. */
TEST(a_supply_and_a_wiring_that_change_meanwhile_are_felt)
{
    start_cold();
    command(0x010);
    loop_advance(loop, 5.0);
    const double whole = (double)loop_outputs(loop)->duty[4];
    TEST_ASSERT_EQUAL(PLANT_OK, plant_set(loop_plant(loop), "supply_v", 4.6));
    loop_advance(loop, 3.0);
    const double sagged = (double)loop_outputs(loop)->duty[4];
    TEST_ASSERT_DOUBLE_WITHIN(0.04, 5.0 / 4.6, sagged / whole);
    TEST_ASSERT_EQUAL(PLANT_OK, plant_set(loop_plant(loop), "loop_resistance_ohm", 0.22));
    loop_advance(loop, 3.0);
    TEST_ASSERT_TRUE((double)loop_outputs(loop)->duty[4] > 1.04 * sagged);
}

/* What looks right and is not: the loop only provokes it; what the controller makes of it is not
 * judged here. */
TEST(frozen_lying_and_swapped_sensors_show_what_they_should_not)
{
    start();
    command(0x1FF);
    loop_advance(loop, 5.0);
    const controller_sensor_t *sensor = loop_inputs(loop)->sensor;
    TEST_ASSERT_TRUE(loop_act(loop, LOOP_ACTION_SENSOR_FREEZE, 3));
    TEST_ASSERT_TRUE(loop_scale_sensor(loop, 4, 0.9, 1.2));
    const int16_t frozen_ma = sensor[3].current_ma, frozen_mv = sensor[3].voltage_mv;
    for (int n = 0; n < 50; n++) { /* noise moves every reading but a frozen one */
        loop_tick(loop);
        TEST_ASSERT_EQUAL(CONTROLLER_SENSOR_OK, sensor[3].status);
        TEST_ASSERT_EQUAL_INT16(frozen_ma, sensor[3].current_ma);
        TEST_ASSERT_EQUAL_INT16(frozen_mv, sensor[3].voltage_mv);
    }
    TEST_ASSERT_INT16_WITHIN(20, 900.0 * loop_current_a(loop, 4), sensor[4].current_ma);
    TEST_ASSERT_INT16_WITHIN(
        8, 1200.0 * loop_current_a(loop, 4) * plant_terminal_ohm(loop_plant(loop), 4),
        sensor[4].voltage_mv);

    command(0x1BF); /* spring 7 off, its sensor at spring 8's */
    TEST_ASSERT_TRUE(loop_swap_sensors(loop, 6, 7));
    loop_advance(loop, 0.06);
    TEST_ASSERT_INT16_WITHIN(2, 0, sensor[7].current_ma);
    TEST_ASSERT_TRUE(sensor[6].current_ma > 500);
    for (int k = 0; k < 9; k++) {
        TEST_ASSERT_TRUE(loop_act(loop, LOOP_ACTION_SENSOR_GOOD, k));
    }
    loop_advance(loop, 2.0); /* the currents settle */
    for (int k = 0; k < 9; k++) {
        TEST_ASSERT_INT16_WITHIN(20, 1000.0 * loop_current_a(loop, k), sensor[k].current_ma);
    }
    TEST_ASSERT_FALSE(loop_swap_sensors(loop, 0, 9));
    TEST_ASSERT_FALSE(loop_scale_sensor(loop, -1, 1.0, 1.0));
    TEST_ASSERT_FALSE(loop_scale_sensor(loop, 0, (double)NAN, 1.0));
}

static uint32_t ticks_until_named(void)
{
    for (uint32_t ticks = 0; ticks < 200; ticks++) {
        if (controller_board_fault(loop_controller(loop)) == SAFETY_FAULT_STUCK_ON) {
            TEST_ASSERT_EQUAL(SAFETY_FAULT_STUCK_ON, controller_fault(loop_controller(loop), 4));
            for (int k = 0; k < 9; k++) {
                TEST_ASSERT_EQUAL_UINT16(0, loop_outputs(loop)->duty[k]);
            }
            return ticks;
        }
        loop_tick(loop);
    }
    TEST_FAIL_MESSAGE("not named in 4 s");
    return 0;
}

/* Driven alone, with all others, not at all; and after a stop. */
TEST(switch_that_fails_closed_is_named_within_15_ticks)
{
    static const unsigned driven[] = {0x010, 0x1FF, 0x000};
    for (unsigned n = 0; n < 6; n++) {
        start();
        command(driven[n / 2]);
        loop_advance(loop, 3.0);
        TEST_ASSERT_TRUE(loop_act(loop, LOOP_ACTION_SWITCH_CLOSED, 4));
        if (n % 2 != 0) {
            controller_emergency_stop(loop_controller(loop));
        }
        TEST_ASSERT_LESS_OR_EQUAL_UINT32(15, ticks_until_named());
        TEST_ASSERT_TRUE(loop_current_a(loop, 4) >
                         10.0);  /* nothing but the supply's switch helps */
        loop_advance(loop, 0.1); /* the cut-off opens, and `clear` does not close it */
        TEST_ASSERT_TRUE(loop_current_a(loop, 4) == 0.0);
        TEST_ASSERT_FALSE(controller_set_supply(loop_controller(loop), true));
        controller_clear_faults(loop_controller(loop));
        loop_advance(loop, 1.0);
        TEST_ASSERT_TRUE(loop_current_a(loop, 4) == 0.0);
        TEST_ASSERT_TRUE(loop_act(loop, LOOP_ACTION_SWITCH_GOOD, 4));
        TEST_ASSERT_TRUE(controller_set_supply(loop_controller(loop), true));
        loop_advance(loop, 1.0);
        TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, controller_board_fault(loop_controller(loop)));
    }
}

TEST(the_chip_believes_the_ambient_that_it_is_told)
{
    start();
    TEST_ASSERT_TRUE(loop_tell_ambient(loop, 10.0));
    TEST_ASSERT_TRUE(loop_set_ambient(loop, 30.0));
    loop_tick(loop);
    TEST_ASSERT_EQUAL_INT16(10 * 128, loop_inputs(loop)->ambient_c7);
    TEST_ASSERT_FALSE(loop_tell_ambient(loop, 1000.0));
    TEST_ASSERT_TRUE(loop_tell_ambient(loop, (double)NAN));
    loop_tick(loop);
    TEST_ASSERT_EQUAL_INT16(30 * 128, loop_inputs(loop)->ambient_c7);
}

TEST(after_a_reset_nothing_runs_until_unlocked)
{
    const loop_action_t resets[] = {LOOP_ACTION_WATCHDOG, LOOP_ACTION_BROWN_OUT};
    for (size_t r = 0; r < 2; r++) {
        start_cold();
        command(0x1FF);
        loop_advance(loop, 60.0);
        double before_c = true_c(4);
        TEST_ASSERT_TRUE(loop_act(loop, resets[r], -1));
        if (resets[r] == LOOP_ACTION_WATCHDOG) { /* what was given is kept, what is believed not */
            TEST_ASSERT_TRUE(controller_is_warm(loop_controller(loop), 4));
            TEST_ASSERT_DOUBLE_WITHIN(5.0, before_c,
                                      (double)controller_delivered_c(loop_controller(loop), 4));
        }
        command(0x1FF);
        for (int n = 0; n < 500; n++) {
            loop_tick(loop);
            TEST_ASSERT_TRUE(loop_sum_current_a(loop) == 0.0);
            for (int k = 0; k < 9; k++) { /* never taken to be certainly colder than they are */
                TEST_ASSERT_TRUE(hottest_c(k) > true_c(k) - 0.5);
            }
        }
        TEST_ASSERT_TRUE(controller_is_locked(loop_controller(loop)));
        controller_unlock(loop_controller(loop));
        loop_advance(loop, 1.0);
        TEST_ASSERT_TRUE(loop_sum_current_a(loop) == 0.0);
        command(0x1FF);
        loop_advance(loop, 2.0);
        TEST_ASSERT_DOUBLE_WITHIN(0.03, 1.5, loop_current_a(loop, 4));
    }
}

TEST(ambient_reaches_plant_and_chip_with_its_error)
{
    loop_options_t options;
    loop_options_default(&options);
    options.ambient_error_c = 3.0;
    start_with(&options, 1);
    TEST_ASSERT_EQUAL_INT16(23 * 128, loop_inputs(loop)->ambient_c7); /* before any tick */
    TEST_ASSERT_TRUE(loop_set_ambient(loop, 30.0));
    TEST_ASSERT_FALSE(loop_set_ambient(loop, 1000.0));
    loop_tick(loop);
    TEST_ASSERT_EQUAL_INT16(33 * 128, loop_inputs(loop)->ambient_c7);
    TEST_ASSERT_EQUAL(CONTROLLER_SENSOR_OK, loop_inputs(loop)->sensor[0].status); /* at power-up */
    loop_advance(loop, 1000.0 - LOOP_TICK_S);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 30.0, true_c(4));
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 33.0, chip_c(4));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1000.0, loop_time_s(loop));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1000.0, plant_time_s(loop_plant(loop)));
}

TEST(what_does_not_fit_is_refused)
{
    uint16_t bad = 0;
    loop_options_t options;
    loop_options_default(&options);
    options.plant_ticks = 0;
    TEST_ASSERT_NULL(loop_create(&settings, plant, &options, 1, &bad));
    TEST_ASSERT_EQUAL_UINT16(UINT16_MAX, bad);
    options.plant_ticks = 6;
    TEST_ASSERT_NULL(loop_create(&settings, plant, &options, 1, NULL));
    loop_options_default(&options);
    options.sensor_samples = 3;
    TEST_ASSERT_NULL(loop_create(&settings, plant, &options, 1, NULL));
    loop_options_default(&options);
    options.ambient_error_c = NAN;
    TEST_ASSERT_NULL(loop_create(&settings, plant, &options, 1, NULL));
    controller_settings_t wrong = settings;
    wrong.model.rows = 2;
    TEST_ASSERT_NULL(loop_create(&wrong, plant, NULL, 1, &bad));
    TEST_ASSERT_EQUAL_UINT16(PARAMETER_rows, bad);
    wrong = settings;
    wrong.safety.bad_samples = 0;
    TEST_ASSERT_NULL(loop_create(&wrong, plant, NULL, 1, &bad));
    TEST_ASSERT_EQUAL_UINT16(PARAMETER_fault_bad_samples, bad);
    start();
    TEST_ASSERT_FALSE(loop_act(loop, LOOP_ACTION_OPEN_SPRING, 9));
    TEST_ASSERT_FALSE(loop_act(loop, LOOP_ACTION_OPEN_SPRING, -1));
    TEST_ASSERT_FALSE(loop_act(loop, LOOP_ACTION_COUNT, 0));
    TEST_ASSERT_TRUE(loop_current_a(loop, 9) == 0.0);
}
