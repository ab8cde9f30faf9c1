/* What it is for: a lumped thermal network of an array of NiTi springs, in integers, one step per
 * 0.1 s.
 * What it owns: the temperature, enthalpy and phase of each spring, of the shared air and of the
 * plate.
 * What it never does: measure, decide a current, divide or use floating point in a step, allocate.
 */
#ifndef THERMAL_MODEL_H
#define THERMAL_MODEL_H

#include <stdbool.h>
#include <stdint.h>

#include "parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Where the fan's air goes: towards the next column, the next row, ... (row 1 is at the top). */
typedef enum {
    THERMAL_MODEL_WAKE_EAST = 0,
    THERMAL_MODEL_WAKE_SOUTH,
    THERMAL_MODEL_WAKE_WEST,
    THERMAL_MODEL_WAKE_NORTH
} thermal_model_wake_t;

/* What a parameter can be refused for. */
typedef enum {
    THERMAL_MODEL_OK = 0,
    THERMAL_MODEL_ERROR_RANGE = -1,    /* outside the parameter's own limits */
    THERMAL_MODEL_ERROR_OVERFLOW = -2, /* heat flows would not fit the accumulator */
    THERMAL_MODEL_ERROR_UNSTABLE =
        -3, /* the step is too long for this heat capacity and these losses */
    THERMAL_MODEL_ERROR_ORDER = -4 /* transformation temperatures out of order */
} thermal_model_status_t;

/* Temperatures are held within these, degC in Q9.7: -40 .. 215. What lies outside counts as the
 * limit. A spring's upper limit is 255 degC less latent heat over heat capacity where that is
 * lower. */
#define THERMAL_MODEL_LOWEST_C7  (-40 * 128)
#define THERMAL_MODEL_HIGHEST_C7 (215 * 128)
#define THERMAL_MODEL_HIGHEST_POWER_UW                                                             \
    8388607u                                /* 8.4 W: more counts as this                          \
                                             */
#define THERMAL_MODEL_AUSTENITE_FULL 32768u /* Q0.15 of thermal_model_austenite */

typedef enum {
    THERMAL_MODEL_BRANCH_COOLING = 0, /* austenite = amplitude S((M_s - turn) / (M_s - M_f)) */
    THERMAL_MODEL_BRANCH_HEATING = 1  /* austenite = 1 - amplitude S((turn - A_s) / (A_f - A_s)) */
} thermal_model_branch_t;             /* S(x) = (1 + cos(pi x)) / 2, Liang and Rogers 1990
                                       */

/* What one spring remembers. */
typedef struct {
    int32_t temperature_c23; /* Q9.23 degC */
    int32_t latent_c23;      /* Q9.23 K: latent heat taken up over heat capacity; the
                                sum of both is the enthalpy */
    int16_t heating_c7;      /* above this, austenite forms; the upper limit when none
                                is left to form */
    int16_t cooling_c7;      /* below this, martensite forms; the lower limit when none
                                is left to form */
    uint16_t amplitude;      /* Q0.15, of the branch */
    uint8_t branch;          /* thermal_model_branch_t */
} thermal_model_spring_state_t;

/* What a model remembers: plain data, can be kept over a warm reset. */
typedef struct {
    int32_t air_c23;
    int32_t plate_c23;
    thermal_model_spring_state_t spring[THERMAL_MODEL_MAX_SPRINGS];
} thermal_model_state_t;

/* Between which temperatures one spring transforms, degC in Q9.7. */
typedef struct {
    int16_t martensite_finish_c7;
    int16_t martensite_start_c7;
    int16_t austenite_start_c7;
    int16_t austenite_finish_c7;
} thermal_model_transformation_t;

/* Derived from the parameters: internal, read it through the functions. In each of the three
 * structs what the parameters alone decide comes first, and then what moves: the controller looks
 * whether the former stays as it is. */
typedef struct {
    int32_t step_gain; /* 2^48 1e-6 step / heat capacity: 2^-31 of 2^-23 K for 1/64 uW */
    uint16_t loss_natural_uw_per_k; /* with the fan off, and full */
    uint16_t loss_fan_uw_per_k;
    uint16_t loss_rise_natural; /* uW/K per 1024 K */
    int16_t transformation_shift_c7;
    uint16_t contact_q16; /* 2^-16 ohm */
    uint8_t row;
    uint8_t column;
    spring_index_t upstream; /* spring from which the fan blows; THERMAL_MODEL_MAX_SPRINGS: none */
    uint16_t loss_uw_per_k;  /* at the present fan, as loss_rise */
    uint16_t loss_rise;
    int16_t midstep_c6; /* temperature expected at the middle of the next step, Q9.6 degC */
} thermal_model_spring_t;

/* Air or plate: how flow becomes temperature. Internal. */
typedef struct {
    int64_t gain;           /* 2^45 1e-6 step / heat capacity: 2^-28 of 2^-23 K for 1/64 uW */
    uint32_t loss_uw_per_k; /* to ambient */
    bool quick; /* a step is long against its own time: taken implicitly, not extrapolated */
    int16_t midstep_c6;
} thermal_model_slow_node_t;

typedef struct {
    thermal_model_parameters_t parameters;
    thermal_model_transformation_t transformation; /* of a spring that is not shifted */
    uint16_t heating_position;                     /* 2^21 / width of the transformation, 1/128 K */
    uint16_t cooling_position;
    uint16_t latent_full_c8;   /* Q8.8 K: latent heat over heat capacity */
    uint16_t radiation_factor; /* 1/64 uW at 512 K */
    int16_t highest_c7;        /* of a spring: temperature plus latent heat must fit */
    spring_index_t springs;
    uint8_t fan_percent;
    int16_t ambient_c7;
    uint16_t orthogonal_uw_per_k; /* at the present fan */
    uint16_t diagonal_uw_per_k;
    uint16_t wake_uw_per_k;
    thermal_model_state_t state;
    thermal_model_slow_node_t air;
    thermal_model_slow_node_t plate;
    thermal_model_spring_t spring[THERMAL_MODEL_MAX_SPRINGS];
} thermal_model_t;

/* Takes the parameters; then fan off, ambient 20 degC, everything at 20 degC and martensite. On
 * refusal the model is unchanged and *bad (may be NULL) is the row of parameters.def
 * that is in the way, PARAMETER_COUNT where it is step_ms. O(n); divides: for
 * start-up, not for the tick. Fails if and only if
 *
 * RANGE: rows x columns not in 1..THERMAL_MODEL_MAX_SPRINGS; step_ms not in 1..1000; a scale not in
 * 1..8000 permille; heat capacity times scale below 1 mJ/K, or so small that a step of the highest
 * power exceeds 63 K; latent heat over heat capacity above 80 K or above 20 times either width; a
 * transformation narrower than 2 K or wider than 100 K; a transformation temperature outside
 * -30..200 degC; austenite finish plus latent heat over heat capacity above 200 degC, or either
 * beyond its end with the shift of a spring; a resistance
 * of 0 or above 16 ohm; loss rise above 20000 ppm/K; wake direction above 3; wake above the fan's
 * loss (heat from nothing); air or plate above 2 kJ/K; a plate coupled but without heat capacity.
 *
 * ORDER: not martensite finish < martensite start <= austenite start < austenite finish.
 *
 * OVERFLOW: one spring's couplings and plate above 65.5 mW/K, all springs' to the plate above
 * 4.29 W/K, its loss (at 255 K if it rises) above
 * 65.5 mW/K, all of it with wake and radiation above 98 mW/K, or its loss rising by more than
 * 64 uW/K per K.
 *
 * UNSTABLE: step times conductance above half the heat capacity of a spring, or of the plate. */
thermal_model_status_t thermal_model_init(thermal_model_t *model,
                                          const thermal_model_parameters_t *parameters,
                                          uint16_t *bad);

/* Other parameters of the same rows and columns: ambient, fan and temperatures stay, and phases, as
 * far as the parameters have them there. Refuses as thermal_model_init. O(n); divides. */
thermal_model_status_t thermal_model_declare(thermal_model_t *model,
                                             const thermal_model_parameters_t *parameters,
                                             uint16_t *bad);

/* Springs, air and plate to one temperature, reached from cold: martensite below austenite start.
 * O(n). */
void thermal_model_reset(thermal_model_t *model, int16_t temperature_c7);
/* O(1). */
void thermal_model_set_ambient(thermal_model_t *model, int16_t ambient_c7);
/* Conductances between fan off (0) and full (100, more counts as 100). O(n) on a change, else O(1);
 * no division. */
void thermal_model_set_fan(thermal_model_t *model, uint8_t percent);

/* One step of step_ms with power_uw[i] into spring i. O(n), no division. */
void thermal_model_step(thermal_model_t *model, const uint32_t power_uw[]);

/* Getters, O(1). An index out of range reads as spring 0. */
int16_t thermal_model_temperature_c7(const thermal_model_t *model, spring_index_t spring);
uint16_t thermal_model_austenite(const thermal_model_t *model,
                                 spring_index_t spring); /* Q0.15, 0..32768 */
/* Of the law below at the spring's own phase and temperature. */
uint32_t thermal_model_resistance_uohm(const thermal_model_t *model, spring_index_t spring);
int16_t
thermal_model_air_c7(const thermal_model_t *model); /* ambient where there is no shared air */
int16_t thermal_model_plate_c7(const thermal_model_t *model);

/* The one law of resistance: what that spring's sensor sees at a phase (Q0.15, 0..32768) and a
 * temperature. Each phase's own resistance rises in proportion with the distance from 20 degC, they
 * are mixed by their shares, and the spring's contact is in series. At least 1 uohm. O(1). */
uint32_t thermal_model_resistance_uohm_at(const thermal_model_t *model, spring_index_t spring,
                                          uint16_t austenite, int16_t temperature_c7);
/* What heats the spring of what its sensor measures: not what heats its contact, uW. current_ma: at
 * most 4095. O(1). */
uint32_t thermal_model_heating_uw(const thermal_model_t *model, spring_index_t spring,
                                  uint16_t current_ma, uint16_t voltage_mv);
/* The one source of the temperatures between which that spring transforms. O(1). */
thermal_model_transformation_t thermal_model_transformation(const thermal_model_t *model,
                                                            spring_index_t spring);
int16_t thermal_model_ambient_c7(const thermal_model_t *model);
/* How many neighbours a spring has one row or column away, and both. */
typedef struct {
    uint8_t orthogonals;
    uint8_t diagonals;
} thermal_model_neighbours_t;
thermal_model_neighbours_t thermal_model_neighbours(const thermal_model_parameters_t *parameters,
                                                    spring_index_t spring);

/* Between two springs at the present fan; 0 where they are no neighbours. Both below the number of
 * springs. O(1). */
uint16_t thermal_model_coupling_uw_per_k(const thermal_model_t *model, spring_index_t spring,
                                         spring_index_t other);

/* Takes one spring to a temperature as if slowly: on the way its phase transforms as it would.
 * O(1). */
void thermal_model_set_temperature(thermal_model_t *model, spring_index_t spring,
                                   int16_t temperature_c7);

/* The steady power that holds that spring at that temperature while its neighbours, air and plate
 * are as they are now; negative where it would have to be cooled. O(1), no division. */
int32_t thermal_model_power_to_hold_uw(const thermal_model_t *model, spring_index_t spring,
                                       int16_t temperature_c7);

/* O(n). */
void thermal_model_get_state(const thermal_model_t *model, thermal_model_state_t *state);
/* False, and the model unchanged, if and only if the state is not one this model could be in. O(n).
 */
bool thermal_model_set_state(thermal_model_t *model, const thermal_model_state_t *state);

/* What the fan decides is taken from those anew. O(n), no division. */
void thermal_model_refresh(thermal_model_t *model);

/* Everything remembered is within its limits and fits together. O(n). */
bool thermal_model_is_consistent(const thermal_model_t *model);

#ifdef __cplusplus
}
#endif
#endif
