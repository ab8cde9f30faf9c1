/* The current loop against a resistive load behind an averaged buck stage and a sensor that is one
 * tick old, two, or a mean of both (conversions that straddle the tick). */
#include <limits.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "../run_tests.h"
#include "current_control.h"

/* What lies behind it is nobody's to write. */
static struct {
    current_control_t control;
    uint8_t behind[64];
} owned;
#define control owned.control
static current_control_parameters_t parameters;

/* One channel's load. Currents in nA so that whole steps and their means are exact enough. */
typedef struct {
    int32_t supply_mv;
    int32_t freewheel_mv;
    int32_t spring_mohm; /* below 0: open */
    int32_t loop_mohm;
    int32_t old_percent; /* of the sensor's mean is of the tick before the last */
    int32_t now_ua, before_ua;
} load_t;

static load_t load;

void setUp(void)
{
    current_control_parameters_default(&parameters);
    TEST_ASSERT_TRUE(current_control_init(&control, &parameters, NULL));
    load = (load_t){.supply_mv = 5000, .spring_mohm = 190, .loop_mohm = 180};
}

static int16_t sensed_ma(void)
{
    int32_t ua = (load.old_percent * (load.before_ua / 100)) +
                 ((100 - load.old_percent) * (load.now_ua / 100));
    ua = ua > 3200000 ? 3200000 : ua;
    return (int16_t)((ua + 500) / 1000);
}

static void give(uint16_t duty)
{
    load.before_ua = load.now_ua;
    int64_t mean_nv = (int64_t)duty * load.supply_mv * 1250 -
                      (int64_t)(800 - duty) * load.freewheel_mv * 1250; /* / 800 x 10^6 */
    load.now_ua = (duty == 0 || load.spring_mohm < 0 || mean_nv < 0)
                      ? 0
                      : (int32_t)(mean_nv / (load.spring_mohm + load.loop_mohm));
}

static uint16_t tick_with(uint16_t target_ma, uint16_t estimate_mohm, bool valid, bool may_rise)
{
    current_control_set_resistance(&control, 0, estimate_mohm);
    int16_t measured_ma = sensed_ma();
    uint16_t duty;
    current_control_tick(&control, 1, &target_ma, &measured_ma, &valid, may_rise, &duty);
    give(duty);
    return duty;
}

static uint16_t tick(uint16_t target_ma)
{
    return tick_with(target_ma, 190, true, true);
}

static int32_t mean_ua(uint16_t target_ma, int ticks)
{
    int64_t sum = 0;
    for (int n = 0; n < ticks; n++) {
        tick(target_ma);
        sum += load.now_ua;
    }
    return (int32_t)(sum / ticks);
}

/* Ticks from off until the reference is at the target: doubled in every second tick, by two ticks
 * of the slew at most. One more until the channel has its turn. */
static int ramp_ticks(uint16_t target_ma)
{
    int ticks = 0;
    int reference_ma = 0;
    for (; reference_ma < target_ma; ticks += 2) {
        int rise_ma = reference_ma == 0 ? 128 : reference_ma;
        int most_ma = 2 * parameters.slew_ma_per_tick;
        reference_ma += rise_ma < most_ma ? rise_ma : most_ma;
    }
    return ticks;
}

/* One step from off: at most 40 mA too much, and within 2 % and 17 mA three ticks after the ramp's
 * end. */
static void expect_step_settles(int32_t spring_mohm, int32_t old_percent, uint16_t target_ma)
{
    TEST_ASSERT_TRUE(current_control_init(&control, &parameters, NULL));
    load = (load_t){.supply_mv = 5000,
                    .spring_mohm = spring_mohm,
                    .loop_mohm = 180,
                    .old_percent = old_percent};
    int32_t highest_ua = 0;
    int last_outside = 0;
    for (int n = 0; n < 200; n++) {
        tick(target_ma);
        highest_ua = load.now_ua > highest_ua ? load.now_ua : highest_ua;
        int32_t error_ua = load.now_ua - target_ma * 1000;
        if (error_ua > target_ma * 20 + 17000 || error_ua < -target_ma * 20 - 17000) {
            last_outside = n + 1;
        }
    }
    TEST_ASSERT_LESS_OR_EQUAL_INT32(40, highest_ua / 1000 - target_ma);
    TEST_ASSERT_LESS_OR_EQUAL_INT(3, last_outside - ramp_ticks(target_ma));
}

/* Estimate 190 mohm, spring 120..300, whatever the age of the readings and the slew. */
TEST(step_settles_without_much_overshoot)
{
    const uint16_t slew_ma[] = {60, 150, 300, 3200};
    const int32_t spring_mohm[] = {120, 135, 150, 175, 190, 219, 250, 300};
    const uint16_t target_ma[] = {130, 200, 400, 700, 1000, 1500, 2200, 3000};
    for (size_t s = 0; s < 4; s++) {
        parameters.slew_ma_per_tick = slew_ma[s];
        for (size_t r = 0; r < 8; r++) {
            for (size_t t = 0; t < 8; t++) {
                for (int32_t old_percent = 0; old_percent <= 100; old_percent += 25) {
                    expect_step_settles(spring_mohm[r], old_percent, target_ma[t]);
                }
            }
        }
    }
}

/* A fault takes five readings above over_current_a in a row. 4.35 V: nine springs behind 0.2 ohm;
 * 3.6 V: as much as can be learnt. */
TEST(supply_that_comes_back_is_met_before_it_is_a_fault)
{
    static const int32_t sagged_mv[] = {3600, 4000, 4350, 4600};
    static const int32_t spring_mohm[] = {140, 160, 190, 219};
    for (unsigned n = 0; n < 4u * 4u * 5u * 2u; n++) {
        setUp();
        load.spring_mohm = spring_mohm[n % 4u];
        load.old_percent = (int32_t)(n / 16u % 5u) * 25;
        load.supply_mv = sagged_mv[n / 4u % 4u];
        mean_ua(3000, n < 80u ? 100 : 101);
        load.now_ua =
            (int32_t)((int64_t)load.now_ua * 5000 / load.supply_mv); /* in the very tick */
        load.supply_mv = 5000;
        int above = 0;
        for (int m = 0; m < 30; m++) {
            above += sensed_ma() > 3150;
            tick(3000);
            TEST_ASSERT_GREATER_THAN_INT32(2300000, load.now_ua);
        }
        TEST_ASSERT_LESS_OR_EQUAL_INT(4, above);
        TEST_ASSERT_INT32_WITHIN(77000, 3000000, load.now_ua);
    }
}

TEST(reference_rises_by_the_slew_to_the_maximum_and_falls_at_once)
{
    parameters.slew_ma_per_tick = 100;
    TEST_ASSERT_TRUE(current_control_init(&control, &parameters, NULL));
    uint16_t before_ma[2] = {0, 0};
    for (int n = 0; n < 60; n++) {
        tick(2500);
        uint16_t reference_ma = current_control_reference_ma(&control, 0);
        TEST_ASSERT_LESS_OR_EQUAL_UINT16(before_ma[0] + 2 * 100, reference_ma);
        before_ma[0] = before_ma[1];
        before_ma[1] = reference_ma;
    }
    TEST_ASSERT_EQUAL_UINT16(2500, before_ma[1]);
    tick(700);
    TEST_ASSERT_EQUAL_UINT16(700, current_control_reference_ma(&control, 0));
    TEST_ASSERT_INT32_WITHIN(40000, 700000, load.now_ua);
    TEST_ASSERT_EQUAL_UINT16(0, tick(0));
    TEST_ASSERT_EQUAL_UINT16(0, current_control_reference_ma(&control, 0));
    (void)mean_ua(UINT16_MAX, 100);
    TEST_ASSERT_EQUAL_UINT16(parameters.maximum_current_ma,
                             current_control_reference_ma(&control, 0));
}

TEST(channels_have_their_turns_in_alternate_ticks)
{
    uint16_t target_ma[9], duty[9], before_ma[9] = {0};
    int16_t measured_ma[9];
    bool valid[9];
    int rises = 0;
    for (uint8_t k = 0; k < 9; k++) {
        target_ma[k] = 3000;
        measured_ma[k] = 0;
        valid[k] = true;
    }
    for (int n = 0; n < 8; n++) {
        current_control_tick(&control, 9, target_ma, measured_ma, valid, true, duty);
        for (uint8_t k = 0; k < 9; k++) {
            uint16_t reference_ma = current_control_reference_ma(&control, k);
            bool rose = reference_ma > before_ma[k];
            TEST_ASSERT_EQUAL((n + k) % 2 == 0, rose);
            rises += rose;
            before_ma[k] = reference_ma;
        }
    }
    TEST_ASSERT_EQUAL_INT(8 * 9 / 2, rises);
}

/* 0.95 x 0.9 V reaches 2.3 A of the 3 A wanted; then the supply recovers to 1.2 V, which just
 * reaches 3 A. */
TEST(saturation_does_not_wind_up)
{
    parameters.supply_mv = 1200;
    TEST_ASSERT_TRUE(current_control_init(&control, &parameters, NULL));
    load.supply_mv = 900;
    mean_ua(3000, 500);
    TEST_ASSERT_INT32_WITHIN(20000, 2311000, load.now_ua);
    load.supply_mv = 1200;
    for (int n = 0; n < 10; n++) {
        tick(2000);
        /* 1.2 / 0.9 of 2 A at most until its turn comes, then less from turn to turn */
        TEST_ASSERT_LESS_THAN_INT32(n < 3 ? 2700000 : n < 5 ? 2450000 : 2150000, load.now_ua);
    }
    TEST_ASSERT_INT32_WITHIN(30000, 2000000, load.now_ua);
}

TEST(all_of_a_period_may_be_given)
{
    parameters.supply_mv = 1200;
    parameters.maximum_duty_steps = CURRENT_CONTROL_DUTY_STEPS;
    TEST_ASSERT_TRUE(current_control_init(&control, &parameters, NULL));
    load.supply_mv = 900;
    mean_ua(3000, 100);
    TEST_ASSERT_EQUAL_UINT16(CURRENT_CONTROL_DUTY_STEPS, control.channel[0].duty);
}

TEST(blind_channel_holds_then_goes_off_then_returns)
{
    mean_ua(1500, 100);
    int32_t before_ua = mean_ua(1500, 20);
    for (int n = 0; n < parameters.hold_ticks; n++) {
        uint16_t duty = tick_with(2500, 190, false, true);
        TEST_ASSERT_EQUAL_UINT16(1500, current_control_reference_ma(&control, 0));
        TEST_ASSERT_NOT_EQUAL(0, duty);
        TEST_ASSERT_INT32_WITHIN(30000, before_ua, load.now_ua);
    }
    for (int n = 0; n < 300; n++) {
        TEST_ASSERT_EQUAL_UINT16(0, tick_with(2500, 190, false, true));
    }
    TEST_ASSERT_EQUAL_UINT8(UINT8_MAX, control.channel[0].blind_ticks);
    tick(2500);
    TEST_ASSERT_NOT_EQUAL(0, tick(2500)); /* one of the two is its turn */
    TEST_ASSERT_LESS_OR_EQUAL_UINT16(128, current_control_reference_ma(&control, 0));
}

/* The last of four channels gives the same whatever the others are told. */
TEST(channels_do_not_touch_each_other)
{
    current_control_t other;
    TEST_ASSERT_TRUE(current_control_init(&other, &parameters, NULL));
    uint32_t random = 7;
    for (int n = 0; n < 2000; n++) {
        uint16_t target_ma[4], duty[4], other_duty[4];
        int16_t measured_ma[4];
        bool valid[4];
        for (uint8_t k = 0; k < 4; k++) {
            random = random * 1664525u + 1013904223u;
            target_ma[k] = (uint16_t)((random >> 16) % 3000);
            measured_ma[k] = (int16_t)((random >> 8) % 3000);
            valid[k] = (random >> 28) != 0;
        }
        current_control_tick(&control, 4, target_ma, measured_ma, valid, true, duty);
        for (uint8_t k = 0; k < 3; k++) {
            target_ma[k] = (uint16_t)(3000u - target_ma[k]);
            measured_ma[k] = (int16_t)(3000 - measured_ma[k]);
            valid[k] = !valid[k];
        }
        current_control_tick(&other, 4, target_ma, measured_ma, valid, true, other_duty);
        TEST_ASSERT_EQUAL_UINT16(duty[3], other_duty[3]);
    }
    TEST_ASSERT_NOT_EQUAL(0, control.channel[3].trim_q24);
    TEST_ASSERT_EQUAL_MEMORY(&control.channel[3], &other.channel[3], sizeof control.channel[3]);
    TEST_ASSERT_EQUAL_UINT16(0, control.channel[4].reference_ma);
}

/* Whatever it had learnt: after a reset it is off, and begins as one that is new. */
TEST(reset_forgets_what_was_learnt_but_not_the_estimate)
{
    load.spring_mohm = 240; /* the estimate says 190 */
    mean_ua(1500, 100);
    TEST_ASSERT_TRUE(control.channel[0].trim_q24 != 0);
    (void)tick_with(0, 190, false, true);
    (void)tick_with(1500, 190, true, true);
    const int16_t estimate_q16 = control.channel[0].estimate_q16;
    current_control_reset(&control, 0);
    const current_control_channel_t fresh = {.estimate_q16 = estimate_q16};
    TEST_ASSERT_EQUAL_MEMORY(&fresh, &control.channel[0], sizeof fresh);
    TEST_ASSERT_EQUAL_UINT16(0, current_control_duty(&control, 0));
    TEST_ASSERT_EQUAL_UINT16(0, current_control_reference_ma(&control, 0));
}

/* The arithmetic of the header, in double: gain, drop, limit of the trim. */
TEST(what_is_fed_forward_is_ohm_s_law)
{
    static const uint16_t circuit[][4] = {/* supply, drop, shunt, wiring */
                                          {5000, 0, 100, 80},
                                          {5000, 400, 100, 80},
                                          {12000, 700, 50, 300},
                                          {3000, 300, 100, 20}};
    for (size_t n = 0; n < 4; n++) {
        parameters.supply_mv = circuit[n][0];
        parameters.freewheel_mv = circuit[n][1];
        parameters.shunt_mohm = circuit[n][2];
        parameters.wiring_mohm = circuit[n][3];
        TEST_ASSERT_TRUE(current_control_init(&control, &parameters, NULL));
        const double swing_mv = circuit[n][0] + circuit[n][1];
        const double drop_steps = 800.0 * circuit[n][1] / swing_mv;
        TEST_ASSERT_DOUBLE_WITHIN(0.02, drop_steps, control.offset_q16 / 65536.0);
        for (uint16_t mohm = 0; mohm < 600; mohm = (uint16_t)(mohm + 97u)) {
            current_control_set_resistance(&control, 0, mohm);
            const double steps_per_ma = 0.8 * (mohm + circuit[n][2] + circuit[n][3]) / swing_mv;
            TEST_ASSERT_DOUBLE_WITHIN(2.0 + 0.001 * 65536.0 * steps_per_ma, 65536.0 * steps_per_ma,
                                      control.channel[0].estimate_q16);
        }
        const double trim = 16777216.0 * 0.8 * parameters.trim_limit_mohm / swing_mv;
        TEST_ASSERT_DOUBLE_WITHIN(600.0 + 0.002 * trim,
                                  trim < 8191.0 * 256.0 ? trim : 8191.0 * 256.0,
                                  control.trim_limit_q24);
        TEST_ASSERT_EQUAL_UINT16(parameters.integral_permille * 65535ul / 1000u,
                                 control.integral_q16);
    }
    current_control_set_resistance(&control, 0, UINT16_MAX);
    TEST_ASSERT_EQUAL_INT16(24575, control.channel[0].estimate_q16);
}

/* To the last bit: a drop of which a 51200th more would round otherwise; and the highest gain that
 * an estimate and what is learnt beyond it come to, given to the thousandth of a step. */
TEST(drop_and_limits_are_exact)
{
    parameters.supply_mv = 2000;
    parameters.freewheel_mv = 27;
    TEST_ASSERT_TRUE(current_control_init(&control, &parameters, NULL));
    TEST_ASSERT_EQUAL_INT32(27 * 51200 / 2027 * 1024, control.offset_q16);
    current_control_set_drop(&control, 400);
    TEST_ASSERT_EQUAL_INT32(400 * 51200 / 2400 * 1024, control.offset_q16);
    TEST_ASSERT_EQUAL_UINT(133, current_control_dead_steps(&control));
    current_control_set_drop(&control, 1000);
    TEST_ASSERT_EQUAL_UINT(255, current_control_dead_steps(&control));
    parameters.supply_mv = 1000;
    parameters.freewheel_mv = 0;
    parameters.trim_limit_mohm = 1000;
    TEST_ASSERT_TRUE(current_control_init(&control, &parameters, NULL));
    TEST_ASSERT_EQUAL_INT32(8191 * 256, control.trim_limit_q24);
}

/* What is found of the drop in mid-drive is no step of the current: trim and offset say the same of
 * it, and from there on the loop goes on as before; a channel that is off keeps what it learnt. */
TEST(another_drop_moves_no_duty)
{
    static const uint16_t drops_mv[] = {310, 0, 150, 300};
    for (uint16_t target_ma = 1600; target_ma <= 2900; target_ma += 650) {
        setUp();
        load.supply_mv = 4210;
        control.channel[1].trim_q24 = 900 * 256;
        for (unsigned n = 0; n < sizeof drops_mv / sizeof *drops_mv; n++) {
            mean_ua(target_ma, 100);
            const uint16_t before = current_control_duty(&control, 0);
            current_control_set_drop(&control, drops_mv[n]);
            for (int m = 0; m < 20; m++) {
                TEST_ASSERT_INT_WITHIN(1, before, tick(target_ma)); /* dither */
            }
            TEST_ASSERT_INT32_WITHIN(8000, target_ma * 1000, mean_ua(target_ma, 20));
        }
        TEST_ASSERT_EQUAL_INT32(900 * 256, control.channel[1].trim_q24);
    }
}

/* Nor is another declaration of its circuit, right or wrong: what was learnt is what there is. Who
 * is off begins as declared. */
TEST(another_declaration_moves_no_duty)
{
    static const struct {
        uint16_t supply_mv, wiring_mohm, freewheel_mv;
    } declared[] = {{5000, 80, 0}, {5000, 120, 0}, {4500, 80, 0}, {5200, 60, 0}, {5000, 80, 380}};
    for (unsigned n = 0; n < ROWS(declared); n++) {
        setUp();
        row(n);
        load.supply_mv = 4500;
        load.loop_mohm = 220;
        control.channel[1].trim_q24 = 900 * 256;
        current_control_set_resistance(&control, 1, 190);
        mean_ua(2700, 100);
        const uint16_t before = current_control_duty(&control, 0);
        parameters.supply_mv = declared[n].supply_mv;
        parameters.wiring_mohm = declared[n].wiring_mohm;
        parameters.freewheel_mv = declared[n].freewheel_mv;
        TEST_ASSERT_TRUE(current_control_apply(&control, &parameters, NULL));
        for (int m = 0; m < 20; m++) {
            TEST_ASSERT_INT_WITHIN(2, before, tick(2700)); /* dither */
        }
        TEST_ASSERT_INT32_WITHIN(8000, 2700000, mean_ua(2700, 20));
        TEST_ASSERT_EQUAL_INT32(900 * 256, control.channel[1].trim_q24);
        current_control_t anew;
        TEST_ASSERT_TRUE(current_control_init(&anew, &parameters, NULL));
        current_control_set_resistance(&anew, 1, 190);
        TEST_ASSERT_INT16_WITHIN(12, anew.channel[1].estimate_q16, /* a milliohm */
                                 control.channel[1].estimate_q16);
        TEST_ASSERT_EQUAL_UINT16(anew.gain_q24_per_mohm, control.gain_q24_per_mohm);
        TEST_ASSERT_EQUAL_UINT16(anew.fixed_mohm, control.fixed_mohm);
        TEST_ASSERT_EQUAL_INT32(anew.offset_q16, control.offset_q16);
    }
}

/* To the last bit, of every channel that is driven, as far as its trim reaches. */
TEST(another_drop_is_taken_from_every_trim)
{
    const int32_t most = control.trim_limit_q24;
    control.channel[7].reference_ma = 2000;
    control.channel[8].reference_ma = 128;
    memset(owned.behind, 1, sizeof owned.behind);
    current_control_set_drop(&control, 300);
    TEST_ASSERT_EACH_EQUAL_UINT8(1, owned.behind, sizeof owned.behind);
    TEST_ASSERT_EQUAL_INT32(control.offset_q16 / 2000 * -256, control.channel[7].trim_q24);
    TEST_ASSERT_EQUAL_INT32(-most, control.channel[8].trim_q24);
    control.channel[8].trim_q24 = 0;
    current_control_set_drop(&control, 0);
    TEST_ASSERT_EQUAL_INT32(0, control.channel[7].trim_q24);
    TEST_ASSERT_EQUAL_INT32(most, control.channel[8].trim_q24);
    control.channel[8].reference_ma = 1;
    current_control_set_drop(&control, 1000);
    TEST_ASSERT_EQUAL_INT32(-most, control.channel[8].trim_q24);
}

/* A circuit of which nothing is declared is given a step in 65536 a milliampere: it answers. */
TEST(no_resistance_at_all_gives_the_least_there_is)
{
    parameters.shunt_mohm = parameters.wiring_mohm = 0;
    parameters.hold_ticks = 250;
    TEST_ASSERT_TRUE(current_control_init(&control, &parameters, NULL));
    unsigned given = 0;
    for (int n = 0; n < 220; n++) {
        const uint16_t target_ma = 1000;
        const int16_t measured_ma = 0;
        const bool valid = n < 20; /* until it is at its target; then it learns no more */
        uint16_t duty;
        control.channel[0].trim_q24 = n <= 20 ? 0 : control.channel[0].trim_q24;
        current_control_tick(&control, 1, &target_ma, &measured_ma, &valid, true, &duty);
        given += n >= 20 ? duty : 0;
    }
    TEST_ASSERT_UINT_WITHIN(1, 3, given); /* 200 ticks x 1000 mA / 65536 */
}

/* What one reading teaches a channel that gives nothing. */
static int32_t taken(uint16_t resistance_mohm, int16_t measured_ma)
{
    parameters.integral_permille = 1;
    TEST_ASSERT_TRUE(current_control_init(&control, &parameters, NULL));
    current_control_set_resistance(&control, 0, resistance_mohm);
    control.channel[0].reference_ma = 1;
    const uint16_t target_ma = 1;
    const bool valid = true;
    uint16_t duty;
    current_control_tick(&control, 1, &target_ma, &measured_ma, &valid, true, &duty);
    return control.channel[0].trim_q24;
}

/* Up to 128 steps each way an error is taken as it is, beyond as that. */
TEST(an_error_is_taken_in_full_up_to_its_end)
{
    /* 0.8 x 470 / 5000 steps a mA: 127.1, 127.4, 127.7, and all beyond 128 */
    static const int16_t measured_ma[] = {1690, 1694, 1698, 2600};
    for (int sign = -1; sign <= 1; sign += 2) {
        int32_t before_q24 = 0;
        for (size_t n = 0; n < 4; n++) {
            const int32_t taken_q24 = -sign * taken(290, (int16_t)(sign * measured_ma[n]));
            TEST_ASSERT_GREATER_THAN_INT32(before_q24, taken_q24);
            before_q24 = taken_q24;
        }
    }
}

/* A reading is one of up to 4095 mA, which are 124 steps of 190 mohm. */
TEST(a_reading_counts_up_to_its_end)
{
    for (int sign = -1; sign <= 1; sign += 2) {
        const int32_t most_q24 = taken(10, (int16_t)(sign * 4095));
        TEST_ASSERT_EQUAL_INT32(most_q24, taken(10, (int16_t)(sign * 4096)));
        TEST_ASSERT_EQUAL_INT32(most_q24, taken(10, sign < 0 ? INT16_MIN : INT16_MAX));
    }
    TEST_ASSERT_GREATER_THAN_INT32(taken(10, -4085), taken(10, -4095));
}

/* The same by hand for the declared circuit: 2684 millionths of a step, 180 mohm, 12.3 % drop. */
TEST(a_new_one_is_off_and_has_the_numbers_of_its_circuit)
{
    memset(owned.behind, 0xA5, sizeof owned.behind);
    mean_ua(1500, 50);
    parameters.freewheel_mv = 700;
    parameters.integral_permille = 500;
    TEST_ASSERT_TRUE(current_control_init(&control, &parameters, NULL));
    const uint32_t gain_q24 = 13421773ul / 5700ul;
    TEST_ASSERT_EQUAL_UINT16(2354, gain_q24);
    TEST_ASSERT_EQUAL_UINT16(gain_q24, control.gain_q24_per_mohm);
    TEST_ASSERT_EQUAL_INT32(6287 * 1024, control.offset_q16);
    TEST_ASSERT_EQUAL_UINT16(32767, control.integral_q16);
    for (uint8_t k = 0; k < CURRENT_CONTROL_MAX_CHANNELS; k++) {
        const current_control_channel_t fresh = {.estimate_q16 = 180 * 2354 / 256};
        TEST_ASSERT_EQUAL_MEMORY(&fresh, &control.channel[k], sizeof fresh);
    }
    TEST_ASSERT_EACH_EQUAL_HEX8(0xA5, owned.behind, sizeof owned.behind);
}

/* Off is nothing at all, also of what was left of a step; 25 mA are small, 26 wait. */
TEST(off_is_nothing_and_small_ends_at_25_ma)
{
    mean_ua(1500, 60);
    tick(0);
    TEST_ASSERT_EQUAL_UINT16(0, current_control_duty(&control, 0));
    TEST_ASSERT_EQUAL_UINT16(0, control.channel[0].residue_q16);
    for (uint16_t rise_ma = 25; rise_ma <= 26; rise_ma++) {
        for (int odd = 0; odd < 2; odd++) {
            mean_ua(1500, 60 + odd);
            tick((uint16_t)(1500 + rise_ma));
            const bool at_once =
                current_control_reference_ma(&control, 0) == (uint16_t)(1500 + rise_ma);
            TEST_ASSERT_TRUE(rise_ma > 25 || at_once);
            if (rise_ma > 25) {
                tick((uint16_t)(1500 + rise_ma));
                TEST_ASSERT_EQUAL_UINT16(1500 + rise_ma, current_control_reference_ma(&control, 0));
            }
            mean_ua(1500, 60);
            tick((uint16_t)(1500 - rise_ma));
            TEST_ASSERT_EQUAL(rise_ma > 25, control.channel[0].fell);
        }
    }
}

/* What still flows from before is no answer to a duty that was not given. */
TEST(what_is_read_before_the_start_teaches_nothing)
{
    const uint16_t fresh = tick(1000);
    setUp();
    for (int n = 0; n < 50; n++) {
        load.now_ua = load.before_ua = 2000000;
        TEST_ASSERT_EQUAL_UINT16(0, tick_with(1000, 190, true, false));
    }
    TEST_ASSERT_EQUAL_UINT16(fresh, tick(1000));
}

/* A change as small as that need not wait; a start of any size does, for what is read at it. */
TEST(a_small_start_has_its_turn_and_one_mA_is_given)
{
    unsigned given = 0;
    (void)tick(0);
    (void)tick(3);
    TEST_ASSERT_EQUAL_UINT16(0, current_control_reference_ma(&control, 0));
    (void)tick(3);
    TEST_ASSERT_EQUAL_UINT16(3, current_control_reference_ma(&control, 0));
    for (int n = 0; n < 100; n++) {
        given += tick(1);
    }
    TEST_ASSERT_UINT_WITHIN(4, 6, given); /* 800 steps x 1 mA x 0.37 ohm / 5 V, in each tick */
}
