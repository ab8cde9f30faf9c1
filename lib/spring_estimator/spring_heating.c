#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "spring_estimator_internal.h"

#define STRONG_A        0.8f
#define STEP_LEAST_K    3.0f  /* of heat between two comparisons */
#define STEP_MOST_K     15.0f
#define STEP_PER_NOISE  1600.0f /* so that a slope's noise is half of COEFFICIENT_MOST_PER_K */
#define EXCESS_SEEN     0.01f /* and four standard deviations */
#define CHANGE_LEAST    0.03f /* of a whole transformation, else it is none */
#define CHANGE_PART     0.15f /* of a transformation: less to come may not show */
#define FLAT_K          6.0f  /* of heat without any: it is over */
#define ONSET_K         2.0f  /* beyond austenite start it is noticed */
#define PLACE_SD_K      3.0f
#define COLD_SPAN_K     20.0f /* least, over which a coefficient is learnt */

void spring_estimator_begin_heating(spring_belief_t *b)
{
    b->heat_k = b->mark_k = b->flat_k = b->excess = 0.0f;
    b->mark_ohm = b->onset_ohm = b->cold_ohm = b->line_ohm = 0.0f;
    b->onset = b->steep = false;
    if (b->possible == SPRING_PHASE_AUSTENITE && b->lost < CHANGE_PART) {
        b->possible = SPRING_PHASE_BETWEEN | SPRING_PHASE_AUSTENITE;
    } else if (b->possible == SPRING_PHASE_AUSTENITE) {
        b->possible = SPRING_PHASE_BETWEEN;
    }
}

static void see_onset(const spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model,
                      uint8_t k)
{
    const float now_c = spring_now_c(model, k);
    b->onset = true;
    if (getenv("DBG")) fprintf(stderr,"onset k%d now %.2f sd %.2f noise %.5f excess %.4f step\n",k,now_c,sqrtf(b->variance_k2),b->noise,b->excess);
    if (b->possible == SPRING_PHASE_MARTENSITE) {
        if (now_c > b->cold_c + COLD_SPAN_K) {
            b->learnt.martensite_rise_per_k =
                (b->onset_ohm / b->cold_ohm - 1.0f) / (now_c - b->cold_c);
            b->learnt.martensite_ohm =
                b->cold_ohm / (1.0f + b->learnt.martensite_rise_per_k * (b->cold_c - 20.0f));
        }
        (void)spring_see(e, b, model, k, e->austenite_start_c + ONSET_K, PLACE_SD_K,
                         SPRING_PHASE_MARTENSITE);
    }
    b->possible = SPRING_PHASE_BETWEEN;
}

static void see_finish(const spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model,
                       uint8_t k)
{
    const float change = 1.0f - b->onset_ohm / b->ohm;
    if (getenv("DBG")) fprintf(stderr,"finish k%d now %.2f sd %.2f noise %.5f change %.4f flat %.1f\n",k,spring_now_c(model,k),sqrtf(b->variance_k2),b->noise,change,b->flat_k);
    /* a heating from half way changes less */
    if (b->cold_ohm > 0.0f || fabsf(change) > fabsf(b->learnt.change)) {
        b->learnt.change = change;
    }
    b->learnt.austenite_ohm = b->ohm;
    b->possible = SPRING_PHASE_AUSTENITE;
    b->lost = 0.0f;
    b->crossings = 0;
    (void)spring_see(e, b, model, k, e->austenite_finish_c + b->flat_k, PLACE_SD_K,
                     SPRING_PHASE_AUSTENITE);
}

/* Change of resistance over heat, a step at a time: more than any temperature coefficient makes is
 * a transformation, whatever its sign. */
void spring_heating_watch(const spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model,
                          uint8_t k)
{
    if (b->current_a < STRONG_A || b->possible == SPRING_PHASE_AUSTENITE || b->settling != 0) {
        b->mark_ohm = 0.0f;
        return;
    }
    if (b->cold_ohm == 0.0f && b->possible == SPRING_PHASE_MARTENSITE) {
        b->cold_ohm = b->ohm;
        b->cold_c = spring_now_c(model, k);
    }
    if (b->mark_ohm == 0.0f || b->heat_k < b->mark_k) {
        b->mark_ohm = b->ohm;
        b->mark_k = b->heat_k;
        return;
    }
    const float step_k = b->heat_k - b->mark_k;
    const float least_k = fminf(fmaxf(STEP_LEAST_K, STEP_PER_NOISE * b->noise), STEP_MOST_K);
    if (step_k < least_k) {
        return;
    }
    const float change = b->ohm / b->mark_ohm - 1.0f;
    const float explained = COEFFICIENT_MOST_PER_K * step_k;
    const float excess = change > explained    ? change - explained
                         : change < -explained ? change + explained
                                               : 0.0f;
    if (excess * b->excess < 0.0f && !b->onset) {
        b->excess = 0.0f;
    }
    if (excess != 0.0f) {
        if (b->excess == 0.0f) {
            b->onset_ohm = b->mark_ohm;
        }
        b->excess += excess;
        b->flat_k = 0.0f;
        b->steep = fabsf(excess) > 2.0f * b->noise;
        if (!b->onset && fabsf(b->excess) > EXCESS_SEEN + 4.0f * b->noise) {
            see_onset(e, b, model, k);
        }
    } else if (b->onset) {
        b->flat_k += step_k;
        b->steep = false;
        if (b->flat_k >= FLAT_K && fabsf(b->ohm / b->onset_ohm - 1.0f) > CHANGE_LEAST) {
            see_finish(e, b, model, k);
        }
    } else {
        b->excess = 0.0f;
    }
    b->mark_ohm = b->ohm;
    b->mark_k = b->heat_k;
}
