/* What it is for: what start-up and run share: thermal_model_setup.c, _flow.c, thermal_model.c.
 * What it owns: the unit of heat flow and the sizes that all of them rely on.
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

/* A refusal: the status and the row, in one value; 0 is none. */
typedef uint16_t thermal_model_refusal_t;
#define REFUSED(status, row)                                                                       \
    (thermal_model_refusal_t)((uint16_t)(row) << 8 | (uint8_t)-THERMAL_MODEL_ERROR_##status)
#define REFUSE(status, name) return REFUSED(status, PARAMETER_##name)

/* A spring's own, uJ/K. */
uint32_t thermal_model_spring_capacity(const thermal_model_parameters_t *p, spring_index_t i);

/* All flows of that spring together fit their integers and the step. */
thermal_model_refusal_t thermal_model_check_flows(const thermal_model_parameters_t *p,
                                                  spring_index_t i);

/* What the flows take from the parameters once. Returns all springs' conductance to the air, with
 * the fan or without, whichever is higher. */
uint32_t thermal_model_derive_flows(thermal_model_t *model);

/* Every conductance that depends on the fan; model->fan_percent says how fast it is. */
void thermal_model_apply_fan(thermal_model_t *model);

/* What it remembers is of other parameters, with the austenite that it had of each spring by those:
 * temperatures stay, and phases, as far as the parameters have them there. */
void thermal_model_fit_state(thermal_model_t *model, const uint16_t austenite[]);

/* All but its own heating, were the spring at that temperature and all else as it is now. */
typedef struct {
    int32_t into_spring;
    int32_t to_air;
    int32_t to_plate;
} thermal_model_flows_t;
thermal_model_flows_t thermal_model_flows_at(const thermal_model_t *model, spring_index_t i,
                                             int16_t temperature_c6);

/* What leaves one spring enters another. */
bool thermal_model_exchange_closes(const thermal_model_t *model);

#endif
