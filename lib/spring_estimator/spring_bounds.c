#include <math.h>

#include "spring_estimator_internal.h"

spring_bounds_t spring_around(float value, float sd)
{
    const float most = SPRING_ESTIMATOR_BOUND_SDS * sd;
    return (spring_bounds_t){value, value - most, value + most};
}

float spring_estimator_sd_k(const spring_belief_t *b)
{
    return sqrtf(spring_distance_k2(b));
}

float spring_estimator_hold_sd_k(const spring_estimator_t *e, const thermal_model_t *model,
                                 uint8_t k)
{
    const spring_belief_t *b = &e->spring[k];
    const float above_k = spring_above_ambient_k(model, k);
    const float stiffness = spring_stiffness_w_per_k(b);
    const float settles_k2 =
        above_k * above_k * b->loss_variance / (stiffness * stiffness + 1e-12f);
    return sqrtf(fmaxf(spring_distance_k2(b), settles_k2));
}

/* What moved it lately, a gust for one, may do so again, either way. */
static spring_bounds_t disturbed(const spring_belief_t *b, spring_bounds_t bounds)
{
    return (spring_bounds_t){bounds.value, bounds.low - b->disturbance_k,
                             bounds.high + b->disturbance_k};
}

spring_bounds_t spring_estimator_temperature_c(const spring_estimator_t *e,
                                               const thermal_model_t *model, uint8_t k)
{
    const spring_belief_t *b = &e->spring[k];
    const float now_c = spring_now_c(model, k) + b->shift_k;
    float others_k2 = SHIFT_SD_K * SHIFT_SD_K; /* where it was seen, its transformation was */
    if (b->possible == SPRING_PHASE_ANY) {
        const float coldest_c = spring_ambient_c(model) - SPRING_ESTIMATOR_BOUND_SDS * TRUST_SD_K;
        return (spring_bounds_t){now_c, coldest_c, b->hottest_c};
    }
    if (b->possible == SPRING_PHASE_MARTENSITE) { /* as warm as room and neighbours make it */
        const float neighbours_k =
            SPRING_ESTIMATOR_NEIGHBOUR_SD * (now_c - spring_ambient_c(model));
        others_k2 = TRUST_SD_K * TRUST_SD_K + neighbours_k * neighbours_k;
    }
    const float told_k = SPRING_ESTIMATOR_BOUND_SDS * sqrtf(spring_distance_k2(b) + others_k2);
    float hotter_k = told_k;
    if (b->possible == SPRING_PHASE_AUSTENITE) { /* losses that fell show in nothing: it holds */
        const float warmer_k = LOSS_TOLERANCE * spring_above_ambient_k(model, k);
        hotter_k = sqrtf(told_k * told_k + warmer_k * warmer_k);
    }
    return disturbed(
        b, (spring_bounds_t){now_c, now_c - told_k, now_c + hotter_k + fmaxf(b->gone_k, 0.0f)});
}

spring_bounds_t spring_estimator_distance_k(const spring_estimator_t *e,
                                            const thermal_model_t *model, uint8_t k)
{
    const int16_t start_c7 = thermal_model_transformation(model, k).martensite_start_c7;
    const float away_k = spring_c((int16_t)(thermal_model_temperature_c7(model, k) - start_c7));
    const spring_belief_t *b = &e->spring[k];
    /* what has cooled is known by the room; where it transforms is no more known than it was */
    const float place_k2 = b->possible == SPRING_PHASE_MARTENSITE ? b->shift_variance_k2 : 0.0f;
    return disturbed(b, spring_around(away_k, sqrtf(spring_distance_k2(b) + place_k2)));
}
