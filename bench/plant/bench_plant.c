/* What it is for: how fast the plant runs and how far it is from the exact solution, for the full
 * nine-spring network.
 * What it owns: the figures' definition: an hour of random drive, best of several runs on one
 * core.
 * What it never does: judge; the figures are printed, tests assert none of these times. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "plant.h"

#define SPRINGS 9
#define ROWS    3601
#define REPEATS 7

static double time_s[ROWS], drive[ROWS * SPRINGS], fan[ROWS];
static double shown_c[ROWS * SPRINGS], exact_c[ROWS * SPRINGS];
static plant_drive_mode_t mode[SPRINGS];

typedef struct {
    const char *figure;
    double value;
    const char *unit;
    const char *target;
} figure_t;
static figure_t figures[32];
static size_t figure_count;

static void note(const char *figure, double value, const char *unit, const char *target)
{
    figures[figure_count++] = (figure_t){figure, value, unit, target};
    printf("%-58s %12.4g %-12s %s\n", figure, value, unit, target);
}

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t); /* other users of the machine do not count */
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

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
        const double start = now_s();
        must(plant_simulate(plant, rows, time_s, mode, drive, fan, NULL, out, NULL));
        best = fmin(best, now_s() - start);
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

static const char *save(const char *name)
{
    char unfinished[4096];
    if (snprintf(unfinished, sizeof unfinished, "%s.part", name) >= (int)sizeof unfinished)
        return "name too long";
    FILE *file = fopen(unfinished, "w");
    if (!file)
        return "cannot be written";
    fputs("[\n", file);
    for (size_t k = 0; k < figure_count; k++)
        fprintf(file,
                "  {\"figure\": \"%s\", \"value\": %.6g, \"unit\": \"%s\", \"target\": \"%s\", "
                "\"command\": \"bench_plant\"}%s\n",
                figures[k].figure, figures[k].value, figures[k].unit, figures[k].target,
                k + 1 < figure_count ? "," : "");
    fputs("]\n", file);
    if (ferror(file) | fclose(file) || rename(unfinished, name) != 0) {
        remove(unfinished);
        return "cannot be written";
    }
    return NULL;
}

int main(int argc, char **argv)
{
    const char *json = NULL;
    if (argc == 3 && strcmp(argv[1], "--json") == 0) {
        json = argv[2];
    } else if (argc != 1) {
        const int help = argc == 2 && strcmp(argv[1], "--help") == 0;
        fputs("usage: bench_plant [--json FILE]\n", help ? stdout : stderr);
        return help ? 0 : 2;
    }
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
    static char names[4][4][80];
    printf("%-58s %12s %-12s %s\n", "figure (3 x 3 springs, 1 h at rows of 1 s)", "value", "unit",
           "target");
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
        static const char *const what[4] = {"speed", "error", "1800 rows", "energy"};
        for (int k = 0; k < 4; k++)
            snprintf(names[c][k], sizeof names[c][k], "%s, %s", what[k], cases[c].name);
        note(names[c][0], (ROWS - 1) / hour_s, "x real time", ">= 50000");
        note(names[c][1], largest_error(plant), "degC", "<= 0.01");
        note(names[c][3], fabs(plant_energy_balance_j(plant)) / plant_energy_input_j(plant),
             "of the input", "<= 1e-6");
        note(names[c][2], 1e3 * simulate_s(plant, 1800, shown_c), "ms", "2");
        plant_destroy(plant);
    }
    const char *wrong = json ? save(json) : NULL;
    if (wrong) {
        fprintf(stderr, "bench_plant: %s: %s\n", json, wrong);
        return 1;
    }
    return 0;
}
