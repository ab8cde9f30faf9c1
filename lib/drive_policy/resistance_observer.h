/* What it is for: reads the phase of one spring from its resistance, voltage over current.
 * What it owns: averages of the ratio, the spring's own scale, the judgement whether the reading
 * is fit to be believed.
 * What it never does: correct a model, choose a current, divide or use floating point in a tick. */
#ifndef RESISTANCE_OBSERVER_H
#define RESISTANCE_OBSERVER_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define RESISTANCE_OBSERVER_WINDOW  5u    /* readings in one update */
#define RESISTANCE_OBSERVER_ONE_Q14 16384 /* resistance of the declared martensite */

/* What the declared resistances mean for the arithmetic; shared by all springs. */
typedef struct {
    uint16_t gain_mantissa; /* 4000 / R_M (mohm) = gain_mantissa / 2^gain_shift */
    int8_t gain_shift;
    int16_t phase_gain_q12; /* permille of austenite per 2^-14 of ratio; 0: no difference to see */
    uint16_t noise_floor;
} resistance_alloy_t;

typedef struct {
    uint32_t slow_q22;       /* ratio to the declared martensite's resistance, over seconds */
    uint16_t ratio_q14;      /* the same over tenths of a second */
    uint16_t scale_q14;      /* declared martensite's resistance over this spring's own */
    uint16_t noise;          /* mean misfit of a window, units of the window's sums */
    uint16_t current_sum_ma; /* of the running window */
    uint16_t voltage_sum_mv;
    uint16_t first_ma;
    uint16_t last_ma;
    uint8_t readings;
    uint8_t learnt; /* windows that went into scale_q14, saturating */
    bool noisy;
} resistance_observer_t;

/* Works out the alloy's numbers, with divisions. Resistances 1000..16000000 uohm. Where the two
 * differ by less than 2 % of the martensite's, phase_gain_q12 is 0 and nothing is ever trusted. */
void resistance_alloy_prepare(resistance_alloy_t *alloy, uint32_t martensite_uohm,
                              uint32_t austenite_uohm);

void resistance_observer_reset(resistance_observer_t *observer);

/* One tick's reading; negative counts as none. */
void resistance_observer_take(resistance_observer_t *observer, int16_t current_ma,
                              int16_t voltage_mv);

/* Closes the window of RESISTANCE_OBSERVER_WINDOW ticks. True if and only if it was complete, the
 * current was at least 150 mA on average and it did not move by more than 100 mA: then the ratios
 * are new. Normalised least mean squares (Widrow and Hoff 1960), the norm rounded up to a power of
 * two. */
bool resistance_observer_update(resistance_observer_t *observer, const resistance_alloy_t *alloy);

/* The slow ratio starts anew from the fast one. */
void resistance_observer_restart_average(resistance_observer_t *observer);

/* The spring is martensite for certain: learns its scale. */
void resistance_observer_learn_martensite(resistance_observer_t *observer);

/* Austenite in permille as the fast ratio says, -2000..3000. */
int16_t resistance_observer_phase_permille(const resistance_observer_t *observer,
                                           const resistance_alloy_t *alloy);

/* The slow ratio less reference_q14, as permille of austenite. */
int16_t resistance_observer_drift_permille(const resistance_observer_t *observer,
                                           const resistance_alloy_t *alloy, uint16_t reference_q14);

/* The scale is known, readings are quiet, and the phase is within -250..1350 permille. */
bool resistance_observer_is_plausible(const resistance_observer_t *observer,
                                      const resistance_alloy_t *alloy);

/* Current that heats this spring with power_64uw (64 uW), mA, at most 3200, from the fast ratio;
 * inverse_q14 is 1 / ratio as kept by resistance_observer_inverse. */
uint16_t resistance_current_for_power_ma(const resistance_alloy_t *alloy, uint16_t inverse_q14,
                                         uint16_t power_64uw);

/* One Newton step of 1 / ratio_q14, Q14, from the last value. */
uint16_t resistance_inverse_q14(uint16_t inverse_q14, uint16_t ratio_q14);

#ifdef __cplusplus
}
#endif
#endif
