#include "sights.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "one_spring.h"
#include "unity.h"

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
    size_t length = 0;
    for (unsigned i = 0;
         i < spring_estimator_sights(&estimator)->count && length < sizeof where - 8u; i++) {
        length += (size_t)snprintf(where + length, sizeof where - length, "%u ", sight_at(i)->kind);
    }
    TEST_ASSERT_EQUAL_UINT_MESSAGE(count, spring_estimator_sights(&estimator)->count, where);
    for (unsigned i = 0; i < count; i++) {
        TEST_ASSERT_EQUAL_UINT_MESSAGE(kinds[i], sight_at(i)->kind, where);
    }
}

/* Held nearer and nearer until phase is seen to be lost. */
static void search(double from_k)
{
    double margin_k = from_k;
    for (double s = 0.0; s < 300.0 && spring_estimator_lost(BELIEF) == 0.0f; s += TICK_S) {
        margin_k -= spring_estimator_rests(BELIEF) && !spring_estimator_seems_to_lose(BELIEF)
                        ? 0.08 * TICK_S
                        : 0.0;
        (void)tick(hold_current_a(margin_k));
    }
    TEST_ASSERT_TRUE(spring_estimator_lost(BELIEF) > 0.0f);
}

void each_sight_of_a_life_is_noted_with_what_was_done(void)
{
    static const spring_sight_kind_t kinds[] = {SPRING_SIGHT_TOLD, SPRING_SIGHT_ONSET,
                                                SPRING_SIGHT_FINISH, SPRING_SIGHT_LOST};
    begin_cold();
    spring_estimator_begin_heating(&estimator, &model, 0);
    bool still = false; /* seen to transform still: what comes next tells that, too */
    while (!spring_estimator_has_transformed(&estimator, &model, 0)) {
        (void)tick(3.0);
        if (newest()->kind == SPRING_SIGHT_TRANSFORMS) {
            still = true;
            TEST_ASSERT_EQUAL_INT16(200, newest()->now); /* austenite finish */
        }
    }
    TEST_ASSERT_TRUE(still);
    spring_estimator_begin_hold(&estimator, &model, 0, true);
    hold(4.0, 20.0);
    search(4.0);
    static const uint8_t did[] = {SPRING_DID_HEAT, 0, SPRING_DID_HOLD, 0};
    expect_kinds(kinds, 4);
    for (unsigned i = 0; i < 4; i++) {
        TEST_ASSERT_EQUAL_UINT8(did[i], sight_at(i)->did);
    }
    spring_estimator_begin_heating(&estimator, &model, 0);
    TEST_ASSERT_EQUAL_UINT8(SPRING_DID_HEAT, sight_at(3)->did);
    const double ago_s =
        0.25 * spring_sights_age_turns(spring_estimator_sights(&estimator), sight_at(2));
    TEST_ASSERT_TRUE(ago_s > 20.0 && ago_s < 330.0);
}

void sight_says_what_was_believed_read_and_moved(void)
{
    begin_cold();
    (void)heat_then_hold(60.0);
    hold(4.0, 20.0);
    const float shift_k = spring_estimator_shift_k(BELIEF);
    search(4.0);
    const spring_sight_t *s = newest();
    (void)snprintf(where, sizeof where,
                   "believed %d (%u), seen %d (%u), now %d (%u), read %d (%u), shift %d, loss %d",
                   s->believed, s->believed_sd, s->seen, s->seen_sd, s->now, s->now_sd, s->read,
                   s->read_sd, s->shift, s->loss);
    TEST_ASSERT_EQUAL_UINT8_MESSAGE(SPRING_SIGHT_LOST, s->kind, where);
    /* where it is believed now is between both, nearer to what is surer, and surer than either */
    TEST_ASSERT_TRUE_MESSAGE((s->believed - s->now) * (s->now - s->seen) >= 0, where);
    TEST_ASSERT_TRUE_MESSAGE(s->now_sd <= s->believed_sd && s->now_sd <= s->seen_sd, where);
    TEST_ASSERT_TRUE_MESSAGE(s->seen <= 0 && s->seen_sd >= 10, where);
    /* its change is 20 %: what is lost of it is read as less, and that for certain */
    TEST_ASSERT_TRUE_MESSAGE(s->read < 0 && s->read > -400 && s->read_sd > 0, where);
    TEST_ASSERT_TRUE_MESSAGE(s->read < -2 * s->read_sd, where);
    TEST_ASSERT_INT_WITHIN_MESSAGE(
        1, (int)lround(10.0 * (double)(spring_estimator_shift_k(BELIEF) - shift_k)), s->shift,
        where);
    const spring_bounds_t k = spring_estimator_distance_k(&estimator, &model, 0);
    TEST_ASSERT_INT_WITHIN_MESSAGE(2, (int)lround(10.0 * (double)k.value), s->now, where);
}

/* Turn after turn the same: it is told once, with all that it has moved. */
void hold_that_loses_nothing_is_one_sight(void)
{
    begin_cold();
    truth.loss_w_per_k *= 0.85; /* it is warmer than it is believed to be */
    (void)heat_then_hold(60.0);
    hold(3.0, 20.0);
    double margin_k = 3.0;
    for (unsigned s = 0; s < 400 && newest()->kind != SPRING_SIGHT_LOST; s++) {
        margin_k -= 0.05;
        hold(margin_k, 1.0);
    }
    const spring_sight_t *const s = sight_at(spring_estimator_sights(&estimator)->count - 2u);
    TEST_ASSERT_EQUAL_UINT8(SPRING_SIGHT_LOST, newest()->kind);
    TEST_ASSERT_EQUAL_UINT8(SPRING_SIGHT_KEPT, s->kind);
    (void)snprintf(where, sizeof where, "%u turns ago, loss %d, %d to %d, newest %d",
                   spring_sights_age_turns(spring_estimator_sights(&estimator), s), s->loss,
                   s->believed, s->now, newest()->loss);
    TEST_ASSERT_TRUE_MESSAGE(spring_sights_age_turns(spring_estimator_sights(&estimator), s) < 240,
                             where);
    TEST_ASSERT_TRUE_MESSAGE(s->loss < -100,
                             where); /* of the declared loss, a hundredth less at least */
    TEST_ASSERT_TRUE(sight_at(spring_estimator_sights(&estimator)->count - 3u)->kind !=
                     SPRING_SIGHT_KEPT);
}

void contact_that_jumps_is_noted_and_blind_is_said(void)
{
    begin_cold();
    (void)heat_then_hold(60.0);
    hold(4.0, 20.0);
    for (unsigned n = 0; n < 3; n++) {
        truth.contact_ohm = truth.contact_ohm > 0.0 ? 0.0 : 0.02;
        hold(4.0, 5.0);
        (void)snprintf(where, sizeof where, "%u: kind %u, read %d", n, newest()->kind,
                       newest()->read);
        const spring_sight_t *s = newest();
        TEST_ASSERT_EQUAL_UINT8_MESSAGE(SPRING_SIGHT_JUMPED, s->kind, where);
        TEST_ASSERT_TRUE_MESSAGE(n % 2u == 0 ? s->read > 500 : s->read < -500, where);
        TEST_ASSERT_EQUAL_UINT8(0, s->seen_sd); /* it puts it nowhere */
        TEST_ASSERT_EQUAL_INT16(s->believed, s->now);
        TEST_ASSERT_EQUAL(n == 2, (s->did & SPRING_DID_BLIND) != 0);
    }
}

void time_and_look_after_power_on_are_noted(void)
{
    power_comes_on();
    ticks(0.0, 100.0);
    TEST_ASSERT_EQUAL_UINT8(SPRING_SIGHT_COOLED, newest()->kind);
    TEST_ASSERT_EQUAL_UINT8(0, newest()->believed_sd); /* nothing was known */

    (void)heat_then_hold(60.0);
    hold(4.0, 20.0);
    const spring_learnt_t learnt = spring_estimator_learnt(&estimator, 0);
    const truth_t was = truth;
    power_comes_on();
    truth = was;
    spring_estimator_restore(&estimator, 0, &learnt);
    spring_estimator_begin_heating(&estimator, &model, 0);
    ticks(2.0, 2.0);
    TEST_ASSERT_EQUAL_UINT8(SPRING_SIGHT_LOOKED, newest()->kind);
    TEST_ASSERT_TRUE(newest()->seen_sd > 30); /* from martensite start to austenite finish */
    TEST_ASSERT_EQUAL_UINT8(SPRING_DID_HEAT, newest()->did);
}

/* An alloy that shows nothing: hot enough by the model, and blind from there on. */
void heating_that_shows_no_finish_is_noted(void)
{
    begin_cold();
    truth.ratio = 1.0;
    (void)heat_then_hold(60.0);
    TEST_ASSERT_EQUAL_UINT8(SPRING_SIGHT_UNSEEN, newest()->kind);
    TEST_ASSERT_EQUAL_UINT8(SPRING_DID_HOLD | SPRING_DID_BLIND, newest()->did);
    TEST_ASSERT_EQUAL_INT16(newest()->believed, newest()->now);
}

/* ---- the records themselves ---- */

void spring_that_has_most_gives_way(void)
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
        TEST_ASSERT_TRUE(i == 0 || sights.sight[i].number > sights.sight[i - 1u].number);
    }
    for (unsigned k = 0; k < THERMAL_MODEL_MAX_SPRINGS; k++) {
        TEST_ASSERT_EQUAL_UINT(k == 1 ? 6 : 2, of[k]);
    }
    TEST_ASSERT_EQUAL_UINT32(sights.numbers - 1u, spring_sights_newest(&sights, 1)->number);
    TEST_ASSERT_EQUAL_UINT32(7, spring_sights_newest(&sights, 3)->number);
}

void sights_are_found_by_number_and_forgotten_after_four_hours(void)
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
