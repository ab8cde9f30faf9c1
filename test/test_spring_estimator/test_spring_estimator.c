/* What is believed of one spring against the spring as it is. */
#include <math.h>
#include <stdio.h>

#include "lost_phase.h"
#include "one_spring.h"
#include "rules.h"
#include "seals.h"
#include "sights.h"
#include "unity.h"

void setUp(void)
{
    begin_cold();
}

/* In all that is done to it here nothing was taken for a bit that has turned over. */
void tearDown(void)
{
    TEST_ASSERT_EQUAL_UINT8(0, spring_estimator_broken_seals(&estimator));
}

/* Off until it is cold; the estimator keeps what it has learnt. */
static void begin_cold_as_learnt(void)
{
    const spring_learnt_t learnt = spring_estimator_learnt(&estimator, 0);
    begin_cold();
    spring_estimator_restore(&estimator, 0, &learnt);
}

/* Narrows the margin until phase is seen to be lost; returns the sd of the turn before, K. */
static float search(double from_k, double most_s)
{
    float sd_k = spring_estimator_sd_k(BELIEF);
    double margin_k = from_k;
    for (double s = 0.0; s < most_s && spring_estimator_lost(BELIEF) == 0.0f; s += TICK_S) {
        sd_k = spring_estimator_sd_k(BELIEF);
        margin_k -= spring_estimator_rests(BELIEF) && !spring_estimator_seems_to_lose(BELIEF)
                        ? 0.08 * TICK_S
                        : 0.0;
        (void)tick(hold_current_a(margin_k));
    }
    return sd_k;
}

/* ---- power-on ---- */

static void at_power_on_everything_is_possible(void)
{
    power_comes_on();
    TEST_ASSERT_EQUAL_UINT8(SPRING_PHASE_ANY, spring_estimator_possible(BELIEF));
    const spring_bounds_t c = spring_estimator_temperature_c(&estimator, &model, 0);
    TEST_ASSERT_TRUE(c.low <= 20.0f && c.high >= SPRING_ESTIMATOR_HOTTEST_C);
    const spring_bounds_t austenite = spring_estimator_austenite(&estimator, &model, 0);
    TEST_ASSERT_TRUE(austenite.low == 0.0f && austenite.high == 1.0f);
}

/* From the hottest that it may be, with its latent heat. */
static void it_is_cold_only_after_the_time_that_physics_needs(void)
{
    for (double loss = 0.85; loss < 1.2; loss += 0.15) {
        power_comes_on();
        truth.temperature_c = SPRING_ESTIMATOR_HOTTEST_C;
        truth.austenite = 1.0;
        truth.loss_w_per_k *= loss;
        const double said_s = spring_estimator_cooling_s(&estimator, &model, 0);
        double took_s = 0.0;
        while (spring_estimator_possible(BELIEF) != SPRING_PHASE_MARTENSITE && took_s < 300.0) {
            (void)tick(0.0);
            took_s += TICK_S;
        }
        (void)snprintf(where, sizeof where, "loss x %.2f: said %.0f s, took %.0f s: %.1f degC",
                       loss, said_s, took_s, truth.temperature_c);
        TEST_ASSERT_TRUE_MESSAGE(truth.temperature_c < 68.0 && truth.austenite == 0.0, where);
        TEST_ASSERT_TRUE_MESSAGE(took_s < 100.0 && fabs(said_s - took_s) < 0.25 * took_s, where);
        TEST_ASSERT_EQUAL_FLOAT(0.0f, spring_estimator_cooling_s(&estimator, &model, 0));
    }
}

/* ---- a heating ---- */

static void check_transformation_is_seen(double ratio, double rise_per_k)
{
    begin_cold();
    truth.ratio = ratio;
    truth.rise_per_k = rise_per_k;
    double began_at = -1.0;
    ticks(3.0, 1.0);
    spring_estimator_begin_heating(&estimator, &model, 0);
    for (double s = 0.0; s < 60.0 && !spring_estimator_has_transformed(&estimator, &model, 0);
         s += TICK_S) {
        (void)tick(3.0);
        began_at = began_at < 0.0 && INSIDE.onset ? truth.austenite : began_at;
    }
    (void)snprintf(where, sizeof where,
                   "ratio %.2f, %.4f per K: onset at %.2f, end at %.3f, %.1f C", ratio, rise_per_k,
                   began_at, truth.austenite, truth.temperature_c);
    TEST_ASSERT_TRUE_MESSAGE(began_at > 0.0 && began_at < 0.5, where);
    TEST_ASSERT_TRUE_MESSAGE(truth.austenite > 0.99 && truth.temperature_c < 112.0, where);
    spring_estimator_begin_hold(&estimator, &model, 0, true);
    TEST_ASSERT_FALSE_MESSAGE(spring_estimator_blind(BELIEF), where);
    TEST_ASSERT_EQUAL_UINT8_MESSAGE(SPRING_PHASE_AUSTENITE, spring_estimator_possible(BELIEF),
                                    where);
    TEST_ASSERT_FLOAT_WITHIN(0.01f * (float)resistance_ohm(), (float)resistance_ohm(),
                             LEARNT.austenite_ohm);
    TEST_ASSERT_FLOAT_WITHIN(0.04f, (float)(1.0 - 1.0 / ratio), LEARNT.change);
}

static void transformation_is_seen_whatever_its_sign_and_size(void)
{
    check_transformation_is_seen(1.25, 0.0);
    check_transformation_is_seen(1.40, 0.0);
    check_transformation_is_seen(0.85, 0.0);
    check_transformation_is_seen(1.25, 0.0010);
    check_transformation_is_seen(0.85, 0.0005);
}

static void transformation_is_seen_through_noise(void)
{
    begin_cold();
    truth.noise_v = 0.016; /* four steps of the sensor */
    (void)heat_then_hold(60.0);
    TEST_ASSERT_TRUE(truth.austenite > 0.99 && truth.temperature_c < 115.0);
    TEST_ASSERT_FALSE(spring_estimator_blind(BELIEF));
}

/* The last of a small change is flatter than a coefficient may be: it is waited for. */
static void small_change_is_heated_to_its_end(void)
{
    for (double ratio = 1.10; ratio < 1.3; ratio += 0.02) {
        begin_cold();
        truth.cosine = true;
        truth.ratio = ratio;
        (void)heat_then_hold(60.0);
        begin_cold_as_learnt();
        truth.cosine = true;
        truth.ratio = ratio;
        (void)heat_then_hold(60.0);
        (void)snprintf(where, sizeof where, "ratio %.2f: %.3f at %.1f C", ratio, truth.austenite,
                       truth.temperature_c);
        TEST_ASSERT_TRUE_MESSAGE(truth.austenite > 0.95 && truth.temperature_c < 112.0, where);
    }
}

/* A change of some percent shows late: by then it has nearly transformed, and is not heated as if
 * it had just begun. */
static void onset_that_shows_late_heats_no_further(void)
{
    for (double ratio = 1.06; ratio < 1.12; ratio += 0.005) {
        begin_cold();
        truth.cosine = true;
        truth.ratio = ratio;
        (void)heat_then_hold(60.0);
        (void)snprintf(where, sizeof where, "ratio %.3f: %.3f at %.1f C", ratio, truth.austenite,
                       truth.temperature_c);
        TEST_ASSERT_TRUE_MESSAGE(truth.austenite > 0.99 && truth.temperature_c < 115.0, where);
    }
}

/* No change, or a temperature coefficient alone (of those in print), is no transformation. */
static void coefficient_alone_is_never_an_onset(void)
{
    static const double rise_per_k[] = {-0.0003, 0.0, 0.0004, 0.0010, 0.0015};
    for (unsigned n = 0; n < sizeof rise_per_k / sizeof rise_per_k[0]; n++) {
        for (int noisy = 0; noisy < 2; noisy++) {
            begin_cold();
            truth.ratio = 1.0;
            truth.rise_per_k = rise_per_k[n];
            truth.noise_v = noisy ? 0.016 : 0.0;
            spring_estimator_begin_heating(&estimator, &model, 0);
            for (double s = 0.0;
                 s < 60.0 && !spring_estimator_has_transformed(&estimator, &model, 0);
                 s += TICK_S) {
                (void)tick(3.0);
                (void)snprintf(where, sizeof where, "%.4f per K, noisy %d: %.1f degC",
                               rise_per_k[n], noisy, truth.temperature_c);
                TEST_ASSERT_FALSE_MESSAGE(INSIDE.onset, where);
            }
            TEST_ASSERT_TRUE_MESSAGE(truth.austenite > 0.95 && truth.temperature_c < 125.0, where);
            spring_estimator_begin_hold(&estimator, &model, 0, true);
            TEST_ASSERT_TRUE_MESSAGE(spring_estimator_blind(BELIEF), where);
            TEST_ASSERT_FALSE(spring_estimator_sees(BELIEF));
        }
    }
}

/* ---- bounds ---- */

static unsigned seen, within_distance, within_temperature, within_phase;

static bool holds(spring_bounds_t bounds, double value)
{
    return bounds.low <= (float)value && (float)value <= bounds.high;
}

static void count_bounds(void)
{
    seen++;
    within_distance += holds(spring_estimator_distance_k(&estimator, &model, 0), distance_k());
    within_temperature +=
        holds(spring_estimator_temperature_c(&estimator, &model, 0), truth.temperature_c);
    within_phase += holds(spring_estimator_austenite(&estimator, &model, 0), truth.austenite);
}

static void check_counted(void)
{
    (void)snprintf(where, sizeof where, "of %u: distance %.4f, temperature %.4f, phase %.4f", seen,
                   (double)within_distance / seen, (double)within_temperature / seen,
                   (double)within_phase / seen);
    TEST_ASSERT_TRUE_MESSAGE(within_distance >= 0.99 * seen, where);
    TEST_ASSERT_TRUE_MESSAGE(within_temperature >= 0.99 * seen, where);
    TEST_ASSERT_TRUE_MESSAGE(within_phase >= 0.99 * seen, where);
}

static void heat_and_hold(void)
{
    double margin_k = 12.0;
    spring_estimator_begin_heating(&estimator, &model, 0);
    for (double s = 0.0; s < 60.0 && !spring_estimator_has_transformed(&estimator, &model, 0);
         s += TICK_S) {
        if (tick(3.0)) {
            count_bounds();
        }
    }
    spring_estimator_disturb(&estimator, 0);
    spring_estimator_begin_hold(&estimator, &model, 0, true);
    for (double s = 0.0; s < 240.0; s += TICK_S) {
        margin_k = spring_estimator_lost(BELIEF) > 0.0f ? 3.0 : margin_k - 0.08 * TICK_S;
        if (tick(hold_current_a(margin_k > 0.0 ? margin_k : 0.0))) {
            count_bounds();
        }
    }
}

/* 15 % off in capacity and loss, 5 K off in the transformation, with a coefficient. */
static void driven_spring_is_within_its_bounds(void)
{
    static const double off[] = {0.85, 1.0, 1.15};
    seen = within_distance = within_temperature = within_phase = 0;
    for (unsigned n = 0; n < 27; n++) {
        begin_cold();
        truth.capacity_j_per_k *= off[n % 3u];
        truth.loss_w_per_k *= off[n / 3u % 3u];
        truth.shift_k = 5.0 * ((double)(n / 9u) - 1.0);
        truth.rise_per_k = 0.0002 * (double)(n % 4u);
        heat_and_hold();
    }
    check_counted();
}

/* Nobody reads a spring that is off: what it may have become meanwhile widens. */
static void spring_that_is_off_is_within_its_bounds(void)
{
    static const double off[] = {0.85, 1.0, 1.15};
    seen = within_distance = within_temperature = within_phase = 0;
    for (unsigned n = 0; n < 3; n++) {
        begin_cold();
        truth.loss_w_per_k *= off[n];
        (void)heat_then_hold(60.0);
        for (double s = 0.0; s < 200.0; s += TICK_S) {
            if (tick(0.0)) {
                count_bounds();
            }
        }
    }
    check_counted();
}

/* ---- a hold ---- */

static void crossing_is_seen_and_makes_the_distance_sure(void)
{
    static const double loss[] = {0.85, 1.0, 1.15};
    for (unsigned n = 0; n < 3; n++) {
        begin_cold();
        truth.loss_w_per_k *= loss[n];
        (void)heat_then_hold(60.0);
        const float before_k = search(12.0, 400.0);
        const float after_k = spring_estimator_sd_k(BELIEF);
        (void)snprintf(where, sizeof where,
                       "loss x %.2f: lost %.3f of %.3f, sd %.2f -> %.2f, distance %.2f", loss[n],
                       (double)spring_estimator_lost(BELIEF), 1.0 - truth.austenite,
                       (double)before_k, (double)after_k, distance_k());
        TEST_ASSERT_TRUE_MESSAGE(spring_estimator_lost(BELIEF) > 0.0f, where);
        TEST_ASSERT_TRUE_MESSAGE(distance_k() > -3.0 && distance_k() < 1.0, where);
        TEST_ASSERT_TRUE_MESSAGE(after_k < before_k && after_k < 2.0f, where);
        TEST_ASSERT_TRUE_MESSAGE(
            holds(spring_estimator_distance_k(&estimator, &model, 0), distance_k()), where);
        /* and what was learnt of the loss is right within what it says of itself */
        const spring_learnt_t learnt = spring_estimator_learnt(&estimator, 0);
        const double off_w_per_k = (double)learnt.loss_w_per_k - 5.8e-3 * (loss[n] - 1.0);
        (void)snprintf(where, sizeof where, "loss x %.2f: off by %.6f, sd %.6f", loss[n],
                       off_w_per_k, (double)learnt.loss_sd_w_per_k);
        TEST_ASSERT_TRUE_MESSAGE(fabs(off_w_per_k) <= 3.0 * (double)learnt.loss_sd_w_per_k, where);
        TEST_ASSERT_TRUE_MESSAGE((double)learnt.loss_sd_w_per_k < 0.12 * 5.8e-3, where);
    }
}

static void hold_that_loses_nothing_shows_no_crossing(void)
{
    /* what one phase's resistance does with temperature tells nothing of the other's */
    static const double of_martensite[] = {0.0, 0.0010, 0.0, 0.0012};
    static const double of_austenite[] = {0.0, 0.0010, 0.0010, 0.0};
    for (unsigned n = 0; n < 4; n++) {
        begin_cold();
        truth.rise_per_k = of_martensite[n];
        truth.apart_per_k = of_austenite[n] - of_martensite[n];
        (void)heat_then_hold(60.0);
        hold(9.0, 600.0);
        (void)snprintf(where, sizeof where, "%.4f and %.4f per K: lost %.3f of %.3f",
                       of_martensite[n], of_austenite[n], (double)spring_estimator_lost(BELIEF),
                       1.0 - truth.austenite);
        TEST_ASSERT_TRUE_MESSAGE(truth.austenite > 0.999, where);
        TEST_ASSERT_EQUAL_FLOAT_MESSAGE(0.0f, spring_estimator_lost(BELIEF), where);
    }
}

/* A touch in mid-hold: all four temperatures rise by 8 K, and phase goes. */
static void transformation_that_moves_is_noticed(void)
{
    (void)heat_then_hold(60.0);
    hold(5.0, 120.0);
    const float before_k = spring_estimator_shift_k(BELIEF);
    truth.shift_k = 8.0;
    double after_s = 0.0;
    while (spring_estimator_lost(BELIEF) == 0.0f && after_s < 60.0) {
        (void)tick(hold_current_a(5.0));
        after_s += TICK_S;
    }
    (void)snprintf(where, sizeof where, "after %.1f s, lost %.3f of %.3f, shift %.2f", after_s,
                   (double)spring_estimator_lost(BELIEF), 1.0 - truth.austenite,
                   (double)spring_estimator_shift_k(BELIEF));
    TEST_ASSERT_TRUE_MESSAGE(after_s < 20.0 && spring_estimator_shift_k(BELIEF) > before_k, where);
}

/* In a gust the model runs ahead: what still transforms is not past its transformation. */
static void heating_in_a_gust_goes_on_until_it_is_over(void)
{
    static const double loss[] = {1.0, 1.5, 2.0};
    for (unsigned n = 0; n < 3; n++) {
        begin_cold();
        truth.loss_w_per_k *= loss[n];
        (void)heat_then_hold(90.0);
        (void)snprintf(where, sizeof where, "loss x %.1f: %.3f at %.1f degC", loss[n],
                       truth.austenite, truth.temperature_c);
        TEST_ASSERT_TRUE_MESSAGE(truth.austenite > 0.97 && truth.temperature_c < 115.0, where);
    }
}

/* A heating that a limit ends before the phase is there has not transformed it; the second time
 * its readings tell nothing any more. */
static void heating_that_a_limit_ends_is_doubted(void)
{
    (void)heat_then_hold(60.0);
    ticks(0.0, 300.0);
    for (int time = 0; time < 2; time++) {
        spring_estimator_disturb(&estimator, 0);
        spring_estimator_begin_heating(&estimator, &model, 0);
        ticks(3.0, time == 0 ? 18.0 : 0.5);
        spring_estimator_begin_hold(&estimator, &model, 0, true);
        (void)snprintf(where, sizeof where, "%d: lost %.3f of %.3f", time,
                       (double)spring_estimator_lost(BELIEF), 1.0 - truth.austenite);
        TEST_ASSERT_TRUE_MESSAGE(truth.austenite > 0.1 && truth.austenite < 0.7, where);
        TEST_ASSERT_TRUE_MESSAGE(spring_estimator_blind(BELIEF) == (time == 1), where);
        if (time == 0) {
            TEST_ASSERT_FLOAT_WITHIN_MESSAGE(0.1f, (float)(1.0 - truth.austenite),
                                             spring_estimator_lost(BELIEF), where);
        }
    }
}

/* Just below its transformation a contact or a gain steps, all at once or in mid-turn. What does
 * not go on is no transformation, and what came after it is. */
static void step_that_looks_like_an_onset_ends_no_heating(void)
{
    static const double steps[] = {-0.06, -0.045, 0.045, 0.06};
    for (unsigned n = 0; n < 4 * 4 * 3; n++) {
        const double at_c = 68.0 + 5.0 * (n / 4 % 4);
        begin_cold();
        spring_estimator_begin_heating(&estimator, &model, 0);
        while (truth.temperature_c < at_c) {
            (void)tick(3.0);
        }
        ticks(3.0, n / 16 * 4 * TICK_S);
        truth.contact_ohm = steps[n % 4] * resistance_ohm();
        for (double s = 0.0; s < 60.0 && !spring_estimator_has_transformed(&estimator, &model, 0);
             s += TICK_S) {
            (void)tick(3.0);
        }
        (void)snprintf(where, sizeof where, "step of %.3f at %.0f degC: %.3f at %.1f degC",
                       steps[n % 4], at_c, truth.austenite, truth.temperature_c);
        TEST_ASSERT_TRUE_MESSAGE(truth.austenite > 0.95 && truth.temperature_c < 120.0, where);
    }
}

/* Far below its transformation, nor half of a transformation in a moment: a contact. */
static void contact_that_steps_in_a_heating_does_not_end_it(void)
{
    for (int known = 0; known < 2; known++) {
        for (double at_c = 35.0; at_c < 70.0; at_c += 10.0) {
            begin_cold();
            if (known) {
                (void)heat_then_hold(60.0);
                begin_cold_as_learnt();
            }
            spring_estimator_begin_heating(&estimator, &model, 0);
            bool stepped = false;
            for (double s = 0.0;
                 s < 60.0 && !spring_estimator_has_transformed(&estimator, &model, 0);
                 s += TICK_S) {
                if (!stepped && truth.temperature_c > at_c) {
                    truth.contact_ohm = 0.07 * truth.martensite_ohm;
                    stepped = true;
                }
                (void)tick(3.0);
            }
            (void)snprintf(where, sizeof where, "known %d, step at %.0f degC: %.3f at %.1f degC",
                           known, at_c, truth.austenite, truth.temperature_c);
            TEST_ASSERT_TRUE_MESSAGE(truth.austenite > 0.95 && truth.temperature_c < 120.0, where);
        }
    }
}

/* Its share of the supply changes all the time: no turn has readings for half of its
 * transformation. What it reads then is no jump of a contact. */
static void transformation_that_is_not_read_is_no_jump(void)
{
    (void)heat_then_hold(60.0);
    begin_cold_as_learnt();
    const float learnt_ohm = LEARNT.austenite_ohm;
    spring_estimator_begin_heating(&estimator, &model, 0);
    for (unsigned n = 0; truth.austenite < 0.7; n++) {
        if (truth.austenite > 0.02 && n % 4u == 0) {
            spring_estimator_disturb(&estimator, 0);
        }
        (void)tick(3.0);
    }
    TEST_ASSERT_FALSE(INSIDE.onset);
    for (double s = 0.0; s < 60.0 && !spring_estimator_has_transformed(&estimator, &model, 0);
         s += TICK_S) {
        (void)tick(3.0);
    }
    (void)snprintf(where, sizeof where, "%.4f ohm, learnt %.4f; %.1f degC",
                   (double)LEARNT.austenite_ohm, (double)learnt_ohm, truth.temperature_c);
    TEST_ASSERT_FLOAT_WITHIN_MESSAGE(0.01f * learnt_ohm, learnt_ohm, LEARNT.austenite_ohm, where);
    TEST_ASSERT_TRUE_MESSAGE(truth.austenite > 0.99 && truth.temperature_c < 115.0, where);
}

/* The current goes up and down by a quarter each second, at twice the noise: a turn is compared
 * with one at another current. */
static void transformation_is_seen_through_changes_of_current(void)
{
    (void)heat_then_hold(60.0);
    begin_cold_as_learnt();
    truth.noise_v = 0.008;
    spring_estimator_begin_heating(&estimator, &model, 0);
    double s = 0.0, began_at = -1.0;
    for (; s < 60.0 && !spring_estimator_has_transformed(&estimator, &model, 0); s += TICK_S) {
        (void)tick(fmod(s, 2.0) < 1.0 ? 2.9 : 2.2);
        began_at = began_at < 0.0 && INSIDE.onset ? truth.austenite : began_at;
    }
    (void)snprintf(where, sizeof where, "onset at %.2f, end at %.3f, %.1f degC", began_at,
                   truth.austenite, truth.temperature_c);
    TEST_ASSERT_TRUE_MESSAGE(began_at > 0.0 && began_at < 0.5, where);
    TEST_ASSERT_TRUE_MESSAGE(truth.austenite > 0.99 && truth.temperature_c < 115.0, where);
}

/* A third of its current is left to it in mid-transformation, and it loses a fifth more than
 * declared: it stands still, and the model thinks that it takes up heat. That is no end. */
static void transformation_that_waits_for_current_is_not_over(void)
{
    truth.loss_w_per_k *= 1.2;
    spring_estimator_begin_heating(&estimator, &model, 0);
    while (truth.austenite < 0.85) {
        (void)tick(3.0);
    }
    const double holds_w = truth.loss_w_per_k * (truth.temperature_c - 20.0);
    for (double s = 0.0; s < 120.0; s += TICK_S) {
        (void)tick(sqrt(holds_w / resistance_ohm()));
        TEST_ASSERT_TRUE(spring_estimator_possible(BELIEF) != SPRING_PHASE_AUSTENITE);
    }
    TEST_ASSERT_TRUE(truth.austenite < 0.95);
}

/* ---- learnt before ---- */

/* Power-on with what an earlier heating has taught, and a look at 1 A. */
static uint8_t look(double temperature_c, double austenite)
{
    begin_cold();
    truth.rise_per_k = 0.0004;
    (void)heat_then_hold(60.0);
    const spring_learnt_t learnt = spring_estimator_learnt(&estimator, 0);
    power_comes_on();
    spring_estimator_restore(&estimator, 0, &learnt);
    truth.rise_per_k = 0.0004;
    truth.temperature_c = temperature_c;
    truth.austenite = austenite;
    ticks(1.0, 3.0);
    (void)snprintf(where, sizeof where, "%.0f degC, %.2f", temperature_c, austenite);
    TEST_ASSERT_TRUE_MESSAGE(
        holds(spring_estimator_temperature_c(&estimator, &model, 0), truth.temperature_c), where);
    TEST_ASSERT_TRUE_MESSAGE(
        holds(spring_estimator_austenite(&estimator, &model, 0), truth.austenite), where);
    return spring_estimator_possible(BELIEF);
}

static void look_tells_the_phase_by_what_was_learnt(void)
{
    TEST_ASSERT_EQUAL_UINT8(SPRING_PHASE_MARTENSITE, look(25.0, 0.0));
    TEST_ASSERT_EQUAL_UINT8(SPRING_PHASE_MARTENSITE, look(66.0, 0.0));
    TEST_ASSERT_EQUAL_UINT8(SPRING_PHASE_BETWEEN, look(76.0, 0.5));
    static const double hot_c[] = {84.0, 100.0};
    for (unsigned n = 0; n < 2; n++) { /* it may begin to transform before it is heated */
        const uint8_t possible = look(hot_c[n], 1.0);
        TEST_ASSERT_BITS_HIGH(SPRING_PHASE_AUSTENITE, possible);
        TEST_ASSERT_BITS_LOW(SPRING_PHASE_MARTENSITE, possible);
    }
}

/* A hint that is wrong: it is hot, and reads the austenite that was learnt. */
static void reading_excludes_what_was_told(void)
{
    for (int learnt = 0; learnt < 2; learnt++) {
        begin_cold();
        (void)heat_then_hold(60.0);
        ticks(1.3, 10.0);
        const spring_learnt_t own = spring_estimator_learnt(&estimator, 0);
        const truth_t hot = truth;
        begin_cold();
        truth = hot;
        if (learnt) {
            spring_estimator_restore(&estimator, 0, &own);
        }
        TEST_ASSERT_EQUAL_UINT8(SPRING_PHASE_MARTENSITE, spring_estimator_possible(BELIEF));
        spring_estimator_begin_heating(&estimator, &model, 0);
        ticks(1.5, 1.2);
        TEST_ASSERT_EQUAL_UINT8(learnt ? SPRING_PHASE_BETWEEN | SPRING_PHASE_AUSTENITE
                                       : SPRING_PHASE_MARTENSITE,
                                spring_estimator_possible(BELIEF));
    }
    begin_cold(); /* and a right one stays */
    (void)heat_then_hold(60.0);
    const spring_learnt_t own = spring_estimator_learnt(&estimator, 0);
    begin_cold();
    spring_estimator_restore(&estimator, 0, &own);
    spring_estimator_begin_heating(&estimator, &model, 0);
    ticks(3.0, 1.2);
    TEST_ASSERT_EQUAL_UINT8(SPRING_PHASE_MARTENSITE, spring_estimator_possible(BELIEF));
}

/* Of a spring that was never seen to transform, 3 K of standard deviation stay in the distance. */
static void distance_of_a_cold_spring_has_the_tolerance_of_its_transformation(void)
{
    begin_cold();
    ticks(0.0, 600.0);
    const spring_bounds_t distance = spring_estimator_distance_k(&estimator, &model, 0);
    TEST_ASSERT_TRUE(distance.high - distance.value > 2.6f * 3.0f);
    TEST_ASSERT_TRUE(distance.high - distance.value < 2.6f * 5.0f);
}

static void numbers_that_no_spring_has_are_not_restored(void)
{
    const spring_learnt_t good = {.austenite_ohm = 0.22f, .change = 0.2f, .loss_sd_w_per_k = 1e-4f};
    spring_learnt_t bad[15];
    for (unsigned n = 0; n < 15; n++) {
        bad[n] = good;
    }
    bad[0].austenite_ohm = NAN;
    bad[1].austenite_ohm = 20.0f;
    bad[2].change = NAN;
    bad[3].change = 1.5f;
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
        (void)snprintf(where, sizeof where, "%u", n);
        TEST_ASSERT_EQUAL_FLOAT_MESSAGE(0.0f, LEARNT.austenite_ohm, where);
    }
    static const float possible_ohm[] = {0.0101f, 0.22f, 15.9f};
    for (unsigned n = 0; n < 3; n++) {
        spring_learnt_t own = good;
        own.austenite_ohm = possible_ohm[n];
        spring_estimator_restore(&estimator, 0, &own);
        TEST_ASSERT_EQUAL_FLOAT(possible_ohm[n], LEARNT.austenite_ohm);
        TEST_ASSERT_EQUAL_FLOAT(1e-8f, INSIDE.loss_variance);
    }
    INSIDE.loss_variance = 1e-4f; /* known less than a declared one is, it is that one */
    TEST_ASSERT_FLOAT_WITHIN(1e-7f, 0.12f * 0.0058f, LEARNT.loss_sd_w_per_k);
    INSIDE.loss_variance = 1e-8f;
}

/* ---- readings that are none ---- */

static void check_is_sound(void)
{
    const spring_bounds_t c = spring_estimator_temperature_c(&estimator, &model, 0);
    const spring_bounds_t distance = spring_estimator_distance_k(&estimator, &model, 0);
    const spring_bounds_t austenite = spring_estimator_austenite(&estimator, &model, 0);
    TEST_ASSERT_TRUE_MESSAGE(isfinite(c.low) && isfinite(c.high) && c.low < c.high, where);
    TEST_ASSERT_TRUE_MESSAGE(isfinite(distance.low) && distance.low < distance.high, where);
    TEST_ASSERT_TRUE_MESSAGE(austenite.low >= 0.0f && austenite.low <= austenite.value &&
                                 austenite.value <= austenite.high && austenite.high <= 1.0f,
                             where);
    TEST_ASSERT_TRUE_MESSAGE(INSIDE.loss_variance >= 0.0f, where);
    TEST_ASSERT_TRUE_MESSAGE(isfinite(LEARNT.loss_w_per_k), where);
    TEST_ASSERT_TRUE(thermal_model_is_consistent(&model));
}

static void bad_readings_leave_a_belief_that_can_be_believed(void)
{
    static const sensor_t bad[] = {SENSOR_SILENT, SENSOR_FROZEN, SENSOR_ZERO, SENSOR_WILD};
    for (unsigned n = 0; n < 4; n++) {
        for (int held = 0; held < 2; held++) {
            begin_cold();
            (void)snprintf(where, sizeof where, "sensor %u, held %d", n, held);
            if (held) {
                (void)heat_then_hold(60.0);
                ticks(1.4, 60.0);
            }
            sensor = bad[n];
            for (double s = 0.0; s < 600.0; s += TICK_S) {
                if (tick(held ? 1.4 : 0.0)) {
                    check_is_sound();
                }
            }
            sensor = SENSOR_GOOD; /* off and cold, it transforms as before */
            ticks(0.0, 400.0);
            TEST_ASSERT_TRUE_MESSAGE(heat(60.0) < 60.0 && truth.austenite > 0.99, where);
        }
    }
}

/* What comes in at its largest, for longer than any count can count. */
static void counts_and_sums_saturate(void)
{
    for (unsigned n = 0; n < 40; n++) {
        spring_estimator_take(&estimator, 0, 4095, 4095);
    }
    TEST_ASSERT_EQUAL_UINT8(15, INSIDE.readings);
    TEST_ASSERT_EQUAL_UINT16(15u * 4095u, INSIDE.current_sum_ma);
    TEST_ASSERT_EQUAL_UINT16(15u * 4095u, INSIDE.voltage_sum_mv);
    begin_cold();
    (void)heat_then_hold(60.0);
    hold(6.0, 300.0);
    TEST_ASSERT_EQUAL_UINT8(UINT8_MAX, INSIDE.fresh);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT8(240, INSIDE.quiet); /* where it goes round */
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(at_power_on_everything_is_possible);
    RUN_TEST(it_is_cold_only_after_the_time_that_physics_needs);
    RUN_TEST(transformation_is_seen_whatever_its_sign_and_size);
    RUN_TEST(transformation_is_seen_through_noise);
    RUN_TEST(small_change_is_heated_to_its_end);
    RUN_TEST(onset_that_shows_late_heats_no_further);
    RUN_TEST(coefficient_alone_is_never_an_onset);
    RUN_TEST(driven_spring_is_within_its_bounds);
    RUN_TEST(spring_that_is_off_is_within_its_bounds);
    RUN_TEST(crossing_is_seen_and_makes_the_distance_sure);
    RUN_TEST(hold_that_loses_nothing_shows_no_crossing);
    RUN_TEST(transformation_that_moves_is_noticed);
    RUN_TEST(heating_in_a_gust_goes_on_until_it_is_over);
    RUN_TEST(phase_lost_on_the_way_to_the_hold_is_counted);
    RUN_TEST(coefficient_is_no_loss_above_the_transformation);
    RUN_TEST(contact_is_not_taken_for_phase);
    RUN_TEST(contact_that_comes_and_goes_is_blind_for_a_while);
    RUN_TEST(jump_on_the_way_to_a_hold_is_a_jump);
    RUN_TEST(load_that_comes_within_a_second_is_no_contact);
    RUN_TEST(what_a_loose_contact_seemed_to_lose_is_taken_back);
    RUN_TEST(loss_that_does_not_come_back_stays_in_doubt);
    RUN_TEST(heating_ends_where_it_reads_what_it_did_when_it_had_transformed);
    RUN_TEST(heating_that_a_limit_ended_proves_nothing);
    RUN_TEST(loss_too_small_to_tell_stays_in_doubt);
    RUN_TEST(heating_for_a_loss_that_was_none_ends);
    RUN_TEST(noise_slower_than_a_turn_is_no_loss);
    RUN_TEST(noise_that_was_learnt_is_no_loss_of_the_next_start);
    RUN_TEST(loss_that_was_a_sensor_is_said_and_stays_in_doubt);
    RUN_TEST(restored_spring_is_not_overheated);
    RUN_TEST(heating_that_a_limit_ends_is_doubted);
    RUN_TEST(contact_that_steps_in_a_heating_does_not_end_it);
    RUN_TEST(step_that_looks_like_an_onset_ends_no_heating);
    RUN_TEST(transformation_that_is_not_read_is_no_jump);
    RUN_TEST(transformation_is_seen_through_changes_of_current);
    RUN_TEST(transformation_that_waits_for_current_is_not_over);
    RUN_TEST(look_tells_the_phase_by_what_was_learnt);
    RUN_TEST(reading_excludes_what_was_told);
    RUN_TEST(distance_of_a_cold_spring_has_the_tolerance_of_its_transformation);
    RUN_TEST(numbers_that_no_spring_has_are_not_restored);
    RUN_TEST(bad_readings_leave_a_belief_that_can_be_believed);
    RUN_TEST(counts_and_sums_saturate);
    RUN_TEST(each_sight_of_a_life_is_noted_with_what_was_done);
    RUN_TEST(sight_says_what_was_believed_read_and_moved);
    RUN_TEST(hold_that_loses_nothing_is_one_sight);
    RUN_TEST(contact_that_jumps_is_noted_and_blind_is_said);
    RUN_TEST(time_and_look_after_power_on_are_noted);
    RUN_TEST(heating_that_shows_no_finish_is_noted);
    RUN_TEST(spring_that_has_most_gives_way);
    RUN_TEST(sights_are_found_by_number_and_forgotten_after_four_hours);
    run_seals();
    run_rules();
    run_law();
    run_watch();
    return UNITY_END();
}
