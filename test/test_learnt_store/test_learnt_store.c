/* What was learnt comes back after power-off as it was; it is saved when it is worth a save, and
 * only then; power may fail at any byte. */
#include <stdio.h>
#include <string.h>

#include "../run_tests.h"
#include "learnt_store.h"
#include "settings.h"

#include "../fakes/eeprom.h"

static controller_t controller;
static learnt_store_t store;
static const spring_learnt_t numbers = {.austenite_ohm = 0.2191f,
                                        .change = -0.2034f,
                                        .martensite_ohm = 0.174512f,
                                        .martensite_rise_per_k = 0.000431f,
                                        .loss_w_per_k = -0.000417f,
                                        .loss_sd_w_per_k = 0.000121f,
                                        .offset_v = -0.0031f,
                                        .slow_noise = 0.0004f};

static void power_on_with(const controller_settings_t *settings)
{
    TEST_ASSERT_TRUE(controller_init(&controller, settings, 20 * 128, NULL));
    (void)learnt_store_open(&store, &storage, SETTINGS_LEARNT_BASE, SETTINGS_LEARNT_SLOT_BYTES,
                            &controller);
}

static void power_on(void)
{
    controller_settings_t settings;
    controller_settings_default(&settings);
    power_on_with(&settings);
}

/* Seconds of the loop; the EEPROM takes a byte in each turn. */
static void seconds(unsigned count)
{
    for (unsigned s = 0; s < count; s++) {
        learnt_store_second(&store, &controller);
        for (unsigned turn = 0; turn < 2000 && learnt_store_step(&store) == RECORD_SAVE_BUSY;) {
            turn++;
        }
    }
}

static void hold(uint8_t spring, drive_policy_stage_t stage)
{
    TEST_ASSERT_TRUE(controller_set_target(&controller, spring, 1000));
    controller.policy.spring[spring].stage = (uint8_t)stage;
}

static void learn(uint8_t spring, const spring_learnt_t *learnt)
{
    controller_restore_learnt(&controller, spring, learnt);
    TEST_ASSERT_EQUAL_FLOAT(learnt->austenite_ohm,
                            controller_learnt(&controller, spring).austenite_ohm);
}

/* Spring 1 is held for as long as it takes until its numbers are worth a save. */
static void save_first(void)
{
    hold(0, DRIVE_POLICY_STAGE_HOLD);
    learn(0, &numbers);
    seconds(LEARNT_STORE_HELD_S);
}

void setUp(void)
{
    memset(memory, 0xFF, sizeof memory);
    memory_begin = SETTINGS_LEARNT_BASE;
    power_on();
    writes = 0;
}

static void expect_numbers(uint8_t spring)
{
    const spring_learnt_t back = controller_learnt(&controller, spring);
    TEST_ASSERT_EQUAL_MEMORY(&numbers, &back, sizeof back);
}

/* One second that a spring is not held in begins the minute anew. */
TEST(it_is_saved_a_minute_after_all_that_are_driven_are_held_and_no_sooner)
{
    hold(0, DRIVE_POLICY_STAGE_HOLD);
    hold(1, DRIVE_POLICY_STAGE_HEAT);
    learn(0, &numbers);
    seconds(1000);
    for (int round = 0; round < 3; round++) {
        hold(1, DRIVE_POLICY_STAGE_HOLD);
        seconds(LEARNT_STORE_HELD_S - 1u);
        hold(1, DRIVE_POLICY_STAGE_HEAT);
        seconds(1);
    }
    hold(1, DRIVE_POLICY_STAGE_HOLD);
    seconds(LEARNT_STORE_HELD_S - 1u);
    TEST_ASSERT_EQUAL_UINT(0, writes);
    seconds(1);
    TEST_ASSERT_TRUE(learnt_store_keeps(&store));
}

TEST(nothing_driven_or_nothing_learnt_writes_nothing)
{
    learn(0, &numbers);
    seconds(2000);
    TEST_ASSERT_EQUAL_UINT(0, writes);
    controller_forget_learnt(&controller, 0);
    hold(0, DRIVE_POLICY_STAGE_HOLD);
    seconds(2000);
    TEST_ASSERT_EQUAL_UINT(0, writes);
}

static unsigned saved_after(const spring_learnt_t *change)
{
    learn(0, change);
    writes = 0;
    store.refined = 0;
    seconds(LEARNT_STORE_PAUSE_S);
    return writes;
}

TEST(what_is_worth_a_save_is_saved_once_in_ten_minutes)
{
    spring_learnt_t next = numbers;
    save_first();
    TEST_ASSERT_EQUAL_UINT(0, saved_after(&numbers));
    store.refined = 0;
    next.austenite_ohm *= 1.03f;
    learn(0, &next);
    for (writes = 0; writes == 0;) {
        seconds(1);
    }
    next.austenite_ohm *= 1.03f;
    learn(0, &next);
    writes = 0;
    seconds(2u * LEARNT_STORE_PAUSE_S - 1u);
    TEST_ASSERT_EQUAL_UINT(0, writes);
    seconds(1);
    TEST_ASSERT_TRUE(writes > 0);
}

/* Learning that never settles: 7 saves in the first day, fewer in those that follow. */
TEST(what_never_settles_is_saved_ever_less_often)
{
    spring_learnt_t next = numbers;
    unsigned saves[2] = {0, 0};
    hold(0, DRIVE_POLICY_STAGE_HOLD);
    learn(0, &numbers);
    for (unsigned day = 0; day < 2u; day++) {
        for (unsigned minute = 0; minute < 24u * 60u; minute++) {
            next.austenite_ohm = minute % 2u == 0 ? 0.21f : 0.23f;
            learn(0, &next);
            writes = 0;
            for (unsigned s = 0; s < 60u; s++) {
                learnt_store_second(&store, &controller);
            }
            while (learnt_store_step(&store) == RECORD_SAVE_BUSY) {
            }
            saves[day] += writes > 0;
        }
    }
    TEST_ASSERT_LESS_OR_EQUAL_UINT(9, saves[0]);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(5, saves[0]);
    TEST_ASSERT_LESS_OR_EQUAL_UINT(3, saves[1]);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(1, saves[1]);
}

TEST(what_was_learnt_is_there_after_power_on_until_it_is_cleared)
{
    learn(8, &numbers);
    save_first();
    power_on();
    expect_numbers(0);
    expect_numbers(8);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, controller_learnt(&controller, 1).austenite_ohm);
    TEST_ASSERT_TRUE(learnt_store_keeps(&store));
    learnt_store_clear(&store, &controller);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, controller_learnt(&controller, 0).austenite_ohm);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, controller_learnt(&controller, 8).austenite_ohm);
    seconds(1);
    TEST_ASSERT_FALSE(learnt_store_keeps(&store));
    power_on();
    TEST_ASSERT_EQUAL_FLOAT(0.0f, controller_learnt(&controller, 0).austenite_ohm);
}

/* A calibration declares what was learnt beside the old numbers: it is not to count twice. */
TEST(a_loss_that_was_learnt_beside_another_model_is_left_out)
{
    controller_settings_t settings;
    controller_settings_default(&settings);
    save_first();
    settings.policy.hold_margin_cc++; /* not of the model */
    power_on_with(&settings);
    expect_numbers(0);
    settings.model.loss_scale_permille[8]++;
    power_on_with(&settings);
    const spring_learnt_t back = controller_learnt(&controller, 0);
    TEST_ASSERT_EQUAL_FLOAT(numbers.austenite_ohm, back.austenite_ohm);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, back.loss_w_per_k);
    TEST_ASSERT_EQUAL_FLOAT(controller_learnt(&controller, 1).loss_sd_w_per_k,
                            back.loss_sd_w_per_k);

    /* the record follows, though it has no other number */
    hold(0, DRIVE_POLICY_STAGE_HOLD);
    writes = 0;
    seconds(LEARNT_STORE_HELD_S);
    TEST_ASSERT_TRUE(writes > 0);
    writes = 0;
    seconds(LEARNT_STORE_PAUSE_S);
    TEST_ASSERT_EQUAL_UINT(0, writes);
}

/* What a spring gives off is seen to be far from what is declared of it then, or since: all else
 * that was learnt is as good as before. */
TEST(no_declaration_of_the_losses_costs_what_else_was_learnt)
{
    static const float declared[] = {3.0f, 0.4f, 1.0f}; /* while it is on; off: as much again */
    for (unsigned n = 0; n < 2u * ROWS(declared); n++) {
        controller_settings_t settings;
        controller_settings_default(&settings);
        const float loss_uw_per_k = settings.model.loss_uw_per_k;
        setUp();
        hold(0, DRIVE_POLICY_STAGE_HOLD);
        learn(0, &numbers);
        settings.model.loss_uw_per_k = (uint16_t)(declared[n / 2u] * loss_uw_per_k);
        TEST_ASSERT_TRUE(controller_apply_settings(&controller, &settings, NULL));
        seconds(LEARNT_STORE_HELD_S);
        writes = 0;
        seconds(2u * LEARNT_STORE_PAUSE_S); /* what was saved is not saved again */
        TEST_ASSERT_EQUAL_UINT(0, writes);
        const float believed_w_per_k = controller_learnt(&controller, 0).loss_w_per_k;
        const float most_w_per_k = 0.45e-6f * (float)settings.model.loss_uw_per_k;
        if (n % 2u != 0) {
            settings.model.loss_uw_per_k = (uint16_t)(0.3f * loss_uw_per_k);
        }
        power_on_with(&settings);
        const spring_learnt_t back = controller_learnt(&controller, 0);
        TEST_ASSERT_EQUAL_FLOAT(numbers.austenite_ohm, back.austenite_ohm);
        TEST_ASSERT_EQUAL_FLOAT(n % 2u != 0                        ? 0.0f
                                : believed_w_per_k < -most_w_per_k ? -most_w_per_k
                                : believed_w_per_k > most_w_per_k  ? most_w_per_k
                                                                   : believed_w_per_k,
                                back.loss_w_per_k);
    }
}

TEST(what_lies_at_its_limit_is_taken_back)
{
    spring_learnt_t most = numbers;
    controller_forget_learnt(&controller, 0);
    most.loss_sd_w_per_k = controller_learnt(&controller, 0).loss_sd_w_per_k;
    hold(0, DRIVE_POLICY_STAGE_HOLD);
    learn(0, &most);
    seconds(LEARNT_STORE_HELD_S);
    power_on();
    TEST_ASSERT_EQUAL_FLOAT(most.austenite_ohm, controller_learnt(&controller, 0).austenite_ohm);
}

/* The last spring counts as the first does, and what is new is worth a save at once. */
TEST(the_last_springs_first_numbers_are_saved_after_the_shortest_pause)
{
    save_first();
    TEST_ASSERT_TRUE(writes > 0);
    TEST_ASSERT_EQUAL_UINT8(0, store.refined);
    store.refined = LEARNT_STORE_LONGEST_SHIFT;
    learn(8, &numbers);
    writes = 0;
    seconds(LEARNT_STORE_PAUSE_S - 1u);
    TEST_ASSERT_EQUAL_UINT(0, writes);
    seconds(1);
    TEST_ASSERT_TRUE(writes > 0);
    TEST_ASSERT_EQUAL_UINT8(LEARNT_STORE_LONGEST_SHIFT, store.refined);
    hold(8, DRIVE_POLICY_STAGE_HEAT);
    learn(7, &numbers);
    writes = 0;
    seconds(2000);
    TEST_ASSERT_EQUAL_UINT(0, writes);
}

/* The clock of the pause stays where it ends: it would begin anew after 18 hours. */
TEST(a_day_without_a_save_puts_none_off)
{
    for (uint32_t s = 0; s < 65000u; s++) {
        learnt_store_second(&store, &controller);
    }
    save_first();
    TEST_ASSERT_TRUE(writes > 0);
}

/* Each number by itself: a little less than what is worth a save, and a little more. */
TEST(each_number_is_worth_a_save_at_its_own_limit)
{
    const float rise = 0.02f / 80.0f;
    for (int n = 0; n < 7; n++) {
        for (int more = 0; more < 2; more++) {
            const float by = more ? 1.1f : 0.9f;
            spring_learnt_t next = numbers;
            setUp();
            save_first();
            next.austenite_ohm *= n == 0 ? 1.0f - 0.02f * by : 1.0f;
            next.martensite_ohm *= n == 1 ? 1.0f + 0.02f * by : 1.0f;
            next.change += n == 2 ? 0.02f * by : 0.0f;
            next.martensite_rise_per_k += n == 3 ? rise * by : 0.0f;
            next.loss_sd_w_per_k *= n == 4 ? 0.5f / by : 1.0f;
            next.loss_w_per_k += n == 5 ? by * numbers.loss_sd_w_per_k : 0.0f;
            next.slow_noise *= n == 6 ? 1.0f + by : 1.0f;
            char which[20];
            (void)snprintf(which, sizeof which, "number %d, %s", n, more ? "more" : "less");
            TEST_ASSERT_EQUAL_MESSAGE(more, saved_after(&next) > 0, which);
        }
    }
}
