// Holds 1 A in a heater of which only a wrong resistance is known. The heater is simulated here, by
// Ohm's law, so nothing has to be connected; the serial plotter shows wanted and measured current.
#include <current_control.h>

static current_control_t control;
static int16_t measured_ma;

void setup()
{
    Serial.begin(115200);
    current_control_parameters_t parameters;
    current_control_parameters_default(&parameters);
    uint16_t bad;
    if (!current_control_init(&control, &parameters, &bad)) {
        Serial.println(F("the parameters are refused"));
        for (;;) {
        }
    }
    current_control_set_resistance(&control, 0, 150); // it has 200
}

void loop()
{
    const uint16_t target_ma = millis() / 4000 % 2 ? 1000 : 500;
    const bool valid = true;
    uint16_t duty;
    current_control_tick(&control, 1, &target_ma, &measured_ma, &valid, true, &duty);
    // 5 V through 200 mohm of heater, 100 of shunt and 80 of wiring
    measured_ma = (int16_t)(5000000L / 380 * duty / CURRENT_CONTROL_DUTY_STEPS);
    Serial.print(target_ma);
    Serial.print('\t');
    Serial.println(measured_ma);
    delay(20);
}
