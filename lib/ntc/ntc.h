/* What it is for: the temperature of a 10 kohm thermistor (B 3950 K) below a 10 kohm resistor.
 * What it owns: the curve, as a table of 5 K steps.
 * What it never does: measure. */
#ifndef NTC_H
#define NTC_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* adc is the divider's voltage in 1/1024 of its supply, thermistor to ground. Within 0.3 K of the B
 * equation from -20 to 80 degC. Fails (false) if and only if that is outside: a broken or shorted
 * wire reads so. */
bool ntc_temperature_c7(uint16_t adc, int16_t *temperature_c7);

#ifdef __cplusplus
}
#endif
#endif
