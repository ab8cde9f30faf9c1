#include "circuit_check.h"

#include <math.h>
#include <stddef.h>

#define DUTY_STEPS      800.0f
#define LEAST_READINGS  12u    /* where a current rises, every other tick gives one */
#define SQUARED_MOST_MV 11965u /* a window of these fits 32 bits; no sensor shows as much */

/* Of the duty, steps^2. A quarter of the default dither gives 1; below that, four times a sensor's
 * noise (6 mV) would be more than an eighth of what the window should show. */
#define LEAST_VARIANCE  0.5f
#define VOLTAGE_STEP_MV 4.0f /* of the INA219's register; a current's is 1 mA */
/* Share of the voltage that is found which should follow: all of it, whatever supply, wiring and
 * gains are; 0.9 to 1.15 were seen. Where one of the two readings stays, only the other's part
 * does: 0.3 to 0.65. And of the expected: 0.73 to 1.28 (4.2 V for 5, wiring 0.04 ohm more, gain 3
 * %). */
#define LEAST_FOLLOWS 0.7f
#define MOST_SLOPE    2.5f
/* Least deviation of the duty, of itself, that tells a slope: a supply that moves by 5 % beside it,
 * as others switch, adds half of it at the most. */
#define SLOPE_SHARE 0.05f
/* Deviation of a duty, of itself, at which voltages are still those of one duty. */
#define STEADY_SHARE     0.15f
#define STEADY_PER_SLOPE (STEADY_SHARE * STEADY_SHARE / (SLOPE_SHARE * SLOPE_SHARE))
/* Off by more than the same tolerances, and the offsets of both readings. */
#define BALANCE_SHARE 0.3f
#define BALANCE_MV    15.0f
/* Deviation of what no duty explains, of the voltage. A supply that others load and leave moves by
 * 5 % from end to end, which deviates by half of it at the most. Current and voltage are not read
 * at once: what they make of a resistance is off by as much, and more than any rule that reads it
 * allows for. */
#define RESTLESS_SHARE 0.05f
#define RESTLESS_MV    12.0f /* twice four times a sensor's noise */

static uint16_t amount(int16_t value)
{
    if (value <= 0) {
        return 0;
    }
    return (uint16_t)value > CIRCUIT_CHECK_MOST ? CIRCUIT_CHECK_MOST : (uint16_t)value;
}

static circuit_check_t begun(const circuit_check_t *c)
{
    return (circuit_check_t){.last_duty = c->last_duty,
                             .last_ma = c->last_ma,
                             .last_mv = c->last_mv,
                             .astray = c->astray,
                             .unbalanced = c->unbalanced,
                             .restless = c->restless};
}

/* The drop is no part of a voltage where nothing flows. */
static bool is_of_one_kind(circuit_check_t *c, uint8_t dead_steps, uint16_t duty)
{
    if (dead_steps == 0) {
        return true;
    }
    if (duty > dead_steps && c->duty == 0) {
        const bool hurried = c->hurried;
        *c = begun(c);
        c->hurried = hurried;
    }
    return duty > dead_steps || (duty == 0 && c->duty == 0);
}

void circuit_check_take(circuit_check_t *c, uint16_t fixed_mohm, uint8_t dead_steps, uint16_t duty,
                        bool valid, int16_t current_ma, int16_t voltage_mv)
{
    const uint16_t moved = (uint16_t)(duty - c->last_duty + CIRCUIT_CHECK_JUMP);
    c->last_duty = duty;
    if (c->late) {
        c->late = false;
        return;
    }
    if (!valid || moved > 2u * CIRCUIT_CHECK_JUMP || !is_of_one_kind(c, dead_steps, duty)) {
        return;
    }
    const uint16_t dropped_mv = (uint16_t)(((uint32_t)amount(current_ma) * fixed_mohm) >>
                                           10); /* 2 % low: tolerances are 30 */
    const uint16_t behind_mv = (uint16_t)(amount(voltage_mv) + dropped_mv);
    c->current_moved = c->current_moved || current_ma != c->last_ma;
    c->voltage_moved = c->voltage_moved || voltage_mv != c->last_mv;
    c->last_ma = current_ma;
    c->last_mv = voltage_mv;
    c->readings = (c->readings + 1u) & 63u;
    c->duty = (uint16_t)(c->duty + duty);
    c->voltage_mv += behind_mv;
    c->current_2ma = (uint16_t)(c->current_2ma + (amount(current_ma) >> 1));
    c->duty_square += (uint32_t)duty * duty;
    c->duty_voltage += (uint32_t)duty * behind_mv;
    const uint16_t squared_mv = behind_mv < SQUARED_MOST_MV ? behind_mv : SQUARED_MOST_MV;
    c->voltage_square += (uint32_t)squared_mv * squared_mv;
}

bool circuit_check_drop(circuit_check_t *c)
{
    if (!c->hurried || c->readings >= LEAST_READINGS) {
        return false;
    }
    *c = begun(c);
    return true;
}

static uint8_t counted(uint8_t windows, bool bad)
{
    if (!bad) {
        return 0;
    }
    return windows < 15u ? (uint8_t)(windows + 1u) : windows;
}

/* What is swept moves by two deviations at least: a register that shows none of it is frozen, if
 * they are a step of it. */
static bool stands(const circuit_check_t *c, float swept_mv2, float found_mv)
{
    const float own_mv = (float)c->last_mv; /* the spring's part of what was found */
    const float half_mv = 0.5f * VOLTAGE_STEP_MV * found_mv;
    return !c->current_moved ||
           (!c->voltage_moved && swept_mv2 * own_mv * own_mv > half_mv * half_mv);
}

/* What of its voltage does not go with the duty, as far as that moves. */
static bool moves_alone(float voltage_variance, float follows_mv, float duty_variance,
                        float found_mv)
{
    const float likely_mv = RESTLESS_SHARE * found_mv;
    const float beyond_mv2 = voltage_variance - (likely_mv * likely_mv + RESTLESS_MV * RESTLESS_MV);
    return duty_variance >= LEAST_VARIANCE ? beyond_mv2 * duty_variance > follows_mv * follows_mv
                                           : beyond_mv2 > 0.0f;
}

/* By so much duty of such a supply behind the drop. */
static float expected(const circuit_source_t *source, float step_mv, float duty)
{
    return fmaxf(duty * step_mv - source->drop_mv, 0.0f);
}

bool circuit_check_judge(circuit_check_t *c, const circuit_source_t *source, uint16_t supply_mv,
                         circuit_window_t *window)
{
    bool astray = false;
    bool unbalanced = false;
    bool restless = false;
    if (window != NULL) {
        *window = (circuit_window_t){.tells = false};
    }
    if (c->readings >= LEAST_READINGS) {
        const float share = 1.0f / (float)c->readings;
        const float step_mv = source->step_mv;
        const float duty = share * (float)c->duty;
        const float found_mv = share * (float)c->voltage_mv;
        const float variance = share * (float)c->duty_square - duty * duty;
        const float follows_mv = share * (float)c->duty_voltage - duty * found_mv;
        const float should_mv = variance * step_mv;
        const float expected_mv = expected(source, step_mv, duty);
        const float declared_mv =
            expected(source, (1.0f / DUTY_STEPS) * ((float)supply_mv + source->drop_mv), duty);
        const float slope_variance = SLOPE_SHARE * SLOPE_SHARE * duty * duty;
        const bool tells = variance >= fmaxf(LEAST_VARIANCE, slope_variance);
        const float all_mv = found_mv + source->drop_mv - source->less_mv; /* that go with it */
        const bool other = tells && (follows_mv * duty < LEAST_FOLLOWS * variance * all_mv ||
                                     follows_mv > MOST_SLOPE * should_mv);
        /* else the drop may take all of it, and nothing follows */
        const bool flows = expected_mv >= source->unsure_mv;
        astray =
            flows &&
            (other || (variance >= LEAST_VARIANCE && stands(c, should_mv * step_mv, found_mv)));
        const float off_mv = found_mv - declared_mv;
        const float beyond_mv = fabsf(off_mv) - BALANCE_SHARE * declared_mv - BALANCE_MV;
        unbalanced = beyond_mv > (off_mv < 0.0f ? source->more_mv : source->less_mv);
        const bool steady = variance < STEADY_PER_SLOPE * slope_variance;
        const float square_mv2 = share * (float)c->voltage_square;
        restless = flows && steady &&
                   moves_alone(square_mv2 - found_mv * found_mv, follows_mv, variance, found_mv);
        if (window != NULL) {
            *window = (circuit_window_t){.found_mv = found_mv,
                                         .expected_mv = expected_mv,
                                         .share = circuit_window_share(found_mv, expected_mv),
                                         .current_ma = 2.0f * share * (float)c->current_2ma,
                                         .duty = duty,
                                         .steady = steady,
                                         .tells = true,
                                         .balances = beyond_mv <= 0.0f};
        }
    }
    c->astray = counted(c->astray, astray) & 15u;
    c->unbalanced = counted(c->unbalanced, unbalanced) & 15u;
    c->restless = counted(c->restless, restless) & 15u;
    *c = begun(c);
    return c->astray >= CIRCUIT_CHECK_WINDOWS || c->unbalanced >= CIRCUIT_CHECK_BALANCE_WINDOWS ||
           c->restless >= CIRCUIT_CHECK_BALANCE_WINDOWS;
}
