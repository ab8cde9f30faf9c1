#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "spring_estimator_internal.h"

#define QUIET_K         0.08f /* a turn's: 0.3 K/s */
#define QUIET_TURNS     40    /* 10 s: the average has settled */
#define LINE_TURNS      240.0f /* the line follows within 60 s */
#define LOSS_LEAST      0.0012f /* of the resistance: what a sensor's steps leave in the average */
#define NOISE_IN_SLOW   0.18f /* of one turn's: sqrt(share / (2 - share)) */
#define SURE_SDS        5.0f
#define SUSPECTED       0.6f /* of what is sure */
#define OTHER_WAY       3.0f
#define CONFIRM_TURNS   2
#define LASTING_TURNS   60 /* 15 s of suspicion are as sure */
#define LARGE_LOSS      0.04f
#define LARGE_SD_K      5.0f /* the transformation may have moved */
#define CROSSING_SD_K   1.0f
#define STILL_K         0.5f /* below martensite start it would be seen */

static void see_crossing(const spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model,
                         uint8_t k, float lost)
{
    const float width_k = e->martensite_start_c - e->martensite_finish_c;
    /* the cosine's beginning, (1 - cos pi x) / 2 */
    const float depth_k = width_k * 0.64f * sqrtf(fminf(lost, 1.0f));
    if (lost > LARGE_LOSS) {
        /* the transformation may have moved: nearer to it by as much as more is lost up there */
        const float by_loss = b->stiffness_w_per_k / (spring_now_c(model, k) - 20.0f);
        const float moved_k2 = LARGE_SD_K * LARGE_SD_K;
        b->shift_variance_k2 += moved_k2;
        b->variance_k2 += moved_k2;
        b->covariance -= moved_k2 * by_loss;
        b->loss_variance += moved_k2 * by_loss * by_loss;
    }
    if (getenv("DBG")) fprintf(stderr,"cross k%d lost %.4f now %.2f sd %.2f noise %.5f line %.5f slow %.5f chg %.3f quiet %d i %.2f rise %.5f\n",k,lost,spring_now_c(model,k),sqrtf(b->variance_k2),b->noise,b->line_ohm,b->slow_ohm,b->learnt.change,b->quiet,b->current_a,b->learnt.martensite_rise_per_k);
    const bool searched = b->crossings == 0;
    const float error_k = spring_see(e, b, model, k, e->martensite_start_c - depth_k, CROSSING_SD_K,
                                     SPRING_PHASE_AUSTENITE);
    if (!searched && -error_k > b->disturbance_k) {
        b->disturbance_k = -error_k;
    }
    b->lost += lost;
    b->crossings = b->crossings < UINT8_MAX ? (uint8_t)(b->crossings + 1) : UINT8_MAX;
    b->quiet = 0;
    b->losing = 0;
}

/* A phase that is kept changes the resistance no faster than temperature does. */
void spring_holding_watch(const spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model,
                          uint8_t k, float moved_k)
{
    if (b->possible != SPRING_PHASE_AUSTENITE) {
        return;
    }
    if (fabsf(moved_k) > QUIET_K) {
        b->quiet = 0;
    } else if (b->quiet < UINT8_MAX) {
        b->quiet++;
    }
    if (b->quiet == 0) {
        b->slow_ohm = b->ohm;
        b->line_ohm = 0.0f;
    }
    if (b->quiet < QUIET_TURNS) {
        b->losing = 0;
        return;
    }
    const float now_c = spring_now_c(model, k);
    if (b->line_ohm == 0.0f) {
        b->line_ohm = b->slow_ohm;
        b->line_c = now_c;
        /* what went on the way here, beyond what temperature and the sensor's offset explain */
        const float gone = fabsf(1.0f - b->slow_ohm / b->full_ohm) - 0.0015f * fabsf(b->full_c - now_c) - 0.03f;
        if (b->full_ohm > 0.0f && gone > 0.0f) {
            see_crossing(e, b, model, k, fminf(gone / fabsf(b->learnt.change) + 0.1f, 1.0f));
            b->full_ohm = 0.0f;
            return;
        }
    }
    const float kept_ohm =
        b->line_ohm * (1.0f + b->learnt.martensite_rise_per_k * (now_c - b->line_c));
    const float left = b->slow_ohm / kept_ohm - 1.0f;
    /* an intermediate phase moves it the other way: believed where it is far more than any drift */
    const float as_declared = -left / b->learnt.change;
    const float lost = fmaxf(as_declared, -as_declared / OTHER_WAY);
    const float sure =
        fmaxf(LOSS_LEAST, SURE_SDS * NOISE_IN_SLOW * b->noise) / fabsf(b->learnt.change);
    if (lost < SUSPECTED * sure) {
        b->losing = 0;
        b->line_ohm += b->line_ohm * left / LINE_TURNS;
        if (now_c < e->martensite_start_c - STILL_K) {
            spring_keep(e, b, model, k, e->martensite_start_c - STILL_K, SPRING_PHASE_AUSTENITE);
        }
        return;
    }
    b->losing = b->losing < UINT8_MAX ? (uint8_t)(b->losing + 1) : UINT8_MAX;
    if ((lost > sure && b->losing >= CONFIRM_TURNS) || b->losing >= LASTING_TURNS) {
        see_crossing(e, b, model, k, lost);
    }
}
