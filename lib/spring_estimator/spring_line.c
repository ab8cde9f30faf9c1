#include <math.h>

#include "spring_estimator_internal.h"

#define NOISE_IN_SLOW 0.18f /* of one turn's, with all turns in it: sqrt(share / (2 - share)) */
#define OFFSET_SDS    3.0f
#define SUSPECTED     0.6f  /* of what is sure: 3 of 5 */
#define LASTING_TURNS 60    /* 15 s of suspicion are as sure */
#define COSINE_BEGINS 0.64f /* 2 / pi: x where a cosine has sqrt(lost) = (pi / 2) x */

/* Where it is on its way down, having lost so much: the beginning of the cosine, (1 - cos pi x)
 * / 2. */
float spring_lost_at_c(const thermal_model_t *model, uint8_t k, float lost)
{
    const thermal_model_transformation_t t = thermal_model_transformation(model, k);
    const float width_k = spring_c((int16_t)(t.martensite_start_c7 - t.martensite_finish_c7));
    const float depth = lost > 0.0f ? COSINE_BEGINS * sqrtf(fminf(lost, 1.0f)) : 0.0f;
    return spring_c(t.martensite_start_c7) - width_k * depth;
}

spring_place_t spring_place_of(const thermal_model_t *model, uint8_t k, float lost, float lost_sd)
{
    const float seen_c = spring_lost_at_c(model, k, lost);
    const float unsure_k = seen_c - spring_lost_at_c(model, k, lost + lost_sd);
    return (spring_place_t){seen_c, sqrtf(CROSSING_SD_K * CROSSING_SD_K + unsure_k * unsure_k)};
}

/* Of its resistance, what its sensor's steps may make as long as they like. Where it may have come
 * to where it loses phase, that is likelier. */
static float coarse_share(const spring_belief_t *b, const thermal_model_t *model, uint8_t k)
{
    if (b->coarse == 0) {
        return 0.0f;
    }
    const float above_k = spring_now_c(model, k) - spring_lost_at_c(model, k, b->lost);
    return above_k < SPRING_ESTIMATOR_BOUND_SDS * spring_estimator_sd_k(b)
               ? 0.0f
               : COARSE_V * (float)b->coarse / (b->slow_ohm * b->slow_a);
}

void spring_average_anew(spring_belief_t *b)
{
    b->slow_ohm = b->ohm;
    b->slow_a = b->current_a;
    b->averaged = 1;
    b->run.line.slow_k = b->run.line.way_k;
}

float spring_slow_variance(const spring_belief_t *b, float share)
{
    const float averages = b->averaged < SLOW_TURNS ? share : NOISE_IN_SLOW * NOISE_IN_SLOW;
    return fmaxf(b->noise * b->noise * averages, b->learnt.slow_noise * b->learnt.slow_noise);
}

/* What it reads on average now is what it reads with the phase that it has. Rough: it still moves,
 * another one follows when it is at rest. */
void spring_begin_line(spring_belief_t *b, bool rough, float share)
{
    b->run.line.ohm = b->slow_ohm;
    b->run.line.a = b->slow_a;
    b->run.line.variance = spring_slow_variance(b, share);
    b->run.line.way_k -= b->run.line.slow_k;
    b->run.line.slow_k = 0.0f;
    b->rough = rough;
    b->losing = 0;
}

float spring_offset_may_show(const spring_belief_t *b, float ohm, float from_a, float to_a)
{
    return OFFSET_SDS * b->offset_sd_v * fabsf(from_a - to_a) / (from_a * to_a * ohm);
}

/* By how much, squared, the resistance may have left its line with the phase kept: its temperature
 * moves it, and another current shows another share of the sensor's offset. */
static float may_move_squared(const spring_belief_t *b)
{
    const float moves = SPRING_ESTIMATOR_BOUND_SDS * b->run.line.rise_sd_per_k * b->run.line.slow_k;
    const float offset = spring_offset_may_show(b, b->run.line.ohm, b->run.line.a, b->slow_a);
    return moves * moves + offset * offset;
}

void spring_begin_hold_line(const spring_estimator_t *e, spring_belief_t *b, bool now)
{
    b->trial = false;
    b->run.line = (spring_line_t){
        .rise_per_k = e->rise_per_k,
        .rise_sd_per_k = spring_alloy_rise_sd_per_k(e),
    };
    if (now) {
        spring_average_anew(b);
        spring_begin_line(b, true, 1.0f);
    }
}

bool spring_is_other_way(const spring_belief_t *b, float left)
{
    return left * b->learnt.change > 0.0f;
}

/* By how much its resistance has left its line; on trial, since that began, what does not go back.
 */
float spring_has_left(const spring_belief_t *b)
{
    if (b->trial && spring_is_other_way(b, b->slow_ohm - b->run.line.trial_ohm)) {
        return b->slow_ohm / b->run.line.trial_ohm - 1.0f;
    }
    const spring_line_t *line = &b->run.line;
    return b->slow_ohm / (line->ohm * (1.0f + line->rise_per_k * line->slow_k)) - 1.0f;
}

spring_departure_t spring_departs(spring_belief_t *b, const thermal_model_t *model, uint8_t k,
                                  float changed2, float least2, float sds, float share)
{
    spring_departure_t d = {.noise2 = spring_slow_variance(b, share) + b->run.line.variance,
                            .least = LOSS_LEAST};
    float sure2 = fmaxf(fmaxf(LOSS_LEAST * LOSS_LEAST, least2), sds * sds * d.noise2);
    float suspected2 = SUSPECTED * SUSPECTED * sure2;
    float moves2 = 0.0f;
    if (changed2 >= suspected2) { /* as a rule not: divisions are saved */
        const float coarse = coarse_share(b, model, k);
        moves2 = may_move_squared(b);
        d.least = fmaxf(d.least, coarse);
        sure2 = fmaxf(sure2, coarse * coarse) + moves2;
        suspected2 = fmaxf(suspected2, coarse * coarse) + moves2;
    }
    if (changed2 < suspected2) {
        b->losing = 0;
        return d;
    }
    b->losing = b->losing < UINT8_MAX ? (uint8_t)(b->losing + 1) : UINT8_MAX;
    d.sure = changed2 > sure2 || b->losing >= LASTING_TURNS;
    d.unsure = d.sure ? sqrtf(moves2) * (1.0f / SPRING_ESTIMATOR_BOUND_SDS) : 0.0f;
    return d;
}

float spring_unseen(const spring_departure_t *d)
{
    return fmaxf(d->least, SUSPECTED * SURE_SDS * sqrtf(d->noise2));
}
