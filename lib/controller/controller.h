/* What it is for: one control tick of the whole board: measured inputs in, duties out.
 * What it owns: the order in which safety, model, belief, policy and current loops run.
 * What it never does: touch hardware, keep time, print. Same inputs, same outputs, everywhere. */
#ifndef CONTROLLER_H
#define CONTROLLER_H

#include <stdbool.h>
#include <stdint.h>

#include "circuit_check.h"
#include "circuit_peers.h"
#include "circuit_source.h"
#include "circuit_step.h"
#include "current_control.h"
#include "drive_policy.h"
#include "safety.h"
#include "scrub.h"
#include "spring_estimator.h"
#include "temperature_ceiling.h"
#include "thermal_model.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CONTROLLER_MAX_SPRINGS THERMAL_MODEL_MAX_SPRINGS
#define CONTROLLER_TICK_MS     20   /* 50 Hz */
#define CONTROLLER_DUTY_MAX    800u /* duty steps: timer counts of the 20 kHz PWM */

/* What one current sensor said since the last tick. A failed read is a status, never a number. */
typedef enum {
    CONTROLLER_SENSOR_OK = 0,
    CONTROLLER_SENSOR_ABSENT, /* no acknowledge */
    CONTROLLER_SENSOR_BUS,    /* bus stuck or timed out */
    CONTROLLER_SENSOR_STALE,  /* no new conversion */
    CONTROLLER_SENSOR_RESET   /* the sensor lost its configuration */
} controller_sensor_status_t;

typedef struct {
    uint8_t status;     /* controller_sensor_status_t */
    int16_t current_ma; /* mean current */
    int16_t voltage_mv; /* across the spring */
} controller_sensor_t;

typedef struct {
    controller_sensor_t sensor[CONTROLLER_MAX_SPRINGS];
    int16_t ambient_c7;  /* degC in Q9.7 */
    uint8_t fan_percent; /* what the fan is doing */
} controller_inputs_t;

typedef struct {
    /* Whole duty steps, 0..800, already dithered. 0 = output off and low. */
    uint16_t duty[CONTROLLER_MAX_SPRINGS];
    uint8_t fan_percent;
    bool supply; /* the cut-off gets its pulse: see controller_set_supply */
} controller_outputs_t;

/* Everything a user can set. lib/settings holds the one table of names, limits and units over these
 * fields. */
typedef struct {
    thermal_model_parameters_t model;
    current_control_parameters_t current;
    safety_parameters_t safety;
    drive_policy_parameters_t policy;
} controller_settings_t;

typedef struct {
    thermal_model_t model;
    temperature_ceiling_t ceiling;
    temperature_ceiling_drive_t drive;
    bool supply_off;      /* until controller_set_supply */
    uint8_t supply_ticks; /* that the supply has been held, up to those that a relay takes */
    /* a bit a spring: it had SAFETY_FAULT_SENSOR_MISMATCH or _STUCK_ON, cleared since */
    uint8_t mistrusted[(CONTROLLER_MAX_SPRINGS + 7) / 8];
    /* it was warm as the board was reset, and has not waited since: no look at it, either */
    uint8_t resumed[(CONTROLLER_MAX_SPRINGS + 7) / 8];
    current_control_t current; /* what is before it outlives another size of the array */
    safety_t safety;
    spring_estimator_t estimator; /* what is believed; it alone corrects the model */
    drive_policy_t policy;
    uint32_t silent_ticks; /* since the host was heard; no more than the longest host_timeout_s */
    uint8_t springs;
    int16_t ambient_c7;      /* of the last model step */
    uint8_t model_tick;      /* ticks since the last model step */
    uint8_t fan_percent;     /* wanted */
    uint8_t resistance_turn; /* whose resistance the current loop is told in the next tick */
    uint8_t floor_turn; /* of the round in which each spring's circuit and ceiling are judged */
    uint16_t level_permille[CONTROLLER_MAX_SPRINGS];
    int16_t measured_ma[CONTROLLER_MAX_SPRINGS]; /* last valid reading */
    int16_t measured_mv[CONTROLLER_MAX_SPRINGS];
    uint32_t power_sum_uw[CONTROLLER_MAX_SPRINGS]; /* over the ticks of the running model step */
    circuit_check_t circuit[CONTROLLER_MAX_SPRINGS];
    circuit_peers_t peers;
    circuit_source_t source;
    circuit_step_t step[CONTROLLER_MAX_SPRINGS];
    uint32_t heat_sum_uw[CONTROLLER_MAX_SPRINGS]; /* over the ticks of the ceiling's running step */
    uint16_t duty_sum[CONTROLLER_MAX_SPRINGS];    /* the same */
    scrub_t scrub;                                /* of what settings decide */
} controller_t;

/* The paper's spring and 3 x 3 array on the reference board. */
void controller_settings_default(controller_settings_t *settings);

/* True if and only if every two settings of parameter_pair fit together; else pair are the two
 * rows, the larger first. */
bool controller_settings_pair(const controller_settings_t *settings, uint16_t pair[2]);

/* Everything off, all temperatures at ambient_c7, no faults, unlocked. Fails (false, *controller
 * unchanged) if and only if a part refuses its settings, two settings do not fit together, a spring
 * would take longer than an hour to cool by two thirds, or model.step_ms is not 100; then *bad (may
 * be NULL) is the row of parameters.def, PARAMETER_COUNT where it is step_ms. */
bool controller_init(controller_t *controller, const controller_settings_t *settings,
                     int16_t ambient_c7, uint16_t *bad);

/* Replaces the settings while running. If rows and columns stay, so do temperatures, phases,
 * current loops, faults, levels and fan, and what was learnt of the springs: of their losses, that
 * they give off as much as they did, whatever the model declares now. Else as
 * controller_init at the last ambient, but faults of the board, lock and fan stay. Fails as
 * controller_init does, and where controller_is_sound is false; then nothing is changed. Divides.
 */
bool controller_apply_settings(controller_t *controller, const controller_settings_t *settings,
                               uint16_t *bad);

/* All that is believed begins anew, as when the power comes on, with the settings that are active;
 * what was learnt of the springs (as it was last restored or seen, less the drift of the losses
 * since), what was delivered, and the fan stay; all springs are off. From here on the same inputs
 * give the same outputs as after controller_init, the same learnt numbers and this. Fails where
 * controller_is_sound is false; then nothing is changed. Divides. */
bool controller_restart(controller_t *controller, const controller_settings_t *settings);

/* This tick or the last one was late: windows that run are of no use to who judges circuits. Before
 * and after the tick. */
void controller_hurry(controller_t *controller);

/* One tick of 20 ms: sensors, safety, model (every 5th tick, with the mean power of the ticks),
 * belief, policy, current loops.
 * inputs are of the tick that just ended, outputs are for the one that starts. outputs of springs
 * that do not exist are 0. Power is v x i of a valid reading. Without one it is the last valid
 * power if the output was on in the tick, else 0: the duty is not raised while a channel is blind,
 * so that is not too low. */
void controller_tick(controller_t *controller, const controller_inputs_t *inputs,
                     controller_outputs_t *outputs);

/* False if and only if what settings decide (limits, the model's numbers, what is derived of them)
 * has changed by itself, as RAM may, since controller_init: it is looked through every
 * CONTROLLER_SCRUB_MS, and before each change of a part of it. From then on nothing is driven and
 * the supply is not held; there is no way back but controller_init, as nothing here can be trusted.
 */
#define CONTROLLER_SCRUB_BYTES 26u /* a tick in which no circuit is judged, 25 a second of nine */
#define CONTROLLER_SCRUB_MS    1000u
bool controller_is_sound(const controller_t *controller);

/* Commands. Springs count from 0. They take effect in the next tick. */

/* level in permille, 0 off .. 1000 on. Fails if and only if there is no such spring or level is
 * above 1000. */
bool controller_set_target(controller_t *controller, uint8_t spring, uint16_t level_permille);
/* All springs at once: level 1000 where on[spring], else 0. */
void controller_set_pattern(controller_t *controller, const bool on[]);
/* Fails if and only if the policy does not exist in this version. With DRIVE_POLICY_OPEN the model
 * of a spring of which nothing is known is as warm as what this board has given since power-on. */
bool controller_set_policy(controller_t *controller, drive_policy_kind_t kind);
/* The same for a while, with another current of a spring that is fully on, and no model moves: what
 * selftest drives with, and how it goes back. Fails as that does, or by open_current_ma's range. */
bool controller_set_open(controller_t *controller, drive_policy_kind_t kind,
                         uint16_t open_current_ma);
/* Fails if and only if percent is above 100. */
bool controller_set_fan(controller_t *controller, uint8_t percent);
/* All levels to 0; no fault, the fan stays. */
void controller_stop(controller_t *controller);
/* All levels to 0 and SAFETY_FAULT_EMERGENCY_STOP until cleared. */
void controller_emergency_stop(controller_t *controller);
/* The same, and the supply off. */
void controller_emergency_cut(controller_t *controller);
/* The supply of all stages, where a cut-off is fitted (setting cut_off; without one it counts as
 * on, and outputs.supply is false). It is held from the start, but not while the board is locked.
 * False here, controller_emergency_cut, and each fault of safety_cuts_supply switch it off, with
 * all levels to 0; only true here switches it on again. Nothing is driven until the relay has
 * closed: 40 ms. Fails (nothing changed) if and only if on is true and a fault of
 * safety_cuts_supply or SAFETY_FAULT_EMERGENCY_STOP stands, or no cut-off is fitted. */
bool controller_set_supply(controller_t *controller, bool on);
bool controller_supply_is_fitted(const controller_t *controller);
/* Whether the cut-off gets its pulses: not while it is off, locked or not fitted. */
bool controller_supply_is_held(const controller_t *controller);
/* Switched off; not while it is only locked, nor where it is not fitted. */
bool controller_supply_is_off(const controller_t *controller);
/* Whoever asked for the springs is still there. host_timeout_s (0: never) after the last call, in
 * the tick in which a spring is wanted, all levels are set to 0 with SAFETY_FAULT_HOST_SILENT. */
void controller_host_heard(controller_t *controller);
/* Faults are forgotten and all levels set to 0: nothing starts by clearing. But for
 * SAFETY_FAULT_SENSOR_MISMATCH and _STUCK_ON of a spring that had one of them before: each time it
 * took up to 2.4 s of any heat until the sensor was found again, or 0.1 s of all that the supply
 * gives, so it stays until the spring has been given none for its time constant, as declared. */
void controller_clear_faults(controller_t *controller);
/* How long a clear will leave such a fault, s; 0: it takes it, or there is none. */
uint16_t controller_clear_wait_s(const controller_t *controller, uint8_t spring);
/* After a reset, of a spring that had SAFETY_FAULT_SENSOR_MISMATCH before it, or had it cleared: it
 * has that again, as if cleared once. What told of it, how its circuit showed before, is not kept.
 */
void controller_mistrust(controller_t *controller, uint8_t spring);
/* It had SAFETY_FAULT_SENSOR_MISMATCH or _STUCK_ON, and that was cleared since power-on. */
bool controller_is_mistrusted(const controller_t *controller, uint8_t spring);
void controller_lock(controller_t *controller);
/* Levels are set to 0: nothing starts by unlocking. */
void controller_unlock(controller_t *controller);

/* No spring may still be hot from before power-on; or none but what this board has warmed since. */
bool controller_is_known(const controller_t *controller);
bool controller_knows_cold(const controller_t *controller);
/* What the model remembers, and the heat that this board has given since power-on, whatever is
 * known of the springs: to be kept over a warm reset. */
void controller_get_model_state(const controller_t *controller, thermal_model_state_t *state);
void controller_get_delivered(const controller_t *controller, temperature_ceiling_t *delivered);
/* Gives them back, after controller_init with the same settings of size. state is NULL where
 * controller_knows_cold was false: then its temperatures are guesses, which a reset must not make
 * certain. Air, plate and what is cold are as they were. A spring that is warm, by state or
 * delivered, waits as after power-on, and no look at what it reads ends that: what would tell that
 * its sensor has begun to lie is lost, and by its readings alone a hold would go on at any
 * temperature. (By DRIVE_POLICY_OPEN nothing waits:
 * see controller_set_policy.) False, nothing but delivered taken, if and only if the state is NULL
 * or none that this model could be in. */
bool controller_resume(controller_t *controller, const temperature_ceiling_t *delivered,
                       const thermal_model_state_t *state);
/* A hint: springs, air and plate are taken to be at one temperature, reached from cold. It takes
 * away what is not known of the time before power-on, and no heat that this board gave: a spring
 * that is warm by that keeps its temperature and all that is believed of it, and then air and plate
 * keep theirs. */
void controller_set_temperature(controller_t *controller, int16_t temperature_c7);
/* After power-on: the board was switched off before all that it had heated was cold. Until each
 * spring has waited as long as it may be hot (controller_cooling_s), that hint is none of it. */
void controller_doubt_cold(controller_t *controller);
bool controller_is_doubtful(const controller_t *controller, uint8_t spring);
/* Once a second. False if all springs would be cold, were the power cut now: none was given heat
 * that has not cooled, and none is in doubt. */
bool controller_may_be_warm(controller_t *controller);
/* By the heat that this board gave since power-on, measured, and the declared losses
 * (temperature_ceiling): too warm for the hint; how warm, degC, if it was cold before; since when
 * it was given none itself, s, TEMPERATURE_CEILING_NEVER where it never was. */
bool controller_is_warm(const controller_t *controller, uint8_t spring);
float controller_delivered_c(const controller_t *controller, uint8_t spring);
uint16_t controller_rest_s(const controller_t *controller, uint8_t spring);

/* What is known of each spring, with the bounds of 99 % (spring_estimator); spring, here and below,
 * must be below controller_springs. Temperature in degC, distance to martensite start in K,
 * austenite 0..1. */
spring_bounds_t controller_temperature_bounds_c(const controller_t *controller, uint8_t spring);
spring_bounds_t controller_distance_bounds_k(const controller_t *controller, uint8_t spring);
spring_bounds_t controller_austenite_bounds(const controller_t *controller, uint8_t spring);
/* By how much the transformation is believed to lie above where it is declared (a load), K. */
float controller_shift_k(const controller_t *controller, uint8_t spring);
/* What the held springs lose, of what is declared, with its standard deviation. False where fewer
 * than two are held. */
bool controller_losses(const controller_t *controller, float *factor, float *sd);
/* What was found of supply and diodes; what is declared of them is in the settings. */
const circuit_source_t *controller_source(const controller_t *controller);
/* A CRC-16 of all that is believed of a spring (spring_estimator_mark). */
uint16_t controller_belief_mark(const controller_t *controller, uint8_t spring);
/* How often what is believed had changed by itself, as RAM may, and began anew: of a spring as when
 * the power comes on. Saturates at 255. */
uint8_t controller_broken_seals(const controller_t *controller);
/* The last sights of the springs: why they are believed to be where they are. */
const spring_sights_t *controller_sights(const controller_t *controller);
/* How long it may still be hot from before power-on, s, never more than
 * CONTROLLER_COOLING_MOST_S; 0 where that is over. */
#define CONTROLLER_COOLING_MOST_S 86400.0f
float controller_cooling_s(const controller_t *controller, uint8_t spring);
/* The spring's own numbers, as they are. */
spring_learnt_t controller_learnt(const controller_t *controller, uint8_t spring);
/* The same, to be kept over power-off: within what is restored. */
spring_learnt_t controller_to_keep(const controller_t *controller, uint8_t spring);
/* All of a spring's numbers; none of them if one is such as no spring has. */
void controller_restore_learnt(controller_t *controller, uint8_t spring,
                               const spring_learnt_t *learnt);
void controller_forget_learnt(controller_t *controller, uint8_t spring);
/* Of its own numbers the loss alone, which is one beyond the declared losses. */
void controller_forget_loss(controller_t *controller, uint8_t spring);
/* A CRC-16 of all numbers of the model that is declared, O(parameters): what was learnt of a loss
 * beside another one does not hold. */
uint16_t controller_model_mark(const controller_t *controller);

/* For telemetry. */
uint8_t controller_springs(const controller_t *controller);
uint16_t controller_level_permille(const controller_t *controller, uint8_t spring);
uint16_t controller_target_ma(const controller_t *controller, uint8_t spring);
int16_t controller_measured_ma(const controller_t *controller,
                               uint8_t spring); /* last valid reading */
int16_t controller_measured_mv(const controller_t *controller, uint8_t spring);
uint32_t controller_power_uw(const controller_t *controller, uint8_t spring); /* of the last tick */
uint16_t controller_duty(const controller_t *controller, uint8_t spring);
int16_t controller_temperature_c7(const controller_t *controller, uint8_t spring);
uint16_t controller_austenite_permille(const controller_t *controller, uint8_t spring);
safety_fault_t controller_fault(const controller_t *controller, uint8_t spring);
safety_fault_t controller_board_fault(const controller_t *controller);
uint16_t controller_limits(const controller_t *controller,
                           uint8_t spring); /* drive_policy_limit_t bits */
/* By how much they cut the spring's target. */
uint16_t controller_cut_ma(const controller_t *controller, uint8_t spring);
drive_policy_stage_t controller_stage(const controller_t *controller, uint8_t spring);
bool controller_is_locked(const controller_t *controller);
uint8_t controller_fan_percent(const controller_t *controller); /* wanted */
drive_policy_kind_t controller_policy(const controller_t *controller);

#ifdef __cplusplus
}
#endif
#endif
