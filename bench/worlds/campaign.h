/* What it is for: the list of worlds, and how an array of each is drawn.
 * What it owns: what differs from the declaration in which world, and by how much.
 * What it never does: run or judge. */
#ifndef WORLDS_CAMPAIGN_H
#define WORLDS_CAMPAIGN_H

#include <stdbool.h>
#include <stdint.h>

#include "run.h"

#define CAMPAIGN_TOLERANCE 0.15

/* One to all springs, each number as often, each set of so many as often. */
void campaign_draw_pattern(run_case_t *run, random_t *random);

int campaign_worlds(void);
const char *campaign_name(int world);
const char *campaign_says(int world); /* one line for --help */
/* The world is of another structure than the declaration, not only of other numbers: the mean
 * temperature of the hold is judged by the wider limit. */
bool campaign_is_structural(int world);

/* Array number 'array' of that world. Same seed and number: the same specimen and pattern in every
 * world, so that worlds differ only in what their names say. */
void campaign_draw(int world, uint64_t seed, int array, double seconds, run_case_t *run);

#endif
