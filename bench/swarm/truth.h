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

/* What else a circuit may have; value 0 (TRUTH_BRIDGE, TRUTH_GATES_JOINED: below 0) ends it. */
typedef enum {
    TRUTH_LEAK_A,       /* of a switch that is off */
    TRUTH_SLOW_SHARE,   /* of the period: it goes on later (below 0) or off later */
    TRUTH_WELDS_AT_C,   /* of its spring: then it stays closed */
    TRUTH_DIODE_OPEN,   /* its current ends with each pulse */
    TRUTH_BRIDGE,       /* value: the spring whose hot end touches this one's */
    TRUTH_GATES_JOINED, /* value: the spring whose switch's gate this one's touches */
    TRUTH_NO_INDUCTOR,  /* its turns touch: current flows in the pulses alone */
    TRUTH_CONTACT_OHM,  /* more for each 100 K of its spring */
    TRUTH_CHATTER_HZ,   /* its crimp opens and closes */
    TRUTH_GROUND_OHM,   /* of all: what their currents lift is read beside each voltage */
    TRUTH_FREEWHEEL_V,  /* of all: what their diodes drop */
    TRUTH_RIPPLE_SHARE, /* of all: of the supply, up and down */
    TRUTH_RIPPLE_HZ,    /* of all */
    TRUTH_WEAK_A,       /* of all: the supply gives no more, its voltage falls */
    TRUTH_CLOCK         /* of all: the world's seconds in one of the board's; 0: 1 */
} truth_upset_t;

typedef struct truth truth_t;

/* An array of 3 x 3 drawn with that seed; all that a specimen may have otherwise within tolerance
 * of what is declared. NULL if and only if memory is out or there are too many events. */
truth_t *truth_create(uint64_t seed, double tolerance, double ambient_c,
                      const truth_event_t *events, unsigned count);
void truth_destroy(truth_t *truth);
/* For board_options_t; valid as long as the truth is. */
board_array_t truth_array(truth_t *truth);
void truth_upset(truth_t *truth, truth_upset_t what, unsigned spring, double value);
double truth_hottest_c(const truth_t *truth, unsigned spring); /* of its wire */
double truth_austenite(const truth_t *truth, unsigned spring);
double truth_time_s(const truth_t *truth);

#ifdef __cplusplus
}
#endif
#endif
