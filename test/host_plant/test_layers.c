/* Two layers: each is the array that it would be alone, but for what passes between the springs of
 * a taxel. */
#include "../run_tests.h"
#include <math.h>

#include "plant.h"

#define LAYERS_ROWS 3
#define COLUMNS     4
#define SPRINGS     (LAYERS_ROWS * COLUMNS)
#define OK(call)    TEST_ASSERT_EQUAL_INT(PLANT_OK, (call))

static plant_t *both;

void setUp(void)
{
    both = plant_create_layers(LAYERS_ROWS, COLUMNS, 2);
}
void tearDown(void)
{
    plant_destroy(both);
}

static void dress(plant_t *plant)
{
    static const char *const effects[] = {"latent_heat", "edge_loss", "fan_wake",
                                          "plate_conduction", "radiation"};
    for (size_t k = 0; k < ROWS(effects); k++)
        OK(plant_set_effect(plant, effects[k], true));
    OK(plant_set(plant, "second_w_per_k", 1e-4));
    OK(plant_set(plant, "second_fan_w_per_k", 1e-4));
    OK(plant_set_fan(plant, 0.4));
    plant_reset(plant);
}

/* Without the joint, each layer is a plant of one layer, to the last bit that the steps allow. */
TEST(without_the_joint_each_layer_is_an_array)
{
    plant_t *one[2];
    dress(both);
    OK(plant_set(both, "series_w_per_k", 0.0));
    OK(plant_set(both, "series_fan_w_per_k", 0.0));
    OK(plant_set(both, "stiffness_coupling_scale", 0.5));
    for (int layer = 0; layer < 2; layer++) {
        one[layer] = plant_create(LAYERS_ROWS, COLUMNS);
        dress(one[layer]);
    }
    static const char *const scaled[] = {
        "orthogonal_w_per_k", "orthogonal_fan_w_per_k", "diagonal_w_per_k", "diagonal_fan_w_per_k",
        "second_w_per_k",     "second_fan_w_per_k",     "wake_w_per_k"};
    for (size_t k = 0; k < ROWS(scaled); k++) {
        double value;
        OK(plant_get(one[1], scaled[k], &value));
        OK(plant_set(one[1], scaled[k], 0.5 * value));
    }
    for (int second = 0; second < 400; second++) {
        for (int i = 0; i < SPRINGS && second % 50 == 0; i++)
            for (int layer = 0; layer < 2; layer++) {
                const double w = 0.1 * ((i * 7 + layer * 3 + second / 50) % 9);
                OK(plant_drive(both, layer * SPRINGS + i, PLANT_DRIVE_POWER, w));
                OK(plant_drive(one[layer], i, PLANT_DRIVE_POWER, w));
            }
        OK(plant_step(both, 1.0));
        for (int layer = 0; layer < 2; layer++) {
            OK(plant_step(one[layer], 1.0));
            for (int i = 0; i < SPRINGS; i++)
                TEST_ASSERT_DOUBLE_WITHIN(0.005, plant_temperature_c(one[layer], i),
                                          plant_temperature_c(both, layer * SPRINGS + i));
        }
    }
    plant_destroy(one[0]);
    plant_destroy(one[1]);
}

/* Two nodes: P = (G + S) a - S b, 0 = (G + S) b - S a. */
TEST(a_taxel_alone_is_two_nodes_and_a_joint)
{
    const double loss = 5e-3, series = 1e-3, power = 0.4;
    plant_t *taxel = plant_create_layers(1, 1, 2);
    OK(plant_set(taxel, "loss_w_per_k", loss));
    OK(plant_set(taxel, "series_w_per_k", series));
    OK(plant_drive(taxel, 0, PLANT_DRIVE_POWER, power));
    OK(plant_settle(taxel, 1e5));
    const double determinant = (loss + series) * (loss + series) - series * series;
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 20.0 + power * (loss + series) / determinant,
                              plant_temperature_c(taxel, 0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 20.0 + power * series / determinant,
                              plant_temperature_c(taxel, 1));
    OK(plant_set(taxel, "series_fan_w_per_k", 0.0));
    OK(plant_set_fan(taxel, 1.0));
    OK(plant_settle(taxel, 1e5));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 20.0, plant_temperature_c(taxel, 1));
    plant_destroy(taxel);
}

TEST(energy_closes)
{
    dress(both);
    OK(plant_set_effect(both, "shared_air", true));
    plant_reset(both);
    for (int second = 0; second < 300; second++) {
        OK(plant_drive(both, second % (2 * SPRINGS), PLANT_DRIVE_POWER, second % 7 * 0.2));
        OK(plant_step(both, 1.0));
    }
    TEST_ASSERT_TRUE(plant_energy_input_j(both) > 500.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6 * plant_energy_input_j(both), 0.0, plant_energy_balance_j(both));
}

TEST(sizes)
{
    TEST_ASSERT_EQUAL_INT(2 * SPRINGS, plant_spring_count(both));
    TEST_ASSERT_EQUAL_INT(LAYERS_ROWS, plant_rows(both));
    TEST_ASSERT_EQUAL_INT(2, plant_layers(both));
    TEST_ASSERT_NULL(plant_create_layers(3, 3, 3));
    TEST_ASSERT_NULL(plant_create_layers(3, 3, 0));
    TEST_ASSERT_NULL(plant_create_layers(32, 32, 2));
    double value;
    OK(plant_set(both, "loss_w_per_k[24]", 0.01));
    OK(plant_get(both, "loss_w_per_k[24]", &value));
    TEST_ASSERT_EQUAL_DOUBLE(0.01, value);
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_INDEX, plant_set(both, "loss_w_per_k[25]", 0.01));
}
