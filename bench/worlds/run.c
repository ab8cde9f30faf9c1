#include "run.h"

#include <math.h>
#include <string.h>
#include <time.h>

#include "knowing.h"

#define TICKS_PER_S   50
#define LEARNING_S    300.0
#define FIRST_START_S 180.0 /* what one to eight springs may take; nine share the supply */
#define LATER_START_S 90.0
#define NINE_MORE_S   30.0
#define TRACE_TICKS   10   /* 0.2 s */
#define WARM_K        5.0  /* left of what the board had given as its power went */
#define GIVES_UP_S    30.0 /* after it was reached: the heating itself is over */

typedef struct {
    const run_case_t *run;
    world_t *world;
    controller_t controller;
    controller_inputs_t inputs;
    controller_outputs_t outputs;
    belief_memory_t memory;
    uint16_t level_permille[WORLD_SPRINGS_MAX]; /* what is asked for now */
    knowing_t knowing;
} bench_t;

static double thread_s(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void ask(bench_t *bench, int k, bool on, uint16_t level_permille)
{
    bench->level_permille[k] = !on ? 0 : level_permille != 0 ? level_permille : 1000;
}

/* The board's power comes on, and the README's two words are typed. */
static bool power_on(bench_t *bench)
{
    controller_settings_t settings = bench->run->settings;
    settings.model.rows = (uint8_t)bench->run->world.rows;
    settings.model.columns = (uint8_t)bench->run->world.columns;
    int16_t ambient_c7 = (int16_t)lround(bench->run->world.ambient_setting_c * 128.0);
    if (!controller_init(&bench->controller, &settings, ambient_c7, NULL)) {
        return false;
    }
    belief_restore(&bench->controller, &bench->memory);
    for (int k = 0; k < world_springs(bench->world); k++) { /* as lib/warm_mark has it */
        if (world_mean_c(bench->world, k) > bench->run->world.ambient_c + WARM_K) {
            controller_doubt_cold(&bench->controller);
        }
    }
    controller_set_pattern(&bench->controller, bench->run->on);
    for (int k = 0; k < world_springs(bench->world); k++) {
        ask(bench, k, bench->run->on[k], 0);
    }
    (void)controller_set_fan(&bench->controller, bench->run->fan_percent);
    return controller_set_policy(&bench->controller, DRIVE_POLICY_PRECOMPENSATE);
}

static void trace_head(FILE *trace, int springs)
{
    (void)fprintf(trace, "time_s,loss_factor,ambient_c");
    for (int k = 1; k <= springs; k++) {
        (void)fprintf(trace,
                      ",duty%d,i%d_a,v%d_v,read%d_ma,read%d_mv,end%d_c,middle%d_c,t%d_c,a%d,ms%d_c,"
                      "ohm%d,draught%d,stage%d,believed%d_c,low%d_c,high%d_c,believed_a%d,low_a%d,"
                      "high_a%d,target%d_ma,"
                      "limits%d,fault%d",
                      k, k, k, k, k, k, k, k, k, k, k, k, k, k, k, k, k, k, k, k, k, k);
    }
    (void)fputc('\n', trace);
}

static void trace_row(const bench_t *bench, FILE *trace)
{
    const world_t *world = bench->world;
    const controller_t *controller = &bench->controller;
    (void)fprintf(trace, "%.2f,%.3f,%.2f", world_time_s(world), world_loss_factor(world),
                  world_ambient_c(world));
    for (int k = 0; k < world_springs(world); k++) {
        belief_bounds_t c = belief_temperature_bounds_c(controller, k);
        belief_bounds_t phase = belief_austenite_bounds(controller, k);
        (void)fprintf(trace, ",%u,%.4f,%.4f,%d,%d,%.2f,%.2f,%.2f,%.4f,%.2f,%.5f,%.3f,%d",
                      bench->outputs.duty[k], world_current_a(world, k), world_voltage_v(world, k),
                      bench->inputs.sensor[k].current_ma, bench->inputs.sensor[k].voltage_mv,
                      world_node_c(world, k, 0), world_node_c(world, k, 1), world_mean_c(world, k),
                      world_austenite(world, k), world_martensite_start_c(world, k),
                      world_resistance_ohm(world, k), world_spring_loss_factor(world, k),
                      (int)controller_stage(controller, (uint8_t)k));
        (void)fprintf(
            trace, ",%.2f,%.2f,%.2f,%.4f,%.4f,%.4f,%u,%u,%d", belief_temperature_c(controller, k),
            c.low, c.high, belief_austenite(controller, k), phase.low, phase.high,
            controller_target_ma(controller, (uint8_t)k), controller_limits(controller, (uint8_t)k),
            (int)controller_fault(controller, (uint8_t)k));
    }
    (void)fputc('\n', trace);
}

/* A run of its own, in which nothing happens, then everything has cooled. */
static bool learn(bench_t *bench)
{
    world_parameters_t quiet = bench->run->world;
    quiet.events = 0;
    for (int k = 0; k < quiet.rows * quiet.columns; k++) {
        quiet.spring[k].start_c = quiet.ambient_c;
        quiet.spring[k].was_austenite = false;
    }
    bench->world = world_create(&quiet);
    if (bench->world == NULL || !power_on(bench)) {
        world_destroy(bench->world);
        return false;
    }
    for (long tick = 0; tick < lround(LEARNING_S * TICKS_PER_S); tick++) {
        world_tick(bench->world, &bench->outputs, &bench->inputs);
        controller_tick(&bench->controller, &bench->inputs, &bench->outputs);
    }
    belief_keep(&bench->controller, &bench->memory);
    world_destroy(bench->world);
    memset(&bench->outputs, 0, sizeof bench->outputs);
    return true;
}

/* Types what is due. What is asked for a level is not judged as driven. */
static void type(bench_t *bench, score_t *score, int *typed)
{
    const run_case_t *run = bench->run;
    while (*typed < run->commands && run->command[*typed].time_s <= world_time_s(bench->world)) {
        const run_command_t *command = &run->command[(*typed)++];
        for (int k = 0; k < world_springs(bench->world); k++) {
            score_ask(score, bench->world, k, command->on[k] && command->level_permille[k] == 0);
        }
        controller_set_pattern(&bench->controller, command->on);
        for (int k = 0; k < world_springs(bench->world); k++) {
            ask(bench, k, command->on[k], command->level_permille[k]);
            if (command->on[k] && command->level_permille[k] != 0) {
                (void)controller_set_target(&bench->controller, (uint8_t)k,
                                            command->level_permille[k]);
            }
        }
    }
}

static void give_up(bench_t *bench, const score_t *score)
{
    for (int k = 0; k < score->springs; k++) {
        if (!isnan(score->spring[k].reached_s) &&
            world_time_s(bench->world) - score->spring[k].reached_s > GIVES_UP_S &&
            controller_stage(&bench->controller, (uint8_t)k) == DRIVE_POLICY_STAGE_HEAT) {
            (void)controller_set_target(&bench->controller, (uint8_t)k, 0);
        }
    }
}

static bool drive(bench_t *bench, run_result_t *result, FILE *trace)
{
    score_t *score = &result->score;
    int typed = 0;
    const run_case_t *run = bench->run;
    long ticks = lround(run->seconds * TICKS_PER_S);
    long off = run->reset_s > 0.0 ? lround(run->reset_s * TICKS_PER_S) : ticks;
    long on_again = off + lround(run->reset_gap_s * TICKS_PER_S);
    for (long tick = 0; tick < ticks; tick++) {
        world_tick(bench->world, &bench->outputs, &bench->inputs);
        if (tick == off) {
            belief_keep(&bench->controller, &bench->memory);
            memset(&bench->outputs, 0, sizeof bench->outputs);
        } else if (tick == on_again) {
            score_restart(score, bench->world);
            if (!power_on(bench)) {
                return false;
            }
        }
        bool powered = tick < off || tick >= on_again;
        if (powered) {
            type(bench, score, &typed);
            controller_tick(&bench->controller, &bench->inputs, &bench->outputs);
            if (run->driver == RUN_GIVES_UP) {
                give_up(bench, score);
            } else if (run->driver == RUN_KNOWS) {
                knowing_drive(&bench->knowing, &run->world, bench->world, bench->level_permille,
                              bench->outputs.duty);
            }
        }
        score_tick(score, bench->world, powered ? &bench->controller : NULL);
        losses_tick(&result->losses, score, bench->world, powered ? &bench->controller : NULL);
        if (trace != NULL && tick % TRACE_TICKS == 0) {
            trace_row(bench, trace);
        }
    }
    score_end(score);
    return true;
}

bool run_case(const run_case_t *run, run_result_t *result, FILE *trace)
{
    double begin_s = thread_s();
    bench_t bench = {.run = run};
    if (run->learnt && !learn(&bench)) {
        return false;
    }
    bench.world = world_create(&run->world);
    if (bench.world == NULL || !power_on(&bench)) {
        world_destroy(bench.world);
        return false;
    }
    int springs = world_springs(bench.world), driven = 0;
    for (int k = 0; k < springs; k++) {
        driven += run->on[k];
    }
    score_begin(&result->score, bench.world, run->on,
                (run->learnt ? LATER_START_S : FIRST_START_S) + (driven > 8 ? NINE_MORE_S : 0.0));
    losses_begin(&result->losses, run->step_s, run->stepped_s);
    if (trace != NULL) {
        trace_head(trace, springs);
    }
    bool done = drive(&bench, result, trace);
    world_destroy(bench.world);
    result->wall_s = thread_s() - begin_s;
    return done;
}
