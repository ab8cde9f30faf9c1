#include <math.h>

#include "spring_estimator_internal.h"

#define LEARNT_OHM_LEAST 0.01f
#define LEARNT_OHM_MOST  16.0f
#define DRIVEN_ABOVE_K   60.0f
#define SLOW_NOISE_FIRST 0.0007f /* 0.2 mV of 0.3 V, a twentieth of a step */

/* Above ambient; of a spring that is cooler, as far as one is that is driven: there its loss
 * counts, and is a quotient of two that are not small. */
static float driven_above_k(const thermal_model_t *model, uint8_t k)
{
    return fmaxf(spring_above_ambient_k(model, k), DRIVEN_ABOVE_K);
}

void spring_estimator_forget_loss(spring_estimator_t *e, uint8_t k)
{
    if (!spring_is_sound(e, k)) {
        return; /* its turn finds it so */
    }
    spring_belief_t *b = &e->spring[k];
    const float sd = LOSS_SD * e->loss_w_per_k;
    b->learnt.loss_w_per_k = 0.0f;
    b->learnt.loss_sd_w_per_k = sd;
    b->loss_variance = sd * sd;
    b->covariance = 0.0f;
    b->gone_w_per_k = b->kept_w_per_k = 0.0f;
    spring_seal(e, k);
}

float spring_estimator_declared_w(const thermal_model_t *model, uint8_t k)
{
    const float ambient_c = spring_ambient_c(model);
    return spring_declared_w(model, k, ambient_c + driven_above_k(model, k));
}

void spring_estimator_keep_loss(spring_estimator_t *e, const thermal_model_t *model, uint8_t k,
                                float before_w)
{
    if (!spring_is_sound(e, k)) {
        return; /* its turn finds it so */
    }
    spring_belief_t *b = &e->spring[k];
    const float sd = LOSS_SD * e->loss_w_per_k;
    const float declared_sd = LOSS_SD * 1e-6f * (float)model->parameters.loss_uw_per_k;
    /* of what is known of it, the share that was seen: the rest was the declaration of before */
    const float seen = 1.0f - b->loss_variance / (sd * sd);
    if (seen > 0.0f) {
        const float less_w_per_k =
            (before_w - spring_estimator_declared_w(model, k)) / driven_above_k(model, k);
        const float variance = declared_sd * declared_sd;
        const float gain = variance / (seen * variance + b->loss_variance);
        b->learnt.loss_w_per_k = gain * (b->learnt.loss_w_per_k + seen * less_w_per_k);
        b->loss_variance *= gain;
        b->covariance *= fminf(gain, 1.0f);
    } else {
        b->loss_variance = fmaxf(b->loss_variance, declared_sd * declared_sd);
    }
    b->learnt.loss_sd_w_per_k = fminf(sqrtf(b->loss_variance), declared_sd);
    b->extra_loss_uw = (int32_t)(1e6f * b->learnt.loss_w_per_k * spring_above_ambient_k(model, k));
    spring_seal(e, k);
}

void spring_estimator_forget(spring_estimator_t *e, uint8_t k)
{
    if (spring_is_sound(e, k)) {
        e->spring[k].learnt =
            (spring_learnt_t){.change = e->change, .slow_noise = SLOW_NOISE_FIRST};
        spring_seal(e, k);
        spring_estimator_forget_loss(e, k);
    }
}

void spring_estimator_restore(spring_estimator_t *e, uint8_t k, const spring_learnt_t *l)
{
    /* written so that a NaN is left out, too */
    const bool possible =
        l->austenite_ohm > LEARNT_OHM_LEAST && l->austenite_ohm < LEARNT_OHM_MOST &&
        fabsf(l->change) < 1.0f && l->change != 0.0f &&
        fabsf(l->loss_w_per_k) <= LOSS_MOST * e->loss_w_per_k && l->loss_sd_w_per_k >= 0.0f &&
        l->loss_sd_w_per_k <= LOSS_SD * e->loss_w_per_k &&
        fabsf(l->martensite_rise_per_k) <= COEFFICIENT_MOST_PER_HEAT_K &&
        fabsf(l->offset_v) <= OFFSET_MOST_V && l->slow_noise >= 0.0f &&
        l->slow_noise <= SLOW_NOISE_MOST;
    if (possible && spring_is_sound(e, k)) {
        e->spring[k].learnt = *l;
        e->spring[k].loss_variance = l->loss_sd_w_per_k * l->loss_sd_w_per_k;
        spring_seal(e, k);
    }
}

spring_learnt_t spring_estimator_learnt(const spring_estimator_t *e, uint8_t k)
{
    spring_learnt_t learnt = e->spring[k].learnt;
    const float sd = sqrtf(e->spring[k].loss_variance);
    learnt.loss_sd_w_per_k = sd < LOSS_SD * e->loss_w_per_k ? sd : LOSS_SD * e->loss_w_per_k;
    return learnt;
}

float spring_loss_ever(const spring_estimator_t *e, float loss_w_per_k)
{
    const float most_w_per_k = LOSS_MOST * e->loss_w_per_k;
    return spring_clamp(loss_w_per_k, -most_w_per_k, most_w_per_k);
}

spring_learnt_t spring_estimator_to_keep(const spring_estimator_t *e, uint8_t k)
{
    spring_learnt_t learnt = spring_estimator_learnt(e, k);
    learnt.loss_w_per_k = spring_loss_ever(e, learnt.loss_w_per_k);
    return learnt;
}
