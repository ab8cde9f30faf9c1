#include <math.h>

#include "spring_estimator_internal.h"

#define STEP_LASTS    0.8f  /* how much of such an error a step that lasts makes: a correlation */
#define STEP_LATELY_S 60.0f /* a spring's time constant, C / G = 52 s */

bool spring_open_to_step(spring_estimator_t *e, spring_belief_t *b, uint8_t k, float error_k,
                         float sd_k)
{
    const float known_k2 = spring_distance_k2(b) + sd_k * sd_k;
    if (error_k >= 0.0f ||
        error_k * error_k < SPRING_ESTIMATOR_LIKELY_SDS * SPRING_ESTIMATOR_LIKELY_SDS * known_k2) {
        return false;
    }
    const bool opens = e->stepped_turns > 0 && e->stepped_spring != k;
    if (opens) {
        const float step_w_per_k = LOSS_TOLERANCE * e->loss_w_per_k;
        spring_belief_t *other = &e->spring[e->stepped_spring];
        if (spring_is_sound(e, e->stepped_spring)) { /* else its turn finds it so */
            other->loss_variance = fmaxf(other->loss_variance, step_w_per_k * step_w_per_k);
            spring_seal(e, e->stepped_spring);
        }
        b->variance_k2 += error_k * error_k;
        b->covariance += STEP_LASTS * error_k * step_w_per_k;
        b->loss_variance += step_w_per_k * step_w_per_k;
    }
    e->stepped_turns = (uint16_t)((STEP_LATELY_S / SPRING_ESTIMATOR_TURN_S) * (float)e->springs);
    e->stepped_spring = k;
    return opens;
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
