#include <math.h>

#include "spring_estimator_internal.h"

/* At a place of its transformation. */
static void see_level(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model, uint8_t k,
                      spring_sight_kind_t kind, float seen_c, float sd_k)
{
    const spring_before_t before = spring_before(b, model, k);
    (void)spring_see(e, b, model, k, seen_c, sd_k, SPRING_PHASE_AUSTENITE);
    spring_note(e, model, k, kind, &before, seen_c, sd_k);
}

/* It loses phase: it is on its way down, no hotter than there. Returns whether that moved it. */
static bool see_falling(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model,
                        uint8_t k, float lost, float lost_sd)
{
    b->lost = fminf(b->lost + lost, 1.0f);
    const float seen_c = spring_lost_at_c(model, k, b->lost);
    const float unsure_k = seen_c - spring_lost_at_c(model, k, b->lost + lost_sd);
    if (spring_now_c(model, k) <= seen_c) {
        return false;
    }
    see_level(e, b, model, k, SPRING_SIGHT_LOST, seen_c,
              sqrtf(CROSSING_SD_K * CROSSING_SD_K + unsure_k * unsure_k));
    return true;
}

/* It gains phase: it is on its way up, no colder than where it has come to what it surely has.
 * Returns whether that moved it. */
static bool see_rising(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model, uint8_t k)
{
    const thermal_model_transformation_t t = thermal_model_transformation(model, k);
    const float width_k = spring_c((int16_t)(t.austenite_finish_c7 - t.austenite_start_c7));
    const float seen_c =
        spring_c(t.austenite_start_c7) + width_k * spring_estimator_austenite(e, model, k).low;
    b->lost = 0.0f;
    if (spring_now_c(model, k) >= seen_c) {
        return false;
    }
    see_level(e, b, model, k, SPRING_SIGHT_ONSET, seen_c, SHIFT_SD_K);
    return true;
}

void spring_level_watch(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model,
                        uint8_t k, float moved_k, float share)
{
    const bool tells = b->learnt.austenite_ohm > 0.0f || b->learnt.martensite_ohm > 0.0f;
    if (b->heating || !tells || (b->possible & SPRING_PHASE_BETWEEN) == 0 ||
        b->possible == SPRING_PHASE_ANY) {
        return;
    }
    spring_line_t *line = &b->run.line;
    line->way_k += moved_k;
    line->slow_k += (line->way_k - line->slow_k) * share;
    if (b->current_a < STRONG_A) {
        line->ohm = 0.0f;
        line->turns = 0;
        return;
    }
    if (line->ohm == 0.0f) {
        if (line->turns == 0) {
            spring_average_anew(b);
        }
        line->turns++;
        if (line->turns >= SLOW_TURNS) {
            spring_begin_line(b, true, share);
        }
        return;
    }
    const float left = spring_has_left(b);
    const spring_departure_t d = spring_departs(b, model, k, left * left, 0.0f, SURE_SDS, share);
    if (!d.sure) {
        if (b->losing == 0 && fabsf(line->slow_k) > ANCHOR_K) {
            spring_begin_line(b, true, share);
        }
        return;
    }
    /* cooling gains none: then it is an intermediate phase, or a contact */
    const bool rises = spring_is_other_way(b, left);
    if (rises && (line->slow_k < 0.0f || spring_alloy_has_r_phase(e))) {
        spring_begin_line(b, true, share);
        return;
    }
    const float per_change = 1.0f / fabsf(b->learnt.change);
    if (rises ? see_rising(e, b, model, k)
              : see_falling(e, b, model, k, fabsf(left) * per_change, d.unsure * per_change)) {
        spring_note_read(e, k, left, sqrtf(d.noise2 + d.unsure * d.unsure));
    }
    spring_begin_line(b, true, share);
}
