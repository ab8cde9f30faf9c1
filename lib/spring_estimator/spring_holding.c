#include <math.h>

#include "spring_estimator_internal.h"

#define QUIET_K 0.08f /* a turn's: 0.3 K/s */
/* Of a turn, 60 s: what the line follows is no loss of phase. */
#define LINE_SHARE (1.0f / 240.0f)
/* Mean size of a second difference of averages, each of which still has a third of the one before
 * in it. */
#define SLOW_BEND_TO_SD  0.68f
#define SLOW_NOISE_SHARE ((float)SLOW_TURNS * LINE_SHARE) /* as the line follows */
/* Of its temperature, by steps of the surroundings in 60 s: 12 K, by a fifth of the loss, once in a
 * quarter of an hour. */
#define STEPS_K        3.0f
#define OTHER_WAY      2.0f /* times as much: an intermediate phase, where drifts go either way */
#define APART_PER_A    0.5f /* between two currents, as of 3 and 1.2 A */
#define OFFSET_LEAST_V 0.0005f /* what a turn's steps of 4 mV leave, and its noise */
/* Of an average: so little phase may be lost unseen, and it tells anew in 2 x 16 turns. */
#define LINE_VARIANCE (32.0f * LOSS_LEAST * LOSS_LEAST)

/* In a frame of its own: inlined, avr-gcc 5.4 tears a pointer (test/board_code). */
__attribute__((noinline)) static void see_crossing(spring_estimator_t *e, spring_belief_t *b,
                                                   thermal_model_t *model, uint8_t k, float lost,
                                                   float lost_sd)
{
    const spring_before_t before = spring_before(b, model, k);
    const bool searched = spring_estimator_sd_k(b) > 3.0f * CROSSING_SD_K;
    b->lost = fminf(b->lost + lost, 1.0f);
    const spring_place_t at = spring_place_of(model, k, b->lost, lost_sd);
    const bool opened = spring_open_to_step(e, b, k, at.c - spring_now_c(model, k), at.sd_k);
    const float error_k = spring_see(e, b, model, k, at.c, at.sd_k, SPRING_PHASE_AUSTENITE);
    b->gone_k -= error_k;
    b->gone_w_per_k += b->learnt.loss_w_per_k - before.loss_w_per_k;
    spring_note(e, model, k, SPRING_SIGHT_LOST, &before, at.c, at.sd_k);
    spring_note_did(e, k, opened ? SPRING_DID_OPEN : 0);
    if (!searched && -error_k > b->disturbance_k) {
        b->disturbance_k = -error_k;
    }
}

/* To have lost so much it would be colder than a load on top of all that was not known of it makes
 * it: rather it is the sensor that reads otherwise, or a contact that crept. */
static bool is_misread(const spring_belief_t *b, const thermal_model_t *model, uint8_t k,
                       float lost)
{
    const float colder_k = spring_now_c(model, k) - spring_lost_at_c(model, k, b->lost + lost);
    const float unsure_k = sqrtf(spring_distance_k2(b) + CROSSING_SD_K * CROSSING_SD_K);
    return colder_k > SHIFT_BOUND_K + SPRING_ESTIMATOR_LIKELY_SDS * unsure_k;
}

/* The current has dropped, the spring is what it was a moment ago: what reads otherwise is the
 * sensor's offset. Returns whether this turn told one. */
bool spring_learn_offset(spring_belief_t *b)
{
    if (b->offset_sd_v <= OFFSET_LEAST_V) {
        return false;
    }
    const float less_a = b->run.line.a - b->current_a;
    const float product_a2 = b->current_a * b->run.line.a;
    if (less_a < APART_PER_A * product_a2 || b->run.line.way_k < -ANCHOR_K) {
        /* as a rule: no division. Over a longer way a coefficient may have made as much */
        return false;
    }
    const float apart_a = product_a2 / less_a;
    const float moved_v = COEFFICIENT_MOST_PER_K * b->run.line.way_k * b->run.line.ohm * apart_a;
    const float noise_v = b->noise * b->ohm * apart_a;
    const float prior_v2 = b->offset_sd_v * b->offset_sd_v;
    const float least_v = fmaxf(OFFSET_LEAST_V, COARSE_V * (float)b->coarse);
    const float read_v2 = least_v * least_v + noise_v * noise_v + moved_v * moved_v;
    const float gain = prior_v2 / (prior_v2 + read_v2);
    const float more_v = gain * (b->ohm - b->run.line.ohm) * apart_a;
    if (fabsf(b->learnt.offset_v + more_v) > OFFSET_MOST_V) {
        return false; /* no offset is so large */
    }
    b->learnt.offset_v += more_v;
    b->offset_sd_v = sqrtf(gain * read_v2);
    const float more_ohm = more_v / b->run.line.a;
    b->run.line.ohm -= more_ohm;
    b->learnt.austenite_ohm -= b->learnt.austenite_ohm > 0.0f ? more_ohm : 0.0f;
    b->ohm -= more_v / b->current_a;
    spring_average_anew(b); /* what was read before is off by it */
    b->seen = true;         /* it is acted on in the next turn */
    return true;
}

/* It keeps its phase: how what it reads goes with a moving temperature is its slope. */
static void tell_slope(spring_line_t *line, float left)
{
    const float way_k = line->slow_k;
    const float prior = line->rise_sd_per_k * line->rise_sd_per_k;
    const float gain = prior * way_k / (prior * way_k * way_k + LINE_VARIANCE);
    line->rise_per_k = spring_clamp(line->rise_per_k + gain * left, -COEFFICIENT_MOST_PER_K,
                                    COEFFICIENT_MOST_PER_K);
    line->rise_sd_per_k = sqrtf(prior * (1.0f - gain * way_k));
}

/* What of its slope is more than its sd: one that was never seen moves nothing. */
static float sure_rise_per_k(const spring_line_t *line)
{
    const float unsure = line->rise_sd_per_k;
    return line->rise_per_k - spring_clamp(line->rise_per_k, -unsure, unsure);
}

/* Of what left its line, the part that an unseen step of the surroundings is likely to have made,
 * as far as its slope is known, K; the rest is a sensor or a contact that drifts. */
static float by_step_k(const spring_line_t *line, float left, float noise2)
{
    const float step = sure_rise_per_k(line) * STEPS_K;
    return step / (step * step + noise2) * STEPS_K * left;
}

/* It is hotter by so much, and gives off less. */
static void warm(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model, uint8_t k,
                 float hotter_k)
{
    spring_line_t *line = &b->run.line;
    spring_correct_loss(e, b, b->covariance / spring_distance_k2(b) * hotter_k);
    spring_set_temperature(model, k, spring_now_c(model, k) + hotter_k, SPRING_PHASE_AUSTENITE);
    b->last_c7 = thermal_model_temperature_c7(model, k);
    line->way_k += hotter_k;
    line->slow_k += hotter_k;
}

/* At rest the line follows what it reads, and its temperature: as far as its slope makes an unseen
 * step of the surroundings likelier than a sensor or a contact that drifts. It grows no surer. */
static void follow(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model, uint8_t k,
                   float left, float noise2)
{
    spring_line_t *line = &b->run.line;
    if (fabsf(line->slow_k) > CROSSING_SD_K && fabsf(left) < LOSS_LEAST) {
        tell_slope(line, left);
    }
    const float hotter_k = by_step_k(line, left, noise2);
    line->ohm += line->ohm * (left - sure_rise_per_k(line) * hotter_k) * LINE_SHARE;
    line->way_k -= line->slow_k * LINE_SHARE;
    line->slow_k -= line->slow_k * LINE_SHARE;
    line->variance -= 2.0f * line->variance * LINE_SHARE;
    if (line->turns != 0 && line->turns % SLOW_TURNS == 0) { /* a turn's is below a model's step */
        warm(e, b, model, k, hotter_k * SLOW_NOISE_SHARE);
    }
}

/* Of what the resistance has left its line by, the part that lost phase may explain; the other way
 * it is an intermediate phase's. */
static float as_lost(const spring_belief_t *b, float left)
{
    return spring_is_other_way(b, left) ? fabsf(left) * (1.0f / OTHER_WAY) : fabsf(left);
}

/* Noise that the average does not take away, as it is slower than a turn. Second differences, 4 s
 * apart: neither a phase nor a temperature that goes steadily shows in them. */
static void take_slow_noise(spring_belief_t *b)
{
    spring_line_t *line = &b->run.line;
    if (b->quiet == 0 || b->averaged < SLOW_TURNS) {
        line->turns = 0;
        line->was_ohm[0] = line->was_ohm[1] = 0.0f;
        return;
    }
    line->turns++;
    if (line->turns % SLOW_TURNS != 0) {
        return;
    }
    if (line->was_ohm[1] > 0.0f) {
        const float bend = fabsf(b->slow_ohm - 2.0f * line->was_ohm[0] + line->was_ohm[1]);
        const float seen = fminf(SLOW_BEND_TO_SD * bend / b->slow_ohm, SLOW_NOISE_MOST);
        b->learnt.slow_noise += (seen - b->learnt.slow_noise) * SLOW_NOISE_SHARE;
    }
    line->was_ohm[1] = line->was_ohm[0];
    line->was_ohm[0] = b->slow_ohm;
}

/* More than its austenite read when that was hot: it is hotter, or a contact has crept. */
static bool reads_hot(const spring_belief_t *b, const thermal_model_t *model, uint8_t k)
{
    const float ohm = b->slow_ohm;
    return b->learnt.change > 0.0f && b->learnt.austenite_ohm > 0.0f &&
           spring_beyond_austenite(b, model, k, ohm) > spring_read_tolerance(b);
}

/* What is certain to have left its line need be no lost phase: a hotter spring reads otherwise, or
 * a contact that has crept, and what goes the other way may be an intermediate phase's. While the
 * spring may be hot, or may have come to where it loses phase, it is put on trial: with less power
 * what is lost goes on, what was heat goes back, and a contact does neither until phase is lost.
 * Where it cannot have, and others read hotter (or colder) as well, it is.
 * Returns whether it was no sight of lost phase. */
static bool is_tried(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model, uint8_t k,
                     bool other_way, float share, float left, float noise2)
{
    const float start_c = spring_lost_at_c(model, k, 0.0f);
    const bool may_lose =
        spring_now_c(model, k) < start_c + SPRING_ESTIMATOR_LIKELY_SDS * spring_estimator_sd_k(b);
    const bool hot = !b->trial && reads_hot(b, model, k);
    if (spring_alloy_has_r_phase(e) || !(hot || other_way) || (b->trial && may_lose)) {
        return false;
    }
    b->trial = b->trial || hot || may_lose;
    const float hotter_k = by_step_k(&b->run.line, left, noise2);
    if (!b->trial && hotter_k != 0.0f && spring_steps_with_others(e, k, hotter_k > 0.0f)) {
        warm(e, b, model, k, hotter_k);
    }
    b->run.line.trial_ohm = b->slow_ohm;
    spring_begin_line(b, true, share);
    return true;
}

/* No austenite that is colder reads beyond what it read when it was hot: a contact has crept, and
 * all that was learnt beside it with it. */
static void take_crept(spring_belief_t *b, const thermal_model_t *model, uint8_t k)
{
    spring_learnt_t *l = &b->learnt;
    if (l->austenite_ohm > 0.0f) {
        const float beyond = spring_beyond_austenite(b, model, k, b->run.line.ohm);
        const float by = beyond * l->change > 0.0f ? 1.0f + beyond : 1.0f;
        l->austenite_ohm *= by;
        l->martensite_ohm *= by;
    }
}

/* Surely austenite: how what it reads has gone with its way is its alloy's. */
static void show_rise(spring_estimator_t *e, const spring_belief_t *b, const thermal_model_t *model,
                      uint8_t k, float noise2)
{
    const spring_line_t *line = &b->run.line;
    if (spring_estimator_distance_k(e, model, k).low > 0.0f) {
        const float per_k = 1.0f / line->slow_k;
        spring_alloy_shows_rise(e, (b->slow_ohm / line->ohm - 1.0f) * per_k,
                                noise2 * per_k * per_k);
    }
}

/* A phase that is kept changes the resistance no faster than temperature does. */
void spring_holding_watch(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model,
                          uint8_t k, float moved_k, float share)
{
    if (b->heating || b->possible != SPRING_PHASE_AUSTENITE) {
        b->quiet = 0;
        return;
    }
    b->quiet = fabsf(moved_k) > QUIET_K ? 0
               : b->quiet < UINT8_MAX   ? (uint8_t)(b->quiet + 1)
                                        : UINT8_MAX;
    take_slow_noise(b);
    spring_line_t *line = &b->run.line;
    line->way_k += moved_k;
    line->slow_k += (line->way_k - line->slow_k) * share;
    if (line->ohm == 0.0f) {
        if (b->quiet == 0) {
            spring_average_anew(b);
        }
        if (b->quiet < SPRING_ESTIMATOR_REST_TURNS) {
            b->losing = 0;
            return;
        }
        spring_begin_line(b, false, share);
    } else if (b->quiet == 0 && spring_learn_offset(b)) {
        return;
    }
    if (b->quiet < (b->rough ? SPRING_ESTIMATOR_REST_TURNS : 1) && b->current_a < WEAK_A) {
        /* on its way to the hold: too weak to tell */
        b->slow_ohm = line->ohm * (1.0f + line->rise_per_k * line->way_k);
        b->slow_a = line->a;
        line->slow_k = line->way_k;
        b->averaged = 0;
        b->losing = 0;
        return;
    }
    b->hot = reads_hot(b, model, k);
    const float left = spring_has_left(b);
    const float distance_k2 = spring_distance_k2(b);
    const float changed = as_lost(b, left);
    /* as its temperature may have moved unseen, so may the resistance */
    const float rise = line->rise_per_k;
    /* that something has changed is known by then */
    const float sds = b->trial ? SPRING_ESTIMATOR_BOUND_SDS : SURE_SDS;
    const spring_departure_t d =
        spring_departs(b, model, k, changed * changed, rise * rise * distance_k2, sds, share);
    const float noise2 = d.noise2;
    const float least = d.least;
    if (b->losing == 0) {
        const bool rests = b->quiet >= SPRING_ESTIMATOR_REST_TURNS;
        const bool away = b->averaged > ANCHOR_TURNS && fabsf(line->slow_k) > ANCHOR_K;
        if (b->rough && (rests || b->averaged == ANCHOR_TURNS || away)) {
            if (away) {
                show_rise(e, b, model, k, noise2);
            }
            spring_begin_line(b, !rests, share); /* a coefficient explains only the way since */
        }
        if (rests) {
            follow(e, b, model, k, left, fmaxf(noise2, least * least));
        }
        if (b->trial && spring_is_other_way(b, left) && changed > least) {
            spring_begin_line(b, true, share); /* what creeps hides no loss from here */
        }
        if ((rests && b->current_a >= WEAK_A) || b->trial) { /* its average is of where it was */
            const float moved_since_k = fminf(line->way_k - line->slow_k, 0.0f);
            const float unseen = spring_unseen(&d) / fabsf(b->learnt.change);
            spring_keep_above(e, b, model, k,
                              spring_lost_at_c(model, k, b->lost + unseen) + moved_since_k);
        }
        return;
    }
    if (d.sure) {
        const bool other_way = spring_is_other_way(b, left);
        if (is_tried(e, b, model, k, other_way, share, left, noise2)) {
            return;
        }
        spring_alloy_sees(e, other_way);
        if (!other_way) {
            take_crept(b, model, k);
        }
        const float per_change = 1.0f / fabsf(b->learnt.change);
        const float sd = d.unsure;
        if (is_misread(b, model, k, changed * per_change)) {
            spring_misread(e, model, k, left, sqrtf(noise2 + sd * sd));
            b->losing = 0;
            return;
        }
        see_crossing(e, b, model, k, changed * per_change, sd * per_change);
        spring_note_read(e, k, left, sqrtf(noise2 + sd * sd));
        b->trial = false;
        spring_begin_line(b, true, share); /* the average still falls */
    }
}
