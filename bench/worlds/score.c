#include "score.h"

#include <math.h>
#include <string.h>

#define SAMPLE_S (SCORE_EVERY_TICKS * WORLD_TICK_S)

static void restart_spring(score_spring_t *spring)
{
    spring->reached_s = spring->report_from_s = spring->report_last_s = NAN;
    spring->lost_s = 0.0;
    spring->heats = false;
}

void score_begin(score_t *score, const world_t *world, const bool driven[], double allowed_s)
{
    memset(score, 0, sizeof *score);
    score->springs = world_springs(world);
    score->allowed_s = allowed_s;
    for (int k = 0; k < score->springs; k++) {
        score->spring[k].driven = driven[k];
        score->spring[k].start_s = world_time_s(world);
        score->spring[k].lowest_held = 1.0;
        score->spring[k].hottest_c = -INFINITY;
        restart_spring(&score->spring[k]);
    }
}

/* A spring that is there was there when it got there, or said why not from then on. */
static void settle(score_spring_t *spring)
{
    /* NaN, 'not yet', gives way to any number. */
    double at_s = fmin(fmin(spring->reached_s, spring->report_from_s), (double)INFINITY);
    spring->settled_s = fmax(spring->settled_s, at_s - spring->start_s);
}

void score_restart(score_t *score, const world_t *world)
{
    score->next_sight = 0;
    for (int k = 0; k < score->springs; k++) {
        if (score->spring[k].driven && isnan(score->spring[k].reached_s)) {
            settle(&score->spring[k]);
        }
        restart_spring(&score->spring[k]);
        score->spring[k].start_s = world_time_s(world);
    }
}

void score_ask(score_t *score, const world_t *world, int k, bool driven)
{
    score_spring_t *spring = &score->spring[k];
    if (driven == spring->driven) {
        return;
    }
    bool due = world_time_s(world) - spring->start_s > score->allowed_s;
    if (spring->driven && due && isnan(spring->reached_s)) {
        settle(spring);
    }
    restart_spring(spring);
    spring->driven = driven;
    spring->start_s = world_time_s(world);
    spring->was_low = false;
}

static void score_report(score_spring_t *spring, bool reported, double now_s)
{
    if (reported) {
        if (isnan(spring->report_from_s)) {
            spring->report_from_s = now_s;
        }
        spring->report_last_s = now_s;
    } else if (now_s - spring->report_last_s > SCORE_REPORT_GAP_S) {
        spring->report_from_s = spring->report_last_s = NAN;
    }
}

static void score_hold(score_spring_t *spring, const world_t *world, int k,
                       const controller_t *controller)
{
    spring->hold_s += SAMPLE_S;
    spring->hold_c += SAMPLE_S * world_mean_c(world, k);
    belief_bounds_t c = belief_temperature_bounds_c(controller, k);
    belief_bounds_t distance_k = belief_distance_bounds_k(controller, k);
    spring->half_width_k += SAMPLE_S * 0.5 * (c.high - c.low);
    spring->half_distance_k += SAMPLE_S * 0.5 * (distance_k.high - distance_k.low);
}

static void score_driven(score_t *score, score_spring_t *spring, const world_t *world, int k,
                         const controller_t *controller)
{
    double now_s = world_time_s(world), since_s = now_s - spring->start_s;
    double austenite = world_austenite(world, k);
    score_report(spring, belief_reported(controller, k), now_s);
    if (isnan(spring->reached_s) && austenite >= SCORE_REACHED) {
        spring->reached_s = now_s;
        settle(spring);
    }
    bool due = !isnan(spring->reached_s) || since_s > score->allowed_s;
    bool lost = due && austenite < SCORE_LOST && isnan(spring->report_from_s);
    spring->lost_s = lost ? spring->lost_s + SAMPLE_S : 0.0;
    if (spring->lost_s > SCORE_LOST_S) {
        spring->silent_s += SAMPLE_S;
    }
    if (!isnan(spring->reached_s)) {
        spring->lowest_held = fmin(spring->lowest_held, austenite);
    }
    if (since_s >= SCORE_HOLD_S && austenite >= SCORE_LOST) {
        score_hold(spring, world, k, controller);
    }
    bool settled = since_s >= SCORE_SETTLED_S && !isnan(spring->reached_s);
    spring->settled_hold_s += settled ? SAMPLE_S : 0.0;
    spring->mean_a += (world_current_a(world, k) - spring->mean_a) * SAMPLE_S;
    bool heats = spring->mean_a > (spring->heats ? SCORE_REHEATED_A : SCORE_REHEAT_A);
    spring->reheats += settled && heats && !spring->heats;
    spring->heats = heats;
}

static void score_bounds(score_spring_t *spring, const world_t *world, int k,
                         const controller_t *controller)
{
    belief_bounds_t c = belief_temperature_bounds_c(controller, k);
    belief_bounds_t phase = belief_austenite_bounds(controller, k);
    if (isnan(c.low) || isnan(phase.low)) {
        return;
    }
    double true_c = world_mean_c(world, k), austenite = world_austenite(world, k);
    bool inside_c = c.low <= true_c && true_c <= c.high;
    bool inside_phase = phase.low <= austenite && austenite <= phase.high;
    spring->known_s += SAMPLE_S;
    spring->inside_c_s += inside_c ? SAMPLE_S : 0.0;
    spring->inside_phase_s += inside_phase ? SAMPLE_S : 0.0;
    spring->inside_s += inside_c && inside_phase ? SAMPLE_S : 0.0;
}

static void score_sights(score_t *score, const world_t *world, const controller_t *controller)
{
    int k;
    while ((k = belief_next_loss(controller, &score->next_sight)) >= 0) {
        score->spring[k].losses_seen++;
        score->spring[k].false_losses +=
            world_austenite(world, k) > SCORE_WHOLE &&
            world_mean_c(world, k) > world_martensite_start_c(world, k) + SCORE_FAR_K;
    }
}

void score_tick(score_t *score, const world_t *world, const controller_t *controller)
{
    if (++score->ticks % SCORE_EVERY_TICKS != 0) {
        return;
    }
    if (controller != NULL) {
        score_sights(score, world, controller);
    }
    for (int k = 0; k < score->springs; k++) {
        score_spring_t *spring = &score->spring[k];
        double austenite = world_austenite(world, k);
        spring->hottest_c = fmax(spring->hottest_c, world_hottest_c(world, k));
        if (!spring->driven) {
            spring->was_low = spring->was_low || austenite < SCORE_UNDRIVEN;
            spring->undriven_most =
                spring->was_low ? fmax(spring->undriven_most, austenite) : spring->undriven_most;
        } else if (controller != NULL) {
            score_driven(score, spring, world, k, controller);
        }
        if (controller != NULL) {
            score_bounds(spring, world, k, controller);
            spring->fault = controller_fault(controller, (uint8_t)k) != SAFETY_FAULT_NONE ||
                            controller_board_fault(controller) != SAFETY_FAULT_NONE;
        }
    }
}

void score_end(score_t *score)
{
    double now_s = score->ticks * WORLD_TICK_S;
    for (int k = 0; k < score->springs; k++) {
        score_spring_t *spring = &score->spring[k];
        bool due = now_s - spring->start_s > score->allowed_s;
        if (spring->driven && due && isnan(spring->reached_s)) {
            settle(spring);
        }
    }
}
