/* The rules behind the limits: derating and the shared supply, as functions. */
#include <math.h>

#include "derating.h"
#include "small_array.h"
#include "supply_share.h"
#include "unity.h"

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
    TEST_ASSERT_EQUAL_FLOAT(0.0f, derating_share(110.0f, 110.0f, 10.0f));
    TEST_ASSERT_EQUAL_FLOAT(0.0f, derating_share(1e6f, 110.0f, 10.0f));
    TEST_ASSERT_EQUAL_FLOAT(0.0f, derating_share(NAN, 110.0f, 10.0f));
}

static void undriven_spring_is_judged_by_where_it_is_going(void)
{
    TEST_ASSERT_EQUAL_FLOAT(0.0f, derating_severity(70.0f, 0.0f, 83.0f));
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, 0.4f, derating_severity(80.0f, 0.0f, 83.0f));
    TEST_ASSERT_EQUAL_FLOAT(1.0f, derating_severity(83.0f, 0.0f, 83.0f));
    /* 0.5 K/s for 6 s are 3 K */
    TEST_ASSERT_FLOAT_WITHIN(1e-6f, derating_severity(80.0f, 0.0f, 83.0f),
                             derating_severity(77.0f, 0.5f, 83.0f));
    TEST_ASSERT_EQUAL_FLOAT(0.0f, derating_severity(82.0f, -1.0f, 83.0f));
    TEST_ASSERT_EQUAL_FLOAT(1.0f, derating_severity(NAN, 0.0f, 83.0f));
}

static void overload_is_free_for_half_of_its_time(void)
{
    TEST_ASSERT_EQUAL_UINT16(14800, derating_overload_ma(14800, 6000, 0, 80));
    TEST_ASSERT_EQUAL_UINT16(14800, derating_overload_ma(14800, 6000, 40, 80));
    TEST_ASSERT_EQUAL_UINT16(10400, derating_overload_ma(14800, 6000, 60, 80));
    TEST_ASSERT_EQUAL_UINT16(6000, derating_overload_ma(14800, 6000, 80, 80));
    TEST_ASSERT_EQUAL_UINT16(6000, derating_overload_ma(14800, 6000, UINT16_MAX, 80));
    TEST_ASSERT_EQUAL_UINT16(5000, derating_overload_ma(5000, 6000, 80, 80));
    TEST_ASSERT_EQUAL_UINT16(6000, derating_overload_ma(14800, 6000, 1, 1));
    for (uint16_t quarters = 0; quarters < 100; quarters++) { /* never back up */
        TEST_ASSERT_LESS_OR_EQUAL_UINT16(
            derating_overload_ma(14800, 6000, quarters, 80),
            derating_overload_ma(14800, 6000, (uint16_t)(quarters + 1u), 80));
    }
}

/* ---- supply ---- */

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

static void no_budget_is_no_current(void)
{
    supply_queue_t queue = {0};
    supply_claim_t claim[SPRINGS];
    uint16_t granted_ma[SPRINGS];
    for (uint8_t k = 0; k < SPRINGS; k++) {
        claim[k] = (supply_claim_t){3000, k % 2u == 0 ? 3000 : 0};
        supply_queue_add(&queue, k);
    }
    supply_share(&queue, claim, SPRINGS, 0, granted_ma);
    TEST_ASSERT_EQUAL_UINT32(0, sum_of(granted_ma));
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
    RUN_TEST(undriven_spring_is_judged_by_where_it_is_going);
    RUN_TEST(overload_is_free_for_half_of_its_time);
    RUN_TEST(queue_keeps_each_once_in_order);
    RUN_TEST(boosts_are_served_in_turn_after_what_is_secured);
    RUN_TEST(no_budget_is_no_current);
    RUN_TEST(cap_fits_and_wastes_less_than_a_milliampere_each);
}
