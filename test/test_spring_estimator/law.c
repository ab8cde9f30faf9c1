/* The equations of docs/believing.md, written down once more: a row is what is believed before, and
 * what must be believed after one turn, one sight, one beginning. */
#include <math.h>
#include <stdio.h>

#include "../run_tests.h"
#include "one_spring.h"
#include "rules.h"
#include "sights.h"
#include "spring_estimator_internal.h"

#define ANY      SPRING_PHASE_ANY
#define CAPACITY 0.3    /* J/K, declared */
#define LOSS     0.0058 /* W/K */
#define TURN_S   0.25
#define LEAST_K2 0.36 /* of a distance: 0.6 K within a spring */

#define NEAR(is, value)                                                                            \
    TEST_ASSERT_FLOAT_WITHIN(1e-6f + 2e-4f * fabsf((float)(is)), (float)(is), (value))

/* As the model has it. */
static double in_128ths(double c)
{
    return (double)lround(c * 128.0) / 128.0;
}

static void put(double c)
{
    thermal_model_set_temperature(&model, 0, (int16_t)lround(c * 128.0));
}

static float put_c(void)
{
    return spring_now_c(&model, 0);
}

static void give(double current_a, double ohm)
{
    if (current_a > 0.0) {
        give_readings(12, current_a, ohm);
    }
}

static void turn(void)
{
    const uint16_t stepped_turns = estimator.stepped_turns;
    spring_seal(&estimator, 0);
    TEST_ASSERT_TRUE(spring_estimator_update(&estimator, &model, 0));
    TEST_ASSERT_FALSE(spring_estimator_has_begun_anew(BELIEF));
    TEST_ASSERT_EQUAL_UINT16(stepped_turns > 0 ? stepped_turns - 1 : 0, estimator.stepped_turns);
}

/* ---- the law ---- */

TEST(errors_of_distance_and_loss_go_on_by_the_law)
{
    static const struct {
        double was_c, c, current_a;
        double var_k2, cov_w, loss_sd, more_loss, capacity_k;
        double gone_k, gone_w_per_k;
        bool heating, unsteady;
    } table[] = {
        {60.0, 60.0, 0.0, 9.0, 0.0, 7e-4, 0.0, 0.0, 0.0, 0.0, false, false},
        {60.0, 60.0, 0.0, 9.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, false, false},
        {60.0, 60.5, 2.0, 9.0, 0.0, 7e-4, 1e-3, 2.0, 0.0, 0.0, false, false},
        {60.5, 60.0, 2.0, 4.0, -2e-3, 3e-4, -1e-3, 2.0, 5.0, -1e-4, false, true},
        {60.5, 60.0, 2.0, 4.0, 2e-3, 3e-4, -1e-3, -2.0, 5.0, 1e-4, true, false},
        {80.0, 80.1, 3.0, 4.0, -2e-3, 3e-4, 2e-3, -2.0, 5.0, 1e-4, true, true},
        {80.0, 81.0, 1.0, 4.0, -2e-3, 3e-4, 2e-3, -2.0, 5.0, 1e-4, true, true},
        {20.0, 20.0, 0.0, 0.3, 0.0, 7e-4, 0.0, 0.0, 0.0, 1.0, true, false},
        {80.0, 79.0, 0.0, 9.0, 1e-3, 7e-4, 1e-3, 3.0, -1.0, 1.0, true, true},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold();
        row(n);
        put(table[n].was_c);
        INSIDE.last_c7 = thermal_model_temperature_c7(&model, 0);
        put(table[n].c);
        INSIDE.variance_k2 = (float)table[n].var_k2;
        INSIDE.covariance = (float)table[n].cov_w;
        INSIDE.loss_variance = (float)(table[n].loss_sd * table[n].loss_sd);
        INSIDE.learnt.loss_w_per_k = (float)table[n].more_loss;
        INSIDE.declared_stiffness_w_per_k = 0.006f;
        INSIDE.capacity_k = (float)table[n].capacity_k;
        INSIDE.gone_k = (float)table[n].gone_k;
        INSIDE.gone_w_per_k = (float)table[n].gone_w_per_k;
        INSIDE.heating = table[n].heating;
        INSIDE.unsteady = table[n].unsteady ? 9 : 0;
        INSIDE.run.heat = (spring_heat_t){.heat_k = 10.0f, .flat_k = 1.0f};
        INSIDE.onset = n != 4;
        INSIDE.disturbance_k = 5.0f;
        INSIDE.seen = true; /* in the turn before */
        give(table[n].current_a, 0.2);
        const double h = TURN_S / CAPACITY, above_k = in_128ths(table[n].c) - 20.0;
        const double rise_k = in_128ths(table[n].c) - in_128ths(table[n].was_c);
        const double k = 1.0 - h * (0.006 + table[n].more_loss), l = -h * above_k;
        const double var_g = table[n].loss_sd * table[n].loss_sd;
        const double extra_w = table[n].more_loss * above_k;
        const double gives_w = 1e-6 * thermal_model_power_to_hold_uw(
                                          &model, 0, thermal_model_temperature_c7(&model, 0)) +
                               extra_w;
        const double heat_k = h * (table[n].current_a * table[n].current_a * 0.2 - gives_w);
        estimator.stepped_turns = (uint16_t)n;
        spring_seal_shared(&estimator);
        const bool warms = table[n].heating && table[n].unsteady && heat_k > rise_k;
        turn();
        NEAR(fmax(k * k * table[n].var_k2 + 2.0 * k * l * table[n].cov_w + l * l * var_g, LEAST_K2),
             INSIDE.variance_k2);
        NEAR(1e3 * (k * table[n].cov_w + l * var_g), 1e3f * INSIDE.covariance);
        NEAR(1e12 * (var_g + TURN_S * pow(0.0005 * LOSS, 2)), 1e12f * INSIDE.loss_variance);
        NEAR(k * table[n].capacity_k + 0.09 * rise_k, INSIDE.capacity_k);
        NEAR(gives_w, INSIDE.gives_w);
        NEAR(extra_w, 1e-6f * (float)INSIDE.extra_loss_uw);
        NEAR(table[n].gone_k <= 0.0 ? table[n].gone_k
                                    : k * table[n].gone_k + h * above_k * table[n].gone_w_per_k +
                                          (warms ? heat_k - rise_k : 0.0),
             INSIDE.gone_k);
        TEST_ASSERT_FLOAT_WITHIN(1e-4f, 5.0f * 0.9998f, INSIDE.disturbance_k);
        TEST_ASSERT_FALSE(spring_estimator_has_just_seen(BELIEF));
        TEST_ASSERT_EQUAL_INT16(lround(128.0 * rise_k), spring_estimator_moved_c7(BELIEF));
        if (table[n].heating) { /* one that waits cools by the least loss, one that may lose more */
            NEAR(10.0 + (heat_k < 0.0 ? 0.8 : 1.0) * heat_k, INSIDE.run.heat.heat_k);
            /* ... and nothing can be over that has not begun */
            NEAR(n != 4 ? 1.0 + heat_k - 0.2 * h * gives_w : 1.0, INSIDE.run.heat.flat_k);
        }
    }
}

/* e = what is seen less what was believed; D and S are variances of the distance, without and with
 * that of the sight. */
TEST(sight_moves_all_by_what_each_is_known_to)
{
    static const struct {
        double seen_c, sd_k; /* from 80 degC */
        double var_k2, cov_w, capacity_k, loss_sd, more_loss, shift_k, shift_sd;
    } table[] = {
        {84.0, 2.0, 9.0, 0.0, 0.0, 7e-4, 0.0, 0.0, 3.0},
        {76.0, 2.0, 9.0, -1.5e-3, 2.0, 7e-4, 1e-4, 1.0, 2.0},
        {76.0, 1.0, 4.0, -1e-3, -2.0, 7e-4, 1e-4, -1.0, 9.0},
        {82.0, 0.0, 1.0, 5e-4, 0.0, 7e-4, 2e-3, 0.0, 0.5},
        {20.0, 1.0, 9.0, -1.9e-3, 0.0, 7e-4, 0.0, 25.0, 3.0},
        {140.0, 1.0, 9.0, -1.9e-3, 0.0, 7e-4, 0.0, -25.0, 3.0},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold();
        row(n);
        put(80.0);
        INSIDE.variance_k2 = (float)table[n].var_k2;
        INSIDE.covariance = (float)table[n].cov_w;
        INSIDE.capacity_k = (float)table[n].capacity_k;
        INSIDE.loss_variance = (float)(table[n].loss_sd * table[n].loss_sd);
        INSIDE.learnt.loss_w_per_k = (float)table[n].more_loss;
        INSIDE.shift_k = (float)table[n].shift_k;
        INSIDE.shift_variance_k2 = (float)(table[n].shift_sd * table[n].shift_sd);
        INSIDE.kept_w_per_k = 1e-3f;
        const double e = table[n].seen_c - 80.0;
        const double d = table[n].var_k2 + table[n].capacity_k * table[n].capacity_k;
        const double s = d + table[n].sd_k * table[n].sd_k;
        const double left = 1.0 - d / s, by_loss = table[n].cov_w / s;
        const double shift_k2 = table[n].shift_sd * table[n].shift_sd;
        const double most = 0.45 * LOSS, least = -0.8 * LOSS;
        NEAR(e, spring_see(&estimator, &INSIDE, &model, 0, (float)table[n].seen_c,
                           (float)table[n].sd_k, n == 0 ? M : A));
        TEST_ASSERT_FLOAT_WITHIN(0.01f, (float)(80.0 + d / s * e), put_c());
        TEST_ASSERT_EQUAL(n != 0 && put_c() > 78.0f,
                          thermal_model_austenite(&model, 0) == THERMAL_MODEL_AUSTENITE_FULL);
        NEAR(fmin(fmax(table[n].shift_k - fmin(shift_k2 / s, d / s) * e, -30.0), 30.0),
             INSIDE.shift_k);
        NEAR(1e3 * fmin(fmax(table[n].more_loss + by_loss * e, least), most),
             1e3f * INSIDE.learnt.loss_w_per_k);
        NEAR(1e6 * (table[n].loss_sd * table[n].loss_sd - by_loss * table[n].cov_w),
             1e6f * INSIDE.loss_variance);
        NEAR(1e3 * left * table[n].cov_w, 1e3f * INSIDE.covariance);
        NEAR(left * table[n].capacity_k, INSIDE.capacity_k);
        NEAR(left * shift_k2, INSIDE.shift_variance_k2);
        NEAR(fmax(left * table[n].var_k2, LEAST_K2), INSIDE.variance_k2);
        TEST_ASSERT_EQUAL_FLOAT(0.0f, INSIDE.kept_w_per_k);
        TEST_ASSERT_EQUAL_INT16(thermal_model_temperature_c7(&model, 0), INSIDE.last_c7);
        TEST_ASSERT_TRUE(spring_estimator_has_just_seen(BELIEF));
    }
}

/* It is no colder than 80 degC: as much as that teaches of the loss, but no surer; by more than
 * 2.6 sd of the loss without a sight what it reads is no phase. */
TEST(what_keeps_its_phase_is_no_colder_and_tells_of_its_loss)
{
    static const struct {
        double c, cov_w, loss_sd, kept;
        bool moves, blind;
    } table[] = {
        {78.0, -1e-3, 7e-4, 0.0, true, false},      {80.0, -1e-3, 7e-4, 0.0, false, false},
        {82.0, -1e-3, 7e-4, 0.0, false, false},     {78.0, -1e-3, 7e-4, -1.65e-3, true, true},
        {78.0, -1e-3, 7e-4, -1.55e-3, true, false}, {79.0, 1e-3, 1e-4, 2e-4, true, true}};
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold();
        row(n);
        put(table[n].c);
        INSIDE.possible = A;
        INSIDE.variance_k2 = 5.0f;
        INSIDE.capacity_k = 2.0f;
        INSIDE.covariance = (float)table[n].cov_w;
        INSIDE.loss_variance = (float)(table[n].loss_sd * table[n].loss_sd);
        INSIDE.kept_w_per_k = (float)table[n].kept;
        INSIDE.learnt.loss_w_per_k = 1e-4f;
        const double less = table[n].moves ? table[n].cov_w / 9.0 * (80.0 - table[n].c) : 0.0;
        spring_keep_above(&estimator, &INSIDE, &model, 0, 80.0f);
        NEAR(1e3 * (1e-4 + less), 1e3f * INSIDE.learnt.loss_w_per_k);
        NEAR(1e3 * (table[n].kept + less), 1e3f * INSIDE.kept_w_per_k);
        NEAR(table[n].moves ? 80.0 : table[n].c, put_c());
        NEAR(5.0, INSIDE.variance_k2);
        TEST_ASSERT_EQUAL(table[n].blind, INSIDE.blind);
        TEST_ASSERT_EQUAL_FLOAT(table[n].blind ? 1.0f : 0.0f, INSIDE.lost);
        TEST_ASSERT_EQUAL(
            table[n].moves,
            sights_inside(&estimator)->sight[sights_inside(&estimator)->count - 1u].kind ==
                SPRING_SIGHT_KEPT);
        if (table[n].moves) { /* from austenite, and all of it is one sight */
            const spring_sight_t *const sight = spring_sights_newest(sights_inside(&estimator), 0);
            TEST_ASSERT_TRUE(thermal_model_austenite(&model, 0) == THERMAL_MODEL_AUSTENITE_FULL);
            TEST_ASSERT_INT_WITHIN(1, lround(1e4 * (table[n].kept + less) / LOSS), sight->loss);
            TEST_ASSERT_EQUAL_UINT8(0, sight->seen_sd);
            TEST_ASSERT_EQUAL_INT16(thermal_model_temperature_c7(&model, 0), INSIDE.last_c7);
            const unsigned count = sights_inside(&estimator)->count; /* and goes on in it */
            spring_keep_above(&estimator, &INSIDE, &model, 0, 81.0f);
            TEST_ASSERT_EQUAL_UINT(count + table[n].blind, sights_inside(&estimator)->count);
        }
    }
}

/* ---- from power-on ---- */

/* Three turns at 0.8 A or more tell a phase by what was learnt: 12 % and 2.6 sd of a turn's noise,
 * but no more than 40 %. Of springs that may be hot austenite only (and no more than that reads
 * 50 K hotter: half of a current, and resets, heated one to 233 degC), of others martensite only:
 * what tells anything else leaves it to wait, and is looked for no longer. The temperature is even
 * over the phase's width, and a heating goes on from no less. */
TEST(look_tells_a_phase_and_a_temperature_evenly_over_its_width)
{
    static const struct {
        uint8_t possible;
        bool told, doubtful;
        double phase, noise, current_a, change;
        uint8_t fresh; /* before */
        bool heating, looks;
        uint8_t then;
        double low_c, high_c;
    } table[] = {
        {ANY, false, false, 0.12, 0.002, 2.0, 0.2, 2, false, false, M, 20.0, 88.0},
        {ANY, false, false, 0.14, 0.002, 2.0, -0.2, 2, true, false, M, 20.0, 88.0},
        {ANY, false, true, 0.14, 0.002, 2.0, 0.2, 2, true, false, ANY, 0.0, 0.0},
        {ANY, false, false, 0.15, 0.002, 2.0, 0.2, 2, true, false, ANY, 0.0, 0.0},
        {ANY, false, true, 0.49, 0.002, 2.0, 0.2, 2, true, false, ANY, 0.0, 0.0},
        {ANY, false, true, 0.85, 0.002, 2.0, 0.2, 9, false, false, ANY, 0.0, 0.0},
        {ANY, false, true, 0.86, 0.002, 2.0, 0.2, 9, true, false, A | B, 78.0, 98.0},
        {ANY, false, true, 0.86, 0.002, 2.0, -0.2, 9, true, false, A | B, 78.0, 98.0},
        {ANY, false, false, 0.86, 0.002, 2.0, 0.2, 9, true, false, ANY, 0.0, 0.0},
        {ANY, false, true, 1.51, 0.002, 2.0, 0.2, 9, true, false, A | B, 78.0, 98.0},
        {ANY, false, true, 1.53, 0.002, 2.0, 0.2, 9, true, false, ANY, 0.0, 0.0},
        {ANY, false, true, 6.0, 0.002, 2.0, 0.2, 9, true, false, ANY, 0.0, 0.0},
        {M, true, false, 1.53, 0.002, 2.0, 0.2, 9, false, false, A, 78.0, 98.0},
        {ANY, false, false, 0.0, 0.021, 2.0, 0.2, 9, true, false, M, 20.0, 88.0},
        {ANY, false, false, 0.0, 0.022, 2.0, 0.2, 9, true, true, ANY, 0.0, 0.0},
        {ANY, false, false, 0.0, 0.002, 2.0, 0.2, 1, true, true, ANY, 0.0, 0.0},
        {ANY, false, false, 0.0, 0.002, 0.79, 0.2, 9, true, true, ANY, 0.0, 0.0},
        {ANY, false, false, 0.0, 0.002, 0.8, 0.2, 9, true, false, M, 20.0, 88.0},
        {M, true, false, 0.85, 0.002, 2.0, 0.2, 9, false, false, M, 0.0, 0.0},
        {M, true, false, 0.86, 0.002, 2.0, 0.2, 9, false, false, A, 78.0, 98.0},
        {M, true, false, 0.86, 0.022, 2.0, 0.2, 9, false, false, M, 0.0, 0.0},
        {M, false, false, 0.86, 0.002, 2.0, 0.2, 9, false, false, M, 0.0, 0.0},
        {B, true, false, 0.86, 0.002, 2.0, 0.2, 9, false, true, B, 0.0, 0.0},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold();
        row(n);
        put(75.0);
        INSIDE.possible = table[n].possible;
        INSIDE.untested = table[n].told || table[n].possible == ANY;
        estimator.doubtful = table[n].doubtful;
        INSIDE.hottest_c = 110.0f;
        INSIDE.noise = (float)table[n].noise;
        INSIDE.fresh = table[n].fresh;
        INSIDE.current_a = (float)table[n].current_a;
        INSIDE.heating = table[n].heating;
        INSIDE.learnt.austenite_ohm = 0.25f;
        INSIDE.learnt.martensite_ohm = 0.2f;
        INSIDE.learnt.change = (float)table[n].change;
        const double ohm = 0.25 * (1.0 - table[n].change * (1.0 - table[n].phase));
        INSIDE.slow_ohm = (float)ohm;
        INSIDE.averaged = 16;
        give(table[n].current_a, ohm);
        turn();
        const bool looked = table[n].high_c > 0.0;
        TEST_ASSERT_EQUAL_UINT8(table[n].then, INSIDE.possible);
        TEST_ASSERT_EQUAL_UINT8(table[n].fresh + 1, INSIDE.fresh);
        TEST_ASSERT_EQUAL(table[n].looks, INSIDE.untested);
        TEST_ASSERT_EQUAL(looked, spring_estimator_has_just_seen(BELIEF));
        NEAR(0.25, INSIDE.learnt.austenite_ohm); /* a heating begins with no reading yet */
        TEST_ASSERT_FLOAT_WITHIN(
            0.01f, looked ? (float)(table[n].low_c + table[n].high_c) / 2.0f : 75.0f, put_c());
        if (looked) {
            TEST_ASSERT_EQUAL_UINT8(SPRING_SIGHT_LOOKED, newest()->kind);
            TEST_ASSERT_EQUAL(table[n].possible == ANY, newest()->believed_sd == 0);
            const float sd_k = 0.29f * (float)(table[n].high_c - table[n].low_c);
            TEST_ASSERT_FLOAT_WITHIN(0.01f, sd_k * sd_k + 9.0f, INSIDE.variance_k2);
            TEST_ASSERT_FLOAT_WITHIN(0.01f, 9.0f, INSIDE.shift_variance_k2);
            TEST_ASSERT_EQUAL(table[n].phase > 0.5 && put_c() > 78.0f,
                              thermal_model_austenite(&model, 0) == THERMAL_MODEL_AUSTENITE_FULL);
            TEST_ASSERT_EQUAL(table[n].heating, INSIDE.heating);
            if (table[n].heating) {
                NEAR(table[n].low_c, INSIDE.run.heat.begun_c);
            }
        }
    }
}

/* A look that tells nothing, by noise or a contact that comes and goes, heats by 3 K at most. */
TEST(look_that_tells_nothing_ends)
{
    static const double hottest_c[] = {122.0, 124.0};
    for (size_t n = 0; n < ROWS(hottest_c); n++) {
        power_comes_on();
        row(n);
        INSIDE.learnt.austenite_ohm = 0.25f;
        INSIDE.hottest_c = (float)hottest_c[n];
        give(2.0, 0.2);
        turn();
        TEST_ASSERT_EQUAL(hottest_c[n] < 123.0, spring_estimator_may_look(&estimator, 0));
        TEST_ASSERT_EQUAL_UINT8(ANY, INSIDE.possible);
    }
}

/* The hottest possible gives off 0.8 of the declared loss; below martensite start its whole latent
 * heat, too. Below martensite finish it is cold. */
TEST(hottest_possible_cools_by_the_least_loss_with_its_latent_heat)
{
    static const double hottest_c[] = {120.0, 90.0, 78.1, 77.9, 70.0, 68.05, 68.0};
    for (size_t n = 0; n < 2u * ROWS(hottest_c); n++) {
        const double c = hottest_c[n / 2u], current_a = n % 2u == 0 ? 0.0 : 1.0;
        power_comes_on();
        row(n);
        TEST_ASSERT_EQUAL_FLOAT(SPRING_ESTIMATOR_HOTTEST_C, INSIDE.hottest_c);
        const spring_bounds_t any = spring_estimator_austenite(&estimator, &model, 0);
        TEST_ASSERT_EQUAL_FLOAT(0.0f, any.low);
        TEST_ASSERT_EQUAL_FLOAT(1.0f, any.high);
        /* it lacks no contact: none is declared, whatever it reads */
        TEST_ASSERT_FALSE(spring_estimator_lacks_contact(&estimator, &model, 0));
        model.parameters.contact_uohm[0] = 950000; /* nor where nothing was read */
        TEST_ASSERT_FALSE(spring_estimator_lacks_contact(&estimator, &model, 0));
        model.parameters.contact_uohm[0] = 0;
        NEAR(pow(0.29 * ((double)SPRING_ESTIMATOR_HOTTEST_C - 20.0) + 5.0, 2) + 9.0,
             INSIDE.variance_k2);
        INSIDE.hottest_c = (float)c;
        give(current_a, 0.2);
        turn();
        const double capacity = CAPACITY + (c > 78.0 ? 0.0 : 8.65 / 10.0);
        const double is_c =
            c + TURN_S * (current_a * current_a * 0.2 - 0.8 * LOSS * (c - 20.0)) / capacity;
        NEAR(is_c < 68.0 ? 0.0 : is_c, INSIDE.hottest_c); /* cold: nobody has moved it yet */
        TEST_ASSERT_EQUAL(is_c < 68.0 ? M : ANY, INSIDE.possible);
        TEST_ASSERT_EQUAL(is_c < 68.0, is_noted(SPRING_SIGHT_COOLED));
        power_comes_on();
        INSIDE.hottest_c = (float)c; /* and how long that takes, by small steps */
        double s = 0.0;
        for (double now_c = c; now_c > 68.0; s += 1e-3) {
            now_c -= 1e-3 * 0.8 * LOSS * (now_c - 20.0) /
                     (CAPACITY + (now_c > 78.0 ? 0.0 : 8.65 / 10.0));
        }
        TEST_ASSERT_FLOAT_WITHIN(0.01f + 0.001f * (float)s, (float)s,
                                 spring_estimator_cooling_s(&estimator, &model, 0));
    }
    thermal_model_set_ambient(&model, 68 * 128); /* as warm as that: nothing to wait for */
    TEST_ASSERT_EQUAL_FLOAT(0.0f, spring_estimator_cooling_s(&estimator, &model, 0));
}

/* `model cold` is of the heating that comes next: as long as nothing is learnt that could tell, its
 * reading ends it all the same. Later martensite that reads like austenite is none. */
TEST(a_hint_ends_as_the_spring_is_read_though_nothing_could_tell_yet)
{
    for (unsigned strong = 0; strong < 2; strong++) {
        begin_cold();
        row(strong);
        put(30.0);
        INSIDE.possible = M;
        INSIDE.untested = true;
        INSIDE.fresh = 9;
        INSIDE.current_a = strong != 0 ? 0.8f : 0.79f;
        INSIDE.learnt.austenite_ohm = 0.0f;
        give((double)INSIDE.current_a, 0.175);
        turn();
        TEST_ASSERT_EQUAL(strong == 0, INSIDE.untested);
        TEST_ASSERT_EQUAL_UINT8(M, INSIDE.possible);
    }
}

/* Where it is told that, it is as the model has it. */
TEST(what_is_told_is_the_models_phase)
{
    static const struct {
        double c;
        uint8_t then;
    } table[] = {{20.0, M}, {93.0, B}, {110.0, A}};
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold();
        row(n);
        put(table[n].c);
        spring_estimator_trust_model(&estimator, &model);
        TEST_ASSERT_EQUAL_UINT8(table[n].then, INSIDE.possible);
        TEST_ASSERT_EQUAL(table[n].then == M, INSIDE.untested);
    }
}

/* ---- what a turn ends with ---- */

/* Colder than martensite finish by 2.6 sd it is martensite; austenite of which nothing is read may
 * have begun to go once its bound is below martensite start. */
TEST(phase_is_what_temperature_leaves)
{
    static const struct {
        uint8_t possible;
        double c, sd_k, current_a;
        uint8_t then;
    } table[] = {
        {B, 66.0, 1.0, 0.0, B},     {B, 65.0, 1.0, 0.0, M},     {A | B, 64.0, 2.0, 0.0, A | B},
        {A | B, 62.0, 2.0, 0.0, M}, {A, 80.0, 1.0, 0.0, A | B}, {A, 81.0, 1.0, 0.0, A},
        {A, 80.0, 1.0, 2.0, A},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold();
        row(n);
        put(table[n].c);
        INSIDE.last_c7 = thermal_model_temperature_c7(&model, 0);
        INSIDE.possible = table[n].possible;
        INSIDE.variance_k2 = (float)(table[n].sd_k * table[n].sd_k);
        INSIDE.loss_variance = 0.0f;
        INSIDE.lost = 0.5f;
        give(table[n].current_a, 0.2);
        turn();
        TEST_ASSERT_EQUAL_UINT8(table[n].then, INSIDE.possible);
        TEST_ASSERT_EQUAL_FLOAT(table[n].then == M ? 0.0f : 0.5f, INSIDE.lost);
    }
}

/* On its way down to a level losses may have fallen, or a load may hold it: what its own
 * resistances say is left is not cold, and it gives off less; that is no reason to doubt them. At
 * less than 0.8 A, blind, or with less left than the 21 points by which they may be off, the model
 * counts. A level that was never fully on goes by its martensite's, 31 points. */
TEST(what_still_reads_austenite_has_not_cooled)
{
    static const struct {
        uint8_t possible;
        double austenite, current_a, own_ohm;
        bool blind, kept;
    } table[] = {
        {A | B, 1.0, 1.0, 0.22, false, true},   {A | B, 0.24, 1.0, 0.22, false, true},
        {A | B, 0.18, 1.0, 0.22, false, false}, {A | B, 1.0, 0.7, 0.22, false, false},
        {A | B, 1.0, 1.0, 0.22, true, false},   {B, 0.34, 1.0, 0.0, false, true},
        {B, 0.28, 1.0, 0.0, false, false},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold();
        row(n);
        put(60.0);
        INSIDE.last_c7 = thermal_model_temperature_c7(&model, 0);
        INSIDE.possible = table[n].possible;
        INSIDE.blind = table[n].blind;
        INSIDE.variance_k2 = 1.0f;
        INSIDE.covariance = -1e-3f;
        INSIDE.loss_variance = 1e-9f;
        INSIDE.kept_w_per_k = -1e-3f;
        INSIDE.learnt.austenite_ohm = (float)table[n].own_ohm;
        INSIDE.learnt.change = 0.2f;
        INSIDE.learnt.martensite_ohm = 0.176f;
        give(table[n].current_a, table[n].own_ohm > 0.0
                                     ? 0.22 * (1.0 - 0.2 * (1.0 - table[n].austenite))
                                     : 0.176 / (1.0 - 0.2 * table[n].austenite));
        turn();
        TEST_ASSERT_EQUAL_UINT8(table[n].kept ? table[n].possible : M, INSIDE.possible);
        if (table[n].kept) {
            NEAR(68.0, put_c());
            TEST_ASSERT_TRUE(INSIDE.learnt.loss_w_per_k < 0.0f);
            TEST_ASSERT_FALSE(INSIDE.blind);
        }
    }
}

/* Loose: what it seemed to gain may have been its contact. */
TEST(spring_with_a_loose_contact_is_not_proven_and_has_no_line)
{
    begin_cold();
    put(80.0);
    INSIDE.possible = A;
    INSIDE.unsteady = 2050;
    INSIDE.run.line.ohm = 0.2f;
    INSIDE.quiet = 9;
    give(2.0, 0.2);
    turn();
    TEST_ASSERT_TRUE(INSIDE.unproven);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, INSIDE.run.line.ohm);
    TEST_ASSERT_EQUAL_UINT8(0, INSIDE.quiet);
    INSIDE.unsteady = 2048; /* it stays so until it is heated */
    turn();
    TEST_ASSERT_TRUE(INSIDE.unproven);
}

/* What was left is over in the next turn, and only that. */
TEST(heating_that_was_left_is_over_in_the_next_turn)
{
    for (unsigned n = 0; n < 3; n++) {
        begin_cold();
        row(n);
        INSIDE.heating = n != 2;
        INSIDE.onset = INSIDE.steep = INSIDE.unlike = true;
        INSIDE.run.heat.cold_ohm = 0.2f;
        if (n != 1) {
            spring_estimator_leave(&estimator, 0);
        }
        turn();
        TEST_ASSERT_EQUAL(n == 1, INSIDE.heating);
        TEST_ASSERT_EQUAL(n != 0, INSIDE.onset && INSIDE.unlike);
        TEST_ASSERT_FALSE(INSIDE.left);
    }
}

/* ---- a hold begins ---- */

/* Fully on it is taken for austenite. What has shown no onset is blind; what lacks phase (0.5 % and
 * 2.6 sd, at 0.8 A) sees, is not proven, and its austenite stays what was learnt. */
TEST(hold_begins_by_what_its_heating_showed)
{
    static const struct {
        uint8_t possible;
        bool full, heating, onset;
        double c, ohm, current_a; /* 0.25 ohm was learnt */
        uint8_t then;
        bool blind, lacks;
        double learns_ohm;
    } table[] = {
        {B, true, true, true, 95, 0.25, 2, A, false, false, 0.25},
        {B, true, true, true, 95, 0.252, 2, A, false, false, 0.252},
        {B, true, true, true, 95, 0.252, 0.8, A, false, false, 0.25},
        {B, true, true, false, 95, 0.252, 2, A, false, false, 0.25},
        {B, true, false, true, 95, 0.252, 2, A, false, false, 0.25},
        {A, true, true, true, 95, 0.252, 2, A, false, false, 0.252},
        {M, true, true, false, 95, 0.25, 2, A, true, false, 0.25},
        {B, true, true, true, 95, 0.24, 2, A, false, true, 0.25},
        {B, true, true, true, 95, 0.24, 0.79, A, false, false, 0.25},
        {B, true, true, true, 104, 0.24, 2, A, false, true, 0.25},
        {A, true, true, true, 95, 0.24, 2, A, false, false, 0.24},
        {A, false, false, false, 95, 0.24, 2, A | B, false, false, 0.25},
        {B, false, true, true, 95, 0.24, 2, B, false, false, 0.25},
        {M, false, true, false, 95, 0.24, 2, M, false, false, 0.25},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold();
        row(n);
        put(table[n].c);
        INSIDE.possible = table[n].possible;
        INSIDE.heating = table[n].heating;
        INSIDE.run.heat = (spring_heat_t){.onset_ohm = 0.2f};
        INSIDE.onset = table[n].onset;
        INSIDE.variance_k2 = 4.0f;
        INSIDE.reads = true;
        INSIDE.fresh = 20;
        INSIDE.ohm = INSIDE.phase_ohm = (float)table[n].ohm;
        INSIDE.slow_ohm = 0.3f;
        INSIDE.current_a = (float)table[n].current_a;
        INSIDE.learnt.austenite_ohm = 0.25f;
        INSIDE.learnt.change = 0.2f;
        INSIDE.quiet = INSIDE.losing = 9;
        INSIDE.lost = 0.7f;
        INSIDE.kept_w_per_k = 1e-3f;
        INSIDE.left = INSIDE.unproven = true;
        spring_estimator_begin_hold(&estimator, &model, 0, table[n].full);
        TEST_ASSERT_EQUAL_UINT8(table[n].then, INSIDE.possible);
        TEST_ASSERT_EQUAL(table[n].blind, INSIDE.blind);
        NEAR(table[n].learns_ohm, INSIDE.learnt.austenite_ohm);
        TEST_ASSERT_EQUAL_FLOAT(0.0f, INSIDE.lost);
        TEST_ASSERT_FALSE(INSIDE.heating || INSIDE.left);
        /* it ended neither at its finish, 98 degC, nor with its phase in sight; or lacks some */
        TEST_ASSERT_EQUAL(table[n].lacks || (table[n].full && table[n].heating &&
                                             table[n].possible != A && table[n].c < 98.0),
                          INSIDE.unproven);
        TEST_ASSERT_FALSE(INSIDE.quiet || INSIDE.losing);
        TEST_ASSERT_EQUAL_FLOAT(0.0f, INSIDE.kept_w_per_k);
        /* at a strong current the line of what is austenite begins where it was read last */
        const bool strong = (table[n].full || table[n].possible == A) && table[n].current_a > 0.8;
        NEAR(strong ? table[n].ohm : 0.0, INSIDE.run.line.ohm);
        NEAR(strong ? 0.002 * 0.002 * 1e6 : 0.0, 1e6f * INSIDE.run.line.variance);
        NEAR(0.0006, INSIDE.run.line.rise_per_k);
        NEAR(hypot(0.0009 / 2.6, 0.00015), INSIDE.run.line.rise_sd_per_k);
        TEST_ASSERT_EQUAL(table[n].full && table[n].possible != A,
                          thermal_model_austenite(&model, 0) == THERMAL_MODEL_AUSTENITE_FULL);
        const spring_sight_t *const sight = spring_sights_newest(sights_inside(&estimator), 0);
        const bool unseen = table[n].full && table[n].heating && table[n].possible != A;
        TEST_ASSERT_EQUAL(unseen, sight->kind == SPRING_SIGHT_UNSEEN);
        TEST_ASSERT_EQUAL_UINT8(SPRING_DID_HOLD | (table[n].blind ? SPRING_DID_BLIND : 0),
                                sight->did & ~SPRING_DID_HEAT);
    }
}

/* A sight's numbers are rounded to the nearest; what there is at all is no less than 1, and ends at
 * what a byte holds. */
TEST(sight_is_noted_in_tenths_and_hundredths)
{
    static const struct {
        double read, sd;
        int16_t read_then;
        uint8_t sd_then;
    } table[] = {{0.6e-4, 0.0, 1, 0},      {1.4e-4, 0.0, 1, 0},      {1.6e-4, 0.2e-4, 2, 1},
                 {-1.4e-4, 1.4e-4, -1, 1}, {-1.6e-4, 1.6e-4, -2, 2}, {9.0, 254.4e-4, 32767, 254},
                 {-9.0, 9.0, -32767, 255}};
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold();
        row(n);
        spring_note_read(&estimator, 0, (float)table[n].read, (float)table[n].sd);
        const spring_sight_t *const sight = spring_sights_newest(sights_inside(&estimator), 0);
        TEST_ASSERT_EQUAL_INT16(table[n].read_then, sight->read);
        TEST_ASSERT_EQUAL_UINT8(table[n].sd_then, sight->read_sd);
    }
    put(80.0);
    INSIDE.variance_k2 = 4.0f;
    INSIDE.shift_k = 1.26f;
    INSIDE.learnt.loss_w_per_k = (float)(0.0127 * LOSS);
    const spring_before_t before = {
        .distance_c7 = -147, .sd_k = 3.26f, .shift_k = 1.0f, .loss_w_per_k = (float)(0.01 * LOSS)};
    spring_note(&estimator, &model, 0, SPRING_SIGHT_LOST, &before, 75.04f, 1.26f);
    const spring_sight_t *const sight = spring_sights_newest(sights_inside(&estimator), 0);
    TEST_ASSERT_EQUAL_INT16(-11, sight->believed); /* -1.148 K */
    TEST_ASSERT_EQUAL_UINT8(33, sight->believed_sd);
    TEST_ASSERT_EQUAL_INT16(-30, sight->seen);
    TEST_ASSERT_EQUAL_UINT8(13, sight->seen_sd);
    TEST_ASSERT_EQUAL_INT16(20, sight->now);
    TEST_ASSERT_EQUAL_UINT8(20, sight->now_sd);
    TEST_ASSERT_EQUAL_INT16(3, sight->shift);
    TEST_ASSERT_EQUAL_INT16(27, sight->loss);
    TEST_ASSERT_EQUAL_UINT8(0, sight->did);
    spring_note_did(&estimator, 0, SPRING_DID_OPEN);
    spring_note_did(&estimator, 0, SPRING_DID_HOLD);
    TEST_ASSERT_EQUAL_UINT8(SPRING_DID_OPEN | SPRING_DID_HOLD, sight->did);
}

/* It goes on as the last one, whatever another spring had meanwhile, with the next number. */
TEST(sight_that_goes_on_is_the_newest_again)
{
    spring_sights_t sights = {.numbers = 7};
    spring_sight_t *const first = spring_sights_add(&sights, 0);
    first->believed = 33;
    (void)spring_sights_add(&sights, 1);
    spring_sights_turn(&sights);
    spring_sights_renew(&sights, first);
    const spring_sight_t *const renewed = spring_sights_from(&sights, SPRING_SIGHTS_ANY, 9);
    TEST_ASSERT_EQUAL_PTR(first, renewed);
    TEST_ASSERT_EQUAL_PTR(first, spring_sights_newest(&sights, 0));
    TEST_ASSERT_EQUAL_UINT8(2, sights.count);
    TEST_ASSERT_EQUAL_UINT8(0, renewed->spring);
    TEST_ASSERT_EQUAL_INT16(33, renewed->believed);
    TEST_ASSERT_EQUAL_UINT32(9, renewed->number);
    TEST_ASSERT_EQUAL_UINT16(0, spring_sights_age_turns(&sights, renewed));
    const spring_sight_t *const other = spring_sights_from(&sights, SPRING_SIGHTS_ANY, 7);
    TEST_ASSERT_EQUAL_UINT8(1, other->spring);
    TEST_ASSERT_EQUAL_UINT16(1, spring_sights_age_turns(&sights, other));
}

/* Read, proven and not blind: how far from its transformation it is need not be known. */
TEST(where_it_is_is_known_where_all_is)
{
    static const struct {
        bool reads, unproven, blind;
        uint16_t unsteady;
        float variance_k2;
        bool known;
    } table[] = {{true, false, false, 2048, 9.0f, true}, {true, false, false, 0, 400.0f, true},
                 {false, false, false, 0, 9.0f, false},  {true, true, false, 0, 9.0f, false},
                 {true, false, true, 0, 9.0f, false},    {true, false, false, 2049, 9.0f, false}};
    for (size_t n = 0; n < ROWS(table); n++) {
        row(n);
        INSIDE.reads = table[n].reads;
        INSIDE.unproven = table[n].unproven;
        INSIDE.blind = table[n].blind;
        INSIDE.unsteady = table[n].unsteady;
        INSIDE.variance_k2 = table[n].variance_k2;
        TEST_ASSERT_EQUAL(table[n].known, spring_estimator_knows(&INSIDE));
    }
}

/* Nothing of its own is known, but what is declared; or its loss alone. */
TEST(what_is_forgotten_is_as_declared)
{
    for (int all = 0; all < 2; all++) {
        begin_cold();
        INSIDE.learnt = (spring_learnt_t){
            .austenite_ohm = 0.25f, .change = 0.1f, .loss_w_per_k = 1e-3f, .slow_noise = 0.002f};
        INSIDE.covariance = 1e-3f;
        INSIDE.loss_variance = 1e-8f;
        INSIDE.gone_w_per_k = INSIDE.kept_w_per_k = 1e-4f;
        spring_seal(&estimator, 0);
        if (all != 0) {
            spring_estimator_forget(&estimator, 0);
        } else {
            spring_estimator_forget_loss(&estimator, 0);
        }
        NEAR(all ? 0.0 : 0.25, INSIDE.learnt.austenite_ohm);
        NEAR(all ? 1.0 - 0.175 / 0.219 : 0.1, INSIDE.learnt.change);
        NEAR(all ? 0.0007 : 0.002, INSIDE.learnt.slow_noise);
        NEAR(0.12 * LOSS, INSIDE.learnt.loss_sd_w_per_k);
        NEAR(1e6 * 0.12 * LOSS * 0.12 * LOSS, 1e6f * INSIDE.loss_variance);
        TEST_ASSERT_TRUE(INSIDE.learnt.loss_w_per_k == 0.0f && INSIDE.covariance == 0.0f &&
                         INSIDE.gone_w_per_k == 0.0f && INSIDE.kept_w_per_k == 0.0f);
        TEST_ASSERT_TRUE(spring_is_sound(&estimator, 0));
    }
}

/* Ten turns in twelve and a half ticks, none in each fifth; of twelve springs two are in one turn.
 * With each round the next one's stiffness is looked at. */
TEST(each_spring_has_a_turn_in_a_quarter_of_a_second)
{
    static const uint8_t turn_of_tick[] = {
        0, 1, 2, 3, SPRING_ESTIMATOR_NO_TURN, 4, 5, 6, 7, SPRING_ESTIMATOR_NO_TURN, 8, 9, 0};
    int16_t ma[12], mv[12];
    bool valid[12];
    thermal_model_parameters_t p = model.parameters;
    p.rows = 3;
    p.columns = 4;
    TEST_ASSERT_EQUAL(THERMAL_MODEL_OK, thermal_model_init(&model, &p, NULL));
    spring_estimator_init(&estimator, &model);
    for (uint8_t k = 0; k < 12; k++) {
        ma[k] = 1000;
        mv[k] = 200;
        valid[k] = k != 5;
        belief_inside(&estimator, k)->unsteady = 100;
        belief_inside(&estimator, k)->declared_stiffness_w_per_k = 0.0f;
        spring_seal(&estimator, k);
    }
    for (size_t tick = 0; tick < ROWS(turn_of_tick); tick++) {
        row(tick);
        spring_estimator_tick(&estimator, &model, ma, mv, tick < 4 ? valid : NULL);
        TEST_ASSERT_EQUAL_UINT8(turn_of_tick[tick], spring_estimator_turn(&estimator));
        for (uint8_t k = 0; k < 12; k++) {
            const spring_belief_t *const b = belief_inside(&estimator, k);
            const unsigned turns = 100u - b->unsteady;
            unsigned had = 0;
            for (size_t before = 0; before <= tick; before++) {
                had += turn_of_tick[before] == k % 10u;
            }
            TEST_ASSERT_EQUAL_UINT(had, turns);
            TEST_ASSERT_EQUAL(tick >= 11 && k == 1, b->declared_stiffness_w_per_k > 0.0f);
            if (tick == 3 && k >= 4) {
                TEST_ASSERT_EQUAL_UINT8(k == 5 ? 0 : k < 10 ? 4 : k == 10 ? 3 : 2, b->readings);
            }
        }
    }
    for (unsigned n = 0; n < 25u * 12u; n++) { /* all of them, and the first one again */
        spring_estimator_tick(&estimator, &model, ma, mv, NULL);
    }
    for (uint8_t k = 0; k < 12; k++) {
        TEST_ASSERT_TRUE(belief_inside(&estimator, k)->declared_stiffness_w_per_k > 0.005f);
    }
}

/* What holds it: what it gave off in its last turn, and what a kelvin more gives off; the current
 * of that in what it reads now, or in declared martensite. */
TEST(power_and_current_of_a_hold_are_of_what_it_gives_off)
{
    INSIDE.gives_w = 0.5f;
    INSIDE.declared_stiffness_w_per_k = 0.006f;
    INSIDE.learnt.loss_w_per_k = -0.001f;
    INSIDE.slow_ohm = 0.2f;
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.55f, spring_estimator_hold_w(&estimator, 0, 10.0f));
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.15f, spring_estimator_follow_w(&estimator, 2.0f, 4.0f));
    TEST_ASSERT_UINT16_WITHIN(1, 1000u * sqrt(0.5 / 0.175),
                              spring_estimator_current_ma(&estimator, 0, 0.5f));
    INSIDE.fresh = 1;
    TEST_ASSERT_UINT16_WITHIN(1, 1000u * sqrt(0.5 / 0.2),
                              spring_estimator_current_ma(&estimator, 0, 0.5f));
    TEST_ASSERT_EQUAL_UINT16(3200, spring_estimator_current_ma(&estimator, 0, 3.0f));
    TEST_ASSERT_EQUAL_UINT16(0, spring_estimator_current_ma(&estimator, 0, 0.0f));
    TEST_ASSERT_EQUAL_UINT16(0, spring_estimator_current_ma(&estimator, 0, -1.0f));
    INSIDE.extra_loss_uw = 200000;
    TEST_ASSERT_EQUAL_UINT32(300000, spring_estimator_model_power_uw(&estimator, 0, 500000));
    TEST_ASSERT_EQUAL_UINT32(0, spring_estimator_model_power_uw(&estimator, 0, 100000));
    INSIDE.extra_loss_uw = -200000;
    TEST_ASSERT_EQUAL_UINT32(300000, spring_estimator_model_power_uw(&estimator, 0, 100000));
}

/* 2.6 standard deviations either way: of the distance, and of what hides where a spring is beside
 * it; upwards in a hold, as far as a loss that is a fifth less lets it rise as well. */
TEST(bounds_are_what_is_known_of_distance_place_and_room)
{
    static const struct {
        double c, var_k2, capacity_k, shift_k, disturbance_k, gone_k;
        uint8_t possible;
        double more_k2; /* beside the distance's; below 0: nothing is known */
    } table[] = {
        {80.0, 4.0, 1.0, 0.0, 0.0, 0.0, SPRING_PHASE_AUSTENITE, 9.0},
        {80.0, 4.0, 1.0, 3.0, 2.0, 0.0, SPRING_PHASE_AUSTENITE, 9.0},
        {80.0, 4.0, -1.0, -3.0, 0.0, 7.0, SPRING_PHASE_AUSTENITE, 9.0},
        {80.0, 4.0, 1.0, -3.0, 2.0, -7.0, SPRING_PHASE_AUSTENITE, 9.0},
        {60.0, 4.0, 0.0, 4.0, 1.0, 0.0, SPRING_PHASE_MARTENSITE, 25.0 + 0.0625 * 44.0 * 44.0},
        {20.0, 0.5, 0.0, 0.0, 0.0, 0.0, SPRING_PHASE_MARTENSITE, 25.0},
        {60.0, 4.0, 1.0, 2.0, 3.0, 1.0, ANY, -1.0},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold();
        row(n);
        put(table[n].c);
        INSIDE.variance_k2 = (float)table[n].var_k2;
        INSIDE.capacity_k = (float)table[n].capacity_k;
        INSIDE.shift_k = (float)table[n].shift_k;
        INSIDE.disturbance_k = (float)table[n].disturbance_k;
        INSIDE.gone_k = (float)table[n].gone_k;
        INSIDE.shift_variance_k2 = 2.0f;
        INSIDE.possible = table[n].possible;
        INSIDE.hottest_c = 97.0f;
        const double distance_k2 = table[n].var_k2 + pow(table[n].capacity_k, 2);
        const double c = in_128ths(table[n].c) + table[n].shift_k;
        const double told_k2 = distance_k2 + table[n].more_k2, lately_k = table[n].disturbance_k;
        const double warmer_k = table[n].possible == SPRING_PHASE_AUSTENITE
                                    ? 0.2 * (in_128ths(table[n].c) - 20.0)
                                    : 0.0;
        const double high_c = c + sqrt(6.76 * told_k2 + warmer_k * warmer_k) + lately_k;
        const bool any = table[n].possible == ANY;
        const spring_bounds_t is = spring_estimator_temperature_c(&estimator, &model, 0);
        NEAR(c, is.value);
        NEAR(any ? 20.0 - 2.6 * 5.0 : c - 2.6 * sqrt(told_k2) - lately_k, is.low);
        NEAR(any ? 97.0 : high_c + fmax(table[n].gone_k, 0.0), is.high);
        const double place_k2 = table[n].possible == M ? 2.0 : 0.0;
        const double away_k = 2.6 * sqrt(distance_k2 + place_k2) + lately_k;
        const spring_bounds_t distance = spring_estimator_distance_k(&estimator, &model, 0);
        NEAR(in_128ths(table[n].c) - 78.0 - away_k, distance.low);
        NEAR(in_128ths(table[n].c) - 78.0 + away_k, distance.high);
    }
}

/* As far as it was found by its turns; or where the loss, as unsure as it is, would leave it in the
 * end. */
TEST(hold_is_as_unsure_as_where_its_loss_leads)
{
    static const struct {
        double c, var_k2, loss_sd, more_loss;
    } table[] = {{80.0, 4.0, 7e-4, 0.0},    {80.0, 100.0, 7e-4, 0.0}, {80.0, 4.0, 7e-4, 2e-3},
                 {80.0, 4.0, 1.4e-3, 2e-3}, {50.0, 4.0, 7e-4, 0.0},   {80.0, 4.0, 7e-4, -0.006}};
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold();
        row(n);
        put(table[n].c);
        INSIDE.variance_k2 = (float)table[n].var_k2;
        INSIDE.loss_variance = (float)pow(table[n].loss_sd, 2);
        INSIDE.declared_stiffness_w_per_k = 0.006f;
        INSIDE.learnt.loss_w_per_k = (float)table[n].more_loss;
        const double stiffness = (double)spring_stiffness_w_per_k(BELIEF);
        const double above_k = in_128ths(table[n].c) - 20.0;
        const double settles_k2 =
            pow(above_k * table[n].loss_sd, 2) / (stiffness * stiffness + 1e-12);
        NEAR(sqrt(fmax(table[n].var_k2, settles_k2)),
             spring_estimator_hold_sd_k(&estimator, &model, 0));
    }
}
