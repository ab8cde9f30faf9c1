/* The drive policy against the simulated array: what the springs do, not what the chip believes. */
#include <math.h>

#include "loop.h"
#include "unity.h"

#define SPRINGS 9
#define CENTRE  4

static controller_settings_t settings;
static loop_options_t options;
static plant_t *plant;
static loop_t *loop;

void setUp(void)
{
    controller_settings_default(&settings);
    settings.policy.policy = DRIVE_POLICY_PRECOMPENSATE;
    loop_options_default(&options);
    plant = plant_create(3, 3);
    plant_set_effect(plant, "latent_heat", true);
    plant_set_effect(plant, "resistance_phase", true);
    plant_set(plant, "orthogonal_w_per_k", 586e-6);
    plant_set(plant, "diagonal_w_per_k", 293e-6);
    loop = NULL;
}

void tearDown(void)
{
    loop_destroy(loop);
    plant_destroy(plant);
}

static void start(void)
{
    loop = loop_create(&settings, plant, &options, 5, NULL);
    TEST_ASSERT_NOT_NULL(loop);
}

static void want(int spring, uint16_t permille)
{
    TEST_ASSERT_TRUE(controller_set_target(loop_controller(loop), (uint8_t)spring, permille));
}

static void want_all_but(int spring)
{
    for (int k = 0; k < SPRINGS; k++) {
        want(k, k == spring ? 0 : 1000);
    }
}

/* Advances and returns the highest temperature; the supply's limit holds in every tick. */
static double run(double seconds)
{
    double highest_c = -100.0;
    for (long n = lround(seconds / LOOP_TICK_S); n > 0; n--) {
        loop_tick(loop);
        TEST_ASSERT_TRUE(loop_sum_current_a(loop) <= 15.0);
        for (int k = 0; k < SPRINGS; k++) {
            highest_c = fmax(highest_c, plant_temperature_c(loop_plant(loop), k));
        }
    }
    return highest_c;
}

static double phase(int spring)
{
    return plant_austenite(loop_plant(loop), spring);
}

static double temperature(int spring)
{
    return plant_temperature_c(loop_plant(loop), spring);
}

static bool is_blind(int spring)
{
    return (controller_limits(loop_controller(loop), (uint8_t)spring) & DRIVE_POLICY_LIMIT_BLIND) !=
           0;
}

static void eight_are_held_in_the_band_and_the_centre_stays_cold(void)
{
    start();
    want_all_but(CENTRE);
    TEST_ASSERT_TRUE(run(400.0) < 106.0);
    for (int k = 0; k < SPRINGS; k++) {
        if (k != CENTRE) {
            TEST_ASSERT_TRUE(phase(k) > 0.98);
            TEST_ASSERT_TRUE(temperature(k) > 77.0 && temperature(k) < 84.0);
        }
    }
    TEST_ASSERT_TRUE(phase(CENTRE) < 0.01);
    TEST_ASSERT_TRUE(temperature(CENTRE) < 44.5);
}

static void held_spring_does_not_feel_its_neighbours(void)
{
    start();
    want(CENTRE, 1000);
    run(400.0);
    double alone_c = temperature(CENTRE);
    want_all_but(-1);
    for (int n = 0; n < 60; n++) {
        run(5.0);
        TEST_ASSERT_DOUBLE_WITHIN(3.0, alone_c, temperature(CENTRE));
    }
    TEST_ASSERT_TRUE(phase(CENTRE) > 0.98);
}

static void all_nine_transform_in_turn_within_the_supply(void)
{
    start();
    want_all_but(-1);
    run(90.0);
    for (int k = 0; k < SPRINGS; k++) {
        TEST_ASSERT_TRUE(phase(k) > 0.99);
    }
}

static void toggling_at_any_period_stays_within_the_limits(void)
{
    static const double period_s[] = {0.1, 0.7, 3.0, 10.0, 40.0, 120.0, 300.0};
    start();
    for (unsigned n = 0; n < sizeof period_s / sizeof period_s[0]; n++) {
        double left_s = period_s[n] < 40.0 ? 120.0 : 2.0 * period_s[n];
        for (bool even = true; left_s > 0.0; even = !even, left_s -= period_s[n] / 2.0) {
            for (int k = 0; k < SPRINGS; k++) {
                want(k, (k % 2 == 0) == even ? 1000 : 0);
            }
            TEST_ASSERT_TRUE(run(period_s[n] / 2.0) < 115.0);
        }
    }
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, controller_board_fault(loop_controller(loop)));
}

static void heats_and_holds_an_alloy_whose_resistance_falls(void)
{
    plant_set(plant, "resistance_martensite_ohm", 0.219);
    plant_set(plant, "resistance_austenite_ohm", 0.175);
    settings.model.resistance_martensite_uohm = 219000;
    settings.model.resistance_austenite_uohm = 175000;
    start();
    want(CENTRE, 1000);
    TEST_ASSERT_TRUE(run(400.0) < 110.0);
    TEST_ASSERT_TRUE(phase(CENTRE) > 0.98);
    TEST_ASSERT_FALSE(is_blind(CENTRE));
    TEST_ASSERT_TRUE(temperature(CENTRE) < 84.0);
}

static void wrong_sign_of_the_resistance_falls_back_to_the_model(void)
{
    plant_set(plant, "resistance_martensite_ohm", 0.219);
    plant_set(plant, "resistance_austenite_ohm", 0.175);
    start(); /* the chip believes that it rises */
    want(CENTRE, 1000);
    TEST_ASSERT_TRUE(run(300.0) < 115.0);
    TEST_ASSERT_TRUE(phase(CENTRE) > 0.98);
    TEST_ASSERT_TRUE(is_blind(CENTRE));
    TEST_ASSERT_TRUE(temperature(CENTRE) > 87.0 && temperature(CENTRE) < 93.0); /* wider margin */
}

static void resistance_that_never_changes_falls_back_to_the_model(void)
{
    plant_set_effect(plant, "resistance_phase", false);
    start();
    want(CENTRE, 1000);
    TEST_ASSERT_TRUE(run(300.0) < 125.0); /* the model is the only one to ask, and asked late */
    TEST_ASSERT_TRUE(phase(CENTRE) > 0.98);
    TEST_ASSERT_TRUE(is_blind(CENTRE));
}

static void noisy_voltage_is_not_believed(void)
{
    options.bus_noise_v = 0.2;
    start();
    want(CENTRE, 1000);
    TEST_ASSERT_TRUE(run(300.0) < 115.0);
    TEST_ASSERT_TRUE(phase(CENTRE) > 0.98);
    TEST_ASSERT_TRUE(is_blind(CENTRE));
}

static void half_a_level_is_half_a_phase(void)
{
    start();
    want(CENTRE, 500);
    run(150.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 0.5, phase(CENTRE));
    TEST_ASSERT_FALSE(is_blind(CENTRE));
    want(CENTRE, 250);
    run(100.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 0.25, phase(CENTRE));
    want(CENTRE, 800);
    run(100.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 0.8, phase(CENTRE));
}

static void policy_is_switched_without_a_jump(void)
{
    start();
    want_all_but(CENTRE);
    for (int n = 0; n < 8; n++) {
        run(7.3 * n);
        TEST_ASSERT_TRUE(controller_set_policy(
            loop_controller(loop), n % 2 == 0 ? DRIVE_POLICY_OPEN : DRIVE_POLICY_PRECOMPENSATE));
        for (int tick = 0; tick < 100; tick++) {
            double before_a[SPRINGS];
            for (int k = 0; k < SPRINGS; k++) {
                before_a[k] = loop_current_a(loop, k);
            }
            run(LOOP_TICK_S);
            for (int k = 0; k < SPRINGS; k++) {
                TEST_ASSERT_DOUBLE_WITHIN(0.12, before_a[k], loop_current_a(loop, k));
            }
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(eight_are_held_in_the_band_and_the_centre_stays_cold);
    RUN_TEST(held_spring_does_not_feel_its_neighbours);
    RUN_TEST(all_nine_transform_in_turn_within_the_supply);
    RUN_TEST(toggling_at_any_period_stays_within_the_limits);
    RUN_TEST(heats_and_holds_an_alloy_whose_resistance_falls);
    RUN_TEST(wrong_sign_of_the_resistance_falls_back_to_the_model);
    RUN_TEST(resistance_that_never_changes_falls_back_to_the_model);
    RUN_TEST(noisy_voltage_is_not_believed);
    RUN_TEST(half_a_level_is_half_a_phase);
    RUN_TEST(policy_is_switched_without_a_jump);
    return UNITY_END();
}
