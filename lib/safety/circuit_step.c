#include "circuit_step.h"

#include <math.h>

#include "fixed_point.h"

#define Q12         4096.0f
#define MOST        65535.0f
#define CURRENT_MA  16.0f
#define NOISE_MV    4.0f  /* a step of the voltage's register */
#define CHANGE_PART 0.10f /* of its resistance, that a spring makes in three windows */
/* As others switch, and what a contact makes of it where the wiring is not as declared. */
#define SHARE_PART 0.04f
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

static bool is_off(uint16_t now, uint16_t was, float most_part, float most)
{
    const uint16_t by = apart(now, was);
    /* as a rule: no floating point; either share is above a thirty-second */
    return by > was >> MOVED_SHARE_SHIFT && (float)by > most_part * (float)was + most;
}

/* Of a lie both move: of the current, the share by so much of it as shunt and wiring are of the
 * loop, and the other way; of the voltage, by what the spring is of it. Either is a quarter of the
 * loop at least. */
static bool is_like_a_lie(const circuit_shown_t *now, const circuit_shown_t *was)
{
    const bool other_way = (now->share_q12 > was->share_q12) != (now->ohm_q12 > was->ohm_q12);
    const uint32_t share = fixed_point_mac_u16(0, apart(now->share_q12, was->share_q12),
                                               other_way ? now->ohm_q12 : was->ohm_q12);
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
static bool shares_differ(const circuit_shown_t *now, const circuit_shown_t *was, float expected_mv,
                          float fixed_ohm, const circuit_source_t *source)
{
    const float noise_part = SHARE_PART + NOISE_MV / expected_mv;
    if (!is_off(now->share_q12, was->share_q12, noise_part, 0.0f)) {
        return false;
    }
    const float was_mv =
        CURRENT_MA * (float)was->current_16ma * ((float)was->ohm_q12 + Q12 * fixed_ohm);
    const float change = expected_mv * (float)was->share_q12 / was_mv - 1.0f;
    const bool is_more = (now->share_q12 > was->share_q12) == (change > 0.0f);
    const float unsure_mv = is_more ? source->more_mv : source->less_mv;
    return is_off(now->share_q12, was->share_q12, noise_part,
                  Q12 * unsure_mv * fabsf(change) / expected_mv);
}

bool circuit_step_judge(circuit_step_t *step, const circuit_window_t *window,
                        const circuit_source_t *source, const current_control_parameters_t *circuit)
{
    const float fixed_ohm = 1e-3f * (float)((uint32_t)circuit->shunt_mohm + circuit->wiring_mohm);
    const float spring_mv = window->found_mv - fixed_ohm * window->current_ma;
    if (!circuit_window_compares(window) || spring_mv < NOISE_MV ||
        window->current_ma < CURRENT_MA) {
        *step = (circuit_step_t){0};
        return false;
    }
    const circuit_shown_t now = {to_q12(window->found_mv / window->expected_mv),
                                 to_q12(spring_mv / window->current_ma),
                                 (uint8_t)fminf(window->current_ma / CURRENT_MA, 255.0f)};
    const float change_part = CHANGE_PART + NOISE_MV / spring_mv;
    bool odd = false, like = true;
    for (uint8_t n = 0; n < CIRCUIT_STEP_BACK; n++) {
        const circuit_shown_t *const was = &step->was[n];
        if (was->share_q12 != 0) {
            like = like && is_like(now.current_16ma, was->current_16ma);
            odd = odd || (is_off(now.ohm_q12, was->ohm_q12, change_part, 0.0f) &&
                          shares_differ(&now, was, window->expected_mv, fixed_ohm, source));
        }
    }
    if (!like) {
        *step = (circuit_step_t){.was = {now}};
    } else if (odd) {
        step->odd = step->odd < CIRCUIT_STEP_WINDOWS ? (uint8_t)(step->odd + 1u) : step->odd;
    } else {
        circuit_shown_t *const first = &step->was[CIRCUIT_STEP_BACK - 1u];
        if (first->share_q12 == 0 || has_moved(&now, first)) {
            *first = step->was[0];
        }
        step->was[0] = now;
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
        for (uint8_t n = 0; n < CIRCUIT_STEP_BACK; n++) {
            uint16_t *const share_q12 = &steps[k].was[n].share_q12;
            *share_q12 = to_q12(part * (1.0f / Q12) * (float)*share_q12);
        }
    }
}
