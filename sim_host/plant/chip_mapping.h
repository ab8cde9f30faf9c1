/* What it is for: physical parameters and effects of a plant, as the integers of the on-chip
 * model.
 * What it owns: THE mapping from the plant's names and SI units to thermal_model_parameters_t.
 * What it never does: fit, round away what does not fit, or put a measurement effect on the chip.
 */
#ifndef CHIP_MAPPING_H
#define CHIP_MAPPING_H

#include <stddef.h>

#include "plant.h"
#include "thermal_model.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    CHIP_MAPPING_OK = 0,
    CHIP_MAPPING_ERROR_RANGE = -1, /* a parameter does not fit the chip's integer */
    CHIP_MAPPING_ERROR_MODEL =
        -2 /* the numbers fit one by one, thermal_model_init refuses them together */
} chip_mapping_status_t;

/* The plant's declared model and those effects that the chip carries as chip
 * parameters, rounded to the nearest integer. message (message_size > 0) gets one line: on failure
 * which parameter, its value and the chip's limit; on success the effects that are on and were left
 * out, and why, bands that overlap and were narrowed, or an empty text. Left out on purpose:
 * sensor_lag, sensor_gain, optical_mixing, ambient_drift (they belong to the measurement) and
 * supply_sag (the chip measures v x i). Fails if and only if a number does not fit; *parameters is
 * unchanged then. */
chip_mapping_status_t chip_mapping_from_plant(const plant_t *plant,
                                              thermal_model_parameters_t *parameters, char *message,
                                              size_t message_size);

/* The same for a board that has rows x columns of the plant's springs, from (row, column) on,
 * 0-based, rows counted on through the layers. Of the other layer it knows nothing either. It knows
 * nothing of the others, and takes them to be as warm as its own springs beside them: nothing flows
 * there. A spring that is colder than believed shows it in its resistance, one that is hotter than
 * its transformation does not. Of the array's common air and plate it has its springs' share. */
chip_mapping_status_t chip_mapping_from_part(const plant_t *plant, int row, int column, int rows,
                                             int columns, thermal_model_parameters_t *parameters,
                                             char *message, size_t message_size);

#ifdef __cplusplus
}
#endif
#endif
