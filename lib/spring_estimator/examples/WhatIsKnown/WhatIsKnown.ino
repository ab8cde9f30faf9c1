// The power came on, and nobody knows how hot the spring is. It is read with 0.5 A for a minute
// (the readings are made up: a martensite spring at rest), and the bounds of its temperature close
// in. For the serial plotter. Nothing has to be connected.
#include <spring_estimator.h>

static thermal_model_t model;
static spring_estimator_t estimator;
static unsigned long next_ms;

void setup()
{
    Serial.begin(115200);
    thermal_model_parameters_t parameters;
    thermal_model_parameters_default(&parameters);
    parameters.rows = 1;
    parameters.columns = 1;
    uint16_t bad;
    if (thermal_model_init(&model, &parameters, &bad) != THERMAL_MODEL_OK) {
        Serial.println(F("the parameters are refused"));
        for (;;) {
        }
    }
    spring_estimator_init(&estimator, &model);
    spring_estimator_prepare(&estimator, &model, true);
    next_ms = millis();
}

void loop()
{
    static unsigned tick;
    if ((long)(millis() - next_ms) < 0) {
        return;
    }
    next_ms += 20;
    const int16_t current_ma = 500;
    const int16_t voltage_mv = 88;
    spring_estimator_take(&estimator, 0, current_ma, voltage_mv);
    tick++;
    if (tick % 5 == 0) { // the model's step is 100 ms
        const uint32_t power_uw = (uint32_t)current_ma * (uint32_t)voltage_mv;
        const uint32_t given_uw = spring_estimator_model_power_uw(&estimator, 0, power_uw);
        thermal_model_step(&model, &given_uw);
    }
    if (tick % 13 == 0) { // SPRING_ESTIMATOR_TURN_S
        spring_estimator_update(&estimator, &model, 0);
    }
    if (tick % 50 == 0) {
        const spring_bounds_t c = spring_estimator_temperature_c(&estimator, &model, 0);
        Serial.print(c.low, 1);
        Serial.print('\t');
        Serial.print(c.value, 1);
        Serial.print('\t');
        Serial.println(c.high, 1);
    }
}
