// How warm do the neighbours of a heated spring get? Two springs of a row of three are driven in
// turn, and the model's temperatures are printed once a second, for the serial plotter. Nothing has
// to be connected.
#include <thermal_model.h>

static thermal_model_t model;
static unsigned long next_ms;

void setup()
{
    Serial.begin(115200);
    thermal_model_parameters_t parameters;
    thermal_model_parameters_default(&parameters);
    parameters.rows = 1;
    parameters.columns = 3;
    uint16_t bad = PARAMETER_COUNT;
    if (thermal_model_init(&model, &parameters, &bad) != THERMAL_MODEL_OK) {
        Serial.print(F("cannot use "));
        Serial.println(bad < PARAMETER_COUNT ? parameter_row(bad).name : "step_ms");
        for (;;) {
        }
    }
    next_ms = millis();
}

void loop()
{
    static unsigned step;
    if ((long)(millis() - next_ms) < 0) {
        return;
    }
    next_ms += model.parameters.step_ms;
    const bool first_half = step % 1200 < 600; // a minute each
    const uint32_t power_uw[3] = {first_half ? 600000UL : 0UL, 0UL, first_half ? 0UL : 600000UL};
    thermal_model_step(&model, power_uw);
    if (++step % 10 == 0) {
        for (uint8_t k = 0; k < 3; k++) {
            Serial.print(thermal_model_temperature_c7(&model, k) / 128.0, 2);
            Serial.print(k < 2 ? '\t' : '\n');
        }
    }
}
