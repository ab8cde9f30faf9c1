/* sources: lib/safety/circuit_step.c */
#include "circuit_step.h"

#include "prove.h"

/* Frama-C knows its declaration only. */
float fminf(float a, float b)
{
    return a < b ? a : b;
}

void main(void)
{
    circuit_step_t step = {0};
    current_control_parameters_t settings;
    any_circuit(&settings);
    const circuit_source_t source = any_source();
    while (any_bool()) {
        circuit_window_t window = {
            .found_mv = Frama_C_float_interval(0.0f, 13000.0f),
            .expected_mv = Frama_C_float_interval(0.0f, 17000.0f),
            .current_ma = Frama_C_float_interval(0.0f, 4095.0f),
            .tells = any_bool(),
            .steady = any_bool(),
        };
        window.share = circuit_window_share(window.found_mv, window.expected_mv);
        (void)circuit_step_judge(&step, &window, &source, &settings);
        if (any_bool()) {
            const circuit_source_t now = any_source();
            circuit_step_renew(&step, 1, &source, &now);
        }
    }
}
