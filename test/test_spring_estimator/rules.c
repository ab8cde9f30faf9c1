#include "rules.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>

#include "../run_tests.h"
#include "one_spring.h"
#include "spring_estimator_internal.h"

#define SPRINGS 3

void give_readings(int readings, double current_a, double ohm)
{
    double sum_mv = 0.0;
    int given_mv = 0;
    for (int n = 0; n < readings; n++) {
        sum_mv += 1e3 * current_a * ohm;
        const int mv = (int)lround(sum_mv) - given_mv;
        given_mv += mv;
        spring_estimator_take(&estimator, 0, (int16_t)lround(1e3 * current_a), (int16_t)mv);
    }
}

/* Several springs, all known to be cold. */
static void begin_three(void)
{
    thermal_model_parameters_t p;
    thermal_model_parameters_default(&p);
    p.rows = 1;
    p.columns = SPRINGS;
    (void)thermal_model_init(&model, &p, NULL);
    spring_estimator_init(&estimator, &model);
    TEST_ASSERT_EQUAL_UINT8(SPRING_PHASE_ANY, estimator.spring[SPRINGS - 1].possible);
    thermal_model_reset(&model, 20 * 128);
    spring_estimator_trust_model(&estimator, &model);
    TEST_ASSERT_EQUAL_UINT8(M, estimator.spring[SPRINGS - 1].possible);
}

/* ---- what is read against what it read when it had transformed last ---- */

/* A heated spring that read 0.2 ohm then, a fifth more than its martensite. */
static void begin_heated(float temperature_c, float change, float ohm)
{
    begin_cold();
    thermal_model_set_temperature(&model, 0, (int16_t)(temperature_c * 128.0f));
    INSIDE.learnt.austenite_ohm = 0.2f;
    INSIDE.learnt.change = change;
    INSIDE.fresh = 9;
    INSIDE.reads = true;
    INSIDE.heating = true;
    INSIDE.possible = SPRING_PHASE_BETWEEN;
    INSIDE.noise = 0.001f;
    INSIDE.current_a = 3.0f;
    INSIDE.ohm = INSIDE.ohm_before[0] = INSIDE.ohm_before[1] = ohm;
}

TEST(phase_is_missing_beyond_what_steps_noise_and_coefficient_explain)
{
    static const struct {
        float temperature_c, change, less;
        bool lacks;
    } table[] = {
        {98.0f, 0.2f, 0.0075f, false},   {98.0f, 0.2f, 0.0077f, true},
        {90.0f, 0.2f, 0.0195f, false},   {90.0f, 0.2f, 0.0197f, true},
        {106.0f, 0.2f, 0.0077f, true},   {98.0f, 0.2f, -0.1f, false},
        {106.0f, 0.2f, 0.0075f, false},  {106.0f, -0.2f, -0.0195f, false},
        {106.0f, -0.2f, -0.0197f, true}, {90.0f, -0.2f, -0.0077f, true},
        {98.0f, -0.2f, -0.0077f, true},  {98.0f, -0.2f, -0.0075f, false},
        {98.0f, -0.2f, 0.1f, false},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        row(n);
        begin_heated(table[n].temperature_c, table[n].change, 0.2f * (1.0f - table[n].less));
        TEST_ASSERT_EQUAL(table[n].lacks, spring_estimator_lacks_phase(&INSIDE, &model, 0));
        INSIDE.fresh = 0;
        TEST_ASSERT_FALSE(spring_estimator_lacks_phase(&INSIDE, &model, 0));
        INSIDE.fresh = 20;
        INSIDE.blind = true;
        TEST_ASSERT_FALSE(spring_estimator_lacks_phase(&INSIDE, &model, 0));
        INSIDE.blind = false;
        INSIDE.current_a = 0.79f; /* too weak to tell */
        TEST_ASSERT_FALSE(spring_estimator_lacks_phase(&INSIDE, &model, 0));
        INSIDE.current_a = 0.8f;
        TEST_ASSERT_EQUAL(table[n].lacks, spring_estimator_lacks_phase(&INSIDE, &model, 0));
    }
}

/* From austenite start on, but for 2 % of the phase, and the noise of the mean of two turns, which
 * is no more: 0.66 mohm. */
TEST(heating_is_over_where_its_austenite_is_read_twice)
{
    static const struct {
        float temperature_c, change, ohm, before_ohm;
        bool over;
    } table[] = {
        {89.0f, 0.2f, 0.201f, 0.2f, true},
        {89.0f, 0.2f, 0.1988f, 0.2f, true},
        {89.0f, 0.2f, 0.1986f, 0.2f, false},
        {89.0f, -0.2f, 0.2012f, 0.2f, true},
        {89.0f, -0.2f, 0.2014f, 0.2f, false},
        {87.0f, 0.2f, 0.201f, 0.2f, false},
        {89.0f, 0.2f, 0.201f, 0.0f, false},
        {89.0f, 0.2f, 0.201f, 0.196f, false},
        {89.0f, -0.2f, 0.203f, 0.198f, true},
        {89.0f, -0.2f, 0.197f, 0.196f, true},
        {89.0f, -0.2f, 0.197f, 0.0f, false},
        {88.0f, 0.2f, 0.201f, 0.2f, true},
        {89.0f, 0.2f, 0.2015f, 0.2015f, true},
        {89.0f, 0.2f, 0.2017f, 0.2017f, false}, /* beyond it */
        {89.0f, -0.2f, 0.196f, 0.196f, true},
        {89.0f, -0.2f, 0.1956f, 0.1956f, false},
        {108.0f, 0.2f, 0.2045f, 0.2045f, true},
        {93.0f, 0.2f, 0.2017f, 0.2017f, false},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        row(n);
        begin_heated(table[n].temperature_c, table[n].change, table[n].ohm);
        INSIDE.ohm_before[1] = table[n].before_ohm;
        TEST_ASSERT_EQUAL(table[n].over, spring_estimator_has_transformed(&estimator, &model, 0));
        INSIDE.current_a = 0.79f; /* too weak to tell */
        TEST_ASSERT_EQUAL(table[n].temperature_c > 98.0f,
                          spring_estimator_has_transformed(&estimator, &model, 0));
        INSIDE.current_a = 3.0f;
        INSIDE.blind = true;
        TEST_ASSERT_EQUAL(table[n].temperature_c > 98.0f, /* hot enough by the model */
                          spring_estimator_has_transformed(&estimator, &model, 0));
        INSIDE.blind = false;
        INSIDE.changes = true; /* what still transforms reads its austenite on its way past it */
        TEST_ASSERT_EQUAL(table[n].temperature_c > 98.0f,
                          spring_estimator_has_transformed(&estimator, &model, 0));
    }
    /* by the mean of a step, if it has eight turns: its noise is less, 0.354 */
    for (uint8_t turns = 7; turns <= 9; turns++) {
        begin_heated(89.0f, 0.2f, 0.19f);
        INSIDE.run.heat.turns = turns;
        INSIDE.run.heat.sum_ohm = 0.1994f * (float)turns;
        TEST_ASSERT_EQUAL(turns > 7, spring_estimator_has_transformed(&estimator, &model, 0));
        INSIDE.run.heat.sum_ohm = 0.1992f * (float)turns;
        TEST_ASSERT_FALSE(spring_estimator_has_transformed(&estimator, &model, 0));
        INSIDE.run.heat.sum_ohm = 0.1994f * (float)turns;
        INSIDE.heating = false;
        TEST_ASSERT_FALSE(spring_estimator_has_transformed(&estimator, &model, 0));
    }
    INSIDE.changes = false;
    spring_estimator_begin_heating(&estimator, &model, 0);
    TEST_ASSERT_TRUE(INSIDE.changes); /* nothing is known of that yet */
}

/* What a heating took for a contact's jump may have been phase: at what its austenite read before,
 * too, none is missing. Another heating begins with what is learnt by then. */
TEST(jump_of_a_heating_leaves_what_its_austenite_read_before)
{
    static const struct {
        float change, by, ohm;
        bool lacks, over;
    } table[] = {
        {0.2f, 1.1f, 0.1994f, false, true}, {0.2f, 1.1f, 0.1993f, false, false},
        {0.2f, 1.1f, 0.198f, true, false},  {0.2f, 1.1f, 0.207f, false, false},
        {0.2f, 1.1f, 0.212f, true, false},  {0.2f, 1.1f, 0.2203f, false, true},
        {0.2f, 0.9f, 0.2003f, false, true}, {0.2f, 0.9f, 0.178f, true, false},
        {0.2f, 0.9f, 0.1803f, false, true}, {-0.2f, 1.1f, 0.1985f, false, true},
        {-0.2f, 1.1f, 0.208f, true, false}, {-0.2f, 1.1f, 0.2185f, false, true},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        row(n);
        begin_heated(89.0f, table[n].change, table[n].ohm);
        spring_estimator_begin_heating(&estimator, &model, 0);
        spring_jump(&INSIDE, table[n].by);
        INSIDE.ohm_before[0] = INSIDE.ohm_before[1] = table[n].ohm;
        INSIDE.changes = false;
        /* where it may be colder than its finish, a coefficient explains some of what is less */
        thermal_model_set_temperature(&model, 0, 97 * 128);
        TEST_ASSERT_EQUAL(table[n].lacks, spring_estimator_lacks_phase(&INSIDE, &model, 0));
        TEST_ASSERT_EQUAL(table[n].over, spring_estimator_has_transformed(&estimator, &model, 0));
        spring_estimator_begin_heating(&estimator, &model, 0);
        TEST_ASSERT_FLOAT_WITHIN(1e-5f, 0.2f * table[n].by, INSIDE.run.heat.was_ohm);
    }
}

/* As it begins it has its phase for certain, or does not, at a level or lowered to one. */
TEST(heating_begins_fully_on_or_not)
{
    static const struct {
        uint8_t possible, then;
        bool from_full;
    } table[] = {{SPRING_PHASE_AUSTENITE, SPRING_PHASE_BETWEEN | SPRING_PHASE_AUSTENITE, true},
                 {SPRING_PHASE_BETWEEN | SPRING_PHASE_AUSTENITE,
                  SPRING_PHASE_BETWEEN | SPRING_PHASE_AUSTENITE, false},
                 {SPRING_PHASE_BETWEEN, SPRING_PHASE_BETWEEN, false},
                 {SPRING_PHASE_MARTENSITE, SPRING_PHASE_MARTENSITE, false}};
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold();
        row(n);
        INSIDE.possible = table[n].possible;
        INSIDE.from_full = !table[n].from_full;
        spring_estimator_begin_heating(&estimator, &model, 0);
        TEST_ASSERT_EQUAL_UINT8(table[n].then, INSIDE.possible);
        TEST_ASSERT_EQUAL(table[n].from_full, INSIDE.from_full);
    }
}

/* ---- what all springs share ---- */

/* One alloy in ten has one. Without it three sights of four lose phase straight away; three to the
 * contrary turn it, however many were before. */
TEST(intermediate_phase_is_believed_by_what_was_seen)
{
    static const struct {
        unsigned straight, other_way, straight_then;
        bool is_phase;
    } table[] = {{0, 0, 0, false},  {0, 1, 0, true},    {1, 1, 0, false},
                 {1, 2, 0, true},   {100, 2, 0, false}, {100, 3, 0, true},
                 {0, 100, 4, true}, {0, 100, 5, false}, {0, 2, 2, true}};
    for (size_t n = 0; n < ROWS(table); n++) {
        spring_begin_alloy(&estimator);
        for (unsigned m = 0; m < table[n].straight; m++) {
            spring_alloy_sees(&estimator, false);
        }
        for (unsigned m = 0; m < table[n].other_way; m++) {
            spring_alloy_sees(&estimator, true);
        }
        for (unsigned m = 0; m < table[n].straight_then; m++) {
            spring_alloy_sees(&estimator, false);
        }
        TEST_ASSERT_EQUAL(table[n].is_phase, spring_alloy_has_r_phase(&estimator));
    }
}

TEST(losses_are_those_that_held_springs_have_in_common)
{
    static const struct {
        float more[SPRINGS], sd[SPRINGS]; /* of the declared loss */
        bool held[SPRINGS];
        bool known;
        float factor, factor_sd;
    } table[] = {
        {{0.2f, 0.3f, 0.9f}, {0.1f, 0.1f, 0.1f}, {true, true, false}, true, 1.25f, 0.1f},
        {{0.2f, 0.3f, 0.0f}, {0.1f, 0.2f, 0.1f}, {true, true, false}, true, 1.22f, 0.12649f},
        {{0.2f, 0.395f, 0.0f}, {0.1f, 0.1f, 0.1f}, {true, true, false}, true, 1.2975f, 0.1f},
        {{-0.3f, 0.3f, 0.0f}, {0.01f, 0.01f, 0.01f}, {true, true, true}, true, 1.0f, 0.17321f},
        {{0.2f, 0.2f, 0.2f}, {0.1f, 0.1f, 0.1f}, {false, false, true}, false, 0.0f, 0.0f},
        {{0.2f, 0.2f, 0.2f}, {0.1f, 0.0f, 0.1f}, {true, true, false}, false, 0.0f, 0.0f},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_three();
        for (uint8_t k = 0; k < SPRINGS; k++) {
            spring_belief_t *const b = &estimator.spring[k];
            const float sd = table[n].sd[k] * estimator.loss_w_per_k;
            b->possible = table[n].held[k] ? SPRING_PHASE_AUSTENITE : SPRING_PHASE_BETWEEN;
            b->fresh = 1;
            b->learnt.loss_w_per_k = table[n].more[k] * estimator.loss_w_per_k;
            b->loss_variance = sd * sd;
        }
        float factor = 0.0f, sd = 0.0f;
        row(n);
        TEST_ASSERT_EQUAL(table[n].known, spring_estimator_losses(&estimator, &factor, &sd));
        TEST_ASSERT_FLOAT_WITHIN(1e-4f, table[n].factor, factor);
        TEST_ASSERT_FLOAT_WITHIN(1e-4f, table[n].factor_sd, sd);
        if (n < 2) { /* of what is not read, or heated, nothing is seen */
            estimator.spring[n].fresh = n == 0 ? 0 : 1;
            estimator.spring[n].heating = n == 1;
            TEST_ASSERT_FALSE(spring_estimator_losses(&estimator, &factor, &sd));
        }
    }
}

/* Colder than two standard deviations of what is known, two springs within a minute: both losses
 * are opened by a fifth of the declared one. */
TEST(two_springs_that_are_found_colder_are_a_step)
{
    static const struct {
        float error_k; /* of the second, known to 3 and seen to 4 K */
        uint8_t second;
        unsigned turns_between;
        bool opens;
    } table[] = {{-10.0f, 1, 0, true},  {-9.9f, 1, 0, false},   {10.1f, 1, 0, false},
                 {-10.1f, 0, 0, false}, {-10.1f, 1, 719, true}, {-10.1f, 1, 720, false}};
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_three();
        row(n);
        for (uint8_t k = 0; k < 2; k++) {
            estimator.spring[k].variance_k2 = 9.0f;
            estimator.spring[k].capacity_k = 0.0f;
            estimator.spring[k].loss_variance = 0.0f;
            spring_seal(&estimator, k);
        }
        TEST_ASSERT_FALSE(spring_open_to_step(&estimator, &estimator.spring[0], 0, -10.1f, 4.0f));
        estimator.stepped_turns = (uint16_t)(estimator.stepped_turns - table[n].turns_between);
        const uint8_t k = table[n].second;
        spring_belief_t *const b = &estimator.spring[k];
        TEST_ASSERT_EQUAL(table[n].opens,
                          spring_open_to_step(&estimator, b, k, table[n].error_k, 4.0f));
        const float sd = 0.2f * estimator.loss_w_per_k;
        const float variance = table[n].opens ? sd * sd : 0.0f;
        TEST_ASSERT_FLOAT_WITHIN(1e-9f, variance, estimator.spring[0].loss_variance);
        TEST_ASSERT_FLOAT_WITHIN(1e-9f, variance, estimator.spring[1].loss_variance);
        TEST_ASSERT_FLOAT_WITHIN(1e-6f, table[n].opens ? 0.8f * table[n].error_k * sd : 0.0f,
                                 b->covariance);
        TEST_ASSERT_FLOAT_WITHIN(
            1e-3f, 9.0f + (table[n].opens ? table[n].error_k * table[n].error_k : 0.0f),
            b->variance_k2);
        TEST_ASSERT_EQUAL_UINT8(table[n].error_k <= -10.0f ? k : 0, estimator.stepped_spring);
        TEST_ASSERT_TRUE(spring_is_sound(&estimator, 0) || k == 0);
    }
}

/* What it gives off less by keeping its phase, 4 sd of it, is its own but for what the others that
 * are held and read do, on average: a draught ends for all. */
TEST(what_all_springs_keep_is_the_surroundings)
{
    static const struct {
        float kept, others[2]; /* standard deviations of its loss */
        bool heating, blind, between;
        bool alone;
    } table[] = {
        {-4.0f, {0.0f, 0.0f}, false, false, false, true},
        {-2.5f, {0.0f, 0.0f}, false, false, false, false},
        {-4.0f, {-2.0f, -1.0f}, false, false, false, false},
        {-4.0f, {-2.0f, -0.7f}, false, false, false, true},
        {-4.0f, {-2.0f, -18.0f}, false, false, false, false}, /* less than they */
        {-2.5f, {1.0f, 1.0f}, false, false, false, false},    /* within what is likely */
        {-4.0f, {1.0f, -8.0f}, true, false, false, true},     /* the second is not held, */
        {-4.0f, {1.0f, -8.0f}, false, true, false, true},     /* reads nothing, */
        {-4.0f, {1.0f, -8.0f}, false, false, true, true},     /* or may have lost its phase */
        {-4.0f, {-2.0f, -8.0f}, true, false, false, false},
        {4.0f, {-2.0f, -2.0f}, false, false, false, true},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_three();
        row(n);
        for (uint8_t k = 0; k < SPRINGS; k++) {
            spring_belief_t *const b = &estimator.spring[k];
            b->possible = SPRING_PHASE_AUSTENITE;
            b->reads = true;
            b->fresh = 9;
            b->loss_variance = 1e-8f;
            b->kept_w_per_k = 1e-4f * (k == 0 ? table[n].kept : table[n].others[k - 1]);
        }
        estimator.spring[2].heating = table[n].heating;
        estimator.spring[2].blind = table[n].blind;
        estimator.spring[2].possible |= table[n].between ? SPRING_PHASE_BETWEEN : 0;
        TEST_ASSERT_EQUAL(table[n].alone, spring_keeps_alone(&estimator, &estimator.spring[0], 0));
    }
}

/* A spring is found at 88 degC where 98 were believed: any other in its first heating is taken to
 * be off by half as much, as it is as far above the room. */
TEST(first_heating_is_moved_by_half_of_what_another_has_shown)
{
    static const struct {
        uint8_t possible;
        float austenite_ohm; /* learnt: it is not its first */
        float temperature_c, then_c;
    } table[] = {
        {M, 0.0f, 54.0f, 51.5f}, {M, 0.0f, 88.0f, 83.0f},  {M, 0.0f, 20.0f, 20.0f},
        {M, 0.0f, 28.0f, 28.0f}, {M, 0.0f, 29.0f, 28.34f}, /* not worth it; worth it */
        {M, 0.2f, 54.0f, 54.0f}, {B, 0.0f, 54.0f, 54.0f},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_three();
        row(n);
        thermal_model_set_temperature(&model, 0, 98 * 128);
        spring_share_onset(&estimator, &estimator.spring[0], &model, 0, 88.0f);
        TEST_ASSERT_FLOAT_WITHIN(1e-6f, -5.0f / 68.0f, estimator.warms);
        spring_belief_t *const b = &estimator.spring[1];
        spring_begin_shared_heating(&estimator, b, &model, 1);
        TEST_ASSERT_EQUAL_FLOAT(0.0f, b->shared_k); /* cold: nothing is off yet */
        b->possible = table[n].possible;
        b->learnt.austenite_ohm = table[n].austenite_ohm;
        thermal_model_set_temperature(&model, 1, (int16_t)(table[n].temperature_c * 128.0f));
        const float variance_k2 = b->variance_k2, loss = b->learnt.loss_w_per_k;
        for (int twice = 0; twice < 2; twice++) { /* the second time hardly anything is left */
            spring_heat_as_others(&estimator, b, &model, 1);
            TEST_ASSERT_FLOAT_WITHIN(0.01f, table[n].then_c, spring_now_c(&model, 1));
        }
        TEST_ASSERT_FLOAT_WITHIN(0.01f, spring_now_c(&model, 1) - table[n].temperature_c,
                                 b->shared_k);
        if (b->shared_k != 0.0f) {
            TEST_ASSERT_EQUAL_INT16(thermal_model_temperature_c7(&model, 1), b->last_c7);
        }
        TEST_ASSERT_EQUAL(b->shared_k != 0.0f, b->seen);
        TEST_ASSERT_EQUAL_FLOAT(variance_k2, b->variance_k2); /* that makes it no surer */
        TEST_ASSERT_EQUAL_FLOAT(loss, b->learnt.loss_w_per_k);
    }
}

/* Once its own onset is seen, what others had moved it by is told apart as what is seen is; and
 * only what is left tells of the others. */
TEST(own_onset_takes_over_what_others_have_shown)
{
    begin_three();
    estimator.warms = -0.1f;
    spring_belief_t *const b = &estimator.spring[1];
    b->variance_k2 = 20.0f;
    b->capacity_k = 4.0f;
    b->covariance = -2e-3f;
    b->loss_variance = 4e-7f;
    b->shift_variance_k2 = 9.0f;
    b->shift_k = 0.0f;
    b->shared_k = -6.0f;
    thermal_model_set_temperature(&model, 1, 92 * 128);
    spring_share_onset(&estimator, b, &model, 1, 88.0f);
    TEST_ASSERT_FLOAT_WITHIN(1e-4f, 9.0f * 6.0f / 36.0f, b->shift_k);
    TEST_ASSERT_FLOAT_WITHIN(1e-7f, 2e-3f * 6.0f / 36.0f, b->learnt.loss_w_per_k);
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, -0.1f - 0.5f * 4.0f / 68.0f, estimator.warms);
    b->learnt.austenite_ohm = 0.2f; /* it has been heated before: that tells of no other */
    spring_share_onset(&estimator, b, &model, 1, 60.0f);
    TEST_ASSERT_FLOAT_WITHIN(1e-4f, 1.5f, b->shift_k);
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, -0.1f - 0.5f * 4.0f / 68.0f, estimator.warms);
    spring_begin_shared(&estimator);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, estimator.warms);
}

/* One that is warm when it is switched on was moved by then, as far as it was: it is not moved
 * twice. */
TEST(warm_spring_that_is_heated_is_moved_from_there_on)
{
    begin_three();
    estimator.warms = -0.1f;
    thermal_model_set_temperature(&model, 1, 60 * 128);
    spring_estimator_begin_heating(&estimator, &model, 1);
    spring_belief_t *const b = &estimator.spring[1];
    TEST_ASSERT_EQUAL_FLOAT(-4.0f, b->shared_k);
    spring_heat_as_others(&estimator, b, &model, 1);
    TEST_ASSERT_EQUAL_INT16(60 * 128, thermal_model_temperature_c7(&model, 1));
    thermal_model_set_temperature(&model, 1, 70 * 128);
    spring_heat_as_others(&estimator, b, &model, 1);
    TEST_ASSERT_EQUAL_INT16(69 * 128, thermal_model_temperature_c7(&model, 1));
    b->possible = SPRING_PHASE_ANY;
    b->hottest_c = 90.0f;
    spring_estimator_begin_heating(&estimator, &model, 1);
    TEST_ASSERT_EQUAL_FLOAT(90.0f, b->hottest_c); /* while nothing is known it is that */
}

/* ---- what is believed of one ---- */

TEST(phase_is_told_by_the_best_that_there_is)
{
    static const struct {
        uint8_t possible;
        bool reads, blind;
        float austenite_ohm, martensite_ohm;
        float value, sd;
        float noise;
    } table[] = {
        {SPRING_PHASE_AUSTENITE, true, false, 0.22f, 0.176f, 0.9f, 0.03f,
         0.0f}, /* by what was lost */
        {SPRING_PHASE_AUSTENITE, true, true, 0.22f, 0.176f, 0.9f, 0.29f, 0.0f},
        {SPRING_PHASE_BETWEEN, true, false, 0.22f, 0.176f, 0.5f, 0.08f, 0.0f},
        {SPRING_PHASE_BETWEEN, true, false, 0.0f, 0.176f, 0.556f, 0.12f, 0.0f},
        {SPRING_PHASE_BETWEEN, true, false, 0.22f, 0.176f, 0.5f, 0.13f, 0.01f}, /* of its change */
        {SPRING_PHASE_BETWEEN, true, false, 0.0f, 0.176f, 0.556f, 0.14f, 0.004f},
        {SPRING_PHASE_BETWEEN, true, false, 0.0f, 0.15f, 1.0f, 0.12f, 0.0f},
        {SPRING_PHASE_BETWEEN, true, false, 0.0f, 0.0f, 0.0f, 0.29f, 0.0f}, /* by the model: cold */
        {SPRING_PHASE_BETWEEN, false, false, 0.22f, 0.176f, 0.0f, 0.29f, 0.0f},
        {SPRING_PHASE_MARTENSITE, true, false, 0.22f, 0.176f, 0.0f, 0.03f, 0.0f},
    };
    for (size_t j = 0; j < 2 * ROWS(table); j++) {
        const size_t n = j / 2, i = j % 2;
        begin_cold();
        row(n);
        INSIDE.possible = table[n].possible;
        INSIDE.reads = table[n].reads;
        INSIDE.blind = table[n].blind && i == 0;
        INSIDE.unproven = table[n].blind && i != 0; /* is as wide */
        INSIDE.lost = 0.1f;
        INSIDE.noise = table[n].noise;
        INSIDE.phase_ohm = 0.198f;
        INSIDE.learnt = (spring_learnt_t){.austenite_ohm = table[n].austenite_ohm,
                                          .martensite_ohm = table[n].martensite_ohm,
                                          .change = 0.2f};
        const spring_bounds_t is = spring_estimator_austenite(&estimator, &model, 0);
        TEST_ASSERT_FLOAT_WITHIN(1e-3f, table[n].value, is.value);
        TEST_ASSERT_FLOAT_WITHIN(1e-3f, fmaxf(table[n].value - 2.6f * table[n].sd, 0.0f), is.low);
        TEST_ASSERT_FLOAT_WITHIN(1e-3f, fminf(table[n].value + 2.6f * table[n].sd, 1.0f), is.high);
    }
}

/* A contact's step: the spring is what it was, so all that it is compared with steps along. */
TEST(all_that_is_compared_with_jumps_along)
{
    for (int heating = 0; heating < 2; heating++) {
        begin_cold();
        float *const both[] = {&INSIDE.slow_ohm, &INSIDE.learnt.austenite_ohm,
                               &INSIDE.learnt.martensite_ohm};
        float *const heat[] = {&INSIDE.run.heat.mark_ohm, &INSIDE.run.heat.onset_ohm,
                               &INSIDE.run.heat.cold_ohm, &INSIDE.run.heat.sum_ohm};
        float *const line[] = {&INSIDE.run.line.ohm};
        float *const *const own = heating != 0 ? heat : line;
        const size_t owned = heating != 0 ? ROWS(heat) : ROWS(line);
        INSIDE.heating = heating != 0;
        for (size_t n = 0; n < ROWS(both) + owned; n++) {
            *(n < ROWS(both) ? both[n] : own[n - ROWS(both)]) = 0.2f;
        }
        if (heating == 0) {
            INSIDE.run.line.was_ohm[0] = INSIDE.run.line.was_ohm[1] = 0.2f;
            INSIDE.run.line.rise_per_k = 0.001f;
            INSIDE.run.line.slow_k = 5.0f;
        }
        spring_jump(&INSIDE, 1.1f);
        if (heating == 0) { /* and what it would read where it is */
            TEST_ASSERT_EQUAL_FLOAT(0.0f, INSIDE.run.line.was_ohm[0] + INSIDE.run.line.was_ohm[1]);
            TEST_ASSERT_FLOAT_WITHIN(1e-5f, 0.2211f, INSIDE.slow_ohm);
            INSIDE.slow_ohm = 0.22f;
        }
        for (size_t n = 0; n < ROWS(both) + owned; n++) {
            row(n);
            TEST_ASSERT_FLOAT_WITHIN(1e-5f, 0.22f,
                                     *(n < ROWS(both) ? both[n] : own[n - ROWS(both)]));
        }
    }
}

/* What is declared stands in for a change that is not learnt, and for no other. */
TEST(declared_change_stands_in_until_one_is_learnt)
{
    for (int learnt = 0; learnt < 2; learnt++) {
        begin_three();
        INSIDE.learnt.austenite_ohm = learnt != 0 ? 0.22f : 0.0f;
        INSIDE.learnt.change = 0.1f;
        spring_seal(&estimator, 0);
        model.parameters.resistance_martensite_uohm = 150000;
        model.parameters.resistance_austenite_uohm = 200000;
        spring_estimator_prepare(&estimator, &model, true);
        TEST_ASSERT_FLOAT_WITHIN(1e-6f, learnt != 0 ? 0.1f : 0.25f, INSIDE.learnt.change);
        TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.25f, estimator.spring[SPRINGS - 1].learnt.change);
    }
}

/* Other losses are declared of a spring that is where it is. */
static void declare(double factor)
{
    const float before_w = spring_estimator_declared_w(&model, 0);
    thermal_model_parameters_t now = model.parameters;
    thermal_model_state_t state;
    thermal_model_get_state(&model, &state);
    now.loss_uw_per_k = (uint16_t)(factor * now.loss_uw_per_k);
    TEST_ASSERT_EQUAL(THERMAL_MODEL_OK, thermal_model_init(&model, &now, NULL));
    TEST_ASSERT_TRUE(thermal_model_set_state(&model, &state));
    spring_estimator_keep_loss(&estimator, &model, 0, before_w);
    spring_estimator_prepare(&estimator, &model, true);
}

/* Where nothing was seen, the new declaration is as good as the old one was. */
TEST(loss_that_was_never_seen_is_the_declared_one)
{
    declare(1.5);
    TEST_ASSERT_FLOAT_WITHIN(1e-7f, 0.0f, LEARNT.loss_w_per_k);
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.12f * 0.0087f, LEARNT.loss_sd_w_per_k);
    begin_cold(); /* half seen: half of what stays is the declaration's */
    INSIDE.loss_variance *= 0.5f;
    INSIDE.covariance = -1e-3f;
    spring_seal(&estimator, 0);
    declare(2.0);
    TEST_ASSERT_FLOAT_WITHIN(1e-5f, -0.8f * 0.0058f, LEARNT.loss_w_per_k);
    TEST_ASSERT_FLOAT_WITHIN(1e-5f, 0.8944f * 0.12f * 0.0058f, LEARNT.loss_sd_w_per_k);
    TEST_ASSERT_EQUAL_FLOAT(-1e-3f, INSIDE.covariance);
    TEST_ASSERT_EQUAL_FLOAT(LEARNT.loss_sd_w_per_k, INSIDE.learnt.loss_sd_w_per_k);
    declare(0.5);
    TEST_ASSERT_TRUE(INSIDE.covariance > -1e-3f);
    begin_cold(); /* of a warm one that is at once what it gives off */
    thermal_model_set_temperature(&model, 0, 60 * 128);
    INSIDE.loss_variance *= 0.5f;
    spring_seal(&estimator, 0);
    declare(2.0);
    TEST_ASSERT_INT32_WITHIN(1, 40e6f * LEARNT.loss_w_per_k, INSIDE.extra_loss_uw);
    begin_cold();
    /* and one that is known less by now than any declared one stays as it is */
    INSIDE.loss_variance = 4e-6f;
    INSIDE.learnt.loss_w_per_k = 5e-4f;
    spring_seal(&estimator, 0);
    declare(0.8);
    TEST_ASSERT_EQUAL_FLOAT(5e-4f, LEARNT.loss_w_per_k);
    TEST_ASSERT_EQUAL_FLOAT(4e-6f, INSIDE.loss_variance);
    declare(4.0);
    TEST_ASSERT_EQUAL_FLOAT(5e-4f, LEARNT.loss_w_per_k);
    TEST_ASSERT_FLOAT_WITHIN(2e-8f, 0.00223f * 0.00223f, INSIDE.loss_variance);
}

/* What was kept may be farther from what is declared than anything that is learnt: it is not moved
 * by that, and no sight moves it farther. */
TEST(loss_beyond_what_is_ever_learnt_comes_nearer_only)
{
    INSIDE.loss_variance = 1e-8f;
    spring_seal(&estimator, 0);
    declare(8.0);
    const float kept = LEARNT.loss_w_per_k;
    TEST_ASSERT_FLOAT_WITHIN(0.0008f, -0.0406f, kept);
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, -0.45f * 0.0464f,
                             spring_estimator_to_keep(&estimator, 0).loss_w_per_k);
    spring_correct_loss(&estimator, belief_inside(&estimator, 0), -0.001f);
    TEST_ASSERT_EQUAL_FLOAT(kept, INSIDE.learnt.loss_w_per_k);
    spring_correct_loss(&estimator, belief_inside(&estimator, 0), 0.001f);
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, kept + 0.001f, INSIDE.learnt.loss_w_per_k);
    spring_seal(&estimator, 0);
    INSIDE.learnt.austenite_ohm = 0.22f;
    INSIDE.learnt.change = 0.2f;
    spring_seal(&estimator, 0);
    spring_estimator_restart(&estimator, &model); /* what was learnt is not lost by it */
    TEST_ASSERT_EQUAL_FLOAT(0.22f, LEARNT.austenite_ohm);
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, -0.45f * 0.0464f, LEARNT.loss_w_per_k);
}
