/* The rules behind the limits: derating and the shared supply, as functions, and by tables of what
 * is believed. */
#include <math.h>
#include <stdio.h>

#include "derating.h"
#include "small_array.h"
#include "spring_estimator_internal.h"
#include "supply_share.h"
#include "unity.h"

#define ROUND_TICKS 25u /* two rounds of turns: each spring has had two */
#define FULL_MA     3000
#define ROWS(table) (sizeof(table) / sizeof((table)[0]))

static char where[80];

static void row(size_t n)
{
    (void)snprintf(where, sizeof where, "row %u", (unsigned)n);
}

static uint32_t random_state = 7;
static uint32_t random_below(uint32_t limit)
{
    random_state = random_state * 1664525u + 1013904223u;
    return (random_state >> 8) % limit;
}

/* ---- derating ---- */

static void share_falls_linearly_over_the_band(void)
{
    TEST_ASSERT_EQUAL_FLOAT(1.0f, derating_share(20.0f, 110.0f, 10.0f));
    TEST_ASSERT_EQUAL_FLOAT(1.0f, derating_share(100.0f, 110.0f, 10.0f));
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.25f, derating_share(107.5f, 110.0f, 10.0f));
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.05f, derating_share(109.5f, 110.0f, 10.0f));
    TEST_ASSERT_EQUAL_FLOAT(0.0f, derating_share(110.0f, 110.0f, 10.0f));
    TEST_ASSERT_EQUAL_FLOAT(0.0f, derating_share(1e6f, 110.0f, 10.0f));
    TEST_ASSERT_EQUAL_FLOAT(0.0f, derating_share(NAN, 110.0f, 10.0f));
}

/* Wherever it is: the eight around it, and no other. */
static void all_around_an_undriven_spring_are_derated(void)
{
    for (int warm = 0; warm < SPRINGS; warm++) {
        parameters.dither_ma = 0;
        begin_cold(3, 3);
        for (int k = 0; k < SPRINGS; k++) {
            level[k] = k != warm ? 1000 : 0;
        }
        believe((uint8_t)warm, 80, false);
        decisions(ROUND_TICKS);
        for (int k = 0; k < SPRINGS; k++) {
            const int rows = k / 3 - warm / 3, columns = k % 3 - warm % 3;
            const bool beside = k != warm && rows * rows <= 1 && columns * columns <= 1;
            (void)snprintf(where, sizeof where, "spring %d warm, %d", warm + 1, k + 1);
            TEST_ASSERT_EQUAL_MESSAGE(
                beside,
                (drive_policy_limits(&policy, (uint8_t)k) & DRIVE_POLICY_LIMIT_UNDRIVEN) != 0,
                where);
        }
    }
}

/* It counts as hot as it may be: its own bound, and that of what its neighbours heat it by. */
static void undriven_spring_is_judged_as_hot_as_it_may_be(void)
{
    static const int16_t believed_c[] = {true, 58, 60, 61, 62, 64, 70};
    for (size_t n = 0; n < ROWS(believed_c); n++) {
        parameters.dither_ma = 0;
        begin_cold(3, 3);
        level[0] = 1000;
        believe(1, believed_c[n], false);
        decisions(ROUND_TICKS);
        const float sd_k = spring_estimator_sd_k(spring_estimator_of(&belief, 1));
        const float most_c = believed_c[n] + 2.0f * (sd_k + 0.15f * (believed_c[n] - 20.0f));
        const float left = derating_share(most_c, 88.0f - 5.0f, 5.0f);
        (void)snprintf(where, sizeof where, "%d degC: %.2f", believed_c[n], (double)left);
        TEST_ASSERT_INT_WITHIN_MESSAGE(60, FULL_MA * left, target_ma[0], where);
    }
}

/* What a spring may be hotter by, beyond half of the band, derates it from 82 degC on; what all
 * driven springs were found colder by lately is the surroundings', and no doubt. */
static void doubt_that_others_share_derates_nobody(void)
{
    static const struct {
        float gone_k, others_k[2];
        bool driven[2];
        float counts_k;
    } table[] = {
        {5.0f, {0.0f, 0.0f}, {true, true}, 0.0f},  {5.9f, {0.0f, 0.0f}, {true, true}, 0.9f},
        {12.0f, {0.0f, 0.0f}, {true, true}, 7.0f}, {12.0f, {4.0f, 4.0f}, {true, true}, 3.0f},
        {12.0f, {6.0f, 0.0f}, {true, true}, 4.0f}, {12.0f, {6.0f, 90.0f}, {true, false}, 1.0f},
        {12.0f, {9.0f, 9.0f}, {true, true}, 0.0f}, {12.0f, {90.0f, 90.0f}, {false, false}, 7.0f},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        parameters.dither_ma = 0;
        parameters.temperature_limit_cc = 9200;
        begin_cold(3, 3);
        level[0] = 1000;
        believe(0, 82, false);
        belief_inside(&belief, 0)->gone_k = table[n].gone_k;
        spring_seal(&belief, 0);
        for (uint8_t k = 0; k < 2; k++) {
            level[7 + k] = table[n].driven[k] ? 1000 : 0;
            belief_inside(&belief, (uint8_t)(7 + k))->disturbance_k = table[n].others_k[k];
            spring_seal(&belief, (uint8_t)(7 + k));
        }
        decisions(ROUND_TICKS);
        row(n);
        TEST_ASSERT_INT_WITHIN_MESSAGE(60, FULL_MA * (1.0f - table[n].counts_k / 10.0f),
                                       target_ma[0], where);
    }
}

/* ---- the hold's margin ---- */

/* Above martensite start: as far as its distance is unsure and it was disturbed, within its bounds;
 * what is that unsure is then searched for, at rest, down to a kelvin below. */
static void margin_is_what_is_not_known_and_narrows_at_rest(void)
{
    static const struct {
        float sd_k, disturbance_k, from_k;
        uint8_t quiet;
        float moves_k; /* in a turn; INFINITY: to what is safe */
    } table[] = {
        {1.0f, 0.0f, 30.0f, 0, INFINITY}, {2.5f, 0.0f, 30.0f, 0, INFINITY},
        {2.5f, 2.0f, 30.0f, 0, INFINITY}, {9.0f, 9.0f, 30.0f, 0, INFINITY},
        {2.9f, 0.0f, 1.0f, 60, INFINITY}, {4.0f, 0.0f, 5.0f, 60, -0.02f},
        {4.0f, 0.0f, 5.0f, 0, 0.0f},      {4.0f, 0.0f, -0.99f, 60, -0.02f},
        {4.0f, 0.0f, -1.01f, 60, 0.0f},
    };
    begin_cold(1, 2);
    level[0] = 1000;
    (void)run(120.0);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_HOLD, drive_policy_stage(&policy, 0));
    const drive_policy_t held = policy;
    const spring_estimator_t held_belief = belief;
    const thermal_model_t as_held = model;
    for (size_t n = 0; n < ROWS(table); n++) {
        policy = held;
        belief = held_belief;
        model = as_held;
        spring_belief_t *const b = belief_inside(&belief, 0);
        b->variance_k2 = table[n].sd_k * table[n].sd_k;
        b->capacity_k = b->covariance = b->loss_variance = 0.0f;
        b->disturbance_k = table[n].disturbance_k;
        b->quiet = table[n].quiet;
        spring_seal(&belief, 0);
        policy.spring[0].margin_k = table[n].from_k;
        decisions(ROUND_TICKS / 2u + 1u);
        row(n);
        const float sd_k = spring_estimator_hold_sd_k(&belief, &model, 0);
        const float safe_k =
            fminf(fmaxf(2.5f + b->disturbance_k + 1.6f * (sd_k - 1.5f), 2.5f), 12.0f);
        const float is_k = isinf(table[n].moves_k) ? safe_k : table[n].from_k + table[n].moves_k;
        TEST_ASSERT_FLOAT_WITHIN_MESSAGE(0.005f, is_k, policy.spring[0].margin_k, where);
    }
}

/* ---- supply ---- */

static void overload_is_worked_off_once_nobody_waits(void)
{
    static const struct {
        uint16_t quarters, sum_ma, limits; /* of the last ticks */
        uint16_t then;                     /* two quarters later */
    } table[] = {
        {5, 0, 0, 3},
        {1, 0, 0, 0},
        {0, 0, 0, 0},
        {5, 0, DRIVE_POLICY_LIMIT_SUPPLY, 5},
        {5, 0, DRIVE_POLICY_LIMIT_OVERLOAD, 5},
        {5, 14000, 0, 3},
        {5, 14001, 0, 7},
        {1199, 14001, 0, 1200},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold(1, 2);
        policy.overload_quarters = table[n].quarters;
        for (unsigned tick = 0; tick < ROUND_TICKS; tick++) {
            policy.sum_ma = table[n].sum_ma;
            policy.spring[1].limits = table[n].limits;
            (void)decide();
        }
        row(n);
        TEST_ASSERT_EQUAL_UINT16_MESSAGE(table[n].then, policy.overload_quarters, where);
    }
}

/* What is said of a spring cuts nothing; each limit does. */
static void each_limit_says_by_how_much_it_cuts(void)
{
    const uint16_t cut = DRIVE_POLICY_LIMIT_CURRENT | DRIVE_POLICY_LIMIT_SUPPLY |
                         DRIVE_POLICY_LIMIT_TEMPERATURE | DRIVE_POLICY_LIMIT_UNDRIVEN |
                         DRIVE_POLICY_LIMIT_OVERLOAD;
    begin_cold(1, 2);
    policy.spring[0].wanted_ma = 3000;
    policy.spring[0].target_ma = 1200;
    for (uint16_t bit = 1; bit <= DRIVE_POLICY_LIMIT_AWAY; bit = (uint16_t)(bit << 1)) {
        policy.spring[0].limits = bit;
        TEST_ASSERT_EQUAL_UINT16((bit & cut) != 0 ? 1800 : 0, drive_policy_cut_ma(&policy, 0));
    }
}

/* Of two neighbours that are not driven, one that warms by 0.1 K a turn: 0.4 K/s, once it has for
 * some turns. */
static void rise_is_an_average_of_turns(void)
{
    begin_cold(1, 2);
    believe(1, 40, false);
    decisions(ROUND_TICKS);
    for (unsigned turn = 1; turn <= 8; turn++) {
        thermal_model_set_temperature(&model, 1, (int16_t)(40 * 128 + 13 * (int)turn));
        const float before = policy.spring[1].rise_k_per_s;
        for (unsigned tick = 0; policy.spring[1].rise_k_per_s == before && tick < ROUND_TICKS;
             tick++) {
            (void)decide();
        }
        const float most_k_per_s = 4.0f * 13.0f / 128.0f;
        TEST_ASSERT_FLOAT_WITHIN(1e-3f, most_k_per_s * (1.0f - powf(0.75f, (float)turn)),
                                 policy.spring[1].rise_k_per_s);
    }
}

/* A trip is of turns on end without a current, of a spring that is asked for. */
static void trip_is_counted_anew_where_a_current_or_no_wish_was_between(void)
{
    parameters.trip_time_s = 2; /* 8 turns */
    parameters.temperature_limit_cc = 9200;
    for (int n = 0; n < 3; n++) {
        begin_cold(1, 2);
        level[0] = 1000;
        believe(0, 100, false);
        decisions(7u * 25u / 2u);
        if (n == 1) {
            level[0] = 0;
        } else if (n == 2) {
            believe(0, 85, false);
        }
        decisions(ROUND_TICKS);
        level[0] = 1000;
        believe(0, 100, false);
        decisions(6u * 25u / 2u);
        row((size_t)n);
        TEST_ASSERT_EQUAL_MESSAGE(n == 0, policy.spring[0].tripped, where);
    }
    level[0] = 1000;
    decisions(10u * ROUND_TICKS);
    TEST_ASSERT_TRUE(policy.spring[0].tripped);
    level[0] = 0;
    decisions(ROUND_TICKS);
    TEST_ASSERT_FALSE(policy.spring[0].tripped);
}

/* What is asked for begins with what is there already. */
static void level_that_is_there_is_held_and_one_that_is_not_is_heated(void)
{
    static const struct {
        bool half; /* transformed, at 93 degC; else wholly, at 97 */
        uint16_t level_permille;
        drive_policy_stage_t stage;
    } table[] = {
        {true, 540, DRIVE_POLICY_STAGE_HOLD},  {true, 560, DRIVE_POLICY_STAGE_HEAT},
        {true, 460, DRIVE_POLICY_STAGE_HOLD},  {true, 440, DRIVE_POLICY_STAGE_LOWER},
        {true, 1000, DRIVE_POLICY_STAGE_HEAT}, {false, 1000, DRIVE_POLICY_STAGE_HOLD},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        begin_cold(1, 2);
        believe(0, table[n].half ? 93 : 97, !table[n].half);
        decisions(ROUND_TICKS); /* its turn is over: it is off */
        level[0] = table[n].level_permille;
        for (unsigned tick = 0; tick < 13u || (tick < ROUND_TICKS && n == 3); tick++) {
            (void)decide();
        }
        row(n);
        TEST_ASSERT_EQUAL_MESSAGE(table[n].stage, drive_policy_stage(&policy, 0), where);
    }
}

static void spring_that_is_switched_off_leaves_the_queue(void)
{
    begin_cold(1, 2);
    level[0] = level[1] = 1000;
    (void)run(1.0);
    TEST_ASSERT_EQUAL_UINT8(2, policy.queue.count);
    level[0] = 0;
    (void)decide();
    TEST_ASSERT_EQUAL_UINT8(1, policy.queue.count);
    TEST_ASSERT_EQUAL_UINT8(1, policy.queue.spring[0]);
}

static void restart_leaves_nothing_driven_and_nothing_owed(void)
{
    begin_cold(3, 3);
    for (uint8_t k = 0; k < SPRINGS; k++) {
        level[k] = 1000;
    }
    (void)run(3.0);
    policy.overload_quarters = 7;
    TEST_ASSERT_TRUE(policy.queue.count > 0);
    TEST_ASSERT_TRUE(drive_policy_init(&policy, &parameters, &model, NULL));
    TEST_ASSERT_EQUAL_UINT8(0, policy.queue.count);
    TEST_ASSERT_EQUAL_UINT16(0, policy.overload_quarters);
    for (uint8_t k = 0; k < SPRINGS; k++) {
        TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_OFF, drive_policy_stage(&policy, k));
        TEST_ASSERT_EQUAL_UINT16(0, policy.spring[k].granted_ma);
    }
}

static uint32_t sum_of(const uint16_t granted_ma[])
{
    uint32_t sum_ma = 0;
    for (uint8_t k = 0; k < SPRINGS; k++) {
        sum_ma += granted_ma[k];
    }
    return sum_ma;
}

static void queue_keeps_each_once_in_order(void)
{
    supply_queue_t queue = {0};
    supply_queue_add(&queue, 4);
    supply_queue_add(&queue, 2);
    supply_queue_add(&queue, 4); /* keeps its place */
    supply_queue_add(&queue, 7);
    supply_queue_remove(&queue, 2);
    supply_queue_remove(&queue, 2);
    supply_queue_add(&queue, 2); /* to the end */
    TEST_ASSERT_EQUAL_UINT8(3, queue.count);
    TEST_ASSERT_EQUAL_UINT8(4, queue.spring[0]);
    TEST_ASSERT_EQUAL_UINT8(7, queue.spring[1]);
    TEST_ASSERT_EQUAL_UINT8(2, queue.spring[2]);
    for (unsigned n = 0; n < 300; n++) { /* full is full */
        supply_queue_add(&queue, (uint8_t)n);
    }
    TEST_ASSERT_EQUAL_UINT8(THERMAL_MODEL_MAX_SPRINGS, queue.count);
}

static void boosts_are_served_in_turn_after_what_is_secured(void)
{
    supply_queue_t queue = {0};
    supply_claim_t claim[SPRINGS] = {{0, 0}};
    uint16_t granted_ma[SPRINGS];
    supply_queue_add(&queue, 3);
    supply_queue_add(&queue, 0);
    supply_queue_add(&queue, 5);
    claim[8] = (supply_claim_t){1500, 1500}; /* holds */
    claim[0] = (supply_claim_t){3000, 1000}; /* keeps what it has */
    claim[3] = claim[5] = (supply_claim_t){3000, 0};
    supply_share(&queue, claim, SPRINGS, 7000, granted_ma);
    TEST_ASSERT_EQUAL_UINT16(1500, granted_ma[8]);
    TEST_ASSERT_EQUAL_UINT16(3000, granted_ma[3]);
    TEST_ASSERT_EQUAL_UINT16(2500, granted_ma[0]);
    TEST_ASSERT_EQUAL_UINT16(0, granted_ma[5]);
    supply_share(&queue, claim, SPRINGS, 7600, granted_ma); /* 100 mA are not worth it */
    TEST_ASSERT_EQUAL_UINT16(0, granted_ma[5]);
}

/* What is secured is cut alike where it is too much, to less than 1 mA each below what fits. */
static void cap_fits_and_wastes_less_than_a_milliampere_each(void)
{
    const supply_queue_t queue = {0};
    for (unsigned n = 0; n < 300; n++) {
        supply_claim_t claim[SPRINGS];
        uint16_t granted_ma[SPRINGS];
        uint32_t asked_ma = 0;
        uint16_t highest_ma = 0;
        const uint16_t budget_ma = (uint16_t)random_below(15000);
        for (uint8_t k = 0; k < SPRINGS; k++) {
            claim[k].asked_ma = claim[k].secured_ma = (uint16_t)random_below(3201);
            asked_ma += claim[k].asked_ma;
        }
        supply_share(&queue, claim, SPRINGS, budget_ma, granted_ma);
        TEST_ASSERT_LESS_OR_EQUAL_UINT32(budget_ma, sum_of(granted_ma));
        const uint32_t best_ma = asked_ma < budget_ma ? asked_ma : budget_ma;
        TEST_ASSERT_GREATER_THAN_UINT32(best_ma, sum_of(granted_ma) + SPRINGS);
        for (uint8_t k = 0; k < SPRINGS; k++) {
            highest_ma = granted_ma[k] > highest_ma ? granted_ma[k] : highest_ma;
        }
        for (uint8_t k = 0; k < SPRINGS;
             k++) { /* nobody has less than another but by his own wish */
            TEST_ASSERT_TRUE(granted_ma[k] == highest_ma || granted_ma[k] == claim[k].asked_ma);
        }
    }
}

void run_limit_tests(void)
{
    Unity.TestFile = __FILE__;
    RUN_TEST(share_falls_linearly_over_the_band);
    RUN_TEST(all_around_an_undriven_spring_are_derated);
    RUN_TEST(undriven_spring_is_judged_as_hot_as_it_may_be);
    RUN_TEST(doubt_that_others_share_derates_nobody);
    RUN_TEST(margin_is_what_is_not_known_and_narrows_at_rest);
    RUN_TEST(overload_is_worked_off_once_nobody_waits);
    RUN_TEST(each_limit_says_by_how_much_it_cuts);
    RUN_TEST(rise_is_an_average_of_turns);
    RUN_TEST(trip_is_counted_anew_where_a_current_or_no_wish_was_between);
    RUN_TEST(level_that_is_there_is_held_and_one_that_is_not_is_heated);
    RUN_TEST(spring_that_is_switched_off_leaves_the_queue);
    RUN_TEST(restart_leaves_nothing_driven_and_nothing_owed);
    RUN_TEST(queue_keeps_each_once_in_order);
    RUN_TEST(boosts_are_served_in_turn_after_what_is_secured);
    RUN_TEST(cap_fits_and_wastes_less_than_a_milliampere_each);
}
