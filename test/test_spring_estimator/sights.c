#include "sights.h"

#include <stdio.h>
#include <string.h>

#include "../run_tests.h"
#include "one_spring.h"

static const spring_sight_t *sight_at(unsigned at)
{
    TEST_ASSERT_TRUE_MESSAGE(at < spring_estimator_sights(&estimator)->count,
                             "there is no such sight");
    return &spring_estimator_sights(&estimator)->sight[at];
}

const spring_sight_t *newest(void)
{
    return sight_at(spring_estimator_sights(&estimator)->count - 1u);
}

bool is_noted(spring_sight_kind_t kind)
{
    for (unsigned i = 0; i < spring_estimator_sights(&estimator)->count; i++) {
        if (sight_at(i)->kind == kind) {
            return true;
        }
    }
    return false;
}

static void expect_kinds(const spring_sight_kind_t kinds[], unsigned count)
{
    TEST_ASSERT_EQUAL_UINT(count, spring_estimator_sights(&estimator)->count);
    for (unsigned i = 0; i < count; i++) {
        row(i);
        TEST_ASSERT_EQUAL_UINT(kinds[i], sight_at(i)->kind);
    }
}

TEST(each_sight_of_a_life_is_noted_with_what_was_done)
{
    static const spring_sight_kind_t kinds[] = {SPRING_SIGHT_TOLD, SPRING_SIGHT_ONSET,
                                                SPRING_SIGHT_FINISH, SPRING_SIGHT_KEPT,
                                                SPRING_SIGHT_LOST};
    begin_cold();
    spring_estimator_begin_heating(&estimator, &model, 0);
    bool still = false; /* seen to transform still: what comes next tells that, too */
    while (!spring_estimator_has_transformed(&estimator, &model, 0)) {
        tick(3.0);
        if (newest()->kind == SPRING_SIGHT_TRANSFORMS) {
            still = true;
            TEST_ASSERT_EQUAL_INT16(200, newest()->now); /* austenite finish */
        }
    }
    TEST_ASSERT_TRUE(still);
    spring_estimator_begin_hold(&estimator, &model, 0, true);
    hold(4.0, 20.0);
    double margin_k = 4.0; /* nearer and nearer, until phase is seen to be lost */
    for (double s = 0.0; s < 400.0 && spring_estimator_lost(BELIEF) == 0.0f; s += TICK_S) {
        margin_k -= spring_estimator_rests(BELIEF) ? 0.08 * TICK_S : 0.0;
        tick(hold_current_a(margin_k));
    }
    static const uint8_t did[] = {SPRING_DID_HEAT, 0, SPRING_DID_HOLD, 0, 0};
    expect_kinds(kinds, ROWS(kinds));
    for (unsigned i = 0; i < ROWS(kinds); i++) {
        row(i);
        TEST_ASSERT_EQUAL_UINT8(did[i], sight_at(i)->did);
    }
    spring_estimator_begin_heating(&estimator, &model, 0);
    TEST_ASSERT_EQUAL_UINT8(SPRING_DID_HEAT, sight_at(4)->did);
    const double ago_s =
        0.25 * spring_sights_age_turns(spring_estimator_sights(&estimator), sight_at(2));
    TEST_ASSERT_TRUE(ago_s > 20.0 && ago_s < 330.0);
}

/* ---- the records themselves ---- */

TEST(spring_that_has_most_gives_way)
{
    static spring_sights_t sights;
    memset(&sights, 0, sizeof sights);
    for (uint8_t k = 0; k < THERMAL_MODEL_MAX_SPRINGS; k++) {
        (void)spring_sights_add(&sights, k);
        (void)spring_sights_add(&sights, k);
    }
    for (unsigned n = 0; n < 1000; n++) {
        (void)spring_sights_add(&sights, 1);
    }
    TEST_ASSERT_EQUAL_UINT(SPRING_SIGHTS_KEPT, sights.count);
    unsigned of[THERMAL_MODEL_MAX_SPRINGS] = {0};
    for (unsigned i = 0; i < sights.count; i++) {
        of[sights.sight[i].spring]++;
    }
    for (unsigned k = 0; k < THERMAL_MODEL_MAX_SPRINGS; k++) {
        TEST_ASSERT_EQUAL_UINT(k == 1 ? 6 : 2, of[k]);
    }
    TEST_ASSERT_EQUAL_UINT32(sights.numbers - 1u, spring_sights_newest(&sights, 1)->number);
    TEST_ASSERT_EQUAL_UINT32(7, spring_sights_newest(&sights, 3)->number);
    /* its newest are kept, and whoever reads on by numbers is told each once, in their order */
    TEST_ASSERT_EQUAL_UINT32(sights.numbers - 6u,
                             spring_sights_from(&sights, 1, spring_sights_first(&sights))->number);
    unsigned told = 0;
    uint32_t from = spring_sights_first(&sights);
    for (const spring_sight_t *next;
         told <= SPRING_SIGHTS_KEPT &&
         (next = spring_sights_from(&sights, SPRING_SIGHTS_ANY, from)) != NULL;
         from = next->number + 1u) {
        told++;
    }
    TEST_ASSERT_EQUAL_UINT(SPRING_SIGHTS_KEPT, told);
}

TEST(sights_are_found_by_number_and_forgotten_after_four_hours)
{
    static spring_sights_t sights;
    memset(&sights, 0, sizeof sights);
    sights.numbers = UINT32_MAX; /* they come round */
    (void)spring_sights_add(&sights, 2);
    (void)spring_sights_add(&sights, 0);
    (void)spring_sights_add(&sights, 2);
    const uint32_t first = spring_sights_first(&sights);
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, spring_sights_from(&sights, 2, first)->number);
    TEST_ASSERT_EQUAL_UINT32(1, spring_sights_from(&sights, 2, 0)->number);
    TEST_ASSERT_EQUAL_UINT32(0, spring_sights_from(&sights, SPRING_SIGHTS_ANY, 0)->number);
    TEST_ASSERT_NULL(spring_sights_from(&sights, 0, 1));
    TEST_ASSERT_NULL(spring_sights_from(&sights, SPRING_SIGHTS_ANY, 2));
    TEST_ASSERT_NULL(spring_sights_newest(&sights, 1));
    for (unsigned n = 0; n < 4u * 3600u * SPRING_SIGHTS_TURNS_PER_S; n++) {
        spring_sights_turn(&sights);
    }
    TEST_ASSERT_EQUAL_UINT(3, sights.count);
    for (unsigned n = 0; n < 3u * SPRING_SIGHTS_KEPT; n++) {
        spring_sights_turn(&sights);
    }
    TEST_ASSERT_EQUAL_UINT(0, sights.count);
}
