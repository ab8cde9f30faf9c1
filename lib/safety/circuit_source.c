#include "circuit_source.h"

#include <math.h>

#define DUTY_STEPS 800.0f
/* A window's variance, mV^2: not of noise, but of what wiring and gains make of it. */
#define WINDOW_MV2  3000.0f
#define MOVES_PART  0.02f /* of the supply, from round to round: within one it is what all share */
#define MOST_BEFORE 30.0f /* windows: four rounds of nine springs */
#define MOST_SQUARE 200000.0f /* steps^2: some heatings */
/* Deviations of what is declared. */
#define SUPPLY_PART   0.08f
#define DROP_MV       75.0f
#define UNDECLARED_MV 300.0f
/* A supply that steps looks like as much of a drop, until it is learnt. */
#define DRIVEN_MV 100.0f
/* Another belief begins here. */
#define LEAST_DROP_MV  20.0f
#define UNSURE_PART    0.25f
#define LEAST_LEVEL_MV 5.0f
#define LEVEL_PART     0.03f
/* What no circuit gives, but RAM that has changed by itself. */
#define MOST_MV       20000.0f
#define MOST_STEP_MV2 (40.0f * MOST_SQUARE)

/* What is no number counts as the least. */
static float within(float value, float least, float most)
{
    return value > most ? most : value >= least ? value : least;
}

/* From 0. */
static float up_to(float most, float value)
{
    return within(value, 0.0f, most);
}

static bool is_near(float value, float to, float by)
{
    return fabsf(value - to) <= by;
}

/* What fits best: two equations, for the voltage of a step of the duty and for the drop; of how
 * both moved, of their means, of the declared supply, which is all steps less the drop, and of the
 * declared drop. */
static bool believe(circuit_source_t *s, const current_control_parameters_t *p)
{
    const bool told = p->freewheel_mv != 0;
    const float supply_mv = (float)p->supply_mv, drop_mv = (float)p->freewheel_mv;
    const float supply_deviation_mv = SUPPLY_PART * supply_mv;
    const float drop_deviation_mv = told ? DROP_MV : UNDECLARED_MV;
    const float by_supply = WINDOW_MV2 / (supply_deviation_mv * supply_deviation_mv);
    const float by_drop = WINDOW_MV2 / (drop_deviation_mv * drop_deviation_mv);
    const float mean = s->mean_duty, rest = DUTY_STEPS - mean;
    const float square = s->before * mean * mean + by_supply * DUTY_STEPS * DUTY_STEPS;
    const float mixed = s->before * mean + by_supply * DUTY_STEPS;
    const float by_step_mv =
        s->duty_mv + s->before * mean * s->mean_mv + by_supply * DUTY_STEPS * supply_mv;
    const float by_drop_mv = by_drop * drop_mv - by_supply * supply_mv - s->before * s->mean_mv;
    const float share = 1.0f / (s->duty_square * (s->before + by_supply + by_drop) +
                                s->before * by_supply * rest * rest + by_drop * square);
    const float all = s->duty_square + square;
    const float reach_mv =
        told ? (float)CIRCUIT_SOURCE_DROP_MV : (float)CIRCUIT_SOURCE_UNDECLARED_MV;
    const float least_mv = up_to(MOST_MV, drop_mv - reach_mv), most_mv = drop_mv + reach_mv;
    const float found_drop_mv =
        within(share * (all * by_drop_mv + mixed * by_step_mv), least_mv, most_mv);
    const float found_mv =
        within(DUTY_STEPS * (by_step_mv + mixed * found_drop_mv) / all - found_drop_mv,
               0.01f * (float)CIRCUIT_SOURCE_LEAST_PERCENT * supply_mv,
               0.01f * (float)CIRCUIT_SOURCE_MOST_PERCENT * supply_mv);
    s->unsure_mv = 2.0f * sqrtf(WINDOW_MV2 * share * all);
    const float more_mv = found_drop_mv - drop_mv - s->unsure_mv;
    s->more_drop_v = more_mv > 0.0f ? 1e-3f * more_mv : 0.0f;
    const float beside_mv = within(s->unsure_mv, DRIVEN_MV, MOST_MV);
    s->driven_drop_mv =
        (uint16_t)(is_near(found_drop_mv, drop_mv, beside_mv) ? drop_mv : found_drop_mv);
    const float found_step_mv = (1.0f / DUTY_STEPS) * (found_mv + found_drop_mv);
    const float drop_change_mv = within(UNSURE_PART * s->unsure_mv, LEAST_DROP_MV, MOST_MV);
    const float level_mv = found_step_mv * mean - found_drop_mv;
    const bool stays =
        is_near(found_drop_mv, s->drop_mv, drop_change_mv) &&
        is_near(level_mv, s->step_mv * mean - s->drop_mv, LEAST_LEVEL_MV + LEVEL_PART * s->mean_mv);
    if (!stays) {
        s->drop_mv = found_drop_mv;
        s->step_mv = found_step_mv;
    }
    s->less_mv = up_to(s->unsure_mv, s->drop_mv - least_mv);
    s->more_mv = up_to(s->unsure_mv, most_mv - s->drop_mv);
    s->dead_steps = (uint16_t)up_to(DUTY_STEPS, (s->drop_mv + s->more_mv) / s->step_mv);
    return !stays;
}

float circuit_source_supply_mv(const circuit_source_t *source)
{
    return DUTY_STEPS * source->step_mv - source->drop_mv;
}

void circuit_source_begin(circuit_source_t *source, const current_control_parameters_t *circuit)
{
    *source =
        (circuit_source_t){.drop_mv = (float)circuit->freewheel_mv,
                           .step_mv = (1.0f / DUTY_STEPS) *
                                      (float)((int32_t)circuit->supply_mv + circuit->freewheel_mv)};
    (void)believe(source, circuit);
}

void circuit_source_take(circuit_source_t *source, float duty, float voltage_mv)
{
    source->duty_square += duty * duty; /* fit takes the means off */
    source->duty_mv += duty * voltage_mv;
    source->windows++;
    source->duty += duty;
    source->voltage_mv += voltage_mv;
}

/* At that duty all before explain another voltage, whatever of the drop is not known: the supply
 * has stepped by more than a deviation of what is declared. */
static bool has_stepped(const circuit_source_t *s, float duty, float mv)
{
    const float mean = up_to(DUTY_STEPS, s->mean_duty), more_duty = duty - mean;
    const float expected_mv = up_to(MOST_MV, s->mean_mv) + up_to(MOST_MV, s->step_mv) * more_duty;
    const float off_mv = fabsf(mv - expected_mv) - SUPPLY_PART * expected_mv - LEAST_DROP_MV;
    return off_mv * mean > up_to(MOST_MV, s->unsure_mv) * fabsf(more_duty);
}

bool circuit_source_fit(circuit_source_t *s, const current_control_parameters_t *circuit)
{
    if (s->windows == 0) {
        return false;
    }
    const float windows = (float)s->windows, share = 1.0f / windows;
    const float now_duty = up_to(DUTY_STEPS, share * s->duty);
    const float now_mv = up_to(MOST_MV, share * s->voltage_mv);
    s->duty_square -= share * s->duty * s->duty;
    s->duty_mv -= share * s->duty * s->voltage_mv;
    if (has_stepped(s, now_duty, now_mv)) {
        s->before = s->duty_square = s->duty_mv = 0.0f;
    }
    const float before = up_to(MOST_BEFORE, s->before), part = windows / (before + windows);
    const float duty = now_duty - s->mean_duty;
    const float mv = now_mv - s->mean_mv;
    s->mean_duty = up_to(DUTY_STEPS, s->mean_duty + part * duty);
    s->mean_mv = up_to(MOST_MV, s->mean_mv + part * mv);
    s->before = within(before + windows, before, MOST_BEFORE);
    const float moves_mv = MOVES_PART * s->mean_mv;
    const float weight = part * before / (1.0f + part * before * moves_mv * moves_mv / WINDOW_MV2);
    const float square = up_to(2.0f * MOST_SQUARE, s->duty_square + weight * duty * duty);
    const float kept = square > MOST_SQUARE ? MOST_SQUARE / square : 1.0f;
    s->duty_square = kept * square;
    s->duty_mv = within(kept * (s->duty_mv + weight * duty * mv), -MOST_STEP_MV2, MOST_STEP_MV2);
    s->windows = 0;
    s->duty = 0.0f;
    s->voltage_mv = 0.0f;
    return believe(s, circuit);
}
