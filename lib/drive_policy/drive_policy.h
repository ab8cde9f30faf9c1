/* What it is for: turns wanted levels into target currents, within the limits of springs and
 * supply.
 * What it owns: the choice of policy, each spring's stage (heat, hold, lower), the observer of its
 * resistance, the derating and the queue for the shared supply.
 * What it never does: close a current loop, switch an output, divide or use floating point in a
 * tick. */
#ifndef DRIVE_POLICY_H
#define DRIVE_POLICY_H

#include <stdbool.h>
#include <stdint.h>

#include "parameters.h"
#include "resistance_observer.h"
#include "supply_share.h"
#include "thermal_model.h"

#ifdef __cplusplus
extern "C" {
#endif

#define DRIVE_POLICY_MAX_SPRINGS THERMAL_MODEL_MAX_SPRINGS
#define DRIVE_POLICY_LEVEL_FULL  1000u /* permille */
#define DRIVE_POLICY_ROUND       10u /* updates, one a tick: a spring each, then the supply's share */

typedef enum {
    DRIVE_POLICY_OPEN = 0,         /* a set current while on, nothing while off: the paper's way */
    DRIVE_POLICY_PRECOMPENSATE = 1 /* boost, then hold by the model's inverse */
} drive_policy_kind_t;

/* Which limit holds a spring's target below what its level asks for; bits. */
typedef enum {
    DRIVE_POLICY_LIMIT_NONE = 0,
    DRIVE_POLICY_LIMIT_SAFETY = 1,      /* locked or faulted: not driven */
    DRIVE_POLICY_LIMIT_CURRENT = 2,     /* maximum current of one spring */
    DRIVE_POLICY_LIMIT_SUPPLY = 4,      /* sum of currents */
    DRIVE_POLICY_LIMIT_TEMPERATURE = 8, /* its own temperature */
    DRIVE_POLICY_LIMIT_UNDRIVEN = 16,   /* an undriven neighbour would come near austenite start */
    DRIVE_POLICY_LIMIT_OVERLOAD = 32, /* the board was above its continuous current for too long */
    DRIVE_POLICY_LIMIT_TRIP = 64,     /* a limit stayed fully derated: off until cleared */
    DRIVE_POLICY_LIMIT_BLIND = 128    /* not a limit: the resistance is not trusted here, phase
                                         and level are the model's alone */
} drive_policy_limit_t;

/* What a spring is doing under DRIVE_POLICY_PRECOMPENSATE. */
typedef enum {
    DRIVE_POLICY_STAGE_OFF = 0,
    DRIVE_POLICY_STAGE_HEAT, /* up to the wanted phase, as fast as the limits allow, in turn */
    DRIVE_POLICY_STAGE_HOLD, /* inside the hysteresis band, just above martensite start */
    DRIVE_POLICY_STAGE_LOWER /* cooling to a lower wanted phase */
} drive_policy_stage_t;

typedef struct {
    resistance_observer_t observer; /* first: what every tick touches */
    uint16_t granted_ma;            /* share of the supply, before dither */
    uint16_t target_ma;             /* given in the last tick */
    uint8_t stage;                  /* drive_policy_stage_t */
    uint8_t flags;                  /* internal */
    uint8_t limits;                 /* that act */
    uint8_t severity;               /* undriven: 255 at its limit */
    uint8_t fresh;                  /* windows since current flows without a gap, saturating */
    uint16_t level_permille;        /* wanted when the shares were last worked out, open */
    uint16_t wanted_ma;             /* before limits */
    uint16_t asked_ma;              /* after all but the supply's */
    uint16_t ceiling_ma;            /* by derating */
    uint16_t floor_ma;              /* while it heats: what it has comes before other boosts */
    uint16_t reference_q14;         /* slow ratio before this hold began to lose phase */
    int16_t before_permille;        /* phase half a second ago */
    int16_t bias_uw_per_k;          /* loss beyond the model's */
    int32_t bias_now_uw;            /* the same at the present temperature */
    int16_t full_permille;          /* its phase as read when it had transformed */
    int16_t corrected_c7;           /* sum of the observer's corrections in this heating */
    int16_t margin_c7;              /* of the hold, above martensite start */
    int16_t last_c7;                /* temperature one update ago */
    int16_t lost_permille;          /* most phase that this hold was seen to lose */
    uint16_t derated_updates;
    uint8_t held;      /* seconds in this hold, saturating */
    int8_t followed;   /* steps that reference_q14 has wandered */
    uint8_t reference; /* windows that went into reference_q14 */
    uint8_t plateau;   /* windows: of constant resistance; in a hold, of too little phase */
    uint8_t suspicion; /* windows in which this hold may be losing phase */
    uint8_t derating;  /* limits behind ceiling_ma */
} drive_policy_spring_t;

typedef struct {
    drive_policy_parameters_t parameters;
    uint8_t springs;
    uint8_t columns;
    uint8_t tick;   /* counts to the next in which no spring is updated */
    uint8_t slot;   /* of the round in which each spring is updated once */
    uint8_t round;  /* counts */
    uint8_t sweep;  /* of the dither */
    uint8_t soft;   /* turns in which no target jumps: the policy has just changed */
    uint8_t severe; /* springs whose severity is not 0 */
    uint8_t reason; /* limit behind the supply's share */
    bool prepared;
    bool stale;     /* shares are worked out anew in the next tick */
    bool stops;     /* some spring is driven no longer */
    bool waiting;   /* some spring has less than it asks for */
    uint8_t probed; /* spring whose pulse it is */
    uint16_t probe_ticks;
    uint16_t maximum_ma; /* with which the shares were worked out */
    uint16_t supply_ma;
    uint16_t cap_ma;            /* of the holds, if the supply is too small for them */
    uint16_t budget_ma;         /* with which the shares were worked out */
    uint16_t sum_ma;            /* of the last targets */
    uint16_t left_ma;           /* of the budget: what no spring has been granted */
    uint16_t overload_quarters; /* s */
    supply_queue_t queue;       /* springs that heat */
    drive_policy_spring_t spring[DRIVE_POLICY_MAX_SPRINGS];
    /* derived, see drive_policy_prepare */
    resistance_alloy_t alloy;
    uint16_t overload_half_quarters;
    uint16_t overload_gain; /* 2^16 over that */
    uint16_t feedback_uw_per_c7;
    uint16_t correction_q8; /* Q9.7 K per permille of phase */
    uint16_t derating_gain; /* 2^16 over the band */
    int16_t bias_limit_uw_per_k;
    int16_t falling_uw_per_k; /* loss that a spring seems to lack while it is pulled below start */
    int16_t event_c7;         /* how far below martensite start its crossing is seen */
    int16_t hold_margin_c7;
    int16_t unsure_margin_c7;
    int16_t search_c7; /* per second */
    int16_t limit_c7;
    int16_t undriven_c7; /* undriven springs stay below */
} drive_policy_t;

typedef struct {
    thermal_model_t *model; /* temperatures as of the last model step; the observer corrects them */
    const uint16_t *level_permille; /* wanted per spring, 0..1000 */
    const bool *allowed;            /* by safety, per spring */
    uint16_t maximum_current_ma;    /* of one spring */
    uint16_t supply_limit_ma;       /* of the sum */
    const int16_t *measured_ma;     /* of the last tick; NULL: nothing is measured */
    const int16_t *measured_mv;
    const bool *valid; /* per spring: the two are readings of the last tick */
} drive_policy_input_t;

/* Fails if and only if a parameter is outside the range above; then *bad (may be NULL)
 * is its row of parameters.def. */
bool drive_policy_check(const drive_policy_parameters_t *parameters, uint16_t *bad);

/* Fails (false, nothing changed) if and only if springs is 0 or above DRIVE_POLICY_MAX_SPRINGS or a
 * parameter is outside the range above; then *bad names it (bad may be NULL). */
bool drive_policy_init(drive_policy_t *policy, const drive_policy_parameters_t *parameters,
                       uint8_t springs, uint16_t *bad);
/* Replaces the parameters. Fails as drive_policy_init does. */
bool drive_policy_apply(drive_policy_t *policy, const drive_policy_parameters_t *parameters,
                        uint16_t *bad);

/* What the ticks need of the model's parameters, worked out with divisions: call it after init,
 * after apply and whenever the model's parameters change. Without it only DRIVE_POLICY_OPEN drives.
 */
void drive_policy_prepare(drive_policy_t *policy, const thermal_model_t *model);

/* One tick (20 ms). The targets' sum never exceeds supply_limit_ma - supply_reserve_ma. A spring is
 * off in the tick in which its level is 0 or it is not allowed. What else it is given follows once
 * four times a second: each in one of DRIVE_POLICY_ROUND ticks, and every fifth tick updates none.
 */
void drive_policy_tick(drive_policy_t *policy, const drive_policy_input_t *input,
                       uint16_t target_ma[]);

/* Measured power of a spring less the loss that the observer found beyond the model's: what the
 * model must be stepped with, uW. */
uint32_t drive_policy_model_power_uw(const drive_policy_t *policy, uint8_t spring,
                                     uint32_t power_uw);

/* Bits of drive_policy_limit_t that acted on the spring in the last tick. */
uint8_t drive_policy_limits(const drive_policy_t *policy, uint8_t spring);
/* By how much they cut the current that it asked for, mA. */
uint16_t drive_policy_cut_ma(const drive_policy_t *policy, uint8_t spring);
drive_policy_stage_t drive_policy_stage(const drive_policy_t *policy, uint8_t spring);
/* The resistance of this spring is plausible, quiet and agrees with the model. */
bool drive_policy_observes(const drive_policy_t *policy, uint8_t spring);
/* Austenite as the resistance says, permille; outside 0..1000 by noise. */
int16_t drive_policy_phase_permille(const drive_policy_t *policy, uint8_t spring);
/* Trips are forgotten. */
void drive_policy_clear(drive_policy_t *policy);

#ifdef __cplusplus
}
#endif
#endif
