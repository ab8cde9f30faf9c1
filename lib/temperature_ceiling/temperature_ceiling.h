/* What it is for: how hot a spring can be by the power it was given, whatever is believed of it.
 * What it owns: that temperature and its phase for each spring, from power and time alone.
 * What it never does: learn, follow a correction of the model, latch a fault. It uses floating
 * point, one spring at a time. */
#ifndef TEMPERATURE_CEILING_H
#define TEMPERATURE_CEILING_H

#include <stdbool.h>
#include <stdint.h>

#include "thermal_model.h"

#ifdef __cplusplus
extern "C" {
#endif

#define TEMPERATURE_CEILING_TURN_S 0.6f /* between two steps of a spring */

typedef struct {
    int32_t temperature_c23[THERMAL_MODEL_MAX_SPRINGS]; /* Q9.23 degC */
    float austenite[THERMAL_MODEL_MAX_SPRINGS];         /* 0..1 */
    float v_per_step;                                   /* of duty */
    float drop_v;                                       /* of the freewheeling diode */
    float w_per_v2; /* least power of a spring, by the voltage behind its switch */
} temperature_ceiling_t;

/* From here on it begins where the model is. */
void temperature_ceiling_set(temperature_ceiling_t *ceiling, const thermal_model_t *model);

/* One spring's step of TEMPERATURE_CEILING_TURN_S with the mean power of that time: the model's
 * declared numbers, but of its state only air and plate, which nothing corrects. */
void temperature_ceiling_step(temperature_ceiling_t *ceiling, const thermal_model_t *model,
                              uint8_t spring, float power_w);

/* degC. */
float temperature_ceiling_c(const temperature_ceiling_t *ceiling, uint8_t spring);

/* Its rise above ambient is a ninth more than that of trip_cc (0.01 degC), which an array within
 * its tolerances does not reach; or as hot as it can be. */
bool temperature_ceiling_trips(const temperature_ceiling_t *ceiling, const thermal_model_t *model,
                               uint8_t spring, int16_t trip_cc);

/* Takes what it needs of the settings; where it is stays. */
void temperature_ceiling_prepare(temperature_ceiling_t *ceiling, const thermal_model_t *model,
                                 const current_control_parameters_t *circuit);

/* Power, W, that the duty (steps of 800) must at least bring, whatever is read: the supply may be a
 * fifth lower than declared. */
float temperature_ceiling_power_w(const temperature_ceiling_t *ceiling, float duty);

#ifdef __cplusplus
}
#endif
#endif
