/* The drive policy by what it does: to springs as they are, and where a limit is meant, by what it
 * is told of them. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "../run_tests.h"
#include "small_array.h"
#include "spring_estimator_internal.h"

#define RESERVED_MA   14800u /* supply 15 A less the default reserve */
#define FULL_BOOST_MA 3000u
#define TURN_TICKS    13u /* in which each spring is decided on once, rounded up */

void setUp(void)
{
    set_defaults();
}

void tearDown(void)
{
    TEST_ASSERT_EQUAL_UINT8(0, spring_estimator_broken_seals(&belief));
}

static void want_all(uint16_t permille)
{
    for (uint8_t k = 0; k < SPRINGS; k++) {
        level[k] = permille;
    }
}

/* ---- from power-on ---- */

TEST(jump_of_the_current_forgets_no_phase)
{
    begin_cold(1, 2);
    level[0] = 1000;
    (void)run(300.0);
    for (unsigned n = 0; n < TURN_TICKS; n++) { /* one of them leaves a turn without readings */
        spring_estimator_disturb(&belief, 0);
        (void)run(1.0 + TICK_S);
        TEST_ASSERT_EQUAL_UINT8(SPRING_PHASE_AUSTENITE,
                                spring_estimator_possible(spring_estimator_of(&belief, 0)));
    }
}

/* Whichever way it came there, and never fully on: by its own martensite's resistance. */
TEST(levels_one_after_the_other_are_held)
{
    static const uint16_t levels[] = {500, 250, 800, 400, 600};
    for (int n = 0; n < 3; n++) {
        set_defaults();
        loss_w_per_k *= 0.85 + 0.15 * n;
        begin_cold(1, 2);
        for (unsigned j = 0; j < 5; j++) {
            level[0] = levels[j];
            (void)run(120.0);
            here("loss %d, %u permille: %.3f", n, levels[j], truth[0].austenite);
            TEST_ASSERT_TRUE(fabs(truth[0].austenite - 0.001 * levels[j]) < 0.1);
        }
    }
}

/* ---- limits ---- */

TEST(boosts_are_staggered_not_diluted)
{
    begin_cold(3, 3);
    want_all(1000);
    decisions(2u * TURN_TICKS);
    TEST_ASSERT_LESS_OR_EQUAL_UINT32(RESERVED_MA, decide());
    unsigned full = 0, none = 0;
    for (uint8_t k = 0; k < SPRINGS; k++) {
        full += target_ma[k] > FULL_BOOST_MA - parameters.dither_ma / 4u;
        none += target_ma[k] == 0;
        if (target_ma[k] == 0) {
            TEST_ASSERT_BITS_HIGH(DRIVE_POLICY_LIMIT_SUPPLY, drive_policy_limits(&policy, k));
            TEST_ASSERT_EQUAL_UINT16(FULL_BOOST_MA, drive_policy_cut_ma(&policy, k));
        }
    }
    TEST_ASSERT_EQUAL_UINT(4, full);
    TEST_ASSERT_EQUAL_UINT(4, none); /* the ninth has what is left */
}

TEST(budget_holds_in_every_tick_whatever_is_asked)
{
    power_on(3, 3);
    for (unsigned n = 0; n < 40000; n++) {
        if (random_below(20) == 0) {
            level[random_below(SPRINGS)] = (uint16_t)(random_below(3) * 500);
        }
        if (random_below(50) == 0) {
            allowed[random_below(SPRINGS)] = random_below(2) != 0;
        }
        if (random_below(100) == 0) {
            believe((uint8_t)random_below(SPRINGS), (int16_t)(20 + random_below(85)),
                    random_below(2) != 0);
        }
        if (random_below(400) == 0) {
            parameters.policy ^= 1u;
            apply(&parameters);
        }
        TEST_ASSERT_LESS_OR_EQUAL_UINT32(RESERVED_MA, tick());
        for (uint8_t k = 0; k < SPRINGS; k++) {
            TEST_ASSERT_LESS_OR_EQUAL_UINT16(3000, target_ma[k]);
            if (level[k] == 0 || !allowed[k]) {
                TEST_ASSERT_EQUAL_UINT16(0, target_ma[k]);
            }
        }
    }
    TEST_ASSERT_TRUE(thermal_model_is_consistent(&model));
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
