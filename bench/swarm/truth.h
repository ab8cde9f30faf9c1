/* What it is for: the second truth (test/worlds) under the simulated board, for the swarm.
 * What it owns: a world, what a spring's fault makes of its circuit, and the duties of a tick.
 * What it never does: know of the firmware. The world moves in ticks of 20 ms: it gets the mean
 * duty of each; a current follows its duty at once. */
#ifndef SWARM_TRUTH_H
#define SWARM_TRUTH_H

#include <stdbool.h>
#include <stdint.h>

#include "board.h"

#ifdef __cplusplus
extern "C" {
#endif

#define TRUTH_SPRINGS 9

typedef enum { TRUTH_STRESS, TRUTH_SUPPLY, TRUTH_AMBIENT } truth_event_kind_t;
typedef struct {
    truth_event_kind_t kind;
    double time_s;
    int spring; /* of a stress */
    double value;
} truth_event_t;

typedef struct truth truth_t;

/* An array of 3 x 3 drawn with that seed; all that a specimen may have otherwise within tolerance
 * of what is declared. NULL if and only if memory is out or there are too many events. */
truth_t *truth_create(uint64_t seed, double tolerance, double ambient_c,
                      const truth_event_t *events, unsigned count);
void truth_destroy(truth_t *truth);
/* For board_options_t; valid as long as the truth is. */
board_array_t truth_array(truth_t *truth);
double truth_hottest_c(const truth_t *truth, unsigned spring); /* of its wire */
double truth_austenite(const truth_t *truth, unsigned spring);
double truth_time_s(const truth_t *truth);

#ifdef __cplusplus
}
#endif
#endif
