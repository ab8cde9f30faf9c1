/* What it is for: how hot a spring can be by the power it was given, whatever is believed of it.
 * What it owns: that temperature and its phase for each spring, from power and time alone.
 * What it never does: learn, follow a correction of the model, latch a fault. It uses floating
 * point, one spring at a time. */
#ifndef TEMPERATURE_CEILING_H
#define TEMPERATURE_CEILING_H

#include <stdint.h>

#include "thermal_model.h"

#ifdef __cplusplus
extern "C" {
#endif

#define TEMPERATURE_CEILING_TURN_S 0.6f /* between two steps of a spring */

typedef struct {
    float temperature_c[THERMAL_MODEL_MAX_SPRINGS];
    float austenite[THERMAL_MODEL_MAX_SPRINGS]; /* 0..1 */
} temperature_ceiling_t;

/* From here on it begins where the model is. */
void temperature_ceiling_set(temperature_ceiling_t *ceiling, const thermal_model_t *model);

/* One spring's step of TEMPERATURE_CEILING_TURN_S with the mean power of that time: the model's
 * declared numbers, but of its state only air and plate, which nothing corrects. */
void temperature_ceiling_step(temperature_ceiling_t *ceiling, const thermal_model_t *model,
                              uint8_t spring, float power_w);

/* The temperature at which it trips: a tenth more above ambient than trip_c, which an array within
 * its tolerances does not reach. */
float temperature_ceiling_trip_c(const thermal_model_t *model, float trip_c);

/* Power that the duty (steps of 800) must at least bring, whatever is read: the supply may be a
 * fifth lower than declared. */
float temperature_ceiling_power_w(const thermal_model_t *model,
                                  const current_control_parameters_t *circuit, float duty);

#ifdef __cplusplus
}
#endif
#endif
