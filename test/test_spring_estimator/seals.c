/* Bits of RAM that turn over in what is believed of a spring. */
#include <stddef.h>
#include <stdio.h>

#include "../run_tests.h"
#include "one_spring.h"
#include "sights.h"

static spring_estimator_t sound;
static thermal_model_t sound_model;

static void keep_sound(void)
{
    sound = estimator;
    sound_model = model;
}

/* As it was kept, but for one bit. */
static void turn_over(size_t at, unsigned bit)
{
    estimator = sound;
    model = sound_model;
    ((uint8_t *)&estimator)[at] ^= (uint8_t)(1u << bit);
    here("byte %u, bit %u", (unsigned)at, bit);
}

static void expect_begun_anew(void)
{
    TEST_ASSERT_FALSE(spring_estimator_update(&estimator, &model, 0));
    TEST_ASSERT_EQUAL_UINT8(SPRING_PHASE_ANY, INSIDE.possible);
    TEST_ASSERT_EQUAL_FLOAT(SPRING_ESTIMATOR_HOTTEST_C, INSIDE.hottest_c);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, INSIDE.learnt.austenite_ohm);
    TEST_ASSERT_EQUAL_FLOAT(sound.change, INSIDE.learnt.change);
    TEST_ASSERT_FLOAT_WITHIN(1e-5f, sound.spring[0].declared_stiffness_w_per_k,
                             INSIDE.declared_stiffness_w_per_k);
    TEST_ASSERT_FALSE(INSIDE.heating);
    TEST_ASSERT_EQUAL_UINT8(1, estimator.broken_seals);
    TEST_ASSERT_TRUE(is_noted(SPRING_SIGHT_ANEW));
    TEST_ASSERT_TRUE(spring_estimator_has_begun_anew(BELIEF));
    TEST_ASSERT_TRUE(spring_estimator_update(&estimator, &model, 0));
    TEST_ASSERT_FALSE(spring_estimator_has_begun_anew(BELIEF));
}

TEST(whatever_bit_of_a_belief_turns_over_nothing_is_known_from_its_next_turn_on)
{
    for (unsigned held = 0; held < 2; held++) {
        begin_cold();
        if (held != 0) {
            heat_then_hold(60.0);
        } else {
            spring_estimator_begin_heating(&estimator, &model, 0);
        }
        ticks(2.0, 5.0);
        keep_sound();
        const size_t begin =
            offsetof(spring_estimator_t, spring) + offsetof(spring_belief_t, variance_k2);
        const size_t end = offsetof(spring_estimator_t, spring) + sizeof(spring_belief_t);
        for (size_t at = begin; at < end; at++) {
            for (unsigned bit = 0; bit < 8; bit++) {
                turn_over(at, bit);
                expect_begun_anew();
            }
        }
    }
    begin_cold();
}

TEST(whatever_bit_of_what_springs_share_turns_over_that_begins_anew)
{
    heat_then_hold(60.0);
    keep_sound();
    TEST_ASSERT_TRUE(estimator.sights.count > 2);
    const size_t end = offsetof(spring_estimator_t, sights.count);
    for (size_t at = offsetof(spring_estimator_t, stepped_turns); at <= end; at++) {
        for (unsigned bit = 0; bit < 8; bit++) {
            turn_over(at, bit);
            TEST_ASSERT_TRUE(spring_estimator_update(&estimator, &model, 0));
            TEST_ASSERT_EQUAL_UINT8(0, estimator.sights.count);
            TEST_ASSERT_EQUAL_UINT16(0, estimator.stepped_turns);
            TEST_ASSERT_EQUAL_UINT8(0, estimator.stepped_spring);
            TEST_ASSERT_EQUAL_UINT8(SPRING_PHASE_AUSTENITE, INSIDE.possible);
            TEST_ASSERT_TRUE(spring_estimator_update(&estimator, &model, 0));
        }
    }
    begin_cold();
}

/* Bytes of a belief, from the first on and up to the last. */
typedef struct {
    size_t from, to;
    bool counts;
} part_t;

#define PART(from, to, counts)                                                                     \
    {                                                                                              \
        offsetof(spring_belief_t, from), offsetof(spring_belief_t, to), counts                     \
    }

static void expect_marks(const part_t parts[], size_t count)
{
    keep_sound();
    const uint16_t mark = spring_estimator_mark(&estimator, &model, 0);
    for (size_t n = 0; n < count; n++) {
        for (size_t at = parts[n].from; at < parts[n].to; at++) {
            turn_over(offsetof(spring_estimator_t, spring) + at, (unsigned)at % 8u);
            TEST_ASSERT_EQUAL(parts[n].counts,
                              spring_estimator_mark(&estimator, &model, 0) != mark);
        }
    }
    turn_over(offsetof(spring_estimator_t, r_phase_odds), 3);
    TEST_ASSERT_TRUE(spring_estimator_mark(&estimator, &model, 0) != mark);
    estimator = sound;
    model.state.spring[0].temperature_c23 ^= 1;
    TEST_ASSERT_TRUE(spring_estimator_mark(&estimator, &model, 0) != mark);
    model = sound_model;
    model.state.spring[1].temperature_c23 ^= 1; /* another spring's */
    TEST_ASSERT_EQUAL_UINT16(mark, spring_estimator_mark(&estimator, &model, 0));
}

/* What counts is what a rerun must find again: no number of what is read just now, no bit. */
TEST(mark_is_of_every_number_that_is_believed)
{
    static const part_t heats[] = {
        PART(readings, variance_k2, false),
        PART(variance_k2, averaged, true),
        PART(averaged, unsteady, false),
        PART(learnt, last_c7, true),
        PART(last_c7, gone_k, false),
        PART(gone_k, run, true),
        {offsetof(spring_belief_t, unsteady), offsetof(spring_belief_t, unsteady) + 2u, true},
        {offsetof(spring_belief_t, run),
         offsetof(spring_belief_t, run) + offsetof(spring_heat_t, turns) + 1u, true}};
    static const part_t holds[] = {{offsetof(spring_belief_t, run),
                                    offsetof(spring_belief_t, run) + offsetof(spring_line_t, turns),
                                    true},
                                   {offsetof(spring_belief_t, run) + offsetof(spring_line_t, turns),
                                    sizeof(spring_belief_t), false},
                                   PART(variance_k2, averaged, true)};
    begin_cold();
    spring_estimator_begin_heating(&estimator, &model, 0);
    ticks(2.0, 5.0);
    expect_marks(heats, ROWS(heats));
    begin_cold();
    heat_then_hold(60.0);
    expect_marks(holds, ROWS(holds));
    begin_cold();
}

/* What is done to a spring before its next turn. */
static void and_is_left(void)
{
    spring_estimator_leave(&estimator, 0);
}
static void and_is_told(void)
{
    spring_estimator_trust_model(&estimator, &model);
}
static void and_forgets(void)
{
    spring_estimator_forget(&estimator, 0);
}
static void and_forgets_loss(void)
{
    spring_estimator_forget_loss(&estimator, 0);
}
static void and_keeps_loss(void)
{
    spring_estimator_keep_loss(&estimator, &model, 0, 0.5f);
}
static void and_is_restored(void)
{
    spring_estimator_restore(&estimator, 0, &sound.spring[0].learnt);
}
static void and_is_prepared(void)
{
    spring_estimator_prepare(&estimator, &model, true);
}
static void and_is_disturbed(void)
{
    spring_estimator_disturb(&estimator, 0);
}

TEST(change_before_its_turn_hides_no_bit)
{
    static void (*const changes[])(void) = {and_is_left,      and_is_told,     and_forgets,
                                            and_forgets_loss, and_keeps_loss,  and_is_restored,
                                            and_is_prepared,  and_is_disturbed};
    heat_then_hold(60.0);
    spring_estimator_begin_heating(&estimator, &model, 0);
    ticks(2.0, 1.0);
    keep_sound();
    for (unsigned n = 0; n < ROWS(changes); n++) {
        turn_over(offsetof(spring_estimator_t, spring) + offsetof(spring_belief_t, slow_ohm) + 2u,
                  5);
        changes[n]();
        expect_begun_anew();
        turn_over(0, 0); /* and is none itself */
        estimator = sound;
        changes[n]();
        TEST_ASSERT_TRUE(spring_estimator_update(&estimator, &model, 0));
    }
    turn_over(offsetof(spring_estimator_t, spring) + offsetof(spring_belief_t, learnt), 6);
    spring_estimator_restart(&estimator, &model);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, INSIDE.learnt.austenite_ohm);
    estimator = sound;
    spring_estimator_restart(&estimator, &model);
    TEST_ASSERT_TRUE(INSIDE.learnt.austenite_ohm > 0.0f);
    turn_over(offsetof(spring_estimator_t, stepped_turns), 3); /* nor of what they share */
    spring_estimator_trust_model(&estimator, &model);
    TEST_ASSERT_EQUAL_UINT8(1, estimator.sights.count);
    begin_cold();
}
