/* The drive policy against the simulated array: what the springs do, not what the chip believes. */
#include <math.h>
#include <stdio.h>

#include "../run_tests.h"
#include "loop.h"

#define SPRINGS   9
#define CENTRE    4
#define HOTTEST_C 120.0 /* that any spring may ever be */

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
    loop = NULL;
}

void tearDown(void)
{
    loop_destroy(loop);
    plant_destroy(plant);
}

/* The power comes on. Nothing is known of any spring. */
static void power_on(void)
{
    loop_destroy(loop);
    loop = loop_create(&settings, plant, &options, 5, NULL);
    TEST_ASSERT_NOT_NULL(loop);
}

/* With the hint `model cold`, where a test is not about how it begins: a spring heats at once. */
static void start_cold(void)
{
    power_on();
    controller_set_temperature(loop_controller(loop), 20 * 128);
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

/* In every tick of every test: what is asked of the supply is within its limit less the reserve,
 * what flows is within its limit but for an overshoot of 1 % while loops settle (safety trips after
 * five such ticks), and a spring that is not to be driven gets nothing. */
static void check_tick(void)
{
    const controller_t *controller = loop_controller(loop);
    unsigned limit_ma = settings.safety.supply_limit_ma;
    unsigned sum_ma = 0;
    for (uint8_t k = 0; k < SPRINGS; k++) {
        unsigned target_ma = controller_target_ma(controller, k);
        sum_ma += target_ma;
        TEST_ASSERT_LESS_OR_EQUAL_UINT(settings.current.maximum_current_ma, target_ma);
        if (controller_level_permille(controller, k) == 0) {
            TEST_ASSERT_EQUAL_UINT(0, target_ma);
        }
    }
    TEST_ASSERT_LESS_OR_EQUAL_UINT(limit_ma - settings.policy.supply_reserve_ma, sum_ma);
    TEST_ASSERT_TRUE(loop_sum_current_a(loop) <= 1.01 * limit_ma / 1000.0);
}

/* Advances and returns the highest temperature of any spring. */
static double run(double seconds)
{
    double highest_c = -100.0;
    for (long n = lround(seconds / LOOP_TICK_S); n > 0; n--) {
        loop_tick(loop);
        check_tick();
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

static bool limited_by(int spring, drive_policy_limit_t limit)
{
    return (controller_limits(loop_controller(loop), (uint8_t)spring) & limit) != 0;
}

static bool is_blind(int spring)
{
    return limited_by(spring, DRIVE_POLICY_LIMIT_BLIND);
}

static void expect_in_the_band(int spring)
{
    TEST_ASSERT_TRUE(phase(spring) > 0.98);
    TEST_ASSERT_TRUE(temperature(spring) > 77.0 && temperature(spring) < 84.0);
}

static safety_fault_t fault(int spring)
{
    return controller_fault(loop_controller(loop), (uint8_t)spring);
}

/* From power-on, all but the centre; gives the highest temperature. */
static double hold_eight(double seconds)
{
    plant_reset(plant);
    power_on();
    want_all_but(CENTRE);
    const double highest_c = run(seconds);
    for (int k = 0; k < SPRINGS; k++) {
        row((size_t)k);
        TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, fault(k));
        if (k != CENTRE) {
            expect_in_the_band(k);
            TEST_ASSERT_FALSE(is_blind(k));
            TEST_ASSERT_DOUBLE_WITHIN(3.0, temperature(k),
                                      controller_temperature_c7(loop_controller(loop), (uint8_t)k) /
                                          128.0);
        }
    }
    TEST_ASSERT_TRUE(phase(CENTRE) < 0.01);
    return highest_c;
}

TEST(eight_are_held_in_the_band_and_the_centre_stays_cold)
{
    TEST_ASSERT_TRUE(hold_eight(400.0) < 106.0);
    TEST_ASSERT_TRUE(temperature(CENTRE) < 44.5);
}

/* In a declared array what the search for martensite start costs is no more than 2 % of the phase:
 * it goes as slowly as the average that shows a loss follows. */
TEST(search_costs_a_declared_array_no_more_than_a_fiftieth)
{
    static const unsigned patterns[] = {0777, 0066, 0074, 0252};
    for (size_t n = 0; n < ROWS(patterns); n++) {
        row(n);
        plant_reset(plant);
        start_cold();
        for (int k = 0; k < SPRINGS; k++) {
            want(k, (patterns[n] >> k & 1u) != 0 ? 1000 : 0);
        }
        run(110.0);
        for (int second = 0; second < 140; second++) {
            run(1.0);
            for (int k = 0; k < SPRINGS; k++) {
                TEST_ASSERT_TRUE((patterns[n] >> k & 1u) == 0 || phase(k) > 0.98);
            }
        }
    }
}

/* A cloth on the display in mid-hold: what all springs lose falls to a third or to less than a
 * half, and it is lifted again. Each believed alone, they end between 130 and 330 degC; so, over
 * eight seeds of noise, at 109 to 129. Corners may not come back at once (a fifth of all springs
 * from a third of the loss, a tenth from the other, over the same): that is said. */
TEST(cloth_that_lies_on_the_display_is_noticed)
{
    static const double left[] = {0.3, 0.45};
    for (size_t n = 0; n < ROWS(left); n++) {
        plant_reset(plant);
        plant_set(plant, "loss_w_per_k", 5.8e-3);
        plant_set_effect(plant, "resistance_temperature", true);
        plant_set(plant, "resistance_martensite_rise_per_k", 0.0008);
        plant_set(plant, "resistance_austenite_rise_per_k", 0.0006);
        power_on();
        want_all_but(CENTRE);
        (void)run(350.0);
        plant_set(loop_plant(loop), "loss_w_per_k", left[n] * 5.8e-3);
        const double highest_c = run(600.0);
        here("%.1f degC under the cloth", highest_c);
        TEST_ASSERT_TRUE(highest_c < 130.0);
        plant_set(loop_plant(loop), "loss_w_per_k", 5.8e-3);
        const double lifted_c = run(300.0);
        here("%.1f, then %.1f degC", highest_c, lifted_c);
        TEST_ASSERT_TRUE(lifted_c < 130.0);
        int away = 0;
        for (int k = 0; k < SPRINGS; k++) {
            if (k != CENTRE && phase(k) <= 0.9) {
                row((size_t)k);
                TEST_ASSERT_TRUE(limited_by(k, DRIVE_POLICY_LIMIT_AWAY));
                away++;
            }
        }
        TEST_ASSERT_LESS_OR_EQUAL(1, away);
    }
}

/* A step of the duty moves the spring's voltage by as much as its sensor's, to a hundredth, so that
 * the sweep averages no step away: taken for lost phase, springs were heated to 145 degC. A reheat
 * that it still begins ends 5 K too hot at the most. */
TEST(duty_steps_that_are_the_sensors_lose_no_phase)
{
    static const double circuits[][3] = {{5.4, 0.18, 0.26}, {5.0, 0.163, 0.26}, {5.0, 0.15, 0.248}};
    plant_set_effect(plant, "supply_sag", true);
    plant_set(plant, "supply_resistance_ohm", 0.05);
    plant_set(plant, "freewheel_drop_v", 0.3);
    plant_set(plant, "resistance_martensite_ohm", 0.179);
    settings.current.freewheel_mv = 300;
    options.bus_noise_v = 0.0007;
    for (size_t n = 0; n < sizeof circuits / sizeof circuits[0]; n++) {
        row(n);
        plant_set(plant, "supply_v", circuits[n][0]);
        plant_set(plant, "loop_resistance_ohm", circuits[n][1]);
        plant_set(plant, "resistance_austenite_ohm", circuits[n][2]);
        plant_reset(plant);
        power_on();
        for (int k = 0; k < SPRINGS; k++) {
            want(k, 1000);
        }
        TEST_ASSERT_TRUE(run(700.0) < HOTTEST_C + 5.0);
    }
}

/* At either end of what is declared. */
TEST(another_supply_is_no_fault)
{
    for (double supply_v = 4.2; supply_v < 6.0; supply_v += 1.3) {
        plant_set(plant, "supply_v", supply_v);
        TEST_ASSERT_TRUE(hold_eight(400.0) < HOTTEST_C);
    }
}

/* A driven one, and one that is off: then current where nothing is driven switches all off, before
 * the other is named. */
TEST(sensors_that_are_swapped_switch_their_springs_off_in_two_seconds)
{
    for (int other = 1; other <= CENTRE; other += CENTRE - 1) {
        power_on();
        want_all_but(CENTRE);
        (void)run(200.0);
        TEST_ASSERT_TRUE(loop_swap_sensors(loop, 0, other));
        loop_advance(loop, 2.0);
        TEST_ASSERT_TRUE(fault(other) != SAFETY_FAULT_NONE);
        TEST_ASSERT_TRUE(fault(0) != SAFETY_FAULT_NONE || fault(other) == SAFETY_FAULT_STUCK_ON);
        TEST_ASSERT_EQUAL_UINT16(0, controller_duty(loop_controller(loop), 0));
        TEST_ASSERT_EQUAL_UINT16(0, controller_duty(loop_controller(loop), (uint8_t)other));
    }
}

/* Within what can be a circuit, and bounded: a fifth too little of either. */
TEST(a_sensor_that_shows_a_fifth_too_little_overheats_nothing)
{
    power_on();
    want_all_but(CENTRE);
    TEST_ASSERT_TRUE(loop_scale_sensor(loop, 0, 0.8, 0.8));
    TEST_ASSERT_TRUE(run(300.0) < HOTTEST_C);
}

/* Its one converter's reference fails, so that both of what it reads fall: a supply that falls
 * reads alike, and with so few others nobody outvotes it (142 to 178 degC, nothing said). */
TEST(a_sensor_of_which_both_readings_fall_in_a_hold_is_told_from_a_supply_that_falls)
{
    static const double lies[][2] = {{0.82, 0.80}, {0.86, 0.84}, {0.75, 0.77}};
    for (int driven = 1; driven <= 3; driven++) {
        for (size_t n = 0; n < sizeof lies / sizeof lies[0]; n++) {
            row(n);
            plant_reset(plant);
            power_on();
            for (int k = 0; k < driven; k++) {
                want(3 * k, 1000);
            }
            TEST_ASSERT_TRUE(run(195.0) < HOTTEST_C);
            TEST_ASSERT_TRUE(loop_scale_sensor(loop, 0, lies[n][0], lies[n][1]));
            TEST_ASSERT_TRUE(run(60.0) < HOTTEST_C);
            TEST_ASSERT_EQUAL(SAFETY_FAULT_SENSOR_MISMATCH, fault(0));
            TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, fault(driven > 1 ? 3 : 1));
        }
    }
}

/* A twelfth less at once, under one spring alone; a seventh under two. */
TEST(a_supply_that_falls_is_no_lie_of_a_sensor)
{
    for (int driven = 1; driven <= 2; driven++) {
        plant_reset(plant);
        power_on();
        for (int k = 0; k < driven; k++) {
            want(3 * k, 1000);
        }
        TEST_ASSERT_TRUE(run(150.0) < HOTTEST_C);
        plant_set(plant, "supply_v", driven == 1 ? 4.6 : 4.3);
        TEST_ASSERT_TRUE(run(60.0) < HOTTEST_C);
        TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, fault(0));
        TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, fault(3));
    }
}

/* Power goes and comes back, and what was learnt is told anew: of springs that it may have left
 * warm, or of cold ones. */
static void cut_power(double seconds, bool warm)
{
    controller_t *const controller = loop_controller(loop);
    spring_learnt_t learnt[SPRINGS];
    for (uint8_t k = 0; k < SPRINGS; k++) {
        want(k, 0);
        learnt[k] = controller_to_keep(controller, k);
    }
    loop_advance(loop, seconds);
    TEST_ASSERT_TRUE(controller_init(controller, &settings, 20 * 128, NULL));
    for (uint8_t k = 0; k < SPRINGS; k++) {
        controller_restore_learnt(controller, k, &learnt[k]);
    }
    if (warm) {
        controller_doubt_cold(controller);
    }
}

/* A plug that falls out takes a crimp along, or a sensor is exchanged: hot austenite then reads as
 * its martensite did (175 degC, were that believed), and cold martensite as its austenite (shown as
 * on for minutes). Neither is believed; what did not change is held at once. */
TEST(a_circuit_that_another_one_is_since_the_power_went_tells_no_phase)
{
    static const struct {
        double before, after, off_s;
        bool warm;
    } table[] = {{0.8, 1.0, 1.0, true}, {0.9, 1.0, 1.0, true}, {1.0, 0.8, 300.0, false}};
    for (size_t n = 0; n < sizeof table / sizeof table[0]; n++) {
        row(n);
        plant_reset(plant);
        power_on();
        TEST_ASSERT_TRUE(loop_scale_sensor(loop, 0, table[n].before, 1.0));
        want_all_but(CENTRE);
        TEST_ASSERT_TRUE(run(300.0) < HOTTEST_C);
        cut_power(table[n].off_s, table[n].warm);
        TEST_ASSERT_TRUE(loop_scale_sensor(loop, 0, table[n].after, 1.0));
        want_all_but(CENTRE);
        TEST_ASSERT_TRUE(run(15.0) < HOTTEST_C);
        TEST_ASSERT_EQUAL(table[n].warm, phase(1) > 0.95);
        TEST_ASSERT_TRUE(limited_by(0, DRIVE_POLICY_LIMIT_COOLING) ||
                         fault(0) != SAFETY_FAULT_NONE);
        TEST_ASSERT_TRUE(run(105.0) < HOTTEST_C);
        TEST_ASSERT_TRUE(phase(0) > 0.98 || fault(0) != SAFETY_FAULT_NONE);
    }
}

/* A sensor shows half of its current as the power goes, again and again: what reads twice its
 * austenite is none, and waits. Each look heated it once more, to 233 degC. */
TEST(what_reads_twice_its_austenite_as_power_comes_back_is_not_heated)
{
    power_on();
    want(CENTRE, 1000);
    TEST_ASSERT_TRUE(run(300.0) < HOTTEST_C);
    TEST_ASSERT_TRUE(loop_scale_sensor(loop, CENTRE, 0.5, 1.0));
    for (int cut = 0; cut < 6; cut++) {
        cut_power(1.0, true);
        want(CENTRE, 1000);
        const double hottest_c = run(4.0);
        here("cut %d: %.1f degC", cut, hottest_c);
        TEST_ASSERT_TRUE(hottest_c < HOTTEST_C);
    }
}

/* Neither sign nor size of the declared change is believed: what is seen is learnt. */
TEST(change_of_resistance_is_learnt_whatever_is_declared)
{
    for (unsigned n = 1; n < 4; n++) { /* it falls, a fall is declared, or both */
        plant_set(plant, "resistance_martensite_ohm", (n & 1u) != 0 ? 0.219 : 0.175);
        plant_set(plant, "resistance_austenite_ohm", (n & 1u) != 0 ? 0.175 : 0.219);
        settings.model.resistance_martensite_uohm = (n & 2u) != 0 ? 219000 : 175000;
        settings.model.resistance_austenite_uohm = (n & 2u) != 0 ? 175000 : 219000;
        plant_reset(plant);
        power_on();
        want(CENTRE, 1000);
        TEST_ASSERT_TRUE(run(400.0) < 115.0);
        TEST_ASSERT_TRUE(phase(CENTRE) > 0.98);
        TEST_ASSERT_FALSE(is_blind(CENTRE));
        TEST_ASSERT_TRUE(temperature(CENTRE) < 84.0);
    }
}

/* Whichever way it came there, and never fully on: by its own martensite's resistance. */
TEST(levels_one_after_the_other_are_held)
{
    static const uint16_t levels[] = {500, 250, 800, 400, 600};
    for (int n = 0; n < 3; n++) {
        plant_set(plant, "loss_w_per_k", 5.8e-3 * (0.85 + 0.15 * n));
        plant_reset(plant);
        start_cold();
        for (unsigned j = 0; j < ROWS(levels); j++) {
            want(CENTRE, levels[j]);
            (void)run(120.0);
            here("loss %d, %u permille: %.3f", n, levels[j], phase(CENTRE));
            TEST_ASSERT_DOUBLE_WITHIN(0.1, 0.001 * levels[j], phase(CENTRE));
        }
    }
}

/* Springs 1 and 9 are never driven, the others in two gangs against each other. */
static void toggle(double period_s, double seconds, double limit_c)
{
    double left_s = fmax(seconds, 2.0 * period_s);
    for (bool even = true; left_s > 0.0; even = !even, left_s -= period_s / 2.0) {
        for (int k = 1; k < SPRINGS - 1; k++) {
            want(k, (k % 2 == 0) == even ? 1000 : 0);
        }
        TEST_ASSERT_TRUE(run(period_s / 2.0) < limit_c);
        TEST_ASSERT_TRUE(phase(0) < 0.01 && phase(SPRINGS - 1) < 0.01);
    }
}

/* As declared, and an array that is not the declared one. */
TEST(toggling_at_any_period_stays_within_the_limits)
{
    static const double period_s[] = {0.1,  0.3,  0.7,  1.5,   3.0,  10.0,
                                      20.0, 40.0, 80.0, 120.0, 300.0};
    for (int other = 0; other < 2; other++) {
        for (int k = 0; k < SPRINGS && other; k++) {
            char name[40];
            double sign = k % 2 == 0 ? 1.0 : -1.0;
            (void)snprintf(name, sizeof name, "heat_capacity_j_per_k[%d]", k + 1);
            plant_set(plant, name, 0.300 * (1.0 - 0.15 * sign));
            (void)snprintf(name, sizeof name, "loss_w_per_k[%d]", k + 1);
            plant_set(plant, name, 5.8e-3 * (1.0 + 0.15 * sign));
        }
        plant_set(plant, "orthogonal_w_per_k", 586e-6 * (other ? 1.15 : 1.0));
        options.ambient_error_c = other ? -3.0 : 0.0;
        plant_reset(plant);
        power_on();
        for (unsigned n = 0; n < ROWS(period_s); n++) {
            toggle(period_s[n], 120.0, HOTTEST_C);
        }
        for (int k = 0; k < SPRINGS; k++) {
            TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, fault(k));
        }
    }
}

/* ---- release and return ---- */

/* The message has two numbers that say which case it is, and the phase. */
static void check_full_in_a_minute(const char *format, double first, double second)
{
    want(CENTRE, 1000);
    run(60.0);
    here(format, first, second, phase(CENTRE));
    TEST_ASSERT_TRUE(phase(CENTRE) > 0.98);
}

TEST(spring_switched_on_again_after_seconds_is_austenite_again)
{
    for (int alone = 0; alone < 2; alone++) {
        for (double off_s = 0.02; off_s <= 200.0; off_s = 1.3 * off_s + 1.0) {
            start_cold();
            want_all_but(-1);
            for (int k = 0; alone && k < SPRINGS; k++) {
                want(k, k == CENTRE ? 1000 : 0);
            }
            run(120.0);
            want(CENTRE, 0);
            run(off_s);
            check_full_in_a_minute("alone %.0f off %.0f s: phase %.3f", alone, off_s);
        }
    }
}

/* From a level the phase goes on only where it left the transformation. */
TEST(full_is_reached_from_any_level_at_any_moment)
{
    for (uint16_t level = 300; level <= 800; level = (uint16_t)(level + 250u)) {
        for (double from_s = 80.0; from_s < 290.0; from_s += 14.0) {
            plant_reset(plant);
            start_cold();
            want(CENTRE, level);
            run(from_s);
            check_full_in_a_minute("level %.0f for %.0f s: phase %.3f", level, from_s);
        }
    }
}

/* Whose losses or change are not as declared (a sixth; 10, 25 or 37 %) comes to the level that it
 * is asked for first, as it goes by what it showed on its way through fully on; and from there to
 * fully on, by its own resistances and by what it loses as it is held. No model's guess does: of an
 * array that loses a sixth more, austenite was said to be 100 % and was none. */
TEST(level_is_reached_first_and_then_full_whatever_is_lost_or_changes)
{
    static const double austenite_ohm[] = {0.1925, 0.2188, 0.24};
    plant_set(plant, "resistance_martensite_ohm", 0.175);
    for (int n = 0; n < 27; n++) {
        const unsigned level = 300u + 250u * (unsigned)(n % 3);
        plant_set(plant, "loss_w_per_k", 5.8e-3 * (0.83 + 0.17 * (n / 3 % 3)));
        plant_set(plant, "resistance_austenite_ohm", austenite_ohm[n / 9]);
        plant_reset(plant);
        power_on();
        want(CENTRE, (uint16_t)level);
        TEST_ASSERT_TRUE(run(300.0) < HOTTEST_C);
        here("row %d, level %u permille: phase %.3f", n, level, phase(CENTRE));
        TEST_ASSERT_DOUBLE_WITHIN(0.065, 0.001 * level, phase(CENTRE));
        want(CENTRE, 1000);
        TEST_ASSERT_TRUE(run(240.0) < 112.0);
        here("row %d, level %u permille, then fully: phase %.3f", n, level, phase(CENTRE));
        TEST_ASSERT_TRUE(phase(CENTRE) > (n < 9 ? 0.85 : 0.95)); /* it changes by 10 % */
    }
}

/* It no longer tells anything: the search finds no martensite start. It goes on until no array
 * loses so little: the margin of 8 K and one below at 0.06 K/s, then 2.6 standard deviations of
 * 12 % of 58 K, 18 K, at the 0.06 K/s at which the hold is corrected: 450 s. Then it is said, and
 * it was never hot. */
static void check_stuck_resistance(double ohm)
{
    start_cold();
    want(CENTRE, 1000);
    run(60.0);
    plant_set(loop_plant(loop), "resistance_martensite_ohm[5]", ohm);
    plant_set(loop_plant(loop), "resistance_austenite_ohm[5]", ohm + 1e-6);
    TEST_ASSERT_TRUE(run(450.0) < HOTTEST_C);
    for (int n = 0; n < 750; n++) {
        TEST_ASSERT_TRUE(run(1.0) < HOTTEST_C);
        TEST_ASSERT_TRUE(phase(CENTRE) > 0.9 || is_blind(CENTRE) ||
                         limited_by(CENTRE, DRIVE_POLICY_LIMIT_AWAY));
    }
}

TEST(resistance_that_sticks_in_a_hold_is_not_passed_over)
{
    check_stuck_resistance(0.219); /* austenite's */
    check_stuck_resistance(0.175); /* martensite's */
    check_stuck_resistance(0.190);
}

/* ---- all together ---- */

static uint32_t random_state;

static uint32_t random_below(uint32_t limit)
{
    random_state = random_state * 1664525u + 1013904223u;
    return (random_state >> 8) % limit;
}

/* The hottest that any spring comes while policies, fan and levels are drawn. */
static double hottest_of_everything(uint32_t seed)
{
    double hottest_c = 0.0;
    random_state = seed;
    options.ambient_error_c = 2.0;
    power_on();
    controller_t *controller = loop_controller(loop);
    for (int n = 0; n < 1500; n++) {
        switch (random_below(8)) {
        case 0:
            controller_set_policy(controller, (drive_policy_kind_t)random_below(2));
            break;
        case 1:
            controller_set_fan(controller, (uint8_t)(100 * random_below(2)));
            break;
        case 2:
            want_all_but((int)random_below(SPRINGS));
            break;
        default:
            want((int)random_below(SPRINGS), (uint16_t)(250 * random_below(5)));
            break;
        }
        hottest_c = fmax(hottest_c, run(0.02 * random_below(300)));
    }
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, controller_board_fault(controller));
    return hottest_c;
}

/* Of five draws, each more than an hour long: most below 120 degC, none far above. Thousands,
 * shorter and with faults: bench_swarm, test/worlds. */
TEST(everything_at_once_stays_within_the_limits)
{
    unsigned hot = 0;
    for (uint32_t seed = 11; seed < 16; seed++) {
        const double hottest_c = hottest_of_everything(seed);
        here("draw %u: %.1f degC", (unsigned)seed, hottest_c);
        TEST_ASSERT_TRUE(hottest_c < 135.0);
        hot += hottest_c > 120.0;
    }
    TEST_ASSERT_LESS_OR_EQUAL_UINT(2, hot);
}
