/* What it is for: that the campaign's figures say what they claim, and that worlds differ only in
 *                 what their names say.
 * What it owns: runs whose figures are known without a controller.
 * What it never does: judge a controller: that is bench_worlds' work. */
#include <math.h>
#include <string.h>

#include "../run_tests.h"

#include "campaign.h"
#include "run.h"
#include "score.h"
#include "shares.h"
#include "swarm.h"

#define TICKS_PER_S  50
#define ALLOWED_S    60.0
#define SWARM_TEST_S 900.0

static world_t *world;
static controller_t controller;
static controller_outputs_t outputs;
static controller_inputs_t inputs;
static score_t score;
static losses_t losses;

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
    losses_begin(&losses, 0.0, 0.0);
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
        losses_tick(&losses, &score, world, &controller);
    }
}

static void heat_to_austenite(int spring)
{
    while (world_austenite(world, spring) < 0.999 && world_time_s(world) < 100.0) {
        run_s(spring, 150, 0.1);
    }
}

TEST(a_spring_that_falls_silently_is_counted_beyond_20_s)
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

TEST(a_spring_that_falls_with_a_fault_is_not_silent)
{
    heat_to_austenite(4);
    controller_emergency_stop(&controller);
    run_s(4, 0, 90.0);
    TEST_ASSERT_TRUE(world_austenite(world, 4) < 0.05);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, score.spring[4].silent_s);
}

TEST(a_spring_that_is_never_heated_is_late_for_ever_and_silent_once_it_is_due)
{
    run_s(4, 0, 100.0);
    score_end(&score);
    TEST_ASSERT_TRUE(isinf(score.spring[4].settled_s));
    TEST_ASSERT_DOUBLE_WITHIN(0.3, 100.0 - ALLOWED_S - 20.0, score.spring[4].silent_s);
}

TEST(a_report_counts_from_where_it_stands_to_the_end)
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

TEST(after_a_restart_it_must_be_reached_again)
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

/* As if the controller had seen it lose phase. */
static void see_loss(int spring)
{
    spring_sights_t *sights = (spring_sights_t *)controller_sights(&controller);
    spring_sights_add(sights, (uint8_t)spring)->kind = SPRING_SIGHT_LOST;
    run_s(spring, 0, 0.1);
}

TEST(lost_phase_that_is_seen_of_a_whole_spring_is_none)
{
    heat_to_austenite(4);
    run_s(4, 150, 2.0);
    see_loss(4);
    TEST_ASSERT_EQUAL_INT(1, score.spring[4].losses_seen);
    TEST_ASSERT_EQUAL_INT(1, score.spring[4].false_losses);
    run_s(4, 0, 60.0);
    TEST_ASSERT_TRUE(world_austenite(world, 4) < 0.5);
    see_loss(4);
    TEST_ASSERT_EQUAL_INT(2, score.spring[4].losses_seen);
    TEST_ASSERT_EQUAL_INT(1, score.spring[4].false_losses);
}

TEST(an_undriven_spring_that_transforms_is_seen)
{
    run_s(0, 0, 1.0);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, score.spring[0].undriven_most);
    heat_to_austenite(0);
    TEST_ASSERT_TRUE(score.spring[0].undriven_most > 0.9);
    TEST_ASSERT_TRUE(score.spring[0].hottest_c > 95.0);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, score.spring[8].undriven_most);
}

/* Held below austenite start, then heated above it, again and again. */
TEST(reheats_are_counted_once_settled)
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

TEST(a_dither_across_the_limit_is_no_reheat)
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

/* Nothing is on, nothing is typed. */
static void begin_as_declared(run_case_t *run, double seconds)
{
    memset(run, 0, sizeof *run);
    run->seconds = seconds;
    world_parameters_default(&run->world);
    controller_settings_default(&run->settings);
}

/* Each spring of one array has something else: capacity, loss and transformation as far off as is
 * tolerated; coefficients in print, whatever the change; a contact that steps or ages; a noise that
 * stays for a second. None of that is lost phase: all nine are heated for it ten times in a quarter
 * of an hour at most, on average of six noises (one run says little: 2 to 34), and lose none. */
#define NOISES 6
TEST(springs_are_within_their_bounds_and_nothing_else_is_taken_for_lost_phase)
{
    static const struct {
        double size, loss, shift_mpa, ratio, per_k[2], contact_ohm, step_ohm, age_ohm_per_s, slow_v;
    } table[] = {{1.00, 1.00, 0.0, 1.25, {0.0010, 0.0010}, 0.0, 0.0, 0.0, 0.0},
                 {0.85, 1.15, 0.0, 1.25, {0.0, 0.0014}, 0.0, 0.0, 0.0, 0.0},
                 {1.15, 0.85, 0.0, 1.25, {0.0012, 0.0}, 0.0, 0.0, 0.0, 0.0},
                 {1.00, 1.00, 40.0, 1.40, {0.0, 0.0014}, 0.0, 0.0, 0.0, 0.0},
                 {0.85, 0.85, 0.0, 0.85, {0.0, -0.0002}, 0.0, 0.0, 0.0, 0.0},
                 {1.15, 1.15, 0.0, 1.25, {0.0, 0.0}, 0.0, 0.025, 0.0, 0.0},
                 {1.00, 1.15, 0.0, 1.25, {0.0, 0.0}, 0.025, -0.025, 0.0, 0.0},
                 {1.00, 0.85, 20.0, 1.25, {0.0, 0.0}, 0.0, 0.0, 0.01 / 900.0, 0.0},
                 {1.00, 1.00, 0.0, 1.25, {0.0, 0.0}, 0.0, 0.0, 0.0, 0.001}};
    static run_case_t run;
    static run_result_t result;
    begin_as_declared(&run, 900.0);
    for (int k = 0; k < (int)ROWS(table); k++) {
        world_spring_t *spring = &run.world.spring[k];
        run.on[k] = true;
        spring->heat_capacity_j_per_k *= table[k].size;
        spring->loss_w_per_k *= table[k].loss;
        spring->stress_mpa = table[k].shift_mpa;
        spring->austenite_ohm = table[k].ratio * spring->martensite_ohm;
        spring->martensite_per_k = table[k].per_k[0];
        spring->austenite_per_k = table[k].per_k[1];
        spring->contact_ohm = table[k].contact_ohm;
        spring->sensor.slow_voltage_noise_v = table[k].slow_v;
        run.world.event[run.world.events++] =
            (world_event_t){WORLD_CONTACT_OHM, 500.0, k, table[k].contact_ohm + table[k].step_ohm};
        run.world.event[run.world.events++] =
            (world_event_t){WORLD_CONTACT_OHM_PER_S, 500.0, k, table[k].age_ohm_per_s};
    }
    double known_s = 0.0, inside_s = 0.0;
    int false_losses = 0;
    for (int n = 0; n < NOISES; n++) {
        run.world.seed = (uint64_t)n + 1u;
        TEST_ASSERT_TRUE(run_case(&run, &result, NULL));
        for (int k = 0; k < (int)ROWS(table); k++) {
            const score_spring_t *spring = &result.score.spring[k];
            here("noise %d, spring %d", n + 1, k + 1);
            TEST_ASSERT_TRUE(spring->lowest_held > SCORE_LOST);
            false_losses += spring->false_losses;
            known_s += spring->known_s;
            inside_s += spring->inside_s;
        }
    }
    here("%d false sights, within bounds %.4f", false_losses, inside_s / known_s);
    TEST_ASSERT_LESS_OR_EQUAL_INT(10 * NOISES, false_losses);
    TEST_ASSERT_TRUE(inside_s >= 0.98 * known_s && known_s > NOISES * 8000.0);
}

/* 'declared' is what every world is drawn from. */
TEST(an_array_is_the_same_specimen_in_every_world)
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

TEST(patterns_are_of_one_to_nine_springs)
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

TEST(every_world_runs_and_tells_the_same_twice)
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

/* Heated, and held above martensite start, by hand. */
static void hold_until(int spring, double until_s)
{
    while (world_time_s(world) < until_s) {
        const bool there = world_austenite(world, spring) > 0.999;
        run_s(spring, !there ? 150 : world_node_c(world, spring, 1) < 90.0 ? 120 : 60, 0.1);
    }
}

TEST(a_spring_is_lost_after_a_minute_below_90_percent_and_silent_if_nothing_is_said)
{
    hold_until(4, LOSSES_DUE_S + 20.0);
    const losses_spring_t *spring = &losses.spring[4];
    TEST_ASSERT_DOUBLE_WITHIN(0.2, 20.0, spring->judged_s);
    TEST_ASSERT_DOUBLE_WITHIN(0.2, 20.0, spring->there_s);
    while (world_austenite(world, 4) >= SCORE_LOST) {
        run_s(4, 0, 0.1);
    }
    const double fell_s = world_time_s(world);
    run_s(4, 0, LOSSES_LOST_S - 1.0);
    TEST_ASSERT_TRUE(isnan(spring->lost_at_s) && isnan(spring->silent_at_s));
    run_s(4, 0, 11.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.2, fell_s + LOSSES_LOST_S, spring->lost_at_s);
    TEST_ASSERT_DOUBLE_WITHIN(0.2, fell_s + LOSSES_LOST_S, spring->silent_at_s);
    TEST_ASSERT_DOUBLE_WITHIN(0.2, 10.0, spring->lost_s);
    TEST_ASSERT_TRUE(spring->blind_only);
    TEST_ASSERT_TRUE(isnan(losses.spring[0].lost_at_s)); /* not asked for */
}

TEST(a_spring_that_is_lost_with_a_fault_is_lost_but_not_silent)
{
    run_s(4, 0, LOSSES_DUE_S + 1.0);
    controller_emergency_stop(&controller);
    run_s(4, 0, 70.0);
    TEST_ASSERT_FALSE(isnan(losses.spring[4].lost_at_s));
    TEST_ASSERT_TRUE(isnan(losses.spring[4].silent_at_s));
    TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_EMERGENCY_STOP, losses.spring[4].fault);
}

TEST(what_is_said_for_a_moment_ends_no_silence)
{
    run_s(4, 0, LOSSES_DUE_S);
    for (int i = 0; i < 8; i++) {
        run_s(4, 0, 9.5);
        controller_emergency_stop(&controller);
        run_s(4, 0, 0.5);
        controller_clear_faults(&controller);
    }
    TEST_ASSERT_FALSE(isnan(losses.spring[4].silent_at_s));
}

/* The surroundings change at 100 s; the spring is let go of for a while, or for good. */
static losses_back_t let_go_after_a_step(double let_go_s, double again_s, double until_s)
{
    tearDown();
    setUp();
    losses_begin(&losses, 100.0, 110.0);
    hold_until(4, let_go_s);
    run_s(4, 0, again_s - let_go_s);
    hold_until(4, until_s);
    return losses.spring[4].back;
}

TEST(after_a_step_a_spring_is_back_in_two_minutes_and_stays)
{
    TEST_ASSERT_EQUAL_INT(LOSSES_BACK, let_go_after_a_step(120.0, 160.0, 360.0));
    TEST_ASSERT_EQUAL_INT(LOSSES_NOT_BACK, let_go_after_a_step(120.0, 260.0, 360.0));
    TEST_ASSERT_EQUAL_INT(LOSSES_NOT_BACK, let_go_after_a_step(300.0, 330.0, 360.0));
    TEST_ASSERT_EQUAL_INT(LOSSES_NOT_JUDGED, let_go_after_a_step(120.0, 160.0, 330.0));
    /* it was lost before */
    TEST_ASSERT_EQUAL_INT(LOSSES_NOT_JUDGED, let_go_after_a_step(40.0, 120.0, 360.0));
}

/* Wilson 1927; the table of Newcombe 1998 (method 3). */
TEST(shares_have_wilsons_interval)
{
    shares_t x = shares_wilson(81.0 / 263.0, 263.0);
    TEST_ASSERT_DOUBLE_WITHIN(5e-5, 0.2553, x.low);
    TEST_ASSERT_DOUBLE_WITHIN(5e-5, 0.3662, x.high);
    x = shares_wilson(0.0, 20.0);
    TEST_ASSERT_DOUBLE_WITHIN(5e-5, 0.0, x.low);
    TEST_ASSERT_DOUBLE_WITHIN(5e-5, 0.1611, x.high);
}

/* Eight springs that are always lost together are one. */
TEST(springs_of_a_run_that_go_together_count_for_one)
{
    enum { RUNS = 200 };
    shares_run_t together[RUNS], each[RUNS];
    for (int i = 0; i < RUNS; i++) {
        together[i] = (shares_run_t){i % 10 == 0 ? 8.0 : 0.0, 8.0};
        each[i] = (shares_run_t){i % 10 < 8 ? 1.0 : 0.0, 8.0};
    }
    const shares_t one = shares_wilson(0.1, RUNS), few = shares_share(together, RUNS);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.1, few.value);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, one.low, few.low);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, one.high, few.high);
    const shares_t many = shares_share(each, RUNS), all = shares_wilson(0.1, 8.0 * RUNS);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, all.low, many.low); /* never more than there are */
    for (int i = 0; i < RUNS; i++) {
        together[i].hits = 0.0;
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, shares_wilson(0.0, RUNS).high,
                              shares_share(together, RUNS).high);
    TEST_ASSERT_TRUE(isnan(shares_share(together, 0).value));
}

TEST(a_mean_has_its_runs_scatter)
{
    const shares_run_t run[] = {{80.0, 1.0}, {164.0, 2.0}, {84.0, 1.0}, {164.0, 2.0}};
    const shares_t x = shares_mean(run, 4);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 82.0, x.value);
    /* residuals -2, 0, 2, 0 of 6: sqrt(8 / 36 * 4 / 3) */
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 1.96 * sqrt(8.0 / 27.0), x.high - x.value);
    TEST_ASSERT_TRUE(isnan(shares_mean(run, 1).low));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 2.0 / 32.0, shares_sign_test(0, 5));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1.0, shares_sign_test(3, 3));
}

/* 900 s: what the events' times are drawn within. */
TEST(every_disturbance_is_drawn_as_often_as_is_said)
{
    enum { RUNS = 3000 };
    static swarm_case_t swarm;
    int drawn[64] = {0}, group[SWARM_GROUPS] = {0}, second = 0;
    for (int i = 0; i < RUNS; i++) {
        swarm_draw(1, i, 900.0, &swarm);
        const world_parameters_t *parameters = &swarm.run.world;
        int driven = 0;
        for (int k = 0; k < parameters->rows * parameters->columns; k++) {
            driven += swarm.run.on[k];
        }
        TEST_ASSERT_TRUE_MESSAGE(driven > 0, swarm.says);
        TEST_ASSERT_TRUE_MESSAGE(parameters->events < WORLD_EVENTS_MAX, swarm.says);
        TEST_ASSERT_TRUE(strlen(swarm.says) < SWARM_SAYS_MAX - 2);
        TEST_ASSERT_TRUE(swarm.loss_change >= -0.35 && swarm.loss_change <= 0.45);
        TEST_ASSERT_TRUE(fabs(swarm.ambient_change_k) <= 12.0);
        TEST_ASSERT_EQUAL_INT(swarm.loss_change != 0.0 || swarm.ambient_change_k != 0.0,
                              swarm.group == SWARM_SURROUNDINGS);
        TEST_ASSERT_TRUE(swarm.run.step_s == 0.0 || swarm.run.stepped_s < 700.0);
        for (int d = 0; d < 64; d++) {
            drawn[d] += (int)(swarm.drawn >> d & 1u);
        }
        group[swarm.group]++;
        second += swarm.second;
    }
    TEST_ASSERT_INT_WITHIN(110, RUNS / 3, second);
    TEST_ASSERT_INT_WITHIN(110, (int)(0.35 * RUNS), group[SWARM_SURROUNDINGS]);
    TEST_ASSERT_TRUE(group[SWARM_LOAD] > 200);
    double probability;
    int d = 0;
    for (; swarm_says(d, &probability) != NULL; d++) {
        TEST_ASSERT_TRUE_MESSAGE(drawn[d] > (int)(probability * RUNS) - 110,
                                 swarm_says(d, &probability));
        const bool more = strstr(swarm_says(d, &probability), "second truth") != NULL;
        TEST_ASSERT_TRUE(more || drawn[d] < (int)(probability * RUNS) + 110);
    }
    TEST_ASSERT_TRUE(d > 25 && d <= 64);
}

/* Levels, after what else is typed, in order of time; the board has what was asked last. */
TEST(a_user_of_levels_asks_for_some_after_the_other_patterns_and_the_reset)
{
    static swarm_case_t swarm;
    int users = 0, between = 0, firsts = 0;
    for (int i = 0; i < 500; i++) {
        swarm_draw(4, i, 900.0, &swarm);
        const run_case_t *run = &swarm.run;
        bool any = false;
        for (int n = 0; n < run->commands; n++) {
            TEST_ASSERT_TRUE(n == 0 || run->command[n].time_s > run->command[n - 1].time_s);
            for (int k = 0; k < WORLD_SPRINGS_MAX; k++) {
                const int permille = run->command[n].level_permille[k];
                TEST_ASSERT_TRUE(permille == 0 || (permille >= 150 && permille < 900));
                TEST_ASSERT_TRUE(
                    permille == 0 ||
                    (swarm.levels && (n == 0 || run->command[n].time_s > run->reset_s)));
                any = any || permille != 0;
            }
        }
        TEST_ASSERT_TRUE(run->commands <= RUN_COMMANDS_MAX);
        const bool first = run->commands == 2 && run->command[0].time_s == 0.0;
        if (first) { /* the same of all, of which then all is asked */
            TEST_ASSERT_TRUE(run->command[1].time_s >= 60.0 && run->command[1].time_s < 400.0);
            for (int k = 0; k < WORLD_SPRINGS_MAX; k++) {
                TEST_ASSERT_EQUAL(run->command[0].on[k], run->command[1].on[k]);
                TEST_ASSERT_EQUAL_UINT16(0, run->command[1].level_permille[k]);
            }
        }
        users += swarm.levels && !first;
        firsts += first;
        between += any && !first;
    }
    TEST_ASSERT_INT_WITHIN(30, 100, users);
    TEST_ASSERT_INT_WITHIN(18, 35, firsts);
    TEST_ASSERT_TRUE(between > users / 2 && between <= users);
}

/* Lowered at 30 s and raised at 320 s: it is judged from 530 s on, the other one from 210 s. */
TEST(what_is_asked_for_a_level_is_not_judged_but_for_what_is_hot)
{
    static run_case_t run;
    static run_result_t result;
    begin_as_declared(&run, 600.0);
    run.on[0] = run.on[8] = true;
    run.commands = 2;
    run.command[0] = (run_command_t){30.0, {[0] = true, [8] = true}, {[0] = 300}};
    run.command[1] = (run_command_t){320.0, {[0] = true, [8] = true}, {0}};
    TEST_ASSERT_TRUE(run_case(&run, &result, NULL));
    TEST_ASSERT_DOUBLE_WITHIN(0.3, 70.0, result.losses.spring[0].judged_s);
    TEST_ASSERT_DOUBLE_WITHIN(0.3, 390.0, result.losses.spring[8].judged_s);
    TEST_ASSERT_TRUE(result.score.spring[0].hottest_c > 90.0);
}

static double first_loss_w(world_parameters_t *parameters)
{
    for (int k = 0; k < parameters->rows * parameters->columns; k++) {
        parameters->spring[k].start_c = parameters->ambient_c + 60.0;
    }
    memset(&outputs, 0, sizeof outputs);
    tearDown();
    world = world_create(parameters);
    TEST_ASSERT_NOT_NULL(world);
    world_tick(world, &outputs, &inputs);
    return world_energy(world).lost_j * TICKS_PER_S;
}

/* By the world itself: with its events of loss at the beginning, and without. */
TEST(a_draught_changes_the_whole_loss_by_what_is_said)
{
    static swarm_case_t swarm;
    int seen = 0;
    for (int i = 0; seen < 20; i++) {
        swarm_draw(2, i, 900.0, &swarm);
        if (swarm.loss_change == 0.0 || strstr(swarm.says, "or less of it") != NULL) {
            continue;
        }
        seen++;
        world_parameters_t *parameters = &swarm.run.world;
        int kept = 0;
        for (int e = 0; e < parameters->events; e++) {
            if (parameters->event[e].kind == WORLD_LOSS_FACTOR) {
                parameters->event[kept] = parameters->event[e];
                parameters->event[kept++].time_s = 0.0;
            }
        }
        parameters->events = kept;
        const double after_w = first_loss_w(parameters);
        parameters->events = 0;
        const double change = after_w / first_loss_w(parameters) - 1.0;
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(0.03, swarm.loss_change, change, swarm.says);
    }
}

/* Springs lost in some runs. */
static int lost_springs(run_driver_t driver, double *there_s)
{
    static swarm_case_t swarm;
    static run_result_t result;
    int lost = 0;
    *there_s = 0.0;
    for (int i = 0; i < 6; i++) {
        swarm_draw(3, i, 420.0, &swarm);
        swarm.run.driver = driver;
        TEST_ASSERT_TRUE_MESSAGE(run_case(&swarm.run, &result, NULL), swarm.says);
        for (int k = 0; k < result.score.springs; k++) {
            lost += !isnan(result.losses.spring[k].lost_at_s);
            *there_s += result.losses.spring[k].there_s;
        }
    }
    return lost;
}

TEST(a_controller_that_never_heats_again_is_seen_and_a_run_is_the_same_twice)
{
    double there_s, again_s, given_up_s;
    const int lost = lost_springs(RUN_CONTROLLER, &there_s);
    TEST_ASSERT_EQUAL_INT(lost, lost_springs(RUN_CONTROLLER, &again_s));
    TEST_ASSERT_EQUAL_DOUBLE(there_s, again_s);
    TEST_ASSERT_TRUE(lost_springs(RUN_GIVES_UP, &given_up_s) > lost + 2);
    TEST_ASSERT_TRUE(given_up_s < 0.9 * there_s);
}

/* What a run asks for physics allows: no spring need be lost in it, nor be above 120 degC. */
TEST(whoever_knows_all_loses_no_spring)
{
    static swarm_case_t swarm;
    static run_result_t result;
    for (int i = 0; i < 12; i++) {
        swarm_draw(3, i, 420.0, &swarm);
        swarm.run.driver = RUN_KNOWS;
        TEST_ASSERT_TRUE_MESSAGE(run_case(&swarm.run, &result, NULL), swarm.says);
        for (int k = 0; k < result.score.springs; k++) {
            TEST_ASSERT_TRUE_MESSAGE(isnan(result.losses.spring[k].lost_at_s), swarm.says);
            TEST_ASSERT_TRUE_MESSAGE(result.score.spring[k].hottest_c <= 120.0, swarm.says);
        }
    }
}

/* Runs of the swarm, as drawn, in which springs were lost for more than a minute, in silence, or
 * were too hot. An intermediate phase whose resistance rises while it comes was followed as a
 * drift, and lost wherever a draught or a colder room took the spring further than it was believed
 * to be unsure: 29 springs. A draught, a colder room, losses that fall late in a hold: what a
 * reheat did not bring back at once stayed lost, and a spring that was hotter than believed was
 * heated to 123 degC. A draught that stays is known by the second spring that it takes: nine were
 * lost, each believed alone. What a reheat left in doubt was held without a look at what it read,
 * however plainly that said that phase went. */
TEST(what_the_swarm_lost_once_is_not_lost)
{
    static const struct {
        uint64_t seed;
        int index[5];
        int lost, silent; /* springs, at the most */
    } table[] = {{44, {30, 38, 57, 87, -1}, 4, 4},
                 {15, {470, 542, 633, 725, 713}, 0, 0},
                 {44, {24, 239, -1, -1, -1}, 2, 1},
                 {2921, {121, 505, 529, 1176, 1231}, 0, 0}};
    static swarm_case_t drawn;
    static run_result_t result;
    for (size_t n = 0; n < ROWS(table); n++) {
        int lost = 0, silent = 0;
        for (size_t r = 0; r < 5 && table[n].index[r] >= 0; r++) {
            swarm_draw(table[n].seed, table[n].index[r], SWARM_TEST_S, &drawn);
            TEST_ASSERT_TRUE(run_case(&drawn.run, &result, NULL));
            for (int k = 0; k < WORLD_SPRINGS_MAX; k++) {
                lost += !isnan(result.losses.spring[k].lost_at_s);
                silent += !isnan(result.losses.spring[k].silent_at_s);
                TEST_ASSERT_TRUE(n != 1 || result.score.spring[k].hottest_c < 120.0);
            }
        }
        TEST_ASSERT_LESS_OR_EQUAL(table[n].lost, lost);
        TEST_ASSERT_LESS_OR_EQUAL(table[n].silent, silent);
    }
}

/* Where a distance that is unsure, and a reheat that ended in doubt, counted as away, it was said
 * for 5 % of the time that the springs of these runs were there. */
TEST(a_spring_that_is_there_is_not_said_to_be_away)
{
    static swarm_case_t drawn;
    static run_result_t result;
    double away_s = 0.0, there_s = 0.0;
    for (int run = 0; run < 60; run++) {
        swarm_draw(105, run, SWARM_TEST_S, &drawn);
        TEST_ASSERT_TRUE(run_case(&drawn.run, &result, NULL));
        for (int k = 0; k < WORLD_SPRINGS_MAX; k++) {
            away_s += result.losses.spring[k].away_there_s;
            there_s += result.losses.spring[k].there_s;
        }
    }
    TEST_ASSERT_TRUE(away_s < 0.02 * there_s); /* 1.2 to 2.4 % of 240 runs of other seeds */
}

/* 4.21 V where 5 are declared: what is found of it in mid-drive was a tenth more current at once,
 * of all that were driven, and the board switched itself off for good. */
TEST(a_supply_that_is_found_in_mid_drive_is_no_fault)
{
    static swarm_case_t drawn;
    static run_result_t result;
    swarm_draw(105, 476, SWARM_TEST_S, &drawn);
    TEST_ASSERT_TRUE(run_case(&drawn.run, &result, NULL));
    for (int k = 0; k < WORLD_SPRINGS_MAX; k++) {
        TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_NONE, result.losses.spring[k].fault);
    }
}

/* Of all springs, in a world that is as declared: how hot a part of one gets until then. */
static double hottest_c_until(double until_s)
{
    double hottest_c = -300.0;
    while (world_time_s(world) < until_s) {
        world_tick(world, &outputs, &inputs);
        controller_tick(&controller, &inputs, &outputs);
        for (int k = 0; k < world_springs(world); k++) {
            hottest_c = fmax(hottest_c, world_hottest_c(world, k));
        }
    }
    return hottest_c;
}

static void ask_for(uint16_t permille)
{
    for (uint8_t k = 0; k < 9; k++) {
        TEST_ASSERT_TRUE(controller_set_target(&controller, k, k == 4 ? 0 : permille));
    }
}

/* From 60 to 15 % the crimped ends go first: the middle of each wire has what is left, and is
 * heated by all that the ends still take up. */
TEST(levels_that_are_raised_to_full_leave_no_part_too_hot_and_all_of_them_on)
{
    ask_for(600);
    (void)hottest_c_until(205.0);
    ask_for(150);
    (void)hottest_c_until(385.0);
    ask_for(1000);
    const double hottest_c = hottest_c_until(560.0);
    TEST_ASSERT_TRUE(hottest_c < 120.0);
    for (int k = 0; k < 9; k++) {
        TEST_ASSERT_TRUE(k == 4 || world_austenite(world, k) > 0.95);
    }
}

/* All springs lose three tenths less from 300 s on and are warmer than they are believed when a
 * level is asked for (144 degC: on their way down they were taken to have cooled while they still
 * read austenite, and were heated as from cold). */
TEST(a_level_that_is_asked_for_under_a_cloth_overheats_nothing)
{
    static world_parameters_t parameters;
    world_parameters_default(&parameters);
    for (int k = 0; k < 9; k++) {
        parameters.event[parameters.events++] = (world_event_t){WORLD_LOSS_FACTOR, 300.0, k, 0.7};
    }
    world_destroy(world);
    world = world_create(&parameters);
    TEST_ASSERT_NOT_NULL(world);
    ask_for(1000);
    (void)hottest_c_until(500.0);
    ask_for(700);
    TEST_ASSERT_TRUE(hottest_c_until(800.0) < 110.0);
}
