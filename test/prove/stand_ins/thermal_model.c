/* The thermal model as its header has it: what it gives lies within these, and is any of it. */
#include "thermal_model.h"

#include "prove.h"

#define MOST_UW 50000000 /* 98 mW/K, and 66 mW/K to neighbours and plate, over 255 K */

static int16_t any_c7(int16_t low_c7, int16_t high_c7)
{
    return (int16_t)any_between(low_c7, high_c7);
}

int16_t thermal_model_temperature_c7(const thermal_model_t *model, spring_index_t spring)
{
    (void)model;
    (void)spring;
    return any_c7(THERMAL_MODEL_LOWEST_C7, THERMAL_MODEL_HIGHEST_C7);
}

/* As far as ambient_c and the thermistor go. */
int16_t thermal_model_ambient_c7(const thermal_model_t *model)
{
    (void)model;
    return any_c7(-40 * 128, 85 * 128);
}

uint16_t thermal_model_austenite(const thermal_model_t *model, spring_index_t spring)
{
    (void)model;
    (void)spring;
    return (uint16_t)any_between(0, THERMAL_MODEL_AUSTENITE_FULL);
}

uint16_t thermal_model_coupling_uw_per_k(const thermal_model_t *model, spring_index_t spring,
                                         spring_index_t other)
{
    (void)model;
    (void)spring;
    (void)other;
    return any_u16();
}

thermal_model_neighbours_t thermal_model_neighbours(const thermal_model_parameters_t *p,
                                                    spring_index_t spring)
{
    (void)p;
    (void)spring;
    return (thermal_model_neighbours_t){(uint8_t)any_between(0, 4), (uint8_t)any_between(0, 4)};
}

int32_t thermal_model_power_to_hold_uw(const thermal_model_t *model, spring_index_t spring,
                                       int16_t temperature_c7)
{
    (void)model;
    (void)spring;
    (void)temperature_c7;
    return any_between(-MOST_UW, MOST_UW);
}

thermal_model_transformation_t thermal_model_transformation(const thermal_model_t *model,
                                                            spring_index_t spring)
{
    (void)model;
    (void)spring;
    const int16_t low_c7 = any_c7(-70 * 128, 198 * 128), first_c7 = any_c7(-70 * 128, 198 * 128);
    return (thermal_model_transformation_t){low_c7, any_c7((int16_t)(low_c7 + 2 * 128), 200 * 128),
                                            first_c7,
                                            any_c7((int16_t)(first_c7 + 2 * 128), 200 * 128)};
}
