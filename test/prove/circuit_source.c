/* sources: lib/safety/circuit_source.c */
#include "circuit_source.h"

#include "prove.h"

/* Frama-C knows its declaration only. */
float sqrtf(float value)
{
    return value > 0.0f ? Frama_C_float_interval(0.0f, value + 1.0f) : 0.0f;
}

void main(void)
{
    circuit_source_t source;
    current_control_parameters_t settings;
    any_circuit(&settings);
    circuit_source_begin(&source, &settings);
    while (any_bool()) {
        const uint8_t springs = (uint8_t)any_between(0, 9);
        for (uint8_t k = 0; k < springs; k++) {
            circuit_source_take(&source, Frama_C_float_interval(0.0f, 800.0f),
                                Frama_C_float_interval(0.0f, 13000.0f));
        }
        (void)circuit_source_fit(&source, &settings);
    }
}
