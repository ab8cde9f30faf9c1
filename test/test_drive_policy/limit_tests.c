/* The rules behind the limits: derating and the shared supply, as functions, and by tables of what
 * is believed. */
#include <math.h>
#include <stdio.h>

#include "../run_tests.h"
#include "small_array.h"
#include "spring_estimator_internal.h"
#include "supply_share.h"

#define ROUND_TICKS 25u /* two rounds of turns: each spring has had two */
#define FULL_MA     3000

/* ---- derating ---- */

/* Wherever it is: the eight around it, and no other. */
TEST(all_around_an_undriven_spring_are_derated)
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
            here("spring %d warm, %d", warm + 1, k + 1);
            TEST_ASSERT_EQUAL(beside, (drive_policy_limits(&policy, (uint8_t)k) &
                                       DRIVE_POLICY_LIMIT_UNDRIVEN) != 0);
        }
    }
}

/* What a spring may be hotter by, beyond half of the band, derates it from 82 degC on; what all
 * driven springs were found colder by lately is the surroundings', and no doubt. */
TEST(doubt_that_others_share_derates_nobody)
{
    static const struct {
        float gone_k, others_k[2];
        bool driven[2];
        float counts_k;
    } table[] = {
        {5.0f, {0.0f, 0.0f}, {true, true}, 0.0f},      {5.9f, {0.0f, 0.0f}, {true, true}, 0.9f},
        {12.0f, {0.0f, 0.0f}, {true, true}, 7.0f},     {12.0f, {4.0f, 4.0f}, {true, true}, 3.0f},
        {5.9f, {0.5f, 0.5f}, {true, true}, 0.4f},      {12.0f, {6.0f, 0.0f}, {true, true}, 4.0f},
        {12.0f, {6.0f, 90.0f}, {true, false}, 1.0f},   {12.0f, {9.0f, 9.0f}, {true, true}, 0.0f},
        {12.0f, {90.0f, 90.0f}, {false, false}, 7.0f},
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        parameters.dither_ma = 0;
        parameters.temperature_limit_cc = 9200;
        begin_cold(3, 3);
        level[4] = 1000;
        believe(4, 82, false);
        belief_inside(&belief, 4)->gone_k = table[n].gone_k;
        spring_seal(&belief, 4);
        for (uint8_t k = 0; k < 2; k++) {
            level[8u * k] = table[n].driven[k] ? 1000 : 0;
            belief_inside(&belief, (uint8_t)(8u * k))->disturbance_k = table[n].others_k[k];
            spring_seal(&belief, (uint8_t)(8u * k));
        }
        decisions(ROUND_TICKS);
        row(n);
        TEST_ASSERT_INT_WITHIN(60, FULL_MA * (1.0f - table[n].counts_k / 10.0f), target_ma[4]);
    }
}

/* ---- supply ---- */

TEST(overload_is_worked_off_once_nobody_waits)
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
            policy.spring[n % 2u].limits = table[n].limits;
            (void)decide();
        }
        row(n);
        TEST_ASSERT_EQUAL_UINT16(table[n].then, policy.overload_quarters);
    }
}

/* What is said of a spring cuts nothing; each limit does. */
TEST(each_limit_says_by_how_much_it_cuts)
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

TEST(restart_leaves_nothing_driven_and_nothing_owed)
{
    begin_cold(3, 3);
    for (uint8_t k = 0; k < SPRINGS; k++) {
        level[k] = 1000;
    }
    decisions(ROUND_TICKS);
    policy.overload_quarters = 7;
    TEST_ASSERT_TRUE(policy.queue.count > 0);
    restart();
    TEST_ASSERT_EQUAL_UINT8(0, policy.queue.count);
    TEST_ASSERT_EQUAL_UINT16(0, policy.overload_quarters);
    for (uint8_t k = 0; k < SPRINGS; k++) {
        TEST_ASSERT_EQUAL(DRIVE_POLICY_STAGE_OFF, drive_policy_stage(&policy, k));
        TEST_ASSERT_EQUAL_UINT16(0, policy.spring[k].granted_ma);
        TEST_ASSERT_EQUAL_UINT16(FULL_MA, policy.spring[k].ceiling_ma);
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

TEST(queue_keeps_each_once_in_order)
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

static uint32_t random_state;

static uint32_t random_below(uint32_t limit)
{
    random_state = random_state * 1664525u + 1013904223u;
    return (random_state >> 8) % limit;
}

/* What is secured is cut alike where it is too much, to less than 1 mA each below what fits. */
TEST(cap_fits_and_wastes_less_than_a_milliampere_each)
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

TEST(parameters_outside_their_range_are_refused_whole)
{
    begin_cold(3, 3);
    drive_policy_parameters_t wrong = parameters;
    uint16_t bad = 0;
    wrong.boost_current_ma = 3300;
    TEST_ASSERT_FALSE(drive_policy_apply(&policy, &wrong, &model, &bad));
    TEST_ASSERT_EQUAL_UINT16(PARAMETER_boost_current_a, bad);
    TEST_ASSERT_EQUAL_UINT16(3000, policy.parameters.boost_current_ma);
    wrong = parameters;
    wrong.unsure_margin_cc = (uint16_t)(wrong.hold_margin_cc - 1);
    TEST_ASSERT_FALSE(drive_policy_check(&wrong, &bad));
    TEST_ASSERT_EQUAL_UINT16(PARAMETER_unsure_margin_k, bad);
    wrong.unsure_margin_cc = wrong.hold_margin_cc;
    TEST_ASSERT_TRUE(drive_policy_check(&wrong, &bad));
    wrong = parameters;
    wrong.policy = 2;
    TEST_ASSERT_FALSE(drive_policy_check(&wrong, &bad));
    TEST_ASSERT_FALSE(drive_policy_init(&policy, &wrong, &model, NULL));
}
