#include "current_control.h"

#include "fixed_point.h"
#include "invariant.h"

#define MEASURED_LIMIT_MA 4095  /* keeps current times gain below 2^27; the sensor ends at 3200 */
#define ESTIMATE_LIMIT    24575 /* loop gain, duty steps per mA in Q16: the sum of both fits int16 */
#define SENSOR_END_MA     3200  /* what it reads of any current above */
#define TRIM_LIMIT        8191u
#define FIRST_MA          128u /* what a rise from off begins with */
#define SMALL_MA          25u  /* a change that need not wait: a step of the policy's sweep */

bool current_control_check(const current_control_parameters_t *p, uint16_t *bad)
{
    return parameter_check(PARAMETER_PART_CURRENT, p, bad);
}

static int32_t offset_q16(const current_control_parameters_t *p, uint16_t drop_mv)
{
    const uint16_t swing_mv = (uint16_t)(p->supply_mv + drop_mv);
    return (int32_t)(drop_mv * 51200ul / swing_mv * 1024ul); /* 800 steps */
}

static int16_t estimate_q16(const current_control_t *control, uint16_t resistance_mohm)
{
    uint16_t sum_mohm = (uint16_t)(resistance_mohm + control->fixed_mohm);
    if (sum_mohm < resistance_mohm) {
        sum_mohm = UINT16_MAX;
    }
    uint32_t gain_q16 = ((uint32_t)sum_mohm * control->gain_q24_per_mohm) >> 8;
    return gain_q16 > ESTIMATE_LIMIT ? ESTIMATE_LIMIT : (int16_t)gain_q16;
}

static int32_t limited(int32_t value, int32_t most)
{
    return value > most ? most : value < -most ? -most : value;
}

void current_control_set_drop(current_control_t *control, uint16_t drop_mv)
{
    const int32_t before_q16 = control->offset_q16;
    control->offset_q16 = offset_q16(&control->parameters, drop_mv);
    const int32_t more_q16 = control->offset_q16 - before_q16;
    for (uint8_t k = 0; k < CURRENT_CONTROL_MAX_CHANNELS; k++) {
        current_control_channel_t *c = &control->channel[k];
        if (c->reference_ma != 0) {
            const int32_t of_gain_q16 =
                limited(more_q16 / (int32_t)c->reference_ma, 2 * (int32_t)TRIM_LIMIT);
            c->trim_q24 = limited(c->trim_q24 - of_gain_q16 * 256, control->trim_limit_q24);
        }
    }
}

static void take(current_control_t *control, const current_control_parameters_t *p)
{
    control->parameters = *p;
    /* mean voltage behind the switch: duty x supply - (1 - duty) x drop */
    uint16_t swing_mv = (uint16_t)(p->supply_mv + p->freewheel_mv);
    /* 800 steps / (1000 x swing) per mA mohm, in Q24 */
    control->gain_q24_per_mohm = (uint16_t)(13421773ul / swing_mv);
    control->fixed_mohm = (uint16_t)(p->shunt_mohm + p->wiring_mohm);
    uint32_t trim_q16 = ((uint32_t)p->trim_limit_mohm * control->gain_q24_per_mohm) >> 8;
    control->trim_limit_q24 = (int32_t)(trim_q16 > TRIM_LIMIT ? TRIM_LIMIT : trim_q16) * 256;
    control->integral_q16 = (uint16_t)(p->integral_permille * 65535ul / 1000u);
}

/* Estimated of a loop as it is declared now; what a driven one's gain was stands. */
static void estimate_anew(const current_control_t *control, current_control_channel_t *c,
                          uint16_t resistance_mohm)
{
    const int16_t before_q16 = c->estimate_q16;
    c->estimate_q16 = estimate_q16(control, resistance_mohm);
    if (c->reference_ma != 0) {
        c->trim_q24 = limited(c->trim_q24 - 256 * ((int32_t)c->estimate_q16 - before_q16),
                              control->trim_limit_q24);
    }
}

bool current_control_apply(current_control_t *control, const current_control_parameters_t *p,
                           uint16_t *bad)
{
    if (!current_control_check(p, bad)) {
        return false;
    }
    const uint16_t gain_q24_per_mohm = control->gain_q24_per_mohm;
    const uint16_t fixed_mohm = control->fixed_mohm;
    take(control, p);
    for (uint8_t k = 0; k < CURRENT_CONTROL_MAX_CHANNELS; k++) {
        current_control_channel_t *c = &control->channel[k];
        const uint32_t sum_mohm = ((uint32_t)c->estimate_q16 << 8) / gain_q24_per_mohm;
        estimate_anew(control, c, sum_mohm > fixed_mohm ? (uint16_t)(sum_mohm - fixed_mohm) : 0);
    }
    current_control_set_drop(control, p->freewheel_mv);
    return true;
}

bool current_control_init(current_control_t *control,
                          const current_control_parameters_t *parameters, uint16_t *bad)
{
    if (!current_control_check(parameters, bad)) {
        return false;
    }
    take(control, parameters);
    control->offset_q16 = offset_q16(parameters, parameters->freewheel_mv);
    control->even_turn = false;
    for (uint8_t k = 0; k < CURRENT_CONTROL_MAX_CHANNELS; k++) {
        control->channel[k] = (current_control_channel_t){0};
        current_control_set_resistance(control, k, 0);
    }
    return true;
}

void current_control_reset(current_control_t *control, uint8_t channel)
{
    current_control_channel_t *c = &control->channel[channel];
    *c = (current_control_channel_t){.estimate_q16 = c->estimate_q16};
}

void current_control_set_resistance(current_control_t *control, uint8_t channel,
                                    uint16_t resistance_mohm)
{
    control->channel[channel].estimate_q16 = estimate_q16(control, resistance_mohm);
}

/* Duty steps per mA in Q16: the estimated loop and what was learnt beyond it. */
static inline uint16_t loop_gain_q16(int16_t estimate_q16, int32_t trim_q24)
{
    int16_t gain = (int16_t)(estimate_q16 + (int16_t)((uint32_t)trim_q24 >> 8));
    return gain > 0 ? (uint16_t)gain : 1u;
}

static inline int16_t to_q8(int32_t value_q16)
{
    int16_t high = (int16_t)(value_q16 >> 16);
    return high < INT8_MIN ? INT16_MIN : high > INT8_MAX ? INT16_MAX : (int16_t)(value_q16 >> 8);
}

/* The trim takes integral x error / reference, the reference rounded up to FIRST_MA times a power
 * of two; error: the given duty less the one that what it has brought should have taken. Of a
 * reading at the sensor's end it takes all, the reference rounded down, and what was learnt upwards
 * is taken back: a supply that had sagged has come back. */
static void learn(const current_control_t *control, current_control_channel_t *c,
                  int16_t measured_ma)
{
    if (measured_ma > MEASURED_LIMIT_MA) {
        measured_ma = MEASURED_LIMIT_MA;
    } else if (measured_ma < -MEASURED_LIMIT_MA) {
        measured_ma = -MEASURED_LIMIT_MA;
    }
    uint32_t given_q16 = ((uint32_t)c->duty << 16) - (uint32_t)control->offset_q16;
    int16_t error_q8 = to_q8((int32_t)fixed_point_mac_s16_u16(
        given_q16, (int16_t)-measured_ma, loop_gain_q16(c->estimate_q16, c->trim_q24)));
    const bool ends = measured_ma >= SENSOR_END_MA;
    uint16_t integral_q16 = ends ? UINT16_MAX : control->integral_q16;
    uint8_t firsts = (uint8_t)((uint16_t)((uint16_t)(c->reference_ma - 1u) << 1) >> 8);
    for (firsts = ends ? firsts >> 1 : firsts; firsts != 0; firsts >>= 1) {
        integral_q16 >>= 1;
    }
    int32_t step_q23 = (int32_t)fixed_point_mac_s16_u16(0, error_q8, integral_q16) >> 8;
    int32_t kept_q24 = ends && c->trim_q24 > 0 ? 0 : c->trim_q24;
    /* 1 / FIRST_MA is 2 / 256 */
    c->trim_q24 = limited(kept_q24 + 2 * step_q23, control->trim_limit_q24);
    INVARIANT(c->trim_q24 <= control->trim_limit_q24 && c->trim_q24 >= -control->trim_limit_q24);
}

static uint16_t give(const current_control_t *control, current_control_channel_t *c)
{
    uint32_t wanted_q16 =
        fixed_point_mac_u16((uint32_t)control->offset_q16 + c->residue_q16, c->reference_ma,
                            loop_gain_q16(c->estimate_q16, c->trim_q24));
    uint16_t duty = (uint16_t)(wanted_q16 >> 16);
    uint16_t most = control->parameters.maximum_duty_steps;
    if (duty < most) {
        c->residue_q16 = (uint16_t)wanted_q16;
    } else {
        duty = most;
    }
    c->duty = duty;
    INVARIANT(duty <= most && most <= CURRENT_CONTROL_DUTY_STEPS);
    return duty;
}

/* What is not learnt yet at least halves from one rise to the next: so the reference may double. */
static uint16_t raised_ma(const current_control_t *control, uint16_t reference_ma,
                          uint16_t target_ma)
{
    uint16_t rise_ma = reference_ma == 0 ? FIRST_MA : reference_ma;
    uint16_t slew_ma = (uint16_t)(control->parameters.slew_ma_per_tick * 2u);
    if (rise_ma > slew_ma) {
        rise_ma = slew_ma;
    }
    uint16_t left_ma = (uint16_t)(target_ma - reference_ma);
    return left_ma < rise_ma ? target_ma : (uint16_t)(reference_ma + rise_ma);
}

void current_control_tick(current_control_t *control, uint8_t channels, const uint16_t target_ma[],
                          const int16_t measured_ma[], const bool valid[], bool may_rise,
                          uint16_t duty[])
{
    bool turn = !control->even_turn;
    control->even_turn = turn;
    uint16_t small_ma = control->parameters.slew_ma_per_tick;
    if (small_ma > SMALL_MA) {
        small_ma = SMALL_MA;
    }
    current_control_channel_t *c = control->channel;
    for (; channels != 0; channels--, c++, duty++, measured_ma++, turn = !turn) {
        bool knows = *valid++;
        if (knows) {
            c->blind_ticks = 0;
        } else if (c->blind_ticks < UINT8_MAX) {
            c->blind_ticks++;
        }
        uint16_t wanted_ma = *target_ma++;
        if (wanted_ma > control->parameters.maximum_current_ma) {
            wanted_ma = control->parameters.maximum_current_ma;
        }
        uint16_t reference_ma = c->reference_ma;
        if (wanted_ma == 0 || c->blind_ticks > control->parameters.hold_ticks) {
            c->reference_ma = 0;
            c->residue_q16 = 0;
            c->duty = 0;
            *duty = 0;
            continue;
        }
        bool learns = turn && knows && !c->fell;
        if (learns && reference_ma != 0) {
            learn(control, c, *measured_ma);
        }
        uint16_t next_ma = reference_ma;
        if (wanted_ma < reference_ma) {
            next_ma = wanted_ma;
        } else if (knows && may_rise) {
            uint16_t rise_ma = (uint16_t)(wanted_ma - reference_ma);
            if (rise_ma <= small_ma && reference_ma != 0) {
                next_ma = wanted_ma;
            } else if (learns) {
                next_ma = raised_ma(control, reference_ma, wanted_ma);
            }
        }
        c->fell = reference_ma > (uint16_t)(next_ma + SMALL_MA);
        if (next_ma == reference_ma && !turn) {
            *duty = c->duty;
            continue;
        }
        c->reference_ma = next_ma;
        *duty = next_ma == 0 ? 0 /* not started yet */ : give(control, c);
    }
}

uint16_t current_control_duty(const current_control_t *control, uint8_t channel)
{
    return control->channel[channel].duty;
}

uint16_t current_control_reference_ma(const current_control_t *control, uint8_t channel)
{
    return control->channel[channel].reference_ma;
}

uint16_t current_control_gain_q16(const current_control_t *control, uint8_t channel)
{
    const current_control_channel_t *c = &control->channel[channel];
    return loop_gain_q16(c->estimate_q16, c->trim_q24);
}
