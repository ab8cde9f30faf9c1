/* Physical parameters to the chip's integers: exact where they fit, refused where they do not, told
 * where left out. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../run_tests.h"

#include "chip_mapping.h"
#include "descriptions.h"

static plant_t *plant;
static thermal_model_parameters_t chip;
static char message[800];

void setUp(void)
{
    plant = plant_create(3, 3);
    memset(&chip, 0, sizeof chip);
}

void tearDown(void)
{
    plant_destroy(plant);
}

static void set(const char *name, double value)
{
    TEST_ASSERT_EQUAL_MESSAGE(PLANT_OK, plant_set(plant, name, value), name);
}

static void on(const char *effect)
{
    TEST_ASSERT_EQUAL_MESSAGE(PLANT_OK, plant_set_effect(plant, effect, true), effect);
}

static chip_mapping_status_t map(void)
{
    return chip_mapping_from_plant(plant, &chip, message, sizeof message);
}

/* A row that plant and chip share: a value a little off its default arrives as the chip's nearest
 * whole number, and nothing else moves. */
static void expect_shared(uint16_t k)
{
    const parameter_row_t row = parameter_row(k);
    const size_t at = (size_t)plant_parameter_index(row.name);
    const effect_row_t *const effect = effect_row(parameter_description(k)->effect);
    const double unit = pow(10.0, -row.decimals);
    const double usual = plant_parameter(at)->default_value;
    const double value = row.decimals == 0 ? 3.0 : usual != 0.0 ? 1.05 * usual : 7.0 * unit;
    if (effect != NULL) {
        on(effect->name);
    }
    TEST_ASSERT_EQUAL_MESSAGE(CHIP_MAPPING_OK, map(), message);
    const thermal_model_parameters_t before = chip;
    set(row.name, value);
    TEST_ASSERT_EQUAL_MESSAGE(CHIP_MAPPING_OK, map(), message);
    TEST_ASSERT_EQUAL_STRING_MESSAGE("", message, row.name);
    for (uint8_t spring = 0; spring < (row.count > 1 ? 9 : 1); spring++) {
        TEST_ASSERT_EQUAL_INT32_MESSAGE(lround(value / unit), parameter_get(&chip, &row, spring),
                                        row.name);
        parameter_set(&chip, &row, spring, parameter_get(&before, &row, spring));
    }
    TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&before, &chip, sizeof chip, row.name);
}

TEST(what_plant_and_chip_share_maps_number_by_number)
{
    unsigned shared = 0;
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        const parameter_row_t row = parameter_row(k);
        const bool scale = k == PARAMETER_loss_scale || k == PARAMETER_heat_capacity_scale;
        if (row.part != PARAMETER_PART_MODEL || plant_parameter_index(row.name) < 0 || scale) {
            continue; /* scales become what they scale: edge_and_mismatch_become_scales */
        }
        tearDown();
        setUp();
        expect_shared(k);
        shared++;
    }
    TEST_ASSERT_GREATER_THAN_UINT(20, shared);
    TEST_ASSERT_EQUAL(3, chip.rows);
    TEST_ASSERT_EQUAL(3, chip.columns);
}

TEST(effects_that_are_off_cost_nothing)
{
    TEST_ASSERT_EQUAL(CHIP_MAPPING_OK, map());
    TEST_ASSERT_EQUAL(0, chip.latent_heat_mj);
    TEST_ASSERT_EQUAL(0, chip.loss_rise_ppm_per_k);
    TEST_ASSERT_EQUAL(0, chip.radiating_area_cmm2);
    TEST_ASSERT_EQUAL(0, chip.air_exchange_uw_per_k);
    TEST_ASSERT_EQUAL(0, chip.plate_coupling_uw_per_k);
    TEST_ASSERT_EQUAL(0, chip.wake_uw_per_k);
    TEST_ASSERT_EQUAL(chip.resistance_martensite_uohm, chip.resistance_austenite_uohm);
    for (int k = 0; k < 9; k++) {
        TEST_ASSERT_EQUAL(1000, chip.loss_scale_permille[k]);
        TEST_ASSERT_EQUAL(1000, chip.heat_capacity_scale_permille[k]);
    }
}

TEST(what_the_plant_has_in_two_numbers_becomes_one)
{
    on("radiation");
    TEST_ASSERT_EQUAL(CHIP_MAPPING_OK, map());
    TEST_ASSERT_EQUAL(11080, chip.radiating_area_cmm2); /* 0.4 x 277 mm2 */
}

/* One value on the chip, one for each spring in the plant: the mean, and it is said. */
TEST(what_the_chip_averages_is_said)
{
    const struct {
        const char *effect, *name;
        double value;
    } cases[] = {{"plate_conduction", "plate_coupling_w_per_k", 0.0024},
                 {"latent_heat", "latent_heat_j", 13.15},
                 {"resistance_phase", "resistance_austenite_ohm", 0.264}};
    for (size_t k = 0; k < ROWS(cases); k++) {
        tearDown();
        setUp();
        on(cases[k].effect);
        char one_spring[64];
        (void)snprintf(one_spring, sizeof one_spring, "%s[5]", cases[k].name);
        set(one_spring, cases[k].value);
        TEST_ASSERT_EQUAL(CHIP_MAPPING_OK, map());
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(message, "the chip takes the mean"), cases[k].name);
    }
    TEST_ASSERT_EQUAL(224000, chip.resistance_austenite_uohm);
    on("spring_mismatch");
    set("resistance_scale", 1.1);
    TEST_ASSERT_EQUAL(CHIP_MAPPING_OK, map());
    TEST_ASSERT_EQUAL(246400, chip.resistance_austenite_uohm);
    TEST_ASSERT_EQUAL(192500, chip.resistance_martensite_uohm);
    tearDown();
    setUp();
    on("plate_conduction");
    on("latent_heat");
    set("plate_coupling_w_per_k[5]", 0.0024);
    set("latent_heat_j[5]", 13.15);
    TEST_ASSERT_EQUAL(CHIP_MAPPING_OK, map());
    TEST_ASSERT_EQUAL(1600, chip.plate_coupling_uw_per_k);
    TEST_ASSERT_EQUAL(9150, chip.latent_heat_mj);
    set("loss_w_per_k[5]", 0.0116);
    TEST_ASSERT_EQUAL(CHIP_MAPPING_OK, map());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(message, "the chip takes the ratio without"), message);
}

/* The middle column of 3 x 3 as a board of its own: the edges' losses of the whole array, nothing
 * to springs that it does not have, a third of the plate. */
TEST(a_part_knows_its_own_springs_alone)
{
    on("edge_loss");
    on("plate_conduction");
    set("edge_loss_fraction", 0.1);
    set("plate_heat_capacity_j_per_k", 12.0);
    set("plate_loss_w_per_k", 0.03);
    TEST_ASSERT_EQUAL(CHIP_MAPPING_OK,
                      chip_mapping_from_part(plant, 0, 1, 3, 1, &chip, message, sizeof message));
    const double expected[3] = {1.1, 1.0, 1.1};
    for (int k = 0; k < 3; k++) {
        TEST_ASSERT_DOUBLE_WITHIN(5.8, 5800.0 * expected[k],
                                  chip.loss_uw_per_k * chip.loss_scale_permille[k] / 1000.0);
    }
    TEST_ASSERT_EQUAL(3, chip.rows);
    TEST_ASSERT_EQUAL(1, chip.columns);
    TEST_ASSERT_EQUAL(4000, chip.plate_heat_capacity_mj_per_k);
    TEST_ASSERT_EQUAL(10000, chip.plate_loss_uw_per_k);
}

/* Each layer's board has its own losses and couplings, the plate at its end, half of the air. */
TEST(a_layer_has_its_own_numbers)
{
    plant_destroy(plant);
    plant = plant_create_layers(2, 2, 2);
    on("plate_conduction");
    on("shared_air");
    set("orthogonal_w_per_k", 0.0005);
    set("diagonal_fan_w_per_k", 0.0003);
    set("stiffness_coupling_scale", 0.5);
    set("plate_loss_w_per_k", 0.03);
    set("air_heat_capacity_j_per_k", 12.0);
    for (int k = 5; k <= 8; k++) {
        char name[32];
        (void)snprintf(name, sizeof name, "loss_w_per_k[%d]", k);
        set(name, 0.004);
    }
    for (int layer = 0; layer < 2; layer++) {
        TEST_ASSERT_EQUAL(CHIP_MAPPING_OK, chip_mapping_from_part(plant, 2 * layer, 0, 2, 2, &chip,
                                                                  message, sizeof message));
        TEST_ASSERT_EQUAL(layer ? 250 : 500, chip.orthogonal_uw_per_k);
        TEST_ASSERT_EQUAL(layer ? 150 : 300, chip.diagonal_fan_uw_per_k);
        TEST_ASSERT_EQUAL(layer ? 4000 : 5800, chip.loss_uw_per_k);
        TEST_ASSERT_EQUAL(30000, chip.plate_loss_uw_per_k);
        TEST_ASSERT_EQUAL(6000, chip.air_heat_capacity_mj_per_k);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(message, "series_w_per_k is not on the chip"), message);
    }
    TEST_ASSERT_EQUAL(CHIP_MAPPING_ERROR_RANGE,
                      chip_mapping_from_part(plant, 1, 0, 2, 2, &chip, message, sizeof message));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(message, "one layer"), message);
}

/* 3 x 3: six pairs two apart, twelve beside each other. */
TEST(second_neighbours_are_counted_to_the_first)
{
    set("orthogonal_w_per_k", 0.0005);
    set("second_w_per_k", 0.0001);
    TEST_ASSERT_EQUAL(CHIP_MAPPING_OK, map());
    TEST_ASSERT_EQUAL(550, chip.orthogonal_uw_per_k);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(message, "second_w_per_k is not on the chip"), message);
}

/* What each spring loses on the chip is what it loses in the plant, to the permille. */
TEST(edge_and_mismatch_become_scales)
{
    on("edge_loss");
    on("spring_mismatch");
    set("edge_loss_fraction", 0.1);
    set("loss_scale[2]", 1.5);
    set("heat_capacity_scale[7]", 0.8);
    TEST_ASSERT_EQUAL(CHIP_MAPPING_OK, map());
    const double expected[9] = {1.2, 1.65, 1.2, 1.1, 1.0, 1.1, 1.2, 1.1, 1.2};
    for (int k = 0; k < 9; k++) {
        TEST_ASSERT_DOUBLE_WITHIN(5800.0 * 0.001, 5800.0 * expected[k],
                                  chip.loss_uw_per_k * chip.loss_scale_permille[k] / 1000.0);
        TEST_ASSERT_DOUBLE_WITHIN(300.0 * 0.002, k == 6 ? 240.0 : 300.0,
                                  chip.heat_capacity_mj_per_k *
                                      chip.heat_capacity_scale_permille[k] / 1000.0);
    }
}

/* The straight line keeps the heat flow of the power law within 2 % of the flow at 85 K, over 0 to
 * 90 K. */
TEST(natural_convection_becomes_a_rising_loss)
{
    on("natural_convection");
    TEST_ASSERT_EQUAL(CHIP_MAPPING_OK, map());
    TEST_ASSERT_TRUE(chip.loss_rise_ppm_per_k > 0);
    TEST_ASSERT_EQUAL(11300, chip.loss_fan_uw_per_k);
    for (double above_k = 5.0; above_k <= 90.0; above_k += 5.0) {
        const double law = 0.0058 * pow(above_k / 85.0, 0.25) * above_k;
        const double line =
            chip.loss_uw_per_k * 1e-6 * (1.0 + chip.loss_rise_ppm_per_k * 1e-6 * above_k) * above_k;
        TEST_ASSERT_DOUBLE_WITHIN(0.02 * 0.0058 * 85.0, law, line);
    }
    set("convection_correlation", 1);
    TEST_ASSERT_EQUAL(CHIP_MAPPING_OK, map());
    TEST_ASSERT_TRUE(chip.loss_uw_per_k > 2000 && chip.loss_uw_per_k < 6500);
    TEST_ASSERT_TRUE(chip.loss_fan_uw_per_k > 8000 && chip.loss_fan_uw_per_k < 15000);
}

TEST(what_is_not_on_the_chip_is_left_out_and_said)
{
    thermal_model_parameters_t plain;
    TEST_ASSERT_EQUAL(CHIP_MAPPING_OK, map());
    plain = chip;
    for (size_t k = 0; k < EFFECT_COUNT; k++) {
        if (effect_row(k)->not_on_chip != NULL) {
            on(effect_row(k)->name);
        }
    }
    TEST_ASSERT_EQUAL(CHIP_MAPPING_OK, map());
    TEST_ASSERT_EQUAL_MEMORY(&plain, &chip, sizeof chip);
    for (size_t k = 0; k < EFFECT_COUNT; k++) {
        const effect_row_t *const row = effect_row(k);
        TEST_ASSERT_EQUAL_MESSAGE(row->not_on_chip != NULL, strstr(message, row->name) != NULL,
                                  row->name);
    }
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(message, "sensor_lag is not on the chip: it belongs to"),
                                 message);
}

TEST(bands_that_overlap_are_narrowed_about_their_middles_and_it_is_said)
{
    set("martensite_finish_c", 36.0);
    set("martensite_start_c", 56.0);
    set("austenite_start_c", 48.0);
    set("austenite_finish_c", 78.0);
    TEST_ASSERT_EQUAL_MESSAGE(CHIP_MAPPING_OK, map(), message);
    TEST_ASSERT_EQUAL_INT16(3920, chip.martensite_finish_cc); /* 46 degC +- 0.68 x 10 K */
    TEST_ASSERT_EQUAL_INT16(5280, chip.martensite_start_cc);
    TEST_ASSERT_EQUAL_INT16(5280, chip.austenite_start_cc);
    TEST_ASSERT_EQUAL_INT16(7320, chip.austenite_finish_cc);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(message, "overlap by 8.0 K"), message);
}

TEST(what_does_not_fit_is_refused_by_name)
{
    const struct {
        const char *name;
        double value;
        chip_mapping_status_t status;
    } cases[] = {{"heat_capacity_j_per_k", 66.0, CHIP_MAPPING_ERROR_RANGE},
                 {"loss_w_per_k", 0.0656, CHIP_MAPPING_ERROR_RANGE},
                 {"orthogonal_w_per_k", 0.1, CHIP_MAPPING_ERROR_RANGE},
                 {"loss_fan_w_per_k", 0.0655, CHIP_MAPPING_ERROR_MODEL},
                 {"resistance_ohm", 900.0, CHIP_MAPPING_ERROR_RANGE},
                 {"austenite_finish_c", 89.0, CHIP_MAPPING_ERROR_MODEL}};
    for (size_t k = 0; k < ROWS(cases); k++) {
        tearDown();
        setUp();
        set(cases[k].name, cases[k].value);
        if (cases[k].status == CHIP_MAPPING_ERROR_MODEL && k == 3) {
            set("orthogonal_w_per_k", 0.016); /* each fits, all together do not */
        }
        const thermal_model_parameters_t before = chip;
        TEST_ASSERT_EQUAL_MESSAGE(cases[k].status, map(), message);
        TEST_ASSERT_EQUAL_MEMORY(&before, &chip, sizeof chip);
        char name[64] = ""; /* by the plant's own name, the chip's model's refusals too */
        TEST_ASSERT_EQUAL_INT(1, sscanf(message, "%63[a-z_]", name));
        TEST_ASSERT_TRUE_MESSAGE(plant_parameter_index(name) >= 0, message);
        if (cases[k].status == CHIP_MAPPING_ERROR_RANGE) {
            TEST_ASSERT_EQUAL_PTR_MESSAGE(message, strstr(message, cases[k].name), message);
        }
    }
}

TEST(message_never_outgrows_its_buffer)
{
    on("sensor_lag");
    on("sensor_gain");
    char small[12];
    memset(small, 'x', sizeof small);
    TEST_ASSERT_EQUAL(CHIP_MAPPING_OK, chip_mapping_from_plant(plant, &chip, small, 10));
    TEST_ASSERT_TRUE(strlen(small) < 10);
    TEST_ASSERT_EQUAL('x', small[10]);
}
