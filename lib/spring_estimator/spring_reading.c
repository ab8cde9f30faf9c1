#include <math.h>

#include "spring_estimator_internal.h"

#define LEAST_READINGS 4
/* mV, for a mA and ohm, over steps of 4 mV; of a gain in Q16. */
#define STEPS_PER_OHM_AND_GAIN (65536.0f / 4.0f)
#define SENSOR_STEPS_MOST      100.0f
#define GAIN_TOLERANCE         0.02f
#define COARSE_MOST            13.0f /* 0.1 mV: of steps of 4 mV, 1 / pi */
#define COVERED                0.32f /* 1 / pi: less of a step is as none */
#define LEAST_MEAN_MA          50u
/* 0.02 ohm: no spring, but a sensor's offset in one that gets nothing, or a short */
#define LEAST_MA_PER_MV 50u
#define SETTLING_TICKS  8
#define NOISE_MOST      0.05f
#define NOISE_SHARE     0.06f
#define BEND_TO_SD      0.512f /* mean size of a second difference: 1 / (sqrt(6) sqrt(2 / pi)) */
#define SAME_CURRENT    0.1f /* currents that differ by less of them show a sensor's offset alike */
/* Of a resistance in a turn. */
#define JUMP_OF_HOLD 0.01f /* 0.4 W change 1 % of the phase, 0.3 % of it */
#define JUMP_OF_LOAD 0.08f /* 16 K at once, latent heat kept: 40 % of the phase */
#define JUMP_TURNS   1024u /* a jump is forgotten in four minutes, one after the other */
/* One jump has moved it, two went and came back: a third will come. */
#define LOOSE_TURNS (2u * JUMP_TURNS)

void spring_estimator_disturb(spring_estimator_t *e, uint8_t k)
{
    spring_belief_t *b = &e->spring[k];
    b->settling = SETTLING_TICKS;
    b->cut_short = true;
    b->current_sum_ma = b->voltage_sum_mv = 0;
    b->readings = 0;
}

/* Averaged over a sweep of voltages, evenly, what rounding to steps leaves has an amplitude of
 * 1 / pi of a step, times sin(pi x) / (pi x), where the sweep covers x of a step and what is left
 * of each of its own steps; the converter's noise leaves half of that. Two averages may differ by
 * twice it. */
void spring_estimator_sweep(spring_estimator_t *e, uint8_t k, uint16_t gain_q16, uint16_t sweep_ma)
{
    spring_belief_t *b = &e->spring[k];
    const float sensor_steps =
        fminf(STEPS_PER_OHM_AND_GAIN * b->ohm / (float)gain_q16, SENSOR_STEPS_MOST);
    const float off = sensor_steps - (float)(uint8_t)(sensor_steps + 0.5f);
    const float surely_off = fabsf(off) - GAIN_TOLERANCE * sensor_steps;
    const float covers = surely_off * (float)gain_q16 * (float)sweep_ma * (1.0f / 65536.0f);
    b->coarse = (uint8_t)(COARSE_MOST * COVERED / fmaxf(covers, COVERED)) & 15u;
}

void spring_jump(spring_belief_t *b, float by)
{
    b->slow_ohm *= by;
    if (b->heating) {
        b->run.heat.mark_ohm *= by;
        b->run.heat.sum_ohm *= by;
        b->run.heat.onset_ohm *= by;
        b->run.heat.cold_ohm *= by;
    } else if (b->run.line.ohm > 0.0f) {
        b->run.line.ohm *= by;
        b->run.line.was_ohm[0] = b->run.line.was_ohm[1] = 0.0f;
        b->slow_ohm = b->run.line.ohm * (1.0f + b->run.line.rise_per_k * b->run.line.slow_k);
    }
    b->learnt.austenite_ohm *= by;
    b->learnt.martensite_ohm *= by;
    b->ohm_before[0] = b->ohm_before[1] = 0.0f;
}

static void note_jump(spring_estimator_t *e, const thermal_model_t *model, uint8_t k, float by,
                      float noise)
{
    const spring_before_t before = spring_before(&e->spring[k], model, k);
    spring_note(e, model, k, SPRING_SIGHT_JUMPED, &before, 0.0f, 0.0f);
    spring_note_read(e, k, by, noise);
}

/* In a hold no phase changes so fast: it is a contact or the sensor. A turn in which it may have
 * jumped half way is left out. */
static bool leave_out(spring_estimator_t *e, const thermal_model_t *model, uint8_t k, float ohm,
                      float current_a)
{
    spring_belief_t *b = &e->spring[k];
    const float was_ohm = b->slow_ohm;
    const float step = ohm - was_ohm;
    if (b->heating || b->possible != SPRING_PHASE_AUSTENITE || b->run.line.ohm <= 0.0f ||
        fabsf(step) <= JUMP_OF_HOLD * was_ohm || b->fresh == 0) {
        b->odd = false;
        return false;
    }
    /* no hold gains phase at once; it loses it by a load, where no contact has moved lately */
    const bool by_load = step * b->learnt.change < 0.0f && b->unsteady == 0;
    const float noise = b->noise * fmaxf(b->current_a / current_a, 1.0f); /* it is the voltage's */
    const float most = (by_load ? JUMP_OF_LOAD : JUMP_OF_HOLD) + SURE_SDS * noise +
                       spring_offset_may_show(b, was_ohm, b->run.line.a, current_a);
    const bool jumps = current_a > WEAK_A && fabsf(step) > most * was_ohm;
    if (jumps && b->odd) {
        spring_jump(b, ohm / was_ohm);
        note_jump(e, model, k, step / was_ohm, noise);
    }
    b->odd = jumps && !b->odd;
    if (b->odd && !spring_is_loose(b)) {
        b->unsteady = (uint16_t)(b->unsteady + JUMP_TURNS);
        if (spring_is_loose(b)) {
            note_jump(e, model, k, step / was_ohm, noise);
            spring_note_did(e, k, SPRING_DID_BLIND);
        }
    }
    return b->odd;
}

void spring_misread(spring_estimator_t *e, const thermal_model_t *model, uint8_t k, float by,
                    float noise)
{
    spring_belief_t *b = &e->spring[k];
    spring_jump(b, 1.0f + by);
    b->unsteady = (uint16_t)(b->unsteady + JUMP_TURNS);
    note_jump(e, model, k, by, noise);
    spring_note_did(e, k, spring_is_loose(b) ? SPRING_DID_BLIND : 0);
}

bool spring_is_loose(const spring_belief_t *b)
{
    return b->unsteady > LOOSE_TURNS;
}

/* Second differences of turns at the same current: neither a level nor a slope shows in them. */
static void take_noise(spring_belief_t *b, float ohm, float current_a)
{
    const bool same = fabsf(current_a - b->current_a) < SAME_CURRENT * current_a;
    if (!same && b->fresh != 0) { /* it is one of the voltage */
        b->noise = fminf(b->noise * b->current_a / current_a, NOISE_MOST);
    }
    if (same && b->ohm_before[1] > 0.0f) {
        const float bend = fabsf(ohm - 2.0f * b->ohm_before[0] + b->ohm_before[1]) / ohm;
        b->noise += (fminf(BEND_TO_SD * bend, NOISE_MOST) - b->noise) * NOISE_SHARE;
    }
    b->ohm_before[1] = same && !b->unread ? b->ohm_before[0] : 0.0f;
    b->ohm_before[0] = ohm;
}

static float take_reading(spring_belief_t *b, float ohm, float current_a)
{
    take_noise(b, ohm, current_a);
    b->averaged = b->fresh == 0 ? 0 : b->averaged;
    b->averaged = b->averaged < SLOW_TURNS ? (uint8_t)(b->averaged + 1) : SLOW_TURNS;
    const float share = b->averaged < SLOW_TURNS ? 1.0f / (float)b->averaged : SLOW_SHARE;
    b->slow_ohm += (ohm - b->slow_ohm) * share;
    b->slow_a += (current_a - b->slow_a) * share;
    b->unread = false;
    b->current_a = current_a;
    b->ohm = ohm;
    b->phase_ohm = current_a > STRONG_A || b->fresh == 0 ? ohm : b->phase_ohm;
    b->fresh = b->fresh < UINT8_MAX ? (uint8_t)(b->fresh + 1) : UINT8_MAX;
    return share;
}

float spring_take_readings(spring_estimator_t *e, const thermal_model_t *model, uint8_t k)
{
    spring_belief_t *b = &e->spring[k];
    float share = SLOW_SHARE;
    b->unsteady = b->unsteady > 0 ? (uint16_t)(b->unsteady - 1) : 0;
    if (b->cut_short) {
        b->quiet = 0;
        b->ohm_before[1] = 0.0f;
    }
    b->reads = b->readings >= LEAST_READINGS && b->current_sum_ma >= LEAST_MEAN_MA * b->readings &&
               (uint32_t)b->voltage_sum_mv * LEAST_MA_PER_MV > b->current_sum_ma;
    if (b->reads) {
        const float offset_mv = 1e3f * b->learnt.offset_v * (float)b->readings;
        const float ohm = ((float)b->voltage_sum_mv - offset_mv) / (float)b->current_sum_ma;
        const float current_a = (float)b->current_sum_ma * 1e-3f / (float)b->readings;
        if (!leave_out(e, model, k, ohm, current_a)) {
            share = take_reading(b, ohm, current_a);
        }
    } else {
        b->unread = true;
        b->ohm_before[1] = 0.0f;
        if (b->current_sum_ma < LEAST_MEAN_MA && !b->cut_short) {
            b->fresh = 0; /* no current, or no sensor */
        }
    }
    b->cut_short = false;
    b->current_sum_ma = b->voltage_sum_mv = 0;
    b->readings = 0;
    return share;
}
