/* What it is for: how fast the plant runs and how far it is from the exact solution, for the full
 * nine-spring network.
 * What it owns: the figures' definition: an hour of random drive, best of several runs on one
 * core.
 * What it never does: judge; the figures are printed, tests assert none of these times. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "figures.h"
#include "plant.h"

#define SPRINGS 9
#define ROWS    3601
#define REPEATS 7

static double time_s[ROWS], drive[ROWS * SPRINGS], fan[ROWS];
static double shown_c[ROWS * SPRINGS], exact_c[ROWS * SPRINGS];
static plant_drive_mode_t mode[SPRINGS];

static unsigned state = 2024;
static double uniform(void)
{
    state = state * 1664525u + 1013904223u;
    return (double)(state >> 8) / 16777216.0;
}

static void make_log(double largest, plant_drive_mode_t how)
{
    for (int r = 0; r < ROWS; r++) {
        time_s[r] = r;
        fan[r] = (r / 600) % 2 ? 0.6 : 0.0;
        for (int i = 0; i < SPRINGS; i++) {
            mode[i] = how;
            drive[r * SPRINGS + i] = r % 30 ? drive[(r - 1) * SPRINGS + i]
                                            : (uniform() < 0.5 ? 0.0 : largest * uniform());
        }
    }
}

static void must(plant_status_t status)
{
    if (status != PLANT_OK) {
        fprintf(stderr, "bench_plant: %s\n", plant_status_text(status));
        exit(1);
    }
}

static double simulate_s(plant_t *plant, size_t rows, double *out)
{
    double best = 1e9;
    for (int k = 0; k < REPEATS; k++) {
        plant_reset(plant);
        const double start = figures_cpu_s();
        must(plant_simulate(plant, rows, time_s, mode, drive, fan, NULL, out, NULL));
        best = fmin(best, figures_cpu_s() - start);
    }
    return best;
}

static double largest_error(const plant_t *plant)
{
    plant_t *exact = plant_copy(plant);
    must(plant_set(exact, "integration_tolerance_c", 1e-9));
    plant_reset(exact);
    must(plant_simulate(exact, ROWS, time_s, mode, drive, fan, NULL, exact_c, NULL));
    plant_destroy(exact);
    double largest = 0.0;
    for (int k = 0; k < ROWS * SPRINGS; k++)
        largest = fmax(largest, fabs(shown_c[k] - exact_c[k]));
    return largest;
}

static void add(const char *what, const char *network, double value, const char *unit,
                const char *target)
{
    char figure[100];
    (void)snprintf(figure, sizeof figure, "%s, %s", what, network);
    figures_add(figure, value, unit, target);
}

int main(int argc, char **argv)
{
    const char *json = figures_json(argc, argv, "bench_plant");
    static const char *const chip_effects[] = {"radiation",  "latent_heat",      "resistance_phase",
                                               "shared_air", "plate_conduction", "fan_wake",
                                               "edge_loss"};
    static const struct {
        const char *name;
        plant_drive_mode_t mode;
        double largest;
        int effects; /* 0 none, 1 those of the chip, 2 all, 3 all with correlations */
    } cases[] = {{"declared model, power", PLANT_DRIVE_POWER, 1.0, 0},
                 {"latent heat and the chip's effects, current", PLANT_DRIVE_CURRENT, 2.4, 1},
                 {"all 14 effects, duty", PLANT_DRIVE_DUTY, 0.24, 2},
                 {"all 14 effects and correlations, duty", PLANT_DRIVE_DUTY, 0.24, 3}};
    printf("3 x 3 springs, 1 h at rows of 1 s\n");
    for (int c = 0; c < 4; c++) {
        plant_t *plant = plant_create(3, 3);
        if (!plant)
            return 1;
        if (cases[c].effects == 1)
            for (size_t k = 0; k < sizeof chip_effects / sizeof chip_effects[0]; k++)
                must(plant_set_effect(plant, chip_effects[k], true));
        if (cases[c].effects >= 2)
            for (size_t k = 0; k < plant_effect_count(); k++)
                must(plant_set_effect_index(plant, k, true));
        if (cases[c].effects == 3)
            must(plant_set(plant, "convection_correlation", 1));
        make_log(cases[c].largest, cases[c].mode);
        const double hour_s = simulate_s(plant, ROWS, shown_c);
        add("speed", cases[c].name, (ROWS - 1) / hour_s, "x real time", ">= 50000");
        add("error", cases[c].name, largest_error(plant), "degC", "<= 0.01");
        add("energy", cases[c].name,
            fabs(plant_energy_balance_j(plant)) / plant_energy_input_j(plant), "of the input",
            "<= 1e-6");
        add("1800 rows", cases[c].name, 1e3 * simulate_s(plant, 1800, shown_c), "ms", "");
        plant_destroy(plant);
    }
    return json == NULL || figures_save(json, "build/host/bench/plant/bench_plant") ? 0 : 1;
}
