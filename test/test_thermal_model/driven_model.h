/* What it is for: one on-chip model with its parameters and what drives it, for the tests of both
 * files. What it owns: defaults before each test, and degrees for the model's integers. What it
 * never does: look behind thermal_model.h. */
#ifndef DRIVEN_MODEL_H
#define DRIVEN_MODEL_H

#include "../run_tests.h"
#include "thermal_model.h"

extern thermal_model_parameters_t parameters;
extern thermal_model_t model;
extern uint32_t power_uw[THERMAL_MODEL_MAX_SPRINGS];
extern uint32_t random_state;

uint32_t random_bits(void);
/* The model with `parameters`, which it must take. */
void start(void);
void run(uint32_t steps);
double degrees(uint8_t spring);
double phase(uint8_t spring);
int16_t c7(double temperature_c);

#endif
