/* What it is for: an array that is larger than a board: several boards side by side at one plant.
 * What it owns: which springs are whose, the boards, the plant, their common time.
 * What it never does: tell one board what another does. They meet in the heat alone. */
#ifndef BOARDS_H
#define BOARDS_H

#include "loop.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Springs of one board: rows x columns from (row, column) on, 0-based. */
typedef struct {
    int row, column, rows, columns;
} boards_part_t;

typedef struct boards boards_t;

/* Into how many boards of rows x columns springs (at the edges fewer) a layer is cut. */
int boards_count(int array_rows, int array_columns, int rows, int columns);
/* Which springs board k has: boards lie row by row, like springs; the stiffness layer's begin where
 * the elongation layer's end, in a row counted on. */
boards_part_t boards_part(int array_rows, int array_columns, int rows, int columns, int k);

/* Copies the plant as loop_create does; settings[k] are board k's own, with its supply and limits.
 * NULL if and only if board *board (may be NULL) is refused (*bad as of loop_create_part), or
 * memory is out (*board is -1). */
boards_t *boards_create(const controller_settings_t settings[], const plant_t *plant, int rows,
                        int columns, const loop_options_t *options, uint64_t seed, int *board,
                        uint16_t *bad);
void boards_destroy(boards_t *boards);

/* One tick of every board, in step. */
void boards_tick(boards_t *boards);

int boards_of(const boards_t *boards); /* how many, in all layers */
loop_t *boards_loop(boards_t *boards, int k);
plant_t *boards_plant(boards_t *boards);

#ifdef __cplusplus
}
#endif
#endif
