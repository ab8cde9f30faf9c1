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

#define RESISTANCE_OBSERVER_LEAST_READINGS 4u    /* of a window */
#define RESISTANCE_OBSERVER_SETTLING       8u    /* readings after a jump of the current */
#define RESISTANCE_OBSERVER_ONE_Q14        16384 /* resistance of the declared martensite */

/* What the declared resistances mean for the arithmetic; shared by all springs. */
typedef struct {
    uint16_t gain_mantissa; /* 1000 / R_M (mohm) = gain_mantissa / 2^gain_shift, 15 bits */
    int8_t gain_shift;
    uint16_t phase_gain;     /* permille of austenite per 1 of ratio; 0: no difference to see */
    bool falls;              /* the resistance, as austenite forms */
    uint16_t noise_floor_ma; /* of one reading, as current through R_M */
    uint16_t highest_q14;    /* the larger of both resistances over the martensite's */
} resistance_alloy_t;

typedef struct {
    uint16_t current_sum_ma; /* of the running window */
    uint16_t voltage_sum_mv;
    uint8_t readings;
    uint8_t settling;       /* readings to leave out */
    uint8_t learnt;         /* windows that went into scale_q14, saturating */
    uint16_t ratio_q14;     /* to the declared martensite's resistance, over tenths of a second */
    uint32_t slow_q22;      /* the same over seconds */
    uint16_t inverse_q14;   /* 1 / ratio */
    uint16_t scale_q14;     /* declared martensite's resistance over this spring's own */
    int16_t misfit;         /* of the last window, 8 mA through R_M */
    uint16_t noise;         /* mean change of it, 2 mA */
    int16_t phase_permille; /* austenite as the fast ratio says, -2000..3000 */
    bool noisy;
} resistance_observer_t;

/* Works out the alloy's numbers, with divisions. Resistances 1000..16000000 uohm. Where the two
 * differ by less than 2 % of the martensite's, phase_gain is 0 and nothing is ever trusted. */
void resistance_alloy_prepare(resistance_alloy_t *alloy, uint32_t martensite_uohm,
                              uint32_t austenite_uohm);

void resistance_observer_reset(resistance_observer_t *observer);

/* One tick's reading. Negative ones are left out, and what no longer fits the sums. Inline: every
 * tick takes nine. */
static inline void resistance_observer_take(resistance_observer_t *observer, int16_t current_ma,
                                            int16_t voltage_mv)
{
    if (observer->settling != 0) {
        observer->settling--;
        return;
    }
    if (current_ma < 0 || voltage_mv < 0) {
        return;
    }
    uint16_t current_sum_ma = (uint16_t)(observer->current_sum_ma + (uint16_t)current_ma);
    uint16_t voltage_sum_mv = (uint16_t)(observer->voltage_sum_mv + (uint16_t)voltage_mv);
    if (current_sum_ma < (uint16_t)current_ma || voltage_sum_mv < (uint16_t)voltage_mv) {
        return;
    }
    observer->current_sum_ma = current_sum_ma;
    observer->voltage_sum_mv = voltage_sum_mv;
    observer->readings++;
}

/* The current jumps: the next readings are left out, as the sensor reads current and voltage one
 * after the other. */
static inline void resistance_observer_disturb(resistance_observer_t *observer)
{
    observer->settling = RESISTANCE_OBSERVER_SETTLING;
}

/* Closes the window. True if and only if it had RESISTANCE_OBSERVER_LEAST_READINGS and their
 * current was at least 150 mA on average: then ratios and phase are new. Normalised least mean
 * squares (Widrow and Hoff 1960) with a gain of a half to one: the norm, the sum of currents, is
 * rounded up to a power of two. judges: the ratio had time to follow, so what does not fit is
 * noise.
 */
bool resistance_observer_update(resistance_observer_t *observer, const resistance_alloy_t *alloy,
                                bool judges);

/* The slow ratio starts anew from the fast one. */
void resistance_observer_restart_average(resistance_observer_t *observer);

/* The spring is martensite for certain: learns its scale. */
void resistance_observer_learn_martensite(resistance_observer_t *observer,
                                          const resistance_alloy_t *alloy);

/* The slow ratio less reference_q14, as permille of austenite. */
int16_t resistance_observer_drift_permille(const resistance_observer_t *observer,
                                           const resistance_alloy_t *alloy, uint16_t reference_q14);

/* The scale is known, readings are quiet, and the phase is within -250..1350 permille. */
bool resistance_observer_is_plausible(const resistance_observer_t *observer,
                                      const resistance_alloy_t *alloy);

/* Current that heats a spring with power_64uw (64 uW), mA, at most 3200; inverse_q14 is the
 * observer's. */
uint16_t resistance_current_for_power_ma(const resistance_alloy_t *alloy, uint16_t inverse_q14,
                                         uint16_t power_64uw);

#ifdef __cplusplus
}
#endif
#endif
