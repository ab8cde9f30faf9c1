#include <math.h>

#include "spring_estimator_internal.h"

#define STEP_LASTS    0.8f  /* how much of such an error a step that lasts makes: a correlation */
#define STEP_LATELY_S 60.0f /* a spring's time constant, C / G = 52 s */

bool spring_steps_with_others(spring_estimator_t *e, uint8_t k, bool hotter)
{
    const bool common =
        e->stepped_turns > 0 && e->stepped_spring != k && e->stepped_hotter == hotter;
    e->stepped_turns = (uint16_t)((STEP_LATELY_S / SPRING_ESTIMATOR_TURN_S) * (float)e->springs);
    e->stepped_spring = k;
    e->stepped_hotter = hotter;
    return common;
}

/* In a frame of its own: inlined, avr-gcc 5.4 tears a pointer (test/board_code). */
__attribute__((noinline)) bool spring_open_to_step(spring_estimator_t *e, spring_belief_t *b,
                                                   uint8_t k, float error_k, float sd_k)
{
    const float known_k2 = spring_distance_k2(b) + sd_k * sd_k;
    if (error_k >= 0.0f ||
        error_k * error_k < SPRING_ESTIMATOR_LIKELY_SDS * SPRING_ESTIMATOR_LIKELY_SDS * known_k2) {
        return false;
    }
    const uint8_t first = e->stepped_spring;
    const bool opens = spring_steps_with_others(e, k, false);
    if (opens) {
        const float step_w_per_k = LOSS_TOLERANCE * e->loss_w_per_k;
        spring_belief_t *other = &e->spring[first];
        if (spring_is_sound(e, first)) { /* else its turn finds it so */
            other->loss_variance = fmaxf(other->loss_variance, step_w_per_k * step_w_per_k);
            spring_seal(e, first);
        }
        b->variance_k2 += error_k * error_k;
        b->covariance += STEP_LASTS * error_k * step_w_per_k;
        b->loss_variance += step_w_per_k * step_w_per_k;
    }
    return opens;
}

static bool is_held_and_read(const spring_belief_t *b)
{
    return !b->heating && b->possible == SPRING_PHASE_AUSTENITE && spring_estimator_sees(b);
}

bool spring_keeps_alone(const spring_estimator_t *e, const spring_belief_t *b, uint8_t k)
{
    const float bound2 = SPRING_ESTIMATOR_BOUND_SDS * SPRING_ESTIMATOR_BOUND_SDS * b->loss_variance;
    if (b->kept_w_per_k * b->kept_w_per_k <= bound2) {
        return false; /* as a rule: the others need not be asked */
    }
    float sum_w_per_k = 0.0f;
    uint8_t others = 0;
    for (uint8_t i = 0; i < e->springs; i++) {
        const spring_belief_t *other = &e->spring[i];
        if (i != k && is_held_and_read(other)) {
            sum_w_per_k += other->kept_w_per_k;
            others++;
        }
    }
    const float common_w_per_k = others == 0 ? 0.0f : sum_w_per_k / (float)others;
    const float own_w_per_k = b->kept_w_per_k - common_w_per_k;
    return own_w_per_k * b->kept_w_per_k > 0.0f && own_w_per_k * own_w_per_k > bound2;
}

bool spring_estimator_losses(const spring_estimator_t *e, float *factor, float *sd)
{
    float weights = 0.0f, sum = 0.0f, squares = 0.0f;
    uint8_t held = 0;
    for (uint8_t k = 0; k < e->springs; k++) {
        const spring_belief_t *b = &e->spring[k];
        if (b->fresh == 0 || b->heating || b->possible != SPRING_PHASE_AUSTENITE ||
            !(b->loss_variance > 0.0f)) {
            continue;
        }
        const float weight = e->loss_w_per_k * e->loss_w_per_k / b->loss_variance;
        const float more = b->learnt.loss_w_per_k / e->loss_w_per_k;
        weights += weight;
        sum += weight * more;
        squares += weight * more * more;
        held++;
    }
    if (held < 2) {
        return false;
    }
    const float mean = sum / weights;
    const float scatter = fmaxf(squares / weights - mean * mean, 0.0f) / (float)(held - 1);
    *factor = 1.0f + mean;
    /* what is not known yet is not known of all alike: more springs make it no surer */
    *sd = sqrtf(fmaxf(scatter, (float)held / weights));
    return true;
}
