/* What it is for: that the campaign's figures say what they claim, and that worlds differ only in
 *                 what their names say.
 * What it owns: runs whose figures are known without a controller.
 * What it never does: judge a controller: that is bench_worlds' work. */
#include <math.h>
#include <string.h>

#include <unity.h>

#include "campaign.h"
#include "run.h"
#include "score.h"

#define TICKS_PER_S 50
#define ALLOWED_S   60.0

static world_t *world;
static controller_t controller;
static controller_outputs_t outputs;
static controller_inputs_t inputs;
static score_t score;

/* The middle spring is asked for; the controller says nothing unless a test makes it. */
void setUp(void)
{
    world_parameters_t parameters;
    controller_settings_t settings;
    const bool driven[WORLD_SPRINGS_MAX] = {[4] = true};
    world_parameters_default(&parameters);
    controller_settings_default(&settings);
    memset(&outputs, 0, sizeof outputs);
    TEST_ASSERT_TRUE(controller_init(&controller, &settings, 20 * 128, NULL));
    world = world_create(&parameters);
    TEST_ASSERT_NOT_NULL(world);
    score_begin(&score, world, driven, ALLOWED_S);
}

void tearDown(void)
{
    world_destroy(world);
}

static void run_s(int spring, uint16_t duty, double seconds)
{
    outputs.duty[spring] = duty;
    for (long tick = lround(seconds * TICKS_PER_S); tick > 0; tick--) {
        world_tick(world, &outputs, &inputs);
        score_tick(&score, world, &controller);
    }
}

static void heat_to_austenite(int spring)
{
    while (world_austenite(world, spring) < 0.999 && world_time_s(world) < 100.0) {
        run_s(spring, 150, 0.1);
    }
}

static void a_spring_that_falls_silently_is_counted_beyond_20_s(void)
{
    heat_to_austenite(4);
    double reached_s = world_time_s(world);
    run_s(4, 0, 60.0);
    TEST_ASSERT_TRUE(world_austenite(world, 4) < 0.05);
    const score_spring_t *spring = &score.spring[4];
    TEST_ASSERT_TRUE(spring->reached_s < reached_s && spring->reached_s > reached_s - 5.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, spring->reached_s, spring->settled_s);
    double lost_s = spring->lost_s;
    TEST_ASSERT_TRUE(lost_s > 30.0 && lost_s < 60.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.11, lost_s - 20.0, spring->silent_s);
}

static void a_spring_that_falls_with_a_fault_is_not_silent(void)
{
    heat_to_austenite(4);
    controller_emergency_stop(&controller);
    run_s(4, 0, 90.0);
    TEST_ASSERT_TRUE(world_austenite(world, 4) < 0.05);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, score.spring[4].silent_s);
}

static void a_spring_that_is_never_heated_is_late_for_ever_and_silent_once_it_is_due(void)
{
    run_s(4, 0, 100.0);
    score_end(&score);
    TEST_ASSERT_TRUE(isinf(score.spring[4].settled_s));
    TEST_ASSERT_DOUBLE_WITHIN(0.3, 100.0 - ALLOWED_S - 20.0, score.spring[4].silent_s);
}

static void a_report_counts_from_where_it_stands_to_the_end(void)
{
    run_s(4, 0, 10.0);
    controller_emergency_stop(&controller);
    run_s(4, 0, 10.0);
    controller_clear_faults(&controller); /* withdrawn: it does not count */
    run_s(4, 0, 10.0);
    controller_emergency_stop(&controller);
    run_s(4, 0, 70.0);
    score_end(&score);
    TEST_ASSERT_DOUBLE_WITHIN(0.2, 30.0, score.spring[4].settled_s);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, score.spring[4].silent_s);
}

static void after_a_restart_it_must_be_reached_again(void)
{
    heat_to_austenite(4);
    double first_s = score.spring[4].settled_s;
    run_s(4, 0, 60.0);
    score_restart(&score, world);
    double restart_s = world_time_s(world);
    run_s(4, 0, 30.0);
    while (world_austenite(world, 4) < 0.999 && world_time_s(world) < restart_s + 100.0) {
        run_s(4, 150, 0.1);
    }
    TEST_ASSERT_TRUE(score.spring[4].settled_s > first_s);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, score.spring[4].reached_s - restart_s,
                              score.spring[4].settled_s);
}

static void an_undriven_spring_that_transforms_is_seen(void)
{
    run_s(0, 0, 1.0);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, score.spring[0].undriven_most);
    heat_to_austenite(0);
    TEST_ASSERT_TRUE(score.spring[0].undriven_most > 0.9);
    TEST_ASSERT_TRUE(score.spring[0].hottest_c > 95.0);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, score.spring[8].undriven_most);
}

/* Held below austenite start, then heated above it, again and again. */
static void reheats_are_counted_once_settled(void)
{
    heat_to_austenite(4);
    int cycles_late = 0;
    for (int cycle = 0; cycle < 20; cycle++) {
        while (world_node_c(world, 4, 1) > 83.0) {
            run_s(4, 40, 0.1);
        }
        while (world_node_c(world, 4, 1) < 92.0) {
            run_s(4, 150, 0.1);
        }
        run_s(4, 93, 30.0);
        cycles_late += world_time_s(world) - 30.0 > SCORE_SETTLED_S;
    }
    TEST_ASSERT_TRUE(cycles_late > 3);
    TEST_ASSERT_EQUAL_INT(cycles_late, score.spring[4].reheats);
    TEST_ASSERT_DOUBLE_WITHIN(0.2, world_time_s(world) - SCORE_SETTLED_S,
                              score.spring[4].settled_hold_s);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, score.spring[4].silent_s);
    double hold_c = score.spring[4].hold_c / score.spring[4].hold_s;
    TEST_ASSERT_TRUE(hold_c > 80.0 && hold_c < 95.0);
}

/* The least duty with which it takes more than that. */
static uint16_t duty_above(int spring, double current_a)
{
    uint16_t duty = 0;
    do {
        run_s(spring, ++duty, 0.1);
    } while (world_current_a(world, spring) <= current_a);
    return duty;
}

static void a_dither_across_the_limit_is_no_reheat(void)
{
    heat_to_austenite(4);
    run_s(4, 93, SCORE_SETTLED_S);
    const uint16_t duty = duty_above(4, SCORE_REHEAT_A);
    run_s(4, 0, 60.0);
    score.spring[4].reheats = 0;
    for (int sweep = 0; sweep < 10; sweep++) {
        run_s(4, duty, 0.3);
        run_s(4, (uint16_t)(duty - 20), 0.3);
    }
    TEST_ASSERT_EQUAL_INT(0, score.spring[4].reheats);
    run_s(4, (uint16_t)(duty + 20), 5.0);
    TEST_ASSERT_EQUAL_INT(1, score.spring[4].reheats);
}

/* 'declared' is what every world is drawn from. */
static void an_array_is_the_same_specimen_in_every_world(void)
{
    run_case_t declared, other;
    campaign_draw(0, 1, 7, 900.0, &declared);
    int springs_differ = 0;
    for (int w = 1; w < campaign_worlds(); w++) {
        campaign_draw(w, 1, 7, 900.0, &other);
        TEST_ASSERT_EQUAL_MEMORY(declared.on, other.on, sizeof declared.on);
        TEST_ASSERT_TRUE(declared.world.seed == other.world.seed);
        TEST_ASSERT_EQUAL_DOUBLE(declared.world.spring[3].heat_capacity_j_per_k,
                                 other.world.spring[3].heat_capacity_j_per_k);
        TEST_ASSERT_TRUE(memcmp(&declared, &other, sizeof declared) != 0);
        springs_differ +=
            memcmp(declared.world.spring, other.world.spring, sizeof declared.world.spring) != 0;
    }
    TEST_ASSERT_TRUE(springs_differ > 5);
    campaign_draw(0, 1, 8, 900.0, &other);
    TEST_ASSERT_TRUE(declared.world.spring[3].heat_capacity_j_per_k !=
                     other.world.spring[3].heat_capacity_j_per_k);
}

static void patterns_are_of_one_to_nine_springs(void)
{
    int seen[10] = {0};
    run_case_t run;
    for (int array = 0; array < 900; array++) {
        campaign_draw(0, 1, array, 900.0, &run);
        int driven = 0;
        for (int k = 0; k < 9; k++) {
            driven += run.on[k];
        }
        seen[driven]++;
    }
    TEST_ASSERT_EQUAL_INT(0, seen[0]);
    for (int n = 1; n <= 9; n++) { /* 100 each, +- 4 sigma */
        TEST_ASSERT_INT_WITHIN(38, 100, seen[n]);
    }
}

static void every_world_runs_and_tells_the_same_twice(void)
{
    run_case_t run;
    run_result_t result[2];
    for (int w = 0; w < campaign_worlds(); w++) {
        for (int i = 0; i < 2; i++) {
            campaign_draw(w, 1, 3, 30.0, &run);
            run.learnt = w % 5 == 0;
            TEST_ASSERT_TRUE_MESSAGE(run_case(&run, &result[i], NULL), campaign_name(w));
        }
        for (int k = 0; k < 9; k++) {
            TEST_ASSERT_EQUAL_DOUBLE(result[0].score.spring[k].hottest_c,
                                     result[1].score.spring[k].hottest_c);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(a_spring_that_falls_silently_is_counted_beyond_20_s);
    RUN_TEST(a_spring_that_falls_with_a_fault_is_not_silent);
    RUN_TEST(a_spring_that_is_never_heated_is_late_for_ever_and_silent_once_it_is_due);
    RUN_TEST(a_report_counts_from_where_it_stands_to_the_end);
    RUN_TEST(after_a_restart_it_must_be_reached_again);
    RUN_TEST(an_undriven_spring_that_transforms_is_seen);
    RUN_TEST(reheats_are_counted_once_settled);
    RUN_TEST(a_dither_across_the_limit_is_no_reheat);
    RUN_TEST(an_array_is_the_same_specimen_in_every_world);
    RUN_TEST(patterns_are_of_one_to_nine_springs);
    RUN_TEST(every_world_runs_and_tells_the_same_twice);
    return UNITY_END();
}
