#include <math.h>
#include <stddef.h>

#include "spring_estimator_internal.h"

static int16_t rounded(float value)
{
    const float most = 32767.0f;
    return (int16_t)spring_clamp(value + (value < 0.0f ? -0.5f : 0.5f), -most, most);
}

/* 0 says that there is none. */
static uint8_t rounded_sd(float value)
{
    return value > 0.0f ? (uint8_t)spring_clamp(value + 0.5f, 1.0f, SPRING_SIGHT_SD_MOST) : 0;
}

static int16_t deci_k(int16_t distance_c7)
{
    return (int16_t)(((int32_t)distance_c7 * 10 + 64) >> 7);
}

spring_before_t spring_before(const spring_belief_t *b, const thermal_model_t *model, uint8_t k)
{
    const int16_t start_c7 = thermal_model_transformation(model, k).martensite_start_c7;
    return (spring_before_t){
        .distance_c7 = (int16_t)(thermal_model_temperature_c7(model, k) - start_c7),
        .sd_k = b->possible == SPRING_PHASE_ANY ? 0.0f : spring_estimator_sd_k(b),
        .shift_k = b->shift_k,
        .loss_w_per_k = b->learnt.loss_w_per_k};
}

/* What a sight was of, and what has become of what was believed. A division only where there is
 * something to divide: a tick has little time left. */
static void fill(const spring_estimator_t *e, const thermal_model_t *model, uint8_t k,
                 spring_sight_t *sight, const spring_before_t *before, float seen_c, float sd_k)
{
    const spring_before_t now = spring_before(&e->spring[k], model, k);
    const float more_w_per_k = now.loss_w_per_k - before->loss_w_per_k;
    if (sd_k > 0.0f) {
        const int16_t off_c7 =
            (int16_t)(rounded(128.0f * seen_c) - thermal_model_temperature_c7(model, k));
        sight->seen = deci_k((int16_t)(now.distance_c7 + off_c7));
        sight->seen_sd = rounded_sd(10.0f * sd_k);
    }
    sight->now = deci_k(now.distance_c7);
    sight->now_sd = rounded_sd(10.0f * now.sd_k);
    sight->shift = rounded(10.0f * (now.shift_k - before->shift_k));
    sight->loss = more_w_per_k == 0.0f ? 0 : rounded(1e4f * more_w_per_k / e->loss_w_per_k);
    if (e->spring[k].blind) {
        sight->did |= SPRING_DID_BLIND;
    }
}

void spring_note(spring_estimator_t *e, const thermal_model_t *model, uint8_t k,
                 spring_sight_kind_t kind, const spring_before_t *before, float seen_c, float sd_k)
{
    /* that it still transformed is told by what comes after it, too */
    const spring_sight_t *const last = spring_sights_newest(&e->sights, k);
    if (last != NULL && last->kind == SPRING_SIGHT_TRANSFORMS) {
        spring_sights_drop(&e->sights, last);
    }
    spring_sight_t *const sight = spring_sights_add(&e->sights, k);
    sight->kind = (uint8_t)kind;
    sight->believed = deci_k(before->distance_c7);
    sight->believed_sd = rounded_sd(10.0f * before->sd_k);
    fill(e, model, k, sight, before, seen_c, sd_k);
}

void spring_note_on(spring_estimator_t *e, const thermal_model_t *model, uint8_t k,
                    spring_sight_kind_t kind, const spring_before_t *before, float seen_c,
                    float sd_k)
{
    spring_sight_t *const last = spring_sights_newest(&e->sights, k);
    if (last == NULL || last->kind != kind || last->did != 0) {
        spring_note(e, model, k, kind, before, seen_c, sd_k);
        return;
    }
    spring_sights_renew(&e->sights, last);
    fill(e, model, k, last, before, seen_c, sd_k);
}

void spring_note_read(spring_estimator_t *e, uint8_t k, float read, float sd)
{
    spring_sight_t *const sight = spring_sights_newest(&e->sights, k);
    if (sight != NULL) {
        sight->read = rounded(1e4f * read);
        sight->read_sd = rounded_sd(1e4f * sd);
    }
}

void spring_note_did(spring_estimator_t *e, uint8_t k, uint8_t did)
{
    spring_sight_t *const sight = spring_sights_newest(&e->sights, k);
    if (sight != NULL) {
        sight->did = (uint8_t)(sight->did | did);
    }
}
