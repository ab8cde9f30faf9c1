/* What it is for: what start-up (thermal_model_setup.c) and run (thermal_model.c) share.
 * What it owns: the unit of heat flow and the sizes that both rely on.
 * What it never does: serve anybody outside this folder. */
#ifndef THERMAL_MODEL_INTERNAL_H
#define THERMAL_MODEL_INTERNAL_H

#include "fixed_point.h"
#include "thermal_model.h"

/* Heat flows are counted in 1/64 uW: a conductance in uW/K times a difference in 1/64 K.
 * Temperatures span 255 K, so that a difference fits 16 bits and a product 32. */
#define SPAN_K       255
#define LATENT_MAX_K 80
#define NO_SPRING    THERMAL_MODEL_MAX_SPRINGS

/* Every conductance that depends on the fan; model->fan_percent says how fast it is. */
void thermal_model_apply_fan(thermal_model_t *model);

#endif
