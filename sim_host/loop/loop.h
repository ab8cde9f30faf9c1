/* What it is for: controller and plant in one process, in lockstep (software in the loop).
 * What it owns: a controller, a copy of a plant, stages and sensors between, their failures.
 * What it never does: read files, print, look at a clock: one seed, one run, everywhere. */
#ifndef LOOP_H
#define LOOP_H

#include <stdbool.h>
#include <stdint.h>

#include "controller.h"
#include "plant.h"

#ifdef __cplusplus
extern "C" {
#endif

#define LOOP_TICK_S 0.02

typedef struct loop loop_t;

/* What can happen to the board or the array. Those of one spring last until LOOP_ACTION_SPRING_GOOD
 * or LOOP_ACTION_SENSOR_GOOD. */
typedef enum {
    LOOP_ACTION_OPEN_SPRING = 0, /* one spring: the wire breaks */
    LOOP_ACTION_SHORT_SPRING,  /* one spring: ELECTRICS_SHORT_OHM between its ends; it is not heated
                                */
    LOOP_ACTION_SPRING_GOOD,   /* one spring: connected again */
    LOOP_ACTION_SWITCH_CLOSED, /* one spring: its switch has failed closed: full duty for ever */
    LOOP_ACTION_SWITCH_GOOD,
    LOOP_ACTION_SENSOR_NACK,   /* one sensor: no acknowledge */
    LOOP_ACTION_SENSOR_BUS,    /* all sensors: SDA stuck low */
    LOOP_ACTION_SENSOR_STALE,  /* one sensor: no new conversions, and it says so */
    LOOP_ACTION_SENSOR_FREEZE, /* one sensor: converts, with the same result for ever */
    LOOP_ACTION_SENSOR_RESET,  /* one sensor: lost its configuration once; it is written again */
    LOOP_ACTION_SENSOR_GOOD,   /* one sensor: answers, converts and shows what is, at its place */
    LOOP_ACTION_BUS_GOOD,      /* ends LOOP_ACTION_SENSOR_BUS */
    LOOP_ACTION_FAN_STOP,      /* the fan stands whatever it is told */
    LOOP_ACTION_FAN_GOOD,
    LOOP_ACTION_WATCHDOG,  /* reset: boots locked, the model's state survives */
    LOOP_ACTION_BROWN_OUT, /* supply lost and back: boots locked, nothing is known of the springs */
    LOOP_ACTION_COUNT
} loop_action_t;

typedef struct {
    unsigned sensor_samples; /* averaged conversions of the INA219s: 1, 2, 4 .. 128 */
    double shunt_noise_v;    /* standard deviation of one conversion, >= 0 */
    double bus_noise_v;
    double ambient_error_c; /* what the chip believes less what is */
    unsigned plant_ticks;   /* thermal steps of the plant last this many ticks, 1..5 */
} loop_options_t;

void loop_options_default(loop_options_t *options);

/* Copies the plant as it is (parameters, effects, temperatures); springs of plant and settings must
 * match. The controller knows nothing of the springs, all off, unlocked. options may be NULL. NULL
 * if and only if the settings are refused
 * (*bad is its row of parameters.def, bad may be NULL), rows x columns of model and
 * plant differ
 * (*bad is that of rows), an option is out of range or memory is out (*bad is UINT16_MAX). */
loop_t *loop_create(const controller_settings_t *settings, const plant_t *plant,
                    const loop_options_t *options, uint64_t seed, uint16_t *bad);
void loop_destroy(loop_t *loop);

/* A board at a part of a larger array: its springs are settings->model.rows x columns of the plant
 * from there on (0-based, rows counted on through the layers; of one layer). The plant is the
 * caller's, and he advances it: loop_tick_part is a tick without that, and returns how far the
 * plant is to be advanced now, s (0: not yet); then every board reads the plant. boards.h does so.
 * Fails as loop_create, and if the part is not within the plant (*bad is the row of rows). */
loop_t *loop_create_part(const controller_settings_t *settings, plant_t *plant, int first_row,
                         int first_column, const loop_options_t *options, uint64_t seed,
                         uint16_t *bad);
double loop_tick_part(loop_t *loop);
void loop_read_plant(loop_t *loop);

/* One tick of 20 ms: sensors, controller_tick, outputs held while the plant advances. Commands are
 * given to the controller between ticks: controller_set_target(loop_controller(loop), ...). */
void loop_tick(loop_t *loop);
/* round(seconds / LOOP_TICK_S) ticks; none if that is not positive. */
void loop_advance(loop_t *loop, double seconds);

/* Fails if and only if there is no such action, or it needs a spring and there is no such one
 * (0-based). */
bool loop_act(loop_t *loop, loop_action_t action, int spring);
/* A sensor lies: it shows so many times the current and the voltage. Fails if and only if there is
 * no such spring or a scale is not 0..100. */
bool loop_scale_sensor(loop_t *loop, int spring, double current_scale, double voltage_scale);
/* Two sensors change their places in the stages; done twice, they are back. Fails if and only if
 * there is no such spring. */
bool loop_swap_sensors(loop_t *loop, int a, int b);
/* From now on the chip is told this ambient, whatever the plant's is; NaN: the plant's again. Fails
 * if and only if it is not -100..200 degC. */
bool loop_tell_ambient(loop_t *loop, double ambient_c);
/* Of the plant, and (with ambient_error_c) what the chip is told. Fails if the plant refuses it. */
bool loop_set_ambient(loop_t *loop, double ambient_c);

/* Owned by the loop. Drives, fan and ambient of the plant are set by the loop; all else may be
 * changed, but for its effects, and counts from the plant's next step on. */
controller_t *loop_controller(loop_t *loop);
plant_t *loop_plant(loop_t *loop);

double loop_time_s(const loop_t *loop);
/* Of the last tick, as they are, not as they are measured. spring is 0-based, out of range reads 0.
 */
double loop_current_a(const loop_t *loop, int spring);
double loop_sum_current_a(const loop_t *loop);
/* Highest sum of currents since loop_create, A. */
double loop_highest_sum_current_a(const loop_t *loop);
/* What the controller was told and what it answered in the last tick. */
const controller_inputs_t *loop_inputs(const loop_t *loop);
const controller_outputs_t *loop_outputs(const loop_t *loop);

#ifdef __cplusplus
}
#endif
#endif
