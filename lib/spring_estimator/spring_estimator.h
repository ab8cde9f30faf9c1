/* What it is for: what is known of each spring, and how surely: its distance to the transformation,
 * its phase, its own numbers (docs/believing.md).
 * What it owns: the average of its readings, the error of the model's temperature with its standard
 * deviation, the phases that nothing has excluded, what was learnt of this very spring.
 * What it never does: choose a current, touch hardware, allocate. It uses floating point, one spring
 * at a time. */
#ifndef SPRING_ESTIMATOR_H
#define SPRING_ESTIMATOR_H

#include <stdbool.h>
#include <stdint.h>

#include "thermal_model.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SPRING_ESTIMATOR_MAX_SPRINGS THERMAL_MODEL_MAX_SPRINGS
#define SPRING_ESTIMATOR_TURN_S      0.25f /* between two updates of a spring */

/* Phases that nothing has excluded; bits. */
enum {
    SPRING_PHASE_MARTENSITE = 1,
    SPRING_PHASE_BETWEEN = 2,
    SPRING_PHASE_AUSTENITE = 4,
    SPRING_PHASE_ANY = 7
};

/* A spring's own numbers, kept over power-off; austenite_ohm 0: nothing is learnt yet. */
typedef struct {
    float austenite_ohm;         /* when it had just transformed */
    float change;                /* from martensite to austenite, of austenite_ohm; below 0 where it falls */
    float martensite_ohm;        /* at 20 degC; 0: it was never seen from cold */
    float martensite_rise_per_k; /* of that, relative */
    float loss_w_per_k;          /* beyond the declared one */
    float loss_sd_w_per_k;
} spring_learnt_t;

/* What is believed of one spring. To be read by anyone, written by this module alone. */
typedef struct {
    /* The transformation lies where the model has it, give or take the error: temperatures are
     * degC on the declared scale; shift_k is what is believed to be the transformation's own. */
    float shift_k;
    float variance_k2; /* of the distance to the transformation */
    float capacity_k;  /* standard deviation of that, by the heat capacity alone; signed */
    float shift_variance_k2;
    float loss_variance;
    float covariance;      /* of distance and loss, W */
    float stiffness_w_per_k; /* what 1 K more of this spring gives off */
    float disturbance_k;   /* how far it was found from where it was believed, lately */
    uint8_t possible;      /* SPRING_PHASE_ bits */
    bool reads;            /* the last turn had readings fit for use */
    bool blind;            /* a heating that must have transformed it did not show in its resistance */
    bool onset;            /* this heating was seen to begin to transform it */
    uint8_t fresh;         /* turns with readings since current flows, saturating */
    uint8_t quiet;         /* turns in which its temperature hardly moved, saturating */
    uint8_t losing;        /* turns on end in which it seems to lose phase */
    uint8_t crossings;     /* of martensite start since it had transformed, saturating */
    float lost;            /* phase lost since it had transformed, 0..1 */
    spring_learnt_t learnt;

    /* the running turn's readings */
    uint8_t readings;
    uint8_t settling; /* to be left out, after a jump of the current */
    uint16_t current_sum_ma;
    uint16_t voltage_sum_mv;
    float current_a; /* of the last turn that had readings */
    float ohm;
    float ohm_before[2]; /* one and two turns earlier */
    float slow_ohm;      /* over 2 s */
    float noise;         /* standard deviation of one turn's, relative */
    float last_c;        /* the model's temperature a turn ago */
    /* the running heating */
    float heat_k;   /* taken up, over heat capacity */
    float mark_k;   /* where the resistance was last compared, and what it was */
    float mark_ohm; /* 0: nowhere yet */
    float onset_ohm;
    float cold_ohm; /* at its beginning */
    float cold_c;
    float excess; /* change that no temperature coefficient explains; signed */
    float flat_k; /* heat since, without such a change */
    bool steep;   /* it changed so when it was last compared */
    /* the running hold */
    float full_ohm; /* at its beginning, fully on */
    float full_c;
    float line_ohm; /* what it reads while it keeps its phase, at line_c; 0: none yet */
    float line_c;
} spring_belief_t;

typedef struct {
    uint8_t springs;
    float heat_capacity_j_per_k;
    float loss_w_per_k;
    float martensite_ohm;
    float change; /* declared, as in spring_learnt_t */
    float martensite_finish_c, martensite_start_c, austenite_start_c, austenite_finish_c;
    spring_belief_t spring[SPRING_ESTIMATOR_MAX_SPRINGS];
} spring_estimator_t;

typedef struct {
    float value, low, high;
} spring_bounds_t;

/* Nothing is known of any spring: any phase, between the model's ambient and hottest_c. The
 * model's temperatures are set to the middle. Divides. */
void spring_estimator_init(spring_estimator_t *estimator, thermal_model_t *model, float hottest_c);
/* After the model's parameters have changed. What is believed stays. */
void spring_estimator_prepare(spring_estimator_t *estimator, const thermal_model_t *model);
/* They are all at ambient, martensite: a hint. */
void spring_estimator_cold(spring_estimator_t *estimator, thermal_model_t *model);
/* What was learnt before; a change of 0 is nothing. */
void spring_estimator_restore(spring_estimator_t *estimator, uint8_t spring,
                              const spring_learnt_t *learnt);

/* One tick's reading of one spring, in range; negative ones are left out. Inline: every tick takes
 * nine. */
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
void spring_estimator_disturb(spring_belief_t *belief);

/* Once in a turn: takes the readings, moves the model's temperature and phase to what they say. */
void spring_estimator_update(spring_estimator_t *estimator, thermal_model_t *model, uint8_t spring);

/* A heating begins: what the resistance does from here on tells of the transformation. */
void spring_estimator_begin_heating(spring_belief_t *belief);
/* The heating has fully transformed it: seen, or as hot as it takes whatever it reads. Then a hold
 * begins. */
bool spring_estimator_has_transformed(const spring_estimator_t *estimator,
                                      const thermal_model_t *model, uint8_t spring);
void spring_estimator_begin_hold(spring_estimator_t *estimator, thermal_model_t *model,
                                 uint8_t spring, bool full);

/* Colder than martensite finish for certain: martensite, whatever it was. */
bool spring_estimator_is_cold(const spring_belief_t *belief);
/* Its resistance tells the phase. */
bool spring_estimator_sees(const spring_belief_t *belief);
float spring_estimator_sd_k(const spring_belief_t *belief);

/* With the bounds of 99 %. Temperature in degC, as it is (with the shift); distance to martensite
 * start in K; austenite 0..1. */
spring_bounds_t spring_estimator_temperature_c(const spring_estimator_t *estimator,
                                               const thermal_model_t *model, uint8_t spring);
spring_bounds_t spring_estimator_distance_k(const spring_estimator_t *estimator,
                                            const thermal_model_t *model, uint8_t spring);
spring_bounds_t spring_estimator_austenite(const spring_estimator_t *estimator,
                                           const thermal_model_t *model, uint8_t spring);

/* What the model must be stepped with: measured power less what this spring loses beyond it. */
uint32_t spring_estimator_model_power_uw(const spring_estimator_t *estimator,
                                         const thermal_model_t *model, uint8_t spring,
                                         uint32_t power_uw);
/* Power that holds it there, on the declared scale, W. */
float spring_estimator_hold_w(const spring_estimator_t *estimator, const thermal_model_t *model,
                              uint8_t spring, float temperature_c);
/* Current for a power in the resistance that it has now, 0..3200 mA. */
uint16_t spring_estimator_current_ma(const spring_estimator_t *estimator, uint8_t spring,
                                     float power_w);

#ifdef __cplusplus
}
#endif
#endif
