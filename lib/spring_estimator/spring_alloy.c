#include <math.h>

#include "spring_estimator_internal.h"

/* Odds are natural logarithms. */
#define R_PHASE_ODDS      (-2.2f) /* one alloy in ten */
#define R_PHASE_OTHER_WAY 2.9f    /* three sights of four, and one of twenty-five without it */
#define R_PHASE_STRAIGHT  (-1.4f) /* the others */
#define R_PHASE_MOST_ODDS 6.0f    /* three sights to the contrary turn it */

#define COMMON_SHARE 0.5f /* of the variance of a first heating's error */

#define RISE_OWN_PER_K 0.00015f /* by how much springs of one alloy differ */

void spring_begin_alloy(spring_estimator_t *e)
{
    e->r_phase_odds = R_PHASE_ODDS;
    e->warms = 0.0f;
    /* any in print: martensite's does not tell it */
    e->rise_per_k = 0.5f * (COEFFICIENT_MOST_PER_K + COEFFICIENT_IN_PRINT_PER_K);
    e->rise_sd_per_k =
        0.5f * (COEFFICIENT_MOST_PER_K - COEFFICIENT_IN_PRINT_PER_K) / SPRING_ESTIMATOR_BOUND_SDS;
}

void spring_alloy_sees(spring_estimator_t *e, bool other_way)
{
    const float more = other_way ? R_PHASE_OTHER_WAY : R_PHASE_STRAIGHT;
    e->r_phase_odds = spring_clamp(e->r_phase_odds + more, -R_PHASE_MOST_ODDS, R_PHASE_MOST_ODDS);
}

void spring_alloy_shows_rise(spring_estimator_t *e, float rise_per_k, float variance)
{
    const float prior = e->rise_sd_per_k * e->rise_sd_per_k;
    const float gain = prior / (prior + variance + RISE_OWN_PER_K * RISE_OWN_PER_K);
    e->rise_per_k = spring_clamp(e->rise_per_k + gain * (rise_per_k - e->rise_per_k),
                                 -COEFFICIENT_MOST_PER_K, COEFFICIENT_MOST_PER_K);
    e->rise_sd_per_k = fmaxf(sqrtf(prior * (1.0f - gain)), RISE_OWN_PER_K);
}

float spring_alloy_rise_sd_per_k(const spring_estimator_t *e)
{
    return sqrtf(e->rise_sd_per_k * e->rise_sd_per_k + RISE_OWN_PER_K * RISE_OWN_PER_K);
}

bool spring_alloy_has_r_phase(const spring_estimator_t *e)
{
    return e->r_phase_odds >= 0.0f;
}

static bool is_first_heating(const spring_belief_t *b)
{
    return b->possible == SPRING_PHASE_MARTENSITE && b->learnt.austenite_ohm == 0.0f;
}

void spring_begin_shared_heating(const spring_estimator_t *e, spring_belief_t *b,
                                 const thermal_model_t *model, uint8_t k)
{
    b->shared_k = e->warms * spring_above_ambient_k(model, k);
}

void spring_heat_as_others(const spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model,
                           uint8_t k)
{
    if (!is_first_heating(b)) {
        return;
    }
    const float shared_k = e->warms * spring_above_ambient_k(model, k);
    const float more_k = shared_k - b->shared_k;
    if (fabsf(more_k) > LEAST_SD_K) {
        spring_set_temperature(model, k, spring_now_c(model, k) + more_k, SPRING_PHASE_MARTENSITE);
        b->last_c7 = thermal_model_temperature_c7(model, k);
        b->shared_k = shared_k;
        b->seen = true; /* it is acted on in the next turn */
    }
}

void spring_share_onset(spring_estimator_t *e, spring_belief_t *b, const thermal_model_t *model,
                        uint8_t k, float seen_c)
{
    if (!is_first_heating(b)) {
        return;
    }
    const float moved = b->shared_k / spring_distance_k2(b);
    b->shift_k -= b->shift_variance_k2 * moved;
    spring_correct_loss(e, b, b->covariance * moved);
    const float error_k = seen_c - spring_now_c(model, k);
    e->warms += COMMON_SHARE * error_k / (seen_c - spring_ambient_c(model));
}
