#include "drive_policy.h"

#include <stddef.h>

#define UPDATE_TICKS                                                                               \
    5u /* each spring is updated once in so many ticks, as the model is stepped                    \
        */

/* A spring counts as wanted fully on from here: the last percent of a transformation has no level.
 */
#define LEVEL_FULL_PERMILLE 960
#define LEVEL_BAND_PERMILLE 50 /* a held level may be off by so much before it is sought again */

/* What the fast ratio must show before it moves the model; permille. */
#define PHASE_DEADBAND 40
#define PHASE_SEEN     60
#define PHASE_MISSING  100
#define PHASE_PROBED   120

#define MODEL_FULL_PERMILLE 985
#define RATIO_FULL_PERMILLE 900
#define PLATEAU_PERMILLE    15 /* less than this in half a second: the transformation is over */
#define PLATEAU_TRUSTED     3  /* half seconds that end a heating against the model */

/* The slow ratio in a hold, permille of phase. */
#define LOSS_SUSPECTED    3 /* the search pauses */
#define LOSS_SEEN         6 /* for SEEN_WINDOWS: martensite start was passed */
#define SEEN_WINDOWS      10
#define PAUSE_WINDOWS     30
#define LOSS_CERTAIN      10  /* at once */
#define SUSPICION_64UW    470 /* 30 mW stop a fall of 0.1 K/s */
#define SETTLE_WINDOWS    50  /* after a loss was seen the average still moves */
#define LOSS_REHEAT       18
#define GAIN_IMPLAUSIBLE  45
#define REFERENCE_WINDOWS 100u
#define FRESH_WINDOWS     8u

#define KELVIN_C7          128
#define TRUST_LIMIT_C7     (15 * KELVIN_C7) /* corrections beyond this: the reading is wrong */
#define CERTAIN_C7         (20 * KELVIN_C7) /* below austenite start: martensite for certain */
#define SETTLED_C7         (3 * KELVIN_C7 / 2)
#define AFTER_BOOST_C7     (4 * KELVIN_C7) /* margin added until the heating has settled */
#define BLIND_OVERSHOOT_C7 (4 * KELVIN_C7)
#define PIN_C7             (KELVIN_C7 / 2) /* model is not believed this far below a start unseen */
#define PULL_C7            (KELVIN_C7 * 5 / 16) /* and the hold asks for so much less: 0.08 K/s */
#define UNDRIVEN_BAND_C7   (5 * KELVIN_C7)
#define UNDRIVEN_GAIN_Q8   102  /* 255 / UNDRIVEN_BAND_C7 */
#define HORIZON_UPDATES    64   /* 6.4 s: undriven springs are predicted so far */
#define PARTIAL_POWER_64UW 6250 /* 0.4 W beyond the hold: heating to a level slows down */

#define SOFT_MA         20                       /* per tick, after a change of policy */
#define SOFT_TICKS      (2u * UPDATE_TICKS + 2u) /* every spring has had two turns */
#define LEAST_BOOST_MA  200                      /* less is not worth waiting for */
#define PROBE_TICKS     50u
#define CURRENT_MOST_MA 3200

enum {
    FLAG_LEARNT = 1,   /* martensite start was seen: the loss is known */
    FLAG_LET_GO = 2,   /* the resistance contradicts the model: not used until cold */
    FLAG_RELEASED = 4, /* switched off hot: no false actuation */
    FLAG_TRIPPED = 8
};

static int16_t clamp16(int32_t value, int16_t low, int16_t high)
{
    return value < low ? low : value > high ? high : (int16_t)value;
}

/* ---- parameters ---- */

static bool refuse(uint16_t *bad, size_t offset)
{
    if (bad != NULL) {
        *bad = (uint16_t)offset;
    }
    return false;
}

void drive_policy_parameters_default(drive_policy_parameters_t *parameters)
{
    *parameters = (drive_policy_parameters_t){.policy = DRIVE_POLICY_OPEN,
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
}

static bool outside(int32_t value, int32_t low, int32_t high)
{
    return value < low || value > high;
}

#define REFUSE_UNLESS(field, low, high)                                                            \
    if (outside(p->field, low, high)) {                                                            \
        return refuse(bad, offsetof(drive_policy_parameters_t, field));                            \
    }

bool drive_policy_check(const drive_policy_parameters_t *p, uint16_t *bad)
{
    REFUSE_UNLESS(policy, DRIVE_POLICY_OPEN, DRIVE_POLICY_PRECOMPENSATE)
    REFUSE_UNLESS(open_current_ma, 0, CURRENT_MOST_MA)
    REFUSE_UNLESS(supply_reserve_ma, 0, 10000)
    REFUSE_UNLESS(boost_current_ma, 100, CURRENT_MOST_MA)
    REFUSE_UNLESS(probe_current_ma, 100, 1000)
    REFUSE_UNLESS(dither_ma, 0, 400)
    REFUSE_UNLESS(hold_margin_cc, 50, 3000)
    REFUSE_UNLESS(unsure_margin_cc, p->hold_margin_cc, 5000)
    REFUSE_UNLESS(search_mk_per_s, 0, 1000)
    REFUSE_UNLESS(observer, 0, 1)
    REFUSE_UNLESS(probe_period_s, 0, 250)
    REFUSE_UNLESS(temperature_limit_cc, -4000, 20000)
    REFUSE_UNLESS(temperature_band_cc, 100, 5000)
    REFUSE_UNLESS(undriven_margin_cc, 0, 5000)
    REFUSE_UNLESS(overload_current_ma, 100, 60000)
    REFUSE_UNLESS(overload_time_s, 1, 3000)
    REFUSE_UNLESS(trip_time_s, 0, 600)
    return true;
}

bool drive_policy_apply(drive_policy_t *policy, const drive_policy_parameters_t *parameters,
                        uint16_t *bad)
{
    if (!drive_policy_check(parameters, bad)) {
        return false;
    }
    if (policy->parameters.policy != parameters->policy) {
        policy->soft = SOFT_TICKS;
    }
    policy->parameters = *parameters;
    policy->prepared = false;
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
    *policy = (drive_policy_t){.parameters = *parameters, .springs = springs, .columns = springs};
    for (uint8_t k = 0; k < springs; k++) {
        drive_policy_spring_t *s = &policy->spring[k];
        resistance_observer_reset(&s->observer);
        s->inverse_q14 = RESISTANCE_OBSERVER_ONE_Q14;
        s->ceiling_ma = parameters->boost_current_ma;
    }
    return true;
}

static int16_t c7_of_cc(int32_t value_cc)
{
    return (int16_t)(value_cc * 32 / 25);
}

void drive_policy_prepare(drive_policy_t *policy, const thermal_model_t *model)
{
    const drive_policy_parameters_t *p = &policy->parameters;
    const thermal_model_parameters_t *m = &model->parameters;
    resistance_alloy_prepare(&policy->alloy, m->resistance_martensite_uohm,
                             m->resistance_austenite_uohm);
    policy->columns = m->columns;

    /* a distance of 1 K is closed with a time constant of 4 s: C / 4 s */
    uint32_t feedback = (uint32_t)m->heat_capacity_mj_per_k * 1000u / 2048u;
    policy->feedback_q4 = feedback > 4095u ? 4095u : (uint16_t)feedback;
    int16_t width_cc = (int16_t)(m->austenite_finish_cc - m->austenite_start_cc);
    policy->correction_q8 = (uint16_t)((uint32_t)c7_of_cc(width_cc) * 64u / 1000u);
    /* 35 % of the declared loss */
    uint32_t limit = (uint32_t)m->loss_uw_per_k * 21u / 64u;
    policy->bias_limit_64uw = limit > 16000u ? 16000 : (int16_t)limit;
    /* 1 - (1 + cos(pi d / w)) / 2 = LOSS_SEEN: d = 0.0533 w */
    width_cc = (int16_t)(m->martensite_start_cc - m->martensite_finish_cc);
    policy->event_c7 = c7_of_cc((int32_t)width_cc * 55 / 1000);

    policy->hold_margin_c7 = c7_of_cc(p->hold_margin_cc);
    policy->unsure_margin_c7 = c7_of_cc(p->unsure_margin_cc);
    policy->search_c7 = (int16_t)((int32_t)p->search_mk_per_s * KELVIN_C7 / 1000);
    policy->limit_c7 = c7_of_cc(p->temperature_limit_cc);
    uint16_t band_c7 = (uint16_t)c7_of_cc(p->temperature_band_cc);
    policy->derating_gain = (uint16_t)(65535u / band_c7);
    policy->undriven_c7 = c7_of_cc((int32_t)m->austenite_start_cc - p->undriven_margin_cc);
    policy->overload_half_ticks = (uint32_t)p->overload_time_s * 25u;
    policy->overload_gain_q24 = 16777215ul / policy->overload_half_ticks;
    policy->prepared = true;
}

/* ---- what the model says ---- */

static int16_t model_permille(const thermal_model_t *model, uint8_t k)
{
    return (int16_t)(((uint32_t)thermal_model_austenite(model, k) * 125u) >> 12);
}

/* bias at a temperature: proportional to what it is above ambient, given at 60 K. */
static int16_t bias_at(const thermal_model_t *model, int16_t bias_64uw, int16_t temperature_c7)
{
    if (bias_64uw == 0) {
        return 0;
    }
    int16_t above_c7 = (int16_t)(temperature_c7 - model->ambient_c7);
    /* / 7680, as x 273 / 2^21 */
    return (int16_t)((((int32_t)bias_64uw * above_c7 >> 9) * 273) >> 12);
}

uint32_t drive_policy_model_power_uw(const drive_policy_t *policy, uint8_t spring,
                                     uint32_t power_uw)
{
    int32_t bias_uw = (int32_t)policy->spring[spring].bias_now_64uw * 64;
    if (bias_uw > 0 && (uint32_t)bias_uw > power_uw) {
        return 0;
    }
    return (uint32_t)((int32_t)power_uw - bias_uw);
}

/* The model's spring to a temperature, its phase as if it came from martensite or from austenite.
 */
static void rewind_to(thermal_model_t *model, uint8_t k, int16_t temperature_c7, bool from_cold)
{
    thermal_model_set_temperature(model, k,
                                  from_cold ? (int16_t)(model->martensite_finish_c7 - KELVIN_C7)
                                            : (int16_t)(model->austenite_finish_c7 + KELVIN_C7));
    thermal_model_set_temperature(model, k, temperature_c7);
}

/* ---- the observer's corrections ---- */

static bool trusted(const drive_policy_t *policy, const drive_policy_spring_t *s)
{
    return policy->parameters.observer != 0 && (s->flags & FLAG_LET_GO) == 0 &&
           s->fresh >= FRESH_WINDOWS &&
           resistance_observer_is_plausible(&s->observer, &policy->alloy);
}

/* While it heats: where the resistance says the spring is, against where the model has it. */
static void correct_heating(const drive_policy_t *policy, drive_policy_spring_t *s,
                            thermal_model_t *model, uint8_t k, int16_t phase)
{
    int16_t now_c7 = thermal_model_temperature_c7(model, k);
    int16_t error = (int16_t)(phase - model_permille(model, k));
    int16_t move_c7 = 0;
    if (phase > PHASE_SEEN && error > PHASE_DEADBAND && now_c7 < model->austenite_start_c7) {
        move_c7 = (int16_t)(model->austenite_start_c7 + KELVIN_C7 - now_c7);
    } else if (phase < 1000 - PHASE_MISSING && now_c7 > model->austenite_finish_c7) {
        move_c7 = (int16_t)(model->austenite_finish_c7 - KELVIN_C7 / 2 - now_c7);
    } else if (error > PHASE_DEADBAND || error < -PHASE_DEADBAND) {
        error = (int16_t)(error > 0 ? error - PHASE_DEADBAND : error + PHASE_DEADBAND);
        move_c7 = (int16_t)(((int32_t)error * policy->correction_q8) >> 8);
    }
    if (move_c7 == 0) {
        return;
    }
    int16_t sum_c7 = (int16_t)(s->corrected_c7 + move_c7);
    if (sum_c7 > TRUST_LIMIT_C7 || sum_c7 < -TRUST_LIMIT_C7) {
        s->flags |= FLAG_LET_GO; /* and what it did is undone */
        move_c7 = (int16_t)-s->corrected_c7;
        sum_c7 = 0;
    }
    s->corrected_c7 = sum_c7;
    if (move_c7 > 0) {
        thermal_model_add_temperature(model, k, move_c7);
    } else {
        rewind_to(model, k, (int16_t)(now_c7 + move_c7), true);
    }
}

/* While it cools to a level, or is probed. */
static void correct_cooling(const drive_policy_t *policy, thermal_model_t *model, uint8_t k,
                            int16_t phase, int16_t deadband)
{
    int16_t error = (int16_t)(phase - model_permille(model, k));
    if (error > deadband || error < -deadband) {
        error = (int16_t)(error > 0 ? error - deadband : error + deadband);
        thermal_model_add_temperature(model, k,
                                      (int16_t)(((int32_t)error * policy->correction_q8) >> 8));
    }
}

/* In a hold the true temperature was seen: the model takes it, and the power by which its loss was
 * wrong in steady state goes into the bias. */
static void correct_hold(const drive_policy_t *policy, drive_policy_spring_t *s,
                         thermal_model_t *model, uint8_t k, int16_t true_c7, bool full)
{
    int16_t model_c7 = thermal_model_temperature_c7(model, k);
    int32_t difference_uw = thermal_model_power_to_hold_uw(model, k, model_c7) -
                            thermal_model_power_to_hold_uw(model, k, true_c7);
    s->bias_64uw = clamp16(s->bias_64uw + (difference_uw >> 6), (int16_t)-policy->bias_limit_64uw,
                           policy->bias_limit_64uw);
    if (full) {
        rewind_to(model, k, true_c7, false);
    } else {
        thermal_model_add_temperature(model, k, (int16_t)(true_c7 - model_c7));
    }
}

/* ---- stages ---- */

static void enter(drive_policy_t *policy, uint8_t k, drive_policy_stage_t stage)
{
    drive_policy_spring_t *s = &policy->spring[k];
    if (stage == DRIVE_POLICY_STAGE_HEAT) {
        supply_queue_add(&policy->queue, k);
    } else {
        supply_queue_remove(&policy->queue, k);
    }
    if (stage == DRIVE_POLICY_STAGE_HOLD) {
        s->margin_c7 = (s->flags & FLAG_LEARNT) != 0
                           ? (int16_t)(policy->hold_margin_c7 + AFTER_BOOST_C7)
                           : policy->unsure_margin_c7;
    }
    s->stage = (uint8_t)stage;
    s->corrected_c7 = 0;
    s->lost_permille = 0;
    s->reference = 0;
    s->plateau = 0;
    s->suspicion = 0;
    s->seen = 0;
    s->floor_ma = 0;
}

/* What heats a spring at a temperature, against its neighbours as they are now, plus a correction
 * towards it. */
static uint16_t hold_current_ma(const drive_policy_t *policy, const drive_policy_spring_t *s,
                                const thermal_model_t *model, uint8_t k, int16_t target_c7,
                                int16_t extra_64uw)
{
    int16_t short_c7 =
        clamp16((int32_t)target_c7 - thermal_model_temperature_c7(model, k), -2560, 2560);
    int32_t power_64uw = (thermal_model_power_to_hold_uw(model, k, target_c7) >> 6) +
                         bias_at(model, s->bias_64uw, target_c7) +
                         (((int32_t)short_c7 * (int16_t)policy->feedback_q4) >> 4) + extra_64uw;
    if (power_64uw <= 0) {
        return 0;
    }
    return resistance_current_for_power_ma(&policy->alloy, s->inverse_q14,
                                           power_64uw > UINT16_MAX ? UINT16_MAX
                                                                   : (uint16_t)power_64uw);
}

static bool is_transformed(const drive_policy_t *policy, drive_policy_spring_t *s,
                           thermal_model_t *model, uint8_t k, bool sees, int16_t phase)
{
    int16_t now_c7 = thermal_model_temperature_c7(model, k);
    if (!sees) {
        bool derated = s->ceiling_ma < policy->parameters.boost_current_ma >> 1;
        return now_c7 >= model->austenite_finish_c7 + BLIND_OVERSHOOT_C7 ||
               (derated && now_c7 >= model->austenite_finish_c7);
    }
    if (s->plateau >= PLATEAU_TRUSTED && phase > 600 &&
        now_c7 > model->austenite_start_c7 + 2 * KELVIN_C7 &&
        s->target_ma >= policy->parameters.boost_current_ma >> 1) {
        if (now_c7 < model->austenite_finish_c7) {
            rewind_to(model, k, model->austenite_finish_c7, true);
        }
        return true;
    }
    return s->plateau != 0 && phase >= RATIO_FULL_PERMILLE &&
           now_c7 >= model->austenite_finish_c7 - KELVIN_C7;
}

/* Counts half seconds in which the ratio stood still. */
static void watch_plateau(const drive_policy_t *policy, drive_policy_spring_t *s)
{
    if (s->fresh % UPDATE_TICKS != 0) {
        return;
    }
    int32_t change =
        ((int32_t)s->observer.ratio_q14 - (int32_t)s->before_q14) * policy->alloy.phase_gain_q12;
    change >>= 12;
    s->before_q14 = s->observer.ratio_q14;
    if (change > PLATEAU_PERMILLE || change < -PLATEAU_PERMILLE) {
        s->plateau = 0;
    } else if (s->plateau < UINT8_MAX) {
        s->plateau++;
    }
}

static void heat(drive_policy_t *policy, drive_policy_spring_t *s, thermal_model_t *model,
                 uint8_t k, int16_t level, bool fresh)
{
    int16_t now_c7 = thermal_model_temperature_c7(model, k);
    if (fresh && s->fresh >= FRESH_WINDOWS && model_permille(model, k) == 0 &&
        now_c7 < model->austenite_start_c7 - CERTAIN_C7) {
        resistance_observer_learn_martensite(&s->observer);
    }
    bool sees = trusted(policy, s);
    int16_t phase = sees ? resistance_observer_phase_permille(&s->observer, &policy->alloy)
                         : model_permille(model, k);
    if (fresh) {
        watch_plateau(policy, s);
        if (sees) {
            correct_heating(policy, s, model, k, phase);
        }
    }
    s->wanted_ma = policy->parameters.boost_current_ma;
    /* what it has is kept while it waits */
    s->floor_ma = phase > level >> 1 ? hold_current_ma(policy, s, model, k, now_c7, 0) : 0;
    if (level >= LEVEL_FULL_PERMILLE) {
        if (is_transformed(policy, s, model, k, sees, phase)) {
            enter(policy, k, DRIVE_POLICY_STAGE_HOLD);
        }
        return;
    }
    if (thermal_model_temperature_c7(model, k) > model->austenite_start_c7 - KELVIN_C7) {
        uint16_t gentle_ma = hold_current_ma(
            policy, s, model, k, thermal_model_temperature_c7(model, k), PARTIAL_POWER_64UW);
        s->wanted_ma = gentle_ma < s->wanted_ma ? gentle_ma : s->wanted_ma;
    }
    if (phase >= level) {
        enter(policy, k, DRIVE_POLICY_STAGE_HOLD);
    }
}

/* The reading cannot be right: the model alone, with the wide margin. */
static void let_go(const drive_policy_t *policy, drive_policy_spring_t *s)
{
    s->flags = (uint8_t)((s->flags | FLAG_LET_GO) & ~FLAG_LEARNT);
    s->bias_64uw = 0;
    s->margin_c7 = policy->unsure_margin_c7;
}

/* A first doubt stops the search for a while: what is seen then is seen with less delay. */
static bool is_pausing(const drive_policy_spring_t *s)
{
    return s->suspicion != 0 && s->suspicion <= PAUSE_WINDOWS;
}

/* Looks for the first loss of phase: martensite start, seen as on a thermometer. */
static void watch_hold(drive_policy_t *policy, drive_policy_spring_t *s, thermal_model_t *model,
                       uint8_t k, bool full)
{
    int16_t now_c7 = thermal_model_temperature_c7(model, k);
    int16_t target_c7 = (int16_t)(model->martensite_start_c7 + s->margin_c7);
    if (s->reference < REFERENCE_WINDOWS) {
        if (now_c7 < target_c7 + SETTLED_C7 && now_c7 > target_c7 - SETTLED_C7) {
            s->reference++;
            s->reference_q14 = (uint16_t)(s->observer.slow_q22 >> 8);
        } else if (s->reference == 0) {
            resistance_observer_restart_average(&s->observer);
        }
        return;
    }
    int16_t loss = (int16_t)-resistance_observer_drift_permille(&s->observer, &policy->alloy,
                                                                s->reference_q14);
    if (loss < -GAIN_IMPLAUSIBLE) {
        let_go(policy, s);
        return;
    }
    int16_t start_c7 = model->martensite_start_c7;
    if (loss >= LOSS_REHEAT && full) {
        enter(policy, k, DRIVE_POLICY_STAGE_HEAT);
        return;
    }
    if (s->plateau != 0) {
        s->plateau--;
        s->lost_permille = loss > s->lost_permille ? loss : s->lost_permille;
        return;
    }
    if (now_c7 > model->martensite_start_c7 && (s->flags & FLAG_LEARNT) == 0 &&
        s->fresh % 20u == 0) {
        /* the sensor's steps let the average wander as the current changes: 0.1 permille a second
         * is followed, a loss is ten times faster */
        uint16_t slow_q14 = (uint16_t)(s->observer.slow_q22 >> 8);
        if (slow_q14 != s->reference_q14) {
            s->reference_q14 = (uint16_t)(slow_q14 > s->reference_q14 ? s->reference_q14 + 1
                                                                      : s->reference_q14 - 1);
        }
    }
    int16_t more = (int16_t)(loss - s->lost_permille);
    s->suspicion = more < LOSS_SUSPECTED      ? 0
                   : s->suspicion < UINT8_MAX ? (uint8_t)(s->suspicion + 1)
                                              : UINT8_MAX;
    s->seen = more < LOSS_SEEN ? 0 : (uint8_t)(s->seen + 1);
    if (more >= LOSS_CERTAIN || s->seen > SEEN_WINDOWS) {
        correct_hold(policy, s, model, k, (int16_t)(start_c7 - policy->event_c7), full);
        s->lost_permille = loss;
        s->plateau = SETTLE_WINDOWS;
        s->suspicion = 0;
        s->seen = 0;
        s->flags |= FLAG_LEARNT;
        s->margin_c7 = policy->hold_margin_c7;
        return;
    }
    if (now_c7 < start_c7 - PIN_C7) {
        correct_hold(policy, s, model, k, (int16_t)(start_c7 - PIN_C7), full);
    }
}

/* The margin narrows: to the wanted one where the loss is known, else until the start is seen. */
static void narrow_margin(drive_policy_t *policy, drive_policy_spring_t *s)
{
    int16_t floor_c7 =
        (s->flags & FLAG_LEARNT) != 0 ? policy->hold_margin_c7 : (int16_t) - (PIN_C7 + PULL_C7);
    if (policy->search_c7 == 0 || is_pausing(s) || s->reference < REFERENCE_WINDOWS ||
        s->fresh % 10u != 0) {
        return;
    }
    if (s->margin_c7 > floor_c7) {
        s->margin_c7 = (int16_t)(s->margin_c7 - policy->search_c7);
        if (s->margin_c7 < floor_c7) {
            s->margin_c7 = floor_c7;
        }
    } else if ((s->flags & FLAG_LEARNT) == 0 && s->bias_64uw <= -policy->bias_limit_64uw) {
        let_go(policy, s); /* it must have been passed */
    }
}

static void hold(drive_policy_t *policy, drive_policy_spring_t *s, thermal_model_t *model,
                 uint8_t k, int16_t level, bool fresh)
{
    bool full = level >= LEVEL_FULL_PERMILLE;
    bool sees = trusted(policy, s);
    if (sees && fresh) {
        watch_hold(policy, s, model, k, full);
        narrow_margin(policy, s);
    } else if (!sees && s->fresh >= FRESH_WINDOWS) {
        s->margin_c7 = policy->unsure_margin_c7;
    }
    if (s->stage != DRIVE_POLICY_STAGE_HOLD) {
        return;
    }
    int16_t phase = sees && s->reference >= REFERENCE_WINDOWS
                        ? resistance_observer_phase_permille(&s->observer, &policy->alloy)
                        : model_permille(model, k);
    if (phase < level - (full ? 2 : 1) * LEVEL_BAND_PERMILLE) {
        enter(policy, k, DRIVE_POLICY_STAGE_HEAT);
    } else if (!full && phase > level + LEVEL_BAND_PERMILLE) {
        enter(policy, k, DRIVE_POLICY_STAGE_LOWER);
    }
    uint16_t wanted_ma =
        hold_current_ma(policy, s, model, k, (int16_t)(model->martensite_start_c7 + s->margin_c7),
                        is_pausing(s) ? SUSPICION_64UW : 0);
    wanted_ma = (uint16_t)(wanted_ma + (policy->parameters.dither_ma >> 1));
    if (wanted_ma < policy->parameters.probe_current_ma) {
        wanted_ma = policy->parameters.probe_current_ma;
    }
    s->wanted_ma = wanted_ma;
}

static void lower(drive_policy_t *policy, drive_policy_spring_t *s, thermal_model_t *model,
                  uint8_t k, int16_t level, bool fresh)
{
    s->wanted_ma = policy->parameters.probe_current_ma;
    bool sees = trusted(policy, s);
    int16_t phase = sees ? resistance_observer_phase_permille(&s->observer, &policy->alloy)
                         : model_permille(model, k);
    if (sees && fresh) {
        correct_cooling(policy, model, k, phase, PHASE_DEADBAND);
    }
    if (phase <= level) {
        enter(policy, k,
              phase < level - LEVEL_BAND_PERMILLE ? DRIVE_POLICY_STAGE_HEAT
                                                  : DRIVE_POLICY_STAGE_HOLD);
    }
}

/* Undriven: how near austenite start it is going to come, 255 at the limit. */
static void off(const drive_policy_t *policy, drive_policy_spring_t *s, thermal_model_t *model,
                uint8_t k, bool fresh)
{
    int16_t now_c7 = thermal_model_temperature_c7(model, k);
    int16_t from_c7 = (int16_t)(policy->undriven_c7 - UNDRIVEN_BAND_C7);
    s->wanted_ma = 0;
    if (fresh && trusted(policy, s)) { /* a probing pulse */
        correct_cooling(policy, model, k,
                        resistance_observer_phase_permille(&s->observer, &policy->alloy),
                        PHASE_PROBED);
    }
    if (now_c7 < from_c7) {
        s->flags &= (uint8_t)~FLAG_RELEASED;
        if (model_permille(model, k) == 0) {
            s->flags &= (uint8_t)~FLAG_LET_GO;
        }
    }
    int32_t soon_c7 = now_c7 + (int32_t)(now_c7 - s->last_c7) * HORIZON_UPDATES;
    int32_t over = soon_c7 - from_c7;
    if (over <= 0 || (s->flags & FLAG_RELEASED) != 0) {
        s->severity = 0;
    } else {
        s->severity =
            over >= UNDRIVEN_BAND_C7 ? UINT8_MAX : (uint8_t)((over * UNDRIVEN_GAIN_Q8) >> 8);
    }
}

/* ---- derating ---- */

/* Worst of the undriven neighbours, itself not counted. */
static uint8_t worst_neighbour(const drive_policy_t *policy, uint8_t k)
{
    uint8_t columns = policy->columns;
    uint8_t column = k;
    while (column >= columns) {
        column = (uint8_t)(column - columns);
    }
    uint8_t worst = 0;
    for (int8_t row_step = -1; row_step <= 1; row_step++) {
        for (int8_t step = -1; step <= 1; step++) {
            int16_t other = (int16_t)(k + row_step * (int16_t)columns + step);
            if ((step < 0 && column == 0) || (step > 0 && column + 1 >= columns) || other < 0 ||
                other >= policy->springs || other == k) {
                continue;
            }
            uint8_t severity = policy->spring[other].severity;
            worst = severity > worst ? severity : worst;
        }
    }
    return worst;
}

static uint16_t share_q8(uint16_t value, uint16_t share)
{
    return (uint16_t)(((uint32_t)value * share) >> 8);
}

static void derate(const drive_policy_t *policy, drive_policy_spring_t *s,
                   const thermal_model_t *model, uint8_t k, bool driven)
{
    uint16_t full_ma = policy->parameters.boost_current_ma;
    uint16_t share = 256;
    uint8_t limits = DRIVE_POLICY_LIMIT_NONE;
    int16_t room_c7 =
        clamp16((int32_t)policy->limit_c7 - thermal_model_temperature_c7(model, k), 0, INT16_MAX);
    uint32_t room_q16 = (uint32_t)(uint16_t)room_c7 * policy->derating_gain;
    if (room_q16 < 65000u) {
        share = (uint16_t)(room_q16 >> 8);
        limits = DRIVE_POLICY_LIMIT_TEMPERATURE;
    }
    uint16_t allowed = (uint16_t)(255u - worst_neighbour(policy, k));
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
            s->derated_updates >= policy->parameters.trip_time_s * 10u) {
            s->flags |= FLAG_TRIPPED;
        }
    } else if (share != 0) {
        s->derated_updates = 0;
    }
}

/* The sum of targets that is allowed now; the overload's share is taken off. */
static uint16_t budget_ma(drive_policy_t *policy, const drive_policy_input_t *input,
                          uint32_t sum_ma, bool *overloaded)
{
    const drive_policy_parameters_t *p = &policy->parameters;
    uint16_t budget = input->supply_limit_ma > p->supply_reserve_ma
                          ? (uint16_t)(input->supply_limit_ma - p->supply_reserve_ma)
                          : 0;
    *overloaded = false;
    if (p->policy == DRIVE_POLICY_OPEN || !policy->prepared || budget <= p->overload_current_ma) {
        return budget;
    }
    uint32_t half = policy->overload_half_ticks;
    if (sum_ma > p->overload_current_ma) {
        if (policy->overload_ticks < 2u * half) {
            policy->overload_ticks++;
        }
    } else if (policy->overload_ticks > 0) {
        policy->overload_ticks--;
    }
    if (policy->overload_ticks > half) {
        uint32_t share_q16 = ((policy->overload_ticks - half) * policy->overload_gain_q24) >> 8;
        uint16_t more = (uint16_t)(budget - p->overload_current_ma);
        *overloaded = true;
        budget = (uint16_t)(budget - ((more * (share_q16 > 65535u ? 65535u : share_q16)) >> 16));
    }
    return budget;
}

/* ---- one spring, once in five ticks ---- */

static void update(drive_policy_t *policy, const drive_policy_input_t *input, uint8_t k)
{
    drive_policy_spring_t *s = &policy->spring[k];
    thermal_model_t *model = input->model;
    int16_t level = (int16_t)input->level_permille[k];
    bool driven = level != 0 && input->allowed[k];

    thermal_model_settle(model, k);
    bool fresh = resistance_observer_update(&s->observer, &policy->alloy);
    if (fresh) {
        s->fresh = s->fresh < UINT8_MAX ? (uint8_t)(s->fresh + 1) : (uint8_t)(UINT8_MAX - 19);
        s->inverse_q14 = resistance_inverse_q14(s->inverse_q14, s->observer.ratio_q14);
    } else if (s->target_ma == 0) {
        s->fresh = 0;
    }
    if (driven && policy->parameters.policy == DRIVE_POLICY_PRECOMPENSATE) {
        s->severity = 0;
        switch ((drive_policy_stage_t)s->stage) {
        case DRIVE_POLICY_STAGE_OFF:
            enter(policy, k,
                  model_permille(model, k) + LEVEL_BAND_PERMILLE < level ? DRIVE_POLICY_STAGE_HEAT
                                                                         : DRIVE_POLICY_STAGE_HOLD);
            break;
        case DRIVE_POLICY_STAGE_HEAT:
            heat(policy, s, model, k, level, fresh);
            break;
        case DRIVE_POLICY_STAGE_HOLD:
            hold(policy, s, model, k, level, fresh);
            break;
        case DRIVE_POLICY_STAGE_LOWER:
            lower(policy, s, model, k, level, fresh);
            break;
        }
    } else if (!driven) {
        off(policy, s, model, k, fresh);
    }
    derate(policy, s, model, k, driven);
    s->last_c7 = thermal_model_temperature_c7(model, k);
    s->bias_now_64uw = bias_at(model, s->bias_64uw, s->last_c7);
}

/* ---- one tick ---- */

/* level / 1000 of current, without a division: 8389 / 2^23 is 1 / 1000 to 5e-5. */
static uint16_t share_ma(uint16_t current_ma, uint16_t level_permille)
{
    if (level_permille >= DRIVE_POLICY_LEVEL_FULL) {
        return current_ma;
    }
    uint32_t product = (uint32_t)current_ma * level_permille; /* < 3200 x 1000 */
    return (uint16_t)(((product >> 3) * 8389u) >> 20);
}

static void listen(drive_policy_t *policy, const drive_policy_input_t *input)
{
    for (uint8_t k = 0; k < policy->springs; k++) {
        if (input->valid[k]) {
            resistance_observer_take(&policy->spring[k].observer, input->measured_ma[k],
                                     input->measured_mv[k]);
        }
    }
}

static void update_some(drive_policy_t *policy, const drive_policy_input_t *input)
{
    uint8_t slot = policy->slot;
    policy->slot = (uint8_t)(slot + 1 < (uint8_t)UPDATE_TICKS ? slot + 1 : 0);
    for (uint16_t k = slot; k < policy->springs; k = (uint16_t)(k + UPDATE_TICKS)) {
        /* who asks together is queued from a different spring each round */
        update(policy, input, (uint8_t)k);
    }
}

/* Off at once, whatever the update's turn. */
static void stop(drive_policy_t *policy, uint8_t k)
{
    drive_policy_spring_t *s = &policy->spring[k];
    if (s->stage != DRIVE_POLICY_STAGE_OFF) {
        enter(policy, k, DRIVE_POLICY_STAGE_OFF);
        s->flags |= FLAG_RELEASED;
    }
    s->wanted_ma = 0;
}

/* A slow triangle below the target, each spring at another place of it. */
static uint16_t dithered_ma(const drive_policy_t *policy, uint8_t k, uint16_t target_ma)
{
    uint8_t place = (uint8_t)((policy->sweep + 7u * k) & 31u);
    uint8_t height = (uint8_t)(place < 16u ? place : 31u - place);
    uint16_t drop_ma = (uint16_t)((policy->parameters.dither_ma * height) >> 4);
    if (policy->spring[k].stage == DRIVE_POLICY_STAGE_HEAT) {
        drop_ma >>= 4; /* heat first */
    }
    return target_ma > drop_ma ? (uint16_t)(target_ma - drop_ma) : target_ma;
}

static uint16_t want(drive_policy_t *policy, const drive_policy_input_t *input, uint8_t k,
                     uint8_t *limits)
{
    drive_policy_spring_t *s = &policy->spring[k];
    const drive_policy_parameters_t *p = &policy->parameters;
    uint16_t level = input->level_permille[k];
    *limits = DRIVE_POLICY_LIMIT_NONE;
    if (level == 0 || !input->allowed[k] || (s->flags & FLAG_TRIPPED) != 0) {
        if (level != 0) {
            *limits = input->allowed[k] ? DRIVE_POLICY_LIMIT_TRIP : DRIVE_POLICY_LIMIT_SAFETY;
        }
        stop(policy, k);
        return 0;
    }
    uint16_t target_ma;
    if (p->policy == DRIVE_POLICY_OPEN) {
        if (s->stage != DRIVE_POLICY_STAGE_OFF) {
            enter(policy, k, DRIVE_POLICY_STAGE_OFF);
        }
        s->wanted_ma = share_ma(p->open_current_ma, level);
        target_ma = s->wanted_ma;
    } else {
        target_ma = s->wanted_ma;
        if (s->ceiling_ma < target_ma) {
            target_ma = s->ceiling_ma;
            *limits |= s->derating;
        }
        if (!trusted(policy, s) && s->fresh >= FRESH_WINDOWS) {
            *limits |= DRIVE_POLICY_LIMIT_BLIND;
        }
    }
    if (target_ma > input->maximum_current_ma) {
        target_ma = input->maximum_current_ma;
        *limits |= DRIVE_POLICY_LIMIT_CURRENT;
    }
    if (p->policy != DRIVE_POLICY_OPEN) {
        target_ma = dithered_ma(policy, k, target_ma);
    }
    return target_ma;
}

/* Holds first, the largest cut to a common cap if they alone are too much; then those that heat,
 * one after the other: heat grows with the square of current. */
static void share(drive_policy_t *policy, uint16_t target_ma[], uint16_t budget, uint8_t reason)
{
    uint32_t sum_ma = 0;
    uint16_t fixed_ma[DRIVE_POLICY_MAX_SPRINGS];
    for (uint8_t k = 0; k < policy->springs; k++) {
        const drive_policy_spring_t *s = &policy->spring[k];
        fixed_ma[k] = target_ma[k];
        if (s->stage == DRIVE_POLICY_STAGE_HEAT && s->floor_ma < target_ma[k]) {
            fixed_ma[k] = s->floor_ma;
        }
        sum_ma += fixed_ma[k];
    }
    uint16_t cap_ma = UINT16_MAX;
    if (sum_ma > budget) {
        cap_ma = supply_share_cap_ma(fixed_ma, policy->springs, budget);
        sum_ma = budget;
    }
    uint16_t left_ma = (uint16_t)(budget - sum_ma);
    for (uint8_t k = 0; k < policy->springs; k++) {
        fixed_ma[k] = fixed_ma[k] > cap_ma ? cap_ma : fixed_ma[k];
        if (policy->spring[k].stage != DRIVE_POLICY_STAGE_HEAT && target_ma[k] > cap_ma) {
            target_ma[k] = cap_ma;
            policy->spring[k].limits |= reason;
        }
    }
    for (uint8_t n = 0; n < policy->queue.count; n++) {
        uint8_t k = policy->queue.spring[n];
        uint16_t more_ma = (uint16_t)(target_ma[k] - fixed_ma[k]);
        if (more_ma > left_ma) {
            more_ma = left_ma >= LEAST_BOOST_MA ? left_ma : 0;
            policy->spring[k].limits |= reason;
        }
        target_ma[k] = (uint16_t)(fixed_ma[k] + more_ma);
        left_ma = (uint16_t)(left_ma - more_ma);
    }
}

/* After a change of policy each target walks from where it was; falls first, rises as they fit. */
static void soften(drive_policy_t *policy, const drive_policy_input_t *input, uint16_t target_ma[],
                   uint16_t budget)
{
    uint32_t sum_ma = 0;
    bool done = true;
    for (uint8_t k = 0; k < policy->springs; k++) {
        uint16_t last_ma = policy->spring[k].target_ma;
        if (input->level_permille[k] != 0 && input->allowed[k] &&
            target_ma[k] + SOFT_MA < last_ma) {
            target_ma[k] = (uint16_t)(last_ma - SOFT_MA);
            done = false;
        }
        sum_ma += target_ma[k] < last_ma ? target_ma[k] : last_ma;
    }
    uint16_t left_ma = (uint16_t)(sum_ma < budget ? budget - sum_ma : 0);
    for (uint8_t k = 0; k < policy->springs; k++) {
        uint16_t last_ma = policy->spring[k].target_ma;
        if (target_ma[k] <= last_ma) {
            continue;
        }
        uint16_t rise_ma = (uint16_t)(target_ma[k] - last_ma);
        if (rise_ma > SOFT_MA) {
            rise_ma = SOFT_MA;
            done = false;
        }
        rise_ma = rise_ma < left_ma ? rise_ma : left_ma;
        target_ma[k] = (uint16_t)(last_ma + rise_ma);
        left_ma = (uint16_t)(left_ma - rise_ma);
    }
    policy->soft = done ? (uint8_t)(policy->soft - 1u) : SOFT_TICKS;
}

/* Undriven springs one after the other, in what the budget leaves. */
static void probe(drive_policy_t *policy, const drive_policy_input_t *input, uint16_t target_ma[],
                  uint16_t budget)
{
    const drive_policy_parameters_t *p = &policy->parameters;
    if (p->probe_period_s == 0 || p->policy == DRIVE_POLICY_OPEN) {
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
            return;
        }
        uint32_t sum_ma = p->probe_current_ma;
        for (uint8_t n = 0; n < policy->springs; n++) {
            sum_ma += target_ma[n];
        }
        if (sum_ma <= budget) {
            target_ma[k] = p->probe_current_ma;
        }
    } else if (policy->probe_ticks >= period) {
        policy->probed = 0;
        policy->probe_ticks = 0;
    }
}

void drive_policy_tick(drive_policy_t *policy, const drive_policy_input_t *input,
                       uint16_t target_ma[])
{
    if (policy->prepared && input->valid != NULL) {
        listen(policy, input);
    }
    if (policy->prepared) {
        update_some(policy, input);
    }
    uint32_t sum_ma = 0;
    for (uint8_t k = 0; k < policy->springs; k++) {
        sum_ma += policy->spring[k].target_ma;
        target_ma[k] = want(policy, input, k, &policy->spring[k].limits);
    }
    policy->sweep = (uint8_t)((policy->sweep + 1u) & 31u);
    bool overloaded;
    uint16_t budget = budget_ma(policy, input, sum_ma, &overloaded);
    share(policy, target_ma, budget,
          overloaded ? DRIVE_POLICY_LIMIT_OVERLOAD : DRIVE_POLICY_LIMIT_SUPPLY);
    if (policy->soft != 0) {
        soften(policy, input, target_ma, budget);
    }
    probe(policy, input, target_ma, budget);
    for (uint8_t k = 0; k < policy->springs; k++) {
        policy->spring[k].target_ma = target_ma[k];
    }
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
    return trusted(policy, &policy->spring[spring]);
}

int16_t drive_policy_phase_permille(const drive_policy_t *policy, uint8_t spring)
{
    return resistance_observer_phase_permille(&policy->spring[spring].observer, &policy->alloy);
}

void drive_policy_clear(drive_policy_t *policy)
{
    for (uint8_t k = 0; k < policy->springs; k++) {
        policy->spring[k].flags &= (uint8_t)~FLAG_TRIPPED;
        policy->spring[k].derated_updates = 0;
    }
}
