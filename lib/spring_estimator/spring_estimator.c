#include "spring_estimator.h"

#include <math.h>
#include <stdio.h>

#include "spring_estimator_internal.h"

#define LEAST_READINGS    4
#define LEAST_MEAN_MA     50u
#define SETTLING_TICKS    8
#define SLOW_SHARE        0.0625f /* of a turn in the average: 4 s, six periods of the dither */
#define NOISE_FIRST       0.002f
#define NOISE_MOST        0.05f
#define NOISE_SHARE       0.06f
#define NOISE_SAME        0.1f /* a current that has moved by more tells nothing of the noise */
#define THIRD_DIFFERENCES 2.449f /* sqrt(6): of a second difference over one reading's */

/* Standard deviations of a uniform tolerance of 15 and 20 %. */
#define CAPACITY_SD       0.09f
#define LOSS_SD           0.12f
#define LOSS_MOST         0.45f /* of the declared loss: no more is ever believed */
#define LOSS_DRIFT_SD     0.0005f /* of the declared loss, a second's: 3 % in a minute's root */
#define NEIGHBOUR_SD      0.15f /* of the rise that neighbours have given */
#define SHIFT_SD_K        3.0f  /* of a declared transformation, and of a light touch */
#define SHIFT_MOST_K      30.0f
#define SHIFT_DRIFT_K2    1e-4f /* a second's */
#define COLD_SD_K         4.0f  /* of ambient */
#define BOUND_SDS         2.6f
#define PROBABLE_SDS      0.7f
#define LEAST_SD_K        0.6f /* nodes of one spring differ by so much */
#define PHASE_SD          0.02f
#define LOOK_SD           0.12f /* of phase by a resistance that was learnt at another current */
#define LOOK_A            0.8f

static float clamp(float value, float low, float high)
{
    return value < low ? low : value > high ? high : value;
}

float spring_now_c(const thermal_model_t *model, uint8_t k)
{
    return (float)thermal_model_temperature_c7(model, k) * (1.0f / 128.0f);
}

static int16_t as_c7(float temperature_c)
{
    return (int16_t)(clamp(temperature_c, -40.0f, 215.0f) * 128.0f);
}

static float ambient_c(const thermal_model_t *model)
{
    return (float)model->ambient_c7 * (1.0f / 128.0f);
}

static float hold_w(const thermal_model_t *model, uint8_t k, float temperature_c)
{
    return 1e-6f * (float)thermal_model_power_to_hold_uw(model, k, as_c7(temperature_c));
}

/* The temperature, its phase as if it came from martensite, or from austenite. */
static void set_temperature(const spring_estimator_t *e, thermal_model_t *model, uint8_t k,
                            float temperature_c, uint8_t from)
{
    if (from == SPRING_PHASE_AUSTENITE) {
        thermal_model_set_temperature(model, k, as_c7(e->austenite_finish_c + 1.0f));
    } else if (from == SPRING_PHASE_MARTENSITE) {
        thermal_model_set_temperature(model, k, as_c7(e->martensite_finish_c - 1.0f));
    }
    thermal_model_set_temperature(model, k, as_c7(temperature_c));
}

static float distance_k2(const spring_belief_t *b)
{
    return b->variance_k2 + b->capacity_k * b->capacity_k;
}

/* ---- beginning ---- */

void spring_estimator_prepare(spring_estimator_t *e, const thermal_model_t *model)
{
    const thermal_model_parameters_t *p = &model->parameters;
    e->heat_capacity_j_per_k = (float)p->heat_capacity_mj_per_k * 1e-3f;
    e->loss_w_per_k = (float)p->loss_uw_per_k * 1e-6f;
    e->martensite_ohm = (float)p->resistance_martensite_uohm * 1e-6f;
    e->change =
        1.0f - (float)p->resistance_martensite_uohm / (float)p->resistance_austenite_uohm;
    e->martensite_finish_c = (float)p->martensite_finish_cc * 0.01f;
    e->martensite_start_c = (float)p->martensite_start_cc * 0.01f;
    e->austenite_start_c = (float)p->austenite_start_cc * 0.01f;
    e->austenite_finish_c = (float)p->austenite_finish_cc * 0.01f;
}

static void begin(const spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model,
                  uint8_t k, float temperature_c, float sd_k, uint8_t possible)
{
    const spring_learnt_t learnt = b->learnt;
    *b = (spring_belief_t){.variance_k2 = sd_k * sd_k + SHIFT_SD_K * SHIFT_SD_K,
                           .shift_variance_k2 = SHIFT_SD_K * SHIFT_SD_K,
                           .loss_variance = learnt.loss_sd_w_per_k * learnt.loss_sd_w_per_k,
                           .possible = possible,
                           .noise = NOISE_FIRST,
                           .learnt = learnt,
                           .last_c = temperature_c};
    set_temperature(e, model, k, temperature_c, SPRING_PHASE_MARTENSITE);
}

static const spring_learnt_t *nothing_learnt(const spring_estimator_t *e, spring_learnt_t *learnt)
{
    *learnt = (spring_learnt_t){.change = e->change, .loss_sd_w_per_k = LOSS_SD * e->loss_w_per_k};
    return learnt;
}

void spring_estimator_init(spring_estimator_t *e, thermal_model_t *model, float hottest_c)
{
    spring_learnt_t nothing;
    const float coldest_c = ambient_c(model);
    e->springs = (uint8_t)(model->parameters.rows * model->parameters.columns);
    spring_estimator_prepare(e, model);
    for (uint8_t k = 0; k < e->springs; k++) {
        e->spring[k].learnt = *nothing_learnt(e, &nothing);
        begin(e, &e->spring[k], model, k, 0.5f * (coldest_c + hottest_c),
              0.29f * (hottest_c - coldest_c), SPRING_PHASE_ANY);
    }
}

void spring_estimator_cold(spring_estimator_t *e, thermal_model_t *model)
{
    for (uint8_t k = 0; k < e->springs; k++) {
        begin(e, &e->spring[k], model, k, ambient_c(model), COLD_SD_K, SPRING_PHASE_MARTENSITE);
    }
}

void spring_estimator_restore(spring_estimator_t *e, uint8_t k, const spring_learnt_t *learnt)
{
    if (learnt->austenite_ohm > 0.0f) {
        e->spring[k].learnt = *learnt;
        e->spring[k].loss_variance = learnt->loss_sd_w_per_k * learnt->loss_sd_w_per_k;
    }
}

/* ---- one turn ---- */

void spring_estimator_disturb(spring_belief_t *b)
{
    b->settling = SETTLING_TICKS;
    b->current_sum_ma = b->voltage_sum_mv = 0;
    b->readings = 0;
    b->quiet = 0;
    b->ohm_before[1] = 0.0f;
}

/* Second differences of turns at the same current: neither a level nor a slope shows in them. */
static void take_noise(spring_belief_t *b, float ohm, float current_a)
{
    const bool same = fabsf(current_a - b->current_a) < NOISE_SAME * current_a;
    if (same && b->ohm_before[1] > 0.0f) {
        const float bend = (ohm - 2.0f * b->ohm_before[0] + b->ohm_before[1]) / ohm;
        const float noise = clamp(fabsf(bend) / THIRD_DIFFERENCES * 1.25f, 0.0f, NOISE_MOST);
        b->noise += (noise - b->noise) * NOISE_SHARE;
    }
    b->ohm_before[1] = same ? b->ohm_before[0] : 0.0f;
    b->ohm_before[0] = ohm;
}

static void take_readings(spring_belief_t *b)
{
    b->reads = b->readings >= LEAST_READINGS && b->current_sum_ma >= LEAST_MEAN_MA * b->readings &&
               b->voltage_sum_mv > 0;
    if (b->reads) {
        const float ohm = (float)b->voltage_sum_mv / (float)b->current_sum_ma;
        const float current_a = (float)b->current_sum_ma * 1e-3f / (float)b->readings;
        take_noise(b, ohm, current_a);
        b->slow_ohm = b->fresh == 0 ? ohm : b->slow_ohm + (ohm - b->slow_ohm) * SLOW_SHARE;
        b->current_a = current_a;
        b->ohm = ohm;
        b->fresh = b->fresh < UINT8_MAX ? (uint8_t)(b->fresh + 1) : UINT8_MAX;
    } else if (b->current_sum_ma < LEAST_MEAN_MA) {
        b->fresh = 0;
    }
    b->current_sum_ma = b->voltage_sum_mv = 0;
    b->readings = 0;
}

/* What this spring gives off beyond the model, at a temperature on the declared scale. */
static float extra_loss_w(const spring_belief_t *b, const thermal_model_t *model,
                          float temperature_c)
{
    return b->learnt.loss_w_per_k * (temperature_c - ambient_c(model));
}

/* How the errors of distance and loss go on in a turn. Returns the heat taken up, K. */
static float predict(const spring_estimator_t *e, spring_belief_t *b, const thermal_model_t *model,
                     uint8_t k, float power_w)
{
    const float now_c = spring_now_c(model, k);
    const float balance_w = hold_w(model, k, now_c);
    b->stiffness_w_per_k =
        (hold_w(model, k, now_c + 8.0f) - balance_w) * 0.125f + b->learnt.loss_w_per_k;
    const float per_w = SPRING_ESTIMATOR_TURN_S / e->heat_capacity_j_per_k;
    const float keeps = 1.0f - per_w * b->stiffness_w_per_k;
    const float above_k = now_c - ambient_c(model);
    const float by_loss = -per_w * above_k;
    const float drift = LOSS_DRIFT_SD * e->loss_w_per_k;
    b->variance_k2 = keeps * (keeps * b->variance_k2 + 2.0f * by_loss * b->covariance) +
                     by_loss * by_loss * b->loss_variance;
    b->covariance = keeps * b->covariance + by_loss * b->loss_variance;
    b->loss_variance += SPRING_ESTIMATOR_TURN_S * drift * drift;
    b->capacity_k = keeps * b->capacity_k + CAPACITY_SD * (now_c - b->last_c);
    {static int n; extern char *getenv(const char*); if (k==2 && getenv("DBG2") && n++%80==0) fprintf(stderr,"%d sd %.2f cap %.2f lossd %.1f%% loss %.1f%% cov %.5f stiff %.2f dist %.1f lost %.3f cross %d T %.1f\n",n/4,sqrtf(b->variance_k2),b->capacity_k,100*sqrtf(b->loss_variance)/e->loss_w_per_k,100*b->learnt.loss_w_per_k/e->loss_w_per_k,b->covariance,1e3*b->stiffness_w_per_k,b->disturbance_k,b->lost,b->crossings,now_c);}
    b->last_c = now_c;
    return per_w * (power_w - balance_w - extra_loss_w(b, model, now_c));
}

static void limit_loss(const spring_estimator_t *e, spring_belief_t *b)
{
    const float most = LOSS_MOST * e->loss_w_per_k;
    b->learnt.loss_w_per_k = clamp(b->learnt.loss_w_per_k, -most, most);
}

float spring_see(const spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model, uint8_t k,
                 float seen_c, float sd_k, uint8_t from)
{
    const float error_k = seen_c - spring_now_c(model, k);
    const float own_k2 = b->variance_k2 + b->capacity_k * b->capacity_k;
    const float total = own_k2 + sd_k * sd_k;
    const float gain = own_k2 / total;
    const float shift = fminf(b->shift_variance_k2 / total, gain);
    const float loss = b->covariance / total;
    set_temperature(e, model, k, seen_c - (1.0f - gain) * error_k, from);
    b->last_c = spring_now_c(model, k);
    b->shift_k = clamp(b->shift_k - shift * error_k, -SHIFT_MOST_K, SHIFT_MOST_K);
    b->learnt.loss_w_per_k += loss * error_k;
    limit_loss(e, b);
    b->loss_variance -= loss * b->covariance;
    b->covariance *= 1.0f - gain;
    b->capacity_k *= 1.0f - gain;
    b->shift_variance_k2 *= 1.0f - gain;
    b->variance_k2 = fmaxf(b->variance_k2 * (1.0f - gain), LEAST_SD_K * LEAST_SD_K);
    return error_k;
}

void spring_keep(const spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model, uint8_t k,
                 float limit_c, uint8_t from)
{
    const float error_k = limit_c - spring_now_c(model, k);
    b->learnt.loss_w_per_k += b->covariance / b->variance_k2 * error_k;
    limit_loss(e, b);
    set_temperature(e, model, k, limit_c, from);
    b->last_c = spring_now_c(model, k);
}

/* What was learnt at power-on before tells the phase at the first look. */
static void look(const spring_estimator_t *e, spring_belief_t *b, thermal_model_t *model, uint8_t k)
{
    const spring_learnt_t *l = &b->learnt;
    const float most = LOOK_SD + 3.0f * b->noise / fabsf(l->change);
    if (b->possible != SPRING_PHASE_ANY || l->austenite_ohm == 0.0f || b->current_a < LOOK_A ||
        b->fresh < 3 || most > 0.4f) {
        return;
    }
    const float austenite = 1.0f - (1.0f - b->slow_ohm / l->austenite_ohm) / l->change;
    if (austenite < most) {
        begin(e, b, model, k, 0.5f * (ambient_c(model) + e->austenite_start_c),
              0.29f * (e->austenite_start_c - ambient_c(model)), SPRING_PHASE_MARTENSITE);
    } else if (austenite > 1.0f - most) {
        begin(e, b, model, k, e->austenite_start_c, 8.0f, SPRING_PHASE_AUSTENITE);
        set_temperature(e, model, k, e->austenite_start_c, SPRING_PHASE_AUSTENITE);
    } else {
        begin(e, b, model, k, 0.5f * (e->martensite_finish_c + e->austenite_finish_c), 8.0f,
              SPRING_PHASE_BETWEEN);
    }
    b->fresh = 4;
}

void spring_estimator_update(spring_estimator_t *e, thermal_model_t *model, uint8_t k)
{
    spring_belief_t *b = &e->spring[k];
    const float before_c = b->last_c;
    take_readings(b);
    const float power_w = b->reads ? b->current_a * b->current_a * b->ohm : 0.0f;
    const float heat_k = predict(e, b, model, k, power_w);
    const float moved_k = b->last_c - before_c;
    b->disturbance_k *= 0.9998f; /* forgotten within 20 minutes */
    if (b->reads) {
        look(e, b, model, k);
        b->heat_k += heat_k;
        if (!b->blind) {
            spring_heating_watch(e, b, model, k);
            spring_holding_watch(e, b, model, k, moved_k);
        }
    } else {
        b->mark_ohm = b->line_ohm = 0.0f;
        b->quiet = 0;
    }
    if (spring_now_c(model, k) + BOUND_SDS * spring_estimator_sd_k(b) < e->martensite_finish_c) {
        b->possible = SPRING_PHASE_MARTENSITE;
        b->lost = 0.0f;
    }
}

/* ---- what is believed ---- */

void spring_estimator_begin_hold(spring_estimator_t *e, thermal_model_t *model, uint8_t k,
                                 bool full)
{
    spring_belief_t *b = &e->spring[k];
    if (full && b->possible != SPRING_PHASE_AUSTENITE) {
        b->blind = b->blind || b->possible == SPRING_PHASE_MARTENSITE;
        b->possible = SPRING_PHASE_AUSTENITE;
        set_temperature(e, model, k, spring_now_c(model, k), SPRING_PHASE_AUSTENITE);
    }
    b->lost = 0.0f;
    b->crossings = 0;
    b->quiet = 0;
    b->full_ohm = full && b->reads && b->current_a > 0.8f ? b->ohm : 0.0f;
    b->full_c = spring_now_c(model, k);
}

bool spring_estimator_has_transformed(const spring_estimator_t *e, const thermal_model_t *model,
                                      uint8_t k)
{
    const spring_belief_t *b = &e->spring[k];
    /* Where the transformation is known to show, and has still to come, it is waited for as long as
     * it may be; else no longer than it probably takes. */
    const bool to_come = (b->possible & SPRING_PHASE_AUSTENITE) == 0;
    const bool shows = b->reads && !b->blind && (b->onset || b->learnt.austenite_ohm > 0.0f);
    const float sds = b->onset ? 1.3f : to_come && shows ? BOUND_SDS : PROBABLE_SDS;
    return b->possible == SPRING_PHASE_AUSTENITE ||
           (!b->steep &&
           spring_now_c(model, k) - sds * spring_estimator_sd_k(b) > e->austenite_finish_c);
}

bool spring_estimator_is_cold(const spring_belief_t *b)
{
    return b->possible == SPRING_PHASE_MARTENSITE;
}

bool spring_estimator_sees(const spring_belief_t *b)
{
    return b->reads && !b->blind;
}

float spring_estimator_sd_k(const spring_belief_t *b)
{
    return sqrtf(distance_k2(b));
}

spring_bounds_t spring_estimator_temperature_c(const spring_estimator_t *e,
                                               const thermal_model_t *model, uint8_t k)
{
    const spring_belief_t *b = &e->spring[k];
    const float value_c = spring_now_c(model, k) + b->shift_k;
    const float neighbours_k = NEIGHBOUR_SD * (value_c - ambient_c(model));
    const float own = b->possible == SPRING_PHASE_MARTENSITE ? neighbours_k * neighbours_k : 0.0f;
    const float most_k = BOUND_SDS * sqrtf(distance_k2(b) + SHIFT_SD_K * SHIFT_SD_K + own);
    return (spring_bounds_t){value_c, value_c - most_k, value_c + most_k};
}

spring_bounds_t spring_estimator_distance_k(const spring_estimator_t *e,
                                            const thermal_model_t *model, uint8_t k)
{
    const float value_k = spring_now_c(model, k) - e->martensite_start_c;
    const float most_k = BOUND_SDS * spring_estimator_sd_k(&e->spring[k]);
    return (spring_bounds_t){value_k, value_k - most_k, value_k + most_k};
}

spring_bounds_t spring_estimator_austenite(const spring_estimator_t *e,
                                           const thermal_model_t *model, uint8_t k)
{
    const spring_belief_t *b = &e->spring[k];
    float value = (float)thermal_model_austenite(model, k) * (1.0f / 32768.0f);
    float sd = 0.3f;
    if (b->possible == SPRING_PHASE_AUSTENITE) {
        value = clamp(1.0f - b->lost, 0.0f, 1.0f);
        sd = b->blind ? 0.3f : PHASE_SD;
    } else if (b->possible == SPRING_PHASE_MARTENSITE) {
        sd = PHASE_SD;
        value = spring_now_c(model, k) < e->austenite_start_c ? 0.0f : value;
        if (spring_now_c(model, k) + BOUND_SDS * spring_estimator_sd_k(b) > e->austenite_start_c) {
            sd = 0.4f;
        }
    } else if (b->reads && !b->blind && b->learnt.austenite_ohm > 0.0f) {
        value = clamp(1.0f - (1.0f - b->ohm / b->learnt.austenite_ohm) / b->learnt.change, 0.0f,
                      1.0f);
        sd = 0.08f;
    } else if (b->reads && !b->blind && b->onset) {
        value = clamp((1.0f - b->onset_ohm / b->ohm) / b->learnt.change, 0.0f, 1.0f);
        sd = 0.12f;
    }
    return (spring_bounds_t){value, clamp(value - BOUND_SDS * sd, 0.0f, 1.0f),
                             clamp(value + BOUND_SDS * sd, 0.0f, 1.0f)};
}

uint32_t spring_estimator_model_power_uw(const spring_estimator_t *e, const thermal_model_t *model,
                                         uint8_t k, uint32_t power_uw)
{
    const float own_uw =
        (float)power_uw - 1e6f * extra_loss_w(&e->spring[k], model, spring_now_c(model, k));
    return own_uw <= 0.0f ? 0 : (uint32_t)own_uw;
}

float spring_estimator_hold_w(const spring_estimator_t *e, const thermal_model_t *model, uint8_t k,
                              float temperature_c)
{
    return hold_w(model, k, temperature_c) + extra_loss_w(&e->spring[k], model, temperature_c);
}

uint16_t spring_estimator_current_ma(const spring_estimator_t *e, uint8_t k, float power_w)
{
    const spring_belief_t *b = &e->spring[k];
    if (power_w <= 0.0f) {
        return 0;
    }
    const float current_ma =
        1000.0f * sqrtf(power_w / (b->fresh != 0 ? b->slow_ohm : e->martensite_ohm));
    return current_ma > 3200.0f ? 3200 : (uint16_t)current_ma;
}
