/* What it is for: how fast controller and plant run together natively, and where the time goes.
 * What it owns: the figures' definition: ten minutes of the paper's patterns, best of five.
 * What it never does: judge; the figures are printed, tests assert none of these times. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "figures.h"
#include "loop.h"

#define MINUTES  10
#define TICKS    (MINUTES * 60 * 50)
#define REPEATS  5
#define TARGET_X ">= 5000"

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
        double start_s = figures_cpu_s();
        for (int tick = 0; tick < TICKS; tick++) {
            command(loop_controller(loop), tick);
            loop_tick(loop);
        }
        double spent_s = figures_cpu_s() - start_s;
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
        double start_s = figures_cpu_s();
        for (int tick = 0; tick < TICKS; tick++) {
            command(&controller, tick);
            controller_tick(&controller, &recorded[tick % 500], &outputs);
        }
        double spent_s = figures_cpu_s() - start_s;
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
        double start_s = figures_cpu_s();
        for (int tick = 0; tick < TICKS; tick += ticks_per_step) {
            for (int k = 0; k < 9; k++) {
                double power_w = ((unsigned)tick / 500u * 73u >> k & 1u) != 0 ? 0.45 : 0.0;
                (void)plant_drive(copy, k, PLANT_DRIVE_POWER, power_w + 1e-3 * (tick % 7));
            }
            (void)plant_step(copy, ticks_per_step * LOOP_TICK_S);
        }
        double spent_s = figures_cpu_s() - start_s;
        best_s = spent_s < best_s ? spent_s : best_s;
        plant_destroy(copy);
    }
    return best_s;
}

int main(int count, char **arguments)
{
    if (count != 1 && !(count == 3 && strcmp(arguments[1], "--json") == 0)) {
        fprintf(stderr, "usage: bench_loop [--json FILE]\n");
        return 2;
    }
    controller_settings_t settings;
    controller_settings_default(&settings);
    settings.policy.policy = DRIVE_POLICY_OPEN;
    settings.policy.open_current_ma = 1700;
    plant_t *plant = make_plant();
    loop_options_t quiet;
    loop_options_default(&quiet);
    quiet.shunt_noise_v = quiet.bus_noise_v = 0.0;
    loop_options_t fine;
    loop_options_default(&fine);
    fine.plant_ticks = 1;

    const double simulated_s = MINUTES * 60.0;
    figures_add("controller + plant, native, 9 springs",
                simulated_s / run_loop_s(&settings, plant, NULL), "x real time", TARGET_X);
    settings.policy.policy = DRIVE_POLICY_PRECOMPENSATE;
    figures_add("the same, policy precompensate", simulated_s / run_loop_s(&settings, plant, NULL),
                "x real time", TARGET_X);
    settings.policy.policy = DRIVE_POLICY_OPEN;
    figures_add("the same, sensors without noise",
                simulated_s / run_loop_s(&settings, plant, &quiet), "x real time", "");
    figures_add("the same, plant stepped every tick",
                simulated_s / run_loop_s(&settings, plant, &fine), "x real time", "");
    figures_add("of one tick: controller_tick", run_controller_s(&settings, plant) * 1e9 / TICKS,
                "ns", "");
    figures_add("of one tick: plant, stepped every 5th", run_plant_s(plant, 5) * 1e9 / TICKS, "ns",
                "");
    figures_add("of one tick: plant, stepped every tick", run_plant_s(plant, 1) * 1e9 / TICKS, "ns",
                "");
    plant_destroy(plant);
    return count == 1 || figures_save(arguments[2], "build/host/bench/loop/bench_loop") ? 0 : 1;
}
