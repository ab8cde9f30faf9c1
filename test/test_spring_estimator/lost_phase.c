#include "lost_phase.h"

#include <math.h>
#include <stdio.h>

#include "one_spring.h"
#include "sights.h"
#include "unity.h"

/* As hot as it is if what it seems to have lost was no phase, degC. */
static float hottest_c(void)
{
    return spring_c(thermal_model_temperature_c7(&model, 0)) + spring_estimator_doubt_k(BELIEF);
}

#define ACTED_ON 0.03f /* by the drive, which heats it then */

/* From the first second of a hold, before it has come to rest, and all of it. */
void phase_lost_on_the_way_to_the_hold_is_counted(void)
{
    truth.offset_v = 0.005;
    (void)heat_then_hold(60.0);
    ticks(0.4, 2.0);
    for (double s = 0.0; s < 60.0 && truth.austenite > 0.8; s += TICK_S) {
        (void)tick(0.9);
    }
    ticks(1.2, 16.0); /* the average follows */
    (void)snprintf(where, sizeof where, "lost %.3f of %.3f", (double)spring_estimator_lost(BELIEF),
                   1.0 - truth.austenite);
    TEST_ASSERT_TRUE_MESSAGE(truth.austenite < 0.85, where);
    TEST_ASSERT_TRUE_MESSAGE(spring_estimator_lost(BELIEF) > ACTED_ON, where);
}

/* A coefficient in print is no loss where none is possible, whatever the change of the alloy. */
void coefficient_is_no_loss_above_the_transformation(void)
{
    static const struct {
        double ratio, rise_per_k;
    } cases[] = {{1.25, 0.0014}, {1.4, 0.0014}, {0.85, -0.0002}, {0.85, 0.0}};
    for (unsigned n = 0; n < 4; n++) {
        unsigned t = 0; /* the dither */
        begin_cold();
        truth.ratio = cases[n].ratio;
        truth.apart_per_k = cases[n].rise_per_k;
        (void)heat_then_hold(60.0);
        float lost = 0.0f;
        for (double s = 0.0; s < 60.0 && distance_k() > 4.0; s += TICK_S) {
            (void)tick(1.05 + 0.05 * (double)(t++ % 8u) / 8.0);
            lost = fmaxf(lost, spring_estimator_lost(BELIEF));
        }
        (void)snprintf(where, sizeof where, "%.2f, %.4f /K: lost %.3f", cases[n].ratio,
                       cases[n].rise_per_k, (double)lost);
        TEST_ASSERT_EQUAL_FLOAT_MESSAGE(0.0f, lost, where);
    }
}

/* A contact that steps is no phase, whatever the sign; nor one that ages. */
void contact_is_not_taken_for_phase(void)
{
    static const double step_ohm[] = {0.015, 0.025, -0.025};
    for (unsigned n = 0; n < 4; n++) {
        begin_cold();
        truth.contact_ohm = n == 2 ? 0.025 : 0.0;
        (void)heat_then_hold(60.0);
        for (long t = 0; t < 15000; t++) {
            truth.contact_ohm += n < 3 && t == 5000 ? step_ohm[n] : 0.0;
            truth.contact_ohm += n == 3 ? 0.020 / 900.0 * TICK_S : 0.0;
            (void)tick(hold_current_a(8.0));
        }
        (void)snprintf(where, sizeof where, "%u: lost %.3f of %.3f at %.1f degC", n,
                       (double)spring_estimator_lost(BELIEF), 1.0 - truth.austenite,
                       truth.temperature_c);
        TEST_ASSERT_TRUE_MESSAGE(truth.austenite > 0.97, where);
        TEST_ASSERT_TRUE_MESSAGE(spring_estimator_lost(BELIEF) < 0.03f &&
                                     !spring_estimator_blind(BELIEF),
                                 where); /* not heated back */
    }
}

/* One that steps has moved; one that goes and comes tells nothing, until it has been quiet. A small
 * one is told by its steps up: no hold gains phase at once. */
void contact_that_comes_and_goes_is_blind_for_a_while(void)
{
    static const double step_ohm[] = {0.03, 0.008};
    for (unsigned small = 0; small < 2; small++) {
        begin_cold();
        (void)heat_then_hold(60.0);
        hold(12.0, 60.0);
        for (unsigned n = 0; n < 3; n++) {
            TEST_ASSERT_FALSE(spring_estimator_blind(BELIEF));
            truth.contact_ohm = n % 2u == 0 ? step_ohm[small] : 0.0;
            hold(12.0, 20.0);
        }
        TEST_ASSERT_TRUE(spring_estimator_blind(BELIEF));
        TEST_ASSERT_FALSE(spring_estimator_sees(BELIEF));
        TEST_ASSERT_TRUE(INSIDE.unproven);
        hold(12.0, 256.0);
        TEST_ASSERT_FALSE(spring_estimator_blind(BELIEF));
    }
}

/* A sensor's gain falls by a quarter while the current is too weak to tell: that is no phase. */
void jump_on_the_way_to_a_hold_is_a_jump(void)
{
    begin_cold();
    (void)heat_then_hold(60.0);
    ticks(0.3, 3.0);
    truth.contact_ohm = -0.26 * resistance_ohm();
    for (double s = 0.0; s < 12.0; s += TICK_S) { /* it comes back slowly */
        (void)tick(fmin(0.3 + 0.1 * s, 1.2));
    }
    (void)snprintf(where, sizeof where, "lost %.2f of %.2f", (double)spring_estimator_lost(BELIEF),
                   1.0 - truth.austenite);
    TEST_ASSERT_TRUE_MESSAGE(INSIDE.unsteady > 0, where);
    TEST_ASSERT_TRUE_MESSAGE(spring_estimator_lost(BELIEF) < 0.1f, where);
}

/* A finger that presses takes a few turns: each of them loses as much as a contact's step. */
void load_that_comes_within_a_second_is_no_contact(void)
{
    begin_cold();
    (void)heat_then_hold(60.0);
    hold(3.0, 60.0);
    for (double s = 0.0; s < 20.0 && spring_estimator_lost(BELIEF) < ACTED_ON; s += TICK_S) {
        truth.shift_k = fmin(8.0, 8.0 * s);
        (void)tick(hold_current_a(3.0));
    }
    (void)snprintf(where, sizeof where, "lost %.3f of %.3f", (double)spring_estimator_lost(BELIEF),
                   1.0 - truth.austenite);
    TEST_ASSERT_TRUE_MESSAGE(spring_estimator_lost(BELIEF) > ACTED_ON, where);
    TEST_ASSERT_EQUAL_UINT16(0, INSIDE.unsteady);
}

static float believed_c(void)
{
    return (float)thermal_model_temperature_c7(&model, 0) / 128.0f;
}

/* A contact gets better by 5 %, as if phase was lost; then it goes and comes. It was not. */
void what_a_loose_contact_seemed_to_lose_is_taken_back(void)
{
    begin_cold();
    truth.contact_ohm = 0.012;
    (void)heat_then_hold(60.0);
    for (double s = 0.0; s < 90.0; s += TICK_S) {
        truth.contact_ohm = s < 60.0 ? 0.012 : 0.0;
        (void)tick(hold_current_a(8.0));
    }
    TEST_ASSERT_TRUE(spring_estimator_doubt_k(BELIEF) > 4.0f);
    for (double s = 0.0; s < 60.0; s += TICK_S) {
        truth.contact_ohm = fmod(s, 10.0) < 5.0 ? 0.012 : 0.0;
        (void)tick(hold_current_a(8.0));
    }
    (void)snprintf(where, sizeof where, "%.1f degC, true %.1f", (double)believed_c(),
                   truth.temperature_c);
    TEST_ASSERT_TRUE(spring_estimator_blind(BELIEF));
    TEST_ASSERT_EQUAL_FLOAT(0.0f, spring_estimator_doubt_k(BELIEF));
    TEST_ASSERT_FLOAT_WITHIN_MESSAGE(7.0f, (float)truth.temperature_c, believed_c(), where);
}

/* In the hold a contact gets better by 5 %, as if phase was lost, and no heat brings it back: the
 * reading tells nothing any more. It may still have been phase, of a spring that loses more heat
 * than was counted: it is held as if it was, and doubted as if it was not. */
void loss_that_does_not_come_back_stays_in_doubt(void)
{
    begin_cold();
    truth.contact_ohm = 0.012;
    (void)heat_then_hold(60.0);
    hold(12.0, 60.0);
    truth.contact_ohm = 0.0;
    for (double s = 0.0; s < 60.0 && spring_estimator_lost(BELIEF) < 0.03f; s += TICK_S) {
        (void)tick(hold_current_a(12.0));
    }
    (void)snprintf(where, sizeof where, "lost %.3f: %.1f to %.1f degC, true %.1f",
                   (double)spring_estimator_lost(BELIEF), (double)believed_c(), (double)hottest_c(),
                   truth.temperature_c);
    TEST_ASSERT_TRUE_MESSAGE(spring_estimator_lost(BELIEF) >= 0.03f, where); /* it is taken in */
    TEST_ASSERT_TRUE_MESSAGE((double)believed_c() < truth.temperature_c - 3.0, where);
    /* the contact's heat was read as the spring's: 5 % of its rise */
    TEST_ASSERT_FLOAT_WITHIN_MESSAGE(4.0f, (float)truth.temperature_c, hottest_c(), where);
    (void)heat_then_hold(60.0);
    hold(12.0, 90.0);
    (void)snprintf(where, sizeof where, "at rest: %.1f degC, true %.1f", (double)believed_c(),
                   truth.temperature_c);
    TEST_ASSERT_TRUE(spring_estimator_blind(BELIEF));
    TEST_ASSERT_TRUE_MESSAGE((double)believed_c() < truth.temperature_c - 3.0, where);
    TEST_ASSERT_FLOAT_WITHIN_MESSAGE(4.0f, (float)truth.temperature_c, hottest_c(), where);
}

/* It gives off a quarter less than it did, unseen, and is far hotter than it is believed to be
 * when something seems to be lost. What it read when it had transformed last ends the heating. */
void heating_ends_where_it_reads_what_it_did_when_it_had_transformed(void)
{
    begin_cold();
    truth.rise_per_k = 0.0007;
    (void)heat_then_hold(60.0);
    const float austenite_ohm = LEARNT.austenite_ohm;
    truth.loss_w_per_k *= 0.75;
    hold(3.0, 120.0);
    (void)snprintf(where, sizeof where, "%.1f degC, true %.1f", (double)believed_c(),
                   truth.temperature_c);
    TEST_ASSERT_TRUE_MESSAGE(truth.temperature_c > (double)believed_c() + 8.0, where);
    spring_estimator_begin_heating(&estimator, &model, 0);
    for (double s = 0.0; s < 60.0 && !spring_estimator_has_transformed(&estimator, &model, 0);
         s += TICK_S) {
        (void)tick(3.0);
    }
    (void)snprintf(where, sizeof where, "%.1f degC, true %.1f, %.5f of %.5f ohm",
                   (double)believed_c(), truth.temperature_c, (double)INSIDE.ohm,
                   (double)austenite_ohm);
    TEST_ASSERT_TRUE_MESSAGE(believed_c() < 96.0f, where);
    TEST_ASSERT_FLOAT_WITHIN_MESSAGE(0.004f * austenite_ohm, austenite_ohm, INSIDE.ohm, where);
}

static void hold_for(double seconds)
{
    for (double s = 0.0; s < seconds; s += TICK_S) {
        (void)tick(hold_current_a(8.0));
    }
}

static void hold_with_contact(double contact_ohm, double noise_v)
{
    begin_cold();
    truth.contact_ohm = contact_ohm;
    truth.noise_v = noise_v;
    (void)heat_then_hold(60.0);
    hold_for(60.0);
}

/* A limit ends the heating before it could come back: that it has not tells nothing. */
void heating_that_a_limit_ended_proves_nothing(void)
{
    hold_with_contact(0.0, 0.016);
    while (spring_estimator_lost(BELIEF) < 0.05f) {
        truth.shift_k += 0.1 * TICK_S; /* a load that grows */
        (void)tick(hold_current_a(3.0));
    }
    spring_estimator_begin_heating(&estimator, &model, 0);
    ticks(3.0, 1.0);
    spring_estimator_begin_hold(&estimator, &model, 0, true);
    TEST_ASSERT_TRUE(INSIDE.unproven && !INSIDE.doubted);
    hold(12.0, 60.0);
    (void)snprintf(where, sizeof where, "%.1f K in doubt; %.1f degC, true %.1f",
                   (double)spring_estimator_doubt_k(BELIEF), (double)believed_c(),
                   truth.temperature_c);
    TEST_ASSERT_TRUE_MESSAGE(INSIDE.unproven && spring_estimator_doubt_k(BELIEF) > 0.0f, where);
}

/* Less than 1 % tells nothing: what may be hotter stays so. */
void loss_too_small_to_tell_stays_in_doubt(void)
{
    hold_with_contact(0.0012, 0.004);
    truth.contact_ohm = 0.0;
    hold_for(60.0);
    (void)heat_then_hold(60.0);
    hold_for(30.0);
    (void)snprintf(where, sizeof where, "%.1f K in doubt; %.1f degC, true %.1f",
                   (double)spring_estimator_doubt_k(BELIEF), (double)believed_c(),
                   truth.temperature_c);
    TEST_ASSERT_TRUE_MESSAGE(spring_estimator_doubt_k(BELIEF) > 5.0f, where);
    TEST_ASSERT_FLOAT_WITHIN_MESSAGE(4.0f, (float)truth.temperature_c, hottest_c(), where);
}

/* A contact that gets better by more than a line forgives looks like half of the phase. Heat goes
 * on until the rest must have come, and no further: it is not there to come. */
void heating_for_a_loss_that_was_none_ends(void)
{
    hold_with_contact(0.015, 0.004);
    truth.contact_ohm = 0.0;
    for (double s = 0.0; s < 60.0 && spring_estimator_lost(BELIEF) < 0.2f; s += TICK_S) {
        (void)tick(hold_current_a(8.0));
    }
    const float lost = spring_estimator_lost(BELIEF);
    (void)heat_then_hold(60.0);
    (void)snprintf(where, sizeof where, "lost %.2f: %.1f degC, blind %d", (double)lost,
                   truth.temperature_c, spring_estimator_blind(BELIEF));
    TEST_ASSERT_TRUE_MESSAGE(lost > 0.2f, where);
    TEST_ASSERT_TRUE_MESSAGE(truth.temperature_c < 122.0, where);
    TEST_ASSERT_TRUE_MESSAGE(spring_estimator_blind(BELIEF), where); /* and it is said */
}

/* A third of a percent that stays for a second: the average keeps half of it. It takes a minute or
 * two to tell. */
void noise_slower_than_a_turn_is_no_loss(void)
{
    unsigned losses = 0;
    begin_cold();
    truth.slow_noise_v = 0.001;
    (void)heat_then_hold(60.0);
    for (double s = 0.0; s < 1800.0; s += TICK_S) {
        (void)tick(hold_current_a(6.0));
        if (spring_estimator_lost(BELIEF) > 0.0f) {
            losses++;
            (void)heat_then_hold(60.0);
        }
    }
    (void)snprintf(where, sizeof where, "%u, noise %.5f", losses, (double)LEARNT.slow_noise);
    TEST_ASSERT_TRUE_MESSAGE(losses <= 2, where);
}

/* A whole percent that stays for a second. */
void noise_that_was_learnt_is_no_loss_of_the_next_start(void)
{
    begin_cold();
    truth.slow_noise_v = 0.003;
    (void)heat_then_hold(60.0);
    hold(6.0, 300.0);
    const spring_learnt_t learnt = spring_estimator_learnt(&estimator, 0);
    begin_cold();
    spring_estimator_restore(&estimator, 0, &learnt);
    truth.slow_noise_v = 0.003;
    (void)heat_then_hold(60.0);
    for (double s = 0.0; s < 300.0; s += TICK_S) {
        (void)tick(hold_current_a(6.0));
        (void)snprintf(where, sizeof where, "after %.0f s, noise %.5f", s,
                       (double)LEARNT.slow_noise);
        TEST_ASSERT_TRUE_MESSAGE(spring_estimator_lost(BELIEF) == 0.0f, where);
    }
}

/* A sensor's gain falls by 8 % in a hold. Two heatings later that is said, and it may still be as
 * hot as if what it seemed to have lost was none. */
void loss_that_was_a_sensor_is_said_and_stays_in_doubt(void)
{
    hold_with_contact(0.0, 0.004);
    truth.contact_ohm = -0.08 * resistance_ohm();
    for (unsigned n = 0; n < 3 && !spring_estimator_blind(BELIEF); n++) {
        for (double s = 0.0; s < 60.0 && spring_estimator_lost(BELIEF) < 0.03f; s += TICK_S) {
            (void)tick(hold_current_a(8.0));
        }
        TEST_ASSERT_TRUE(spring_estimator_lost(BELIEF) >= 0.03f);
        spring_estimator_begin_heating(&estimator, &model, 0);
        ticks(3.0, 2.0);
        spring_estimator_begin_hold(&estimator, &model, 0, true); /* by a limit */
    }
    (void)snprintf(where, sizeof where, "%.1f K in doubt; %.1f degC, true %.1f",
                   (double)spring_estimator_doubt_k(BELIEF), (double)believed_c(),
                   truth.temperature_c);
    TEST_ASSERT_TRUE_MESSAGE(spring_estimator_blind(BELIEF), where);
    TEST_ASSERT_FLOAT_WITHIN_MESSAGE(4.0f, (float)truth.temperature_c, hottest_c(), where);
}

/* Power off in mid-hold: what was learnt holds only beside the sensor's offset, and a spring that
 * reads as austenite cannot have been cold, though a contact is a little better than it was. */
void restored_spring_is_not_overheated(void)
{
    static const struct {
        double offset_v, contact_ohm;
    } cases[] = {{-0.008, 0.0}, {0.0, 0.0}, {0.008, 0.0}, {0.0, 0.003}};
    for (unsigned n = 0; n < 4; n++) {
        begin_cold();
        truth.offset_v = cases[n].offset_v;
        truth.contact_ohm = cases[n].contact_ohm;
        (void)heat_then_hold(60.0);
        ticks(0.4, 2.0);
        hold_for(60.0);
        const spring_learnt_t learnt = spring_estimator_learnt(&estimator, 0);
        const truth_t before = truth;
        power_comes_on();
        truth = before;
        truth.contact_ohm = 0.0;
        spring_estimator_restore(&estimator, 0, &learnt);
        spring_estimator_begin_heating(&estimator, &model, 0);
        ticks(1.0, 1.5); /* the look */
        for (double s = 0.0; s < 60.0 && !spring_estimator_has_transformed(&estimator, &model, 0);
             s += TICK_S) {
            (void)tick(believed_c() < 104.0f ? 3.0 : 1.5); /* the drive derates from 100 degC on */
        }
        (void)snprintf(where, sizeof where, "%.3f V, %.3f ohm: %.1f degC", cases[n].offset_v,
                       cases[n].contact_ohm, truth.temperature_c);
        TEST_ASSERT_TRUE_MESSAGE(truth.temperature_c < 118.0, where);
    }
}
