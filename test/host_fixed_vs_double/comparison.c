/* All but loss_rise_per_k, which the plant has not: test_thermal_model holds that. */
#include "comparison.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "plant.h"
#include "thermal_model.h"

#define SPRINGS_MAX 9
#define LIMIT_C     150.0
#define AGREED_C    0.05 /* the rms that is promised */
#define APART       0.05 /* phases that have another history */

static uint64_t random_state;

static uint32_t random_bits(void) /* splitmix64 */
{
    uint64_t z = (random_state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (uint32_t)((z ^ (z >> 31)) >> 32);
}

static uint32_t between(uint32_t least, uint32_t most)
{
    return least + (uint32_t)(((uint64_t)random_bits() * (most - least + 1u)) >> 32);
}

static bool often(void)
{
    return (random_bits() & 1u) != 0;
}

static void draw(thermal_model_parameters_t *p, bool latent)
{
    thermal_model_parameters_default(p);
    p->rows = (uint8_t)between(1, 3);
    p->columns = (uint8_t)between(1, 3);
    p->heat_capacity_mj_per_k = (uint16_t)between(150, 1500);
    p->loss_uw_per_k = (uint16_t)between(3000, 12000);
    p->loss_fan_uw_per_k = (uint16_t)(p->loss_uw_per_k * between(100, 220) / 100u);
    p->orthogonal_uw_per_k = (uint16_t)between(0, 1200);
    p->orthogonal_fan_uw_per_k = (uint16_t)between(0, 1200);
    p->diagonal_uw_per_k = (uint16_t)between(0, 600);
    p->diagonal_fan_uw_per_k = (uint16_t)between(0, 600);
    p->radiating_area_cmm2 = often() ? (uint16_t)between(100, 20000) : 0;
    p->latent_heat_mj = latent ? (uint16_t)(p->heat_capacity_mj_per_k * between(5, 50)) : 0;
    p->martensite_finish_cc = (int16_t)between(3500, 7000);
    p->martensite_start_cc = (int16_t)(p->martensite_finish_cc + (int)between(500, 2000));
    p->austenite_start_cc = (int16_t)(p->martensite_start_cc + (int)between(0, 1500));
    p->austenite_finish_cc = (int16_t)(p->austenite_start_cc + (int)between(500, 2000));
    if (often()) {
        p->air_exchange_uw_per_k = (uint32_t)between(20000, 300000);
        p->air_heat_capacity_mj_per_k = between(50, 2000);
    }
    if (often()) {
        p->plate_coupling_uw_per_k = (uint16_t)between(50, 1500);
        p->plate_heat_capacity_mj_per_k = between(5000, 200000);
        p->plate_loss_uw_per_k = (uint16_t)between(5000, 50000);
    }
    p->wake_uw_per_k = often() ? (uint16_t)between(0, p->loss_uw_per_k / 4u) : 0;
    p->wake_direction = (uint8_t)between(0, 3);
    p->fan_half_share_permille = often() ? (uint16_t)between(100, 900) : 500;
    for (int i = 0; i < p->rows * p->columns; i++) {
        p->loss_scale_permille[i] = (uint16_t)between(850, 1150);
        p->heat_capacity_scale_permille[i] = (uint16_t)between(850, 1150);
        p->transformation_shift_cc[i] = (int16_t)((int)between(0, 1600) - 800);
    }
}

/* The plant of these parameters: rows of one name mean the same in both. */
static plant_t *plant_of(const thermal_model_parameters_t *p)
{
    const struct {
        const char *effect;
        bool on;
    } effects[] = {{"latent_heat", p->latent_heat_mj != 0},
                   {"radiation", p->radiating_area_cmm2 != 0},
                   {"shared_air", p->air_exchange_uw_per_k != 0},
                   {"plate_conduction", p->plate_coupling_uw_per_k != 0},
                   {"fan_wake", p->wake_uw_per_k != 0},
                   {"fan_curve", true},
                   {"spring_mismatch", true},
                   {"transformation_shift", true}};
    plant_t *const plant = plant_create(p->rows, p->columns);
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        const parameter_row_t row = parameter_row(k);
        const int index = plant_parameter_index(row.name);
        for (int i = 0; row.part == PARAMETER_PART_MODEL && index >= 0 && i < p->rows * p->columns;
             i++) {
            const spring_index_t element = (spring_index_t)(row.count > 1 ? i : 0);
            const double value = parameter_get(p, &row, element) * pow(10.0, -row.decimals);
            const bool each = plant_parameter((size_t)index)->per_spring;
            (void)plant_set_index(plant, (size_t)index, each ? i : -1, value);
        }
    }
    (void)plant_set(plant, "emissivity", 1.0);
    (void)plant_set(plant, "surface_mm2", 1e-2 * p->radiating_area_cmm2);
    for (size_t k = 0; k < sizeof effects / sizeof effects[0]; k++) {
        (void)plant_set_effect(plant, effects[k].effect, effects[k].on);
    }
    plant_reset(plant);
    return plant;
}

comparison_t compare_fixed_with_double(uint32_t first_set, uint32_t sets, uint32_t steps,
                                       bool latent)
{
    comparison_t result = {0};
    double squares = 0.0;
    uint64_t transforming = 0;
    for (uint32_t set = first_set; set < first_set + sets; set++) {
        random_state = 20000u + set;
        thermal_model_parameters_t p;
        draw(&p, latent);
        thermal_model_t model;
        uint16_t bad = PARAMETER_COUNT;
        if (thermal_model_init(&model, &p, &bad) != THERMAL_MODEL_OK) {
            fprintf(stderr, "set %u refused: %s\n", set, parameter_row(bad).name);
            exit(1);
        }
        plant_t *const plant = plant_of(&p);
        const int n = p.rows * p.columns;
        uint32_t power_uw[SPRINGS_MAX] = {0};
        uint32_t change[SPRINGS_MAX] = {0};
        uint32_t fan_change = 0;
        bool parted[SPRINGS_MAX] = {false};
        for (uint32_t k = 0; k < steps; k++) {
            if (k == fan_change) {
                uint8_t percent = (uint8_t)(often() ? 0 : between(0, 100));
                thermal_model_set_fan(&model, percent);
                (void)plant_set_fan(plant, percent / 100.0);
                int16_t ambient_c7 = (int16_t)between(10 * 128, 30 * 128);
                thermal_model_set_ambient(&model, ambient_c7);
                (void)plant_set_ambient(plant, ambient_c7 / 128.0);
                fan_change = k + between(600, 6000);
            }
            for (int i = 0; i < n; i++) {
                if (k == change[i]) {
                    uint32_t kind = between(0, 3);
                    /* rest; or what settles between 45 and 145 degC; or, briefly, a boost */
                    uint32_t hold = p.loss_uw_per_k * between(25, 125);
                    if (kind == 0 && plant_temperature_c(plant, i) < 60.0) {
                        power_uw[i] = between(1000000, 2000000);
                        change[i] = k + 1 + between(1, p.heat_capacity_mj_per_k / 10u);
                    } else {
                        power_uw[i] = kind == 1 ? 0 : hold;
                        change[i] = k + 1 + between(20, 1200);
                    }
                }
                if (plant_temperature_c(plant, i) > LIMIT_C) {
                    power_uw[i] = 0; /* as the firmware would */
                }
                (void)plant_drive(plant, i, PLANT_DRIVE_POWER, 1e-6 * power_uw[i]);
            }
            thermal_model_step(&model, power_uw);
            if (plant_step(plant, p.step_ms / 1000.0) != PLANT_OK) {
                fprintf(stderr, "set %u: the plant refuses\n", set);
                exit(1);
            }
            for (int i = 0; i < n; i++) {
                const double truth = plant_temperature_c(plant, i);
                double error =
                    fabs(thermal_model_temperature_c7(&model, (uint8_t)i) / 128.0 - truth);
                squares += error * error;
                result.samples++;
                const double x = plant_austenite(plant, i);
                const double there = thermal_model_austenite(&model, (uint8_t)i) / 32768.0;
                transforming += x > 0.02 && x < 0.98;
                if (truth > result.highest_c) {
                    result.highest_c = truth;
                }
                parted[i] = fabs(x - there) > APART || (parted[i] && error > AGREED_C);
                if (parted[i]) {
                    result.parted++;
                    if (error > result.max_parted_c) {
                        result.max_parted_c = error;
                    }
                } else if (error > result.max_c) {
                    result.max_c = error;
                }
            }
        }
        plant_destroy(plant);
    }
    result.rms_c = sqrt(squares / (double)result.samples);
    result.transformed = (double)transforming / (double)result.samples;
    return result;
}
