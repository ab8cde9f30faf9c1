/* What it is for: one plant of 3 x 3 springs and short words for what tests do with it.
 * What it owns: the plant of the running test, and a random log.
 * What it never does: know an equation of the plant. */
#ifndef PLANT_RIG_H
#define PLANT_RIG_H

#include "../run_tests.h"
#include <math.h>
#include <string.h>

#include "plant.h"

static plant_t *plant;

void setUp(void)
{
    plant = plant_create(3, 3);
}
void tearDown(void)
{
    plant_destroy(plant);
}

#define OK(call) TEST_ASSERT_EQUAL_INT(PLANT_OK, (call))

static inline void set(const char *name, double value)
{
    OK(plant_set(plant, name, value));
}
static inline double get(const char *name)
{
    double value;
    OK(plant_get(plant, name, &value));
    return value;
}
static inline void on(const char *effect)
{
    OK(plant_set_effect(plant, effect, true));
}
static inline double at(int spring)
{
    return plant_temperature_c(plant, spring);
}
static inline void drive(int spring, plant_drive_mode_t mode, double quantity)
{
    OK(plant_drive(plant, spring, mode, quantity));
}
static inline void hold(int spring, double t)
{
    drive(spring, PLANT_DRIVE_TEMPERATURE, t);
}
static inline void settle(void)
{
    OK(plant_settle(plant, 1e6));
}
static inline void uncouple(void)
{
    set("orthogonal_w_per_k", 0);
    set("orthogonal_fan_w_per_k", 0);
    set("diagonal_w_per_k", 0);
    set("diagonal_fan_w_per_k", 0);
}

static unsigned random_state;
static inline double uniform(void) /* the same numbers everywhere */
{
    random_state = random_state * 1664525u + 1013904223u;
    return (double)(random_state >> 8) / 16777216.0;
}

#define LOG_ROWS 600
static double log_time[LOG_ROWS], log_drive[LOG_ROWS * 9], log_fan[LOG_ROWS], log_ambient[LOG_ROWS];
static double shown[2][LOG_ROWS * 9], real[2][LOG_ROWS * 9];
static plant_drive_mode_t log_mode[9];

static inline void make_log(plant_drive_mode_t mode, double largest, unsigned seed)
{
    random_state = seed;
    for (int r = 0; r < LOG_ROWS; r++) {
        log_time[r] = r;
        log_fan[r] = r < 300 ? 0.0 : 0.7;
        log_ambient[r] = 20.0;
        for (int i = 0; i < 9; i++)
            log_drive[r * 9 + i] =
                r % 40 ? log_drive[(r - 1) * 9 + i] : (uniform() < 0.4 ? 0.0 : largest * uniform());
    }
    for (int i = 0; i < 9; i++)
        log_mode[i] = mode;
}

static inline void run_log(int k)
{
    plant_reset(plant);
    OK(plant_simulate(plant, LOG_ROWS, log_time, log_mode, log_drive, log_fan, log_ambient,
                      shown[k], real[k]));
}

#endif
