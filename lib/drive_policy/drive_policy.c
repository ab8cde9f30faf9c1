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

#define TICKS_PER_REST  5u /* no spring is updated in that tick: a round takes 1/4 s */
#define SOFT_MA         20 /* per tick, after a change of policy */
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
        resistance_observer_reset(&s->observer);
        s->ceiling_ma = parameters->boost_current_ma;
        s->full_permille = 1000;
    }
    return true;
}

void drive_policy_prepare(drive_policy_t *policy, const thermal_model_t *model)
{
    const drive_policy_parameters_t *p = &policy->parameters;
    const thermal_model_parameters_t *m = &model->parameters;
    resistance_alloy_prepare(&policy->alloy, m->resistance_martensite_uohm,
                             m->resistance_austenite_uohm);
    policy->columns = m->columns;
    const thermal_model_transformation_t points = thermal_model_transformation(model, 0);

    /* a distance of 1 K is closed with a time constant of 4 s: C / 4 s */
    uint32_t feedback = (uint32_t)m->heat_capacity_mj_per_k * 1000u / (4u * KELVIN_C7);
    policy->feedback_uw_per_c7 = feedback > 16383u ? 16383u : (uint16_t)feedback;
    /* half of the error in each update: width / 2 / 1000 */
    uint16_t width_c7 = (uint16_t)(points.austenite_finish_c7 - points.austenite_start_c7);
    policy->correction_q8 = (uint16_t)((uint32_t)width_c7 * 131u >> 10);
    /* 35 % of the declared loss */
    policy->bias_limit_uw_per_k = (int16_t)((uint32_t)m->loss_uw_per_k * 23u >> 6);
    /* heat of a fall of 0.04 K/s over the 60 K that correct_hold works with */
    policy->falling_uw_per_k = (int16_t)((uint32_t)policy->feedback_uw_per_c7 * 87u >> 8);
    width_c7 = (uint16_t)(points.martensite_start_c7 - points.martensite_finish_c7);
    policy->event_c7 = (int16_t)((uint32_t)width_c7 * 14u >> 8); /* 5.5 % */

    policy->hold_margin_c7 = fixed_point_c7_from_cc((int16_t)p->hold_margin_cc);
    policy->unsure_margin_c7 = fixed_point_c7_from_cc((int16_t)p->unsure_margin_cc);
    policy->search_c7 = (int16_t)((uint32_t)p->search_mk_per_s * 131u >> 10);
    policy->limit_c7 = fixed_point_c7_from_cc((int16_t)p->temperature_limit_cc);
    uint16_t band_c7 = (uint16_t)fixed_point_c7_from_cc((int16_t)p->temperature_band_cc);
    policy->derating_gain = (uint16_t)(65535u / band_c7);
    policy->undriven_c7 =
        fixed_point_c7_from_cc((int16_t)(m->austenite_start_cc - (int16_t)p->undriven_margin_cc));
    policy->overload_half_quarters = (uint16_t)(p->overload_time_s * 2u);
    policy->overload_gain = (uint16_t)(65535u / policy->overload_half_quarters);
    policy->prepared = true;
}

/* ---- what the model says ---- */

static int16_t model_permille(const thermal_model_t *model, uint8_t k)
{
    return (int16_t)(((uint32_t)thermal_model_austenite(model, k) * 125u) >> 12);
}

/* The loss beyond the model's at a temperature, uW. */
static int32_t bias_at(const thermal_model_t *model, int16_t bias_uw_per_k, int16_t temperature_c7)
{
    if (bias_uw_per_k == 0) {
        return 0;
    }
    int16_t above_c7 = (int16_t)(temperature_c7 - thermal_model_ambient_c7(model));
    if (above_c7 <= 0) {
        return 0;
    }
    return (int32_t)fixed_point_mac_s16_u16(0, bias_uw_per_k, (uint16_t)above_c7) >> 7;
}

uint32_t drive_policy_model_power_uw(const drive_policy_t *policy, uint8_t spring,
                                     uint32_t power_uw)
{
    const drive_policy_spring_t *s = &policy->spring[spring];
    if ((s->flags & FLAG_FALSE) != 0) { /* the current in the highest resistance that it can have */
        uint32_t real_q14 = ((uint32_t)s->observer.inverse_q14 * policy->alloy.highest_q14) >> 14;
        if (real_q14 > RESISTANCE_OBSERVER_ONE_Q14) {
            power_uw = (power_uw >> 8) * (real_q14 > UINT16_MAX ? UINT16_MAX : real_q14) >> 6;
        }
    }
    int32_t bias_uw = s->bias_now_uw;
    if (bias_uw > 0 && (uint32_t)bias_uw > power_uw) {
        return 0;
    }
    return (uint32_t)((int32_t)power_uw - bias_uw);
}

/* The model's spring to a temperature, its phase as if it came from martensite or from austenite.
 */
static void rewind_to(thermal_model_t *model, uint8_t k, int16_t temperature_c7, bool from_cold)
{
    thermal_model_set_temperature(
        model, k,
        from_cold
            ? (int16_t)(thermal_model_transformation(model, k).martensite_finish_c7 - KELVIN_C7)
            : (int16_t)(thermal_model_transformation(model, k).austenite_finish_c7 + KELVIN_C7));
    thermal_model_set_temperature(model, k, temperature_c7);
}

/* ---- the observer's corrections ---- */

static bool trusted(const drive_policy_t *policy, const drive_policy_spring_t *s)
{
    return policy->parameters.observer != 0 && (s->flags & FLAG_LET_GO) == 0 &&
           s->fresh >= FRESH_WINDOWS &&
           resistance_observer_is_plausible(&s->observer, &policy->alloy);
}

/* Austenite as the resistance says, 0..1000 permille. Fully on is what it read when it had
 * transformed, whatever the declared resistances say. */
static int16_t read_phase(const drive_policy_spring_t *s)
{
    int16_t phase = s->observer.phase_permille;
    if (phase <= 0) {
        return 0;
    }
    int16_t beyond = (int16_t)(1000 - s->full_permille);
    uint32_t part = fixed_point_mac_s16_u16(0, beyond, (uint16_t)phase);
    phase = (int16_t)(phase + ((int16_t)(part >> 8) >> 2));
    return phase > 1000 ? 1000 : phase;
}

/* The same, or as the model says where the resistance is not trusted. */
static int16_t best_phase(const drive_policy_t *policy, const drive_policy_spring_t *s,
                          const thermal_model_t *model, uint8_t k)
{
    return trusted(policy, s) ? read_phase(s) : model_permille(model, k);
}

/* How far the model is to move for an error of its phase: half of what is beyond the deadband. */
static int16_t correction_c7(const drive_policy_t *policy, int16_t error, int16_t deadband)
{
    if (error > deadband) {
        error = (int16_t)(error - deadband);
    } else if (error < -deadband) {
        error = (int16_t)(error + deadband);
    } else {
        return 0;
    }
    return (int16_t)(((int32_t)error * policy->correction_q8) >> 8);
}

/* While it heats: where the resistance says the spring is, against where the model has it. */
static void correct_heating(const drive_policy_t *policy, drive_policy_spring_t *s,
                            thermal_model_t *model, uint8_t k, int16_t phase, int16_t permille)
{
    int16_t now_c7 = thermal_model_temperature_c7(model, k);
    int16_t error = (int16_t)(phase - permille);
    int16_t move_c7 = 0;
    if (now_c7 < thermal_model_transformation(model, k).austenite_start_c7) {
        if (error > PHASE_DEADBAND && phase > PHASE_SEEN) {
            move_c7 = (int16_t)(thermal_model_transformation(model, k).austenite_start_c7 +
                                KELVIN_C7 - now_c7);
        } /* too little phase below austenite start is memory, and heating brings it */
    } else if (phase < 1000 - PHASE_MISSING &&
               now_c7 > thermal_model_transformation(model, k).austenite_finish_c7) {
        move_c7 = (int16_t)(thermal_model_transformation(model, k).austenite_finish_c7 -
                            KELVIN_C7 / 2 - now_c7);
    } else {
        move_c7 = correction_c7(policy, error, PHASE_DEADBAND);
    }
    if (move_c7 == 0) {
        return;
    }
    /* within a transformation a little temperature is much heat */
    int16_t before_c7 = thermal_model_enthalpy_c7(model, k);
    if (move_c7 > 0) {
        thermal_model_add_temperature(model, k, move_c7);
    } else {
        rewind_to(model, k, (int16_t)(now_c7 + move_c7), true);
    }
    /* forgotten within minutes: in a long heating small errors add up */
    s->corrected_c7 = (int16_t)(s->corrected_c7 - (s->corrected_c7 >> 8) +
                                thermal_model_enthalpy_c7(model, k) - before_c7);
    if (s->corrected_c7 > TRUST_LIMIT_C7 || s->corrected_c7 < -TRUST_LIMIT_C7) {
        s->flags |= FLAG_LET_GO; /* and what it did is undone */
        thermal_model_add_enthalpy(model, k, (int16_t)-s->corrected_c7);
        s->corrected_c7 = 0;
    }
}

/* How far into its width a transformation is, permille, that has made so much austenite:
 * acos(1 - 2 x) / pi in three straight pieces to a half and their mirror, to 15 permille. */
static int16_t place_of_phase(int16_t permille)
{
    bool upper = permille > 500;
    uint16_t x = (uint16_t)(upper ? 1000 - permille : permille);
    uint16_t place = x < 38    ? (uint16_t)((x * 13u) >> 2)
                     : x < 146 ? (uint16_t)(125u + (((x - 38u) * 295u) >> 8))
                               : (uint16_t)(250u + (((x - 146u) * 181u) >> 8));
    return (int16_t)(upper ? 1000u - place : place);
}

/* Where heating goes on to transform a spring that is so much austenite. */
static int16_t goes_on_c7(const drive_policy_t *policy, const thermal_model_t *model, uint8_t k,
                          int16_t permille)
{
    uint16_t place = (uint16_t)place_of_phase(clamp16(permille, 0, 1000));
    uint32_t place_q15 = fixed_point_mac_u16(0, place, policy->correction_q8) << 1;
    return (int16_t)(thermal_model_transformation(model, k).austenite_start_c7 +
                     (int16_t)(place_q15 >> 8));
}

/* Between martensite start and austenite start the phase rests: what the resistance says of it is
 * the phase's memory, not the temperature. */
static void impose_phase(const drive_policy_t *policy, thermal_model_t *model, uint8_t k,
                         int16_t permille)
{
    int16_t now_c7 = thermal_model_temperature_c7(model, k);
    thermal_model_set_temperature(
        model, k,
        (int16_t)(thermal_model_transformation(model, k).martensite_finish_c7 - KELVIN_C7));
    thermal_model_set_temperature(model, k, goes_on_c7(policy, model, k, permille));
    thermal_model_set_temperature(model, k, now_c7);
}

/* While it cools to a level, or is probed. */
static void correct_cooling(const drive_policy_t *policy, thermal_model_t *model, uint8_t k,
                            int16_t phase, int16_t deadband)
{
    int16_t move_c7 = correction_c7(policy, (int16_t)(phase - model_permille(model, k)), deadband);
    if (move_c7 != 0) {
        thermal_model_add_temperature(model, k, move_c7);
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
    /* A wrong loss shows with the spring's own time, some 50 s: seen early it is the greater. A
     * hold that is too cold is worse than one too hot, so this counts for losses only. */
    if (difference_uw > 0 && s->held < 2u * FULL_MINUTE) {
        difference_uw += s->held < FULL_MINUTE ? difference_uw >> 1 : difference_uw >> 2;
    }
    /* / 60 K, where springs are held above ambient */
    s->bias_uw_per_k = clamp16(s->bias_uw_per_k + ((difference_uw * 273) >> 14),
                               (int16_t)-policy->bias_limit_uw_per_k, policy->bias_limit_uw_per_k);
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
    supply_queue_remove(&policy->queue, k);
    if (stage == DRIVE_POLICY_STAGE_HEAT) {
        supply_queue_add(&policy->queue, k);
    }
    if (stage == DRIVE_POLICY_STAGE_HOLD) {
        s->margin_c7 = (s->flags & FLAG_LEARNT) != 0 || s->bias_uw_per_k != 0
                           ? (int16_t)(policy->hold_margin_c7 + AFTER_BOOST_C7)
                           : policy->unsure_margin_c7;
    }
    s->floor_ma = s->stage == DRIVE_POLICY_STAGE_HOLD ? s->wanted_ma : 0; /* until its turn */
    s->stage = (uint8_t)stage;
    s->wanted_ma = stage == DRIVE_POLICY_STAGE_HEAT  ? policy->parameters.boost_current_ma
                   : stage == DRIVE_POLICY_STAGE_OFF ? 0
                                                     : policy->parameters.probe_current_ma;
    s->corrected_c7 = 0;
    s->flags &= (uint8_t)~FLAG_DOUBT;
    s->lost_permille = 0;
    s->reference = 0;
    s->plateau = 0;
    s->held = 0;
    s->suspicion = 0;
}

/* What heats a spring at a temperature, against its neighbours as they are now, plus a correction
 * towards it. */
static uint16_t hold_current_ma(const drive_policy_t *policy, const drive_policy_spring_t *s,
                                const thermal_model_t *model, uint8_t k, int16_t target_c7,
                                int16_t extra_64uw)
{
    int16_t short_c7 = (int16_t)(target_c7 - thermal_model_temperature_c7(model, k));
    short_c7 = short_c7 > SHORT_MOST_C7    ? SHORT_MOST_C7
               : short_c7 < -SHORT_MOST_C7 ? -SHORT_MOST_C7
                                           : short_c7;
    int32_t power_uw = thermal_model_power_to_hold_uw(model, k, target_c7) +
                       bias_at(model, s->bias_uw_per_k, target_c7);
    power_uw += (int32_t)fixed_point_mac_s16_u16(0, short_c7, policy->feedback_uw_per_c7);
    int32_t power_64uw = ((int32_t)((uint32_t)power_uw << 2) >> 8) + extra_64uw;
    if (power_64uw <= 0) {
        return 0;
    }
    return resistance_current_for_power_ma(&policy->alloy, s->observer.inverse_q14,
                                           power_64uw > UINT16_MAX ? UINT16_MAX
                                                                   : (uint16_t)power_64uw);
}

/* It heats with much less than it asks for. */
static bool waits_for_supply(const drive_policy_spring_t *s)
{
    return s->granted_ma < s->asked_ma - (s->asked_ma >> 2);
}

static bool is_transformed(const drive_policy_t *policy, drive_policy_spring_t *s,
                           thermal_model_t *model, uint8_t k, bool sees, int16_t phase)
{
    int16_t now_c7 = thermal_model_temperature_c7(model, k);
    if (!sees) {
        bool derated = s->ceiling_ma < policy->parameters.boost_current_ma >> 1;
        return now_c7 >= thermal_model_transformation(model, k).austenite_finish_c7 +
                             BLIND_OVERSHOOT_C7 ||
               (derated && now_c7 >= thermal_model_transformation(model, k).austenite_finish_c7);
    }
    if (s->plateau >= PLATEAU_TRUSTED && phase > 600 &&
        s->target_ma >= policy->parameters.boost_current_ma >> 1) {
        if (now_c7 < thermal_model_transformation(model, k).austenite_finish_c7) {
            rewind_to(model, k, thermal_model_transformation(model, k).austenite_finish_c7, true);
        }
        return true;
    }
    return s->plateau >= 2 && phase >= RATIO_FULL_PERMILLE &&
           now_c7 >= thermal_model_transformation(model, k).austenite_finish_c7 - KELVIN_C7;
}

/* Counts windows in which the phase stood still: the last percent of a transformation is slow. What
 * heats with less current is slower in all of it. */
static void watch_plateau(const drive_policy_t *policy, drive_policy_spring_t *s)
{
    int16_t phase = s->observer.phase_permille;
    int16_t change = (int16_t)(phase - s->before_permille);
    bool boosts = s->target_ma >=
                  policy->parameters.boost_current_ma - (policy->parameters.boost_current_ma >> 2);
    int16_t most = boosts ? PLATEAU_BOOST : PLATEAU_SLOW;
    s->before_permille = phase;
    if (change > most || change < -most) {
        s->plateau = 0;
    } else if (s->plateau < UINT8_MAX) {
        s->plateau++;
    }
}

/* Where the resistance says that the heating is, and the model with it. True once the wanted phase
 * is reached. */
static bool has_heated(drive_policy_t *policy, drive_policy_spring_t *s, thermal_model_t *model,
                       uint8_t k, int16_t level, bool fresh)
{
    int16_t now_c7 = thermal_model_temperature_c7(model, k);
    int16_t permille = model_permille(model, k);
    bool certain = permille == 0 &&
                   now_c7 < thermal_model_transformation(model, k).austenite_start_c7 - CERTAIN_C7;
    if (certain && fresh && s->fresh >= LEARNING_WINDOWS) {
        resistance_observer_learn_martensite(&s->observer, &policy->alloy);
    }
    bool sees = trusted(policy, s);
    bool strong = s->target_ma >= 2u * policy->parameters.probe_current_ma; /* no coarse reading */
    int16_t phase = sees ? read_phase(s) : permille;
    /* until heating goes on, what it is, is memory */
    bool rests = now_c7 < goes_on_c7(policy, model, k, permille) - KELVIN_C7;
    if (waits_for_supply(s) || rests) {
        s->plateau = 0; /* it stands still because it waits, or has not begun to go on */
    } else if (fresh) {
        watch_plateau(policy, s);
    }
    if (fresh && s->reference == 0) {
        if (now_c7 < thermal_model_transformation(model, k).martensite_finish_c7) {
            s->reference = 1;
        } else if (sees && strong &&
                   now_c7 > thermal_model_transformation(model, k).martensite_start_c7) {
            s->reference = 1; /* the first look at it, if it was not cold before */
            if (now_c7 < thermal_model_transformation(model, k).austenite_start_c7 &&
                (phase > permille + PHASE_SEEN || phase < permille - PHASE_SEEN)) {
                impose_phase(policy, model, k, phase);
                return false;
            }
        }
    } else if (fresh && sees && strong && !certain && (!rests || phase > permille)) {
        correct_heating(policy, s, model, k, phase, permille);
    }
    if (level < LEVEL_FULL_PERMILLE) {
        return phase >= level;
    }
    if (!is_transformed(policy, s, model, k, sees, phase)) {
        return false;
    }
    if (sees) {
        s->full_permille = clamp16(s->observer.phase_permille, 1000 - FULL_MOST_PERMILLE,
                                   1000 + FULL_MOST_PERMILLE);
    }
    return true;
}

static void heat(drive_policy_t *policy, drive_policy_spring_t *s, thermal_model_t *model,
                 uint8_t k, int16_t level, bool fresh)
{
    int16_t now_c7 = thermal_model_temperature_c7(model, k);
    bool waits = waits_for_supply(s);
    bool slows = level < LEVEL_FULL_PERMILLE &&
                 now_c7 > thermal_model_transformation(model, k).austenite_start_c7 - KELVIN_C7;
    if ((waits || slows) && (policy->round & 1u) != 0) { /* every second time: a tick is short */
        uint16_t keeps_ma =
            hold_current_ma(policy, s, model, k, now_c7, slows ? PARTIAL_POWER_64UW : 0);
        if (slows && keeps_ma < s->wanted_ma) {
            s->wanted_ma = keeps_ma;
        }
        /* what it has is kept while it waits */
        bool has = now_c7 > thermal_model_transformation(model, k).austenite_start_c7 + KEPT_C7 ||
                   best_phase(policy, s, model, k) > level >> 1;
        s->floor_ma = waits && has ? keeps_ma : 0;
    } else if (has_heated(policy, s, model, k, level, fresh)) {
        enter(policy, k, DRIVE_POLICY_STAGE_HOLD);
    }
}

/* The reading cannot be right: the model alone, with the wide margin. Whether a spring that is
 * fully on has kept its phase is not known: its hold goes above austenite finish first, by power
 * and not by boost, which takes it there, be it austenite or not. From there the margin narrows by
 * 1 K a minute: at this power latent heat takes its time. */
static void let_go(const drive_policy_t *policy, drive_policy_spring_t *s,
                   const thermal_model_t *model, bool full)
{
    s->flags = (uint8_t)((s->flags | FLAG_LET_GO) & ~FLAG_LEARNT);
    s->bias_uw_per_k = 0;
    s->margin_c7 = policy->unsure_margin_c7;
    if (full) {
        const thermal_model_transformation_t points = thermal_model_transformation(model, 0);
        s->margin_c7 =
            (int16_t)(points.austenite_finish_c7 + BLIND_OVERSHOOT_C7 - points.martensite_start_c7);
    }
}

/* A first doubt stops the search for a while: what is seen then is seen with less delay. */
static bool is_pausing(const drive_policy_spring_t *s)
{
    return s->suspicion != 0 && s->suspicion <= PAUSE_WINDOWS;
}

/* The average has settled. What was lost is lost for good, and by now the average shows all of it:
 * a loss that it does not show was its own wandering. */
static void take_reference(drive_policy_t *policy, drive_policy_spring_t *s)
{
    if ((s->flags & FLAG_DOUBT) != 0) {
        int16_t lost = (int16_t)-resistance_observer_drift_permille(&s->observer, &policy->alloy,
                                                                    s->reference_q14);
        s->flags &= (uint8_t)~FLAG_DOUBT;
        if ((s->flags & FLAG_LEARNT) != 0 &&
            (lost >= LOSS_CONFIRMED || (s->flags & FLAG_SEEN_ONCE) != 0)) {
            s->flags &= (uint8_t)~FLAG_SEEN_ONCE;
            lost = (int16_t)(s->lost_permille + lost);
        } else { /* who knows how much it was: all is heated back, and looked for again */
            s->flags = FLAG_SEEN_ONCE; /* the others are not of a spring that is held and read */
            lost = LOSS_RESTORED;
        }
        s->lost_permille = lost;
    }
    s->followed = 0;
    s->reference_q14 = (uint16_t)(s->observer.slow_q22 >> 8);
}

/* Looks for the first loss of phase: martensite start, seen as on a thermometer. */
static void watch_hold(drive_policy_t *policy, drive_policy_spring_t *s, thermal_model_t *model,
                       uint8_t k, bool full)
{
    int16_t now_c7 = thermal_model_temperature_c7(model, k);
    int16_t target_c7 =
        (int16_t)(thermal_model_transformation(model, k).martensite_start_c7 + s->margin_c7);
    if (s->reference < REFERENCE_WINDOWS) {
        if (now_c7 < target_c7 + SETTLED_C7 && now_c7 > target_c7 - SETTLED_C7) {
            s->reference++;
        } else if (s->reference == 0 && (s->flags & FLAG_DOUBT) == 0) {
            resistance_observer_restart_average(&s->observer);
        }
        if (s->reference == REFERENCE_WINDOWS) {
            take_reference(policy, s);
            if (full && s->lost_permille >= LOSS_RESTORED) {
                enter(policy, k, DRIVE_POLICY_STAGE_HEAT);
            }
        }
        return;
    }
    int16_t loss = (int16_t)-resistance_observer_drift_permille(&s->observer, &policy->alloy,
                                                                s->reference_q14);
    if (loss < -GAIN_IMPLAUSIBLE) {
        let_go(policy, s, model, full);
        return;
    }
    int16_t start_c7 = thermal_model_transformation(model, k).martensite_start_c7;
    if (loss + s->lost_permille >= LOSS_REHEAT && full) {
        enter(policy, k, DRIVE_POLICY_STAGE_HEAT);
        return;
    }
    bool searches = (s->flags & FLAG_LEARNT) == 0;
    uint16_t slow_q14 = (uint16_t)(s->observer.slow_q22 >> 8);
    int16_t unsure_c7 = policy->unsure_margin_c7;
    if (now_c7 >
        start_c7 + (searches ? unsure_c7 - (unsure_c7 >> 3) : policy->hold_margin_c7 + KELVIN_C7)) {
        s->reference_q14 = slow_q14; /* so far off, what the average does is its own */
        s->suspicion = 0;
        return;
    }
    if ((searches || now_c7 > start_c7) && s->suspicion == 0 && (s->fresh & 7u) == 0) {
        /* the sensor's steps let the average wander as the current changes: 0.1 permille a second
         * is followed, a loss is ten times faster; once it is held still not for ever */
        if (slow_q14 > s->reference_q14 && (searches || s->followed < FOLLOWED_MOST)) {
            s->reference_q14++;
            s->followed = (int8_t)(s->followed + !searches);
        } else if (slow_q14 < s->reference_q14 && (searches || s->followed > -FOLLOWED_MOST)) {
            s->reference_q14--;
            s->followed = (int8_t)(s->followed - !searches);
        }
    }
    s->suspicion = loss < LOSS_SUSPECTED      ? 0
                   : s->suspicion < UINT8_MAX ? (uint8_t)(s->suspicion + 1)
                                              : UINT8_MAX;
    if (loss >= LOSS_SEEN) {
        correct_hold(policy, s, model, k, (int16_t)(start_c7 - policy->event_c7), full);
        if (s->margin_c7 < 0 && s->bias_uw_per_k < 0) {
            /* pulled below start it was falling: not all of the bias is steady loss */
            s->bias_uw_per_k = clamp16(s->bias_uw_per_k + policy->falling_uw_per_k, INT16_MIN, 0);
        }
        s->reference = 0; /* the average lags: a new one once it has settled */
        s->suspicion = 0;
        s->flags |= FLAG_DOUBT;
        if (now_c7 < start_c7 + (policy->unsure_margin_c7 >> 1)) {
            s->flags |= FLAG_LEARNT; /* farther off is hardly any array: it must be seen twice */
        }
        s->margin_c7 = policy->hold_margin_c7;
        return;
    }
    if (now_c7 < start_c7 - PIN_C7) {
        correct_hold(policy, s, model, k, (int16_t)(start_c7 - PIN_C7), full);
    }
}

/* The margin narrows: to the wanted one where the loss is known, else until the start is seen. */
static void narrow_margin(const drive_policy_t *policy, drive_policy_spring_t *s,
                          const thermal_model_t *model, bool full)
{
    int16_t floor_c7 =
        (s->flags & FLAG_LEARNT) != 0 ? policy->hold_margin_c7 : (int16_t) - (PIN_C7 + PULL_C7);
    if (policy->search_c7 == 0 || is_pausing(s) || (s->fresh & 3u) != 0 ||
        (s->reference < REFERENCE_WINDOWS && s->granted_ma >= s->asked_ma)) {
        return;
    }
    if (s->margin_c7 > floor_c7) {
        s->margin_c7 = (int16_t)(s->margin_c7 - policy->search_c7);
        if (s->margin_c7 < floor_c7) {
            s->margin_c7 = floor_c7;
        }
    } else if ((s->flags & FLAG_LEARNT) == 0 && s->bias_uw_per_k <= -policy->bias_limit_uw_per_k) {
        let_go(policy, s, model, full); /* it must have been passed */
    }
}

static void hold(drive_policy_t *policy, drive_policy_spring_t *s, thermal_model_t *model,
                 uint8_t k, int16_t level, bool fresh)
{
    bool full = level >= LEVEL_FULL_PERMILLE;
    int16_t phase = full ? s->observer.phase_permille : read_phase(s);
    if ((policy->round & 3u) == 0 && s->held < UINT8_MAX) {
        s->held++;
    }
    bool sees = trusted(policy, s);
    /* right after its boost the model is sure, each second less: others may have the current */
    int16_t coasting_c7 = (int16_t)(COASTING_C7 + s->held * COASTING_RISE_C7);
    bool coasts =
        sees && policy->queue.count != 0 && s->reference == 0 && coasting_c7 < s->margin_c7;
    if ((full || !sees) && model_permille(model, k) < level - 2 * LEVEL_BAND_PERMILLE) {
        enter(policy, k, DRIVE_POLICY_STAGE_HEAT); /* more is wanted than before */
        return;
    }
    if (!sees) {
        if ((s->flags & FLAG_DOUBT) != 0) { /* what was seen last may have been the same lie */
            s->flags &= (uint8_t) ~(FLAG_DOUBT | FLAG_LEARNT);
            s->bias_uw_per_k = 0;
        }
        if (s->margin_c7 > policy->unsure_margin_c7) {
            s->margin_c7 = (int16_t)(s->margin_c7 - (int16_t)(policy->round & 1u));
        } else if (s->fresh >= FRESH_WINDOWS) {
            s->margin_c7 = policy->unsure_margin_c7;
        }
        phase = full ? INT16_MAX : level;
    } else if (fresh && !coasts) {
        watch_hold(policy, s, model, k, full);
        narrow_margin(policy, s, model, full);
        if (s->stage != DRIVE_POLICY_STAGE_HOLD) {
            return;
        }
    }
    /* fully on is what it read when it had transformed, whatever the declared resistances say */
    bool coarse = s->granted_ma < 2u * policy->parameters.probe_current_ma; /* or still settling */
    int16_t least =
        full ? (int16_t)(s->full_permille - (coarse ? COARSE_BAND_PERMILLE : FULL_BAND_PERMILLE))
             : (int16_t)(level - LEVEL_BAND_PERMILLE -
                         (s->reference < REFERENCE_WINDOWS ? LEVEL_BAND_PERMILLE : 0));
    if (phase >= least) {
        s->plateau = 0;
    } else if (fresh && ++s->plateau >= LOW_WINDOWS) { /* one alone may be a coarse reading */
        if (full && phase < least - LOSS_IMPOSSIBLE) {
            let_go(policy, s, model, true); /* no hold loses so much between two looks */
        } else {
            enter(policy, k, DRIVE_POLICY_STAGE_HEAT);
        }
        return;
    }
    if (!full && phase > level + LEVEL_BAND_PERMILLE) {
        enter(policy, k, DRIVE_POLICY_STAGE_LOWER);
        return;
    }
    int16_t target_c7 = (int16_t)(thermal_model_transformation(model, k).martensite_start_c7 +
                                  (coasts ? coasting_c7 : s->margin_c7));
    uint16_t wanted_ma =
        hold_current_ma(policy, s, model, k, target_c7, is_pausing(s) ? SUSPICION_64UW : 0);
    wanted_ma = (uint16_t)(wanted_ma + (policy->parameters.dither_ma >> 1));
    if (wanted_ma < policy->parameters.probe_current_ma) {
        wanted_ma = policy->parameters.probe_current_ma;
    }
    s->wanted_ma = wanted_ma;
}

static void lower(drive_policy_t *policy, drive_policy_spring_t *s, thermal_model_t *model,
                  uint8_t k, int16_t level, bool fresh)
{
    int16_t phase = best_phase(policy, s, model, k);
    if (fresh && trusted(policy, s)) {
        correct_cooling(policy, model, k, phase, PHASE_DEADBAND);
    }
    if (phase <= level) {
        enter(policy, k,
              phase < level - LEVEL_BAND_PERMILLE ? DRIVE_POLICY_STAGE_HEAT
                                                  : DRIVE_POLICY_STAGE_HOLD);
    }
}

/* Undriven: how near austenite start it is going to come, 255 at the limit. */
static uint8_t off(const drive_policy_t *policy, drive_policy_spring_t *s, thermal_model_t *model,
                   uint8_t k, bool fresh)
{
    int16_t now_c7 = thermal_model_temperature_c7(model, k);
    int16_t from_c7 = (int16_t)(policy->undriven_c7 - UNDRIVEN_BAND_C7);
    if (fresh && trusted(policy, s)) { /* a probing pulse */
        correct_cooling(policy, model, k, s->observer.phase_permille, PHASE_PROBED);
    }
    if (now_c7 < from_c7) {
        s->flags &= (uint8_t)~FLAG_RELEASED;
        if (model_permille(model, k) == 0) {
            s->flags &= (uint8_t)~FLAG_LET_GO;
        }
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
        resistance_observer_disturb(&s->observer);
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
            if (now_c7 > warmest_c7 &&
                now_c7 < thermal_model_transformation(model, k).austenite_start_c7 - GOES_ON_C7) {
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
static void ask(drive_policy_t *policy, const drive_policy_input_t *input, drive_policy_spring_t *s)
{
    uint16_t asked_ma = s->wanted_ma;
    uint8_t limits = DRIVE_POLICY_LIMIT_NONE;
    if (policy->parameters.policy != DRIVE_POLICY_OPEN) {
        if (s->ceiling_ma < asked_ma) {
            asked_ma = s->ceiling_ma;
            limits = s->derating;
        }
        if (s->fresh >= FRESH_WINDOWS && !trusted(policy, s)) {
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
               thermal_model_temperature_c7(model, k) >
                   thermal_model_transformation(model, k).martensite_start_c7 + KELVIN_C7;
    }
    return permille >= level - LEVEL_BAND_PERMILLE;
}

static void precompensate(drive_policy_t *policy, const drive_policy_input_t *input,
                          drive_policy_spring_t *s, uint8_t k, bool fresh)
{
    thermal_model_t *model = input->model;
    int16_t level = (int16_t)input->level_permille[k];
    switch ((drive_policy_stage_t)s->stage) {
    case DRIVE_POLICY_STAGE_OFF:
        enter(policy, k,
              is_there(model, k, level) ? DRIVE_POLICY_STAGE_HOLD : DRIVE_POLICY_STAGE_HEAT);
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
}

static void update(drive_policy_t *policy, const drive_policy_input_t *input,
                   drive_policy_spring_t *s, uint8_t k)
{
    bool open = policy->parameters.policy == DRIVE_POLICY_OPEN;
    bool driven = input->level_permille[k] != 0 && input->allowed[k];
    if (policy->prepared) {
        thermal_model_t *model = input->model;
        bool fresh =
            resistance_observer_update(&s->observer, &policy->alloy, s->fresh >= FRESH_WINDOWS);
        if (fresh || s->target_ma == 0) {
            s->flags &= (uint8_t)~FLAG_FALSE;
        }
        if (fresh) {
            s->fresh = s->fresh < UINT8_MAX ? (uint8_t)(s->fresh + 1u) : (uint8_t)(UINT8_MAX - 7u);
            if (s->fresh >= FRESH_WINDOWS && policy->alloy.phase_gain != 0 &&
                s->observer.phase_permille <
                    (s->observer.noisy ? PHASE_FALSE_NOISY : PHASE_FALSE)) {
                s->flags |= FLAG_FALSE;
            }
        } else if (s->target_ma == 0) {
            s->fresh = 0;
        }
        uint8_t severity = 0;
        if (!driven) {
            supply_queue_remove(&policy->queue, k);
            severity = off(policy, s, model, k, fresh);
        } else if (!open) {
            precompensate(policy, input, s, k, fresh);
        }
        policy->severe = (uint8_t)(policy->severe + (severity != 0) - (s->severity != 0));
        s->severity = severity;
        derate(policy, s, model, k, driven);
        s->last_c7 = thermal_model_temperature_c7(model, k);
        s->bias_now_uw = bias_at(model, s->bias_uw_per_k, s->last_c7);
    }
    if (driven && (s->flags & FLAG_TRIPPED) == 0) {
        if (open) {
            s->wanted_ma = share_ma(policy->parameters.open_current_ma, input->level_permille[k]);
        }
        ask(policy, input, s);
    }
}

static void watch_levels(drive_policy_t *policy, const uint16_t *level_permille)
{
    for (uint8_t k = 0; k < policy->springs; k++) {
        if (policy->spring[k].level_permille != level_permille[k]) {
            policy->spring[k].level_permille = level_permille[k];
            policy->stale = true;
        }
    }
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
            resistance_observer_take(&s->observer, *current_ma, *voltage_mv);
        }
    }
}

/* Undriven springs one after the other, in what the budget leaves. */
static void probe(drive_policy_t *policy, const drive_policy_input_t *input, uint16_t target_ma[])
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
    bool rests = ++policy->tick == TICKS_PER_REST;
    if (rests) {
        policy->tick = 0;
    }
    bool limits_changed = policy->supply_ma != input->supply_limit_ma ||
                          policy->maximum_ma != input->maximum_current_ma;
    if (limits_changed) {
        policy->supply_ma = input->supply_limit_ma;
        policy->maximum_ma = input->maximum_current_ma;
        policy->soft = 0; /* a lower limit holds at once */
    }
    if (!rests && policy->parameters.policy == DRIVE_POLICY_OPEN) {
        watch_levels(policy, input->level_permille);
    }
    if (limits_changed || (policy->stale && !rests)) {
        restart(policy, input); /* takes the time of all else */
    } else {
        bool in_time = !rests || policy->soft == 0;
        if (in_time && policy->prepared && input->valid != NULL) {
            listen(policy, input->valid, input->measured_ma, input->measured_mv);
        }
        if (!rests) {
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
    return trusted(policy, &policy->spring[spring]);
}

int16_t drive_policy_phase_permille(const drive_policy_t *policy, uint8_t spring)
{
    return policy->spring[spring].observer.phase_permille;
}

void drive_policy_clear(drive_policy_t *policy)
{
    for (uint8_t k = 0; k < policy->springs; k++) {
        policy->spring[k].flags &= (uint8_t)~FLAG_TRIPPED;
        policy->spring[k].limits &= (uint8_t)~DRIVE_POLICY_LIMIT_TRIP;
        policy->spring[k].derated_updates = 0;
    }
}
