#include "losses.h"

#include <math.h>
#include <string.h>

#define SAMPLE_S (SCORE_EVERY_TICKS * WORLD_TICK_S)

void losses_begin(losses_t *losses, double step_s, double stepped_s)
{
    memset(losses, 0, sizeof *losses);
    losses->step_s = step_s;
    losses->stepped_s = stepped_s;
    for (int k = 0; k < WORLD_SPRINGS_MAX; k++) {
        losses->spring[k].lost_at_s = losses->spring[k].silent_at_s = NAN;
    }
}

static void last(double *on_end_s, bool lasts)
{
    *on_end_s = lasts ? *on_end_s + SAMPLE_S : 0.0;
}

/* A silence ends only with what is said for LOSSES_SAY_S. */
static void keep_silence(double *silence_s, double *said_s, bool low, bool said)
{
    last(said_s, said);
    last(silence_s, low && *said_s < LOSSES_SAY_S);
}

static void look_for_loss(losses_spring_t *spring, double now_s, double austenite, unsigned said)
{
    const bool low = austenite < SCORE_LOST;
    spring->judged_s += SAMPLE_S;
    if (austenite >= SCORE_REACHED) {
        spring->there_s += SAMPLE_S;
        const unsigned away = said & (BELIEF_SAID_AWAY | BELIEF_SAID_BLIND);
        spring->away_there_s += away == BELIEF_SAID_AWAY ? SAMPLE_S : 0.0;
    }
    last(&spring->low_s, low);
    keep_silence(&spring->unsaid_s, &spring->said_s, low, said != 0u);
    keep_silence(&spring->unreported_s, &spring->reported_s, low,
                 (said & ~BELIEF_SAID_BLIND) != 0u);
    if (spring->low_s > LOSSES_LOST_S) {
        spring->lost_s += SAMPLE_S;
        spring->lost_at_s = isnan(spring->lost_at_s) ? now_s : spring->lost_at_s;
    }
    if (spring->unsaid_s > LOSSES_LOST_S && isnan(spring->silent_at_s)) {
        spring->silent_at_s = now_s;
    }
    spring->blind_only = spring->blind_only || spring->unreported_s > LOSSES_LOST_S;
}

static void look_for_return(losses_t *losses, losses_spring_t *spring, double now_s,
                            double austenite)
{
    if (!spring->was_there || spring->back != LOSSES_NOT_JUDGED) {
        return;
    }
    if (austenite < SCORE_REACHED) {
        spring->last_low_s = now_s;
    }
    if (now_s >= losses->stepped_s + LOSSES_BACK_S + LOSSES_SETTLE_S) {
        const bool back = spring->last_low_s <= losses->stepped_s + LOSSES_BACK_S;
        spring->back = back ? LOSSES_BACK : LOSSES_NOT_BACK;
    }
}

void losses_tick(losses_t *losses, const score_t *score, const world_t *world,
                 const controller_t *controller)
{
    if (score->ticks % SCORE_EVERY_TICKS != 0) {
        return;
    }
    const double now_s = world_time_s(world);
    const bool begins = !losses->begun && losses->step_s > 0.0 && now_s >= losses->step_s;
    losses->begun = losses->begun || begins;
    for (int k = 0; k < score->springs; k++) {
        losses_spring_t *spring = &losses->spring[k];
        const double start_s = score->spring[k].start_s;
        const double austenite = world_austenite(world, k);
        if (controller == NULL || !score->spring[k].driven) {
            spring->low_s = spring->unsaid_s = spring->unreported_s = 0.0;
            spring->was_there = false;
            continue;
        }
        const int fault = belief_fault(controller, k);
        spring->fault = fault != 0 ? fault : spring->fault;
        if (now_s - start_s >= LOSSES_DUE_S) {
            look_for_loss(spring, now_s, austenite, belief_said(controller, k));
        }
        if (begins) {
            spring->was_there = austenite >= SCORE_REACHED;
        }
        look_for_return(losses, spring, now_s, austenite);
    }
}
