/* Counts cycles of one model step on the target, and of the same network in float. */
#include "../report.h"
#include <string.h>

#include "float_network.h"
#include "thermal_model_internal.h"
#include "thermal_model_pass_avr.h"

static thermal_model_t model;
static thermal_model_parameters_t parameters;
static uint32_t power_uw[9];
static uint8_t failures;

static void start(void)
{
    if (thermal_model_init(&model, &parameters, 0) != THERMAL_MODEL_OK) {
        failures = 1;
    }
}

static void run(uint16_t steps)
{
    while (steps-- > 0) {
        thermal_model_step(&model, power_uw);
    }
}

static void drive(uint32_t each_uw)
{
    for (uint8_t i = 0; i < 9; i++) {
        power_uw[i] = each_uw;
    }
}

static __attribute__((noinline)) void pass_in_assembly(thermal_model_t *which)
{
    thermal_model_pass(which);
}

static uint32_t random_state = 3;

static uint32_t random_bits(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 17;
    random_state ^= random_state << 5;
    return random_state;
}

/* The assembly leaves exactly what the C form leaves, from any numbers whatever: also from those
 * init would refuse. */
static void hold_assembly_to_c(void)
{
    static thermal_model_t other;
    for (uint16_t k = 0; k < 600; k++) {
        parameters.rows = (uint8_t)(1u + random_bits() % 3u);
        parameters.columns = (uint8_t)(1u + random_bits() % 3u);
        start();
        model.pass.flags = (uint8_t)random_bits() & 3;
        for (uint8_t i = 0; i < 9; i++) {
            power_uw[i] = random_bits() >> (random_bits() % 32);
            thermal_model_spring_t *spring = &model.spring[i];
            thermal_model_spring_state_t *state = &model.state.spring[i];
            spring->gain_c23 = (int32_t)random_bits();
            spring->step_gain = random_bits() >> (9 + random_bits() % 8);
            spring->orthogonal = (uint16_t)random_bits();
            spring->diagonal = (uint16_t)random_bits();
            spring->conduction = (uint16_t)random_bits();
            spring->loss = (uint16_t)random_bits() >> 1;
            spring->loss_rise =
                (model.pass.flags & PASS_RISES) != 0 ? (uint16_t)random_bits() >> 1 : 0;
            /* within the limits, as a step leaves it */
            state->temperature_c23 = (int32_t)(random_bits() % 0x7f800000u) - 40 * 8388608;
            if ((k & 3) != 0) { /* as a rule, no threshold in the way */
                state->heating_c7 = THERMAL_MODEL_HIGHEST_C7;
                state->cooling_c7 = THERMAL_MODEL_LOWEST_C7;
            } else {
                state->heating_c7 = (int16_t)(random_bits() % 27520u);
                state->cooling_c7 = (int16_t)((int16_t)(random_bits() % 5120u) - 5120);
            }
        }
        for (uint8_t i = 0; i < sizeof model.lead / sizeof model.lead[0]; i++) {
            model.lead[i] = (uint16_t)random_bits() & 0x3fff;
        }
        model.pass.common = random_bits();
        model.pass.air_flow = (int32_t)random_bits();
        model.pass.air_lead = (uint16_t)random_bits() & 0x3fff;
        model.pass.power_uw = power_uw;
        other = model; /* everything inside is relative: a copy works as well */
        pass_in_assembly(&model);
        thermal_model_pass_in_c(&other);
        if (memcmp(&other, &model, sizeof model) != 0) {
            report_text("assembly differs from C\n");
            failures = 1;
            return;
        }
    }
}

static uint8_t transforming(void)
{
    uint16_t austenite = thermal_model_austenite(&model, 0);
    return austenite > 3277 && austenite < 29491;
}

/* All nine through a whole loop, up and down: the runner keeps the largest count of each name. */
static void watch_loop(uint32_t up_uw)
{
    drive(up_uw);
    while (thermal_model_temperature_c7(&model, 0) < 110 * 128) {
        if (transforming()) {
            COUNT("step_nine_transforming");
            thermal_model_step(&model, power_uw);
            COUNTED();
        } else {
            COUNT("step_worst");
            thermal_model_step(&model, power_uw);
            COUNTED();
        }
    }
    drive(0);
    while (thermal_model_temperature_c7(&model, 0) > 60 * 128) {
        COUNT("step_worst");
        thermal_model_step(&model, power_uw);
        COUNTED();
    }
}

int main(void)
{
    thermal_model_parameters_default(&parameters);
    parameters.air_exchange_uw_per_k = 60000;
    parameters.plate_coupling_uw_per_k = 500;
    start();
    drive(390000);
    run(50);
    COUNT("step_typical");
    thermal_model_step(&model, power_uw);
    COUNTED();

    watch_loop(800000);
    watch_loop(2000000);

    parameters.loss_rise_ppm_per_k = 3000;
    parameters.radiating_area_cmm2 = 11080;
    parameters.wake_uw_per_k = 1000;
    start();
    thermal_model_set_fan(&model, 50);
    drive(390000);
    run(50);
    COUNT("step_every_effect");
    thermal_model_step(&model, power_uw);
    COUNTED();

    if (!thermal_model_is_consistent(&model)) {
        failures = 1;
    }
    COUNT("set_fan");
    thermal_model_set_fan(&model, 51);
    COUNTED();
    COUNT("power_to_hold");
    int32_t hold = thermal_model_power_to_hold_uw(&model, 4, 80 * 128);
    COUNTED();
    if (hold < 0) {
        failures = 1;
    }
    float_network_reset();
    COUNT("step_float");
    float_network_step();
    COUNTED();
    hold_assembly_to_c();
    report_text("#ram_bytes ");
    report_number(sizeof model);
    report_text("\n");
    report_end(failures);
}
