#include "spring_estimator.h"

#include <math.h>

#define LEAST_READINGS 4
#define SETTLING_TICKS 8

/* Tolerances of what is declared, as standard deviations: 15 and 30 % at the ends of a uniform spread. */
#define CAPACITY_SD      0.09f
#define LOSS_SD          0.12f
#define LOSS_MOST        0.45f
#define START_SD_K       3.0f /* at power-on, cold */

/* The largest temperature coefficient of any NiTi in print, and some more for a heat capacity below the declared one. */
#define COEFFICIENT_MOST 0.0018f
#define STEP_K           3.0f  /* of heat between two comparisons */
#define CHANGE_LEAST     0.03f /* of resistance: less is no transformation to be seen */
#define STRONG_A         0.9f

#define LINE_TURNS   240.0f /* 60 s: what the line follows */
#define LOSS_STEP    0.0012f
#define QUIET_TURNS  24

static float clampf(float v, float lo, float hi) { return v < lo ? lo : v > hi ? hi : v; }

static float now_c(const thermal_model_t *model, uint8_t k)
{
    return (float)thermal_model_temperature_c7(model, k) * (1.0f / 128.0f);
}

static int16_t as_c7(float c) { return (int16_t)(c * 128.0f); }

static float ambient_c(const thermal_model_t *model) { return (float)model->ambient_c7 * (1.0f / 128.0f); }

void spring_estimator_init(spring_estimator_t *e, uint8_t springs)
{
    *e = (spring_estimator_t){.springs = springs};
}

void spring_estimator_prepare(spring_estimator_t *e, const thermal_model_t *model)
{
    const thermal_model_parameters_t *p = &model->parameters;
    e->heat_capacity_j_per_k = (float)p->heat_capacity_mj_per_k * 1e-3f;
    e->loss_w_per_k = (float)p->loss_uw_per_k * 1e-6f;
    e->martensite_ohm = (float)p->resistance_martensite_uohm * 1e-6f;
    e->change = 1.0f - (float)p->resistance_martensite_uohm / (float)p->resistance_austenite_uohm;
    e->martensite_finish_c = (float)p->martensite_finish_cc * 0.01f;
    e->martensite_start_c = (float)p->martensite_start_cc * 0.01f;
    e->austenite_start_c = (float)p->austenite_start_cc * 0.01f;
    e->austenite_finish_c = (float)p->austenite_finish_cc * 0.01f;
    for (uint8_t k = 0; k < e->springs; k++) {
        spring_belief_t *b = &e->spring[k];
        if (b->loss_variance == 0.0f) {
            b->loss_variance = LOSS_SD * LOSS_SD * e->loss_w_per_k * e->loss_w_per_k;
            b->variance_k2 = START_SD_K * START_SD_K;
            b->possible = SPRING_PHASE_MARTENSITE;
            b->last_c = now_c(model, k);
            b->learnt.change = e->change;
        }
    }
}

void spring_estimator_disturb(spring_estimator_t *e, uint8_t k)
{
    spring_belief_t *b = &e->spring[k];
    b->settling = SETTLING_TICKS;
    b->current_sum_ma = b->voltage_sum_mv = 0;
    b->readings = 0;
    b->quiet = 0;
}

static void take_reading(spring_belief_t *b)
{
    b->read = false;
    if (b->readings < LEAST_READINGS || b->current_sum_ma < 50u * b->readings) {
        if (b->current_sum_ma == 0) {
            b->fresh = 0;
        }
    } else {
        const float r = (float)b->voltage_sum_mv / (float)b->current_sum_ma;
        b->current_a = (float)b->current_sum_ma * 1e-3f / (float)b->readings;
        if (b->fresh == 0) {
            b->slow_ohm = r;
        }
        b->fresh = b->fresh < 255 ? (uint8_t)(b->fresh + 1) : 255;
        b->slow_ohm += (r - b->slow_ohm) * 0.125f;
        b->resistance_ohm = r;
        b->read = true;
    }
    b->current_sum_ma = b->voltage_sum_mv = 0;
    b->readings = 0;
}

static void set_temperature(thermal_model_t *model, uint8_t k, float c, uint8_t phase,
                            const spring_estimator_t *e)
{
    if (phase == SPRING_PHASE_AUSTENITE) {
        thermal_model_set_temperature(model, k, as_c7(e->austenite_finish_c + 1.0f));
    } else if (phase == SPRING_PHASE_MARTENSITE) {
        thermal_model_set_temperature(model, k, as_c7(e->martensite_finish_c - 1.0f));
    }
    thermal_model_set_temperature(model, k, as_c7(c));
}

/* The spring is seen at a temperature of its transformation: the one update law of temperature and loss. */
static float see(const spring_estimator_t *e, spring_belief_t *b, const thermal_model_t *model,
                 uint8_t k, float seen_c, float sd_k)
{
    const float s = b->variance_k2 + sd_k * sd_k;
    const float gain = b->variance_k2 / s;
    const float loss_gain = b->covariance / s;
    const float error = seen_c - now_c(model, k);
    b->learnt.extra_loss_w_per_k =
        clampf(b->learnt.extra_loss_w_per_k + loss_gain * error, -LOSS_MOST * e->loss_w_per_k,
               LOSS_MOST * e->loss_w_per_k);
    b->loss_variance -= loss_gain * b->covariance;
    b->covariance *= 1.0f - gain;
    b->variance_k2 *= 1.0f - gain;
    return now_c(model, k) + gain * error;
}

static float own_loss_w(const spring_belief_t *b, const thermal_model_t *model, float c)
{
    return b->learnt.extra_loss_w_per_k * (c - ambient_c(model));
}

/* Error of temperature and loss over one turn; returns the heat taken up, K of heat capacity. */
static float predict(const spring_estimator_t *e, spring_belief_t *b, const thermal_model_t *model,
                     uint8_t k, float power_w)
{
    const float c = now_c(model, k);
    const float hold_w = 1e-6f * (float)thermal_model_power_to_hold_uw(model, k, as_c7(c));
    const float stiff =
        1e-6f * 0.125f *
            (float)(thermal_model_power_to_hold_uw(model, k, as_c7(c + 8.0f)) - (int32_t)(1e6f * hold_w)) +
        b->learnt.extra_loss_w_per_k;
    const float per_w = SPRING_ESTIMATOR_TURN_S / e->heat_capacity_j_per_k;
    const float phi = 1.0f - per_w * stiff;
    const float coupling = -per_w * (c - ambient_c(model));
    const float moved = c - b->last_c;
    b->variance_k2 = phi * phi * b->variance_k2 + 2.0f * phi * coupling * b->covariance +
                     coupling * coupling * b->loss_variance;
    b->covariance = phi * b->covariance + coupling * b->loss_variance;
    const float rise_sd = CAPACITY_SD * fabsf(moved);
    b->variance_k2 += 2.0f * sqrtf(b->variance_k2) * rise_sd + rise_sd * rise_sd;
    b->last_c = c;
    return per_w * (power_w - hold_w - own_loss_w(b, model, c));
}

void spring_estimator_begin_heating(spring_estimator_t *e, const thermal_model_t *model, uint8_t k)
{
    spring_belief_t *b = &e->spring[k];
    (void)model;
    b->heat_k = b->mark_k = 0.0f;
    b->mark_ohm = b->onset_ohm = b->cold_ohm = 0.0f;
    b->steep = b->flat = 0;
    if (b->possible == SPRING_PHASE_AUSTENITE) {
        b->possible = SPRING_PHASE_BETWEEN | SPRING_PHASE_AUSTENITE;
    }
    b->line_ohm = 0.0f;
}

/* Slope of the resistance over heat: more than any temperature coefficient is a transformation. */
static void compare(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model, uint8_t k)
{
    const float c = now_c(model, k);
    if (b->cold_ohm == 0.0f) {
        b->cold_ohm = b->resistance_ohm;
        b->cold_c = c;
    }
    if (b->mark_ohm == 0.0f) {
        b->mark_ohm = b->resistance_ohm;
        b->mark_k = b->heat_k;
        return;
    }
    const float heat_k = b->heat_k - b->mark_k;
    if (heat_k < STEP_K) {
        return;
    }
    const float per_k = (b->resistance_ohm / b->mark_ohm - 1.0f) / heat_k;
    if (fabsf(per_k) > COEFFICIENT_MOST) {
        if (b->steep == 0) {
            b->onset_ohm = b->mark_ohm;
        }
        b->steep = b->steep < 255 ? (uint8_t)(b->steep + 1) : 255;
        b->flat = 0;
        if (b->steep == 2) { /* two comparisons are 6 K of heat, 1.5 K of temperature */
            b->possible = SPRING_PHASE_BETWEEN;
            if (b->cold_ohm > 0.0f && c > b->cold_c + 20.0f) {
                const float rise = (b->onset_ohm / b->cold_ohm - 1.0f) / (c - b->cold_c);
                b->learnt.martensite_rise_per_k = rise;
                b->learnt.martensite_ohm = b->cold_ohm / (1.0f + rise * (b->cold_c - 20.0f));
            }
            set_temperature(model, k, see(e, b, model, k, e->austenite_start_c + 2.0f, 3.0f),
                            SPRING_PHASE_MARTENSITE, e);
        }
        if (b->steep >= 2 && now_c(model, k) > e->austenite_finish_c - 1.0f) {
            set_temperature(model, k, e->austenite_finish_c - 1.0f, SPRING_PHASE_MARTENSITE, e);
        }
    } else if (b->steep == 1) {
        b->steep = 0;
    } else if (b->steep >= 2) {
        b->flat++;
        if (b->flat >= 2 && fabsf(b->resistance_ohm / b->onset_ohm - 1.0f) > CHANGE_LEAST) {
            b->possible = SPRING_PHASE_AUSTENITE;
            b->blind = false;
            b->learnt.austenite_ohm = b->resistance_ohm;
            if (fabsf(1.0f - b->onset_ohm / b->resistance_ohm) > 0.5f * fabsf(b->learnt.change)) {
                b->learnt.change = 1.0f - b->onset_ohm / b->resistance_ohm;
            }
            set_temperature(model, k, see(e, b, model, k, e->austenite_finish_c + 4.0f, 3.0f),
                            SPRING_PHASE_AUSTENITE, e);
            b->lost = 0.0f;
            b->crossings = 0;
        }
    }
    b->mark_ohm = b->resistance_ohm;
    b->mark_k = b->heat_k;
}

/* Phase is lost where the resistance leaves what it read while it was kept: martensite start. */
static void watch(spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model, uint8_t k, float moved_k)
{
    if (fabsf(moved_k) > 0.08f) {
        b->quiet = 0;
    } else if (b->quiet < 255) {
        b->quiet++;
    }
    if (b->quiet < QUIET_TURNS) {
        if (b->quiet == 0) {
            b->slow_ohm = b->resistance_ohm;
        }
        return;
    }
    if (b->quiet == QUIET_TURNS || b->line_ohm == 0.0f) {
        b->line_ohm = b->slow_ohm;
        b->line_c = now_c(model, k);
        b->losing = 0;
        return;
    }
    const float turn = (b->resistance_ohm - b->slow_ohm) / b->slow_ohm;
    b->noise += (fabsf(turn) - b->noise) * 0.03f;
    const float rise = b->learnt.martensite_rise_per_k;
    const float c = now_c(model, k);
    const float line = b->line_ohm * (1.0f + rise * (c - b->line_c));
    const float left = b->slow_ohm / line - 1.0f;
    float lost = -left / b->learnt.change;
    b->line_ohm += b->line_ohm * left / LINE_TURNS;
    const float step = fmaxf(LOSS_STEP, 1.5f * b->noise) / fabsf(b->learnt.change);
    b->losing = lost > 0.6f * step ? (uint8_t)(b->losing < 255 ? b->losing + 1 : 255) : 0;
    if (lost > step && b->losing >= 2) {
        const float width_k = e->martensite_start_c - e->martensite_finish_c;
        if (lost > 0.04f) {
            b->variance_k2 += 25.0f;
        }
        const float depth_k = width_k * sqrtf(lost) * 0.64f;
        set_temperature(model, k, see(e, b, model, k, e->martensite_start_c - depth_k, 1.0f),
                        SPRING_PHASE_AUSTENITE, e);
        b->last_c = now_c(model, k);
        b->lost += lost;
        b->crossings = b->crossings < 255 ? (uint8_t)(b->crossings + 1) : 255;
        b->quiet = 0;
        b->losing = 0;
    }
}

void spring_estimator_update(spring_estimator_t *e, thermal_model_t *model, uint8_t k)
{
    spring_belief_t *b = &e->spring[k];
    const float before_c = b->last_c;
    take_reading(b);
    const float power_w = b->read ? b->current_a * b->current_a * b->resistance_ohm : 0.0f;
    const float heat_k = predict(e, b, model, k, power_w);
    const float moved_k = b->last_c - before_c;
    if (heat_k > 0.2f) {
        b->heat_k += heat_k;
        if (b->read && b->current_a > STRONG_A) {
            compare(e, b, model, k);
        }
    } else {
        b->mark_ohm = 0.0f;
    }
    if (b->possible == SPRING_PHASE_AUSTENITE && b->read && !b->blind) {
        watch(e, b, model, k, moved_k);
    }
    /* colder than martensite finish for certain */
    if (now_c(model, k) + 2.0f * sqrtf(b->variance_k2) < e->martensite_finish_c) {
        b->possible = SPRING_PHASE_MARTENSITE;
    }
}

bool spring_estimator_sees(const spring_estimator_t *e, uint8_t k)
{
    const spring_belief_t *b = &e->spring[k];
    return b->read && !b->blind;
}

float spring_estimator_sd_k(const spring_estimator_t *e, uint8_t k)
{
    return sqrtf(e->spring[k].variance_k2);
}

bool spring_estimator_has_transformed(const spring_estimator_t *e, const thermal_model_t *model, uint8_t k)
{
    const spring_belief_t *b = &e->spring[k];
    return b->possible == SPRING_PHASE_AUSTENITE ||
           now_c(model, k) - 1.3f * sqrtf(b->variance_k2) > e->austenite_finish_c;
}

float spring_estimator_phase(const spring_estimator_t *e, const thermal_model_t *model, uint8_t k)
{
    const spring_belief_t *b = &e->spring[k];
    if (b->possible == SPRING_PHASE_AUSTENITE) {
        return clampf(1.0f - b->lost, 0.0f, 1.0f);
    }
    if (b->read && b->onset_ohm > 0.0f && b->steep >= 2 && !b->blind) {
        return clampf((1.0f - b->onset_ohm / b->resistance_ohm) / b->learnt.change, 0.0f, 1.0f);
    }
    return (float)thermal_model_austenite(model, k) / 32768.0f;
}

uint32_t spring_estimator_model_power_uw(const spring_estimator_t *e, const thermal_model_t *model, uint8_t k,
                                         uint32_t power_uw)
{
    const float extra = 1e6f * own_loss_w(&e->spring[k], model, now_c(model, k));
    const float p = (float)power_uw - extra;
    return p <= 0.0f ? 0 : (uint32_t)p;
}

float spring_estimator_hold_w(const spring_estimator_t *e, const thermal_model_t *model, uint8_t k, float c)
{
    return 1e-6f * (float)thermal_model_power_to_hold_uw(model, k, as_c7(c)) + own_loss_w(&e->spring[k], model, c);
}

uint16_t spring_estimator_current_ma(const spring_estimator_t *e, uint8_t k, float power_w)
{
    const spring_belief_t *b = &e->spring[k];
    const float r = b->slow_ohm > 0.05f ? b->resistance_ohm : e->martensite_ohm;
    if (power_w <= 0.0f) {
        return 0;
    }
    const float ma = 1000.0f * sqrtf(power_w / r);
    return ma > 3200.0f ? 3200 : (uint16_t)ma;
}
