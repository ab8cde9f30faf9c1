/* What a turn's readings are taken for, in a heating and in a hold: a row is what was read before
 * and now; numbers are those of docs/believing.md. */
#include <math.h>
#include <stdio.h>

#include "../run_tests.h"
#include "one_spring.h"
#include "rules.h"
#include "spring_estimator_internal.h"

#define OHM         0.25
#define MOST_PER_K  (0.0015 / 0.85) /* the largest coefficient, of a spring that is 15 % lighter */
#define LEAST_PER_K (-0.0003 / 0.85)

#define NEAR(is, value)                                                                            \
    TEST_ASSERT_FLOAT_WITHIN(1e-6f + 3e-4f * fabsf((float)(is)), (float)(is), (value))

static void put(double c)
{
    thermal_model_set_temperature(&model, 0, (int16_t)lround(c * 128.0));
    INSIDE.last_c7 = thermal_model_temperature_c7(&model, 0);
}

static const spring_sight_t *sight(void)
{
    return spring_sights_newest(sights_inside(&estimator), 0);
}

static void give(double current_a, double ohm)
{
    give_readings(15, current_a, ohm);
}

/* ---- readings ---- */

/* Four of 50 mA and of a voltage that a spring has make one, less the sensor's offset; without
 * current it begins anew. */
TEST(reading_is_the_mean_of_enough_of_them)
{
    static const struct {
        unsigned count;
        int16_t ma, mv;
        bool disturbed, reads;
        double ohm;
        uint8_t fresh;
    } table[] = {
        {4, 2000, 500, false, true, 0.249, 8}, {3, 2000, 500, false, false, 0.0, 7},
        {4, 50, 12, false, true, 0.2, 8},      {4, 49, 12, false, false, 0.0, 7},
        {12, 4, 1, false, false, 0.0, 0},      {10, 5, 1, false, false, 0.0, 7},
        {12, 0, 0, true, false, 0.0, 7},       {4, 2000, 0, false, false, 0.0, 7},
        {0, 0, 0, false, false, 0.0, 0},       {15, 4095, 4095, false, true, 0.99951, 8},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold();
        row(n);
        INSIDE.fresh = 7;
        INSIDE.learnt.offset_v = 0.002f;
        INSIDE.quiet = 9;
        INSIDE.current_a = 1e-3f * table[n].ma;
        INSIDE.ohm_before[1] = 0.25f;
        for (unsigned m = 0; m < table[n].count; m++) {
            spring_estimator_take(&estimator, 0, table[n].ma, table[n].mv);
        }
        INSIDE.cut_short = table[n].disturbed;
        (void)spring_take_readings(&estimator, &model, 0);
        TEST_ASSERT_EQUAL(table[n].reads, INSIDE.reads);
        TEST_ASSERT_EQUAL(!table[n].reads, INSIDE.unread);
        TEST_ASSERT_EQUAL_UINT8(table[n].fresh, INSIDE.fresh);
        NEAR(table[n].ohm, INSIDE.ohm);
        TEST_ASSERT_EQUAL_UINT8(table[n].disturbed ? 0 : 9, INSIDE.quiet);
        TEST_ASSERT_FALSE(INSIDE.cut_short || INSIDE.readings || INSIDE.current_sum_ma ||
                          INSIDE.voltage_sum_mv);
        if (!table[n].reads) {
            TEST_ASSERT_EQUAL_FLOAT(0.0f, INSIDE.ohm_before[1]);
        }
    }
}

/* Not below 0, nor beyond what a sum of 15 holds; eight after a jump of current are left out. */
TEST(readings_that_no_sensor_gives_are_left_out)
{
    static const struct {
        int16_t ma, mv;
        bool taken;
    } table[] = {{0, 0, true},     {4095, 4095, true}, {4096, 1, false},
                 {1, 4096, false}, {-1, 1, false},     {1, -1, false}};
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold();
        row(n);
        spring_estimator_take(&estimator, 0, 7, 9);
        spring_estimator_disturb(&estimator, 0);
        TEST_ASSERT_TRUE(INSIDE.cut_short && INSIDE.readings == 0);
        for (unsigned m = 1; m <= 12; m++) {
            spring_estimator_take(&estimator, 0, table[n].ma, table[n].mv);
            const unsigned taken = m > 8 && table[n].taken ? m - 8 : 0;
            TEST_ASSERT_EQUAL_UINT8(taken, INSIDE.readings);
            TEST_ASSERT_EQUAL_UINT16(taken * (unsigned)table[n].ma, INSIDE.current_sum_ma);
            TEST_ASSERT_EQUAL_UINT16(taken * (unsigned)table[n].mv, INSIDE.voltage_sum_mv);
        }
    }
}

/* A sensor that shows 0.3 A in a spring that gets nothing, or a short: 4 mV, a step of its
 * register, are no resistance, and no noise of one. */
TEST(what_no_spring_reads_is_no_resistance)
{
    for (unsigned reads = 0; reads < 2; reads++) {
        begin_cold();
        row(reads);
        INSIDE.fresh = 9;
        INSIDE.ohm = INSIDE.slow_ohm = INSIDE.ohm_before[0] = INSIDE.ohm_before[1] = 0.22f;
        INSIDE.current_a = 0.3f;
        INSIDE.readings = 8;
        INSIDE.current_sum_ma = 8 * 300;
        INSIDE.voltage_sum_mv = reads != 0 ? 8 * 7 : 8 * 6;
        (void)spring_take_readings(&estimator, &model, 0);
        TEST_ASSERT_EQUAL(reads != 0, INSIDE.reads);
        TEST_ASSERT_EQUAL(reads == 0, INSIDE.noise < 0.003f);
        NEAR(reads != 0 ? 7.0 / 300.0 : 0.22, INSIDE.ohm);
    }
}

/* Second differences at one current tell it, by 6 % a turn; at another one it is the voltage's. The
 * average takes a sixteenth, young ones evenly; the phase is told at more than 0.8 A. */
TEST(turn_tells_noise_and_goes_into_the_average)
{
    static const struct {
        double current_a, was_a, before[2], noise; /* 0.25 ohm is read */
        uint8_t fresh, averaged;
        bool unread;
        double noise_then, before_then, share;
        bool phase;
    } table[] = {
        /* by 6 % of 0.512 x 0.02 / 0.25; of no more than 5 % (the last row) */
        {2.0, 2.0, {0.24, 0.25}, 0.002, 9, 16, false, 0.0043376, 0.24, 1.0 / 16.0, true},
        {2.0, 1.81, {0.25, 0.25}, 0.002, 9, 16, false, 0.94 * 0.002, 0.25, 1.0 / 16.0, true},
        {2.0, 1.79, {0.25, 0.25}, 0.002, 9, 16, false, 0.002 * 1.79 / 2.0, 0.0, 1.0 / 16.0, true},
        {0.79, 3.0, {0.25, 0.25}, 0.02, 9, 3, false, 0.05, 0.0, 0.25, false},
        {0.81, 0.81, {0.25, 0.0}, 0.002, 9, 7, false, 0.002, 0.25, 0.125, true},
        {0.7, 0.0, {0.0, 0.0}, 0.002, 0, 9, false, 0.002, 0.0, 1.0, true},
        {0.9, 0.9, {0.2, 0.0}, 0.002, 0, 9, false, 0.002, 0.2, 1.0, true}, /* the first: no jump */
        {2.0, 2.0, {0.25, 0.25}, 0.002, 9, 15, true, 0.94 * 0.002, 0.0, 1.0 / 16.0, true},
        {2.0, 2.0, {0.235, 0.25}, 0.002, 9, 14, false, 0.00488, 0.235, 1.0 / 15.0, true},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold();
        row(n);
        INSIDE.current_a = (float)table[n].was_a;
        INSIDE.ohm_before[0] = (float)table[n].before[0];
        INSIDE.ohm_before[1] = (float)table[n].before[1];
        INSIDE.noise = (float)table[n].noise;
        INSIDE.fresh = table[n].fresh;
        INSIDE.averaged = table[n].averaged;
        INSIDE.unread = table[n].unread;
        INSIDE.slow_ohm = 0.2f;
        INSIDE.slow_a = 1.0f;
        give(table[n].current_a, OHM);
        NEAR(table[n].share, spring_take_readings(&estimator, &model, 0));
        NEAR(table[n].noise_then, INSIDE.noise);
        NEAR(table[n].before_then, INSIDE.ohm_before[1]);
        TEST_ASSERT_FLOAT_WITHIN(2e-4f, 0.25f, INSIDE.ohm_before[0]);
        TEST_ASSERT_FLOAT_WITHIN(2e-4f, 0.25f, INSIDE.ohm);
        TEST_ASSERT_FLOAT_WITHIN(2e-4f, 0.2f + 0.05f * (float)table[n].share, INSIDE.slow_ohm);
        NEAR(1.0 + (table[n].current_a - 1.0) * table[n].share, INSIDE.slow_a);
        TEST_ASSERT_EQUAL(table[n].phase, INSIDE.phase_ohm > 0.0f);
        TEST_ASSERT_EQUAL_UINT8(table[n].fresh + 1, INSIDE.fresh);
        TEST_ASSERT_UINT8_WITHIN(0, fmin(16.0, round(1.0 / table[n].share)), INSIDE.averaged);
        TEST_ASSERT_FALSE(INSIDE.unread);
    }
}

/* A step beyond 1 % in a hold (8 % as a load may), and 5 sd of noise, and what the offset may show:
 * the first is left out, the second is a jump. */
TEST(what_no_phase_does_so_fast_is_a_jump)
{
    static const struct {
        bool heating;
        double step, current_a, was_a, change;
        uint8_t averaged;
        uint16_t unsteady;
        double noise, offset_sd_v;
        bool jumps;
    } table[] = {
        {false, 0.019, 2.0, 2.0, 0.2, 16, 0, 0.002, 0.0, false},
        {false, 0.021, 2.0, 2.0, 0.2, 16, 0, 0.002, 0.0, true},
        {false, 0.021, 2.0, 2.0, 0.2, 1, 0, 0.002, 0.0, true},
        {false, -0.089, 2.0, 2.0, 0.2, 16, 0, 0.002, 0.0, false},
        {false, -0.091, 2.0, 2.0, 0.2, 16, 0, 0.002, 0.0, true},
        {false, -0.021, 2.0, 2.0, 0.2, 16, 5, 0.002, 0.0, true},
        {false, -0.019, 2.0, 2.0, 0.2, 16, 5, 0.002, 0.0, false},
        {false, -0.021, 2.0, 2.0, -0.2, 16, 0, 0.002, 0.0, true},
        {false, 0.089, 2.0, 2.0, -0.2, 16, 0, 0.002, 0.0, false},
        {false, 0.2, 0.6, 0.6, 0.2, 16, 0, 0.002, 0.0, false},
        {false, 0.2, 0.61, 0.61, 0.2, 16, 0, 0.002, 0.0, true},
        {false, 0.029, 1.0, 2.0, 0.2, 16, 0, 0.002, 0.0, false},
        {false, 0.031, 1.0, 2.0, 0.2, 16, 0, 0.002, 0.0, true},
        {false, 0.021, 2.0, 1.5, 0.2, 16, 0, 0.002, 0.0, true},
        {false, 0.025, 1.0, 1.0, 0.2, 16, 0, 0.002, 0.001, false},
        {false, 0.027, 1.0, 1.0, 0.2, 16, 0, 0.002, 0.001, true},
        {false, 0.0105, 2.0, 2.0, 0.2, 16, 0, 0.0, 0.0, true},
        {false, 0.0095, 2.0, 2.0, 0.2, 16, 0, 0.0, 0.0, false},
        {true, 0.2, 2.0, 2.0, 0.2, 16, 0, 0.002, 0.0, false},
        {false, 0.1, 2.0, 2.0, 0.2, 16, 1024, 0.002, 0.0, true}, /* the second, and the third */
        {false, 0.1, 2.0, 2.0, 0.2, 16, 1026, 0.002, 0.0, true},
        {false, 0.1, 2.0, 2.0, 0.2, 16, 2050, 0.002, 0.0, true},
    };
    for (size_t n = 0; n < 2u * ROWS(table); n++) {
        const bool odd = n % 2u != 0, jumps = table[n / 2u].jumps;
        const uint16_t unsteady = table[n / 2u].unsteady;
        begin_cold();
        row(n / 2u);
        INSIDE.possible = A;
        INSIDE.heating = table[n / 2u].heating;
        if (INSIDE.heating) {
            INSIDE.run.heat.mark_ohm = 0.25f;
        } else {
            INSIDE.run.line = (spring_line_t){.ohm = 0.25f, .a = 2.0f, .was_ohm = {0.25f, 0.25f}};
        }
        INSIDE.slow_ohm = 0.25f;
        INSIDE.ohm_before[0] = 0.25f;
        INSIDE.current_a = (float)table[n / 2u].was_a;
        INSIDE.learnt.austenite_ohm = 0.25f;
        INSIDE.learnt.change = (float)table[n / 2u].change;
        INSIDE.averaged = table[n / 2u].averaged;
        INSIDE.unsteady = unsteady;
        INSIDE.noise = (float)table[n / 2u].noise;
        INSIDE.offset_sd_v = (float)table[n / 2u].offset_sd_v;
        INSIDE.fresh = 9;
        INSIDE.odd = odd;
        const uint32_t sights = sights_inside(&estimator)->numbers;
        give(table[n / 2u].current_a, OHM * (1.0 + table[n / 2u].step));
        (void)spring_take_readings(&estimator, &model, 0);
        const uint16_t left = unsteady != 0 ? (uint16_t)(unsteady - 1u) : 0u;
        const bool out = jumps && !odd, counts = out && left <= 2048u;
        const bool becomes_loose = counts && left > 1024u;
        TEST_ASSERT_EQUAL(out, INSIDE.odd);
        TEST_ASSERT_EQUAL_UINT8(out ? 9 : 10, INSIDE.fresh);
        TEST_ASSERT_EQUAL_UINT16(left + (counts ? 1024u : 0u), INSIDE.unsteady);
        TEST_ASSERT_FLOAT_WITHIN(3e-4f,
                                 jumps && odd ? 0.25f * (1.0f + (float)table[n / 2u].step) : 0.25f,
                                 INSIDE.learnt.austenite_ohm);
        TEST_ASSERT_EQUAL((jumps && odd) || becomes_loose,
                          sights_inside(&estimator)->numbers == sights + 1u);
        if (sights_inside(&estimator)->numbers != sights) {
            TEST_ASSERT_EQUAL_UINT8(SPRING_SIGHT_JUMPED, sight()->kind);
            TEST_ASSERT_EQUAL_UINT8(becomes_loose ? SPRING_DID_BLIND : 0, sight()->did);
            TEST_ASSERT_TRUE(sight()->seen == 0 && sight()->seen_sd == 0);
            TEST_ASSERT_INT_WITHIN(20, lround(1e4 * table[n / 2u].step), sight()->read);
        }
        TEST_ASSERT_EQUAL(becomes_loose || left > 2048u, spring_is_loose(&INSIDE));
    }
}

/* A hold that has no line yet has nothing to jump from. */
TEST(nothing_jumps_before_its_line_begins)
{
    for (int line = 0; line < 2; line++) {
        begin_cold();
        INSIDE.possible = A;
        INSIDE.run.line = (spring_line_t){.ohm = line != 0 ? 0.25f : 0.0f, .a = 2.0f};
        INSIDE.slow_ohm = 0.25f;
        INSIDE.current_a = 2.0f;
        INSIDE.averaged = 16;
        INSIDE.noise = 0.002f;
        INSIDE.offset_sd_v = 0.0f;
        INSIDE.fresh = 9;
        give(2.0, 0.3);
        (void)spring_take_readings(&estimator, &model, 0);
        TEST_ASSERT_EQUAL(line != 0, INSIDE.odd);
    }
}

/* ---- a heating ---- */

static void begin_heating_at(double c, uint8_t possible, double heat_k)
{
    begin_cold();
    put(c);
    INSIDE.possible = possible;
    INSIDE.variance_k2 = 9.0f;
    INSIDE.heating = true;
    INSIDE.fresh = 20;
    INSIDE.reads = true;
    INSIDE.current_a = 2.0f;
    INSIDE.noise = 0.001f;
    INSIDE.offset_sd_v = 0.001f;
    INSIDE.ohm = 0.2f;
    INSIDE.run.heat = (spring_heat_t){.begun_c = 20.0f,
                                      .heat_k = (float)heat_k,
                                      .peak_k = 10.0f,
                                      .mark_k = 10.0f,
                                      .mark_ohm = 0.2f,
                                      .onset_ohm = 0.2f,
                                      .onset_k = 5.0f,
                                      .flat_k = 1.0f};
}

/* Over 2 K of heat or more (1600 times the noise) more than any coefficient makes: 1 % and 4 sd of
 * that, added up, is an onset; of a spring whose change is known, that way alone. */
TEST(onset_is_a_change_that_no_coefficient_makes)
{
    static const struct {
        double step_k, change, noise, learnt_change, excess;
        bool compares, onset;
        double excess_then;
    } table[] = {
        {1.9, 0.1, 0.001, 0.0, 0.0, false, false, 0.0},
        {2.0, 2 * MOST_PER_K + 0.0139, 0.001, 0.0, 0.0, true, false, 0.0139},
        {2.0, 2 * MOST_PER_K + 0.0141, 0.001, 0.0, 0.0, true, true, 0.0},
        {2.0, 2 * LEAST_PER_K - 0.0139, 0.001, 0.0, 0.0, true, false, -0.0139},
        {2.0, 2 * LEAST_PER_K - 0.0141, 0.001, 0.0, 0.0, true, true, 0.0},
        {2.0, 0.003, 0.001, 0.0, 0.008, true, false, 0.0},
        {4.0, 4 * MOST_PER_K + 0.0061, 0.001, 0.0, 0.008, true, true, 0.0},
        {4.0, 4 * MOST_PER_K + 0.0059, 0.001, 0.0, 0.008, true, false, 0.0139},
        {4.0, 4 * MOST_PER_K + 0.0061, 0.001, 0.0, -0.008, true, false, 0.0061},
        {4.0, 0.05, 0.001, -0.2, -0.008, true, false, 0.0},
        {4.0, 4 * MOST_PER_K + 0.0141, 0.001, 0.2, 0.0, true, true, 0.0},
        {3.1, 0.1, 0.002, 0.0, 0.0, false, false, 0.0},
        {3.3, 3.3 * MOST_PER_K + 0.0179, 0.002, 0.0, 0.0, true, false, 0.0179},
        {3.3, 3.3 * MOST_PER_K + 0.0181, 0.002, 0.0, 0.0, true, true, 0.0},
        /* 2 sd: it still changes */
        {2.0, 2 * MOST_PER_K + 0.0019, 0.001, 0.0, 0.0, true, false, 0.0019},
        {2.0, 2 * MOST_PER_K + 0.0021, 0.001, 0.0, 0.0, true, false, 0.0021},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_heating_at(85.0, B, 10.0 + table[n].step_k);
        row(n);
        INSIDE.noise = (float)table[n].noise;
        INSIDE.learnt.austenite_ohm = table[n].learnt_change == 0.0 ? 0.0f : 0.25f;
        INSIDE.learnt.change = (float)table[n].learnt_change;
        INSIDE.run.heat.excess = (float)table[n].excess;
        INSIDE.run.heat.onset_ohm = 0.19f;
        INSIDE.ohm = (float)(0.2 * (1.0 + table[n].change));
        spring_heating_watch(&estimator, &INSIDE, &model, 0);
        const bool counted_anew =
            table[n].compares && (table[n].excess == 0.0 || n == 5 || n == 8 || n == 9);
        TEST_ASSERT_EQUAL(table[n].onset, INSIDE.onset);
        TEST_ASSERT_EQUAL(table[n].onset, INSIDE.steep);
        TEST_ASSERT_EQUAL(table[n].compares && n != 5 && n != 14, INSIDE.changes);
        TEST_ASSERT_EQUAL(table[n].onset, sight()->kind == SPRING_SIGHT_ONSET);
        TEST_ASSERT_FLOAT_WITHIN(3e-5f, (float)table[n].excess_then, INSIDE.run.heat.excess);
        NEAR(table[n].compares ? 10.0 + table[n].step_k : 10.0, INSIDE.run.heat.mark_k);
        NEAR(table[n].compares ? (double)INSIDE.ohm : 0.2, INSIDE.run.heat.mark_ohm);
        NEAR(counted_anew ? 0.2 : 0.19, INSIDE.run.heat.onset_ohm);
        NEAR(table[n].onset ? 10.0 + table[n].step_k
             : counted_anew ? 10.0
                            : 5.0,
             INSIDE.run.heat.onset_k);
        NEAR(table[n].compares ? 0.0 : 1.0, INSIDE.run.heat.flat_k);
        NEAR(10.0 + table[n].step_k, INSIDE.run.heat.peak_k);
    }
}

/* As long as it surely is martensite its own rise with heat is told, step by step; from 10 K on
 * nothing beyond that, a quarter of the largest coefficient and its noise is a coefficient. */
TEST(rise_of_its_own_martensite_is_no_onset)
{
    static const struct {
        double c;
        bool told;
    } tells[] = {{79.0, true}, {81.0, false}, {40.0, true}};
    for (size_t n = 0; n < ROWS(tells); n++) {
        begin_heating_at(tells[n].c, M, 14.0);
        row(n);
        INSIDE.run.heat.rise = 0.012f;
        INSIDE.run.heat.rise_k = 8.0f;
        INSIDE.ohm = 0.201f;
        spring_heating_watch(&estimator, &INSIDE, &model, 0);
        NEAR(tells[n].told ? 12.0 : 8.0, INSIDE.run.heat.rise_k);
        NEAR(tells[n].told ? 0.017 : 0.012, INSIDE.run.heat.rise);
    }
    static const struct {
        uint8_t possible;
        double rise_k, rise_per_k, most_per_k, least_per_k;
    } table[] = {
        {M, 9.9, 0.001, MOST_PER_K, LEAST_PER_K},
        {M, 10.1, 0.001, 0.0014 + 0.004 / 10.1, 0.0006 - 0.004 / 10.1},
        {M, 40.0, 0.001, 0.0015, 0.0005},
        {M, 40.0, -0.0001, 0.0004, LEAST_PER_K},
        {M, 40.0, 0.0016, MOST_PER_K, 0.0011},
        {B, 40.0, 0.001, MOST_PER_K, LEAST_PER_K},
    };
    for (size_t n = 0; n < 2 * ROWS(table); n++) {
        for (int beyond = 0; beyond < 2; beyond++) {
            const bool less = n % 2u != 0;
            begin_heating_at(85.0, table[n / 2u].possible, 14.0);
            row(n);
            INSIDE.run.heat.rise_k = (float)table[n / 2u].rise_k;
            INSIDE.run.heat.rise = (float)(table[n / 2u].rise_per_k * table[n / 2u].rise_k);
            const double is = beyond ? 0.0142 : 0.0138; /* 1 % and 4 of a noise of 0.1 % */
            const double change =
                4.0 * (less ? table[n / 2u].least_per_k : table[n / 2u].most_per_k) +
                (less ? -is : is);
            INSIDE.ohm = (float)(0.2 * (1.0 + change));
            spring_heating_watch(&estimator, &INSIDE, &model, 0);
            TEST_ASSERT_EQUAL(beyond, INSIDE.onset);
        }
    }
}

/* A slow step compares the mean of its turns with that of the one before: the more turns, the less
 * heat it needs (a 1600th of the noise, over the root of them; 2 K), and the less is noise. */
TEST(slow_step_compares_means)
{
    static const struct {
        double noise, turn_k, change;
        unsigned turns;
        bool changes;
    } table[] = {
        {0.004, 0.5, 6 * 0.5 * MOST_PER_K + 0.0034, 6, true},
        {0.004, 0.5, 6 * 0.5 * MOST_PER_K + 0.0031, 6, false},
        {0.001, 0.25, 8 * 0.25 * MOST_PER_K + 0.0008, 8, true},
        {0.001, 0.25, 8 * 0.25 * MOST_PER_K + 0.0006, 8, false},
        {0.002, 0.001, 0.001, 255, true},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_heating_at(85.0, B, 10.0);
        row(n);
        INSIDE.noise = (float)table[n].noise;
        const double mean_ohm = 0.2 * (1.0 + table[n].change);
        for (unsigned turn = 1; turn <= table[n].turns; turn++) {
            TEST_ASSERT_EQUAL_UINT8(turn - 1u, INSIDE.run.heat.turns);
            NEAR(0.2, INSIDE.run.heat.mark_ohm);
            INSIDE.run.heat.heat_k = (float)(10.0 + turn * table[n].turn_k);
            const bool odd = turn == table[n].turns && turn % 2u == 1u;
            INSIDE.ohm = (float)(mean_ohm + (odd ? 0.0 : turn % 2u == 1u ? 0.004 : -0.004));
            spring_heating_watch(&estimator, &INSIDE, &model, 0);
        }
        TEST_ASSERT_EQUAL_UINT8(0, INSIDE.run.heat.turns);
        NEAR(0.0, INSIDE.run.heat.sum_ohm);
        NEAR(mean_ohm, INSIDE.run.heat.mark_ohm);
        NEAR(10.0 + table[n].turns * table[n].turn_k, INSIDE.run.heat.mark_k);
        TEST_ASSERT_EQUAL(table[n].changes, INSIDE.changes);
    }
}

/* Where nothing can be compared, nothing is: the mark is begun anew, or stays. */
TEST(heating_that_cannot_be_compared_is_marked_anew)
{
    static const struct {
        uint8_t possible, settling;
        double current_a, peak_k, mark_ohm, then_ohm, mark_k;
    } table[] = {
        {B, 0, 0.79, 10.0, 0.2, 0.0, 10.0}, {B, 0, 0.8, 10.0, 0.2, 0.3, 14.0},
        {A, 0, 2.0, 10.0, 0.2, 0.0, 10.0},  {SPRING_PHASE_ANY, 0, 2.0, 10.0, 0.2, 0.0, 10.0},
        {B, 1, 2.0, 10.0, 0.2, 0.0, 10.0},  {B, 0, 2.0, 14.1, 0.2, 0.2, 10.0},
        {B, 0, 2.0, 10.0, 0.0, 0.3, 14.0},  {B, 0, 2.0, 14.0, 0.0, 0.3, 14.0},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_heating_at(85.0, table[n].possible, 14.0);
        row(n);
        INSIDE.settling = table[n].settling;
        INSIDE.current_a = (float)table[n].current_a;
        INSIDE.run.heat.peak_k = (float)table[n].peak_k;
        INSIDE.run.heat.mark_ohm = (float)table[n].mark_ohm;
        INSIDE.ohm = 0.3f;
        spring_heating_watch(&estimator, &INSIDE, &model, 0);
        NEAR(table[n].then_ohm, INSIDE.run.heat.mark_ohm);
        NEAR(table[n].mark_k, INSIDE.run.heat.mark_k);
        TEST_ASSERT_EQUAL(n == 1, INSIDE.onset);
    }
}

/* After that its next step is from a single turn to the mean of those that follow: half of its heat
 * and a half of a turn's. And heat in which nothing was compared is none without a change, if it
 * had changed until then. */
TEST(step_that_begins_anew_is_from_its_first_turn_to_a_mean)
{
    for (int turns = 1; turns <= 3; turns++) {
        const double apart_k = 3.0 * 0.5 * (1.0 + 1.0 / turns);
        for (int n = 0; n < 4; n++) {
            const bool changed = n % 2 != 0, changes = n / 2 != 0;
            begin_heating_at(85.0, B, 14.0);
            row((size_t)(4 * turns + n));
            INSIDE.onset = true;
            INSIDE.changes = changed;
            INSIDE.noise = 0.0f;
            INSIDE.run.heat.mark_ohm = 0.0f;
            INSIDE.ohm = 0.2f;
            spring_heating_watch(&estimator, &INSIDE, &model, 0);
            NEAR(changed ? 0.0 : 1.0, INSIDE.run.heat.flat_k);
            const double beyond = changes ? 0.0001 : -0.0001;
            for (int turn = 1; turn <= turns; turn++) {
                INSIDE.run.heat.heat_k = turn < turns ? 15.9f : 17.0f; /* the last ends it */
                INSIDE.ohm = (float)(0.2 * (1.0 + MOST_PER_K * apart_k + beyond));
                spring_heating_watch(&estimator, &INSIDE, &model, 0);
            }
            TEST_ASSERT_EQUAL(changes, INSIDE.changes);
            /* the one that follows is from mean to mean */
            INSIDE.ohm *= (float)(1.0 + 3.0 * MOST_PER_K + beyond);
            for (int turn = 1; turn <= 2; turn++) {
                INSIDE.run.heat.heat_k = turn == 1 ? 18.9f : 20.0f;
                spring_heating_watch(&estimator, &INSIDE, &model, 0);
            }
            TEST_ASSERT_EQUAL(changes, INSIDE.changes);
        }
    }
    begin_heating_at(79.0, M, 14.0);
    INSIDE.run.heat.cold_ohm = 0.2f;
    INSIDE.run.heat.mark_ohm = 0.0f;
    for (int turn = 0; turn <= 2; turn++) {
        INSIDE.run.heat.heat_k = turn < 2 ? 14.0f + 1.9f * (float)turn : 17.0f;
        spring_heating_watch(&estimator, &INSIDE, &model, 0);
    }
    NEAR(3.0 * 0.75, INSIDE.run.heat.rise_k);
}

/* Martensite's onset is seen at austenite start and 2 K, or as far on as it took up heat; more than
 * 2.6 sd below, it was a contact's. What led there is its coefficient, as any metal has. */
TEST(onset_puts_it_at_its_start_and_teaches_its_martensite)
{
    static const struct {
        double c, cold_ohm, cold_c, heat_k;
        uint16_t unsteady;
        bool seen;
        double seen_c, martensite_ohm, rise_per_k;
    } table[] = {
        {85.0, 0.19, 25.0, 12.0, 0, true, 90.0, 0.19 - 5 * 0.01 / 60, 0.01 / 60 / 0.189167},
        {85.0, 0.19, 66.0, 30.0, 0, true, 88.0 + 20.0 * 10.0 / 38.833, 0.0, 0.0},
        {85.0, 0.195, 64.0, 12.0, 9, true, 90.0, 0.195 - 44 * 0.005 / 21, 0.005 / 21 / 0.184524},
        {85.0, 0.17, 25.0, 12.0, 0, true, 90.0, 0.0, 0.0},
        {85.0, 0.21, 25.0, 12.0, 0, true, 90.0, 0.0, 0.0},
        {85.0, 0.0, 25.0, 12.0, 0, true, 90.0, 0.0, 0.0},
        {85.0, 0.2005, 90.0, 12.0, 0, true, 90.0, 0.0, 0.0}, /* it has cooled since */
        {80.3, 0.19, 25.0, 12.0, 0, true, 90.0, 0.19 - 5 * 0.01 / 55.3, 0.01 / 55.3 / 0.189096},
        {80.1, 0.19, 25.0, 12.0, 0, false, 0.0, 0.0, 0.0},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_heating_at(table[n].c, M, table[n].heat_k);
        row(n);
        INSIDE.run.heat.cold_ohm = (float)table[n].cold_ohm;
        INSIDE.run.heat.cold_c = (float)table[n].cold_c;
        INSIDE.unsteady = table[n].unsteady;
        INSIDE.gone_k = 5.0f;
        INSIDE.gone_w_per_k = 1e-4f;
        INSIDE.ohm = 0.26f;
        spring_heating_watch(&estimator, &INSIDE, &model, 0);
        TEST_ASSERT_EQUAL(table[n].seen, INSIDE.onset);
        TEST_ASSERT_EQUAL_UINT8(table[n].seen ? B : M, INSIDE.possible);
        TEST_ASSERT_EQUAL_UINT8(table[n].seen ? SPRING_SIGHT_ONSET : SPRING_SIGHT_JUMPED,
                                sight()->kind);
        TEST_ASSERT_INT_WITHIN(1, lround(1e4 * (0.3 - MOST_PER_K * (table[n].heat_k - 10.0))),
                               sight()->read);
        NEAR(table[n].martensite_ohm, INSIDE.learnt.martensite_ohm);
        NEAR(table[n].rise_per_k, INSIDE.learnt.martensite_rise_per_k);
        TEST_ASSERT_EQUAL_FLOAT(0.0f, INSIDE.run.heat.excess);
        if (table[n].seen) {
            TEST_ASSERT_INT_WITHIN(1, lround(10.0 * (table[n].seen_c - 78.0)), sight()->seen);
            TEST_ASSERT_EQUAL_UINT8(30, sight()->seen_sd);
            NEAR(table[n].heat_k, INSIDE.run.heat.onset_k);
            /* what it had lost was phase, unless a contact jumped */
            TEST_ASSERT_EQUAL_FLOAT(table[n].unsteady ? 5.0f : 0.0f, INSIDE.gone_k);
            TEST_ASSERT_EQUAL_FLOAT(table[n].unsteady ? 1e-4f : 0.0f, INSIDE.gone_w_per_k);
        } else {
            NEAR(0.26 * table[n].cold_ohm / 0.2, INSIDE.run.heat.cold_ohm);
            TEST_ASSERT_EQUAL_UINT8(0, sight()->seen_sd);
        }
    }
}

/* A heating from part way: what reads as austenite takes up no latent heat any more, as far up the
 * transformation; where the model has more, or nothing is read, that stays. */
TEST(heating_from_part_way_begins_with_the_phase_that_it_reads)
{
    static const struct {
        uint8_t possible;
        double c, phase;
        bool reads;
        double model_phase;
    } table[] = {
        {B, 80.0, 0.8, true, 0.905},  {B | A, 80.0, 0.8, true, 0.905}, {B, 80.0, 1.0, true, 1.0},
        {B, 80.0, 0.8, false, 0.0},   {M, 80.0, 0.8, true, 0.0},       {B, 80.0, 0.0, true, 0.0},
        {B, 95.0, 0.3, true, 0.4218},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_heating_at(table[n].c, table[n].possible, 14.0);
        row(n);
        INSIDE.reads = table[n].reads;
        INSIDE.run.heat.mark_ohm = 0.0f;
        INSIDE.run.heat.cold_ohm = table[n].possible == M ? 0.2f : 0.0f;
        INSIDE.learnt.austenite_ohm = 0.25f;
        INSIDE.learnt.change = 0.2f;
        INSIDE.phase_ohm = (float)(0.25 * (1.0 - 0.2 * (1.0 - table[n].phase)));
        const double was = thermal_model_austenite(&model, 0) / 32768.0;
        const bool more = table[n].model_phase > was + 0.001;
        spring_heating_watch(&estimator, &INSIDE, &model, 0);
        TEST_ASSERT_FLOAT_WITHIN(0.003f, (float)(more ? table[n].model_phase : was),
                                 (float)thermal_model_austenite(&model, 0) / 32768.0f);
        TEST_ASSERT_EQUAL_INT16(128.0 * table[n].c, thermal_model_temperature_c7(&model, 0));
        TEST_ASSERT_EQUAL(more, INSIDE.seen);
        NEAR(0.2, INSIDE.run.heat.mark_ohm);
    }
}

/* 4 K of heat without a change, 0.8 K / change to 12 K: it is over, if it has changed by 1 %, and
 * by 1 % since its onset. It is seen at austenite finish and that heat. What a heating from part
 * way changes is not all: there the declared change stands in. From a level it waits for its ends
 * while it reads less than its own austenite, 0.3 ohm. */
TEST(finish_is_heat_without_a_change)
{
    static const struct {
        double learnt_change, flat_k, ohm, cold_ohm, excess;
        bool over;
        double beyond_k, change;
        bool from_level;
    } table[] = {
        {0.0, 3.9, 0.25, 0.2, 0.02, false, 0.0, 0.0, false},
        {0.0, 4.1, 0.25, 0.2, 0.02, true, 4.1, 0.2, false},
        {0.0, 4.1, 0.25, 0.2, 0.0099, false, 0.0, 0.0, false},
        {0.0, 4.1, 0.25, 0.0, 0.0, false, 0.0, 0.0, false},
        {0.0, 12.1, 0.25, 0.0, 0.0, true, 4.1, 0.2, false},
        {0.0, 4.1, 0.16, 0.2, -0.02, true, 4.1, -0.25, false},
        {0.0, 12.1, 0.2019, 0.2, 0.02, false, 0.0, 0.0, false},
        {0.0, 12.1, 0.2021, 0.2, 0.02, true, 4.1, 0.010391, false},
        {0.0, 11.9, 0.2021, 0.2, 0.02, false, 0.0, 0.0, false},
        {0.1, 7.9, 0.25, 0.2, 0.02, false, 0.0, 0.0, false},
        {0.1, 8.0, 0.25, 0.2, 0.02, true, 8.0 - (0.8 / 0.101 - 4.0), 0.2, false},
        {0.1, 8.0, 0.25, 0.0, 0.0, true, 8.0 - (0.8 / 0.101 - 4.0), 0.1, false},
        {0.1, 8.0, 0.25, 0.0, 0.0, false, 0.0, 0.0, true},
        {0.1, 8.0, 0.297, 0.0, 0.0, true, 8.0 - (0.8 / 0.101 - 4.0), 0.1, true},
        {0.0, 12.1, 0.25, 0.0, 0.0, true, 4.1, 0.2, true},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_heating_at(95.0, B, 20.0);
        row(n);
        INSIDE.onset = true;
        INSIDE.noise = n == 0 ? 0.0f : INSIDE.noise; /* by none of it, either */
        INSIDE.steep = true;
        INSIDE.blind = !table[n].from_level; /* it is seen */
        INSIDE.lost = 0.5f;
        INSIDE.ohm = INSIDE.run.heat.mark_ohm = (float)table[n].ohm;
        INSIDE.learnt.austenite_ohm = table[n].learnt_change == 0.0 ? 0.0f : 0.3f;
        INSIDE.learnt.change = (float)table[n].learnt_change;
        INSIDE.run.heat.cold_ohm = (float)table[n].cold_ohm;
        INSIDE.run.heat.excess = (float)table[n].excess;
        INSIDE.run.heat.flat_k = (float)table[n].flat_k;
        INSIDE.from_full = !table[n].from_level;
        spring_heating_watch(&estimator, &INSIDE, &model, 0);
        TEST_ASSERT_FALSE(INSIDE.steep);
        TEST_ASSERT_EQUAL_UINT8(table[n].over ? A : B, INSIDE.possible);
        TEST_ASSERT_EQUAL(!table[n].over && !table[n].from_level, INSIDE.blind);
        TEST_ASSERT_EQUAL_FLOAT(table[n].over ? 0.0f : 0.5f, INSIDE.lost);
        if (table[n].over) {
            NEAR(table[n].ohm, INSIDE.learnt.austenite_ohm);
            NEAR(table[n].change, INSIDE.learnt.change);
            TEST_ASSERT_EQUAL_UINT8(SPRING_SIGHT_FINISH, sight()->kind);
            TEST_ASSERT_INT_WITHIN(1, lround(200.0 + 10.0 * table[n].beyond_k), sight()->seen);
            TEST_ASSERT_EQUAL_UINT8(10, sight()->read_sd);
        }
    }
}

/* While it still changes, or lacks phase that it is known to have, it is no hotter than austenite
 * finish (martensite: its onset), until the coldest and heaviest would be. Where only the level of
 * its resistance says so, it loses more than is believed; or a sensor's step has moved it: that
 * stays a doubt, it may be as hot as it was. */
TEST(what_still_transforms_is_no_hotter_than_that_lets_it_be)
{
    static const struct {
        uint8_t possible;
        bool steep, learnt, blind, onset;
        double c, flat_k, shift_sd, ohm, heat_k; /* 0.25 was learnt */
        double then_c;
        bool from_level;
    } table[] = {
        {B, true, false, false, true, 99, 0, 1, 0.25, 10, 98, false},
        {B, true, false, false, true, 97, 0, 1, 0.25, 10, 97, false},
        {B, false, false, false, true, 99, 0, 1, 0.25, 10, 99, false},
        {B, false, true, false, true, 99, 3.9, 1, 0.24, 10, 98, false},
        {B, false, true, false, true, 99, 4.0, 1, 0.24, 10, 99, false},
        {B, false, true, false, true, 99, 3.9, 1, 0.25, 10, 99, false},
        {B, false, true, true, true, 99, 3.9, 1, 0.24, 10, 99, false},
        {B, false, true, false, false, 99, 9, 3, 0.24, 10, 98, false},
        {B, false, true, false, false, 99, 9, 2.9, 0.24, 10, 99, false},
        {B, false, true, false, false, 99, 9, 2.9, 0.24, 10, 98, true},
        {B, false, true, false, false, 99, 9, 2.9, 0.25, 10, 99, true},
        {B, false, true, false, true, 99, 9, 2.9, 0.24, 10, 98, true},
        {B, false, true, false, false, 99, 9, 3, 0.24, 1.25 * (98 + 8 - 20 + 28.83) - 0.1, 98,
         false},
        {B, false, true, false, false, 99, 9, 3, 0.24, 1.25 * (98 + 8 - 20 + 28.83) + 0.1, 99,
         false},
        {B, true, false, false, true, 99, 0, 1, 0.25, 1.25 * (98 + 8 - 20 + 28.83) - 0.1, 98,
         false},
        {B, true, false, false, true, 99, 0, 1, 0.25, 1.25 * (98 + 8 - 20 + 28.83) + 0.1, 99,
         false},
        {A | B, true, false, false, true, 99, 0, 1, 0.25, 1.25 * (98 - 20 + 28.83) - 0.1, 98,
         false},
        {A | B, true, false, false, true, 99, 0, 1, 0.25, 1.25 * (98 - 20 + 28.83) + 0.1, 99,
         false},
        {M, false, true, false, false, 91, 9, 1, 0.2, 10, 90, false},
        {M, false, true, false, false, 89, 9, 1, 0.2, 10, 89, false},
        {M, false, false, false, false, 91, 9, 1, 0.2, 10, 91, false},
        {M, false, true, false, false, 91, 9, 1, 0.2, 1.25 * (90 + 8 - 20) - 0.1, 90, false},
        {M, false, true, false, false, 91, 9, 1, 0.2, 1.25 * (90 + 8 - 20) + 0.1, 91, false},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_heating_at(table[n].c, table[n].possible, table[n].heat_k);
        row(n);
        INSIDE.run.heat.peak_k = 1e3f; /* nothing is compared */
        INSIDE.steep = INSIDE.changes = table[n].steep;
        INSIDE.blind = table[n].blind;
        INSIDE.covariance = -0.01f;
        const float loss_w_per_k = INSIDE.learnt.loss_w_per_k;
        INSIDE.onset = table[n].onset;
        INSIDE.learnt.austenite_ohm = table[n].learnt ? 0.25f : 0.0f;
        INSIDE.learnt.change = 0.2f;
        INSIDE.ohm = (float)table[n].ohm;
        INSIDE.run.heat.flat_k = (float)table[n].flat_k;
        INSIDE.from_full = !table[n].from_level;
        INSIDE.shift_variance_k2 = (float)(table[n].shift_sd * table[n].shift_sd);
        spring_heating_watch(&estimator, &INSIDE, &model, 0);
        NEAR(table[n].then_c, spring_now_c(&model, 0));
        const bool by_level = table[n].possible != M && !table[n].steep;
        const float over_k = by_level ? (float)(table[n].c - table[n].then_c) : 0.0f;
        NEAR(over_k, spring_estimator_doubt_k(BELIEF));
        NEAR(0.01f / spring_distance_k2(&INSIDE) * over_k,
             INSIDE.learnt.loss_w_per_k - loss_w_per_k);
        TEST_ASSERT_EQUAL(table[n].then_c < table[n].c, sight()->kind == SPRING_SIGHT_TRANSFORMS);
        TEST_ASSERT_EQUAL(over_k > 0.0f, sight()->loss > 0);
        TEST_ASSERT_TRUE(sight()->seen == 0 && sight()->seen_sd == 0);
    }
}

/* A sensor showed 0.8 of its voltage until it was switched off: what was learnt went along, as by a
 * contact. It is exchanged; martensite reads 25 % more than its own, and that is no phase. */
TEST(martensite_that_reads_otherwise_than_its_own_is_of_another_circuit)
{
    static const struct {
        uint8_t possible;
        bool told;
        double was_ohm, ohm, by;
    } table[] = {{M, false, 0.140, 0.175, 1.25}, {M, false, 0.175, 0.140, 0.8},
                 {M, false, 0.175, 0.183, 1.0},  {M, false, 0.175, 0.185, 0.185 / 0.175},
                 {M, false, 0.0, 0.175, 1.0},    {M, true, 0.140, 0.175, 1.0},
                 {B, false, 0.140, 0.175, 1.0}};
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_heating_at(30.0, table[n].possible, 5.0);
        row(n);
        INSIDE.untested = table[n].told;
        INSIDE.ohm = (float)table[n].ohm;
        INSIDE.learnt.martensite_ohm = (float)table[n].was_ohm / 1.01f; /* 10 K colder */
        INSIDE.learnt.martensite_rise_per_k = 0.001f;
        INSIDE.learnt.austenite_ohm = 0.2f;
        spring_heating_watch(&estimator, &INSIDE, &model, 0);
        NEAR(table[n].by * table[n].was_ohm / 1.01, INSIDE.learnt.martensite_ohm);
        NEAR(table[n].by * 0.2, INSIDE.learnt.austenite_ohm);
        TEST_ASSERT_EQUAL(table[n].by != 1.0, sight()->kind == SPRING_SIGHT_JUMPED);
        TEST_ASSERT_INT_WITHIN(1, lround(1e4 * (table[n].by - 1.0)), sight()->read);
    }
}

/* Cold martensite of 0.75 to 1.6 of the declared resistance is this circuit's, behind the contact
 * that is declared. */
TEST(cold_martensite_is_compared_with_the_declared_one)
{
    static const struct {
        uint8_t possible;
        double ohm, cold_ohm;
        bool unlike;
        double then_ohm;
        uint32_t contact_uohm;
    } table[] = {{M, 0.75 * 0.175 + 0.051, 0.0, false, 0.18225, 50000},
                 {M, 0.75 * 0.175 + 0.049, 0.0, true, 0.18025, 50000},
                 {M, 1.6 * 0.175 + 0.049, 0.0, false, 0.329, 50000},
                 {M, 1.6 * 0.175 + 0.051, 0.0, true, 0.331, 50000},
                 {M, 0.75 * 0.175 + 0.001, 0.0, false, 0.13225, 0},
                 {M, 0.75 * 0.175 - 0.001, 0.0, true, 0.13025, 0},
                 {M, 1.6 * 0.175 - 0.001, 0.0, false, 0.279, 0},
                 {M, 1.6 * 0.175 + 0.001, 0.0, true, 0.281, 0},
                 {M, 0.5, 0.2, false, 0.2, 0},
                 {B, 0.5, 0.0, false, 0.0, 0}};
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_heating_at(30.0, table[n].possible, 5.0);
        row(n);
        INSIDE.ohm = (float)table[n].ohm;
        INSIDE.run.heat.cold_ohm = (float)table[n].cold_ohm;
        model.parameters.contact_uohm[0] = table[n].contact_uohm;
        spring_heating_watch(&estimator, &INSIDE, &model, 0);
        TEST_ASSERT_EQUAL(table[n].unlike, spring_estimator_is_unlike(BELIEF));
        NEAR(table[n].then_ohm, INSIDE.run.heat.cold_ohm);
        NEAR(n < 8 ? 30.0 : 0.0, INSIDE.run.heat.cold_c);
    }
}

/* ---- a hold ---- */

/* At rest at 84 degC, 0.25 ohm on its line; what it reads on average is given. */
static void begin_line_at(double slow_ohm)
{
    begin_cold();
    thermal_model_set_temperature(&model, 0, 110 * 128);
    put(84.0);
    INSIDE.possible = A;
    INSIDE.variance_k2 = 4.0f;
    INSIDE.covariance = -4e-4f;
    INSIDE.loss_variance = 4e-7f;
    INSIDE.fresh = 200;
    INSIDE.reads = true;
    INSIDE.current_a = INSIDE.slow_a = 2.0f;
    INSIDE.ohm = INSIDE.slow_ohm = (float)slow_ohm;
    INSIDE.noise = 1e-4f;
    INSIDE.offset_sd_v = 0.0f;
    INSIDE.averaged = 16;
    INSIDE.quiet = 100;
    INSIDE.learnt.austenite_ohm = 0.25f;
    INSIDE.learnt.change = 0.2f;
    INSIDE.learnt.slow_noise = 0.0005f;
    INSIDE.run.line = (spring_line_t){.ohm = 0.25f, .a = 2.0f};
}

static double lost_at_c(double lost)
{
    return 78.0 - 10.0 * 0.64 * sqrt(fmin(lost, 1.0));
}

/* Beyond 5 sd, or 0.12 %, it has lost phase; beyond 0.6 of that for 15 s, too; the other way it
 * takes twice as much, and an R-phase. Noise, the line's own, a temperature that is not known or
 * moves, another current each explain a part. */
TEST(phase_is_lost_where_nothing_else_explains_what_is_read)
{
    static const struct {
        double less, noise, slow_noise, line_sd, rise_sd, slow_k, offset_sd_v;
        uint8_t losing, averaged;
        bool lost;
        uint8_t losing_then;
    } table[] = {
        {0.00149, 1e-4, 5e-4, 0, 0, 0, 0, 0, 16, false, 0},
        {0.00151, 1e-4, 5e-4, 0, 0, 0, 0, 0, 16, false, 1},
        {0.00249, 1e-4, 5e-4, 0, 0, 0, 0, 58, 16, false, 59},
        {0.00151, 1e-4, 5e-4, 0, 0, 0, 0, 59, 16, true, 0},
        {0.00251, 1e-4, 5e-4, 0, 0, 0, 0, 0, 16, true, 0},
        {0.00149, 1e-4, 5e-4, 0, 0, 0, 0, 59, 16, false, 0},
        {0.00119, 1e-4, 0, 0, 0, 0, 0, 0, 16, false, 1}, /* the least */
        {0.00121, 1e-4, 0, 0, 0, 0, 0, 0, 16, true, 0},
        {0.00449, 0.005, 0, 0, 0, 0, 0, 0, 16, false, 1}, /* 0.18 of a turn's noise */
        {0.00451, 0.005, 0, 0, 0, 0, 0, 0, 16, true, 0},
        {0.00624, 0.005, 0, 0, 0, 0, 0, 0, 15, false, 1}, /* 1 / sqrt(16) of a young average */
        {0.00626, 0.005, 0, 0, 0, 0, 0, 0, 15, true, 0},
        {0.00499, 1e-4, 0, 1e-3, 0, 0, 0, 0, 16, false, 1},
        {0.00501, 1e-4, 0, 1e-3, 0, 0, 0, 0, 16, true, 0},
        {0.00529, 1e-4, 0, 0, 1e-3, 2, 0, 0, 16, false, 1}, /* 0.0012 and 2.6 x 0.002 */
        {0.00540, 1e-4, 0, 0, 1e-3, 2, 0, 0, 16, true, 0},
        {0.00319, 1e-4, 0, 0, 0, 0, 1e-3, 0, 16, false, 1}, /* at 1.33 A: 0.0012 and 0.003 */
        {0.00330, 1e-4, 0, 0, 0, 0, 1e-3, 0, 16, true, 0},
        {-0.00299, 1e-4, 5e-4, 0, 0, 0, 0, 0, 16, false, 0},
        {-0.00302, 1e-4, 5e-4, 0, 0, 0, 0, 0, 16, false, 1},
        {-0.00502, 1e-4, 5e-4, 0, 0, 0, 0, 0, 16, true, 0},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_line_at(0.25 * (1.0 - table[n].less));
        row(n);
        estimator.r_phase_odds = table[n].less < 0.0 ? 1.0f : -2.2f;
        INSIDE.noise = (float)table[n].noise;
        INSIDE.learnt.slow_noise = (float)table[n].slow_noise;
        INSIDE.run.line.variance = (float)(table[n].line_sd * table[n].line_sd);
        INSIDE.run.line.rise_sd_per_k = (float)table[n].rise_sd;
        INSIDE.run.line.slow_k = INSIDE.run.line.way_k = (float)table[n].slow_k;
        INSIDE.offset_sd_v = (float)table[n].offset_sd_v;
        if (table[n].offset_sd_v > 0.0) {
            INSIDE.slow_a = 4.0f / 3.0f;
        }
        INSIDE.losing = table[n].losing;
        INSIDE.averaged = table[n].averaged;
        const double explained = 2.6 * table[n].rise_sd * table[n].slow_k;
        const double offset = 3.0 * table[n].offset_sd_v * 0.25 / 0.25;
        const double sd = sqrt(explained * explained + offset * offset) / 2.6 / 0.2;
        spring_holding_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.0625f);
        const double lost = fabs(table[n].less) / 0.2 / (table[n].less < 0.0 ? 2.0 : 1.0);
        TEST_ASSERT_EQUAL(table[n].lost, INSIDE.lost > 0.0f);
        TEST_ASSERT_EQUAL_UINT8(table[n].losing_then, INSIDE.losing);
        if (table[n].lost) {
            TEST_ASSERT_FLOAT_WITHIN(0.01f * (float)lost, (float)lost, INSIDE.lost);
            TEST_ASSERT_EQUAL_UINT8(SPRING_SIGHT_LOST, sight()->kind);
            TEST_ASSERT_INT_WITHIN(1, lround(10.0 * (lost_at_c(lost) - 78.0)), sight()->seen);
            const double unsure_k = lost_at_c(lost) - lost_at_c(lost + sd);
            TEST_ASSERT_UINT8_WITHIN(1, lround(10.0 * sqrt(1.0 + unsure_k * unsure_k)),
                                     sight()->seen_sd);
            TEST_ASSERT_INT_WITHIN(1, lround(-1e4 * table[n].less), sight()->read);
            const double turns_noise = table[n].noise * (table[n].averaged < 16 ? 0.25 : 0.18);
            const double read_sd = sqrt(pow(fmax(turns_noise, table[n].slow_noise), 2) +
                                        pow(table[n].line_sd, 2) + pow(0.2 * sd, 2));
            TEST_ASSERT_UINT8_WITHIN(1, lround(fmax(1e4 * read_sd, 1.0)), sight()->read_sd);
            TEST_ASSERT_TRUE(INSIDE.rough);
            NEAR(0.25 * (1.0 - table[n].less), INSIDE.run.line.ohm);
        }
    }
}

/* Its distance is known to 2 K: by so much its slope may have moved what it reads. */
TEST(what_an_unseen_temperature_makes_of_a_slope_is_no_lost_phase)
{
    for (int beyond = 0; beyond < 2; beyond++) {
        begin_line_at(0.25 * (1.0 - (beyond != 0 ? 0.0021 : 0.0019)));
        INSIDE.learnt.slow_noise = 0.0f;
        INSIDE.run.line.rise_per_k = 0.001f;
        spring_holding_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.0625f);
        TEST_ASSERT_EQUAL(beyond != 0, INSIDE.lost > 0.0f);
        TEST_ASSERT_EQUAL_UINT8(beyond != 0 ? 0 : 1, INSIDE.losing);
    }
}

/* Where a duty's step is a whole number of the sensor's, a sweep averages no step away: of 4 mV two
 * averages may differ by 1.3. A gain is believed to 2 %. */
TEST(steps_of_the_duty_that_are_the_sensors_are_a_bound_of_averages)
{
    static const struct {
        double sensor_steps; /* of a step of the duty */
        double duty_steps;   /* over which it sweeps */
        double tenths;       /* of a mV */
    } table[] = {
        {1.0, 20.0, 13.0},        {2.0, 20.0, 13.0},  {1.019, 20.0, 13.0}, {1.06, 5.0, 13.0},
        {1.06, 20.0, 5.3},        {0.94, 20.0, 5.05}, {0.9, 20.0, 2.54},   {1.2, 20.0, 1.18},
        {0.5, 20.0, 0.42},        {0.2, 100.0, 0.21}, {2.06, 20.0, 11.06}, {200.0, 20.0, 13.0},
        {1.06, 20.0 / 3.0, 13.0},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold();
        row(n);
        INSIDE.ohm = 0.25f;
        const double gain = 0.25 / 4.0 / table[n].sensor_steps; /* duty steps per mA */
        const uint16_t gain_q16 = (uint16_t)lround(gain * 65536.0);
        spring_estimator_sweep(&estimator, 0, gain_q16,
                               (uint16_t)lround(table[n].duty_steps / gain));
        TEST_ASSERT_UINT8_WITHIN(table[n].tenths < 12.0 ? 1 : 0, (uint8_t)table[n].tenths,
                                 INSIDE.coarse);
    }
}

/* What they may make lasts: nothing is suspected below it. */
TEST(what_steps_may_make_is_no_lost_phase_however_long)
{
    static const struct {
        double less;
        uint8_t coarse, losing;
        bool lost;
        uint8_t losing_then;
    } table[] = {
        {0.00515, 13, 59, false, 0}, /* 1.3 mV of 0.25 V */
        {0.00525, 13, 0, true, 0},   {0.00235, 6, 0, false, 0},
        {0.00245, 6, 59, true, 0},   {0.00118, 2, 0, false, 1}, /* below the least */
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_line_at(0.25 * (1.0 - table[n].less));
        row(n);
        INSIDE.learnt.slow_noise = 0.0f;
        INSIDE.slow_a = (float)(1.0 / (1.0 - table[n].less)); /* so the line's 0.25 V are read */
        INSIDE.run.line.a = INSIDE.slow_a;
        INSIDE.coarse = table[n].coarse & 15u;
        INSIDE.losing = table[n].losing;
        spring_holding_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.0625f);
        TEST_ASSERT_EQUAL(table[n].lost, INSIDE.lost > 0.0f);
        TEST_ASSERT_EQUAL_UINT8(table[n].losing_then, INSIDE.losing);
    }
}

/* A sight of lost phase: what was moved stays in doubt, and as a disturbance where the distance was
 * known to 3 K; beyond 2 sd it opens a step. Too far off, it is the sensor's. */
TEST(lost_phase_is_doubted_and_too_much_of_it_is_the_sensors)
{
    static const struct {
        double c, sd_k, less, was_lost, odds;
        bool lost, jumps, disturbs;
    } table[] = {
        {84.0, 2.9, 0.01, 0.0, -2.2, true, false, true},
        {84.0, 3.0, 0.01, 0.0, -2.2, true, false, true},
        {84.0, 3.1, 0.01, 0.0, -2.2, true, false, false},
        {84.0, 2.9, 0.01, 0.2, -2.2, true, false, true},
        {76.0, 1.0, 0.01, 0.0, -2.2, true, false, false}, /* colder than that: found hotter */
        {87.3, 1.0, 0.01, 0.0, -2.2, true, false, true},  /* 8 K and 2 sqrt(1 + 1) above 76.57 */
        {87.5, 1.0, 0.01, 0.0, -2.2, false, true, false},
        {85.5, 1.0, 0.01, 0.2, -2.2, true, false, true},
        {85.8, 1.0, 0.01, 0.2, -2.2, false, true, false},
        {84.0, 1.0, -0.01, 0.0, 1.0, true, false, true}, /* the other way, an R-phase */
        {84.0, 1.0, 0.01, 0.0, 6.0, true, false, true},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_line_at(0.25 * (1.0 - table[n].less));
        row(n);
        put(table[n].c);
        INSIDE.variance_k2 = (float)(table[n].sd_k * table[n].sd_k);
        INSIDE.lost = (float)table[n].was_lost;
        INSIDE.gone_k = 1.0f;
        INSIDE.gone_w_per_k = 1e-4f;
        INSIDE.disturbance_k = 0.5f;
        estimator.r_phase_odds = (float)table[n].odds;
        const double was_c = (double)spring_now_c(&model, 0);
        spring_holding_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.0625f);
        const double part = table[n].less < 0.0 ? 0.025 : 0.05;
        const double lost = table[n].was_lost + (table[n].lost ? part : 0.0);
        TEST_ASSERT_FLOAT_WITHIN(1e-3f, (float)lost, INSIDE.lost);
        TEST_ASSERT_EQUAL_UINT16(table[n].jumps ? 1024 : 0, INSIDE.unsteady);
        NEAR(table[n].jumps ? 0.25 * 0.99 : 0.25, INSIDE.learnt.austenite_ohm);
        if (table[n].lost || table[n].jumps) {
            TEST_ASSERT_EQUAL_UINT8(table[n].lost ? SPRING_SIGHT_LOST : SPRING_SIGHT_JUMPED,
                                    sight()->kind);
            TEST_ASSERT_INT_WITHIN(1, lround(-1e4 * table[n].less), sight()->read);
            TEST_ASSERT_EQUAL_UINT8(5, sight()->read_sd);
            TEST_ASSERT_EQUAL_UINT8(0, sight()->did);
        }
        NEAR(0.25 * (1.0 - table[n].less), INSIDE.run.line.ohm);
        TEST_ASSERT_EQUAL_UINT8(0, INSIDE.losing);
        const double error_k = table[n].lost ? lost_at_c(lost) - was_c : 0.0;
        TEST_ASSERT_FLOAT_WITHIN(0.02f, 1.0f - (float)error_k, INSIDE.gone_k);
        TEST_ASSERT_FLOAT_WITHIN(0.02f, table[n].disturbs ? -(float)error_k : 0.5f,
                                 INSIDE.disturbance_k);
        NEAR(1e4 * (1e-4 + (double)INSIDE.learnt.loss_w_per_k), 1e4f * INSIDE.gone_w_per_k);
        TEST_ASSERT_EQUAL(table[n].lost, INSIDE.learnt.loss_w_per_k != 0.0f);
        const float known_k = 2.0f * sqrtf((float)(table[n].sd_k * table[n].sd_k) + 1.0f);
        TEST_ASSERT_EQUAL(table[n].lost && (float)error_k < -known_k,
                          estimator.stepped_turns == 240);
        const double odds = table[n].odds + (table[n].less < 0.0 ? 2.9 : -1.4);
        NEAR(fmin(odds, 6.0), estimator.r_phase_odds);
    }
    INSIDE.unsteady = 1025; /* once more, and it is loose */
    spring_misread(&estimator, &model, 0, -0.01f, 0.0f);
    TEST_ASSERT_EQUAL_UINT8(SPRING_DID_BLIND, sight()->did);
}

/* What a hotter spring, a contact or an intermediate phase may have changed is tried: hot by what
 * it reads, or where it may have begun to lose phase. On trial only what goes on is lost, and where
 * it may be; a known R-phase is no more tried. */
TEST(what_may_be_no_lost_phase_is_tried)
{
    static const struct {
        double c, sd_k, ohm, odds;
        bool trial, tried, lost;
    } table[] = {
        {79.9, 1.0, 0.2512, -2.2, false, true, false}, /* 2 sd */
        {80.1, 1.0, 0.2512, -2.2, false, false, false},
        {85.9, 4.0, 0.2512, -2.2, false, true, false},
        {80.1, 1.0, 0.2514, -2.2, false, true, false}, /* 0.5 % and 2.6 noise beyond: hot */
        {79.0, 1.0, 0.2512, 0.1, false, false, true},  /* an R-phase */
        {79.0, 1.0, 0.2488, -2.2, false, false, true}, /* straight */
        {79.0, 1.0, 0.2512, -2.2, true, false, true},  /* it went on */
        {82.0, 1.0, 0.2512, -2.2, true, true, false},  /* where none is lost */
        {82.0, 1.0, 0.2488, -2.2, true, false, true},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_line_at(table[n].ohm);
        row(n);
        put(table[n].c);
        INSIDE.variance_k2 = (float)(table[n].sd_k * table[n].sd_k);
        INSIDE.run.line.ohm = table[n].ohm > 0.25 ? 0.2488f : 0.2512f;
        INSIDE.learnt.slow_noise = 0.0f;
        INSIDE.trial = table[n].trial;
        INSIDE.run.line.trial_ohm = 0.25f;
        INSIDE.losing = 59;
        estimator.r_phase_odds = (float)table[n].odds;
        spring_holding_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.0625f);
        TEST_ASSERT_EQUAL(table[n].tried, spring_estimator_on_trial(&INSIDE));
        TEST_ASSERT_EQUAL(table[n].lost, INSIDE.lost > 0.0f);
        NEAR(table[n].ohm, INSIDE.run.line.ohm);
        if (table[n].tried && !table[n].trial) {
            NEAR(table[n].ohm, INSIDE.run.line.trial_ohm);
            NEAR(table[n].odds, estimator.r_phase_odds);
        }
    }
    INSIDE.trial = true;
    spring_begin_hold_line(&estimator, &INSIDE, false);
    TEST_ASSERT_FALSE(spring_estimator_on_trial(&INSIDE));
}

/* What reads hotter where it cannot have begun to lose phase, within a minute of another spring, is
 * hotter: by the part that a step of 3 K would make of it by its slope, less the slope's sd. */
TEST(springs_that_read_hotter_one_after_the_other_are)
{
    static const struct {
        uint8_t first;
        unsigned turns_between;
        bool hotter, trial, warms;
        double rise_per_k;
    } table[] = {
        {1, 0, true, false, true, 0.001},   {0, 0, true, false, false, 0.001},
        {1, 719, true, false, true, 0.001}, {1, 720, true, false, false, 0.001},
        {1, 0, false, false, false, 0.001}, {1, 0, true, true, false, 0.001},
        {1, 0, true, false, false, 0.0002}, {1, 0, false, false, true, -0.001},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_line_at(0.2512);
        row(n);
        put(95.0);
        INSIDE.learnt.slow_noise = 0.0f;
        INSIDE.variance_k2 = 1.0f;
        INSIDE.losing = 59;
        INSIDE.trial = table[n].trial;
        INSIDE.run.line.ohm = INSIDE.run.line.trial_ohm = 0.25f;
        INSIDE.run.line.rise_per_k = (float)table[n].rise_per_k;
        INSIDE.run.line.rise_sd_per_k = 0.0002f;
        TEST_ASSERT_FALSE(spring_steps_with_others(&estimator, table[n].first, table[n].hotter));
        const unsigned before = estimator.stepped_turns;
        TEST_ASSERT_EQUAL_UINT(60 * 4 * estimator.springs, before);
        const unsigned lately = before * table[n].turns_between / 720;
        estimator.stepped_turns = (uint16_t)(before - lately);
        spring_holding_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.0625f);
        const double left = 0.0048;
        const double step = 3.0 * copysign(fabs(table[n].rise_per_k) - 0.0002, table[n].rise_per_k);
        const double noise2 = pow(0.18 * 1e-4, 2);
        const double hotter_k = table[n].warms ? 3.0 * left * step / (step * step + noise2) : 0.0;
        TEST_ASSERT_FLOAT_WITHIN(0.03f, (float)(95.0 + hotter_k), spring_now_c(&model, 0));
        const bool less = INSIDE.learnt.loss_w_per_k<0.0f, more = INSIDE.learnt.loss_w_per_k> 0.0f;
        TEST_ASSERT_EQUAL(hotter_k > 0.0, less);
        TEST_ASSERT_EQUAL(hotter_k < 0.0, more);
        TEST_ASSERT_EQUAL_FLOAT(0.0f, INSIDE.lost);
        NEAR(0.2512, INSIDE.run.line.ohm);
    }
}

/* As far down as its loss may still be unseen: so much of its resistance, of which 20 % are its
 * phase. */
static double kept_c(double lost, double unseen)
{
    return lost_at_c(lost + unseen / 0.2);
}

/* On trial what goes the other way counts since it began, by 2.6 sd; what creeps moves the line, so
 * that it hides no loss; the spring is no colder than that lets it be, whatever its average lags
 * by, and gives up no loss for good: by 0.12 % of its resistance, or three of its noise. */
TEST(trial_counts_from_where_it_began)
{
    static const struct {
        double ohm, trial_ohm, noise, way_k;
        bool lost, anew, kept;
    } table[] = {
        {0.2502, 0.2500, 1e-4, 0.0, false, false, true},
        {0.2508, 0.2500, 9e-3, 0.0, false, true, true},
        {0.2512, 0.2500, 1e-4, 0.0, true, true, false},
        {0.2520, 0.2500, 9e-3, 0.0, false, false, false},
        {0.2524, 0.2500, 9e-3, 0.0, true, true, false},
        {0.2499, 0.2500, 1e-4, 0.0, false, false, true},
        {0.2496, 0.2500, 1e-4, 0.0, true, true, false},
        {0.2500, 0.2495, 1e-4, -3.0, false, false, false},
        {0.2500, 0.2500, 1e-4, -3.0, false, false, true},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_line_at(table[n].ohm);
        row(n);
        put(70.0);
        INSIDE.noise = (float)table[n].noise;
        INSIDE.learnt.slow_noise = 0.0f;
        INSIDE.quiet = 0;
        INSIDE.trial = true;
        INSIDE.run.line.trial_ohm = (float)table[n].trial_ohm;
        INSIDE.run.line.way_k = (float)table[n].way_k;
        spring_holding_watch(&estimator, &INSIDE, &model, 0, -1.0f, 0.0f);
        TEST_ASSERT_EQUAL(table[n].lost, INSIDE.lost > 0.0f);
        NEAR(table[n].anew ? table[n].ohm : 0.25, INSIDE.run.line.ohm);
        if (table[n].kept) {
            const double lag_k = table[n].way_k - 1.0;
            const double unseen = n == 1 ? 3.0 * 0.18 * 9e-3 : 0.0012;
            TEST_ASSERT_FLOAT_WITHIN(0.02f, (float)(kept_c(0.0, unseen) + lag_k),
                                     spring_now_c(&model, 0));
            TEST_ASSERT_FALSE(INSIDE.blind);
        }
    }
}

/* Colder austenite that reads beyond what it read when hot: a contact has crept, by as much as no
 * coefficient explains, and takes all that was learnt along. */
TEST(contact_that_crept_is_told_by_what_was_read_before_phase_was_lost)
{
    static const struct {
        double line_ohm, change, by;
    } table[] = {{0.2520, 0.2, 1.008}, {0.2495, 0.2, 1.0},  {0.2500, 0.2, 1.0},
                 {0.2520, -0.2, 1.0},  {0.2480, -0.2, 1.0}, /* 20 K colder explain 3 % */
                 {0.2400, -0.2, 0.99}};
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_line_at(table[n].line_ohm * (table[n].change > 0.0 ? 0.99 : 1.01));
        row(n);
        put(78.0);
        INSIDE.run.line.ohm = (float)table[n].line_ohm;
        INSIDE.learnt.change = (float)table[n].change;
        INSIDE.learnt.martensite_ohm = 0.2f;
        spring_holding_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.0625f);
        TEST_ASSERT_TRUE(INSIDE.lost > 0.0f);
        NEAR(0.25 * table[n].by, INSIDE.learnt.austenite_ohm);
        NEAR(0.2 * table[n].by, INSIDE.learnt.martensite_ohm);
    }
}

/* The line of 0.25 ohm has moved by so much of it: some millionths in a turn. */
#define FOLLOWS(by)                                                                                \
    TEST_ASSERT_FLOAT_WITHIN(0.15f, (float)(1e6 * (by)),                                           \
                             1e6f * (INSIDE.run.line.ohm / 0.25f - 1.0f))

/* It keeps its phase: the line follows in 60 s, tells its slope from 1 K on, and the spring is no
 * colder than where its loss would be seen. */
TEST(line_follows_what_keeps_its_phase)
{
    static const struct {
        double more, slow_k, rise_sd;
        bool tells;
    } table[] = {{0.0011, 2.0, 4e-4, true},  {0.0011, 1.0, 4e-4, false},
                 {0.0011, 0.9, 4e-4, false}, {-0.0011, -2.0, 4e-4, true},
                 {0.0013, 2.0, 4e-4, false}, {0.0011, -2.0, 0.0, true}};
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_line_at(0.25 * (1.0 + table[n].more));
        row(n);
        put(70.0);
        INSIDE.quiet = 40;
        INSIDE.run.line.way_k = INSIDE.run.line.slow_k = (float)table[n].slow_k;
        INSIDE.run.line.rise_sd_per_k = (float)table[n].rise_sd;
        INSIDE.run.line.variance = 1e-7f;
        INSIDE.learnt.slow_noise = 0.0f;
        INSIDE.lost = 0.04f;
        const double share = 1.0 / 240.0, prior = table[n].rise_sd * table[n].rise_sd;
        const double gain =
            table[n].tells
                ? prior * table[n].slow_k /
                      (prior * table[n].slow_k * table[n].slow_k + 32.0 * 0.0012 * 0.0012)
                : 0.0;
        spring_holding_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.0625f);
        FOLLOWS(table[n].more * share);
        NEAR(1e3 * gain * table[n].more, 1e3f * INSIDE.run.line.rise_per_k);
        NEAR(1e3 * sqrt(prior * (1.0 - gain * table[n].slow_k)),
             1e3f * INSIDE.run.line.rise_sd_per_k);
        NEAR(table[n].slow_k * (1.0 - share), INSIDE.run.line.way_k);
        NEAR(table[n].slow_k * (1.0 - share), INSIDE.run.line.slow_k);
        NEAR(1e7 * 1e-7 * (1.0 - 2.0 * share), 1e7f * INSIDE.run.line.variance);
        TEST_ASSERT_FLOAT_WITHIN(0.02f, (float)kept_c(0.04, 0.0012), spring_now_c(&model, 0));
    }
}

/* What may be lost unseen grows with the noise, and is the more of a phase the less that shows. */
TEST(what_keeps_its_phase_is_no_colder_than_its_noise_hides)
{
    static const struct {
        double slow_noise, change, unseen;
    } table[] = {{0.0, 0.2, 0.006},
                 {0.001, 0.2, 0.0149},
                 {0.004, 0.2, 0.0600},
                 {0.001, -0.2, 0.0149},
                 {0.001, 0.05, 0.0597}};
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_line_at(0.25);
        row(n);
        put(60.0);
        INSIDE.quiet = 40;
        INSIDE.noise = 0.0f;
        INSIDE.learnt.slow_noise = (float)table[n].slow_noise;
        INSIDE.learnt.change = (float)table[n].change;
        INSIDE.run.line.variance = 0.0f;
        spring_holding_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.0625f);
        TEST_ASSERT_FLOAT_WITHIN(0.02f, (float)lost_at_c(table[n].unseen), spring_now_c(&model, 0));
    }
}

/* A current that tells nothing keeps nothing: below 0.6 A it is as cold as it is believed to be,
 * and may have lost its phase. */
TEST(what_is_read_too_weakly_keeps_no_phase)
{
    static const struct {
        double current_a;
        bool tells;
    } table[] = {{0.59, false}, {0.61, true}, {0.3, false}};
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_line_at(0.25);
        row(n);
        put(70.0);
        INSIDE.quiet = 40;
        INSIDE.current_a = INSIDE.slow_a = INSIDE.run.line.a = (float)table[n].current_a;
        spring_holding_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.0625f);
        TEST_ASSERT_FLOAT_WITHIN(0.02f, table[n].tells ? (float)kept_c(0.0, 0.0015) : 70.0f,
                                 spring_now_c(&model, 0));
        begin_line_at(0.25);
        put(70.0);
        INSIDE.quiet = 40;
        INSIDE.slow_a = INSIDE.run.line.a = (float)table[n].current_a;
        give(table[n].current_a, 0.25);
        spring_seal(&estimator, 0);
        TEST_ASSERT_TRUE(spring_estimator_update(&estimator, &model, 0));
        TEST_ASSERT_EQUAL_UINT8(table[n].tells ? A : A | B, INSIDE.possible);
    }
}

/* Where its slope is known, by more than its sd, what it leaves its line by at rest tells each 4 s
 * that it is hotter or colder, and loses less or more: the less, the more its readings wander. The
 * line follows by the rest. */
TEST(what_a_known_slope_reads_is_a_temperature)
{
    static const struct {
        double more, rise, sd, slow_noise;
        uint16_t turns;
        bool tells;
    } table[] = {
        {0.0008, 0.001, 2e-4, 0.0005, 15, true},   {-0.0008, 0.001, 2e-4, 0.0005, 31, true},
        {0.0008, -0.001, 2e-4, 0.0005, 15, true},  {0.0008, 0.001, 2e-4, 0.004, 15, true},
        {0.0008, 0.0006, 7e-4, 0.0005, 15, false}, {0.0008, 0.001, 2e-4, 0.0005, 14, false},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_line_at(0.25 * (1.0 + table[n].more));
        row(n);
        put(95.0);
        INSIDE.quiet = 40;
        INSIDE.learnt.slow_noise = (float)table[n].slow_noise;
        INSIDE.run.line.rise_per_k = (float)table[n].rise;
        INSIDE.run.line.rise_sd_per_k = (float)table[n].sd;
        INSIDE.run.line.turns = table[n].turns;
        const double sure = fmax(fabs(table[n].rise) - table[n].sd, 0.0);
        const double step = 3.0 * (table[n].rise < 0.0 ? -sure : sure);
        const double noise = fmax(table[n].slow_noise, 0.0012);
        const double per_step = step / (step * step + noise * noise);
        const double hotter_k = table[n].tells ? per_step * 3.0 * table[n].more / 15.0 : 0.0;
        spring_holding_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.0625f);
        TEST_ASSERT_FLOAT_WITHIN(0.008f, (float)(95.0 + hotter_k), spring_now_c(&model, 0));
        NEAR(1e6 * -1e-4 * hotter_k, 1e6f * INSIDE.learnt.loss_w_per_k);
        NEAR(hotter_k, INSIDE.run.line.way_k);
        NEAR(hotter_k, INSIDE.run.line.slow_k);
        FOLLOWS(table[n].more * (1.0 - per_step * step) / 240.0);
    }
}

/* As the current drops the spring is what it was: what reads otherwise is the sensor's offset. */
TEST(drop_of_the_current_tells_the_offset)
{
    static const struct {
        double line_a, current_a, way_k, offset_v, more_ohm;
        uint8_t quiet;
        bool told;
        uint8_t coarse;
    } table[] = {
        {3.0, 1.1, 0.0, 0.0, 0.002, 0, true, 4},    {3.0, 1.1, 0.0, 0.0, 0.002, 0, true, 13},
        {3.0, 1.1, 0.0, 0.0, 0.002, 0, true, 0},    {3.0, 1.1, 2.0, 0.001, -0.002, 0, true, 0},
        {3.0, 1.1, -2.9, 0.0, 0.002, 0, true, 0},   {3.0, 1.1, -3.2, 0.0, 0.002, 0, false, 0},
        {3.0, 1.3, 0.0, 0.0, 0.002, 0, false, 0},   {3.0, 1.1, 0.0, 0.0, 0.002, 1, false, 0},
        {3.0, 1.1, 0.0, 0.009, 0.002, 0, false, 0}, {3.0, 1.1, 0.0, -0.009, -0.002, 0, false, 0},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_line_at(0.25);
        row(n);
        const bool unread = n == 2; /* its austenite never was */
        INSIDE.learnt.austenite_ohm = unread ? 0.0f : 0.25f;
        INSIDE.offset_sd_v = 0.005f;
        INSIDE.run.line.a = (float)table[n].line_a;
        INSIDE.current_a = (float)table[n].current_a;
        INSIDE.ohm = 0.25f + (float)table[n].more_ohm;
        INSIDE.learnt.offset_v = (float)table[n].offset_v;
        INSIDE.run.line.way_k = (float)table[n].way_k;
        INSIDE.rough = true;
        INSIDE.averaged = 3;
        INSIDE.quiet = table[n].quiet;
        INSIDE.noise = 1e-3f;
        INSIDE.coarse = table[n].coarse & 15u;
        const double product = table[n].line_a * table[n].current_a;
        const double apart_a = product / (table[n].line_a - table[n].current_a);
        const double moved_k = table[n].way_k + (table[n].quiet ? 0.0 : 0.1);
        const double read_v2 = pow(fmax(0.0005, 1e-4 * table[n].coarse), 2) +
                               pow(1e-3 * (0.25 + table[n].more_ohm) * apart_a, 2) +
                               pow(0.0015 * moved_k * 0.25 * apart_a, 2);
        const double gain = 25e-6 / (25e-6 + read_v2);
        const double more_v = table[n].told ? gain * table[n].more_ohm * apart_a : 0.0;
        spring_holding_watch(&estimator, &INSIDE, &model, 0, table[n].quiet ? 0.0f : 0.1f, 0.25f);
        TEST_ASSERT_EQUAL(table[n].told, INSIDE.seen);
        NEAR(1e3 * (table[n].offset_v + more_v), 1e3f * INSIDE.learnt.offset_v);
        NEAR(1e3 * (table[n].told ? sqrt(gain * read_v2) : 0.005), 1e3f * INSIDE.offset_sd_v);
        NEAR(0.25 - more_v / table[n].line_a, INSIDE.run.line.ohm);
        NEAR(unread ? 0.0 : 0.25 - more_v / table[n].line_a, INSIDE.learnt.austenite_ohm);
        NEAR(0.25 + table[n].more_ohm - more_v / table[n].current_a, INSIDE.ohm);
        if (table[n].told) {
            NEAR((double)INSIDE.ohm, INSIDE.slow_ohm);
            NEAR(table[n].current_a, INSIDE.slow_a);
            TEST_ASSERT_EQUAL_UINT8(1, INSIDE.averaged);
            NEAR(moved_k, INSIDE.run.line.slow_k);
        }
    }
}

static void begin_level_at(double c, double more);

/* So it does from fully on to a level: nothing of it is lost phase. */
TEST(drop_to_a_level_tells_the_offset)
{
    begin_level_at(84.0, 0.0);
    INSIDE.offset_sd_v = 0.005f;
    INSIDE.run.line.a = 3.0f;
    INSIDE.current_a = 1.1f;
    INSIDE.ohm = 0.237f;
    const double apart_a = 3.0 * 1.1 / 1.9;
    const double read_v2 = pow(0.0005, 2) + pow(0.001 * 0.237 * apart_a, 2);
    const double more_v = -0.003 * apart_a * 25e-6 / (25e-6 + read_v2);
    INSIDE.noise = 1e-3f;
    spring_level_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.25f);
    TEST_ASSERT_TRUE(INSIDE.seen);
    TEST_ASSERT_EQUAL_FLOAT(0.1f, INSIDE.lost);
    NEAR(1e3 * more_v, 1e3f * INSIDE.learnt.offset_v);
    NEAR(0.24 - more_v / 3.0, INSIDE.run.line.ohm);
    const float told_v = INSIDE.learnt.offset_v;
    INSIDE.offset_sd_v = 0.0005f; /* it is known: what is read now is not it */
    INSIDE.current_a = 1.1f;
    INSIDE.ohm = 0.235f;
    INSIDE.seen = false;
    spring_level_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.25f);
    TEST_ASSERT_FALSE(INSIDE.seen);
    TEST_ASSERT_EQUAL_FLOAT(told_v, INSIDE.learnt.offset_v);
}

/* The line begins at rest (10 s below 0.3 K/s), or anew with eight turns and each 3 K until then;
 * too weak a current on the way tells nothing. */
TEST(line_begins_at_rest_or_with_eight_turns)
{
    static const struct {
        double line_ohm, moved_k, current_a, slow_k;
        uint8_t quiet, averaged;
        bool rough;
        double line_then, slow_then;
        uint8_t quiet_then, averaged_then;
        bool rough_then;
    } table[] = {
        {0.0, 0.081, 2.0, 0.0, 50, 16, false, 0.0, 0.26, 0, 1, false},
        {0.0, -0.081, 2.0, 0.0, 50, 16, false, 0.0, 0.26, 0, 1, false},
        {0.0, 0.079, 2.0, 0.0, 38, 16, false, 0.0, 0.2502, 39, 16, false},
        {0.0, 0.079, 2.0, 0.0, 39, 16, false, 0.2502, 0.2502, 40, 16, false},
        {0.25, 0.0, 2.0, 0.0, 255, 16, true, 0.2502, 0.2502, 255, 16, false},
        {0.25, 0.0, 2.0, 0.0, 20, 7, true, 0.25, 0.2502, 21, 7, true},
        {0.25, 0.0, 2.0, 0.0, 20, 8, true, 0.2502, 0.2502, 21, 8, true},
        {0.25, 0.0, 2.0, 0.0, 20, 9, true, 0.25, 0.2502, 21, 9, true},
        {0.25, 0.0, 2.0, 3.1, 20, 9, true, 0.2502, 0.2502, 21, 9, true},
        {0.25, 0.0, 2.0, -2.9, 20, 9, true, 0.25, 0.2502, 21, 9, true},
        {0.25, 0.1, 2.0, 0.0, 20, 8, false, 0.25, 0.2502, 0, 8, false},
        {0.25, 0.0, 0.59, 0.0, 38, 9, true, 0.25, 0.25, 39, 0, true},
        {0.25, 0.0, 0.6, 0.0, 38, 9, true, 0.25, 0.2502, 39, 9, true},
        {0.25, 0.0, 0.59, 0.0, 39, 9, true, 0.2502, 0.2502, 40, 9, false},
        {0.25, 0.1, 0.59, 0.0, 38, 9, false, 0.25, 0.25, 0, 0, false},
        {0.25, 0.0, 0.59, 0.0, 0, 9, false, 0.25, 0.2502, 1, 9, false},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_line_at(0.2502);
        row(n);
        INSIDE.ohm = 0.26f;
        INSIDE.current_a = (float)table[n].current_a;
        INSIDE.run.line.ohm = (float)table[n].line_ohm;
        INSIDE.run.line.slow_k = INSIDE.run.line.way_k = (float)table[n].slow_k;
        INSIDE.quiet = table[n].quiet;
        INSIDE.averaged = table[n].averaged;
        INSIDE.rough = table[n].rough;
        INSIDE.losing = 7;
        spring_holding_watch(&estimator, &INSIDE, &model, 0, (float)table[n].moved_k, 0.5f);
        TEST_ASSERT_FLOAT_WITHIN(1e-5f, (float)table[n].line_then, INSIDE.run.line.ohm);
        TEST_ASSERT_FLOAT_WITHIN(1e-5f, (float)table[n].slow_then, INSIDE.slow_ohm);
        TEST_ASSERT_EQUAL_UINT8(table[n].quiet_then, INSIDE.quiet);
        TEST_ASSERT_EQUAL_UINT8(table[n].averaged_then, INSIDE.averaged);
        TEST_ASSERT_EQUAL(table[n].rough_then, INSIDE.rough);
        TEST_ASSERT_EQUAL_UINT8(0, INSIDE.losing);
    }
    begin_line_at(0.2502); /* too weak: it reads what its way has led it to */
    INSIDE.current_a = 0.59f;
    INSIDE.quiet = 0;
    INSIDE.run.line.rise_per_k = 0.001f;
    INSIDE.run.line.way_k = 2.0f;
    spring_holding_watch(&estimator, &INSIDE, &model, 0, 0.5f, 0.5f);
    NEAR(0.25 * (1.0 + 0.001 * (double)INSIDE.run.line.way_k), INSIDE.slow_ohm);
    TEST_ASSERT_EQUAL_FLOAT(INSIDE.run.line.way_k, INSIDE.run.line.slow_k);
    TEST_ASSERT_TRUE(INSIDE.run.line.slow_k > 1.9f);
}

/* Each 3 K on the way of certain austenite tell what a kelvin adds to it, but for the first turns,
 * which are few: to all springs of its alloy, which differ. The next hold's line begins with it. */
TEST(way_of_certain_austenite_tells_the_slope_of_all)
{
    static const struct {
        double c, slow_k;
        uint8_t averaged;
        bool rough, tells;
    } table[] = {
        {95.0, -4.0, 16, true, true},  {95.0, 4.0, 16, true, true},  {95.0, -3.1, 9, true, true},
        {95.0, -2.9, 16, true, false}, {95.0, -4.0, 8, true, false}, {95.0, -4.0, 16, false, false},
        {79.0, -4.0, 16, true, false},
    };
    const double prior_sd = 0.0009 / 2.6, own = 0.00015;
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_line_at(0.25 * (1.0 + 0.001 * table[n].slow_k));
        row(n);
        spring_begin_alloy(&estimator);
        put(table[n].c);
        INSIDE.quiet = 20;
        INSIDE.averaged = table[n].averaged;
        INSIDE.rough = table[n].rough;
        INSIDE.run.line.rise_per_k = 0.001f;
        INSIDE.run.line.way_k = INSIDE.run.line.slow_k = (float)table[n].slow_k;
        INSIDE.run.line.variance = 2e-7f;
        const double sample = (2.5e-7 + 2e-7) / pow(table[n].slow_k, 2);
        const double gain =
            table[n].tells ? pow(prior_sd, 2) / (pow(prior_sd, 2) + sample + own * own) : 0.0;
        spring_holding_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.0625f);
        TEST_ASSERT_EQUAL_FLOAT(0.0f, INSIDE.lost);
        NEAR(1e3 * (0.0006 + gain * 0.0004), 1e3f * estimator.rise_per_k);
        NEAR(1e3 * prior_sd * sqrt(1.0 - gain), 1e3f * estimator.rise_sd_per_k);
        spring_begin_hold_line(&estimator, &INSIDE, false);
        TEST_ASSERT_EQUAL_FLOAT(estimator.rise_per_k, INSIDE.run.line.rise_per_k);
        NEAR(1e3 * hypot((double)estimator.rise_sd_per_k, own),
             1e3f * INSIDE.run.line.rise_sd_per_k);
    }
    for (int n = 0; n < 50; n++) {
        spring_alloy_shows_rise(&estimator, 0.002f, 0.0f);
    }
    NEAR(1e3 * 0.0015, 1e3f * estimator.rise_per_k); /* none is steeper */
    NEAR(1e3 * own, 1e3f * estimator.rise_sd_per_k);
}

/* What is slower than a turn: second differences of averages 4 s apart, at rest. */
TEST(slow_noise_is_told_by_averages_four_seconds_apart)
{
    static const struct {
        uint8_t quiet, averaged;
        uint16_t turns;
        double was[2];
        double noise_then, was_then;
        uint16_t turns_then;
    } table[] = {
        {50, 16, 15, {0.2502, 0.25}, 5e-4 + (0.68 * 0.0004 / 0.25 - 5e-4) / 15, 0.2502, 16},
        {0, 16, 15, {0.2502, 0.25}, 5e-4 + (0.68 * 0.0004 / 0.25 - 5e-4) / 15, 0.2502, 16},
        {50, 16, 14, {0.2502, 0.25}, 5e-4, 0.25, 15},
        {50, 16, 31, {0.26, 0.25}, 5e-4 + (0.01 - 5e-4) / 15, 0.26, 32},
        {50, 16, 15, {0.2502, 0.0}, 5e-4, 0.2502, 16},
        {50, 15, 15, {0.2502, 0.25}, 5e-4, 0.0, 0},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_line_at(0.25);
        row(n);
        INSIDE.quiet = table[n].quiet;
        INSIDE.averaged = table[n].averaged;
        INSIDE.run.line.turns = table[n].turns;
        INSIDE.run.line.was_ohm[0] = (float)table[n].was[0];
        INSIDE.run.line.was_ohm[1] = (float)table[n].was[1];
        spring_holding_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.0625f);
        NEAR(1e3 * table[n].noise_then, 1e3f * INSIDE.learnt.slow_noise);
        NEAR(table[n].was_then, INSIDE.run.line.was_ohm[1]);
        TEST_ASSERT_EQUAL_UINT16(table[n].turns_then, INSIDE.run.line.turns);
    }
    begin_line_at(0.25); /* what is heated, or not austenite, rests not */
    INSIDE.heating = true;
    spring_holding_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.0625f);
    TEST_ASSERT_EQUAL_UINT8(0, INSIDE.quiet);
}

/* ---- a level ---- */

/* Between the phases, told by its own: 0.25 ohm as austenite, a fifth less as martensite; 0.8 of it
 * is on its line. It reads so much more than that on average. */
static void begin_level_at(double c, double more)
{
    begin_line_at(0.24 * (1.0 + more));
    put(c);
    INSIDE.possible = B;
    INSIDE.phase_ohm = (float)(0.24 * (1.0 + more));
    INSIDE.learnt.slow_noise = 0.0f;
    INSIDE.run.line.ohm = 0.24f;
    INSIDE.run.line.turns = 16;
    INSIDE.lost = 0.1f;
}

/* On its way down it is no hotter than where it has lost so much; by one update. What it gains
 * tells nothing: a contact may have crept. */
TEST(what_a_level_loses_tells_its_branch)
{
    static const struct {
        double c, more, slow_k;
        double lost, seen_c, sd_k; /* 0: it is not moved */
    } table[] = {
        {84.0, -0.01, 0.0, 0.15, 75.521, 1.0},     {84.0, -0.01, -2.0, 0.15, 75.521, 1.0},
        {84.0, -0.0013, 0.0, 0.1065, 75.911, 1.0}, {75.0, -0.01, 0.0, 0.15, 0.0, 0.0},
        {84.0, 0.01, 0.0, 0.1, 0.0, 0.0},          {84.0, 0.0011, 0.0, 0.1, 0.0, 0.0},
        {84.0, -0.0011, 0.0, 0.1, 0.0, 0.0},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_level_at(table[n].c, table[n].more);
        row(n);
        INSIDE.run.line.slow_k = INSIDE.run.line.way_k = (float)table[n].slow_k;
        const double seen_c = table[n].seen_c;
        const double gain = 4.0 / (4.0 + table[n].sd_k * table[n].sd_k);
        spring_level_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.0625f);
        TEST_ASSERT_FLOAT_WITHIN(2e-4f, (float)table[n].lost, INSIDE.lost);
        const double then_c = seen_c > 0.0 ? table[n].c + gain * (seen_c - table[n].c) : table[n].c;
        TEST_ASSERT_FLOAT_WITHIN(0.02f, (float)then_c, spring_now_c(&model, 0));
        TEST_ASSERT_EQUAL_INT16(thermal_model_temperature_c7(&model, 0),
                                seen_c > 0.0 ? INSIDE.last_c7 : (int16_t)(table[n].c * 128.0));
        if (seen_c > 0.0) {
            TEST_ASSERT_EQUAL_UINT8(SPRING_SIGHT_LOST, sight()->kind);
            TEST_ASSERT_INT_WITHIN(1, lround(1e4 * table[n].more), sight()->read);
        } else { /* no sight: what was read of the one before stands */
            TEST_ASSERT_EQUAL_INT(0, sight()->read);
        }
        const bool anew = fabs(table[n].more) > 0.0012;
        NEAR(anew ? 0.24 * (1.0 + table[n].more) : 0.24, INSIDE.run.line.ohm);
        TEST_ASSERT_EQUAL_UINT8(anew ? 0 : 1, INSIDE.losing);
    }
}

/* Sixteen turns at a strong current make its line; a way of 3 K makes it anew, as a coefficient
 * explains only the way since, but not while it is suspected. */
TEST(line_of_a_level_is_of_sixteen_strong_turns)
{
    static const struct {
        double line_ohm, current_a, slow_k, more;
        uint16_t turns;
        double then_ohm;
        uint16_t then_turns;
        uint8_t averaged;
    } table[] = {
        {0.0, 2.0, 0.0, 0.001, 0, 0.0, 1, 1},
        {0.0, 2.0, 0.0, 0.001, 14, 0.0, 15, 16},
        {0.0, 2.0, 0.0, 0.001, 15, 0.24024, 16, 16},
        {0.24, 0.79, 0.0, 0.0, 16, 0.0, 0, 16},
        {0.24, 0.81, 0.0, 0.0, 16, 0.24, 16, 16},
        {0.24, 2.0, 3.1, 0.0005, 16, 0.24012, 16, 16},
        {0.24, 2.0, -3.1, 0.0005, 16, 0.24012, 16, 16},
        {0.24, 2.0, 2.9, 0.0005, 16, 0.24, 16, 16},
        {0.24, 2.0, 3.1, 0.0011, 16, 0.24, 16, 16},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_level_at(84.0, table[n].more);
        row(n);
        INSIDE.ohm = INSIDE.slow_ohm;
        INSIDE.current_a = (float)table[n].current_a;
        INSIDE.run.line.ohm = (float)table[n].line_ohm;
        INSIDE.run.line.turns = table[n].turns;
        INSIDE.run.line.slow_k = INSIDE.run.line.way_k = (float)table[n].slow_k;
        spring_level_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.0625f);
        NEAR(table[n].then_ohm, INSIDE.run.line.ohm);
        TEST_ASSERT_EQUAL_UINT16(table[n].then_turns, INSIDE.run.line.turns);
        TEST_ASSERT_EQUAL_UINT8(table[n].averaged, INSIDE.averaged);
    }
    begin_level_at(84.0, 0.0); /* on its way */
    INSIDE.run.line.slow_k = 0.5f;
    INSIDE.run.line.way_k = 1.0f;
    spring_level_watch(&estimator, &INSIDE, &model, 0, 0.4f, 0.0625f);
    NEAR(1.4, INSIDE.run.line.way_k);
    NEAR(0.5 + 0.9 / 16.0, INSIDE.run.line.slow_k);
}

/* A spring that heats, is fully on or unknown has no level, nor one that was never fully on. */
TEST(only_a_level_that_tells_its_phase_is_watched)
{
    static const struct {
        uint8_t possible;
        bool heating;
        double austenite_ohm;
        bool watched;
    } table[] = {
        {B, false, 0.25, true},          {B, false, 0.0, false},  {B | A, false, 0.25, true},
        {B, true, 0.25, false},          {A, false, 0.25, false}, {M, false, 0.25, false},
        {M | B | A, false, 0.25, false},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_level_at(84.0, -0.01);
        row(n);
        INSIDE.possible = table[n].possible;
        INSIDE.heating = table[n].heating;
        INSIDE.learnt.austenite_ohm = (float)table[n].austenite_ohm;
        spring_level_watch(&estimator, &INSIDE, &model, 0, 0.0f, 0.0625f);
        TEST_ASSERT_EQUAL(table[n].watched, INSIDE.lost > 0.11f);
        TEST_ASSERT_EQUAL(table[n].watched, spring_now_c(&model, 0) < 80.0f);
    }
}

/* On its way to a level a spring loses its phase as fast as it cools: no contact has jumped. */
TEST(fall_to_a_level_is_no_jump)
{
    begin_level_at(84.0, 0.0);
    INSIDE.odd = true;
    give(2.0, 0.24 * 0.9);
    (void)spring_take_readings(&estimator, &model, 0);
    TEST_ASSERT_EQUAL_UINT16(0, INSIDE.unsteady);
    NEAR(0.24, INSIDE.run.line.ohm);
    TEST_ASSERT_FALSE(INSIDE.odd);
}
