/* What it is for: what arrays of 3 x 3 to 32 x 32 springs cost: plant and chip model, time and
 * memory for each spring.
 * What it owns: the figures' definition: random drive, best of several runs on one core.
 * What it never does: judge; the figures are printed, tests assert none of these times. */
#include <malloc.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "figures.h"
#include "plant.h"
#include "thermal_model.h"

#define ROWS      301 /* of 1 s */
#define REPEATS   9
#define MOST      1024
#define SPRINGS_S 1000000.0 /* springs x simulated seconds of one run at the least */

static double time_s[ROWS], drive[ROWS * MOST];
static plant_drive_mode_t mode[MOST];

static unsigned state = 2024;
static double uniform(void)
{
    state = state * 1664525u + 1013904223u;
    return (double)(state >> 8) / 16777216.0;
}

/* Every spring gets another current, or none, every 30 s. */
static void make_log(int springs)
{
    for (int r = 0; r < ROWS; r++) {
        time_s[r] = r;
        for (int i = 0; i < springs; i++) {
            mode[i] = PLANT_DRIVE_CURRENT;
            drive[r * springs + i] =
                r % 30 ? drive[(r - 1) * springs + i] : (uniform() < 0.5 ? 0.0 : 2.4 * uniform());
        }
    }
}

static void must(plant_status_t status)
{
    if (status != PLANT_OK) {
        fprintf(stderr, "bench_scale: %s\n", plant_status_text(status));
        exit(1);
    }
}

/* Bytes of the heap that are in use. */
static double heap(void)
{
    const struct mallinfo2 now = mallinfo2();
    return (double)now.uordblks + (double)now.hblkhd;
}

/* The array with all that the chip knows; *bytes is what it takes. */
static plant_t *make_plant(int side, double *bytes)
{
    static const char *const effects[] = {"radiation",  "latent_heat",      "resistance_phase",
                                          "shared_air", "plate_conduction", "fan_wake",
                                          "edge_loss"};
    const double before = heap();
    plant_t *plant = plant_create(side, side);
    *bytes = heap() - before;
    if (!plant)
        exit(1);
    for (size_t k = 0; k < sizeof effects / sizeof effects[0]; k++)
        must(plant_set_effect(plant, effects[k], true));
    /* air and plate grow with the array */
    const double larger = side * side / 9.0;
    static const char *const common[] = {"air_heat_capacity_j_per_k", "air_exchange_w_per_k",
                                         "plate_heat_capacity_j_per_k", "plate_loss_w_per_k"};
    for (size_t k = 0; k < sizeof common / sizeof common[0]; k++) {
        double value = 0.0;
        must(plant_get(plant, common[k], &value));
        must(plant_set(plant, common[k], larger * value));
    }
    must(plant_set(plant, "second_w_per_k", 1e-4));
    return plant;
}

/* ns of processor for each spring and simulated second. */
static double plant_ns(plant_t *plant)
{
    const int springs = plant_spring_count(plant);
    const int runs = (int)ceil(SPRINGS_S / (springs * (ROWS - 1.0)));
    make_log(springs);
    const double start = figures_cpu_s();
    for (int run = 0; run < runs; run++) {
        plant_reset(plant);
        must(plant_simulate(plant, ROWS, time_s, mode, drive, NULL, NULL, NULL, NULL));
    }
    return 1e9 * (figures_cpu_s() - start) / (runs * springs * (ROWS - 1.0));
}

static double chip_ns(int side)
{
    static thermal_model_t model;
    static uint32_t power_uw[MOST];
    thermal_model_parameters_t parameters;
    if (parameter_row(PARAMETER_loss_scale).count != MOST) /* linked with a board's model */
        exit(1);
    thermal_model_parameters_default(&parameters);
    parameters.rows = parameters.columns = (uint8_t)side;
    parameters.air_exchange_uw_per_k = 250000;
    parameters.plate_coupling_uw_per_k = 1500;
    parameters.radiating_area_cmm2 = 11080;
    if (thermal_model_init(&model, &parameters, NULL) != THERMAL_MODEL_OK)
        exit(1);
    const int springs = side * side;
    const int steps = (int)ceil(SPRINGS_S * 10.0 / springs);
    thermal_model_reset(&model, 20 * 128);
    double used_s = 0.0;
    for (int done = 0; done < steps; done += 300) { /* 30 s */
        for (int i = 0; i < springs; i++)
            power_uw[i] = uniform() < 0.5 ? 0 : (uint32_t)(1.2e6 * uniform());
        const double start = figures_cpu_s();
        for (int step = 0; step < 300; step++)
            thermal_model_step(&model, power_uw);
        used_s += figures_cpu_s() - start;
    }
    return 1e9 * used_s / SPRINGS_S;
}

static void add(const char *what, int side, double value, const char *unit)
{
    char figure[100];
    (void)snprintf(figure, sizeof figure, "%s, %d x %d", what, side, side);
    figures_add(figure, value, unit, "");
}

int main(int argc, char **argv)
{
    const char *json = figures_json(argc, argv, "bench_scale");
    static const int sides[] = {3, 8, 16, 32};
    enum { SIZES = sizeof sides / sizeof sides[0] };
    double plant_cost[SIZES], chip_cost[SIZES], bytes[SIZES];
    plant_t *plant[SIZES];
    for (int s = 0; s < SIZES; s++) {
        plant[s] = make_plant(sides[s], &bytes[s]);
        bytes[s] /= sides[s] * sides[s];
        plant_cost[s] = chip_cost[s] = HUGE_VAL;
    }
    for (int k = 0; k < REPEATS;
         k++) { /* all sizes in turn: a busy machine is busy for all of them */
        for (int s = 0; s < SIZES; s++) {
            plant_cost[s] = fmin(plant_cost[s], plant_ns(plant[s]));
            chip_cost[s] = fmin(chip_cost[s], chip_ns(sides[s]));
        }
    }
    for (int s = 0; s < SIZES; s++) {
        plant_destroy(plant[s]);
        add("plant, each spring and simulated second", sides[s], plant_cost[s], "ns");
        add("chip model, each spring and simulated second", sides[s], chip_cost[s], "ns");
        add("plant's memory, each spring", sides[s], bytes[s], "bytes");
    }
    figures_add("plant: cost of a spring, 1,024 springs over 9",
                plant_cost[SIZES - 1] / plant_cost[0], "x", "<= 1.5");
    figures_add("chip model: cost of a spring, 1,024 springs over 9",
                chip_cost[SIZES - 1] / chip_cost[0], "x", "<= 1.5");
    figures_add("plant's memory of a spring, 1,024 springs over 9", bytes[SIZES - 1] / bytes[0],
                "x", "<= 1");
    figures_add("chip model's memory, each spring", (double)sizeof(thermal_model_t) / MOST, "bytes",
                "");
    return json == NULL || figures_save(json, "build/host/bench/plant/bench_scale") ? 0 : 1;
}
