#include "small_array.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>

#include "unity.h"

#define CAPACITY_J_PER_K 0.300
#define LATENT_J         8.65
#define MARTENSITE_OHM   0.175

small_spring_t truth[SPRINGS];
double loss_w_per_k, coupling_w_per_k;
thermal_model_t model;
spring_estimator_t belief;
drive_policy_t policy;
drive_policy_parameters_t parameters;
uint16_t level[SPRINGS];
bool allowed[SPRINGS];
uint16_t target_ma[SPRINGS];
uint16_t supply_limit_ma, maximum_current_ma;

static int16_t measured_ma[SPRINGS], measured_mv[SPRINGS];
static bool valid[SPRINGS];
static uint32_t power_sum_uw[SPRINGS];
static unsigned count;
static uint32_t random_state;

static uint32_t random_bits(void)
{
    random_state = random_state * 1664525u + 1013904223u;
    return random_state >> 8;
}

uint32_t random_below(uint32_t limit)
{
    return random_bits() % limit;
}

void set_defaults(void)
{
    drive_policy_parameters_default(&parameters);
    parameters.policy = DRIVE_POLICY_PRECOMPENSATE;
    supply_limit_ma = 15000;
    maximum_current_ma = 3000;
    loss_w_per_k = 5.8e-3;
    coupling_w_per_k = 0.586e-3;
}

void power_on(uint8_t rows, uint8_t columns)
{
    thermal_model_parameters_t p;
    thermal_model_parameters_default(&p);
    p.rows = rows;
    p.columns = columns;
    p.diagonal_uw_per_k = 0; /* as below */
    TEST_ASSERT_EQUAL(THERMAL_MODEL_OK, thermal_model_init(&model, &p, NULL));
    spring_estimator_init(&belief, &model);
    TEST_ASSERT_TRUE(drive_policy_init(&policy, &parameters, &model, NULL));
    spring_estimator_prepare(&belief, &model, parameters.observer != 0);
    count = 0;
    random_state = 5;
    for (uint8_t k = 0; k < SPRINGS; k++) {
        level[k] = target_ma[k] = 0;
        allowed[k] = true;
        valid[k] = false;
        power_sum_uw[k] = 0;
        truth[k] = (small_spring_t){.temperature_c = 20.0, .ratio = 1.25};
    }
}

void begin_cold(uint8_t rows, uint8_t columns)
{
    power_on(rows, columns);
    thermal_model_reset(&model, 20 * 128);
    spring_estimator_trust_model(&belief, &model);
}

void believe(uint8_t spring, int16_t temperature_c, bool austenite)
{
    if (austenite) {
        thermal_model_set_temperature(&model, spring, 110 * 128);
    }
    thermal_model_set_temperature(&model, spring, (int16_t)(temperature_c * 128));
    spring_estimator_trust_model(&belief, &model);
}

void apply(const drive_policy_parameters_t *other)
{
    TEST_ASSERT_TRUE(drive_policy_apply(&policy, other, &model, NULL));
    spring_estimator_prepare(&belief, &model, other->observer != 0);
}

void policy_tick(void)
{
    const drive_policy_input_t input = {.belief = &belief,
                                        .model = &model,
                                        .level_permille = level,
                                        .allowed = allowed,
                                        .maximum_current_ma = maximum_current_ma,
                                        .supply_limit_ma = supply_limit_ma};
    drive_policy_tick(&policy, &input, target_ma);
}

uint32_t decide(void)
{
    uint32_t sum_ma = 0;
    spring_estimator_tick(&belief, &model, measured_ma, measured_mv, valid);
    policy_tick();
    for (uint8_t k = 0; k < policy.springs; k++) {
        sum_ma += target_ma[k];
    }
    return sum_ma;
}

void decisions(unsigned n)
{
    while (n-- != 0) {
        (void)decide();
    }
}

/* Evenly within one step of the sensor. */
static double noise(void)
{
    return (double)(random_bits() & 0xFFFu) / 2048.0 - 1.0;
}

static double share(const small_spring_t *s, double from_c)
{
    return fmin(fmax((s->temperature_c - s->shift_k - from_c) / 10.0, 0.0), 1.0);
}

static double flow_w(uint8_t k)
{
    const int columns = policy.columns;
    double w = -loss_w_per_k * (truth[k].temperature_c - 20.0);
    for (uint8_t j = 0; j < policy.springs; j++) {
        const int apart = (j > k ? j - k : k - j);
        const bool beside = (apart == 1 && j / columns == k / columns) || apart == columns;
        w += beside ? coupling_w_per_k * (truth[j].temperature_c - truth[k].temperature_c) : 0.0;
    }
    return w;
}

static void live(uint8_t k, double heat_w)
{
    small_spring_t *s = &truth[k];
    const bool forms = heat_w > 0.0 && share(s, 88.0) >= s->austenite && s->austenite < 1.0 &&
                       s->temperature_c - s->shift_k >= 88.0;
    const bool goes = heat_w < 0.0 && share(s, 68.0) <= s->austenite && s->austenite > 0.0 &&
                      s->temperature_c - s->shift_k <= 78.0;
    s->temperature_c +=
        heat_w * TICK_S / (CAPACITY_J_PER_K + (forms || goes ? LATENT_J / 10.0 : 0.0));
    s->austenite = fmin(fmax(s->austenite, share(s, 88.0)), share(s, 68.0));
}

uint32_t tick(void)
{
    double heat_w[SPRINGS];
    for (uint8_t k = 0; k < policy.springs; k++) {
        const double ohm = MARTENSITE_OHM * (1.0 + (truth[k].ratio - 1.0) * truth[k].austenite);
        const double current_a = target_ma[k] / 1000.0;
        heat_w[k] = current_a * current_a * ohm + flow_w(k);
        measured_ma[k] = (int16_t)target_ma[k];
        measured_mv[k] = (int16_t)(4 * lround(250.0 * current_a * ohm + noise()));
        valid[k] = true;
        measured_mv[k] = measured_mv[k] < 0 ? 0 : measured_mv[k];
        power_sum_uw[k] += (uint32_t)measured_ma[k] * (uint32_t)measured_mv[k];
    }
    for (uint8_t k = 0; k < policy.springs; k++) {
        live(k, heat_w[k]);
    }
    if (++count % 5u == 0) {
        uint32_t power_uw[SPRINGS] = {0};
        for (uint8_t k = 0; k < policy.springs; k++) {
            power_uw[k] = spring_estimator_model_power_uw(&belief, k, power_sum_uw[k] / 5u);
            power_sum_uw[k] = 0;
        }
        thermal_model_step(&model, power_uw);
    }
    return decide();
}

double run(double seconds)
{
    double highest_c = -100.0;
    for (long n = lround(seconds / TICK_S); n > 0; n--) {
        (void)tick();
        for (uint8_t k = 0; k < policy.springs; k++) {
            highest_c = fmax(highest_c, truth[k].temperature_c);
        }
    }
    return highest_c;
}
