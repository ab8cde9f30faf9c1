/* What it is for: what is known of each spring, and how surely: its distance to the transformation, its phase, its own
 * numbers.
 * What it owns: the readings' averages, the error of the model's temperature with its standard deviation, which phases
 * are still possible, what was learnt of each spring.
 * What it never does: choose a current, touch hardware, allocate. Floating point is used, a spring at a time. */
#ifndef SPRING_ESTIMATOR_H
#define SPRING_ESTIMATOR_H

#include <stdbool.h>
#include <stdint.h>

#include "thermal_model.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SPRING_ESTIMATOR_MAX_SPRINGS THERMAL_MODEL_MAX_SPRINGS
#define SPRING_ESTIMATOR_TURN_S      0.25f /* a spring is updated so often */

/* Phases that nothing has excluded; bits. */
enum {
    SPRING_PHASE_MARTENSITE = 1,
    SPRING_PHASE_BETWEEN = 2,
    SPRING_PHASE_AUSTENITE = 4,
    SPRING_PHASE_ANY = 7
};

/* What stays with a spring over switching off; 0 where it is not known. */
typedef struct {
    float martensite_ohm;       /* at 20 degC */
    float martensite_rise_per_k; /* of it, relative */
    float austenite_ohm;        /* when it had just transformed */
    float change;               /* from martensite to austenite, of austenite_ohm; negative where it falls */
    float extra_loss_w_per_k;   /* beyond the declared loss */
} spring_learnt_t;

typedef struct {
    /* readings since the last update */
    uint16_t current_sum_ma;
    uint16_t voltage_sum_mv;
    uint8_t readings;
    uint8_t settling; /* readings to leave out, after a jump of the current */
    uint8_t possible; /* SPRING_PHASE_ bits */
    uint8_t fresh;    /* turns with a reading since current flows, saturating */
    bool blind;       /* its resistance shows no transformation */
    bool read;        /* the last turn had a reading fit for use */
    float resistance_ohm; /* of the last turn with readings */
    float slow_ohm;   /* the same over 2 s */
    float noise;      /* standard deviation of one turn's reading, relative */
    float current_a;
    float last_c;
    /* error of the model's temperature against the transformation, and of its loss */
    float variance_k2;
    float covariance;
    float loss_variance;
    /* a heating */
    float heat_k;     /* taken up, over heat capacity */
    float mark_k;     /* where the resistance was last compared, and what it was */
    float mark_ohm;
    float onset_ohm;
    float cold_ohm;
    float cold_c;
    uint8_t steep;    /* comparisons on end that only a transformation explains */
    uint8_t flat;     /* after it: that none is needed for */
    /* a hold */
    float line_ohm;   /* what it reads while it keeps its phase, at line_c */
    float line_c;
    uint8_t quiet;    /* turns in which the temperature hardly moved */
    uint8_t losing;   /* turns on end in which phase seems to be lost */
    float lost;       /* phase lost since it had transformed, 0..1 */
    uint8_t crossings; /* of martensite start since it had transformed, saturating */
    spring_learnt_t learnt;
} spring_belief_t;

typedef struct {
    uint8_t springs;
    float heat_capacity_j_per_k;
    float loss_w_per_k;
    float martensite_ohm;
    float change; /* declared: of the austenite's resistance */
    float martensite_finish_c, martensite_start_c, austenite_start_c, austenite_finish_c;
    spring_belief_t spring[SPRING_ESTIMATOR_MAX_SPRINGS];
} spring_estimator_t;

void spring_estimator_init(spring_estimator_t *estimator, uint8_t springs);
void spring_estimator_prepare(spring_estimator_t *estimator, const thermal_model_t *model);

/* One tick's reading. */
static inline void spring_estimator_take(spring_belief_t *belief, int16_t current_ma,
                                         int16_t voltage_mv)
{
    if (belief->settling != 0) {
        belief->settling--;
    } else if (current_ma >= 0 && voltage_mv >= 0 && belief->readings < 15) {
        belief->current_sum_ma = (uint16_t)(belief->current_sum_ma + (uint16_t)current_ma);
        belief->voltage_sum_mv = (uint16_t)(belief->voltage_sum_mv + (uint16_t)voltage_mv);
        belief->readings++;
    }
}
/* The current jumps: readings on the way are left out. */
void spring_estimator_disturb(spring_estimator_t *estimator, uint8_t spring);

/* Once in a turn. */
void spring_estimator_update(spring_estimator_t *estimator, thermal_model_t *model, uint8_t spring);

/* A heating begins: what its resistance does from here on tells of the transformation. */
void spring_estimator_begin_heating(spring_estimator_t *estimator, const thermal_model_t *model, uint8_t spring);

/* It has transformed: seen, or it is hotter than that for certain. */
bool spring_estimator_has_transformed(const spring_estimator_t *estimator, const thermal_model_t *model, uint8_t spring);
/* The standard deviation of the distance to the transformation, K. */
float spring_estimator_sd_k(const spring_estimator_t *estimator, uint8_t spring);
/* Austenite, 0..1. */
float spring_estimator_phase(const spring_estimator_t *estimator, const thermal_model_t *model, uint8_t spring);
/* The resistance tells of the phase. */
bool spring_estimator_sees(const spring_estimator_t *estimator, uint8_t spring);

uint32_t spring_estimator_model_power_uw(const spring_estimator_t *estimator, const thermal_model_t *model, uint8_t spring,
                                         uint32_t power_uw);
/* The power that holds it there, beyond the model's. */
float spring_estimator_hold_w(const spring_estimator_t *estimator, const thermal_model_t *model, uint8_t spring,
                              float temperature_c);
uint16_t spring_estimator_current_ma(const spring_estimator_t *estimator, uint8_t spring, float power_w);

#ifdef __cplusplus
}
#endif
#endif
