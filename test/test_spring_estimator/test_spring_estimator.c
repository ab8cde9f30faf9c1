/* What is believed of one spring against the spring as it is, over minutes; what a turn does is in
 * rules.c, law.c and watch.c. */
#include <math.h>
#include <stdio.h>

#include "../run_tests.h"
#include "one_spring.h"
#include "spring_estimator_internal.h"

#define ACTED_ON 0.03f /* lost, by the drive: it heats it back then */

void setUp(void)
{
    begin_cold();
}

/* In all that is done to it here nothing was taken for a bit that has turned over. */
void tearDown(void)
{
    TEST_ASSERT_EQUAL_UINT8(0, spring_estimator_broken_seals(&estimator));
}

/* ---- bounds ---- */

static bool holds(spring_bounds_t bounds, double value)
{
    return bounds.low <= (float)value && (float)value <= bounds.high;
}

/* 15 % off in capacity and loss, 5 K off in the transformation, with a coefficient: heated, held
 * nearer and nearer, and off, where nobody reads it. */
TEST(spring_is_within_its_bounds)
{
    static const double off[] = {0.85, 1.0, 1.15};
    unsigned seen = 0, distance = 0, temperature = 0, phase = 0;
    for (unsigned n = 0; n < 27; n++) {
        begin_cold();
        truth.capacity_j_per_k *= off[n % 3u];
        truth.loss_w_per_k *= off[n / 3u % 3u];
        truth.shift_k = 5.0 * ((double)(n / 9u) - 1.0);
        truth.rise_per_k = 0.0002 * (double)(n % 4u);
        const double off_s = n % 3u == 1 && n / 9u == 1 ? 200.0 : 0.0;
        double margin_k = 12.0, held_s = 0.0;
        spring_estimator_begin_heating(&estimator, &model, 0);
        for (double s = 0.0; held_s < 240.0 + off_s; s += TICK_S) {
            double current_a = 3.0;
            if (held_s == 0.0 &&
                (s > 60.0 || spring_estimator_has_transformed(&estimator, &model, 0))) {
                spring_estimator_disturb(&estimator, 0);
                spring_estimator_begin_hold(&estimator, &model, 0, true);
                held_s = TICK_S;
            }
            if (held_s > 0.0) {
                margin_k = spring_estimator_lost(BELIEF) > 0.0f ? 3.0 : margin_k - 0.08 * TICK_S;
                current_a = held_s < 240.0 ? hold_current_a(fmax(margin_k, 0.0)) : 0.0;
                held_s += TICK_S;
            }
            if (tick(current_a)) {
                seen++;
                distance += holds(spring_estimator_distance_k(&estimator, &model, 0), distance_k());
                temperature += holds(spring_estimator_temperature_c(&estimator, &model, 0),
                                     truth.temperature_c);
                phase += holds(spring_estimator_austenite(&estimator, &model, 0), truth.austenite);
            }
        }
    }
    here("of %u: distance %u, temperature %u, phase %u", seen, distance, temperature, phase);
    TEST_ASSERT_TRUE(distance >= 0.99 * seen);
    TEST_ASSERT_TRUE(temperature >= 0.99 * seen);
    TEST_ASSERT_TRUE(phase >= 0.99 * seen);
}

/* ---- a hold ---- */

/* A coefficient in print, whatever the change; a contact that steps or ages; noise that stays for a
 * second: nothing of that is phase, and the spring is not heated back. */
TEST(nothing_else_is_taken_for_lost_phase)
{
    static const struct {
        double ratio, rise_per_k, apart_per_k, contact_ohm, step_ohm, age_ohm_per_s, slow_noise_v;
    } table[] = {
        {1.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0},      {1.25, 0.0010, 0.0, 0.0, 0.0, 0.0, 0.0},
        {1.25, 0.0, 0.0014, 0.0, 0.0, 0.0, 0.0},   {1.25, 0.0012, -0.0012, 0.0, 0.0, 0.0, 0.0},
        {1.4, 0.0, 0.0014, 0.0, 0.0, 0.0, 0.0},    {0.85, 0.0, -0.0002, 0.0, 0.0, 0.0, 0.0},
        {1.25, 0.0, 0.0, 0.0, 0.015, 0.0, 0.0},    {1.25, 0.0, 0.0, 0.0, 0.025, 0.0, 0.0},
        {1.25, 0.0, 0.0, 0.025, -0.025, 0.0, 0.0}, {1.25, 0.0, 0.0, 0.0, 0.0, 0.01 / 900.0, 0.0},
        {1.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.001},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold();
        truth.ratio = table[n].ratio;
        truth.rise_per_k = table[n].rise_per_k;
        truth.apart_per_k = table[n].apart_per_k;
        truth.contact_ohm = table[n].contact_ohm;
        truth.slow_noise_v = table[n].slow_noise_v;
        heat_then_hold(60.0);
        for (long t = 0; t < 15000; t++) {
            truth.contact_ohm += t == 5000 ? table[n].step_ohm : 0.0;
            truth.contact_ohm += table[n].age_ohm_per_s * TICK_S;
            (void)tick(hold_current_a(8.0));
            here("row %u, %ld: lost %.3f of %.3f at %.1f degC", (unsigned)n, t,
                 (double)spring_estimator_lost(BELIEF), 1.0 - truth.austenite, truth.temperature_c);
            TEST_ASSERT_TRUE(spring_estimator_lost(BELIEF) < ACTED_ON);
        }
        TEST_ASSERT_TRUE(truth.austenite > 0.97 && !spring_estimator_blind(BELIEF));
    }
}

/* ---- learnt before ---- */

TEST(numbers_that_no_spring_has_are_not_restored)
{
    const spring_learnt_t good = {.austenite_ohm = 0.22f, .change = 0.2f, .loss_sd_w_per_k = 1e-4f};
    spring_learnt_t bad[15];
    for (unsigned n = 0; n < 15; n++) {
        bad[n] = good;
    }
    bad[0].austenite_ohm = NAN;
    bad[1].austenite_ohm = 20.0f;
    bad[2].change = NAN;
    bad[3].change = 1.0f;
    bad[4].loss_w_per_k = 1.0f;
    bad[5].loss_sd_w_per_k = -1e-4f;
    bad[6].martensite_rise_per_k = INFINITY;
    bad[7].loss_sd_w_per_k = NAN;
    bad[8].slow_noise = NAN;
    bad[9].slow_noise = 0.02f;
    bad[10].austenite_ohm = 0.0099f;
    bad[11].change = 0.0f;
    bad[12].offset_v = 0.013f;
    bad[13].loss_w_per_k = -0.46f * 0.0058f;
    bad[14].loss_sd_w_per_k = 0.121f * 0.0058f;
    for (unsigned n = 0; n < 15; n++) {
        power_comes_on();
        spring_estimator_restore(&estimator, 0, &bad[n]);
        here("%u", n);
        TEST_ASSERT_EQUAL_FLOAT(0.0f, LEARNT.austenite_ohm);
    }
    static const float possible_ohm[] = {0.0101f, 0.22f, 15.9f};
    for (unsigned n = 0; n < 3; n++) {
        spring_learnt_t own = good;
        own.austenite_ohm = possible_ohm[n];
        own.slow_noise = 0.01f;
        spring_estimator_restore(&estimator, 0, &own);
        TEST_ASSERT_EQUAL_FLOAT(possible_ohm[n], LEARNT.austenite_ohm);
        TEST_ASSERT_EQUAL_FLOAT(1e-8f, INSIDE.loss_variance);
    }
    spring_learnt_t sure = good;
    sure.loss_sd_w_per_k = 0.0f;
    power_comes_on();
    spring_estimator_restore(&estimator, 0, &sure);
    TEST_ASSERT_EQUAL_FLOAT(0.22f, LEARNT.austenite_ohm);
    INSIDE.loss_variance = 1e-4f; /* known less than a declared one is, it is that one */
    TEST_ASSERT_FLOAT_WITHIN(1e-7f, 0.12f * 0.0058f, LEARNT.loss_sd_w_per_k);
    begin_cold();
}
