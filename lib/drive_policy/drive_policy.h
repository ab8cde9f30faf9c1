/* What it is for: turns wanted levels into target currents, by what is believed of each spring and
 * within the limits of springs and supply.
 * What it owns: the choice of policy, each spring's stage, its margin, what is said of it.
 * What it never does: judge a reading (spring_estimator does), close a current loop, switch an
 * output. It uses floating point, one spring at a time. */
#ifndef DRIVE_POLICY_H
#define DRIVE_POLICY_H

#include <stdbool.h>
#include <stdint.h>

#include "parameters.h"
#include "spring_away.h"
#include "spring_estimator.h"
#include "supply_share.h"
#include "thermal_model.h"

#ifdef __cplusplus
extern "C" {
#endif

#define DRIVE_POLICY_MAX_SPRINGS THERMAL_MODEL_MAX_SPRINGS
#define DRIVE_POLICY_LEVEL_FULL  1000u /* permille */

typedef enum {
    DRIVE_POLICY_OPEN = 0,         /* a set current while on, nothing while off: the paper's way */
    DRIVE_POLICY_PRECOMPENSATE = 1 /* boost, then hold by the model's inverse */
} drive_policy_kind_t;

/* What is said of a spring: which limit holds its target below what its level asks for, and where
 * it is not what it was asked to be; bits. */
typedef enum {
    DRIVE_POLICY_LIMIT_NONE = 0,
    DRIVE_POLICY_LIMIT_SAFETY = 1,      /* locked or faulted: not driven */
    DRIVE_POLICY_LIMIT_CURRENT = 2,     /* maximum current of one spring */
    DRIVE_POLICY_LIMIT_SUPPLY = 4,      /* sum of currents */
    DRIVE_POLICY_LIMIT_TEMPERATURE = 8, /* its own temperature */
    DRIVE_POLICY_LIMIT_UNDRIVEN = 16,   /* an undriven neighbour would come near austenite start */
    DRIVE_POLICY_LIMIT_OVERLOAD = 32, /* the board was above its continuous current for too long */
    DRIVE_POLICY_LIMIT_TRIP = 64,     /* a limit stayed fully derated: off until cleared */
    DRIVE_POLICY_LIMIT_BLIND = 128,   /* its resistance proves no phase: the model alone */
    DRIVE_POLICY_LIMIT_COOLING = 256, /* it may still be hot from before power-on: it waits */
    DRIVE_POLICY_LIMIT_AWAY = 512     /* not where it was asked to be, or that cannot be seen */
} drive_policy_limit_t;

/* What a spring is doing under DRIVE_POLICY_PRECOMPENSATE. */
typedef enum {
    DRIVE_POLICY_STAGE_OFF = 0,
    DRIVE_POLICY_STAGE_HEAT, /* up to the wanted phase, as fast as the limits allow, in turn */
    DRIVE_POLICY_STAGE_HOLD, /* inside the hysteresis band, just above martensite start */
    DRIVE_POLICY_STAGE_LOWER /* cooling to a lower wanted phase */
} drive_policy_stage_t;

typedef struct {
    float margin_k;         /* of the hold, above martensite start */
    float severity;         /* undriven: 0 .. 1 at its limit */
    float rise_k_per_s;     /* of its temperature, over seconds */
    uint16_t limits;        /* drive_policy_limit_t bits that act */
    uint16_t derating;      /* of them, those behind ceiling_ma */
    uint16_t wanted_ma;     /* before limits */
    uint16_t floor_ma;      /* while it heats: what it has comes before other boosts */
    uint16_t ceiling_ma;    /* by derating */
    uint16_t granted_ma;    /* share of the supply, before dither */
    uint16_t target_ma;     /* given in the last tick */
    uint16_t derated_turns; /* fully, on end */
    spring_away_t away;     /* since it was asked for */
    uint8_t stage;          /* drive_policy_stage_t */
    uint8_t asked;          /* its level, in steps of 4 permille */
    bool released : 1;      /* switched off hot: no false actuation */
    bool tripped : 1;
    bool partly : 1; /* its stage, or the last one, began at a level of the phase */
} drive_policy_spring_t;

typedef struct {
    drive_policy_parameters_t parameters;
    uint8_t springs;
    uint8_t columns;
    supply_queue_t queue;       /* springs that heat; up to here all is by settings alone */
    uint16_t overload_quarters; /* of a second */
    uint16_t sum_ma;            /* of the last targets */
    uint8_t sweep;              /* of the dither */
    uint8_t walks;              /* turns in which no target jumps: the policy has changed */
    drive_policy_spring_t spring[DRIVE_POLICY_MAX_SPRINGS];
} drive_policy_t;

typedef struct {
    /* What is believed, after its tick. It is read, and told what is done to a spring: that it
     * heats, holds, is left, that its current jumps. Of the model temperatures are read; a hold's
     * beginning corrects them, which is the belief's. */
    spring_estimator_t *belief;
    thermal_model_t *model;
    const uint16_t *level_permille; /* wanted per spring, 0..1000 */
    const bool *allowed;            /* by safety, per spring */
    uint16_t maximum_current_ma;    /* of one spring */
    uint16_t supply_limit_ma;       /* of the sum */
} drive_policy_input_t;

/* Fails if and only if a parameter is outside its row's range, or unsure_margin_k is below
 * hold_margin_k; then *bad (may be NULL) is the row of parameters.def. */
bool drive_policy_check(const drive_policy_parameters_t *parameters, uint16_t *bad);

/* All springs are off. Fails (false, nothing changed) as drive_policy_check does. */
bool drive_policy_init(drive_policy_t *policy, const drive_policy_parameters_t *parameters,
                       const thermal_model_t *model, uint16_t *bad);
/* Replaces the parameters, and takes over those of the model; the rest stays. Fails as
 * drive_policy_check does. */
bool drive_policy_apply(drive_policy_t *policy, const drive_policy_parameters_t *parameters,
                        const thermal_model_t *model, uint16_t *bad);

/* One tick (20 ms), after that of the belief. The targets' sum never exceeds supply_limit_ma -
 * supply_reserve_ma. A spring is off in the tick in which its level is 0 or it is not allowed. What
 * else is decided of it follows in its turn, once it was believed anew: four times a second. */
void drive_policy_tick(drive_policy_t *policy, const drive_policy_input_t *input,
                       uint16_t target_ma[]);

/* Bits of drive_policy_limit_t of the last tick. */
uint16_t drive_policy_limits(const drive_policy_t *policy, uint8_t spring);
/* By how much limits cut the current that it asked for, mA. */
uint16_t drive_policy_cut_ma(const drive_policy_t *policy, uint8_t spring);
drive_policy_stage_t drive_policy_stage(const drive_policy_t *policy, uint8_t spring);
/* Trips are forgotten. */
void drive_policy_clear(drive_policy_t *policy);

#ifdef __cplusplus
}
#endif
#endif
