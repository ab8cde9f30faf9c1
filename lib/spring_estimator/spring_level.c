#include <math.h>

#include "spring_estimator_internal.h"

/* It loses phase: it is on its way down, no hotter than there. */
static void see_falling(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model,
                        uint8_t k, float left, const spring_departure_t *d)
{
    const float per_change = 1.0f / fabsf(b->learnt.change);
    const spring_before_t before = spring_before(b, model, k);
    b->lost = fminf(b->lost + fabsf(left) * per_change, 1.0f);
    const spring_place_t at = spring_place_of(model, k, b->lost, d->unsure * per_change);
    if (spring_now_c(model, k) <= at.c) {
        return;
    }
    (void)spring_see(e, b, model, k, at.c, at.sd_k, SPRING_PHASE_AUSTENITE);
    spring_note(e, model, k, SPRING_SIGHT_LOST, &before, at.c, at.sd_k);
    spring_note_read(e, k, left, sqrtf(d->noise2 + d->unsure * d->unsure));
}

void spring_level_watch(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model,
                        uint8_t k, float moved_k, float share)
{
    if (b->heating || b->learnt.austenite_ohm == 0.0f ||
        (b->possible & SPRING_PHASE_BETWEEN) == 0 || b->possible == SPRING_PHASE_ANY) {
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
    if (spring_learn_offset(b)) {
        return;
    }
    const float left = spring_has_left(b);
    const spring_departure_t d = spring_departs(b, model, k, left * left, 0.0f, SURE_SDS, share);
    if (d.sure && !spring_is_other_way(b, left)) {
        see_falling(e, b, model, k, left, &d);
    }
    if (d.sure || (b->losing == 0 && fabsf(line->slow_k) > ANCHOR_K)) {
        spring_begin_line(b, true, share);
    }
}
