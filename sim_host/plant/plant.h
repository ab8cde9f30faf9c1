/* What it is for: the simulated array: springs, air, plate, electrics and sensors, in double
 * precision.
 * What it owns: the physics that tests and calibration measure against; every parameter by name,
 * in SI units.
 * What it never does: control anything, read files, share code with the on-chip model. */
#ifndef PLANT_H
#define PLANT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define PLANT_MAX_SPRINGS 1024 /* of all layers */
#define PLANT_MAX_LAYERS  2

typedef enum {
    PLANT_OK = 0,
    PLANT_ERROR_NAME = -1,  /* no parameter or effect of that name */
    PLANT_ERROR_RANGE = -2, /* value outside the parameter's limits, or not a number */
    PLANT_ERROR_INDEX = -3, /* no such spring */
    PLANT_ERROR_SIZE = -4,  /* rows x columns not in 1..1024 */
    PLANT_ERROR_MEMORY = -5,
    PLANT_ERROR_TIME = -6 /* time step not positive or not finite */
} plant_status_t;

/* One entry of the parameter table. The names serve scenario files, --set, model.toml and Python
 * alike. */
typedef struct {
    const char *name;
    const char *unit;
    const char *effect; /* the effect it belongs to, NULL for the declared model */
    const char *description;
    double default_value;
    double minimum;
    double maximum;
    bool per_spring; /* set for one spring as "name[3]" (1-based) or for all as "name" */
} plant_parameter_t;

typedef struct plant plant_t;

size_t plant_parameter_count(void);
const plant_parameter_t *plant_parameter(size_t k); /* NULL if and only if k >= count */
int plant_parameter_index(const char *name);        /* of a name without "[k]"; -1: none */
size_t plant_effect_count(void);
const char *plant_effect_name(size_t k);  /* NULL if and only if k >= count */
int plant_effect_index(const char *name); /* -1: none */
const char *plant_status_text(plant_status_t status);

/* Fails (NULL) if and only if rows or columns are 0, rows x columns > PLANT_MAX_SPRINGS, or memory
 * is out. Memory and time of a step are in proportion to the springs. */
plant_t *plant_create(int rows, int columns);
/* layers 2: below each spring a second one, joined end to end with it (series_w_per_k), the
 * stiffness layer: spring k's is k + rows x columns. Couplings, free sides and wake are within a
 * layer; each layer has the plate at its outer end, all have the one air. layers 1 is plant_create.
 * Fails if that does, with layers x rows for rows, or layers are not 1 or 2. */
plant_t *plant_create_layers(int rows, int columns, int layers);
void plant_destroy(plant_t *plant);
plant_t *plant_copy(const plant_t *plant); /* NULL if and only if memory is out */
int plant_spring_count(const plant_t *plant);
int plant_rows(const plant_t *plant); /* of a layer */
int plant_columns(const plant_t *plant);
int plant_layers(const plant_t *plant);

/* A parameter that belongs to an effect counts only while that effect is on. Unchanged on failure.
 */
plant_status_t plant_set(plant_t *plant, const char *name, double value);
/* Without "[k]" a per-spring parameter answers with spring 1's value. */
plant_status_t plant_get(const plant_t *plant, const char *name, double *value);
plant_status_t plant_set_effect(plant_t *plant, const char *effect, bool on);
bool plant_effect_is_on(const plant_t *plant, size_t effect);

/* The same by index, for loops that set thousands of times. spring is 0-based, -1 means all; a
 * parameter that is not per_spring takes -1 or 0. */
plant_status_t plant_set_index(plant_t *plant, size_t parameter, int spring, double value);
plant_status_t plant_get_index(const plant_t *plant, size_t parameter, int spring, double *value);
plant_status_t plant_set_effect_index(plant_t *plant, size_t effect, bool on);

/* What no single value can show: martensite_finish < martensite_start, austenite_start <
 * austenite_finish, martensite_finish < austenite_start, martensite_start < austenite_finish.
 * PLANT_OK or PLANT_ERROR_RANGE; *message then says which, else it is NULL (message may be NULL).
 * step, settle and simulate ask this first and return its status. */
plant_status_t plant_check(const plant_t *plant, const char **message);

/* All temperatures to the ambient parameter, martensite, time 0, energy sums 0. Drives, fan and
 * faults stay: a spring held at a temperature is at once there again. */
void plant_reset(plant_t *plant);
/* Puts a spring (and its sensor) to -60..500 degC; its phase follows as if it had been led there
 * slowly. Not in the energy sums: it is a starting state. */
plant_status_t plant_set_temperature(plant_t *plant, int spring, double temperature_c);

/* How a spring is driven until the next call; quantity in the unit of the mode. */
typedef enum {
    PLANT_DRIVE_POWER,   /* W at the spring's terminals (all of it heats the spring but for what a
                            contact takes); below 0: heat taken away, none of it from the supply */
    PLANT_DRIVE_CURRENT, /* A through the spring: power = i^2 R(T, phase) */
    PLANT_DRIVE_DUTY,    /* 0..1 of the buck stage: current follows from supply and resistances */
    PLANT_DRIVE_COMMAND, /* 0..1 of command_power_w (where neither current nor voltage was measured)
                          */
    PLANT_DRIVE_TEMPERATURE /* degC, held (its power is whatever that takes) */
} plant_drive_mode_t;
/* Limits: -100..100 W, 0..20 A, duty and command 0..1, -60..300 degC; others PLANT_ERROR_RANGE. */
plant_status_t plant_drive(plant_t *plant, int spring, plant_drive_mode_t mode, double quantity);
typedef enum {
    PLANT_FAULT_NONE = 0,
    PLANT_FAULT_OPEN,    /* no current, whatever the drive */
    PLANT_FAULT_SHORT,   /* the current flows beside the spring (5 milliohm), which stays cold */
    PLANT_FAULT_RESISTOR /* and here through ELECTRICS_DUMMY_OHM in its place, as before a first
                            spring is in */
} plant_fault_t;
plant_status_t plant_set_fault(plant_t *plant, int spring, plant_fault_t fault);
plant_status_t plant_set_fan(plant_t *plant, double fraction); /* 0..1 */
plant_status_t plant_set_ambient(plant_t *plant, double ambient_c);

/* Advances by dt_s (0 < dt_s <= 1e7) with the drives held: Bogacki-Shampine 3(2) on the enthalpies,
 * step chosen so that the estimated error of one step stays below the parameter
 * integration_tolerance_c. With the default the result is within 0.01 degC of the exact one (held
 * by test/host_plant). PLANT_ERROR_RANGE where a spring runs away: beyond 1e6 degC. */
plant_status_t plant_step(plant_t *plant, double dt_s);
/* Runs to the steady state of the present drives; PLANT_ERROR_TIME if it is not reached in limit_s.
 */
plant_status_t plant_settle(plant_t *plant, double limit_s);

/* A whole log in one call, from the present state: row r's inputs hold from time_s[r] to time_s[r +
 * 1], its outputs are those of time_s[r] (row 0: the present state). n = rows x columns of the
 * plant; matrices are row-major. time_s[rows]         strictly rising; only differences count
 *   mode[n]              how each spring is driven in the whole log
 *   drive[rows * n]      quantity of each spring; NaN keeps what the spring does
 *   fan[rows], ambient_c[rows]  NULL or NaN keeps what is set
 *   measured_c[rows * n]    out, or NULL: what the sensors show
 *   temperature_c[rows * n] out, or NULL: what the springs have
 * Everything is checked first: on failure nothing moved and nothing was written, but where a spring
 * runs away (plant_step). */
plant_status_t plant_simulate(plant_t *plant, size_t rows, const double *time_s,
                              const plant_drive_mode_t *mode, const double *drive,
                              const double *fan, const double *ambient_c, double *measured_c,
                              double *temperature_c);

double plant_time_s(const plant_t *plant);
double plant_ambient_c(const plant_t *plant); /* with its drift */
double plant_supply_v(const plant_t *plant);  /* with its sag */
double plant_temperature_c(const plant_t *plant, int spring);
double plant_air_c(const plant_t *plant);
double plant_plate_c(const plant_t *plant);                    /* of the first layer */
double plant_austenite(const plant_t *plant, int spring);      /* 0..1 */
double plant_resistance_ohm(const plant_t *plant, int spring); /* of the spring itself */
double plant_terminal_ohm(const plant_t *plant, int spring);   /* with contact and fault */
double plant_current_a(const plant_t *plant, int spring);
double plant_voltage_v(const plant_t *plant, int spring); /* at the terminals */
double plant_power_w(const plant_t *plant, int spring);   /* heat into the spring itself */
/* What a temperature sensor shows: sensor_lag, sensor_gain, optical_mixing applied; no noise. */
double plant_measured_c(const plant_t *plant, int spring);
/* Heat in less heat out less heat stored since the reset, J: 0 but for rounding and the inversion
 * of the enthalpy. Stored is reckoned from temperatures and phases, not from the flows. */
double plant_energy_balance_j(const plant_t *plant);
double plant_energy_input_j(const plant_t *plant);

#ifdef __cplusplus
}
#endif
#endif
