/* Several boards at one array: the same as one where there is one, and heat passes between them. */
#include <math.h>
#include <stdbool.h>

#include "../run_tests.h"
#include "boards.h"

static controller_settings_t settings[4];
static plant_t *plant;
static boards_t *boards;

static void make(int rows, int columns)
{
    plant = plant_create(rows, columns);
    TEST_ASSERT_NOT_NULL(plant);
    TEST_ASSERT_EQUAL(PLANT_OK, plant_set_effect(plant, "latent_heat", true));
    TEST_ASSERT_EQUAL(PLANT_OK, plant_set_effect(plant, "resistance_phase", true));
}

void setUp(void)
{
    for (int k = 0; k < 4; k++) {
        controller_settings_default(&settings[k]);
        settings[k].policy.policy = DRIVE_POLICY_PRECOMPENSATE;
    }
    plant = NULL;
    boards = NULL;
}

void tearDown(void)
{
    if (boards != NULL) {
        boards_destroy(boards);
    }
    plant_destroy(plant);
}

static void cut(int rows, int columns)
{
    const int count =
        plant_layers(plant) * boards_count(plant_rows(plant), plant_columns(plant), rows, columns);
    for (int k = 0; k < count; k++) {
        const boards_part_t part =
            boards_part(plant_rows(plant), plant_columns(plant), rows, columns, k);
        settings[k].model.rows = (uint8_t)part.rows;
        settings[k].model.columns = (uint8_t)part.columns;
    }
    boards = boards_create(settings, plant, rows, columns, NULL, 1, NULL, NULL);
    TEST_ASSERT_NOT_NULL(boards);
}

static void drive_all(int k)
{
    bool on[CONTROLLER_MAX_SPRINGS];
    for (int i = 0; i < CONTROLLER_MAX_SPRINGS; i++) {
        on[i] = true;
    }
    controller_set_temperature(loop_controller(boards_loop(boards, k)), 20 * 128);
    controller_set_pattern(loop_controller(boards_loop(boards, k)), on);
}

TEST(one_board_is_the_loop)
{
    make(3, 3);
    cut(3, 3);
    drive_all(0);
    loop_t *loop = loop_create(&settings[0], plant, NULL, 1, NULL);
    const bool on[CONTROLLER_MAX_SPRINGS] = {true, true, true, true, true, true, true, true, true};
    controller_set_temperature(loop_controller(loop), 20 * 128);
    controller_set_pattern(loop_controller(loop), on);
    for (int tick = 0; tick < 3000; tick++) {
        boards_tick(boards);
        loop_tick(loop);
    }
    for (int k = 0; k < 9; k++) {
        TEST_ASSERT_EQUAL_DOUBLE(plant_temperature_c(loop_plant(loop), k),
                                 plant_temperature_c(boards_plant(boards), k));
    }
    loop_destroy(loop);
}

/* 5 x 4 on boards of 3 x 3: what is left at the edges is smaller, and each spring has one board; of
 * a second layer, too, whose springs are no board's of the first. */
TEST(every_spring_has_one_board)
{
    TEST_ASSERT_EQUAL(4, boards_count(5, 4, 3, 3));
    int seen[40] = {0};
    for (int k = 0; k < 8; k++) {
        const boards_part_t part = boards_part(5, 4, 3, 3, k);
        for (int i = 0; i < part.rows * part.columns; i++) {
            seen[(part.row + i / part.columns) * 4 + part.column + i % part.columns]++;
        }
    }
    for (int i = 0; i < 40; i++) {
        TEST_ASSERT_EQUAL(1, seen[i]);
    }
}

/* The right half is driven: its springs rise, each board keeps its own limit, and heat reaches the
 * left half, which draws nothing. */
TEST(boards_meet_in_the_heat_alone)
{
    make(2, 4);
    settings[1].safety.supply_limit_ma = 10000;
    cut(2, 2);
    drive_all(1);
    for (int tick = 0; tick < 50 * 200; tick++) {
        boards_tick(boards);
    }
    for (int i = 0; i < 4; i++) {
        const int left = i / 2 * 4 + i % 2, right = left + 2;
        TEST_ASSERT_TRUE(plant_austenite(boards_plant(boards), right) > 0.9);
        TEST_ASSERT_TRUE(plant_temperature_c(boards_plant(boards), left) > 20.5);
    }
    TEST_ASSERT_TRUE(plant_temperature_c(boards_plant(boards), 1) >
                     plant_temperature_c(boards_plant(boards), 0) + 1.0);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, loop_highest_sum_current_a(boards_loop(boards, 0)));
    const double highest_a = loop_highest_sum_current_a(boards_loop(boards, 1));
    TEST_ASSERT_TRUE(highest_a > 8.0 && highest_a < 10.0);
}

/* A board for each layer: the elongation layer's heats its springs within its own limit, and the
 * stiffness layer's, which draws nothing, finds its springs warmer. */
TEST(a_layer_has_its_own_board)
{
    plant = plant_create_layers(2, 2, 2);
    TEST_ASSERT_EQUAL(PLANT_OK, plant_set_effect(plant, "latent_heat", true));
    TEST_ASSERT_EQUAL(PLANT_OK, plant_set_effect(plant, "resistance_phase", true));
    settings[0].safety.supply_limit_ma = 10000;
    cut(2, 2);
    TEST_ASSERT_EQUAL(2, boards_of(boards));
    drive_all(0);
    for (int tick = 0; tick < 50 * 200; tick++) {
        boards_tick(boards);
    }
    for (int i = 0; i < 4; i++) {
        TEST_ASSERT_TRUE(plant_austenite(boards_plant(boards), i) > 0.9);
        TEST_ASSERT_EQUAL_DOUBLE(0.0, plant_austenite(boards_plant(boards), 4 + i));
        TEST_ASSERT_TRUE(plant_temperature_c(boards_plant(boards), 4 + i) > 22.0);
    }
    TEST_ASSERT_EQUAL_DOUBLE(0.0, loop_highest_sum_current_a(boards_loop(boards, 1)));
    TEST_ASSERT_TRUE(loop_highest_sum_current_a(boards_loop(boards, 0)) < 10.0);
}

/* Neither a board nor a loop of one board spans the layers. */
TEST(no_board_spans_the_layers)
{
    uint16_t bad = 0;
    plant = plant_create_layers(2, 2, 2);
    settings[0].model.rows = settings[0].model.columns = 2;
    TEST_ASSERT_NULL(loop_create(&settings[0], plant, NULL, 1, &bad));
    TEST_ASSERT_EQUAL(PARAMETER_rows, bad);
    TEST_ASSERT_NULL(loop_create_part(&settings[0], plant, 1, 0, NULL, 1, &bad));
    settings[0].model.rows = 4;
    TEST_ASSERT_NULL(loop_create(&settings[0], plant, NULL, 1, &bad));
}

TEST(the_board_that_does_not_fit_is_named)
{
    make(2, 4);
    int board = 0;
    uint16_t bad = 0;
    settings[0].model.rows = settings[1].model.rows = 2;
    settings[0].model.columns = 2;
    settings[1].model.columns = 3;
    TEST_ASSERT_NULL(boards_create(settings, plant, 2, 2, NULL, 1, &board, &bad));
    TEST_ASSERT_EQUAL(1, board);
    TEST_ASSERT_EQUAL(PARAMETER_rows, bad);
}
