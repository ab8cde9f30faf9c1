#include "drive_policy.h"

#include <math.h>
#include <stddef.h>

#include "derating.h"
#include "invariant.h"

#define TURNS_PER_S SPRING_SIGHTS_TURNS_PER_S
#define TURN_S      SPRING_ESTIMATOR_TURN_S

/* A spring counts as wanted fully on from here: the last percent of a transformation has no level.
 */
#define LEVEL_FULL_PERMILLE 960
#define LEVEL_BAND          0.05f /* a held level may be off by so much before it is sought again */
#define LEVEL_POWER_W       0.4f  /* beyond the hold: heating to a level slows down */

/* Beyond the hold, from half of the phase on, of a heating from a level: the middle of the
 * wire had most of that, and is heated by all that its crimped ends still take up to transform. One
 * that was fully on has cooled faster than its ends could go ahead. */
#define PART_POWER_W 0.15f
#define PART_LEAST   (2.0f * LEVEL_BAND)
#define PART_MOST    0.8f /* surely: a fifth that is left takes up no more than a hold's margin */

#define LOST          0.004f /* phase lost: it is heated back */
#define SEARCH_SD_K   3.0f   /* a distance known so badly is worth a search */
#define SEARCH_END_K  (-1.0f)
#define MARGIN_PER_SD 1.6f /* 95 % of a normal distribution, one side */
#define MARGIN_SD_K   1.5f /* that hold_margin_k itself allows for */
#define BLIND_BEGIN_K 4.0f /* above austenite finish: it has transformed at the likely worst */
#define BLIND_K_PER_S (1.0f / 40.0f) /* slower than its time constant, C / G = 52 s, follows */
#define FOLLOW_S      4.0f           /* a distance from the held temperature is closed in */
/* Of its power, at the most, is off on the last of the way down, where it is to be read. */
#define COOLS_SHARE         0.4f
#define TELLS_K             10.0f
#define TELLS_NOISE         0.015f    /* with more, what is sure is a tenth of the phase */
#define RISE_BEGINS_K_PER_S 4.0f      /* with the boost, until it is measured */
#define TURN_C7             (6 * 128) /* colder than one that heats: it is its turn */
#define GOES_ON_C7          (4 * 128) /* below austenite start: keeps its turn */
#define LOOK_MA             2000u /* of a spring of which much was learnt and nothing is known */
#define LOWER_MA            800u  /* the least at which a resistance tells the phase */
#define TRIAL_K_PER_S       1.0f  /* about as fast as it cools by itself */
#define TRIAL_MA            650u  /* the least at which a hold is read */
#define STALLS_K_PER_S      0.02f /* what is left of 10 K would take eight minutes */
#define RISE_SHARE          0.25f /* of a turn in the average */

#define WALK_MA     20                                 /* a tick, after a change of policy */
#define WALK_TURNS  (2u * SPRING_ESTIMATOR_ROUND + 1u) /* every spring has had two */
#define JUMP_MA     100u /* of a current: readings on the way tell nothing */
#define HEAT_DITHER 4    /* of the hold's: so that a reading that hangs is noticed */

/* ---- parameters ---- */

bool drive_policy_check(const drive_policy_parameters_t *p, uint16_t *bad)
{
    if (!parameter_check(PARAMETER_PART_POLICY, p, bad)) {
        return false;
    }
    if (p->unsure_margin_cc < p->hold_margin_cc) {
        if (bad != NULL) {
            *bad = PARAMETER_unsure_margin_k;
        }
        return false;
    }
    return true;
}

bool drive_policy_apply(drive_policy_t *policy, const drive_policy_parameters_t *parameters,
                        const thermal_model_t *model, uint16_t *bad)
{
    if (!drive_policy_check(parameters, bad)) {
        return false;
    }
    if (policy->parameters.policy != parameters->policy) {
        policy->walks = WALK_TURNS;
    }
    policy->parameters = *parameters;
    policy->columns = model->parameters.columns;
    return true;
}

bool drive_policy_init(drive_policy_t *policy, const drive_policy_parameters_t *parameters,
                       const thermal_model_t *model, uint16_t *bad)
{
    if (!drive_policy_check(parameters, bad)) {
        return false;
    }
    *policy = (drive_policy_t){0};
    policy->springs = model->springs;
    (void)drive_policy_apply(policy, parameters, model, NULL);
    policy->walks = 0;
    for (uint8_t k = 0; k < policy->springs; k++) {
        policy->spring[k].ceiling_ma = parameters->boost_current_ma;
    }
    return true;
}

/* ---- what a stage wants ---- */

static float kelvin(uint16_t value_ck)
{
    return 0.01f * (float)value_ck;
}

/* Nothing but these, and what it is told of heatings, holds and jumps, is asked of the belief. */
static const spring_belief_t *belief_of(const drive_policy_input_t *in, uint8_t k)
{
    return spring_estimator_of(in->belief, k);
}

static float now_c(const drive_policy_input_t *in, uint8_t k)
{
    return spring_c(thermal_model_temperature_c7(in->model, k));
}

static bool is_full(uint16_t level_permille)
{
    return level_permille >= LEVEL_FULL_PERMILLE;
}

static float phase_of(const drive_policy_input_t *in, uint8_t k)
{
    return spring_estimator_phase(in->belief, in->model, k);
}

/* What nobody knows anything of is looked at, or waits until it is cold. */
static uint16_t boost_of(const drive_policy_t *policy, const drive_policy_input_t *in, uint8_t k)
{
    if (spring_estimator_possible(belief_of(in, k)) != SPRING_PHASE_ANY) {
        return policy->parameters.boost_current_ma;
    }
    return spring_estimator_may_look(in->belief, k) ? LOOK_MA : 0;
}

static void enter(drive_policy_t *policy, const drive_policy_input_t *in, uint8_t k,
                  drive_policy_stage_t stage, uint16_t level_permille)
{
    drive_policy_spring_t *s = &policy->spring[k];
    supply_queue_remove(&policy->queue, k);
    s->floor_ma = s->stage == DRIVE_POLICY_STAGE_HOLD ? s->wanted_ma : 0; /* until its turn */
    if (stage != DRIVE_POLICY_STAGE_HEAT) { /* in case that it is left */
        s->partly = !is_full(level_permille);
    } else if (s->stage != DRIVE_POLICY_STAGE_OFF && spring_estimator_sees(belief_of(in, k))) {
        const spring_bounds_t phase = spring_estimator_austenite(in->belief, in->model, k);
        s->partly = phase.value > PART_LEAST && phase.low < PART_MOST;
    } else if (spring_estimator_possible(belief_of(in, k)) == SPRING_PHASE_MARTENSITE) {
        s->partly = false; /* before that: as it was left */
    }
    s->stage = (uint8_t)stage;
    const thermal_model_transformation_t points = thermal_model_transformation(in->model, k);
    s->wanted_ma = (uint16_t)(LOWER_MA + policy->parameters.dither_ma); /* for a turn */
    switch (stage) {
    case DRIVE_POLICY_STAGE_OFF:
        s->wanted_ma = 0;
        break;
    case DRIVE_POLICY_STAGE_HEAT:
        supply_queue_add(&policy->queue, k);
        spring_estimator_begin_heating(in->belief, in->model, k);
        s->rise_k_per_s = RISE_BEGINS_K_PER_S;
        s->wanted_ma = boost_of(policy, in, k);
        break;
    case DRIVE_POLICY_STAGE_HOLD:
        spring_estimator_begin_hold(in->belief, in->model, k, is_full(level_permille));
        s->margin_k = spring_c((int16_t)(points.austenite_finish_c7 - points.martensite_start_c7)) +
                      BLIND_BEGIN_K;
        break;
    case DRIVE_POLICY_STAGE_LOWER:
        spring_estimator_begin_hold(in->belief, in->model, k, false);
        break;
    }
}

/* How far it is below a place so much above martensite start. */
static float below_k(const drive_policy_input_t *in, uint8_t k, float margin_k)
{
    const int16_t start_c7 = thermal_model_transformation(in->model, k).martensite_start_c7;
    return spring_c((int16_t)(start_c7 - thermal_model_temperature_c7(in->model, k))) + margin_k;
}

/* What holds a spring so much above where it is now, and takes it there. */
static uint16_t hold_current_ma(const drive_policy_t *policy, const drive_policy_input_t *in,
                                uint8_t k, float short_k, float more_w)
{
    const spring_estimator_t *e = in->belief;
    const float hold_w = spring_estimator_hold_w(e, k, short_k) + more_w;
    const float closes_w = spring_estimator_follow_w(e, short_k, FOLLOW_S);
    const bool coasts = policy->queue.count != 0 || short_k < -TELLS_K ||
                        spring_estimator_noise(belief_of(in, k)) > TELLS_NOISE;
    const float cools_w = coasts ? -hold_w : -COOLS_SHARE * hold_w;
    return spring_estimator_current_ma(e, k, hold_w + (closes_w > cools_w ? closes_w : cools_w));
}

static bool waits_for_supply(const drive_policy_spring_t *s)
{
    return s->granted_ma < s->wanted_ma - (s->wanted_ma >> 2);
}

/* Its own limit leaves too little of what it asked for to go on, and it is hot enough to have
 * transformed. */
static bool is_limited(const drive_policy_spring_t *s, const drive_policy_input_t *in, uint8_t k)
{
    return s->ceiling_ma < s->wanted_ma - (s->wanted_ma >> 2) &&
           thermal_model_temperature_c7(in->model, k) >
               thermal_model_transformation(in->model, k).austenite_finish_c7;
}

/* Its own limit leaves it where it is: it would wait there for ever. */
static bool is_stalled(const drive_policy_spring_t *s)
{
    return (s->derating & DRIVE_POLICY_LIMIT_TEMPERATURE) != 0 &&
           s->granted_ma >= s->ceiling_ma - (s->ceiling_ma >> 2) &&
           fabsf(s->rise_k_per_s) < STALLS_K_PER_S;
}

static void heat(drive_policy_t *policy, const drive_policy_input_t *in, uint8_t k,
                 uint16_t level_permille)
{
    drive_policy_spring_t *s = &policy->spring[k];
    const spring_belief_t *b = belief_of(in, k);
    const thermal_model_transformation_t points = thermal_model_transformation(in->model, k);
    const int16_t c7 = thermal_model_temperature_c7(in->model, k);
    const bool limited = is_limited(s, in, k);
    s->wanted_ma = boost_of(policy, in, k);
    if (spring_estimator_possible(b) == SPRING_PHASE_ANY) {
        return;
    }
    const bool full = is_full(level_permille);
    const float level = 0.001f * (float)level_permille;
    const bool waits = waits_for_supply(s);
    const bool ends = limited || is_stalled(s) ||
                      (full && spring_estimator_has_transformed(in->belief, in->model, k));
    const bool asks = !full || s->partly || waits; /* as a rule not, and once */
    const float phase = !ends && asks ? phase_of(in, k) : 0.0f;
    if (ends || (!full && phase >= level)) {
        enter(policy, in, k, DRIVE_POLICY_STAGE_HOLD, level_permille);
        return;
    }
    /* as it rests there is nothing to wait for at this power: it is over, or needs more. Above its
     * finish it is over anyway, but for its ends */
    const bool ahead = s->partly && phase > 0.5f &&
                       (spring_estimator_changes(b) || c7 > points.austenite_finish_c7);
    const bool slows = (!full || ahead) && c7 > points.austenite_start_c7 - 128;
    /* what it keeps it keeps until its turn: else what its current reads could take it away. It may
     * have begun to lose phase: then it waits where it loses no more */
    const bool keeps = waits && (s->floor_ma != 0 || phase > 0.5f * level);
    s->floor_ma = 0;
    if (slows || keeps) {
        const float margin_k = kelvin(policy->parameters.hold_margin_cc);
        const float short_k = full ? fmaxf(below_k(in, k, margin_k), 0.0f) : 0.0f;
        const float more_w = !slows ? 0.0f : ahead ? PART_POWER_W : LEVEL_POWER_W;
        const uint16_t keeps_ma = hold_current_ma(policy, in, k, short_k, more_w);
        if (slows && keeps_ma < s->wanted_ma) {
            s->wanted_ma = keeps_ma;
        }
        s->floor_ma = keeps ? keeps_ma : 0;
    }
}

/* Above martensite start: fully on by as much as its distance is unsure; a level as far from both
 * ends of the band as it can be. */
static float safe_margin_k(const drive_policy_t *policy, const drive_policy_input_t *in, uint8_t k,
                           bool full, float sd_k)
{
    const drive_policy_parameters_t *p = &policy->parameters;
    if (!full) {
        const thermal_model_transformation_t points = thermal_model_transformation(in->model, k);
        return 0.5f * spring_c((int16_t)(points.austenite_start_c7 - points.martensite_start_c7));
    }
    const float least_k = kelvin(p->hold_margin_cc);
    const float most_k = kelvin(p->unsure_margin_cc);
    const float margin_k = least_k + spring_estimator_disturbance_k(belief_of(in, k)) +
                           MARGIN_PER_SD * (sd_k - MARGIN_SD_K);
    return margin_k > most_k ? most_k : margin_k < least_k ? least_k : margin_k;
}

static void hold(drive_policy_t *policy, const drive_policy_input_t *in, uint8_t k,
                 uint16_t level_permille)
{
    drive_policy_spring_t *s = &policy->spring[k];
    const spring_belief_t *b = belief_of(in, k);
    const bool full = is_full(level_permille);
    const bool knows = spring_estimator_knows(b);
    const float level = full ? 1.0f : 0.001f * (float)level_permille;
    const bool settled = spring_estimator_rests(b);
    const bool losing = spring_estimator_seems_to_lose(b);
    const bool lost = full && spring_estimator_possible(b) == SPRING_PHASE_AUSTENITE
                          ? spring_estimator_lost(b) > LOST
                          : phase_of(in, k) < level - 2.0f * LEVEL_BAND;
    if (lost && spring_away_try(&s->away)) {
        enter(policy, in, k, DRIVE_POLICY_STAGE_HEAT, level_permille);
        return;
    }
    if (!full && phase_of(in, k) > level + LEVEL_BAND) {
        enter(policy, in, k, DRIVE_POLICY_STAGE_LOWER, level_permille);
        return;
    }
    const float sd_k = spring_estimator_hold_sd_k(in->belief, in->model, k);
    const float safe_k = safe_margin_k(policy, in, k, full, sd_k);
    if (full && !knows) { /* who knows whether it has transformed: above that first, then down */
        s->margin_k -= BLIND_K_PER_S * TURN_S;
        s->margin_k = s->margin_k < safe_k ? safe_k : s->margin_k;
    } else if (spring_estimator_on_trial(b)) {
        s->margin_k -= TRIAL_K_PER_S * TURN_S;
    } else if (s->margin_k > safe_k || !full || sd_k < SEARCH_SD_K) {
        s->margin_k = safe_k;
    } else if (settled && !losing && s->margin_k > SEARCH_END_K) {
        s->margin_k -= 0.001f * TURN_S * (float)policy->parameters.search_mk_per_s;
    }
    const uint16_t holds_ma = hold_current_ma(policy, in, k, below_k(in, k, s->margin_k), 0.0f);
    const uint16_t wanted_ma = (uint16_t)(holds_ma + policy->parameters.dither_ma / 2u);
    const uint16_t least_ma = spring_estimator_on_trial(b)
                                  ? (uint16_t)(TRIAL_MA + policy->parameters.dither_ma)
                                  : policy->parameters.probe_current_ma;
    s->wanted_ma = wanted_ma < least_ma ? least_ma : wanted_ma;
}

static void lower(drive_policy_t *policy, const drive_policy_input_t *in, uint8_t k,
                  uint16_t level_permille)
{
    const float level = 0.001f * (float)level_permille;
    const float phase = phase_of(in, k);
    if (phase <= level) {
        /* fully on: that was asked for since */
        const bool heats = is_full(level_permille) ||
                           (phase < level - LEVEL_BAND && spring_away_try(&policy->spring[k].away));
        enter(policy, in, k, heats ? DRIVE_POLICY_STAGE_HEAT : DRIVE_POLICY_STAGE_HOLD,
              level_permille);
    }
}

/* Switched on: it has the wanted phase already, and keeps it until the current flows. */
static bool is_there(const drive_policy_input_t *in, uint8_t k, uint16_t level_permille)
{
    const spring_belief_t *b = belief_of(in, k);
    const float level = 0.001f * (float)level_permille;
    if (is_full(level_permille)) {
        return spring_estimator_possible(b) == SPRING_PHASE_AUSTENITE &&
               spring_estimator_lost(b) < LOST &&
               spring_estimator_distance_k(in->belief, in->model, k).low > 0.0f;
    }
    return phase_of(in, k) >= level - LEVEL_BAND;
}

/* A spring that was never seen fully on is heated there before it comes to a level, once: what it
 * reads at one is told by what it read then. */
static uint16_t heats_to(const drive_policy_input_t *in, uint8_t k, uint16_t level_permille)
{
    return spring_estimator_untried(in->belief, k) ? DRIVE_POLICY_LEVEL_FULL : level_permille;
}

static void precompensate(drive_policy_t *policy, const drive_policy_input_t *in, uint8_t k,
                          uint16_t level_permille)
{
    drive_policy_spring_t *s = &policy->spring[k];
    const uint8_t asked = (uint8_t)(level_permille >> 2);
    if (s->asked != asked) { /* what was tried was for another level */
        s->asked = asked;
        s->away.tried = 0;
    }
    switch ((drive_policy_stage_t)s->stage) {
    case DRIVE_POLICY_STAGE_OFF:
        enter(policy, in, k,
              is_there(in, k, level_permille) ? DRIVE_POLICY_STAGE_HOLD : DRIVE_POLICY_STAGE_HEAT,
              level_permille);
        break;
    case DRIVE_POLICY_STAGE_HEAT:
        heat(policy, in, k, heats_to(in, k, level_permille));
        break;
    case DRIVE_POLICY_STAGE_HOLD:
        hold(policy, in, k, level_permille);
        break;
    case DRIVE_POLICY_STAGE_LOWER:
        lower(policy, in, k, level_permille);
        break;
    }
}

/* ---- derating ---- */

/* Undriven: how near austenite start it is going to come, as hot as it may be. */
static float severity(const drive_policy_t *policy, const drive_policy_input_t *in, uint8_t k,
                      drive_policy_spring_t *s)
{
    const spring_belief_t *b = belief_of(in, k);
    const int16_t start_c7 = thermal_model_transformation(in->model, k).austenite_start_c7;
    const float limit_c = spring_c(start_c7) - kelvin(policy->parameters.undriven_margin_cc);
    const float c = now_c(in, k);
    const float rise_k = c - spring_c(thermal_model_ambient_c7(in->model));
    const float highest_c =
        c + SPRING_ESTIMATOR_LIKELY_SDS *
                (spring_estimator_sd_k(b) + SPRING_ESTIMATOR_NEIGHBOUR_SD * rise_k);
    /* as it is released it falls faster than it is going to: that does not end it */
    const float rise_k_per_s = s->released ? fmaxf(s->rise_k_per_s, 0.0f) : s->rise_k_per_s;
    const float severe = derating_severity(highest_c, rise_k_per_s, limit_c);
    if (severe <= 0.0f) {
        s->released = false;
    }
    return s->released || spring_estimator_possible(b) == SPRING_PHASE_ANY ? 0.0f : severe;
}

static float worst_neighbour(const drive_policy_t *policy, uint8_t k)
{
    const uint8_t columns = policy->columns;
    const uint8_t row = (uint8_t)(k / columns);
    const uint8_t column = (uint8_t)(k % columns);
    float worst = 0.0f;
    for (uint8_t r = row > 0 ? (uint8_t)(row - 1) : 0; r <= row + 1; r++) {
        for (uint8_t c = column > 0 ? (uint8_t)(column - 1) : 0; c <= column + 1 && c < columns;
             c++) {
            const uint16_t other = (uint16_t)(r * columns + c);
            if (other < policy->springs && policy->spring[other].severity > worst) {
                worst = policy->spring[other].severity;
            }
        }
    }
    return worst;
}

/* By how much the other driven springs were found colder lately, on average: the surroundings', and
 * no contact's. */
static float common_k(const drive_policy_t *policy, const drive_policy_input_t *in, uint8_t k)
{
    float sum_k = 0.0f;
    uint8_t others = 0;
    for (uint8_t i = 0; i < policy->springs; i++) {
        if (i != k && policy->spring[i].stage != DRIVE_POLICY_STAGE_OFF) {
            sum_k += spring_estimator_disturbance_k(belief_of(in, i));
            others++;
        }
    }
    return others != 0 ? sum_k / (float)others : 0.0f;
}

static void derate(drive_policy_t *policy, const drive_policy_input_t *in, uint8_t k, bool driven)
{
    drive_policy_spring_t *s = &policy->spring[k];
    const drive_policy_parameters_t *p = &policy->parameters;
    const float limit_c = 0.01f * (float)p->temperature_limit_cc;
    const float band_k = kelvin(p->temperature_band_cc);
    /* a touch of 8 K and a search are such doubts: half of the band is left to them */
    float doubt_k = spring_estimator_doubt_k(belief_of(in, k)) - 0.5f * band_k;
    if (doubt_k > 0.0f) { /* as a rule not: nine springs need not be asked */
        doubt_k -= common_k(policy, in, k);
    }
    const float c = now_c(in, k);
    float share = derating_share(doubt_k > 0.0f ? c + doubt_k : c, limit_c, band_k);
    s->derating = share < 1.0f ? DRIVE_POLICY_LIMIT_TEMPERATURE : DRIVE_POLICY_LIMIT_NONE;
    /* open is for who wants to see what currents alone do to the others, but for what burns */
    const bool open = p->policy == DRIVE_POLICY_OPEN;
    const float allowed = open ? 1.0f : 1.0f - worst_neighbour(policy, k);
    if (allowed < 1.0f && allowed <= share) {
        share = allowed;
        s->derating |= DRIVE_POLICY_LIMIT_UNDRIVEN;
    }
    s->ceiling_ma =
        share < 1.0f ? (uint16_t)(share * (float)p->boost_current_ma) : p->boost_current_ma;
    if (!driven) {
        s->tripped = false;
        s->derated_turns = 0;
    } else if (s->ceiling_ma != 0) {
        s->derated_turns = 0;
    } else if (s->derated_turns < UINT16_MAX) {
        s->derated_turns++;
        s->tripped =
            s->tripped || (p->trip_time_s != 0 && s->derated_turns >= p->trip_time_s * TURNS_PER_S);
    }
}

/* At most twice the time that is free of it; worked off only once nobody asks for more: else what
 * is derated would come and go. */
static void count_overload(drive_policy_t *policy)
{
    const drive_policy_parameters_t *p = &policy->parameters;
    bool waiting = false;
    for (uint8_t k = 0; k < policy->springs; k++) {
        waiting = waiting || (policy->spring[k].limits &
                              (DRIVE_POLICY_LIMIT_SUPPLY | DRIVE_POLICY_LIMIT_OVERLOAD)) != 0;
    }
    if (policy->sum_ma > p->overload_current_ma) {
        if (policy->overload_quarters < p->overload_time_s * TURNS_PER_S) {
            policy->overload_quarters++;
        }
    } else if (policy->overload_quarters != 0 && !waiting) {
        policy->overload_quarters--;
    }
}

/* ---- one spring, in its turn ---- */

/* A driven spring that is not where it was asked to be is never passed over in silence. */
static void watch_away(drive_policy_t *policy, const drive_policy_input_t *in, uint8_t k,
                       uint16_t level_permille)
{
    drive_policy_spring_t *s = &policy->spring[k];
    const float level = is_full(level_permille) ? 1.0f : 0.001f * (float)level_permille;
    const float band = is_full(level_permille) ? LEVEL_BAND : 2.0f * LEVEL_BAND;
    const spring_belief_t *b = belief_of(in, k);
    const bool there = s->stage == DRIVE_POLICY_STAGE_HOLD && spring_estimator_knows(b) &&
                       fabsf(phase_of(in, k) - level) < band;
    spring_away_turn(&s->away, there);
}

static uint16_t said_of(const drive_policy_t *policy, const drive_policy_input_t *in, uint8_t k)
{
    const drive_policy_spring_t *s = &policy->spring[k];
    uint16_t said = DRIVE_POLICY_LIMIT_NONE;
    if (spring_estimator_by_model(in->belief, k)) {
        said |= DRIVE_POLICY_LIMIT_BLIND;
    }
    if (s->stage == DRIVE_POLICY_STAGE_HEAT && s->wanted_ma == 0) {
        said |= DRIVE_POLICY_LIMIT_COOLING;
    }
    if (spring_away_says(&s->away)) {
        said |= DRIVE_POLICY_LIMIT_AWAY;
    }
    return said;
}

static void switch_off(drive_policy_t *policy, const drive_policy_input_t *in, uint8_t k)
{
    drive_policy_spring_t *s = &policy->spring[k];
    if (s->stage != DRIVE_POLICY_STAGE_OFF) {
        supply_queue_remove(&policy->queue, k);
        spring_estimator_leave(in->belief, k);
        s->stage = DRIVE_POLICY_STAGE_OFF;
    }
    s->wanted_ma = s->floor_ma = 0;
    s->away = (spring_away_t){0, 0};
}

static void update(drive_policy_t *policy, const drive_policy_input_t *in, uint8_t k)
{
    drive_policy_spring_t *s = &policy->spring[k];
    const uint16_t level_permille = in->level_permille[k];
    const bool driven = level_permille != 0 && in->allowed[k];
    const spring_belief_t *b = belief_of(in, k);
    if (spring_estimator_has_begun_anew(b)) {
        switch_off(policy, in, k); /* it begins as if it were asked for just now */
    }
    const float rise_k_per_s = spring_c(spring_estimator_moved_c7(b)) * (1.0f / TURN_S);
    s->rise_k_per_s += (rise_k_per_s - s->rise_k_per_s) * RISE_SHARE;
    s->released = s->released || driven; /* also where its turn comes before it is off */
    s->severity = driven ? 0.0f : severity(policy, in, k, s);
    /* what was just seen is acted on in the next turn: a tick has no time for both */
    if (driven && policy->parameters.policy != DRIVE_POLICY_OPEN &&
        !spring_estimator_has_just_seen(b)) {
        precompensate(policy, in, k, level_permille);
        watch_away(policy, in, k, level_permille);
    }
    derate(policy, in, k, driven);
}

/* The last ones to heat take turns while they are cold: else the very last heats alone, with most
 * of the supply unused. Far more that wait are better served one after the other. */
static void rotate_queue(drive_policy_t *policy, const drive_policy_input_t *in)
{
    int16_t coldest_c7 = INT16_MAX; /* of those that wait */
    int16_t warmest_c7 = INT16_MIN; /* of those that heat, but have not begun to transform */
    uint8_t warmest = 0;
    int room = 0; /* that heat, less twice those that wait */
    for (uint8_t n = 0; n < policy->queue.count; n++) {
        const uint8_t k = policy->queue.spring[n];
        const int16_t c7 = thermal_model_temperature_c7(in->model, k);
        if (policy->spring[k].granted_ma < policy->spring[k].wanted_ma / 2u) {
            room -= 2;
            coldest_c7 = c7 < coldest_c7 ? c7 : coldest_c7;
        } else {
            room++;
            if (c7 > warmest_c7 &&
                c7 < thermal_model_transformation(in->model, k).austenite_start_c7 - GOES_ON_C7) {
                warmest_c7 = c7;
                warmest = k;
            }
        }
    }
    if (room >= 0 && (int32_t)warmest_c7 - TURN_C7 > coldest_c7) {
        supply_queue_remove(&policy->queue, warmest);
        supply_queue_add(&policy->queue, warmest);
    }
}

/* Of the springs that were believed anew in this tick. */
static void take_turn(drive_policy_t *policy, const drive_policy_input_t *in, uint8_t turn)
{
    for (uint16_t k = turn; k < policy->springs; k = (uint16_t)(k + SPRING_ESTIMATOR_ROUND)) {
        update(policy, in, (uint8_t)k);
    }
    if (policy->walks != 0) {
        policy->walks--;
    }
    if (turn == SPRING_ESTIMATOR_ROUND - 1u) {
        count_overload(policy);
        rotate_queue(policy, in);
    }
}

/* ---- one tick ---- */

/* Rounded, without a division of 32 bits: nine of those would be a tenth of a tick's cycles. */
static uint16_t share_of_ma(uint16_t full_ma, uint16_t level_permille)
{
    const uint16_t share_q16 = (uint16_t)(((uint32_t)level_permille * 33554u) >> 9); /* 65.535 */
    return (uint16_t)(((uint32_t)full_ma * share_q16 + 0x8000u) >> 16);
}

/* What each spring asks for, after its own limits. */
static void claim_of(drive_policy_t *policy, const drive_policy_input_t *in, uint8_t k,
                     supply_claim_t *claim)
{
    drive_policy_spring_t *s = &policy->spring[k];
    const drive_policy_parameters_t *p = &policy->parameters;
    const bool open = p->policy == DRIVE_POLICY_OPEN;
    *claim = (supply_claim_t){0};
    s->limits = DRIVE_POLICY_LIMIT_NONE;
    if (in->level_permille[k] == 0 || !in->allowed[k] || s->tripped) {
        if (in->level_permille[k] != 0) {
            s->limits = in->allowed[k] ? DRIVE_POLICY_LIMIT_TRIP : DRIVE_POLICY_LIMIT_SAFETY;
        }
        switch_off(policy, in, k);
        return;
    }
    if (open) {
        switch_off(policy, in, k);
        s->wanted_ma = share_of_ma(p->open_current_ma, in->level_permille[k]);
    } else {
        s->limits = said_of(policy, in, k);
    }
    uint16_t asked_ma = s->wanted_ma;
    if (s->ceiling_ma < asked_ma && (!open || s->derating != 0)) { /* else it is the boost's */
        asked_ma = s->ceiling_ma;
        s->limits |= s->derating;
    }
    if (asked_ma > in->maximum_current_ma) {
        asked_ma = in->maximum_current_ma;
        s->limits |= DRIVE_POLICY_LIMIT_CURRENT;
    }
    claim->asked_ma = asked_ma;
    claim->secured_ma =
        s->stage != DRIVE_POLICY_STAGE_HEAT || s->floor_ma > asked_ma ? asked_ma : s->floor_ma;
}

/* A slow triangle below what is granted, each spring at another place of it. */
static uint16_t dithered_ma(const drive_policy_t *policy, uint8_t k)
{
    const drive_policy_spring_t *s = &policy->spring[k];
    const uint16_t dither_ma = s->stage == DRIVE_POLICY_STAGE_HEAT
                                   ? policy->parameters.dither_ma / HEAT_DITHER
                                   : policy->parameters.dither_ma;
    const uint8_t place = (uint8_t)(policy->sweep + 7u * k) & 31u;
    /* down on even steps, back on odd ones: finer than a step of the sensor */
    const uint16_t steps = place < 16u ? 2u * place : 63u - 2u * place;
    const uint16_t drop_ma = (uint16_t)(steps * dither_ma / 32u);
    return s->granted_ma > drop_ma ? (uint16_t)(s->granted_ma - drop_ma) : s->granted_ma;
}

/* After a change of policy a target walks from where it was, up as far as there is room. */
static uint16_t walked_ma(uint16_t last_ma, uint16_t target_ma, uint16_t *room_ma)
{
    if (target_ma <= last_ma) {
        return target_ma + WALK_MA < last_ma ? (uint16_t)(last_ma - WALK_MA) : target_ma;
    }
    uint16_t rise_ma = (uint16_t)(target_ma - last_ma);
    rise_ma = rise_ma > WALK_MA ? WALK_MA : rise_ma;
    rise_ma = rise_ma > *room_ma ? *room_ma : rise_ma;
    *room_ma = (uint16_t)(*room_ma - rise_ma);
    return (uint16_t)(last_ma + rise_ma);
}

static void give(drive_policy_t *policy, uint16_t budget_ma, uint16_t target_ma[])
{
    const bool dithers = policy->parameters.policy != DRIVE_POLICY_OPEN;
    uint16_t room_ma = policy->sum_ma < budget_ma ? (uint16_t)(budget_ma - policy->sum_ma) : 0;
    const bool may_walk = policy->walks != 0 && policy->sum_ma <= budget_ma;
    policy->sweep++;
    policy->sum_ma = 0;
    for (uint8_t k = 0; k < policy->springs; k++) {
        drive_policy_spring_t *s = &policy->spring[k];
        uint16_t ma = dithers ? dithered_ma(policy, k) : s->granted_ma;
        if (may_walk && (s->granted_ma != 0 || s->stage != DRIVE_POLICY_STAGE_OFF)) {
            const uint16_t wanted_ma = ma;
            ma = walked_ma(s->target_ma, ma, &room_ma);
            if (ma != wanted_ma) {
                policy->walks = WALK_TURNS;
            }
        }
        s->target_ma = target_ma[k] = ma;
        policy->sum_ma = (uint16_t)(policy->sum_ma + ma);
    }
}

static void share(drive_policy_t *policy, const drive_policy_input_t *in, uint16_t *budget_ma)
{
    const drive_policy_parameters_t *p = &policy->parameters;
    const uint16_t supply_ma = in->supply_limit_ma > p->supply_reserve_ma
                                   ? (uint16_t)(in->supply_limit_ma - p->supply_reserve_ma)
                                   : 0;
    *budget_ma =
        p->policy == DRIVE_POLICY_OPEN
            ? supply_ma
            : derating_overload_ma(supply_ma, p->overload_current_ma, policy->overload_quarters,
                                   (uint16_t)(p->overload_time_s * TURNS_PER_S));
    supply_claim_t claim[DRIVE_POLICY_MAX_SPRINGS];
    uint16_t granted_ma[DRIVE_POLICY_MAX_SPRINGS];
    for (uint8_t k = 0; k < policy->springs; k++) {
        claim_of(policy, in, k, &claim[k]);
    }
    supply_share(&policy->queue, claim, policy->springs, *budget_ma, granted_ma);
    for (uint8_t k = 0; k < policy->springs; k++) {
        drive_policy_spring_t *s = &policy->spring[k];
        if ((uint16_t)(granted_ma[k] + JUMP_MA - s->granted_ma) > 2u * JUMP_MA) {
            spring_estimator_disturb(in->belief, k);
        }
        s->granted_ma = granted_ma[k];
        if (granted_ma[k] < claim[k].asked_ma) {
            s->limits |=
                *budget_ma < supply_ma ? DRIVE_POLICY_LIMIT_OVERLOAD : DRIVE_POLICY_LIMIT_SUPPLY;
        }
    }
}

void drive_policy_tick(drive_policy_t *policy, const drive_policy_input_t *in, uint16_t target_ma[])
{
    const uint8_t turn = spring_estimator_turn(in->belief);
    if (turn != SPRING_ESTIMATOR_NO_TURN) {
        take_turn(policy, in, turn);
    }
    uint16_t budget_ma;
    share(policy, in, &budget_ma);
    give(policy, budget_ma, target_ma);
    INVARIANT(policy->sum_ma <= budget_ma);
}

uint16_t drive_policy_limits(const drive_policy_t *policy, uint8_t spring)
{
    return policy->spring[spring].limits;
}

uint16_t drive_policy_cut_ma(const drive_policy_t *policy, uint8_t spring)
{
    const drive_policy_spring_t *s = &policy->spring[spring];
    const uint16_t cutting = DRIVE_POLICY_LIMIT_CURRENT | DRIVE_POLICY_LIMIT_SUPPLY |
                             DRIVE_POLICY_LIMIT_TEMPERATURE | DRIVE_POLICY_LIMIT_UNDRIVEN |
                             DRIVE_POLICY_LIMIT_OVERLOAD;
    return (s->limits & cutting) != 0 && s->wanted_ma > s->target_ma
               ? (uint16_t)(s->wanted_ma - s->target_ma)
               : 0;
}

drive_policy_stage_t drive_policy_stage(const drive_policy_t *policy, uint8_t spring)
{
    return (drive_policy_stage_t)policy->spring[spring].stage;
}

void drive_policy_clear(drive_policy_t *policy)
{
    for (uint8_t k = 0; k < policy->springs; k++) {
        policy->spring[k].tripped = false;
        policy->spring[k].derated_turns = 0;
    }
}
