/* Plant and chip model of the largest array, one against the other. */
#include <math.h>

#include "../run_tests.h"
#include "plant.h"
#include "thermal_model.h"

#define SIDE    32
#define SPRINGS (SIDE * SIDE)

static thermal_model_t model;
static thermal_model_parameters_t parameters;

void setUp(void)
{
    thermal_model_parameters_default(&parameters);
    parameters.rows = parameters.columns = SIDE;
}

static unsigned state = 7;
static unsigned random_bits(void)
{
    state = state * 1664525u + 1013904223u;
    return state >> 8;
}

/* Ten minutes, other powers every half minute, the fan on after five: through the transformation
 * and back. */
TEST(chip_follows_the_plant)
{
    static uint32_t power_uw[SPRINGS];
    plant_t *plant = plant_create(SIDE, SIDE);
    TEST_ASSERT_EQUAL(PLANT_OK, plant_set_effect(plant, "latent_heat", true));
    TEST_ASSERT_EQUAL(THERMAL_MODEL_OK, thermal_model_init(&model, &parameters, NULL));
    double squares = 0.0, hottest_c = 0.0;
    for (int second = 0; second < 600; second++) {
        for (int i = 0; i < SPRINGS && second % 30 == 0; i++) {
            power_uw[i] = random_bits() % 2u * (random_bits() % 1500000u);
            (void)plant_drive(plant, i, PLANT_DRIVE_POWER, 1e-6 * power_uw[i]);
        }
        thermal_model_set_fan(&model, second < 300 ? 0 : 100);
        (void)plant_set_fan(plant, second < 300 ? 0.0 : 1.0);
        TEST_ASSERT_EQUAL(PLANT_OK, plant_step(plant, 1.0));
        for (int step = 0; step < 10; step++) {
            thermal_model_step(&model, power_uw);
        }
        for (int i = 0; i < SPRINGS; i++) {
            const double true_c = plant_temperature_c(plant, i);
            const double off =
                thermal_model_temperature_c7(&model, (spring_index_t)i) / 128.0 - true_c;
            squares += off * off;
            hottest_c = fmax(hottest_c, true_c);
        }
    }
    plant_destroy(plant);
    TEST_ASSERT_TRUE(hottest_c > 150.0);
    TEST_ASSERT_TRUE(sqrt(squares / (600.0 * SPRINGS)) < 0.1);
}

/* The plate's own sum has 32 bits: refused, not wrapped round. */
TEST(a_plate_that_takes_too_much_is_refused)
{
    uint16_t bad = 0;
    parameters.plate_heat_capacity_mj_per_k = 2000000;
    parameters.plate_coupling_uw_per_k = 4000;
    TEST_ASSERT_EQUAL(THERMAL_MODEL_OK, thermal_model_init(&model, &parameters, &bad));
    parameters.plate_coupling_uw_per_k = 4300;
    TEST_ASSERT_EQUAL(THERMAL_MODEL_ERROR_OVERFLOW, thermal_model_init(&model, &parameters, &bad));
    TEST_ASSERT_EQUAL(PARAMETER_plate_coupling_w_per_k, bad);
}

TEST(more_springs_are_refused)
{
    parameters.columns = SIDE + 1;
    TEST_ASSERT_EQUAL(THERMAL_MODEL_ERROR_RANGE, thermal_model_init(&model, &parameters, NULL));
}
