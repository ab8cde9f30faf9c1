#include "one_spring.h"

#include <math.h>

truth_t truth;
spring_estimator_t estimator;
thermal_model_t model;

static unsigned count;
static double power_sum_w;
static uint32_t random_state;

static uint32_t random_bits(void)
{
    random_state = random_state * 1664525u + 1013904223u;
    return random_state >> 8;
}

void power_comes_on(void)
{
    thermal_model_parameters_t p;
    thermal_model_parameters_default(&p);
    p.rows = p.columns = 1;
    (void)thermal_model_init(&model, &p, NULL);
    spring_estimator_init(&estimator, &model);
    truth = (truth_t){.capacity_j_per_k = p.heat_capacity_mj_per_k * 1e-3,
                      .loss_w_per_k = p.loss_uw_per_k * 1e-6,
                      .latent_j = 8.65,
                      .martensite_ohm = p.resistance_martensite_uohm * 1e-6,
                      .ratio = 1.25,
                      .noise_v = 0.004,
                      .temperature_c = 20.0};
    count = 0;
    power_sum_w = 0.0;
    random_state = 5;
}

void begin_cold(void)
{
    power_comes_on();
    thermal_model_reset(&model, 20 * 128);
    spring_estimator_trust_model(&estimator, &model);
}

static double share(double from_c, double to_c)
{
    const double at = (truth.temperature_c - truth.shift_k - from_c) / (to_c - from_c);
    return at < 0.0 ? 0.0 : at > 1.0 ? 1.0 : at;
}

static void live(double power_w)
{
    const double heat_j = (power_w - truth.loss_w_per_k * (truth.temperature_c - 20.0)) * TICK_S;
    const double formed = share(88.0, 98.0);
    const double kept = share(68.0, 78.0);
    const bool transforms = (heat_j > 0.0 && formed >= truth.austenite && formed < 1.0 &&
                             truth.temperature_c - truth.shift_k >= 88.0) ||
                            (heat_j < 0.0 && kept <= truth.austenite && kept > 0.0 &&
                             truth.temperature_c - truth.shift_k <= 78.0);
    truth.temperature_c +=
        heat_j / (truth.capacity_j_per_k + (transforms ? truth.latent_j / 10.0 : 0.0));
    truth.austenite = fmin(fmax(truth.austenite, share(88.0, 98.0)), share(68.0, 78.0));
}

double resistance_ohm(void)
{
    const double above_k = truth.temperature_c - 20.0;
    const double austenite_ohm = truth.martensite_ohm * truth.ratio *
                                 (1.0 + (truth.rise_per_k + truth.apart_per_k) * above_k);
    return (1.0 - truth.austenite) * truth.martensite_ohm * (1.0 + truth.rise_per_k * above_k) +
           truth.austenite * austenite_ohm;
}

double distance_k(void)
{
    return truth.temperature_c - truth.shift_k - 78.0;
}

static double one_to_minus_one(void)
{
    return (double)(random_bits() % 2001u) / 1000.0 - 1.0;
}

static void read_sensor(double current_a, int16_t *ma, int16_t *mv)
{
    static double slow; /* of standard deviation 1 */
    double noise_v = truth.noise_v * one_to_minus_one();
    if (truth.slow_noise_v > 0.0) {
        slow = slow * 0.98 + 0.345 * one_to_minus_one();
        noise_v += truth.slow_noise_v * slow;
    }
    *ma = (int16_t)lround(1000.0 * current_a);
    *mv = (int16_t)(4 *
                    lround(250.0 * (current_a * (resistance_ohm() + truth.contact_ohm) + noise_v)));
}

bool tick(double current_a)
{
    int16_t ma, mv;
    live(current_a * current_a * resistance_ohm());
    read_sensor(current_a, &ma, &mv);
    spring_estimator_take(&estimator, 0, ma, mv);
    power_sum_w += ma > 0 && mv > 0 ? 1e-6 * ma * mv : 0.0;
    count++;
    if (count % 5u == 0) {
        const uint32_t power_uw =
            spring_estimator_model_power_uw(&estimator, 0, (uint32_t)(power_sum_w * 1e6 / 5.0));
        thermal_model_step(&model, &power_uw);
        power_sum_w = 0.0;
    }
    /* a turn each 0.25 s: 12 ticks, then 13 */
    if (count % 25u == 0 || count % 25u == 12u) {
        spring_estimator_update(&estimator, &model, 0);
        return true;
    }
    return false;
}

void ticks(double current_a, double seconds)
{
    for (long n = lround(seconds / TICK_S); n > 0; n--) {
        (void)tick(current_a);
    }
}

void heat_then_hold(double most_s)
{
    spring_estimator_disturb(&estimator, 0);
    spring_estimator_begin_heating(&estimator, &model, 0);
    for (double s = 0.0; s < most_s && !spring_estimator_has_transformed(&estimator, &model, 0);
         s += TICK_S) {
        (void)tick(3.0);
    }
    spring_estimator_disturb(&estimator, 0);
    spring_estimator_begin_hold(&estimator, &model, 0, true);
}

double hold_current_a(double margin_k)
{
    const int16_t start_c7 = thermal_model_transformation(&model, 0).martensite_start_c7;
    const float target_c = spring_c(start_c7) + (float)margin_k;
    const float now_c = (float)thermal_model_temperature_c7(&model, 0) / 128.0f;
    const float power_w =
        spring_estimator_hold_w(&estimator, 0, target_c - now_c) +
        spring_estimator_follow_w(&estimator, fmaxf(target_c - now_c, -20.0f), 4.0f);
    const unsigned place = count % 32u;
    const double dither_a = 0.3 * ((double)(place < 16u ? place : 31u - place) / 16.0 - 0.5);
    return fmax(1e-3 * spring_estimator_current_ma(&estimator, 0, power_w) + dither_a, 0.4);
}

void hold(double margin_k, double seconds)
{
    for (double s = 0.0; s < seconds; s += TICK_S) {
        (void)tick(hold_current_a(margin_k));
    }
}
