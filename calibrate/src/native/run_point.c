/* What it is for: one point of a sweep: a plant under its boards, a pattern on and then off.
 * What it owns: the walk from console lines to the boards, and what is kept of each second.
 * What it never does: judge what it sees, or know what was varied. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "boards.h"
#include "chip_settings.h"
#include "plant.h"

#define EXPORT __attribute__((visibility("default")))
#define ROW_S  1.0

EXPORT int chip_run(const plant_t *plant, int board_rows, int board_columns,
                    const char *const lines[], const int *pattern, double fan, uint64_t seed,
                    size_t rows, size_t on_rows, double *temperature_c, double *austenite,
                    double *power_w, double *sum_a, int *faults, char *message,
                    size_t message_size);

/* Settings of every board: the firmware's defaults with its console lines. NULL where a line is
 * refused. */
static controller_settings_t *settings_of(const plant_t *plant, int board_rows, int board_columns,
                                          const char *const lines[], char *message, size_t size)
{
    const int rows = plant_rows(plant), columns = plant_columns(plant);
    const int count = plant_layers(plant) * boards_count(rows, columns, board_rows, board_columns);
    controller_settings_t *all = calloc((size_t)count, sizeof *all);
    for (int k = 0; k < count && all != NULL; k++) {
        const boards_part_t part = boards_part(rows, columns, board_rows, board_columns, k);
        settings_t settings;
        if (!chip_settings(&settings, part.rows, part.columns, lines[k], message, size)) {
            free(all);
            return NULL;
        }
        all[k] = settings.controller;
    }
    return all;
}

/* Cold, and told so; each board's springs of the pattern on. */
static void start(boards_t *boards, int board_rows, int board_columns, const int *pattern,
                  double fan)
{
    const plant_t *plant = boards_plant(boards);
    const int columns = plant_columns(plant);
    for (int k = 0; k < boards_of(boards); k++) {
        const boards_part_t part =
            boards_part(plant_rows(plant), columns, board_rows, board_columns, k);
        controller_t *controller = loop_controller(boards_loop(boards, k));
        bool on[CONTROLLER_MAX_SPRINGS] = {false};
        for (int i = 0; i < part.rows * part.columns; i++) {
            on[i] =
                pattern[(part.row + i / part.columns) * columns + part.column + i % part.columns] !=
                0;
        }
        controller_set_temperature(controller, (int16_t)lround(plant_ambient_c(plant) * 128.0));
        (void)controller_set_fan(controller, (uint8_t)lround(fan * 100.0));
        controller_set_pattern(controller, on);
    }
}

static void advance(boards_t *boards, double seconds)
{
    for (double n = 0.0; n < floor(seconds / LOOP_TICK_S + 0.5); n += 1.0) {
        boards_tick(boards);
    }
}

/* Springs that their boards have switched off for good. */
static int faults_of(const boards_t *boards)
{
    int out = 0;
    for (int k = 0; k < boards_of(boards); k++) {
        const controller_t *controller = loop_controller(boards_loop(boards, k));
        const bool all = controller_board_fault(controller) != SAFETY_FAULT_NONE;
        for (uint8_t i = 0; i < controller_springs(controller); i++) {
            out += all || controller_fault(controller, i) != SAFETY_FAULT_NONE;
        }
    }
    return out;
}

/* The plant from where it is (cold, and the boards are told so), cut into boards of board_rows x
 * board_columns springs (boards.h), board k with the firmware's defaults and lines[k]: pattern[n]
 * on for on_rows seconds, then off; the fan at 0..1 throughout; seed is the sensors' noise. Row r
 * is what is true after r + 1 seconds: temperature_c, austenite (n each), power_w and sum_a of all
 * (one each); faults: springs that a fault has switched off by the end. 0 done; -1 a line is
 * refused, -2 a board refuses its settings (message says which).
 */
int chip_run(const plant_t *plant, int board_rows, int board_columns, const char *const lines[],
             const int *pattern, double fan, uint64_t seed, size_t rows, size_t on_rows,
             double *temperature_c, double *austenite, double *power_w, double *sum_a, int *faults,
             char *message, size_t message_size)
{
    controller_settings_t *settings =
        settings_of(plant, board_rows, board_columns, lines, message, message_size);
    if (settings == NULL) {
        return -1;
    }
    uint16_t bad = UINT16_MAX;
    int board = 0;
    boards_t *boards =
        boards_create(settings, plant, board_rows, board_columns, NULL, seed, &board, &bad);
    free(settings);
    if (boards == NULL) {
        (void)snprintf(message, message_size, "board %d: %s", board + 1,
                       bad == UINT16_MAX ? "settings" : parameter_row(bad).name);
        return -2;
    }
    start(boards, board_rows, board_columns, pattern, fan);
    const plant_t *now = boards_plant(boards);
    const size_t springs = (size_t)plant_spring_count(plant);
    for (size_t r = 0; r < rows; r++) {
        for (int k = 0; r == on_rows && k < boards_of(boards); k++) {
            controller_stop(loop_controller(boards_loop(boards, k)));
        }
        advance(boards, ROW_S);
        power_w[r] = sum_a[r] = 0.0;
        for (size_t k = 0; k < springs; k++) {
            const size_t cell = r * springs + k;
            temperature_c[cell] = plant_temperature_c(now, (int)k);
            austenite[cell] = plant_austenite(now, (int)k);
            power_w[r] += plant_power_w(now, (int)k);
        }
        for (int k = 0; k < boards_of(boards); k++) {
            sum_a[r] += loop_sum_current_a(boards_loop(boards, k));
        }
    }
    *faults = faults_of(boards);
    boards_destroy(boards);
    return 0;
}
