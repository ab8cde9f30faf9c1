// The middle one of three springs is on for two minutes: the policy heats it until it has
// transformed, then holds it in the hysteresis with less current. Nothing has to be connected: the
// model stands for the springs, so nothing is measured. For the serial plotter: mA and degC.
#include <drive_policy.h>

static thermal_model_t model;
static spring_estimator_t belief;
static drive_policy_t policy;
static unsigned long next_ms;

static void refused()
{
    Serial.println(F("the parameters are refused"));
    for (;;) {
    }
}

void setup()
{
    Serial.begin(115200);
    thermal_model_parameters_t parameters;
    thermal_model_parameters_default(&parameters);
    parameters.rows = 1;
    parameters.columns = 3;
    drive_policy_parameters_t drive;
    drive_policy_parameters_default(&drive);
    drive.policy = DRIVE_POLICY_PRECOMPENSATE;
    uint16_t bad;
    if (thermal_model_init(&model, &parameters, &bad) != THERMAL_MODEL_OK ||
        !drive_policy_init(&policy, &drive, &model, &bad)) {
        refused();
    }
    spring_estimator_init(&belief, &model);
    thermal_model_reset(&model, thermal_model_ambient_c7(&model));
    spring_estimator_trust_model(&belief, &model); // all are cold
    next_ms = millis();
}

void loop()
{
    static unsigned tick;
    if ((long)(millis() - next_ms) < 0) {
        return;
    }
    next_ms += 20;
    const uint16_t level_permille[3] = {0, (uint16_t)(tick < 6000 ? DRIVE_POLICY_LEVEL_FULL : 0),
                                        0};
    const bool allowed[3] = {true, true, true};
    drive_policy_input_t input = {};
    input.belief = &belief;
    input.model = &model;
    input.level_permille = level_permille;
    input.allowed = allowed;
    input.maximum_current_ma = 3000;
    input.supply_limit_ma = 5000;
    uint16_t target_ma[3];
    spring_estimator_tick(&belief, &model, NULL, NULL, NULL); // nothing is measured
    drive_policy_tick(&policy, &input, target_ma);
    if (tick % 5 == 0) { // the model's step is 100 ms
        uint32_t power_uw[3];
        for (uint8_t k = 0; k < 3; k++) {
            power_uw[k] = (uint32_t)target_ma[k] * target_ma[k] / 1000u * 190u; // 0.19 ohm
        }
        thermal_model_step(&model, power_uw);
    }
    if (tick % 50 == 0) {
        Serial.print(target_ma[1]);
        Serial.print('\t');
        Serial.println(thermal_model_temperature_c7(&model, 1) / 128.0, 1);
    }
    tick++;
}
