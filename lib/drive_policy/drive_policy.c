#include "drive_policy.h"

#include <stddef.h>

#include "fixed_point.h"

/* Each spring is updated once in a round, 0.25 s. Counts of updates and windows below are of those
 * quarters. */
#define UPDATES_PER_S 4u

/* A spring counts as wanted fully on from here: the last percent of a transformation has no level.
 */
#define LEVEL_FULL_PERMILLE  960
#define FULL_BAND_PERMILLE   60  /* less than it read when it had transformed: it is heated again */
#define COARSE_BAND_PERMILLE 150 /* the same where little current is a coarse reading */
#define FULL_MOST_PERMILLE   250
#define LEVEL_BAND_PERMILLE  50 /* a held level may be off by so much before it is sought again */

/* What the fast ratio must show before it moves the model; permille. */
#define PHASE_DEADBAND    40
#define PHASE_SEEN        60
#define PHASE_MISSING     100
#define PHASE_PROBED      120
#define PHASE_FALSE       (-1200) /* no such alloy: the voltage is wrong, and the power with it */
#define PHASE_FALSE_NOISY (-250)  /* nor one that changes so from one window to the next */

#define LOW_WINDOWS 3 /* in a hold */

#define MODEL_FULL_PERMILLE 985
#define RATIO_FULL_PERMILLE 900
#define PLATEAU_BOOST       12 /* less than this in a window: the transformation is over */
#define PLATEAU_SLOW        5
#define PLATEAU_TRUSTED     8 /* windows that end a heating against the model */

/* The slow ratio in a hold, permille of phase. */
#define LOSS_SUSPECTED    3 /* the search pauses */
#define LOSS_SEEN         5 /* martensite start was passed */
#define PAUSE_WINDOWS     12
#define SUSPICION_64UW    600 /* 38 mW stop a fall of 0.1 K/s */
#define FOLLOWED_MOST     12  /* 2^-14 of the ratio: three permille */
#define FULL_MINUTE       60u
#define LOSS_CONFIRMED    3 /* what a true sighting comes to once the average has settled */
#define LOSS_REHEAT       18
#define LOSS_RESTORED     8 /* heated again, once the loss is confirmed */
#define LOSS_IMPOSSIBLE   250
#define GAIN_IMPLAUSIBLE  45
#define REFERENCE_WINDOWS 40u
#define LEARNING_WINDOWS  2u /* fast pulses leave no more while it is cold */
#define FRESH_WINDOWS     4u

#define KELVIN_C7 128
#define TRUST_LIMIT_C7                                                                             \
    (25 * KELVIN_C7) /* heat put right in one heating, over heat capacity; more: the reading is    \
                      * wrong. A capacity that is 15 % off makes 16 K, a loss 4 K */
#define CERTAIN_C7         (20 * KELVIN_C7) /* below austenite start: martensite for certain */
#define SHORT_MOST_C7      (20 * KELVIN_C7)
#define KEPT_C7            (3 * KELVIN_C7) /* above austenite start what was reached is worth keeping */
#define COASTING_C7        (5 * KELVIN_C7) /* margin right after a boost while others heat */
#define COASTING_RISE_C7   8               /* and its rise in a second */
#define TURN_C7            (6 * KELVIN_C7) /* colder than one that heats: it is its turn */
#define GOES_ON_C7         (4 * KELVIN_C7) /* below austenite start: keeps its turn */
#define SETTLED_C7         (3 * KELVIN_C7 / 2)
#define AFTER_BOOST_C7     (4 * KELVIN_C7) /* margin added until the heating has settled */
#define BLIND_OVERSHOOT_C7 (4 * KELVIN_C7)
#define PIN_C7             (KELVIN_C7 / 2) /* model is not believed this far below a start unseen */
#define PULL_C7            (KELVIN_C7 * 5 / 16) /* and the hold asks for so much less: 0.08 K/s */
#define UNDRIVEN_BAND_C7   (5 * KELVIN_C7)
#define UNDRIVEN_GAIN_Q8   102  /* 255 / UNDRIVEN_BAND_C7 */
#define HORIZON_UPDATES    24   /* 6 s: undriven springs are predicted so far */
#define PARTIAL_POWER_64UW 6250 /* 0.4 W beyond the hold: heating to a level slows down */

#define SOFT_MA         20                             /* per tick, after a change of policy */
#define SOFT_TURNS      (2u * DRIVE_POLICY_ROUND + 1u) /* every spring has had two */
#define LEAST_BOOST_MA  200u                           /* less is not worth waiting for */
#define JUMP_MA         100u
#define PROBE_TICKS     58u /* four windows */
#define CURRENT_MOST_MA 3200

enum {
    FLAG_LEARNT = 1,   /* martensite start was seen: the loss is known */
    FLAG_LET_GO = 2,   /* the resistance contradicts the model: not used until cold */
    FLAG_RELEASED = 4, /* switched off hot: no false actuation */
    FLAG_TRIPPED = 8,
    FLAG_DOUBT = 16,    /* martensite start was seen, but the average has not settled */
    FLAG_FALSE = 32,    /* what is read is no resistance of this alloy, its product no power */
    FLAG_SEEN_ONCE = 64 /* martensite start: far off, or the average did not confirm it */
};

static int16_t clamp16(int32_t value, int16_t low, int16_t high)
{
    return value < low ? low : value > high ? high : (int16_t)value;
}

/* ---- parameters ---- */

void drive_policy_parameters_default(drive_policy_parameters_t *parameters)
{
    static const drive_policy_parameters_t usual FLASH_MEMORY = {.policy = DRIVE_POLICY_OPEN,
                                                                 .open_current_ma = 1500,
                                                                 .supply_reserve_ma = 200,
                                                                 .boost_current_ma = 3000,
                                                                 .probe_current_ma = 400,
                                                                 .dither_ma = 300,
                                                                 .hold_margin_cc = 250,
                                                                 .unsure_margin_cc = 1200,
                                                                 .search_mk_per_s = 80,
                                                                 .observer = 1,
                                                                 .probe_period_s = 0,
                                                                 .temperature_limit_cc = 11000,
                                                                 .temperature_band_cc = 1000,
                                                                 .undriven_margin_cc = 500,
                                                                 .overload_current_ma = 14000,
                                                                 .overload_time_s = 300,
                                                                 .trip_time_s = 30};
    flash_copy(parameters, &usual, sizeof usual);
}

#define RANGE(field, type, minimum, maximum)                                                       \
    PARAMETER_RANGE(drive_policy_parameters_t, field, type, minimum, maximum)
const drive_policy_ranges_t drive_policy_ranges FLASH_MEMORY = {
    RANGE(policy, U8, DRIVE_POLICY_OPEN, DRIVE_POLICY_PRECOMPENSATE),
    RANGE(open_current_ma, U16, 0, CURRENT_MOST_MA),
    RANGE(supply_reserve_ma, U16, 0, 10000),
    RANGE(boost_current_ma, U16, 100, CURRENT_MOST_MA),
    RANGE(probe_current_ma, U16, 100, 1000),
    RANGE(dither_ma, U16, 0, 400),
    RANGE(hold_margin_cc, U16, 50, 3000),
    RANGE(unsure_margin_cc, U16, 50, 5000),
    RANGE(search_mk_per_s, U16, 0, 1000),
    RANGE(observer, U8, 0, 1),
    RANGE(probe_period_s, U8, 0, 250),
    RANGE(temperature_limit_cc, S16, -4000, 20000),
    RANGE(temperature_band_cc, U16, 100, 5000),
    RANGE(undriven_margin_cc, U16, 0, 5000),
    RANGE(overload_current_ma, U16, 100, 60000),
    RANGE(overload_time_s, U16, 1, 3000),
    RANGE(trip_time_s, U16, 0, 600)};

bool drive_policy_check(const drive_policy_parameters_t *p, uint16_t *bad)
{
    if (!parameter_check(p, &drive_policy_ranges, sizeof drive_policy_ranges, bad)) {
        return false;
    }
    if (p->unsure_margin_cc < p->hold_margin_cc) {
        if (bad != NULL) {
            *bad = offsetof(drive_policy_parameters_t, unsure_margin_cc);
        }
        return false;
    }
    return true;
}

bool drive_policy_apply(drive_policy_t *policy, const drive_policy_parameters_t *parameters,
                        uint16_t *bad)
{
    if (!drive_policy_check(parameters, bad)) {
        return false;
    }
    if (policy->parameters.policy != parameters->policy) {
        policy->soft = SOFT_TURNS;
    }
    if (policy->parameters.supply_reserve_ma != parameters->supply_reserve_ma) {
        policy->supply_ma = 0; /* a lower budget holds at once */
    }
    policy->parameters = *parameters;
    policy->prepared = false;
    policy->stale = true;
    return true;
}

bool drive_policy_init(drive_policy_t *policy, const drive_policy_parameters_t *parameters,
                       uint8_t springs, uint16_t *bad)
{
    if (springs == 0 || springs > DRIVE_POLICY_MAX_SPRINGS) {
        return false;
    }
    if (!drive_policy_check(parameters, bad)) {
        return false;
    }
    *policy = (drive_policy_t){
        .parameters = *parameters, .springs = springs, .columns = springs, .stale = true};
    for (uint8_t k = 0; k < springs; k++) {
        drive_policy_spring_t *s = &policy->spring[k];
        s->ceiling_ma = parameters->boost_current_ma;
    }
    return true;
}

void drive_policy_prepare(drive_policy_t *policy, const thermal_model_t *model)
{
    const drive_policy_parameters_t *p = &policy->parameters;
    const thermal_model_parameters_t *m = &model->parameters;
    if (policy->estimator.springs == 0) {
        spring_estimator_init(&policy->estimator, (thermal_model_t *)model, 120.0f);
        spring_estimator_cold(&policy->estimator, (thermal_model_t *)model);
    }
    spring_estimator_prepare(&policy->estimator, model);
    policy->columns = m->columns;

    policy->limit_c7 = fixed_point_c7_from_cc((int16_t)p->temperature_limit_cc);
    uint16_t band_c7 = (uint16_t)fixed_point_c7_from_cc((int16_t)p->temperature_band_cc);
    policy->derating_gain = (uint16_t)(65535u / band_c7);
    policy->undriven_c7 =
        fixed_point_c7_from_cc((int16_t)(m->austenite_start_cc - (int16_t)p->undriven_margin_cc));
    policy->overload_half_quarters = (uint16_t)(p->overload_time_s * 2u);
    policy->overload_gain = (uint16_t)(65535u / policy->overload_half_quarters);
    policy->prepared = true;
}

/* ---- stages ---- */

#define PER_K (1.0f / 128.0f)
#define SETTLED_TURNS 45

static float now_c(const thermal_model_t *model, uint8_t k)
{
    return (float)thermal_model_temperature_c7(model, k) * PER_K;
}

static int16_t model_permille(const thermal_model_t *model, uint8_t k)
{
    return (int16_t)(((uint32_t)thermal_model_austenite(model, k) * 125u) >> 12);
}

uint32_t drive_policy_model_power_uw(const drive_policy_t *policy, const thermal_model_t *model, uint8_t spring,
                                     uint32_t power_uw)
{
    return policy->prepared ? spring_estimator_model_power_uw(&policy->estimator, model, spring, power_uw)
                            : power_uw;
}

static int16_t phase_permille(const drive_policy_t *policy, const thermal_model_t *model, uint8_t k)
{
    return (int16_t)(1000.0f * spring_estimator_austenite(&policy->estimator, model, k).value);
}

/* The margin above martensite start that the uncertainty of the distance asks for. */
static float safe_margin_k(const drive_policy_t *policy, uint8_t k, bool full)
{
    const drive_policy_parameters_t *p = &policy->parameters;
    const spring_belief_t *b = &policy->estimator.spring[k];
    const float hold_k = 0.01f * (float)p->hold_margin_cc;
    const float band_k = policy->estimator.austenite_start_c - policy->estimator.martensite_start_c;
    float most_k = 0.01f * (float)p->unsure_margin_cc;
    if (!full && most_k > band_k - 1.0f) {
        most_k = band_k - 1.0f; /* above it a level would rise */
    }
    const float margin_k = hold_k + 1.6f * (spring_estimator_sd_k(b) - 1.5f) + b->disturbance_k;
    return margin_k < hold_k ? hold_k : margin_k > most_k ? most_k : margin_k;
}

static void enter(drive_policy_t *policy, thermal_model_t *model, uint8_t k, drive_policy_stage_t stage, int16_t level)
{
    drive_policy_spring_t *s = &policy->spring[k];
    supply_queue_remove(&policy->queue, k);
    if (stage == DRIVE_POLICY_STAGE_HEAT) {
        supply_queue_add(&policy->queue, k);
        spring_estimator_begin_heating(&policy->estimator.spring[k]);
    } else if (stage == DRIVE_POLICY_STAGE_HOLD) {
        spring_estimator_begin_hold(&policy->estimator, model, k, level >= LEVEL_FULL_PERMILLE);
    }
    s->floor_ma = s->stage == DRIVE_POLICY_STAGE_HOLD ? s->wanted_ma : 0; /* until its turn */
    s->stage = (uint8_t)stage;
    s->wanted_ma = stage == DRIVE_POLICY_STAGE_HEAT  ? policy->parameters.boost_current_ma
                   : stage == DRIVE_POLICY_STAGE_OFF ? 0
                                                     : policy->parameters.probe_current_ma;
    s->margin_k = 100.0f;
}

/* What heats a spring at a temperature, against its neighbours as they are now, plus a correction
 * towards it. */
static uint16_t hold_current_ma(const drive_policy_t *policy, const thermal_model_t *model, uint8_t k,
                                float target_c, float extra_w)
{
    float short_k = target_c - now_c(model, k);
    short_k = short_k > 20.0f ? 20.0f : short_k < -20.0f ? -20.0f : short_k;
    const float power_w = spring_estimator_hold_w(&policy->estimator, model, k, target_c) +
                          short_k * policy->estimator.heat_capacity_j_per_k / 4.0f + extra_w;
    return spring_estimator_current_ma(&policy->estimator, k, power_w);
}

/* It heats with much less than it asks for. */
static bool waits_for_supply(const drive_policy_spring_t *s)
{
    return s->granted_ma < s->asked_ma - (s->asked_ma >> 2);
}

static bool has_heated(const drive_policy_t *policy, const thermal_model_t *model, uint8_t k, int16_t level)
{
    if (level < LEVEL_FULL_PERMILLE) {
        return phase_permille(policy, model, k) >= level;
    }
    return spring_estimator_has_transformed(&policy->estimator, model, k);
}

static void heat(drive_policy_t *policy, drive_policy_spring_t *s, thermal_model_t *model, uint8_t k, int16_t level)
{
    const float c = now_c(model, k);
    bool waits = waits_for_supply(s);
    bool slows = level < LEVEL_FULL_PERMILLE && c > policy->estimator.austenite_start_c - 1.0f;
    const bool derated = s->ceiling_ma < policy->parameters.boost_current_ma - (policy->parameters.boost_current_ma >> 2) && c > policy->estimator.austenite_finish_c;
    if (has_heated(policy, model, k, level) || derated) {
        enter(policy, model, k, DRIVE_POLICY_STAGE_HOLD, level);
        return;
    }
    if (waits || slows) {
        uint16_t keeps_ma = hold_current_ma(policy, model, k, c, slows ? 0.4f : 0.0f);
        if (slows && keeps_ma < s->wanted_ma) {
            s->wanted_ma = keeps_ma;
        }
        bool has = c > policy->estimator.austenite_start_c + 3.0f || phase_permille(policy, model, k) > level >> 1;
        s->floor_ma = waits && has ? keeps_ma : 0;
    }
}

static void hold(drive_policy_t *policy, drive_policy_spring_t *s, thermal_model_t *model, uint8_t k, int16_t level)
{
    bool full = level >= LEVEL_FULL_PERMILLE;
    const spring_belief_t *b = &policy->estimator.spring[k];
    int16_t phase = phase_permille(policy, model, k);
    if (full ? b->lost > 0.03f || (b->lost > 0.008f && b->quiet >= SETTLED_TURNS)
             : phase < level - 2 * LEVEL_BAND_PERMILLE) {
        enter(policy, model, k, DRIVE_POLICY_STAGE_HEAT, level);
        return;
    }
    if (!full && phase > level + LEVEL_BAND_PERMILLE) {
        enter(policy, model, k, DRIVE_POLICY_STAGE_LOWER, level);
        return;
    }
    /* as wide as it must be, until martensite start is looked for: narrower and narrower */
    const float safe_k = safe_margin_k(policy, k, full);
    const bool searches = full && !b->blind && spring_estimator_sd_k(b) > 3.0f;
    if (!searches || s->margin_k > safe_k) {
        s->margin_k = safe_k;
    } else if (b->quiet > SETTLED_TURNS && b->losing == 0 && s->margin_k > -1.0f) {
        s->margin_k -= 0.25e-3f * (float)policy->parameters.search_mk_per_s;
    }
    uint16_t wanted_ma = hold_current_ma(policy, model, k, policy->estimator.martensite_start_c + s->margin_k,
                                         b->losing != 0 ? 0.038f : 0.0f);
    wanted_ma = (uint16_t)(wanted_ma + (policy->parameters.dither_ma >> 1));
    if (wanted_ma < policy->parameters.probe_current_ma) {
        wanted_ma = policy->parameters.probe_current_ma;
    }
    s->wanted_ma = wanted_ma;
}

static void lower(drive_policy_t *policy, thermal_model_t *model, uint8_t k, int16_t level)
{
    int16_t phase = phase_permille(policy, model, k);
    if (phase <= level) {
        enter(policy, model, k,
              phase < level - LEVEL_BAND_PERMILLE ? DRIVE_POLICY_STAGE_HEAT : DRIVE_POLICY_STAGE_HOLD, level);
    }
}

/* Undriven: how near austenite start it is going to come, 255 at the limit. */
static uint8_t off(const drive_policy_t *policy, drive_policy_spring_t *s,
                       thermal_model_t *model, uint8_t k)
{
    int16_t now_c7 = thermal_model_temperature_c7(model, k);
    int16_t from_c7 = (int16_t)(policy->undriven_c7 - UNDRIVEN_BAND_C7);
    if (now_c7 < from_c7) {
        s->flags &= (uint8_t)~FLAG_RELEASED;
    }
    int16_t rise_c7 = clamp16((int32_t)now_c7 - s->last_c7, -256, 256);
    int16_t over_c7 = (int16_t)(now_c7 + rise_c7 * HORIZON_UPDATES - from_c7);
    if (over_c7 <= 0 || (s->flags & FLAG_RELEASED) != 0) {
        return 0;
    }
    if (over_c7 >= UNDRIVEN_BAND_C7) {
        return UINT8_MAX;
    }
    return (uint8_t)(((uint16_t)over_c7 * (uint16_t)UNDRIVEN_GAIN_Q8) >> 8);
}

/* ---- derating ---- */

/* Worst of the undriven neighbours; a driven spring has no severity. */
static uint8_t worst_neighbour(const drive_policy_t *policy, uint8_t k)
{
    uint8_t columns = policy->columns;
    uint8_t row_start = 0;
    while ((uint8_t)(k - row_start) >= columns) {
        row_start = (uint8_t)(row_start + columns);
    }
    uint8_t column = (uint8_t)(k - row_start);
    uint8_t left = column != 0 ? 1 : 0;
    uint8_t width = (uint8_t)(left + (column + 1u < columns ? 2u : 1u));
    uint8_t first = (uint8_t)(row_start == 0 ? k - left : k - left - columns);
    uint8_t worst = 0;
    for (uint16_t row = first; row <= (uint16_t)(k + columns) && row < policy->springs;
         row = (uint16_t)(row + columns)) {
        const drive_policy_spring_t *other = &policy->spring[row];
        for (uint8_t n = width; n != 0; n--, other++) {
            if (other->severity > worst) {
                worst = other->severity;
            }
        }
    }
    return worst;
}

static uint16_t share_q8(uint16_t value, uint16_t share)
{
    return (uint16_t)(fixed_point_mac_u16(0, value, share) >> 8);
}

static void derate(const drive_policy_t *policy, drive_policy_spring_t *s,
                       const thermal_model_t *model, uint8_t k, bool driven)
{
    uint16_t full_ma = policy->parameters.boost_current_ma;
    uint16_t share = 256;
    uint8_t limits = DRIVE_POLICY_LIMIT_NONE;
    int16_t room_c7 =
        clamp16((int32_t)policy->limit_c7 - thermal_model_temperature_c7(model, k), 0, INT16_MAX);
    uint32_t room_q16 = fixed_point_mac_u16(0, (uint16_t)room_c7, policy->derating_gain);
    if (room_q16 < 65000u) {
        share = (uint16_t)(room_q16 >> 8);
        limits = DRIVE_POLICY_LIMIT_TEMPERATURE;
    }
    uint16_t allowed = (uint16_t)(255u - (policy->severe != 0 ? worst_neighbour(policy, k) : 0u));
    if (allowed < 255u && allowed <= share) {
        share = allowed;
        limits |= DRIVE_POLICY_LIMIT_UNDRIVEN;
    }
    s->ceiling_ma = share_q8(full_ma, share);
    s->derating = limits;

    if (!driven) {
        s->derated_updates = 0;
        s->flags &= (uint8_t)~FLAG_TRIPPED;
    } else if (share == 0 && s->derated_updates < UINT16_MAX) {
        s->derated_updates++;
        if (policy->parameters.trip_time_s != 0 &&
            s->derated_updates >= policy->parameters.trip_time_s * UPDATES_PER_S) {
            s->flags |= FLAG_TRIPPED;
        }
    } else if (share != 0) {
        s->derated_updates = 0;
    }
}

/* ---- sharing the supply ---- */

/* A quarter of a second's overload; at most twice the time that is free of it. It is worked off
 * only once nobody asks for more: else what is derated would come and go. */
static void count_overload(drive_policy_t *policy)
{
    if (policy->sum_ma > policy->parameters.overload_current_ma) {
        if (policy->overload_quarters < 2u * policy->overload_half_quarters) {
            policy->overload_quarters++;
        }
    } else if (policy->overload_quarters != 0 && !policy->waiting) {
        policy->overload_quarters--;
    }
}

/* The sum of targets that is allowed now; the overload's share is taken off. */
static uint16_t budget_ma(drive_policy_t *policy)
{
    const drive_policy_parameters_t *p = &policy->parameters;
    uint16_t budget = policy->supply_ma > p->supply_reserve_ma
                          ? (uint16_t)(policy->supply_ma - p->supply_reserve_ma)
                          : 0;
    policy->reason = DRIVE_POLICY_LIMIT_SUPPLY;
    if (p->policy == DRIVE_POLICY_OPEN || !policy->prepared || budget <= p->overload_current_ma ||
        policy->overload_quarters <= policy->overload_half_quarters) {
        return budget;
    }
    policy->reason = DRIVE_POLICY_LIMIT_OVERLOAD;
    uint16_t over = (uint16_t)(policy->overload_quarters - policy->overload_half_quarters);
    uint16_t excess_ma = (uint16_t)(budget - p->overload_current_ma);
    uint16_t away_ma = excess_ma;
    if (over < policy->overload_half_quarters) {
        away_ma = fixed_point_high_u16(excess_ma, (uint16_t)(over * policy->overload_gain));
    }
    return (uint16_t)(budget - away_ma);
}

static void grant(drive_policy_t *policy, drive_policy_spring_t *s, uint16_t granted_ma)
{
    if ((uint16_t)(granted_ma + JUMP_MA - s->granted_ma) > 2u * JUMP_MA) {
        spring_estimator_disturb(&policy->estimator.spring[s - policy->spring]);
    }
    s->granted_ma = granted_ma;
    s->limits &= (uint8_t) ~(DRIVE_POLICY_LIMIT_SUPPLY | DRIVE_POLICY_LIMIT_OVERLOAD);
    if (granted_ma < s->asked_ma) {
        s->limits |= policy->reason;
        policy->waiting = true;
    }
}

/* Holds first, the largest cut to a common cap if they alone are too much; then those that heat,
 * one after the other: heat grows with the square of current. */
static void share(drive_policy_t *policy)
{
    uint16_t budget = budget_ma(policy);
    uint16_t fixed_ma[DRIVE_POLICY_MAX_SPRINGS];
    uint32_t sum_ma = 0;
    drive_policy_spring_t *s = policy->spring;
    for (uint8_t k = 0; k < policy->springs; k++, s++) {
        if (s->asked_ma > policy->maximum_ma) {
            s->asked_ma = policy->maximum_ma;
        }
        uint16_t asked_ma = s->asked_ma;
        if (s->stage == DRIVE_POLICY_STAGE_HEAT && s->floor_ma < asked_ma) {
            asked_ma = s->floor_ma;
        }
        fixed_ma[k] = asked_ma;
        sum_ma += asked_ma;
    }
    uint16_t cap_ma = UINT16_MAX;
    if (sum_ma > budget) {
        cap_ma = supply_share_cap_ma(fixed_ma, policy->springs, budget, policy->cap_ma);
        policy->cap_ma = cap_ma;
        sum_ma = budget;
    }
    uint16_t left_ma = (uint16_t)(budget - sum_ma);
    policy->waiting = false;
    s = policy->spring;
    for (uint8_t k = 0; k < policy->springs; k++, s++) {
        if (fixed_ma[k] > cap_ma) {
            fixed_ma[k] = cap_ma;
        }
        if (s->stage != DRIVE_POLICY_STAGE_HEAT) {
            grant(policy, s, fixed_ma[k]);
        }
    }
    for (uint8_t n = 0; n < policy->queue.count; n++) {
        uint8_t k = policy->queue.spring[n];
        s = &policy->spring[k];
        if (s->stage != DRIVE_POLICY_STAGE_HEAT) {
            continue; /* just switched off */
        }
        uint16_t more_ma = (uint16_t)(s->asked_ma - fixed_ma[k]);
        if (more_ma > left_ma) {
            more_ma = left_ma >= LEAST_BOOST_MA ? left_ma : 0;
        }
        grant(policy, s, (uint16_t)(fixed_ma[k] + more_ma));
        left_ma = (uint16_t)(left_ma - more_ma);
    }
    policy->left_ma = left_ma;
    policy->budget_ma = budget;
    policy->stale = false;
}

/* The last ones to heat take turns while they are cold: else the very last heats alone, with most
 * of the supply unused. Far more that wait are better served one after the other. */
static void rotate_queue(drive_policy_t *policy, const thermal_model_t *model)
{
    int16_t coldest_c7 = INT16_MAX; /* of those that wait */
    int16_t warmest_c7 = INT16_MIN; /* of those that heat, but have not begun to transform */
    uint8_t warmest = 0;
    int8_t room = 0; /* that heat, less twice those that wait */
    for (uint8_t n = 0; n < policy->queue.count; n++) {
        uint8_t k = policy->queue.spring[n];
        const drive_policy_spring_t *s = &policy->spring[k];
        int16_t now_c7 = thermal_model_temperature_c7(model, k);
        if (s->granted_ma < s->asked_ma >> 1) {
            room = (int8_t)(room - 2);
            coldest_c7 = now_c7 < coldest_c7 ? now_c7 : coldest_c7;
        } else {
            room++;
            if (now_c7 > warmest_c7 && now_c7 < model->austenite_start_c7 - GOES_ON_C7) {
                warmest_c7 = now_c7;
                warmest = k;
            }
        }
    }
    if (room >= 0 && warmest_c7 > TURN_C7 && warmest_c7 - TURN_C7 > coldest_c7) {
        supply_queue_remove(&policy->queue, warmest);
        supply_queue_add(&policy->queue, warmest);
    }
}

/* What one spring asks for now: less at once, more as far as nobody else is to have it. */
static void ask(drive_policy_t *policy, const drive_policy_input_t *input,
                    drive_policy_spring_t *s)
{
    uint16_t asked_ma = s->wanted_ma;
    uint8_t limits = DRIVE_POLICY_LIMIT_NONE;
    if (policy->parameters.policy != DRIVE_POLICY_OPEN) {
        if (s->ceiling_ma < asked_ma) {
            asked_ma = s->ceiling_ma;
            limits = s->derating;
        }
        if (policy->estimator.spring[s - policy->spring].blind) {
            limits |= DRIVE_POLICY_LIMIT_BLIND;
        }
    }
    if (asked_ma > input->maximum_current_ma) {
        asked_ma = input->maximum_current_ma;
        limits |= DRIVE_POLICY_LIMIT_CURRENT;
    }
    s->asked_ma = asked_ma;
    s->limits = limits;
    uint16_t had_ma = s->granted_ma;
    uint16_t gets_ma = asked_ma;
    if (asked_ma > had_ma) {
        uint16_t more_ma = (uint16_t)(asked_ma - had_ma);
        if (more_ma > policy->left_ma) {
            more_ma = policy->left_ma;
        }
        if (s->stage == DRIVE_POLICY_STAGE_HEAT &&
            (policy->waiting || had_ma + more_ma < asked_ma)) {
            more_ma = 0; /* in its turn */
        }
        gets_ma = (uint16_t)(had_ma + more_ma);
    }
    policy->left_ma = (uint16_t)(policy->left_ma + had_ma - gets_ma);
    grant(policy, s, gets_ma);
}

/* ---- one spring, once in a round ---- */

/* level / 1000 of current, without a division: to 1 mA. */
static uint16_t share_ma(uint16_t current_ma, uint16_t level_permille)
{
    if (level_permille >= DRIVE_POLICY_LEVEL_FULL) {
        return current_ma;
    }
    /* x 65.53 */
    uint16_t share_q16 =
        (uint16_t)(level_permille * 65u + (level_permille >> 1) + (level_permille >> 5));
    return fixed_point_high_u16(current_ma, share_q16);
}

/* The rest of what leaving a stage means waits for the spring's turn. */
static void stop(drive_policy_t *policy, drive_policy_spring_t *s)
{
    if (s->stage != DRIVE_POLICY_STAGE_OFF) {
        s->stage = DRIVE_POLICY_STAGE_OFF;
        s->flags |= FLAG_RELEASED;
    }
    policy->left_ma = (uint16_t)(policy->left_ma + s->granted_ma);
    s->wanted_ma = 0;
    s->asked_ma = 0;
    s->granted_ma = 0;
}

/* Switched on: it has the wanted phase, and time to keep it until the current flows. */
static bool is_there(const thermal_model_t *model, uint8_t k, int16_t level)
{
    int16_t permille = model_permille(model, k);
    if (level >= LEVEL_FULL_PERMILLE) {
        return permille >= MODEL_FULL_PERMILLE &&
               thermal_model_temperature_c7(model, k) > model->martensite_start_c7 + KELVIN_C7;
    }
    return permille >= level - LEVEL_BAND_PERMILLE;
}

static void precompensate(drive_policy_t *policy, const drive_policy_input_t *input,
                          drive_policy_spring_t *s, uint8_t k)
{
    thermal_model_t *model = input->model;
    int16_t level = (int16_t)input->level_permille[k];
    switch ((drive_policy_stage_t)s->stage) {
    case DRIVE_POLICY_STAGE_OFF:
        enter(policy, model, k,
              is_there(model, k, level) ? DRIVE_POLICY_STAGE_HOLD : DRIVE_POLICY_STAGE_HEAT, level);
        break;
    case DRIVE_POLICY_STAGE_HEAT:
        heat(policy, s, model, k, level);
        break;
    case DRIVE_POLICY_STAGE_HOLD:
        hold(policy, s, model, k, level);
        break;
    case DRIVE_POLICY_STAGE_LOWER:
        lower(policy, model, k, level);
        break;
    }
}

static void update(drive_policy_t *policy, const drive_policy_input_t *input,
                       drive_policy_spring_t *s, uint8_t k)
{
    bool open = policy->parameters.policy == DRIVE_POLICY_OPEN;
    bool driven = input->level_permille[k] != 0 && input->allowed[k];
    if (policy->prepared) {
        thermal_model_t *model = input->model;
        thermal_model_settle(model, k);
        spring_estimator_update(&policy->estimator, model, k);
        uint8_t severity = 0;
        if (!driven) {
            supply_queue_remove(&policy->queue, k);
            severity = off(policy, s, model, k);
        } else if (!open) {
            precompensate(policy, input, s, k);
        }
        policy->severe = (uint8_t)(policy->severe + (severity != 0) - (s->severity != 0));
        s->severity = severity;
        derate(policy, s, model, k, driven);
        s->last_c7 = thermal_model_temperature_c7(model, k);
    }
    if (driven && (s->flags & FLAG_TRIPPED) == 0) {
        if (open) {
            s->wanted_ma = share_ma(policy->parameters.open_current_ma, input->level_permille[k]);
        }
        ask(policy, input, s);
    }
}

/* A hash of the levels tells that one has changed. */
static void watch_levels(drive_policy_t *policy, const uint16_t *level)
{
    uint16_t hash = 0;
    for (uint8_t n = policy->springs; n != 0; n--) {
        hash = (uint16_t)((uint16_t)(hash << 1) + *level++);
    }
    policy->stale = policy->stale || hash != policy->levels;
    policy->levels = hash;
}

/* Limits, parameters or, under DRIVE_POLICY_OPEN, levels have changed: what all springs are given
 * is worked out anew. */
static void restart(drive_policy_t *policy, const drive_policy_input_t *input)
{
    const drive_policy_parameters_t *p = &policy->parameters;
    drive_policy_spring_t *s = policy->spring;
    for (uint8_t k = 0; p->policy == DRIVE_POLICY_OPEN && k < policy->springs; k++, s++) {
        s->stage = DRIVE_POLICY_STAGE_OFF;
        if (input->allowed[k] && (s->flags & FLAG_TRIPPED) == 0) {
            s->wanted_ma = share_ma(p->open_current_ma, input->level_permille[k]);
            s->asked_ma = s->wanted_ma;
        }
    }
    share(policy);
}

/* The work of this tick: one place of the round. */
static void take_turn(drive_policy_t *policy, const drive_policy_input_t *input)
{
    uint8_t slot = policy->slot;
    if (policy->soft != 0) {
        policy->soft--;
    }
    policy->slot = (uint8_t)(slot + 1u);
    if (policy->slot == DRIVE_POLICY_ROUND) {
        policy->slot = 0;
        policy->round++;
    }
    for (uint16_t k = slot; k < policy->springs; k = (uint16_t)(k + DRIVE_POLICY_ROUND)) {
        update(policy, input, &policy->spring[k], (uint8_t)k);
    }
    if (policy->slot == 0) {
        count_overload(policy);
        if (policy->waiting || policy->reason == DRIVE_POLICY_LIMIT_OVERLOAD ||
            policy->overload_quarters > policy->overload_half_quarters) {
            if (policy->prepared) {
                rotate_queue(policy, input->model);
            }
            share(policy);
        }
    }
}

/* ---- one tick ---- */

/* What is granted, less the dither: a slow triangle below, each spring at another place of it. Not
 * driven is off at once, whatever the update's turn. Returns the targets' sum. No calls in the
 * loop: they would cost its registers. */
static uint16_t give(drive_policy_t *policy, const uint16_t *level, const bool *allowed,
                         uint16_t *target_ma)
{
    uint8_t place = policy->sweep;
    policy->sweep = (uint8_t)(place + 1u);
    bool dithers = policy->parameters.policy != DRIVE_POLICY_OPEN;
    uint8_t step_ma = (uint8_t)(dithers ? policy->parameters.dither_ma >> 4 : 0u);
    bool keeps = policy->soft != 0; /* the last target, to walk from */
    bool stops = false;
    uint16_t sum_ma = 0;
    drive_policy_spring_t *s = policy->spring;
    for (uint8_t n = policy->springs; n != 0; n--) {
        uint16_t target = 0;
        uint8_t reason = DRIVE_POLICY_LIMIT_NONE;
        bool on = *level++ != 0;
        bool may = *allowed++;
        if (on && may && (s->flags & FLAG_TRIPPED) == 0) {
            target = s->granted_ma;
            if (s->stage != DRIVE_POLICY_STAGE_HEAT) { /* heat first */
                uint8_t height = place & 15u;
                if ((place & 16u) != 0) {
                    height ^= 15u;
                }
                uint16_t drop_ma = (uint16_t)((uint16_t)height * step_ma);
                if (target > drop_ma) {
                    target = (uint16_t)(target - drop_ma);
                }
            }
            sum_ma = (uint16_t)(sum_ma + target);
        } else {
            if (on) {
                reason = may ? DRIVE_POLICY_LIMIT_TRIP : DRIVE_POLICY_LIMIT_SAFETY;
            }
            s->limits = reason;
            if (s->wanted_ma != 0 || s->stage != DRIVE_POLICY_STAGE_OFF) {
                stops = true;
            }
        }
        if (!keeps) {
            s->target_ma = target;
        }
        *target_ma++ = target;
        s++;
        place = (uint8_t)(place + 7u);
    }
    policy->stops = stops;
    return sum_ma;
}

/* Springs that are driven no longer. */
static void stop_some(drive_policy_t *policy, const uint16_t *level, const bool *allowed)
{
    drive_policy_spring_t *s = policy->spring;
    for (uint8_t n = policy->springs; n != 0; n--, s++) {
        bool on = *level++ != 0;
        if (!*allowed++ || !on || (s->flags & FLAG_TRIPPED) != 0) {
            stop(policy, s);
        }
    }
}

/* After a change of policy a target walks from where it was, up as far as there is room: what the
 * last targets left of the budget. Returns the targets' sum. */
static uint16_t soften(drive_policy_t *policy, uint16_t *target_ma)
{
    uint16_t room_ma = 0;
    if (policy->sum_ma < policy->budget_ma) {
        room_ma = (uint16_t)(policy->budget_ma - policy->sum_ma);
    }
    bool walks = false;
    uint16_t sum_ma = 0;
    drive_policy_spring_t *s = policy->spring;
    for (uint8_t n = policy->springs; n != 0; n--, s++, target_ma++) {
        uint16_t last = s->target_ma;
        uint16_t target = *target_ma;
        if (s->wanted_ma == 0) {
            target = 0; /* off */
        } else if (target < last) {
            if (target + SOFT_MA < last) {
                target = (uint16_t)(last - SOFT_MA);
                walks = true;
            }
        } else {
            uint16_t rise_ma = (uint16_t)(target - last);
            if (rise_ma > SOFT_MA) {
                rise_ma = SOFT_MA;
                walks = true;
            }
            if (rise_ma > room_ma) {
                rise_ma = room_ma;
                walks = true;
            }
            room_ma = (uint16_t)(room_ma - rise_ma);
            target = (uint16_t)(last + rise_ma);
        }
        s->target_ma = target;
        *target_ma = target;
        sum_ma = (uint16_t)(sum_ma + target);
    }
    if (walks) {
        policy->soft = SOFT_TURNS;
    }
    return sum_ma;
}

/* Takes the readings of the last tick. */
static void listen(drive_policy_t *policy, const bool *valid, const int16_t *current_ma,
                       const int16_t *voltage_mv)
{
    drive_policy_spring_t *s = policy->spring;
    for (uint8_t n = policy->springs; n != 0; n--, s++, current_ma++, voltage_mv++) {
        if (*valid++) {
            spring_estimator_take(&policy->estimator.spring[s - policy->spring], *current_ma, *voltage_mv);
        }
    }
}

/* Undriven springs one after the other, in what the budget leaves. */
static void probe(drive_policy_t *policy, const drive_policy_input_t *input,
                      uint16_t target_ma[])
{
    const drive_policy_parameters_t *p = &policy->parameters;
    if (p->probe_period_s == 0 || p->policy == DRIVE_POLICY_OPEN || policy->soft != 0) {
        return;
    }
    uint16_t period = (uint16_t)(p->probe_period_s * 50u);
    policy->probe_ticks++;
    if (policy->probed < policy->springs) {
        uint8_t k = policy->probed;
        if (input->level_permille[k] != 0 || !input->allowed[k] ||
            policy->probe_ticks >= PROBE_TICKS) {
            policy->probed++;
            policy->probe_ticks = 0;
        } else if (p->probe_current_ma <= policy->left_ma) {
            policy->spring[k].target_ma = target_ma[k] = p->probe_current_ma;
        }
    } else if (policy->probe_ticks >= period) {
        policy->probed = 0;
        policy->probe_ticks = 0;
    }
}

void drive_policy_tick(drive_policy_t *policy, const drive_policy_input_t *input,
                       uint16_t target_ma[])
{
    bool limits_changed = policy->supply_ma != input->supply_limit_ma ||
                          policy->maximum_ma != input->maximum_current_ma;
    if (limits_changed) {
        policy->supply_ma = input->supply_limit_ma;
        policy->maximum_ma = input->maximum_current_ma;
        policy->soft = 0; /* a lower limit holds at once */
    }
    if (!input->model_stepped && policy->parameters.policy == DRIVE_POLICY_OPEN) {
        watch_levels(policy, input->level_permille);
    }
    if (limits_changed || (policy->stale && !input->model_stepped)) {
        restart(policy, input); /* takes the time of all else */
    } else {
        bool in_time = !input->model_stepped || policy->soft == 0;
        if (in_time && policy->prepared && input->valid != NULL) {
            listen(policy, input->valid, input->measured_ma, input->measured_mv);
        }
        if (!input->model_stepped) {
            take_turn(policy, input);
        }
    }
    uint16_t sum_ma = give(policy, input->level_permille, input->allowed, target_ma);
    if (policy->stops) {
        stop_some(policy, input->level_permille, input->allowed);
    }
    if (policy->soft != 0) {
        sum_ma = soften(policy, target_ma);
    }
    policy->sum_ma = sum_ma;
    probe(policy, input, target_ma);
}

uint8_t drive_policy_limits(const drive_policy_t *policy, uint8_t spring)
{
    return policy->spring[spring].limits;
}

uint16_t drive_policy_cut_ma(const drive_policy_t *policy, uint8_t spring)
{
    const drive_policy_spring_t *s = &policy->spring[spring];
    const uint8_t cutting = (uint8_t) ~(DRIVE_POLICY_LIMIT_BLIND | DRIVE_POLICY_LIMIT_SAFETY);
    if ((s->limits & cutting) == 0 || s->wanted_ma <= s->target_ma) {
        return 0;
    }
    return (uint16_t)(s->wanted_ma - s->target_ma);
}

drive_policy_stage_t drive_policy_stage(const drive_policy_t *policy, uint8_t spring)
{
    return (drive_policy_stage_t)policy->spring[spring].stage;
}

bool drive_policy_observes(const drive_policy_t *policy, uint8_t spring)
{
    return spring_estimator_sees(&policy->estimator.spring[spring]);
}

int16_t drive_policy_phase_permille(const drive_policy_t *policy, uint8_t spring)
{
    return (int16_t)(1000.0f * policy->estimator.spring[spring].lost);
}

void drive_policy_clear(drive_policy_t *policy)
{
    for (uint8_t k = 0; k < policy->springs; k++) {
        policy->spring[k].flags &= (uint8_t)~FLAG_TRIPPED;
        policy->spring[k].limits &= (uint8_t)~DRIVE_POLICY_LIMIT_TRIP;
        policy->spring[k].derated_updates = 0;
    }
}
