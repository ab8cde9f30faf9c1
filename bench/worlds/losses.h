/* What it is for: which springs lost their phase for long, whether it was said, and whether they
 *                 were back after the surroundings had changed: the swarm's figures of one run.
 * What it owns: their definitions (below, and nowhere else).
 * What it never does: know what was drawn, or make a share of many runs. */
#ifndef WORLDS_LOSSES_H
#define WORLDS_LOSSES_H

#include <stdbool.h>

#include "score.h"

#define LOSSES_DUE_S                                                                               \
    210.0                    /* after it was asked for, or the board was switched on, it is judged \
                              */
#define LOSSES_LOST_S   60.0 /* below SCORE_LOST for longer, on end, it is lost */
#define LOSSES_SAY_S    1.0  /* what is said for less does not end a silence */
#define LOSSES_BACK_S   120.0 /* after a step of the surroundings it is back at SCORE_REACHED ... */
#define LOSSES_SETTLE_S 120.0 /* ... and stays there for so long */

typedef enum { LOSSES_NOT_JUDGED = 0, LOSSES_BACK, LOSSES_NOT_BACK } losses_back_t;

typedef struct {
    double judged_s, there_s; /* driven and due; of that at SCORE_REACHED or above */
    double away_there_s; /* of that in which it is said to be away, though its resistance tells */
    double low_s;        /* due and below SCORE_LOST on end, now */
    double unsaid_s;     /* of that on end: nothing at all is said */
    double unreported_s; /* of that on end: nothing is said but that it is blind */
    double said_s;       /* for so long something is said, on end, now */
    double reported_s;
    double lost_at_s;   /* when it was first lost; NaN: never */
    double silent_at_s; /* when a silence first lasted LOSSES_LOST_S; NaN: never */
    bool blind_only;    /* it was lost for so long while only 'blind' was said */
    double lost_s;      /* all that was beyond LOSSES_LOST_S */
    bool was_there;     /* when the surroundings began to change, and asked for ever since */
    double last_low_s;  /* when it was last below SCORE_REACHED since then */
    losses_back_t back;
    int fault; /* the last seen; SAFETY_FAULT_NONE (0): none */
} losses_spring_t;

typedef struct {
    double step_s, stepped_s; /* the surroundings change from then to then; 0: never */
    bool begun;
    losses_spring_t spring[WORLD_SPRINGS_MAX];
} losses_t;

void losses_begin(losses_t *losses, double step_s, double stepped_s);
/* After score_tick. While the board is off, controller is NULL: nothing is judged. */
void losses_tick(losses_t *losses, const score_t *score, const world_t *world,
                 const controller_t *controller);

#endif
