// A wire breaks after two seconds: the current is zero though the output is driven. The output is
// forbidden after five bad ticks, not at once, and stays so until it is cleared. Nothing has to be
// connected.
#include <safety.h>

static safety_t safety;

void setup()
{
    Serial.begin(115200);
    safety_parameters_t parameters;
    safety_parameters_default(&parameters);
    uint16_t bad;
    if (!safety_init(&safety, &parameters, 1, &bad)) {
        Serial.println(F("the parameters are refused"));
        for (;;) {
        }
    }
}

void loop()
{
    const bool broken = millis() > 2000;
    const bool on = safety_allows(&safety, 0);
    safety_sample_t sample = {};
    sample.expected_ma = on ? 1000 : 0;
    sample.current_ma = on && !broken ? 1000 : 0;
    sample.voltage_mv = on ? 200 : 0;
    sample.temperature_c7 = 60 * 128;
    safety_tick_spring(&safety, 0, &sample);
    safety_tick_board(&safety, (uint32_t)sample.current_ma);
    if (on && !safety_allows(&safety, 0)) {
        Serial.print(millis());
        Serial.print(F(" ms: off, fault "));
        Serial.println((int)safety_fault(&safety, 0));
    }
    delay(20);
}
