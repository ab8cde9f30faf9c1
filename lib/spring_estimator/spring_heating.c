#include <math.h>

#include "spring_estimator_internal.h"

#define STEP_LEAST_K   2.0f    /* of heat between two comparisons */
#define STEP_PER_NOISE 1600.0f /* so that a slope's noise is half of the largest coefficient */
#define EXCESS_SEEN    0.01f   /* a change that no coefficient explains, and that is no noise */
#define EXCESS_SDS     4.0f
/* A martensite's own may go on so much steeper: a quarter of the largest, as losses make a kelvin
 * of heat less on the way up. Over 10 K four of a turn's noise, 0.1 %, are as much. */
#define RISE_MORE_PER_K 0.0004f
#define RISE_LEAST_K    10.0f
#define FLAT_K          4.0f /* of heat without a change: it is over */
/* The last of a cosine is flatter than the largest coefficient, the longer the less it changes:
 * 2 (0.0015 / 0.85) H^2 / pi^2, H = 47 K of heat from its start to its finish. */
#define FLAT_CHANGE_K  0.8f
#define ONSET_K        2.0f  /* beyond austenite start it is noticed */
#define CAPACITY_BOUND 1.25f /* 2.6 standard deviations of a heat capacity more */
/* Of a declared martensite's resistance: 15 %, a sensor's gain of 3 %, a contact of 30 mohm, a
 * coefficient in print over 68 K: 0.81 to 1.53. */
#define UNLIKE_LEAST 0.75f
#define UNLIKE_MOST  1.6f
/* Of its own martensite's: more than a coefficient that is off by half of the largest one makes of
 * 68 K. */
#define ANOTHER_CIRCUIT 0.05f

void spring_estimator_begin_heating(spring_estimator_t *e, const thermal_model_t *model, uint8_t k)
{
    spring_belief_t *b = &e->spring[k];
    b->from_full = b->possible == SPRING_PHASE_AUSTENITE;
    if (b->from_full) {
        b->possible = SPRING_PHASE_BETWEEN | SPRING_PHASE_AUSTENITE;
    }
    b->run.heat = (spring_heat_t){
        .begun_c = spring_now_c(model, k) - SPRING_ESTIMATOR_BOUND_SDS * spring_estimator_sd_k(b),
        .was_ohm = b->learnt.austenite_ohm,
    };
    b->onset = b->steep = b->unlike = false;
    b->changes = true; /* until a step of heat shows that it rests */
    if (b->possible == SPRING_PHASE_MARTENSITE) {
        spring_begin_shared_heating(e, b, model, k);
    }
    b->heating = true;
    b->left = false;
    spring_note_did(e, k, SPRING_DID_HEAT);
    spring_seal(e, k);
    spring_seal_shared(e);
}

/* Where it is when its onset is seen: what a small change shows late has taken up heat by then. */
static float onset_c(const spring_estimator_t *e, const spring_belief_t *b, float start_c)
{
    const float taken_k = b->run.heat.heat_k - b->run.heat.onset_k;
    return start_c + fmaxf(e->transforms_k_per_k * taken_k, ONSET_K);
}

static void see_onset(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model, uint8_t k,
                      float start_c)
{
    const spring_before_t before = spring_before(b, model, k);
    const float now_c = spring_now_c(model, k);
    b->onset = true;
    if (b->unsteady == 0) {                 /* else it may be the contact again */
        b->gone_k = b->gone_w_per_k = 0.0f; /* what it had lost was phase: it comes back */
    }
    if (b->possible == SPRING_PHASE_MARTENSITE) {
        spring_learnt_t *l = &b->learnt;
        const bool as_declared =
            l->austenite_ohm > 0.0f || (b->run.heat.excess > 0.0f) == (l->change > 0.0f);
        if (b->run.heat.cold_ohm > 0.0f && now_c > b->run.heat.cold_c && as_declared) {
            const float ohm_per_k =
                (b->run.heat.onset_ohm - b->run.heat.cold_ohm) / (now_c - b->run.heat.cold_c);
            const float martensite_ohm =
                b->run.heat.cold_ohm - ohm_per_k * (b->run.heat.cold_c - LEARNT_AT_C);
            const float rise_per_k = ohm_per_k / martensite_ohm;
            if (rise_per_k > COEFFICIENT_LEAST_PER_K && rise_per_k < COEFFICIENT_MOST_PER_HEAT_K) {
                l->martensite_rise_per_k = rise_per_k;
                l->martensite_ohm = martensite_ohm;
            } /* else a contact has moved */
        }
        const float seen_c = onset_c(e, b, start_c);
        spring_share_onset(e, b, model, k, seen_c);
        (void)spring_see(e, b, model, k, seen_c, SHIFT_SD_K, SPRING_PHASE_MARTENSITE);
        spring_note(e, model, k, SPRING_SIGHT_ONSET, &before, seen_c, SHIFT_SD_K);
    } else {
        spring_note(e, model, k, SPRING_SIGHT_ONSET, &before, 0.0f, 0.0f);
    }
    b->run.heat.onset_k = b->run.heat.heat_k;
    b->possible = SPRING_PHASE_BETWEEN;
}

void spring_learn_austenite(spring_belief_t *b)
{
    const float change = 1.0f - b->run.heat.onset_ohm / b->ohm;
    /* a heating from half way changes less */
    if (b->run.heat.cold_ohm > 0.0f || b->learnt.austenite_ohm == 0.0f) {
        b->learnt.change = change;
    }
    b->learnt.austenite_ohm = b->ohm;
}

static void see_finish(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model, uint8_t k,
                       float beyond_k)
{
    const spring_before_t before = spring_before(b, model, k);
    spring_learn_austenite(b);
    b->possible = SPRING_PHASE_AUSTENITE;
    b->blind = false;
    b->lost = 0.0f;
    const int16_t finish_c7 = thermal_model_transformation(model, k).austenite_finish_c7;
    const float seen_c = spring_c(finish_c7) + beyond_k;
    (void)spring_see(e, b, model, k, seen_c, SHIFT_SD_K, SPRING_PHASE_AUSTENITE);
    spring_note(e, model, k, SPRING_SIGHT_FINISH, &before, seen_c, SHIFT_SD_K);
}

/* Heat by which even the coldest and heaviest spring has come so far. */
static float most_heat_k(const spring_estimator_t *e, const spring_belief_t *b, int16_t limit_c7)
{
    /* what does not show takes no latent heat; what lacks phase does */
    const bool shows = b->onset || b->possible != SPRING_PHASE_MARTENSITE;
    const float latent_k = shows ? e->latent_k : 0.0f;
    /* where some austenite is left for certain, its transformation is where it was */
    const float shift_k = (b->possible & SPRING_PHASE_AUSTENITE) != 0 ? 0.0f : SHIFT_BOUND_K;
    return (spring_c(limit_c7) + shift_k - b->run.heat.begun_c + latent_k) * CAPACITY_BOUND;
}

/* A spring that still transforms, or is known to show it and has not yet, is not hotter than that
 * lets it be, whatever the model says, until it must have come so far. While it changes its heat
 * transforms it. Where it rests, and its level alone says that phase is missing, it loses more than
 * is believed; or the level is a contact's, and it may be as hot as it was. */
static void hold_back(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model, uint8_t k)
{
    const thermal_model_transformation_t t = thermal_model_transformation(model, k);
    const bool martensite = b->possible == SPRING_PHASE_MARTENSITE;
    const int16_t limit_c7 = martensite
                                 ? (int16_t)(t.austenite_start_c7 + (int16_t)(128.0f * ONSET_K))
                                 : t.austenite_finish_c7;
    if (thermal_model_temperature_c7(model, k) <= limit_c7) {
        return;
    }
    /* after a look, or at a level, its temperature is a guess; once its transformation was seen, it
     * is known, but for what the surroundings have done since */
    const bool guess = !b->from_full || b->shift_variance_k2 >= SHIFT_SD_K * SHIFT_SD_K;
    const bool transforms = b->from_full && b->onset;
    const bool waits = martensite || ((transforms ? b->run.heat.flat_k < FLAT_K : guess) &&
                                      spring_estimator_lacks_phase(b, model, k));
    const bool shows = b->steep || (b->learnt.austenite_ohm > 0.0f && !b->blind && waits);
    if (shows && b->run.heat.heat_k < most_heat_k(e, b, limit_c7)) {
        const spring_before_t before = spring_before(b, model, k);
        if (!martensite && !b->changes) {
            const float over_k = spring_now_c(model, k) - spring_c(limit_c7);
            b->gone_k += over_k;
            spring_correct_loss(e, b, -b->covariance / spring_distance_k2(b) * over_k);
        }
        spring_set_temperature(model, k, spring_c(limit_c7), SPRING_PHASE_MARTENSITE);
        spring_note_on(e, model, k, SPRING_SIGHT_TRANSFORMS, &before, spring_c(limit_c7), 0.0f);
    }
}

/* As hot as it may be it has come to its austenite start. */
static bool may_transform(const spring_belief_t *b, const thermal_model_t *model, uint8_t k,
                          float start_c)
{
    return b->possible != SPRING_PHASE_MARTENSITE ||
           spring_now_c(model, k) + SPRING_ESTIMATOR_BOUND_SDS * spring_estimator_sd_k(b) > start_c;
}

/* It changes no more, in more heat than the last of its change may hide in; and what it changed by
 * since its onset was no contact's step: it went on, as only a transformation does, and shows. From
 * a level it may only have to wait for its ends, and still reads that. */
static bool is_over(const spring_belief_t *b, const thermal_model_t *model, uint8_t k,
                    float unseen_k)
{
    const bool waits = !b->from_full && spring_estimator_lacks_phase(b, model, k);
    const bool grown = b->run.heat.cold_ohm == 0.0f || fabsf(b->run.heat.excess) > EXCESS_SEEN;
    return b->run.heat.flat_k >= FLAT_K + unseen_k && grown && !waits &&
           fabsf(b->ohm / b->run.heat.onset_ohm - 1.0f) > EXCESS_SEEN;
}

/* What no temperature coefficient makes of a change over step_k of heat: of a martensite its own,
 * where that was seen, else any in print. */
static float unexplained(const spring_belief_t *b, float change, float step_k)
{
    float most_per_k = COEFFICIENT_MOST_PER_HEAT_K;
    float least_per_k = COEFFICIENT_LEAST_PER_HEAT_K;
    if (b->possible == SPRING_PHASE_MARTENSITE && b->run.heat.rise_k > RISE_LEAST_K) {
        const float per_k = 1.0f / b->run.heat.rise_k;
        const float own_per_k = b->run.heat.rise * per_k;
        const float unsure_per_k = RISE_MORE_PER_K + EXCESS_SDS * b->noise * per_k;
        most_per_k = fminf(most_per_k, own_per_k + unsure_per_k);
        least_per_k = fmaxf(least_per_k, own_per_k - unsure_per_k);
    }
    const float more = change - most_per_k * step_k;
    const float less = change - least_per_k * step_k;
    return more > 0.0f ? more : less < 0.0f ? less : 0.0f;
}

/* What a contact that is declared leaves to the spring of what was read. */
static float behind_contact_ohm(const thermal_model_t *model, uint8_t k, float ohm)
{
    return ohm - 1e-6f * (float)model->parameters.contact_uohm[k];
}

bool spring_estimator_lacks_contact(const spring_estimator_t *e, const thermal_model_t *model,
                                    uint8_t k)
{
    const spring_belief_t *b = &e->spring[k];
    const bool holds = !b->heating && b->possible == SPRING_PHASE_AUSTENITE;
    const float ohm = b->heating ? b->run.heat.cold_ohm : holds ? b->learnt.austenite_ohm : 0.0f;
    /* as a rule none is declared: checksums of nine springs are a millisecond of a late tick */
    return model->parameters.contact_uohm[k] != 0 && spring_is_sound(e, k) && ohm > 0.0f &&
           behind_contact_ohm(model, k, ohm) < UNLIKE_LEAST * e->martensite_ohm;
}

/* It is martensite again, and reads what none of its own does: a contact has moved while it was
 * off, or what was read of it last was no spring's, as its sensor lied then. */
static void take_another_circuit(spring_estimator_t *e, spring_belief_t *b,
                                 const thermal_model_t *model, uint8_t k)
{
    const float own_ohm = spring_martensite_ohm(b, model, k);
    const float step_ohm = b->ohm - own_ohm;
    if (b->untested || own_ohm <= 0.0f || fabsf(step_ohm) <= ANOTHER_CIRCUIT * own_ohm) {
        return;
    }
    const spring_before_t before = spring_before(b, model, k);
    spring_jump(b, b->ohm / own_ohm);
    spring_note(e, model, k, SPRING_SIGHT_JUMPED, &before, 0.0f, 0.0f);
    spring_note_read(e, k, step_ohm / own_ohm, b->noise);
}

/* What its resistance says to be austenite already takes up no latent heat any more. */
static void take_phase(const spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model,
                       uint8_t k)
{
    const float phase = spring_estimator_phase(e, model, k);
    if ((uint16_t)(phase * (float)THERMAL_MODEL_AUSTENITE_FULL) <=
        thermal_model_austenite(model, k)) {
        return;
    }
    const int16_t now_c7 = thermal_model_temperature_c7(model, k);
    const thermal_model_transformation_t t = thermal_model_transformation(model, k);
    const float width_c7 = (float)(t.austenite_finish_c7 - t.austenite_start_c7);
    const float reached_c = spring_c((int16_t)(t.austenite_start_c7 + (int16_t)(phase * width_c7)));
    spring_set_temperature(model, k, reached_c, SPRING_PHASE_MARTENSITE);
    thermal_model_set_temperature(model, k, now_c7);
    b->seen = true; /* it is acted on in the next turn */
}

static void begin_step(spring_belief_t *b, float mark_ohm)
{
    b->run.heat.mark_ohm = mark_ohm;
    b->run.heat.mark_k = b->run.heat.heat_k;
    b->run.heat.sum_ohm = 0.0f;
    b->run.heat.turns = 0;
}

/* Change of resistance over heat, a step at a time: more than any temperature coefficient makes is
 * a transformation, whatever its sign. */
void spring_heating_watch(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model,
                          uint8_t k)
{
    if (!b->heating) {
        return;
    }
    spring_heat_as_others(e, b, model, k);
    hold_back(e, b, model, k);
    if (b->current_a < STRONG_A || b->possible == SPRING_PHASE_AUSTENITE ||
        b->possible == SPRING_PHASE_ANY || b->settling != 0) {
        b->run.heat.mark_ohm = 0.0f;
        return;
    }
    if (b->possible == SPRING_PHASE_MARTENSITE && b->run.heat.cold_ohm == 0.0f) {
        take_another_circuit(e, b, model, k);
        b->run.heat.cold_ohm = b->ohm;
        b->run.heat.cold_c = spring_now_c(model, k);
        const float own_ohm = behind_contact_ohm(model, k, b->ohm);
        b->unlike =
            own_ohm < UNLIKE_LEAST * e->martensite_ohm || own_ohm > UNLIKE_MOST * e->martensite_ohm;
    }
    if (b->run.heat.heat_k < b->run.heat.peak_k) {
        return; /* it had to wait: on the way back up nothing transforms, and that tells nothing */
    }
    b->run.heat.peak_k = b->run.heat.heat_k;
    if (b->run.heat.mark_ohm == 0.0f) {
        take_phase(e, b, model, k);
        begin_step(b, b->ohm);
        b->single = true;
        /* it changed until nothing was compared: that it rests in this heat nobody has seen */
        b->run.heat.flat_k = b->changes ? 0.0f : b->run.heat.flat_k;
        return;
    }
    b->run.heat.turns++;
    b->run.heat.sum_ohm += b->ohm;
    const float step_k = b->run.heat.heat_k - b->run.heat.mark_k;
    const float turns = (float)b->run.heat.turns;
    /* the more turns it lasts, the less is noise in their mean */
    const float least_k = STEP_PER_NOISE * b->noise;
    if ((step_k < STEP_LEAST_K || step_k * step_k * turns < least_k * least_k) &&
        b->run.heat.turns < UINT8_MAX) {
        return;
    }
    const float ohm = b->run.heat.sum_ohm / turns;
    /* from mean to mean; from a single turn to the mean of those that followed it is less */
    const float apart_k = b->single ? 0.5f * step_k * (1.0f + 1.0f / turns) : step_k;
    b->single = false;
    const float change = ohm / b->run.heat.mark_ohm - 1.0f;
    const float start_c = spring_c(thermal_model_transformation(model, k).austenite_start_c7);
    const bool may_be_onset = may_transform(b, model, k, start_c);
    if (!may_be_onset) { /* all of it is its martensite's own */
        b->run.heat.rise += change;
        b->run.heat.rise_k += apart_k;
    }
    const float excess = unexplained(b, change, apart_k);
    /* a spring whose change is known changes that way */
    const bool against = b->learnt.austenite_ohm > 0.0f && excess * b->learnt.change < 0.0f;
    if (!b->onset && (against || excess * b->run.heat.excess <= 0.0f)) {
        b->run.heat.excess = 0.0f; /* none, or the other way: counted anew */
        b->run.heat.onset_ohm = b->run.heat.mark_ohm;
        b->run.heat.onset_k = b->run.heat.mark_k;
    }
    b->run.heat.excess += against ? 0.0f : excess;
    const float likely = SPRING_ESTIMATOR_LIKELY_SDS * b->noise;
    b->changes = excess * excess * turns > likely * likely;
    b->steep = b->onset && b->changes;
    if (b->steep || !b->onset) {
        b->run.heat.flat_k = 0.0f;
    }
    if (!b->onset && fabsf(b->run.heat.excess) > EXCESS_SEEN + EXCESS_SDS * b->noise) {
        if (may_be_onset) {
            see_onset(e, b, model, k, start_c);
            b->steep = true;
        } else {
            const spring_before_t before = spring_before(b, model, k);
            spring_jump(b, b->ohm / b->run.heat.onset_ohm); /* too cold: a contact */
            spring_note(e, model, k, SPRING_SIGHT_JUMPED, &before, 0.0f, 0.0f);
        }
        spring_note_read(e, k, b->run.heat.excess, b->noise);
        b->run.heat.excess = 0.0f; /* from here on: how it grows, or the next one */
    } else if (b->run.heat.flat_k >= FLAT_K) {
        const float change_seen = b->learnt.austenite_ohm > 0.0f || b->run.heat.cold_ohm == 0.0f
                                      ? b->learnt.change
                                      : b->ohm / b->run.heat.onset_ohm - 1.0f;
        const float unseen_k = spring_clamp(FLAT_CHANGE_K / (fabsf(change_seen) + 0.001f) - FLAT_K,
                                            0.0f, SHIFT_BOUND_K);
        if (is_over(b, model, k, unseen_k)) {
            see_finish(e, b, model, k, b->run.heat.flat_k - unseen_k);
            spring_note_read(e, k, change, b->noise);
        }
    }
    begin_step(b, ohm);
}
