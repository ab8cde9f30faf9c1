/* What it is for: a log through the plant, read as a board reads it: each spring's v / i.
 * What it owns: the walk over rows. What it never does: add noise. */
#include <stddef.h>

#include "plant.h"

#define EXPORT __attribute__((visibility("default")))

EXPORT int plant_readings(plant_t *plant, size_t rows, const double *time_s, const double *power_w,
                          const double *fan, const double *ambient_c, double *ohm,
                          double *temperature_c);

/* power_w[rows * n] holds from its row to the next; ohm and temperature_c (rows * n) are of the
 * row's time, before its inputs act. 0 done, else the plant's status. */
int plant_readings(plant_t *plant, size_t rows, const double *time_s, const double *power_w,
                   const double *fan, const double *ambient_c, double *ohm, double *temperature_c)
{
    const int springs = plant_spring_count(plant);
    const size_t n = (size_t)springs;
    for (size_t row = 0; row < rows; row++) {
        for (int k = 0; k < springs; k++) {
            ohm[row * n + (size_t)k] = plant_terminal_ohm(plant, k);
            temperature_c[row * n + (size_t)k] = plant_temperature_c(plant, k);
        }
        if (row + 1 == rows) {
            break;
        }
        plant_status_t status = plant_set_fan(plant, fan[row]);
        if (status == PLANT_OK && ambient_c != NULL) {
            status = plant_set_ambient(plant, ambient_c[row]);
        }
        for (int k = 0; k < springs && status == PLANT_OK; k++) {
            status = plant_drive(plant, k, PLANT_DRIVE_POWER, power_w[row * n + (size_t)k]);
        }
        if (status == PLANT_OK) {
            status = plant_step(plant, time_s[row + 1] - time_s[row]);
        }
        if (status != PLANT_OK) {
            return (int)status;
        }
    }
    return 0;
}
