#include <math.h>

#include "spring_estimator_internal.h"

#define QUIET_K       0.08f   /* a turn's: 0.3 K/s */
#define QUIET_TURNS   40      /* 10 s: the average has settled */
#define LINE_TURNS    240.0f  /* 60 s: what the line follows is no loss of phase */
#define LOSS_LEAST    0.0012f /* of the resistance: what a sensor's steps leave in the average */
#define NOISE_IN_SLOW 0.18f   /* of one turn's: sqrt(share / (2 - share)) */
#define SURE_SDS      5.0f
#define SUSPECTED     0.6f /* of what is sure */
#define OTHER_WAY     3.0f /* times as much: an intermediate phase, where drifts go either way */
#define CONFIRM_TURNS 2
#define LASTING_TURNS 60    /* 15 s of suspicion are as sure */
#define LARGE_LOSS    0.04f /* no hold drifts so far: the transformation may have moved */
#define LARGE_SD_K    5.0f
#define CROSSING_SD_K 1.0f
#define STILL_K       0.5f  /* below martensite start it would be seen */
#define OFFSET_MOST   0.03f /* of a resistance, read at another current: 8 mV of 0.27 V */
#define OFFSET_PHASE  0.1f

static void see_crossing(const spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model,
                         uint8_t k, float lost)
{
    const thermal_model_transformation_t t = thermal_model_transformation(model, k);
    /* the beginning of the cosine, (1 - cos pi x) / 2 */
    const float depth_k = spring_c((int16_t)(t.martensite_start_c7 - t.martensite_finish_c7)) *
                          0.64f * sqrtf(fminf(lost, 1.0f));
    const bool searched = spring_estimator_sd_k(b) > 3.0f * CROSSING_SD_K;
    if (lost > LARGE_LOSS) {
        /* nearer to it by as much as more is lost up there */
        const float above_k = fmaxf(spring_now_c(model, k) - spring_ambient_c(model), 1.0f);
        const float by_loss = spring_stiffness_w_per_k(b) / above_k;
        const float moved_k2 = LARGE_SD_K * LARGE_SD_K;
        b->shift_variance_k2 += moved_k2;
        b->variance_k2 += moved_k2;
        b->covariance -= moved_k2 * by_loss;
        b->loss_variance += moved_k2 * by_loss * by_loss;
    }
    const float error_k = spring_see(e, b, model, k, spring_c(t.martensite_start_c7) - depth_k,
                                     CROSSING_SD_K, SPRING_PHASE_AUSTENITE);
    if (!searched && -error_k > b->disturbance_k) {
        b->disturbance_k = -error_k;
    }
    b->lost = fminf(b->lost + lost, 1.0f);
    b->quiet = 0;
    b->losing = 0;
}

/* What went on the way here, beyond what temperature and an offset of the sensor explain. */
static float gone_on_the_way(const spring_belief_t *b, float now_c)
{
    if (b->full_ohm == 0.0f) {
        return 0.0f;
    }
    return fabsf(1.0f - b->slow_ohm / b->full_ohm) - OFFSET_MOST -
           COEFFICIENT_MOST_PER_K * fabsf(b->full_c - now_c);
}

/* A phase that is kept changes the resistance no faster than temperature does. */
void spring_holding_watch(const spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model,
                          uint8_t k, float moved_k)
{
    if (b->possible != SPRING_PHASE_AUSTENITE) {
        b->quiet = 0;
        return;
    }
    b->quiet = fabsf(moved_k) > QUIET_K ? 0
               : b->quiet < UINT8_MAX   ? (uint8_t)(b->quiet + 1)
                                        : UINT8_MAX;
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
        const float gone = gone_on_the_way(b, now_c);
        b->line_ohm = b->slow_ohm;
        b->line_c = now_c;
        b->full_ohm = 0.0f; /* asked once */
        if (gone > 0.0f) {
            see_crossing(e, b, model, k, gone / fabsf(b->learnt.change) + OFFSET_PHASE);
            return;
        }
    }
    const float kept_ohm =
        b->line_ohm * (1.0f + b->learnt.martensite_rise_per_k * (now_c - b->line_c));
    const float left = b->slow_ohm / kept_ohm - 1.0f;
    const float as_learnt = b->learnt.change < 0.0f ? left : -left;
    const float changed = as_learnt > 0.0f ? as_learnt : -as_learnt * (1.0f / OTHER_WAY);
    /* as its temperature may have moved unseen, so may the resistance */
    const float moves = fabsf(b->learnt.martensite_rise_per_k) * spring_estimator_sd_k(b);
    const float sure = fmaxf(fmaxf(LOSS_LEAST, moves), SURE_SDS * NOISE_IN_SLOW * b->noise);
    if (changed < SUSPECTED * sure) {
        const int16_t start_c7 = thermal_model_transformation(model, k).martensite_start_c7;
        b->losing = 0;
        b->line_ohm += b->line_ohm * left * (1.0f / LINE_TURNS);
        spring_keep_above(e, b, model, k, spring_c(start_c7) - STILL_K);
        return;
    }
    b->losing = b->losing < UINT8_MAX ? (uint8_t)(b->losing + 1) : UINT8_MAX;
    if ((changed > sure && b->losing >= CONFIRM_TURNS) || b->losing >= LASTING_TURNS) {
        see_crossing(e, b, model, k, changed / fabsf(b->learnt.change));
    }
}
