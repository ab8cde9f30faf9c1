/* What it is for: holds the mean current of each channel at its target by choosing a duty.
 * What it owns: per channel one integer PI loop, a slew-limited reference, a dither residue.
 * What it never does: choose a target, read a sensor, decide a fault, divide in a tick. */
#ifndef CURRENT_CONTROL_H
#define CURRENT_CONTROL_H

#include <stdbool.h>
#include <stdint.h>

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
    uint16_t supply_mv;    /* what feeds the buck stages, 1000..16000 */
    uint16_t freewheel_mv; /* drop of the freewheel diode, 0..1000; 0: synchronous or ideal */
    uint16_t shunt_mohm;   /* 0..1000 */
    uint16_t wiring_mohm;  /* inductor, switch and leads, 0..1000 */
    uint16_t proportional_permille; /* of the loop's inverse gain, 0..1000 */
    uint16_t integral_permille;     /* of the loop's inverse gain, per tick, 1..1000 */
    uint16_t slew_ma_per_tick;   /* how fast a reference may rise, 1..3200; falls are immediate */
    uint16_t maximum_current_ma; /* of one channel, 1..3200: a higher target is clamped */
    uint16_t maximum_duty_steps; /* 1..800 */
    uint16_t
        trim_limit_mohm; /* how far the learnt loop resistance may be off the estimate, 0..1000 */
    uint8_t hold_ticks;  /* ticks that a channel may run without a reading, 0..250; then off */
} current_control_parameters_t;

typedef struct {
    int32_t trim_q24;      /* integral part: learnt less estimated loop gain, duty steps per mA */
    int32_t excess_q16;    /* duty wanted less duty given in the last tick: dither, clamp */
    int16_t estimate_q16;  /* estimated loop gain, duty steps per mA */
    uint16_t reference_ma; /* slew-limited target of the last tick */
    uint16_t residue_q16;  /* sub-step duty not given yet */
    uint8_t blind_ticks;   /* ticks without a valid reading, in a row */
} current_control_channel_t;

typedef struct {
    current_control_parameters_t parameters;
    uint16_t gain_q24_per_mohm; /* duty steps per mA and mohm */
    uint16_t fixed_mohm;        /* shunt and wiring */
    int32_t offset_q16;         /* duty that only overcomes the freewheel drop */
    int32_t trim_limit_q24;
    uint16_t proportional_q8;
    uint16_t integral_q16;
    current_control_channel_t channel[CURRENT_CONTROL_MAX_CHANNELS];
} current_control_t;

/* The reference board of docs/hardware.md. */
void current_control_parameters_default(current_control_parameters_t *parameters);

/* Fails if and only if a parameter is outside the range above; then *bad is its
 * byte offset in *parameters (bad may be NULL). */
bool current_control_check(const current_control_parameters_t *parameters, uint16_t *bad);

/* All channels off, with these parameters. Fails (false, nothing changed) as current_control_check
 * does. */
bool current_control_init(current_control_t *control,
                          const current_control_parameters_t *parameters, uint16_t *bad);

/* Replaces the parameters, keeps references and what was learnt. Fails (false, nothing changed) as
 * current_control_check does. */
bool current_control_apply(current_control_t *control,
                           const current_control_parameters_t *parameters, uint16_t *bad);

/* Estimate of the spring's resistance, without shunt and wiring; 0 after init. Call it when it
 * changes, and after apply. */
void current_control_set_resistance(current_control_t *control, uint8_t channel,
                                    uint16_t resistance_mohm);

/* The channel is off and forgets what it learnt, but not the estimate. */
void current_control_reset(current_control_t *control, uint8_t channel);

typedef struct {
    uint16_t target_ma;  /* wanted mean current; 0 switches off in this very tick */
    int16_t measured_ma; /* mean over the last tick; any value */
    bool valid;          /* measured_ma is a reading of the last tick */
    bool may_rise;       /* false: the reference may not rise in this tick (shared supply) */
} current_control_input_t;

/* One tick (20 ms) of one channel; returns the duty for the next tick in whole steps,
 * 0..maximum_duty_steps, dithered (first order) so that its mean over the ticks is the wanted one.
 * 0 means off. duty = reference x loop resistance / supply + proportional x error, loop resistance
 * = spring estimate + shunt + wiring + trim, the trim integrates error / reference, error = what
 * the given duty should have brought - what was measured, so neither dither nor clamping winds it
 * up. 1 / reference is taken to a power of two: the integral gain in effect is between half and all
 * of the setting. Without a valid reading nothing is learnt and the reference does not rise, and
 * after hold_ticks such ticks in a row the channel is off until a reading is valid again. */
uint16_t current_control_tick(current_control_t *control, uint8_t channel,
                              const current_control_input_t *input);

/* The same for channels 0 .. channels - 1 at once: without a call for each, in a quarter less time.
 */
void current_control_tick_all(current_control_t *control, uint8_t channels,
                              const uint16_t target_ma[], const int16_t measured_ma[],
                              const bool valid[], bool may_rise, uint16_t duty[]);

/* Slew-limited reference of the last tick, mA. */
uint16_t current_control_reference_ma(const current_control_t *control, uint8_t channel);

#ifdef __cplusplus
}
#endif
#endif
