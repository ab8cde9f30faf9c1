#include "circuit_step.h"

#include <math.h>

#include "fixed_point.h"

#define Q12         4096.0f
#define MOST        65535.0f
#define CURRENT_MA  16.0f
#define NOISE_MV    4.0f  /* a step of the voltage's register */
#define CHANGE_PART 0.10f /* of its resistance, that a spring makes in three windows */
/* As others switch, and what a contact makes of it where the wiring is not as declared. */
#define SHARE_PART    0.04f
#define AGAIN_PART    0.06f /* of long ago: others may have begun since, at one end of a cable */
#define KNOWN_WINDOWS 3u
/* What is compared with goes along with a spring, or a supply, that moves by a sixteenth, or a
 * thirty-second. */
#define MOVED_OHM_SHIFT   4u
#define MOVED_SHARE_SHIFT 5u
#define SAME_DROP_MV      4.0f /* of 0.4 V behind a switch, 1 % */

/* Of what is above 0. */
static uint16_t to_q12(float value)
{
    return (uint16_t)fminf(value * Q12, MOST);
}

/* At about the same current: offsets of the readings make another resistance at another one. */
static bool is_like(uint8_t now, uint8_t was)
{
    return 3u * now >= 2u * was && 2u * now <= 3u * was;
}

static uint16_t apart(uint16_t a, uint16_t b)
{
    return a > b ? (uint16_t)(a - b) : (uint16_t)(b - a);
}

/* By more than so much of it and more_mv, of those mV that it was told by. */
static bool is_off(uint16_t now, uint16_t was, float most_part, float told_mv, float more_mv)
{
    const uint16_t by = apart(now, was);
    /* as a rule: no floating point; either share is above a thirty-second */
    return by > was >> MOVED_SHARE_SHIFT &&
           (float)by * told_mv > (most_part * told_mv + more_mv) * (float)was;
}

/* Of a lie that lets its spring get hotter both move: of the current, the share falls by so much of
 * it as shunt and wiring are of the loop, and the resistance rises by all of it; of the voltage
 * both fall, the share by what the spring is of it. Either is a quarter of the loop at least. */
static bool is_like_a_lie(const circuit_shown_t *now, const circuit_shown_t *was)
{
    if (now->share_q12 >= was->share_q12) {
        return false;
    }
    const uint32_t share =
        fixed_point_mac_u16(0, apart(now->share_q12, was->share_q12),
                            now->ohm_q12 > was->ohm_q12 ? now->ohm_q12 : was->ohm_q12);
    const uint32_t all = fixed_point_mac_u16(0, apart(now->ohm_q12, was->ohm_q12), was->share_q12);
    return share <= all && share >= all >> 2;
}

/* It has changed, and not as a lie that grows. */
static bool has_moved(const circuit_shown_t *now, const circuit_shown_t *was)
{
    return (apart(now->ohm_q12, was->ohm_q12) > was->ohm_q12 >> MOVED_OHM_SHIFT ||
            apart(now->share_q12, was->share_q12) > was->share_q12 >> MOVED_SHARE_SHIFT) &&
           !is_like_a_lie(now, was);
}

/* A drop that is not the believed one takes as much of both voltages: one more than that makes the
 * share at fewer volts the lower one. */
static bool shares_differ(const circuit_shown_t *now, const circuit_shown_t *was, float part,
                          float expected_mv, float fixed_ohm, const circuit_source_t *source)
{
    if (!is_off(now->share_q12, was->share_q12, part, expected_mv, NOISE_MV)) {
        return false;
    }
    const float was_mv =
        CURRENT_MA * (float)was->current_16ma * ((float)was->ohm_q12 + Q12 * fixed_ohm);
    const float more_mv = expected_mv * (float)was->share_q12 - was_mv;
    const bool is_more = (now->share_q12 > was->share_q12) == (more_mv > 0.0f);
    const float unsure_mv = is_more ? source->more_mv : source->less_mv;
    const float moved_mv = unsure_mv * fabsf(more_mv) / was_mv * (Q12 / (float)was->share_q12);
    return is_off(now->share_q12, was->share_q12, part, expected_mv, NOISE_MV + moved_mv);
}

/* What it shows no more at this current is kept, if it did for some windows. */
static void leave(circuit_step_t *step)
{
    if (step->windows >= KNOWN_WINDOWS) {
        step->was[1] = step->was[0];
    }
    step->was[0].share_q12 = 0;
    step->windows = step->odd = step->again = step->moved = 0;
}

/* To what it showed at this current, the last or the one before. */
static void look_back(circuit_step_t *step, const circuit_shown_t *now)
{
    if (step->was[0].share_q12 != 0 && is_like(now->current_16ma, step->was[0].current_16ma)) {
        return;
    }
    const circuit_shown_t before = step->was[1];
    leave(step);
    if (is_like(now->current_16ma, before.current_16ma)) { /* none is like 0 */
        step->was[0] = before;
        step->windows = KNOWN_WINDOWS;
        step->again = 1;
    }
}

bool circuit_step_judge(circuit_step_t *step, const circuit_window_t *window,
                        const circuit_source_t *source, const current_control_parameters_t *circuit)
{
    const bool beside = window->outvoted;
    if (step->beside != beside) {
        *step = (circuit_step_t){.beside = beside};
    }
    const float fixed_ohm = 1e-3f * (float)((uint32_t)circuit->shunt_mohm + circuit->wiring_mohm);
    const float spring_mv = window->found_mv - fixed_ohm * window->current_ma;
    if (!circuit_window_compares(window) || spring_mv < NOISE_MV ||
        window->current_ma < CURRENT_MA) {
        leave(step);
        return false;
    }
    const circuit_shown_t now = {to_q12(beside ? window->beside : window->share),
                                 to_q12(spring_mv / window->current_ma),
                                 (uint8_t)fminf(window->current_ma / CURRENT_MA, 255.0f)};
    if (!window->steady) { /* of two currents: like one where their mean is */
        step->again = 1;
        if (step->was[0].share_q12 == 0 || !is_like(now.current_16ma, step->was[0].current_16ma)) {
            return step->odd >= CIRCUIT_STEP_WINDOWS;
        }
    }
    look_back(step, &now);
    circuit_shown_t *const was = &step->was[0];
    if (was->share_q12 == 0) {
        *was = now;
    }
    const float share_part = step->again ? AGAIN_PART : SHARE_PART;
    if ((beside || !window->acquitted) &&
        is_off(now.ohm_q12, was->ohm_q12, CHANGE_PART, spring_mv, NOISE_MV) &&
        (!step->again || is_like_a_lie(&now, was)) &&
        shares_differ(&now, was, share_part, window->expected_mv, fixed_ohm, source)) {
        step->odd = step->odd < CIRCUIT_STEP_WINDOWS ? (step->odd + 1u) & 3u : step->odd;
    } else {
        const bool moved = has_moved(&now, was);
        if (moved && step->moved) { /* the first may be the one in which a lie begins */
            *was = now;
            step->again = 0;
        }
        step->moved = moved && !step->moved;
        step->windows = step->windows < KNOWN_WINDOWS ? (step->windows + 1u) & 3u : step->windows;
        step->odd = 0;
    }
    return step->odd >= CIRCUIT_STEP_WINDOWS;
}

void circuit_step_renew(circuit_step_t steps[], uint8_t springs, const circuit_source_t *before,
                        const circuit_source_t *now)
{
    const bool same_drop = fabsf(now->drop_mv - before->drop_mv) < SAME_DROP_MV;
    const float part = same_drop ? before->step_mv / now->step_mv : 0.0f;
    for (uint8_t k = 0; k < springs; k++) {
        for (uint8_t n = 0; n < 2; n++) {
            uint16_t *const share_q12 = &steps[k].was[n].share_q12;
            if (!steps[k].beside) {
                *share_q12 = to_q12(part * (1.0f / Q12) * (float)*share_q12);
            }
        }
    }
}
