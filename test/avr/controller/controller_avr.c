/* Counts cycles of the control tick on the target, whole and by its parts: nine springs heated,
 * held, lowered and switched under both policies, with failing sensors, broken and shorted springs.
 * The springs are resistors that the controller's own model gives; the runner keeps the largest
 * count of each name. */
#include <stdbool.h>
#include <string.h>

#include "../report.h"
#include "controller.h"

#define SPRINGS 9
#define UNKNOWN INT16_MIN /* a temperature: the power has just come on */

static controller_settings_t settings;
static controller_t controller;
static controller_inputs_t inputs;
static controller_outputs_t outputs;
static bool broken[SPRINGS];
static bool shorted[SPRINGS];
static uint8_t failures;

/* The parts as the tick calls them, in the state that it is going to meet, and with its readings.
 * Their work is undone. */
static void count_parts(bool steps)
{
    static uint32_t power_uw[SPRINGS];
    static uint16_t target_ma[SPRINGS];
    static bool yes[SPRINGS];
    static bool valid[SPRINGS];
    KEEP_VARIABLES();
    for (uint8_t k = 0; k < SPRINGS; k++) {
        valid[k] = inputs.sensor[k].status == CONTROLLER_SENSOR_OK;
        if (valid[k]) {
            controller.measured_ma[k] = inputs.sensor[k].current_ma;
            controller.measured_mv[k] = inputs.sensor[k].voltage_mv;
        }
        power_uw[k] = controller_power_uw(&controller, k);
        yes[k] = safety_allows(&controller.safety, k);
    }
    if (steps) {
        COUNT("model_step");
        thermal_model_step(&controller.model, power_uw);
        COUNTED();
    }
    COUNT("belief");
    spring_estimator_tick(&controller.estimator, &controller.model, controller.measured_ma,
                          controller.measured_mv, valid);
    COUNTED();
    drive_policy_input_t input = {.belief = &controller.estimator,
                                  .model = &controller.model,
                                  .level_permille = controller.level_permille,
                                  .allowed = yes,
                                  .maximum_current_ma = 3000,
                                  .supply_limit_ma = 15000};
    COUNT("policy");
    drive_policy_tick(&controller.policy, &input, target_ma);
    COUNTED();
    safety_sample_t sample = {.sensor_status = (uint8_t)inputs.sensor[0].status,
                              .current_ma = inputs.sensor[0].current_ma,
                              .voltage_mv = inputs.sensor[0].voltage_mv,
                              .expected_ma = current_control_reference_ma(&controller.current, 0),
                              .temperature_c7 = thermal_model_temperature_c7(&controller.model, 0)};
    if (valid[0] && controller.safety.spring[0].electrical == 0 && !broken[0] && !shorted[0]) {
        COUNT("safety_of_one");
        safety_tick_spring(&controller.safety, 0, &sample);
        COUNTED();
    } else {
        COUNT("safety_of_one_bad");
        safety_tick_spring(&controller.safety, 0, &sample);
        COUNTED();
    }
    uint16_t duty[SPRINGS];
    COUNT("current_loops");
    current_control_tick(&controller.current, SPRINGS, target_ma, controller.measured_ma, valid,
                         true, duty);
    COUNTED();
    PUT_BACK_VARIABLES();
}

/* What the duties bring: 5 V, 180 mohm beyond the spring. */
static void respond(void)
{
    for (uint8_t k = 0; k < SPRINGS; k++) {
        uint16_t spring_mohm =
            shorted[k] ? 5u : (uint16_t)(thermal_model_resistance_uohm(&controller.model, k) >> 10);
        uint32_t current_ma =
            broken[k] ? 0u : (uint32_t)outputs.duty[k] * 6250u / (spring_mohm + 180u);
        if (current_ma > 3200u) {
            current_ma = 3200u;
        }
        inputs.sensor[k].current_ma = (int16_t)current_ma;
        inputs.sensor[k].voltage_mv = (int16_t)(current_ma * spring_mohm >> 10 & ~3u);
    }
}

static void run(uint16_t ticks)
{
    while (ticks-- > 0) {
        uint8_t before = controller.model_tick;
        /* a name is said before the tick: which one it is follows from how it counts */
        bool steps = (uint8_t)(before + 1u) * CONTROLLER_TICK_MS >= 100u;
        count_parts(steps);
        if (steps) {
            COUNT("tick_with_model_step");
            controller_tick(&controller, &inputs, &outputs);
            COUNTED();
        } else {
            COUNT("tick_without_model_step");
            controller_tick(&controller, &inputs, &outputs);
            COUNTED();
        }
        respond();
        if ((controller.model_tick == 0) != steps) {
            failures = 1;
        }
    }
}

static void start(drive_policy_kind_t policy, int16_t temperature_c7)
{
    memset(&inputs, 0, sizeof inputs);
    memset(&outputs, 0, sizeof outputs);
    memset(broken, 0, sizeof broken);
    memset(shorted, 0, sizeof shorted);
    inputs.ambient_c7 = 20 * 128;
    settings.policy.policy = (uint8_t)policy;
    if (!controller_init(&controller, &settings, 20 * 128, 0)) {
        failures = 1;
    }
    for (uint8_t k = 0; temperature_c7 != UNKNOWN && k < SPRINGS; k++) {
        /* each at its own place of the transformation */
        thermal_model_set_temperature(&controller.model, k, (int16_t)(temperature_c7 + k * 64));
    }
    if (temperature_c7 != UNKNOWN) { /* else they wait, or look */
        spring_estimator_trust_model(&controller.estimator, &controller.model);
    }
}

static void all(uint16_t level_permille)
{
    for (uint8_t k = 0; k < SPRINGS; k++) {
        (void)controller_set_target(&controller, k, level_permille);
    }
}

static void fail_all(controller_sensor_status_t status)
{
    for (uint8_t k = 0; k < SPRINGS; k++) {
        inputs.sensor[k].status = status;
    }
}

/* Everything that can go wrong with a spring, on all springs at once. */
static void faults(drive_policy_kind_t policy)
{
    for (uint8_t what = 0; what < 4; what++) {
        start(policy, 60 * 128);
        all(1000);
        run(60);
        if (what == 0) {
            memset(broken, 1, sizeof broken);
        } else if (what == 1) {
            memset(shorted, 1, sizeof shorted);
        } else if (what == 2) {
            fail_all(CONTROLLER_SENSOR_BUS);
        } else {
            for (uint8_t k = 0; k < SPRINGS; k++) {
                thermal_model_set_temperature(&controller.model, k, 140 * 128);
            }
        }
        run(20);
        bool found = false;
        for (uint8_t k = 0; k < SPRINGS; k++) {
            found = found || controller_fault(&controller, k) != SAFETY_FAULT_NONE;
        }
        if (!found) {
            failures = 1; /* not what is to be counted */
        }
        fail_all(CONTROLLER_SENSOR_OK);
        controller_clear_faults(&controller);
        all(1000);
        run(20);
    }
}

/* Springs of which all was learnt before, warm: they look, then all go on at once. */
static void power_on(void)
{
    const spring_learnt_t learnt = {.austenite_ohm = 0.219f,
                                    .change = 0.2f,
                                    .martensite_ohm = 0.175f,
                                    .martensite_rise_per_k = 0.0005f,
                                    .loss_sd_w_per_k = 0.0003f};
    start(DRIVE_POLICY_PRECOMPENSATE, UNKNOWN);
    for (uint8_t k = 0; k < SPRINGS; k++) {
        spring_estimator_restore(&controller.estimator, k, &learnt);
    }
    all(1000);
    run(300);
}

static void drive(drive_policy_kind_t policy)
{
    start(policy, 82 * 128);
    run(20);
    all(1000);
    run(policy == DRIVE_POLICY_OPEN ? 400 : 1000); /* at once, or in turn: transformed, held */
    for (uint8_t k = 0; k < SPRINGS; k++) {
        (void)controller_set_target(&controller, k, (uint16_t)(k * 125u));
    }
    run(150);
    all(1000);
    run(150);
    (void)controller_set_policy(&controller, DRIVE_POLICY_OPEN);
    run(60);
    (void)controller_set_policy(&controller, DRIVE_POLICY_PRECOMPENSATE);
    run(60);
    controller_stop(&controller);
    run(20);
}

int main(void)
{
    controller_settings_default(&settings);
    drive(DRIVE_POLICY_OPEN);
    drive(DRIVE_POLICY_PRECOMPENSATE);
    power_on();
    faults(DRIVE_POLICY_OPEN);
    faults(DRIVE_POLICY_PRECOMPENSATE);
    settings.policy.open_current_ma = 3000; /* more than the supply has, in every tick */
    drive(DRIVE_POLICY_OPEN);
    settings.model.air_exchange_uw_per_k = 60000;
    settings.model.plate_coupling_uw_per_k = 500;
    drive(DRIVE_POLICY_PRECOMPENSATE);
    report_text("#ram_bytes ");
    report_number(sizeof controller);
    report_text("\n");
    report_end(failures);
}
