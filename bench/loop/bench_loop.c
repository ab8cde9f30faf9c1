/* What it is for: how fast controller and plant run together natively, and where the time goes.
 * What it owns: the figures' definition: ten minutes of the paper's patterns, best of five.
 * What it never does: judge; the figures are printed, tests assert none of these times. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "loop.h"

#define MINUTES  10
#define TICKS    (MINUTES * 60 * 50)
#define REPEATS  5
#define MAXIMUM  8
#define TARGET_X ">= 5000"

typedef struct {
    const char *figure;
    double value;
    const char *unit;
    const char *target;
} figure_t;
static figure_t figures[MAXIMUM];
static size_t figure_count;

static void note(const char *figure, double value, const char *unit, const char *target)
{
    figures[figure_count++] = (figure_t){figure, value, unit, target};
    printf("%-66s %10.4g %-14s %s\n", figure, value, unit, target);
}

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t); /* other users of the machine do not count */
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static plant_t *make_plant(void)
{
    plant_t *plant = plant_create(3, 3);
    if (plant == NULL) {
        exit(1);
    }
    (void)plant_set_effect(plant, "latent_heat", true);
    (void)plant_set_effect(plant, "resistance_phase", true);
    return plant;
}

/* Another of the 512 patterns every 10 s: springs heat, transform, cool. */
static void command(controller_t *controller, int tick)
{
    if (tick % 500 == 0) {
        bool on[CONTROLLER_MAX_SPRINGS] = {false};
        unsigned pattern = (unsigned)tick / 500u * 73u % 512u;
        for (int k = 0; k < 9; k++) {
            on[k] = (pattern >> k & 1u) != 0;
        }
        controller_set_pattern(controller, on);
    }
}

static double run_loop_s(const controller_settings_t *settings, const plant_t *plant,
                         const loop_options_t *options)
{
    double best_s = 1e9;
    for (int repeat = 0; repeat < REPEATS; repeat++) {
        loop_t *loop = loop_create(settings, plant, options, 1, NULL);
        if (loop == NULL) {
            exit(1);
        }
        double start_s = now_s();
        for (int tick = 0; tick < TICKS; tick++) {
            command(loop_controller(loop), tick);
            loop_tick(loop);
        }
        double spent_s = now_s() - start_s;
        best_s = spent_s < best_s ? spent_s : best_s;
        loop_destroy(loop);
    }
    return best_s;
}

/* The same ticks of the controller alone: inputs are repeated from a recorded run. */
static double run_controller_s(const controller_settings_t *settings, const plant_t *plant)
{
    static controller_inputs_t recorded[500];
    loop_t *loop = loop_create(settings, plant, NULL, 1, NULL);
    if (loop == NULL) {
        exit(1);
    }
    for (int tick = 0; tick < 500; tick++) {
        command(loop_controller(loop), tick + 500);
        loop_tick(loop);
        recorded[tick] = *loop_inputs(loop);
    }
    loop_destroy(loop);
    static controller_t controller;
    static controller_outputs_t outputs;
    double best_s = 1e9;
    for (int repeat = 0; repeat < REPEATS; repeat++) {
        if (!controller_init(&controller, settings, 20 * 128, NULL)) {
            exit(1);
        }
        double start_s = now_s();
        for (int tick = 0; tick < TICKS; tick++) {
            command(&controller, tick);
            controller_tick(&controller, &recorded[tick % 500], &outputs);
        }
        double spent_s = now_s() - start_s;
        best_s = spent_s < best_s ? spent_s : best_s;
    }
    return best_s;
}

static double run_plant_s(const plant_t *plant, int ticks_per_step)
{
    double best_s = 1e9;
    for (int repeat = 0; repeat < REPEATS; repeat++) {
        plant_t *copy = plant_copy(plant);
        if (copy == NULL) {
            exit(1);
        }
        double start_s = now_s();
        for (int tick = 0; tick < TICKS; tick += ticks_per_step) {
            for (int k = 0; k < 9; k++) {
                double power_w = ((unsigned)tick / 500u * 73u >> k & 1u) != 0 ? 0.45 : 0.0;
                (void)plant_drive(copy, k, PLANT_DRIVE_POWER, power_w + 1e-3 * (tick % 7));
            }
            (void)plant_step(copy, ticks_per_step * LOOP_TICK_S);
        }
        double spent_s = now_s() - start_s;
        best_s = spent_s < best_s ? spent_s : best_s;
        plant_destroy(copy);
    }
    return best_s;
}

static int write_json(const char *path)
{
    char partial[4096];
    if (snprintf(partial, sizeof partial, "%s.part", path) >= (int)sizeof partial) {
        return 2;
    }
    FILE *file = fopen(partial, "w");
    if (file == NULL) {
        fprintf(stderr, "bench_loop: cannot write %s\n", partial);
        return 2;
    }
    fprintf(file, "[");
    for (size_t k = 0; k < figure_count; k++) {
        fprintf(file,
                "%s\n {\"figure\": \"%s\", \"value\": %.6g, \"unit\": \"%s\", \"target\": \"%s\", "
                "\"command\": \"bench_loop\"}",
                k == 0 ? "" : ",", figures[k].figure, figures[k].value, figures[k].unit,
                figures[k].target);
    }
    bool failed = fprintf(file, "\n]\n") < 0;
    failed = fclose(file) != 0 || failed;
    if (failed || rename(partial, path) != 0) {
        fprintf(stderr, "bench_loop: cannot write %s\n", path);
        (void)remove(partial);
        return 1;
    }
    return 0;
}

int main(int count, char **arguments)
{
    if (count != 1 && !(count == 3 && strcmp(arguments[1], "--json") == 0)) {
        fprintf(stderr, "usage: bench_loop [--json FILE]\n");
        return 2;
    }
    controller_settings_t settings;
    controller_settings_default(&settings);
    settings.policy.open_current_ma = 1700;
    plant_t *plant = make_plant();
    loop_options_t quiet;
    loop_options_default(&quiet);
    quiet.shunt_noise_v = quiet.bus_noise_v = 0.0;
    loop_options_t fine;
    loop_options_default(&fine);
    fine.plant_ticks = 1;

    const double simulated_s = MINUTES * 60.0;
    note("controller + plant, native, 9 springs", simulated_s / run_loop_s(&settings, plant, NULL),
         "x real time", TARGET_X);
    settings.policy.policy = DRIVE_POLICY_PRECOMPENSATE;
    note("the same, policy precompensate", simulated_s / run_loop_s(&settings, plant, NULL),
         "x real time", TARGET_X);
    settings.policy.policy = DRIVE_POLICY_OPEN;
    note("the same, sensors without noise", simulated_s / run_loop_s(&settings, plant, &quiet),
         "x real time", "");
    note("the same, plant stepped every tick", simulated_s / run_loop_s(&settings, plant, &fine),
         "x real time", "");
    note("of one tick: controller_tick", run_controller_s(&settings, plant) * 1e9 / TICKS, "ns",
         "");
    note("of one tick: plant, stepped every 5th", run_plant_s(plant, 5) * 1e9 / TICKS, "ns", "");
    note("of one tick: plant, stepped every tick", run_plant_s(plant, 1) * 1e9 / TICKS, "ns", "");
    plant_destroy(plant);
    return count == 3 ? write_json(arguments[2]) : 0;
}
