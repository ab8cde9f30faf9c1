/* What it is for: how hot a spring can be by the power it was given, whatever is believed of it or
 * said of it: the account of the heat that this board has delivered since power-on.
 * What it owns: that temperature and its phase for each spring, from power and time alone.
 * What it never does: learn, follow a correction of the model or a hint, latch a fault. It uses
 * floating point, one spring at a time. */
#ifndef TEMPERATURE_CEILING_H
#define TEMPERATURE_CEILING_H

#include <stdbool.h>
#include <stdint.h>

#include "thermal_model.h"

#ifdef __cplusplus
extern "C" {
#endif

#define TEMPERATURE_CEILING_TURN_S      0.6f /* between two steps of a spring */
#define TEMPERATURE_CEILING_WARM_K      5.0f /* above ambient, that who says 'cold' may be off by */
#define TEMPERATURE_CEILING_HEATED_K    40.0f /* at least, from a room to its transformation's end */
#define TEMPERATURE_CEILING_NEVER       UINT16_MAX
#define TEMPERATURE_CEILING_WHOLE_SHARE UINT16_MAX

typedef struct {
    int32_t temperature_c23[THERMAL_MODEL_MAX_SPRINGS]; /* Q9.23 degC */
    uint16_t austenite[THERMAL_MODEL_MAX_SPRINGS];      /* Q0.15, 0..THERMAL_MODEL_AUSTENITE_FULL */
    /* of the loss and the heat capacity that are declared now, the share that it goes by, of
     * TEMPERATURE_CEILING_WHOLE_SHARE, rounded down: what makes it the least that was declared
     * since the springs were cold. Finer than any step of a declared number: what is rounded down
     * again and again costs nothing that shows. */
    uint16_t loss_share[THERMAL_MODEL_MAX_SPRINGS];
    uint16_t capacity_share[THERMAL_MODEL_MAX_SPRINGS];
    uint16_t rest_turns[THERMAL_MODEL_MAX_SPRINGS]; /* since it was given power */
    uint16_t seal[THERMAL_MODEL_MAX_SPRINGS];       /* checksum of all that, of this spring */
    int16_t ambient_c7;     /* the highest that was told since the springs were cold */
    int16_t not_ambient_c7; /* its complement */
    bool delivered : 1;     /* power was given since then */
    bool doubtful : 1;      /* before power-on it was, and nobody has waited since */
    uint8_t broken_seals;   /* found so far, saturating */
} temperature_ceiling_t;

/* What duty and supply give at least, by the settings. */
typedef struct {
    float v_per_step; /* of duty */
    float drop_v;     /* of the freewheeling diode */
    float w_per_v2;   /* least power of a spring, by the voltage behind its switch */
} temperature_ceiling_drive_t;

/* Power-on: nothing was given yet. Also for springs that only another size of the array has. */
void temperature_ceiling_begin(temperature_ceiling_t *ceiling, int16_t ambient_c7);
/* What the model has of before a warm reset was given by this board, too: raises, never lowers.
 * Since when a spring has been given none itself is not in the model, and stays. */
void temperature_ceiling_raise(temperature_ceiling_t *ceiling, const thermal_model_t *model);
/* Of what was given so much is left that nobody can call the spring cold. */
bool temperature_ceiling_is_warm(const temperature_ceiling_t *ceiling, uint8_t spring);
/* Since it was given power itself, s; TEMPERATURE_CEILING_NEVER: not since power-on, or so long. */
uint16_t temperature_ceiling_rest_s(const temperature_ceiling_t *ceiling, uint8_t spring);

/* What of a spring's losses a fan decides, off or full. */
typedef struct {
    uint16_t loss_uw_per_k;
    uint16_t neighbours_uw_per_k; /* what joins it with them */
} temperature_ceiling_fan_t;

/* What a spring loses per kelvin at one fan. */
typedef struct {
    float own_w_per_k; /* to the air: what flows to neighbours and plate stays in the array */
    float with_plate_w_per_k;
    float with_neighbours_w_per_k; /* the loss and what joins it with them */
} temperature_ceiling_losses_t;

/* What a model declares of a spring, wherever it and its neighbours are. */
typedef struct {
    temperature_ceiling_losses_t now; /* at the present fan */
    float capacity_j_per_k;
    float heat_j; /* that warms it by TEMPERATURE_CEILING_HEATED_K and transforms it */
    temperature_ceiling_fan_t still;
    temperature_ceiling_fan_t blown;
    float half_share; /* of the way from the one to the other, what the fan does at half */
} temperature_ceiling_declared_t;
temperature_ceiling_declared_t temperature_ceiling_declared(const thermal_model_t *model,
                                                            uint8_t spring);
/* It is given power that its next step will tell of. */
void temperature_ceiling_give(temperature_ceiling_t *ceiling, const thermal_model_t *model,
                              uint8_t spring);
/* Another model is declared; before: by the one until now. From the first power on, until all
 * springs are cold and none is given any, of both the smaller loss and heat capacity count: a
 * spring that is hot by the numbers of before is not colder by what is said of it. A plate or
 * neighbours that are said to take more take no more than before, nor does a fan, before it is
 * switched on or off, nor a latent heat; as if the loss or the heat capacity had been declared so
 * many times as large. */
void temperature_ceiling_declare(temperature_ceiling_t *ceiling, const thermal_model_t *model,
                                 uint8_t spring, const temperature_ceiling_declared_t *before);

/* What is declared now is not what was since the springs were cold: a loss or heat capacity of half
 * as much again, or air that is 20 K colder. No tolerance explains both. */
bool temperature_ceiling_contradicts(const temperature_ceiling_t *ceiling,
                                     const thermal_model_t *model, uint8_t spring);

/* One spring's step of TEMPERATURE_CEILING_TURN_S with the mean power of that time: the model's
 * declared numbers, but of its state only air and plate, which nothing corrects. */
void temperature_ceiling_step(temperature_ceiling_t *ceiling, const thermal_model_t *model,
                              uint8_t spring, float power_w);

/* How often a spring's record was found to have changed by itself, as RAM may: in its next step it
 * counts as hot as a spring can be when the power comes on, SPRING_ESTIMATOR_HOTTEST_C, with power
 * just given. */
#define TEMPERATURE_CEILING_BROKEN_C 120
static inline uint8_t temperature_ceiling_broken_seals(const temperature_ceiling_t *ceiling)
{
    return ceiling->broken_seals;
}

/* degC. */
float temperature_ceiling_c(const temperature_ceiling_t *ceiling, uint8_t spring);

/* Its rise above ambient is a ninth more than that of trip_cc (0.01 degC), which an array within
 * its tolerances does not reach; or as hot as it can be. */
bool temperature_ceiling_trips(const temperature_ceiling_t *ceiling, uint8_t spring,
                               int16_t trip_cc);

void temperature_ceiling_prepare(temperature_ceiling_drive_t *drive, const thermal_model_t *model,
                                 const current_control_parameters_t *circuit);

/* Power, W, that the duty (steps of 800) must at least bring, whatever is read: the supply may be a
 * fifth lower than declared. more_drop_v: of the diodes, than declared, which there is for certain.
 */
float temperature_ceiling_power_w(const temperature_ceiling_drive_t *drive, float duty,
                                  float more_drop_v);

#ifdef __cplusplus
}
#endif
#endif
