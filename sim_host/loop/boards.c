#include "boards.h"

#include <stdlib.h>

struct boards {
    plant_t *plant;
    int count;
    loop_t *loop[];
};

static int parts(int springs, int each)
{
    return (springs + each - 1) / each;
}

int boards_count(int array_rows, int array_columns, int rows, int columns)
{
    return parts(array_rows, rows) * parts(array_columns, columns);
}

static int least(int a, int b)
{
    return a < b ? a : b;
}

boards_part_t boards_part(int array_rows, int array_columns, int rows, int columns, int k)
{
    const int across = parts(array_columns, columns);
    const int of_layer = boards_count(array_rows, array_columns, rows, columns);
    const int row = k % of_layer / across * rows;
    boards_part_t part = {.row = k / of_layer * array_rows + row, .column = k % across * columns};
    part.rows = least(rows, array_rows - row);
    part.columns = least(columns, array_columns - part.column);
    return part;
}

boards_t *boards_create(const controller_settings_t settings[], const plant_t *plant, int rows,
                        int columns, const loop_options_t *options, uint64_t seed, int *board,
                        uint16_t *bad)
{
    const int array_rows = plant_rows(plant), array_columns = plant_columns(plant);
    const int count = plant_layers(plant) * boards_count(array_rows, array_columns, rows, columns);
    boards_t *boards = calloc(1, sizeof *boards + (size_t)count * sizeof(loop_t *));
    if (boards != NULL) {
        boards->plant = plant_copy(plant);
    }
    if (boards == NULL || boards->plant == NULL) {
        free(boards);
        if (board != NULL) {
            *board = -1;
        }
        return NULL;
    }
    for (int k = 0; k < count; k++) {
        const boards_part_t part = boards_part(array_rows, array_columns, rows, columns, k);
        boards->loop[k] =
            loop_create_part(&settings[k], boards->plant, part.row, part.column, options,
                             seed + (uint64_t)k * UINT64_C(0x9E3779B97F4A7C15), bad);
        if (boards->loop[k] == NULL) {
            boards_destroy(boards);
            if (board != NULL) {
                *board = k;
            }
            return NULL;
        }
        boards->count = k + 1;
    }
    return boards;
}

void boards_destroy(boards_t *boards)
{
    for (int k = 0; k < boards->count; k++) {
        loop_destroy(boards->loop[k]);
    }
    plant_destroy(boards->plant);
    free(boards);
}

void boards_tick(boards_t *boards)
{
    double dt_s = 0.0;
    for (int k = 0; k < boards->count; k++) {
        dt_s = loop_tick_part(boards->loop[k]);
    }
    if (dt_s > 0.0) {
        (void)plant_step(boards->plant, dt_s);
        for (int k = 0; k < boards->count; k++) {
            loop_read_plant(boards->loop[k]);
        }
    }
}

int boards_of(const boards_t *boards)
{
    return boards->count;
}

loop_t *boards_loop(boards_t *boards, int k)
{
    return boards->loop[k];
}

plant_t *boards_plant(boards_t *boards)
{
    return boards->plant;
}
