/* What it is for: holds the mean current of each channel at its target by choosing a duty.
 * What it owns: per channel a learnt loop resistance, a slew-limited reference, a dither residue.
 * What it never does: choose a target, read a sensor, decide a fault, divide in a tick. */
#ifndef CURRENT_CONTROL_H
#define CURRENT_CONTROL_H

#include <stdbool.h>
#include <stdint.h>

#include "parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

#ifndef CURRENT_CONTROL_MAX_CHANNELS
#ifdef __AVR__
#define CURRENT_CONTROL_MAX_CHANNELS 9
#else
#define CURRENT_CONTROL_MAX_CHANNELS 64
#endif
#endif

#define CURRENT_CONTROL_DUTY_STEPS 800u /* timer counts of one PWM period */

typedef struct {
    int32_t trim_q24;      /* learnt less estimated loop gain, duty steps per mA */
    int16_t estimate_q16;  /* estimated loop gain, duty steps per mA */
    uint16_t reference_ma; /* slew-limited target of the last tick */
    uint16_t residue_q16;  /* sub-step duty not given yet */
    uint16_t duty;         /* given in the last tick */
    uint8_t blind_ticks;   /* ticks without a valid reading, in a row */
    bool fell;             /* the target, in the last tick, by more than a little */
} current_control_channel_t;

typedef struct {
    current_control_parameters_t parameters;
    uint16_t gain_q24_per_mohm; /* duty steps per mA and mohm */
    uint16_t fixed_mohm;        /* shunt and wiring */
    int32_t trim_limit_q24;
    uint16_t integral_q16;
    bool even_turn;     /* channels 0, 2, .. had their turn in the last tick */
    int32_t offset_q16; /* duty that only overcomes the freewheel drop */
    current_control_channel_t channel[CURRENT_CONTROL_MAX_CHANNELS];
} current_control_t;

/* Fails if and only if a parameter is outside its row's range; then *bad (may be NULL) is the row
 * of parameters.def. */
bool current_control_check(const current_control_parameters_t *parameters, uint16_t *bad);

/* All channels off, with these parameters. Fails (false, nothing changed) as current_control_check
 * does. */
bool current_control_init(current_control_t *control,
                          const current_control_parameters_t *parameters, uint16_t *bad);

/* Replaces the parameters, keeps references and what was learnt: of a driven channel, what its loop
 * takes, whatever is declared of it now, as far as the trim goes. Fails (false, nothing changed) as
 * current_control_check does. */
bool current_control_apply(current_control_t *control,
                           const current_control_parameters_t *parameters, uint16_t *bad);

/* The drop of the freewheel diodes, up to 1 V, in place of the declared one. No duty jumps with it:
 * what of a driven channel's duty the drop takes or leaves, its trim leaves or takes. */
void current_control_set_drop(current_control_t *control, uint16_t drop_mv);

/* Steps of duty that only overcome that drop: up to 255, which are more. */
static inline uint8_t current_control_dead_steps(const current_control_t *control)
{
    const uint16_t steps = (uint16_t)((uint32_t)control->offset_q16 >> 16);
    return (steps < UINT8_MAX ? steps : UINT8_MAX) & 0xFFu;
}

/* Estimate of the spring's resistance, without shunt and wiring; 0 after init. Call it when it
 * changes. */
void current_control_set_resistance(current_control_t *control, uint8_t channel,
                                    uint16_t resistance_mohm);

/* The channel is off and forgets what it learnt, but not the estimate. */
void current_control_reset(current_control_t *control, uint8_t channel);

/* One tick (20 ms) of channels 0 .. channels - 1. target_ma: wanted mean currents; 0 switches off
 * in this very tick. measured_ma: means over the last tick, any values; valid: they are readings of
 * the last tick. may_rise false: no reference may rise in this tick (shared supply). Gives the
 * duties for the next tick in whole steps, 0..maximum_duty_steps, 0 means off; dithered (first
 * order), so that their mean over the ticks is the wanted one.
 *
 * duty = reference x loop resistance / supply, loop resistance = spring estimate + shunt + wiring +
 * trim. What a duty has brought corrects the trim, so that neither dither nor clamping winds it up.
 * A duty is given for two ticks: a reading after the second, be it of this tick or of the one
 * before, is of it alone. Then the trim takes integral x error / reference, and the reference may
 * rise: to 128 mA from off, to its double later, by two ticks of the slew at most. So what is not
 * learnt yet shrinks as the current rises: a loop resistance that is a quarter off overshoots by no
 * more than 40 mA. A fall of the target does not wait, and teaches nothing; nor do changes of up to
 * 25 mA a tick, as small as they are a reading of the one before does no harm. 1 / reference is
 * taken to a power of two: the gain in effect is between half and all of the setting, below 128 mA
 * less. Channels have their turns in alternate ticks.
 *
 * A supply that comes back, as others switch off at the end of a long cable, raises the current at
 * once. A reading at the sensor's end (3.2 A) tells only that it is more: the channel's next turn
 * takes away all that the sag had taught, and 9 %. With a loop that is up to 14 % below its
 * estimate 3 A then read less than 3.15 A again, four ticks after the rise at the latest.
 *
 * Without a valid reading nothing is learnt and the reference does not rise; after hold_ticks such
 * ticks in a row the channel is off until a reading is valid again. */
void current_control_tick(current_control_t *control, uint8_t channels, const uint16_t target_ma[],
                          const int16_t measured_ma[], const bool valid[], bool may_rise,
                          uint16_t duty[]);

/* Duty given in the last tick; 0 after a reset. */
uint16_t current_control_duty(const current_control_t *control, uint8_t channel);

/* Duty steps that a mA more takes, in Q16: its loop as it is estimated, and as it was learnt. */
uint16_t current_control_gain_q16(const current_control_t *control, uint8_t channel);

/* Slew-limited reference of the last tick, mA. */
uint16_t current_control_reference_ma(const current_control_t *control, uint8_t channel);

#ifdef __cplusplus
}
#endif
#endif
