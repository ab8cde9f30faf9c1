#include "one_spring.h"

#include <math.h>

spring_estimator_t estimator;
thermal_model_t model;

static thermal_model_t truth;
static unsigned count;
static uint32_t power_sum_uw, random_state;

void power_comes_on(void)
{
    thermal_model_parameters_t p;
    thermal_model_parameters_default(&p);
    p.rows = p.columns = 1;
    (void)thermal_model_init(&model, &p, NULL);
    spring_estimator_init(&estimator, &model);
    p.heat_capacity_mj_per_k += p.heat_capacity_mj_per_k / 10u;
    (void)thermal_model_init(&truth, &p, NULL);
    thermal_model_reset(&truth, 20 * 128);
    count = 0;
    power_sum_uw = 0;
    random_state = 5;
}

void begin_cold(void)
{
    power_comes_on();
    thermal_model_reset(&model, 20 * 128);
    spring_estimator_trust_model(&estimator, &model);
}

/* A voltage is read in steps of 4 mV, give or take one. */
void tick(double current_a)
{
    const double mv = 1e-3 * current_a * thermal_model_resistance_uohm(&truth, 0);
    random_state = random_state * 1664525u + 1013904223u;
    const int16_t read_mv = (int16_t)(4 * lround(mv / 4.0 + (random_state >> 8) % 3u - 1.0));
    const int16_t read_ma = (int16_t)lround(1000.0 * current_a);
    spring_estimator_take(&estimator, 0, read_ma, read_mv);
    power_sum_uw += read_mv > 0 ? (uint32_t)(read_ma * read_mv) : 0;
    count++;
    if (count % 5u == 0) {
        const uint32_t true_uw = power_sum_uw / 5u;
        const uint32_t power_uw = spring_estimator_model_power_uw(&estimator, 0, true_uw);
        thermal_model_step(&truth, &true_uw);
        thermal_model_step(&model, &power_uw);
        power_sum_uw = 0;
    }
    /* a turn each 0.25 s: 12 ticks, then 13 */
    if (count % 25u == 0 || count % 25u == 12u) {
        spring_estimator_update(&estimator, &model, 0);
    }
}

void ticks(double current_a, double seconds)
{
    for (long n = lround(seconds / TICK_S); n > 0; n--) {
        tick(current_a);
    }
}

void heat_then_hold(double most_s)
{
    spring_estimator_disturb(&estimator, 0);
    spring_estimator_begin_heating(&estimator, &model, 0);
    for (double s = 0.0; s < most_s && !spring_estimator_has_transformed(&estimator, &model, 0);
         s += TICK_S) {
        tick(3.0);
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
        tick(hold_current_a(margin_k));
    }
}
