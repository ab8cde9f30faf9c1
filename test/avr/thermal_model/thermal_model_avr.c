/* Counts cycles of one model step on the target. */
#include "../report.h"
#include "thermal_model.h"

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
    report_text("#ram_bytes ");
    report_number(sizeof model);
    report_text("\n");
    report_end(failures);
}
