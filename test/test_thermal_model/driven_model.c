#include "driven_model.h"

#include <string.h>

thermal_model_parameters_t parameters;
thermal_model_t model;
uint32_t power_uw[THERMAL_MODEL_MAX_SPRINGS];
uint32_t random_state;

void setUp(void)
{
    thermal_model_parameters_default(&parameters);
    memset(power_uw, 0, sizeof power_uw);
    random_state = 11;
}

uint32_t random_bits(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 17;
    random_state ^= random_state << 5;
    return random_state;
}

void start(void)
{
    uint16_t bad = PARAMETER_COUNT;
    thermal_model_status_t status = thermal_model_init(&model, &parameters, &bad);
    TEST_ASSERT_EQUAL_MESSAGE(THERMAL_MODEL_OK, status,
                              bad < PARAMETER_COUNT ? parameter_row(bad).name : "");
}

void run(uint32_t steps)
{
    while (steps-- > 0) {
        thermal_model_step(&model, power_uw);
    }
}

double degrees(uint8_t spring)
{
    return thermal_model_temperature_c7(&model, spring) / 128.0;
}

double phase(uint8_t spring)
{
    return thermal_model_austenite(&model, spring) / 32768.0;
}

int16_t c7(double temperature_c)
{
    return (int16_t)(temperature_c * 128.0);
}
