#include <math.h>

#include "spring_estimator_internal.h"

#define PHASE_SD      0.03f /* a hundredth of holds that show no loss have lost 8 % or more */
#define PHASE_READ_SD 0.08f /* by its own resistances */

/* What the phase is told by: the best that there is. */
typedef enum { BY_MODEL, BY_LOSS, BY_RESISTANCE, BY_MARTENSITE } phase_source_t;

static phase_source_t phase_source(const spring_belief_t *b)
{
    if (b->possible == SPRING_PHASE_AUSTENITE) {
        return BY_LOSS;
    }
    if (b->possible == SPRING_PHASE_MARTENSITE || b->possible == SPRING_PHASE_ANY ||
        !spring_estimator_sees(b)) {
        return BY_MODEL;
    }
    if (b->learnt.austenite_ohm > 0.0f) {
        return BY_RESISTANCE;
    }
    return b->learnt.martensite_ohm > 0.0f ? BY_MARTENSITE : BY_MODEL;
}

/* Its own martensite's, at its temperature. */
float spring_martensite_ohm(const spring_belief_t *b, const thermal_model_t *model, uint8_t k)
{
    const spring_learnt_t *l = &b->learnt;
    return l->martensite_ohm *
           (1.0f + l->martensite_rise_per_k * (spring_now_c(model, k) - LEARNT_AT_C));
}

/* Told by its own resistances, both of which were learnt, 0..1. */
static float phase_by_resistance(const spring_belief_t *b)
{
    const spring_learnt_t *l = &b->learnt;
    return spring_clamp(1.0f - (1.0f - b->phase_ohm / l->austenite_ohm) / l->change, 0.0f, 1.0f);
}

float spring_estimator_phase(const spring_estimator_t *e, const thermal_model_t *model, uint8_t k)
{
    const spring_belief_t *b = &e->spring[k];
    const spring_learnt_t *l = &b->learnt;
    switch (phase_source(b)) {
    case BY_LOSS:
        return spring_clamp(1.0f - b->lost, 0.0f, 1.0f);
    case BY_RESISTANCE:
        return phase_by_resistance(b);
    case BY_MARTENSITE:
        return spring_clamp((1.0f - spring_martensite_ohm(b, model, k) / b->phase_ohm) / l->change,
                            0.0f, 1.0f);
    case BY_MODEL:
        break;
    }
    return (float)thermal_model_austenite(model, k) * (1.0f / 32768.0f);
}

static float phase_sd(const spring_estimator_t *e, const thermal_model_t *model, uint8_t k)
{
    const spring_belief_t *b = &e->spring[k];
    switch (phase_source(b)) {
    case BY_LOSS:
        return spring_estimator_blind(b) || b->unproven ? UNIFORM_SD : PHASE_SD;
    case BY_RESISTANCE:
        return PHASE_READ_SD + b->noise / fabsf(b->learnt.change);
    case BY_MARTENSITE:
        return LOOK_SD + b->noise / fabsf(b->learnt.change);
    case BY_MODEL:
        break;
    }
    const int16_t start_c7 = thermal_model_transformation(model, k).austenite_start_c7;
    return b->possible == SPRING_PHASE_MARTENSITE &&
                   spring_estimator_temperature_c(e, model, k).high < spring_c(start_c7)
               ? PHASE_SD
               : UNIFORM_SD;
}

spring_bounds_t spring_estimator_austenite(const spring_estimator_t *e,
                                           const thermal_model_t *model, uint8_t k)
{
    const float value = spring_estimator_phase(e, model, k);
    const spring_belief_t *b = &e->spring[k];
    if (b->possible == SPRING_PHASE_ANY) {
        return (spring_bounds_t){value, 0.0f, 1.0f};
    }
    const spring_bounds_t bounds = spring_around(value, phase_sd(e, model, k));
    return (spring_bounds_t){value, spring_clamp(bounds.low, 0.0f, 1.0f),
                             spring_clamp(bounds.high, 0.0f, 1.0f)};
}
