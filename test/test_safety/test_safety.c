/* Limits and latches: each condition trips its own fault after its number of bad ticks in a row,
 * and no earlier. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "../run_tests.h"
#include "safety.h"

static safety_t safety;
static safety_parameters_t parameters;

static const safety_sample_t running = {.sensor_status = 0,
                                        .most_mv = 5000,
                                        .current_ma = 1500,
                                        .voltage_mv = 285, /* 190 mohm */
                                        .expected_ma = 1500,
                                        .temperature_c7 = 90 * 128};
static const safety_sample_t off = {.off = true, .temperature_c7 = 20 * 128};

void setUp(void)
{
    safety_parameters_default(&parameters);
    TEST_ASSERT_TRUE(safety_init(&safety, &parameters, 9, NULL));
}

static void ticks(uint8_t spring, const safety_sample_t *sample, uint32_t count)
{
    for (uint32_t n = 0; n < count; n++) {
        for (uint8_t k = 0; k < 9; k++) {
            safety_tick_spring(&safety, k, k == spring ? sample : &off);
        }
        safety_tick_board(&safety, 0);
    }
}

/* All springs off and read, and so much flows in all. */
static void ends_with(uint32_t sum_ma)
{
    (void)safety_tick_spring(&safety, 0, &off);
    safety_tick_board(&safety, sum_ma);
}

/* The sample trips this fault, in the tick that it must, and neither a pause nor another spring is
 * in it. */
static void trips(safety_fault_t fault, const safety_sample_t *sample)
{
    setUp();
    uint8_t limit = fault == SAFETY_FAULT_STUCK_ON ? SAFETY_STUCK_TICKS : parameters.bad_samples;
    ticks(4, sample, limit - 1u);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, safety_fault(&safety, 4));
    /* one good tick in between, of what no switch can end two seconds for each: counted anew */
    ticks(4, &running, fault == SAFETY_FAULT_STUCK_ON ? 2u * SAFETY_FORGET_TICKS + 1u : 1u);
    ticks(4, sample, limit - 1u);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, safety_fault(&safety, 4));
    TEST_ASSERT_TRUE(safety_allows(&safety, 4));
    ticks(4, sample, 1);
    TEST_ASSERT_EQUAL(fault, safety_fault(&safety, 4));
    TEST_ASSERT_FALSE(safety_allows(&safety, 4));
    bool board = fault >= SAFETY_FAULT_STUCK_ON;
    TEST_ASSERT_EQUAL(board ? fault : SAFETY_FAULT_NONE, safety_board_fault(&safety));
    TEST_ASSERT_EQUAL(!board, safety_allows(&safety, 3));
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, safety_fault(&safety, 3));

    ticks(4, &running, 100); /* the latch stays though the cause has gone */
    TEST_ASSERT_EQUAL(fault, safety_fault(&safety, 4));
    safety_clear(&safety);
    TEST_ASSERT_TRUE(safety_allows(&safety, 4));
    ticks(4, sample, limit - 1u);
    TEST_ASSERT_TRUE(safety_allows(&safety, 4));
    ticks(4, sample, 1); /* and it trips again if the cause has not */
    TEST_ASSERT_EQUAL(fault, safety_fault(&safety, 4));
}

/* And what is at its limit is good. */
TEST(each_condition_trips_its_own_fault)
{
    static const struct {
        int16_t ma, mv, limit_ma, limit_mv; /* of an expected 1.5 A */
        safety_fault_t fault;
    } table[] = {{3151, 600, 3150, 600, SAFETY_FAULT_OVER_CURRENT},
                 {374, 71, 375, 71, SAFETY_FAULT_OPEN_SPRING},      /* a quarter */
                 {1500, 119, 1500, 120, SAFETY_FAULT_SHORT_SPRING}, /* 80 mohm */
                 {3150, 251, 3150, 252, SAFETY_FAULT_SHORT_SPRING},
                 {1500, 751, 1500, 750, SAFETY_FAULT_HIGH_RESISTANCE}, /* 500 mohm */
                 {3150, 1576, 3150, 1575, SAFETY_FAULT_HIGH_RESISTANCE}};
    safety_sample_t sample;
    for (size_t n = 0; n < ROWS(table); n++) {
        sample = running;
        sample.current_ma = table[n].ma;
        sample.voltage_mv = table[n].mv;
        trips(table[n].fault, &sample);
        setUp();
        sample.may_be_dead = true; /* then no current is none; else it is as before */
        ticks(4, &sample, 50);
        TEST_ASSERT_EQUAL(table[n].fault == SAFETY_FAULT_OPEN_SPRING, safety_allows(&safety, 4));
        setUp();
        sample.may_be_dead = false;
        sample.current_ma = table[n].limit_ma;
        sample.voltage_mv = table[n].limit_mv;
        ticks(4, &sample, 50);
        TEST_ASSERT_TRUE(safety_allows(&safety, 4));
    }
    sample = running;
    for (uint8_t status = 1; status <= 4; status++) {
        sample.sensor_status = status;
        trips((safety_fault_t)(SAFETY_FAULT_SENSOR_ABSENT + status - 1), &sample);
    }
    sample = running;
    sample.temperature_c7 = 130 * 128 + 1;
    trips(SAFETY_FAULT_OVER_TEMPERATURE, &sample);
    setUp();
    sample.temperature_c7--;
    ticks(4, &sample, 50);
    TEST_ASSERT_TRUE(safety_allows(&safety, 4));
    sample = off;
    sample.current_ma = 101;
    sample.voltage_mv = 20;
    trips(SAFETY_FAULT_STUCK_ON, &sample);
    setUp();
    sample.current_ma--;
    ticks(4, &sample, 50);
    TEST_ASSERT_TRUE(safety_allows(&safety, 4));
}

/* What was counted before stays: a sensor that fails every other tick does not hide a short. */
TEST(missing_readings_neither_count_nor_forgive)
{
    safety_sample_t bad = running;
    bad.voltage_mv = 0;
    safety_sample_t absent = bad;
    absent.sensor_status = 1;
    for (uint8_t n = 0; n < parameters.bad_samples; n++) {
        TEST_ASSERT_TRUE(safety_allows(&safety, 4));
        ticks(4, &absent, 1);
        TEST_ASSERT_TRUE(safety_allows(&safety, 4));
        ticks(4, &bad, 1);
    }
    TEST_ASSERT_EQUAL(SAFETY_FAULT_SHORT_SPRING, safety_fault(&safety, 4));
}

TEST(the_first_fault_is_kept)
{
    safety_sample_t sample = running;
    sample.voltage_mv = 0;
    ticks(4, &sample, 10);
    sample.temperature_c7 = 200 * 128;
    ticks(4, &sample, 10);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_SHORT_SPRING, safety_fault(&safety, 4));
    safety_emergency_stop(&safety);
    for (int n = 0; n < 10; n++) {
        ends_with(20000);
    }
    TEST_ASSERT_EQUAL(SAFETY_FAULT_EMERGENCY_STOP, safety_board_fault(&safety));
}

TEST(sum_above_the_supply_trips_everything)
{
    for (uint8_t n = 0; n < 100; n++) {
        ends_with(15000);
    }
    for (uint8_t n = 0; n < parameters.bad_samples; n++) {
        TEST_ASSERT_TRUE(safety_allows(&safety, 0));
        ends_with(15001);
    }
    TEST_ASSERT_EQUAL(SAFETY_FAULT_SUPPLY_CURRENT, safety_board_fault(&safety));
    TEST_ASSERT_FALSE(safety_allows(&safety, 0));
    safety_clear(&safety);
    TEST_ASSERT_TRUE(safety_allows(&safety, 0));
}

/* Whatever was found before it, of the spring and of the board, and while that goes on. */
TEST(current_without_duty_overrides_every_other_fault)
{
    for (int fault = 0; fault < SAFETY_FAULT_COUNT; fault++) {
        if (fault == SAFETY_FAULT_STUCK_ON) {
            continue;
        }
        const uint8_t k = (uint8_t)(fault % 9); /* whichever spring it is */
        setUp();
        ticks(k, &running, 10);
        safety_sample_t sample = {
            .current_ma = 3200, .voltage_mv = 2450, .expected_ma = 1500, .most_mv = 3000};
        safety_trip(&safety, k, (safety_fault_t)fault);
        safety_emergency_stop(&safety);
        ticks(k, &sample, 20); /* as over_current and high_resistance, too */
        sample.off = true;
        TEST_ASSERT_FALSE(safety_doubts_supply(&safety));
        ticks(k, &sample, SAFETY_STUCK_TICKS - 1u);
        TEST_ASSERT_TRUE(safety_doubts_supply(&safety));
        TEST_ASSERT_EQUAL(SAFETY_FAULT_EMERGENCY_STOP, safety_board_fault(&safety));
        ticks(k, &sample, 1);
        TEST_ASSERT_EQUAL(SAFETY_FAULT_STUCK_ON, safety_board_fault(&safety));
        TEST_ASSERT_EQUAL(SAFETY_FAULT_STUCK_ON, safety_fault(&safety, k));
        TEST_ASSERT_FALSE(safety_allows(&safety, 0));
        safety_emergency_stop(&safety);
        TEST_ASSERT_EQUAL(SAFETY_FAULT_STUCK_ON, safety_board_fault(&safety));
    }
}

/* A switch that closes for a tick now and then: by the third the supply goes, however many good
 * readings lie between, if it is less than two seconds. */
TEST(a_switch_that_chatters_is_current_without_duty)
{
    safety_sample_t sample = off;
    sample.current_ma = 3190;
    sample.voltage_mv = 1200;
    for (uint32_t pause = 0; pause <= SAFETY_FORGET_TICKS; pause += 20) {
        setUp();
        for (unsigned n = 1; n <= SAFETY_STUCK_TICKS; n++) {
            TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, safety_board_fault(&safety));
            ticks(4, &sample, 1);
            TEST_ASSERT_TRUE(safety_doubts_supply(&safety));
            if (pause > 0) {
                ticks(4, &off, pause);
                TEST_ASSERT_FALSE(safety_doubts_supply(&safety)); /* it was let go for a tick */
            }
        }
        TEST_ASSERT_EQUAL(SAFETY_FAULT_STUCK_ON, safety_board_fault(&safety));
        TEST_ASSERT_TRUE(safety_cuts_supply(&safety));
    }
    setUp(); /* one more is forgotten for each two seconds, not all of them */
    ticks(4, &sample, 2);
    ticks(4, &off, SAFETY_FORGET_TICKS + 1u);
    ticks(4, &sample, 1);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, safety_board_fault(&safety));
    ticks(4, &off, SAFETY_FORGET_TICKS);
    ticks(4, &sample, 1);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_STUCK_ON, safety_board_fault(&safety));
}

/* A driven spring: the current alone may be a short's, the voltage alone an open spring's. */
TEST(a_voltage_that_no_duty_gives_is_current_without_duty)
{
    safety_sample_t sample = running;
    sample.current_ma = 3190;
    sample.voltage_mv = 2450;
    sample.most_mv = 2450;
    ticks(4, &sample, 1);
    TEST_ASSERT_FALSE(safety_doubts_supply(&safety));
    sample.current_ma = (int16_t)parameters.over_current_ma;
    sample.most_mv = 900;
    ticks(4, &sample, 1);
    TEST_ASSERT_FALSE(safety_doubts_supply(&safety));
    sample.current_ma++;
    ticks(4, &sample, 1);
    TEST_ASSERT_TRUE(safety_doubts_supply(&safety));
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, safety_board_fault(&safety));
    ticks(4, &running, 1); /* a glitch: one pulse less */
    TEST_ASSERT_FALSE(safety_doubts_supply(&safety));
    ticks(4, &sample, SAFETY_STUCK_TICKS);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_STUCK_ON, safety_board_fault(&safety));
    TEST_ASSERT_TRUE(safety_cuts_supply(&safety));
}

TEST(silent_host_stops_the_board_until_cleared)
{
    safety_host_silent(&safety);
    ticks(4, &running, 100);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_HOST_SILENT, safety_board_fault(&safety));
    for (uint8_t k = 0; k < 9; k++) {
        TEST_ASSERT_FALSE(safety_allows(&safety, k));
    }
    safety_clear(&safety);
    TEST_ASSERT_TRUE(safety_allows(&safety, 4));
}

TEST(lock_holds_until_unlocked_and_is_no_fault)
{
    safety_lock(&safety);
    safety_clear(&safety);
    TEST_ASSERT_FALSE(safety_allows(&safety, 4));
    TEST_ASSERT_TRUE(safety_is_locked(&safety));
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, safety_board_fault(&safety));
    safety_emergency_stop(&safety);
    safety_unlock(&safety);
    TEST_ASSERT_FALSE(safety_allows(&safety, 4)); /* unlocking clears nothing */
    safety_clear(&safety);
    TEST_ASSERT_TRUE(safety_allows(&safety, 4));
}

TEST(on_time_is_limited_only_where_it_is_set)
{
    ticks(4, &running, 50u * 65537u);
    TEST_ASSERT_TRUE(safety_allows(&safety, 4));
    parameters.maximum_on_s = 10; /* and from then on counts what was before */
    TEST_ASSERT_TRUE(safety_apply(&safety, &parameters, NULL));
    ticks(4, &running, 50);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_ON_TIME, safety_fault(&safety, 4));

    TEST_ASSERT_TRUE(safety_init(&safety, &parameters, 9, NULL));
    for (int pulse = 0; pulse < 5; pulse++) { /* pauses start it again */
        ticks(4, &running, 499);
        ticks(4, &off, 1);
    }
    TEST_ASSERT_TRUE(safety_allows(&safety, 4));
    ticks(4, &off, 1);
    TEST_ASSERT_TRUE(safety_init(&safety, &parameters, 9, NULL));
    ticks(4, &running, 500); /* 10 s, from the first tick on */
    TEST_ASSERT_TRUE(safety_allows(&safety, 4));
    ticks(4, &running, 1);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_ON_TIME, safety_fault(&safety, 4));
    TEST_ASSERT_TRUE(safety_allows(&safety, 5));

    parameters.maximum_on_s = UINT16_MAX; /* the most that may be set is a limit, too */
    TEST_ASSERT_TRUE(safety_init(&safety, &parameters, 9, NULL));
    ticks(4, &running, 50u * UINT16_MAX);
    TEST_ASSERT_TRUE(safety_allows(&safety, 4));
    ticks(4, &running, 1);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_ON_TIME, safety_fault(&safety, 4));
}

/* The quick look lets nothing pass that is beyond a limit, whatever the limits are. */
TEST(resistance_trips_at_its_limits_and_nowhere_else)
{
    const uint16_t limits_mohm[][2] = {{80, 500},    {0, 0},       {1, 2},       {175, 176},
                                       {0, 1250},    {1250, 1251}, {1251, 9999}, {80, 0},
                                       {2039, 2041}, {9999, 10000}};
    const uint16_t steps[] = {299, 300, 301, 447, 1500, 1503, 2999, 3149, 3150};
    parameters.bad_samples = 1;
    for (size_t n = 0; n < ROWS(limits_mohm); n++) {
        parameters.resistance_minimum_mohm = limits_mohm[n][0];
        parameters.resistance_maximum_mohm = limits_mohm[n][1];
        TEST_ASSERT_TRUE(safety_apply(&safety, &parameters, NULL));
        for (size_t i = 0; i < ROWS(steps); i++) {
            int32_t current_ma = steps[i];
            for (int32_t voltage_mv = -5; voltage_mv < 32000;
                 voltage_mv += voltage_mv < 2500 ? 1 : 37) {
                safety_sample_t sample = {.current_ma = (int16_t)current_ma,
                                          .voltage_mv = (int16_t)voltage_mv,
                                          .expected_ma = (uint16_t)current_ma};
                int32_t voltage_uv = voltage_mv < 0 ? 0 : voltage_mv * 1000;
                safety_fault_t fault = SAFETY_FAULT_NONE;
                if (current_ma >= 300 && voltage_uv < current_ma * limits_mohm[n][0]) {
                    fault = SAFETY_FAULT_SHORT_SPRING;
                } else if (current_ma >= 300 && limits_mohm[n][1] != 0 &&
                           voltage_uv > current_ma * limits_mohm[n][1]) {
                    fault = SAFETY_FAULT_HIGH_RESISTANCE;
                }
                safety_tick_spring(&safety, 4, &sample);
                TEST_ASSERT_EQUAL(fault, safety_fault(&safety, 4));
                safety_clear(&safety);
            }
        }
    }
}

static void refuses(const safety_parameters_t *changed, uint16_t row)
{
    uint16_t bad = UINT16_MAX;
    const safety_t before = safety;
    TEST_ASSERT_FALSE(safety_apply(&safety, changed, &bad));
    TEST_ASSERT_EQUAL_UINT16(row, bad);
    TEST_ASSERT_FALSE(safety_init(&safety, changed, 9, NULL));
    TEST_ASSERT_EQUAL_MEMORY(&before, &safety, sizeof safety);
}

/* Each limit: test_parameters. */
TEST(parameters_that_do_not_fit_are_refused_and_found)
{
    safety_parameters_t changed = parameters;
    changed.bad_samples = 0;
    refuses(&changed, PARAMETER_fault_bad_samples);
    changed = parameters;
    changed.resistance_maximum_mohm = changed.resistance_minimum_mohm;
    refuses(&changed, PARAMETER_resistance_maximum_ohm);
    TEST_ASSERT_FALSE(safety_init(&safety, &parameters, 0, NULL));
    TEST_ASSERT_FALSE(safety_init(&safety, &parameters, SAFETY_MAX_SPRINGS + 1, NULL));
}

/* Fault 11 of the board and fault 9 of any spring, and no other: only the supply's switch helps. */
TEST(the_supply_is_cut_where_nothing_else_helps)
{
    TEST_ASSERT_FALSE(safety_cuts_supply(&safety));
    for (int fault = 1; fault < SAFETY_FAULT_COUNT; fault++) {
        for (uint8_t k = 0; k < 9; k += 4) {
            setUp();
            safety_trip(&safety, k, (safety_fault_t)fault);
            const bool cuts =
                fault == SAFETY_FAULT_OVER_TEMPERATURE || fault == SAFETY_FAULT_STUCK_ON;
            TEST_ASSERT_EQUAL(cuts, safety_cuts_supply(&safety));
            safety_emergency_stop(&safety);
            TEST_ASSERT_EQUAL(cuts, safety_cuts_supply(&safety));
            safety_clear(&safety);
            TEST_ASSERT_FALSE(safety_cuts_supply(&safety));
        }
    }
    setUp();
    const safety_sample_t stuck = {.off = true, .current_ma = 500, .voltage_mv = 100};
    ticks(0, &stuck, parameters.bad_samples);
    TEST_ASSERT_TRUE(safety_cuts_supply(&safety));
}

static void unread(uint8_t status, uint8_t but, uint32_t count)
{
    const safety_sample_t silent = {
        .off = true, .sensor_status = status, .temperature_c7 = 20 * 128};
    for (uint32_t n = 0; n < count; n++) {
        for (uint8_t k = 0; k < 9; k++) {
            (void)safety_tick_spring(&safety, k, k == but ? &off : &silent);
        }
        safety_tick_board(&safety, 0);
    }
}

/* Where no sensor acknowledges, or the bus hangs, no reading shows that current is off. One that
 * answers at all is enough: each switch has another sensor, but the bus is there. Whatever a fault
 * takes to be one, and whatever was latched before. */
TEST(supply_that_no_sensor_watches_is_cut)
{
    enum { NOBODY = 255, ABSENT = 1, HANGS = 2, STALE = 3, RESET = 4 };
    for (uint8_t samples = 1; samples <= 50; samples = (uint8_t)(samples + 7u)) {
        for (uint8_t status = ABSENT; status <= RESET; status++) {
            parameters.bad_samples = samples;
            TEST_ASSERT_TRUE(safety_init(&safety, &parameters, 9, NULL));
            const bool cuts = status <= HANGS;
            for (int times = 0; times < 2; times++) {
                unread(status, NOBODY, SAFETY_BLIND_TICKS - 1u);
                TEST_ASSERT_FALSE(safety_cuts_supply(&safety));
                unread(status, 8, 1); /* freed: counted anew */
            }
            unread(status, 8, 300);
            TEST_ASSERT_FALSE(safety_cuts_supply(&safety));
            TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, safety_board_fault(&safety));
            unread(status, NOBODY, SAFETY_BLIND_TICKS);
            for (unsigned n = 0; n < 300; n++) { /* for as long as it lasts */
                TEST_ASSERT_EQUAL(cuts, safety_cuts_supply(&safety));
                unread(status, NOBODY, 1);
            }
            TEST_ASSERT_EQUAL(cuts ? SAFETY_FAULT_NO_SENSOR : SAFETY_FAULT_NONE,
                              safety_board_fault(&safety));
            safety_clear(&safety);
            TEST_ASSERT_FALSE(safety_cuts_supply(&safety));
            safety_emergency_stop(&safety);
            unread(status, NOBODY, SAFETY_BLIND_TICKS - 1u);
            TEST_ASSERT_FALSE(safety_cuts_supply(&safety));
            unread(status, NOBODY, 1);
            TEST_ASSERT_EQUAL(cuts, safety_cuts_supply(&safety));
            TEST_ASSERT_EQUAL(SAFETY_FAULT_EMERGENCY_STOP, safety_board_fault(&safety));
            unread(status, 0, 1); /* whoever switches it on again can */
            TEST_ASSERT_FALSE(safety_cuts_supply(&safety));
        }
    }
}

/* Every count is of ticks in a row: a good one, and clear, begin it anew. */
TEST(a_good_tick_and_clear_begin_every_count_anew)
{
    const uint8_t almost = (uint8_t)(parameters.bad_samples - 1u);
    for (int round = 0; round < 4; round++) {
        for (uint8_t n = 0; n < almost; n++) {
            ends_with(15001);
        }
        TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, safety_board_fault(&safety));
        if (round < 2) {
            ends_with(15000);
        } else {
            safety_clear(&safety);
        }
    }

    safety_sample_t was = running;
    was.expected_ma = 0;
    was.off = true;
    for (int round = 0; round < 3; round++) {
        ticks(4, &running, 10); /* it reads, and shows just that again */
        ticks(4, &was, almost);
    }
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, safety_fault(&safety, 4));
    ticks(4, &was, 1);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_SENSOR_MISMATCH, safety_fault(&safety, 4));
}

/* One tick that shows another current, and what it shows after that flows, though it be the same as
 * before; and the largest current that an output may give can be frozen, too. */
TEST(a_sensor_that_moved_once_is_not_frozen)
{
    safety_sample_t sample = running;
    ticks(4, &sample, 10);
    sample.expected_ma = 0;
    sample.off = true;
    ticks(4, &sample, 2);
    sample.current_ma--;
    ticks(4, &sample, 1);
    sample.current_ma++;
    ticks(4, &sample, parameters.bad_samples - 1u);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_STUCK_ON, safety_board_fault(&safety));

    setUp();
    sample = running;
    sample.current_ma = 3150;
    sample.voltage_mv = 600;
    ticks(4, &sample, 10);
    sample.off = true;
    ticks(4, &sample, 10);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_SENSOR_MISMATCH, safety_fault(&safety, 4));
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, safety_board_fault(&safety));
}

TEST(limits_are_as_they_are_written)
{
    safety_sample_t sample = {.current_ma = 74, .voltage_mv = 15, .expected_ma = 300};
    ticks(4, &sample, parameters.bad_samples);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_OPEN_SPRING, safety_fault(&safety, 4));
    sample.sensor_status = 5; /* of a later driver */
    ticks(3, &sample, parameters.bad_samples);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_SENSOR_ABSENT, safety_fault(&safety, 3));
    TEST_ASSERT_TRUE(safety_init(&safety, &parameters, SAFETY_MAX_SPRINGS, NULL));
}
