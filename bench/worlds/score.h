/* What it is for: the figures of one run, from what is true and what the controller says publicly.
 * What it owns: their definitions (below, and nowhere else).
 * What it never does: look into the controller's thoughts, or forgive. */
#ifndef WORLDS_SCORE_H
#define WORLDS_SCORE_H

#include <stdbool.h>

#include "belief_adapter.h"
#include "world.h"

#define SCORE_EVERY_TICKS  5
#define SCORE_REACHED      0.95 /* austenite */
#define SCORE_LOST         0.90
#define SCORE_LOST_S       20.0  /* may be lost for so long */
#define SCORE_UNDRIVEN     0.05  /* austenite that an undriven spring may have */
#define SCORE_HOLD_S       300.0 /* from then on after a start a spring counts as held */
#define SCORE_SETTLED_S    600.0 /* from then on reheats count */
#define SCORE_REHEAT_A     2.2   /* mean of a second, a reheat begins: no hold needs so much */
#define SCORE_REHEATED_A   1.9   /* and ends: further down than a dither takes that mean */
#define SCORE_WHOLE        0.995 /* austenite, and so far above martensite start: */
#define SCORE_FAR_K        5.0   /* what is seen as lost phase is none */
#define SCORE_REPORT_GAP_S 1.0   /* a report still stands over shorter gaps */

typedef struct {
    bool driven;
    double start_s;        /* since when */
    double reached_s;      /* 95 % austenite, after the last start; NaN: not yet */
    double report_from_s;  /* since when a report stands; NaN: none */
    double report_last_s;  /* when it was last seen */
    double settled_s;      /* longest of all starts: at 95 %, or reported from then until it was */
    double lost_s;         /* how long below 90 % and unreported, now */
    double silent_s;       /* sum of what such times had beyond SCORE_LOST_S */
    double hottest_c;      /* of any node */
    double lowest_held;    /* least austenite after it was reached */
    bool was_low;          /* undriven: it has been below SCORE_UNDRIVEN */
    double undriven_most;  /* austenite, since then */
    double hold_c, hold_s; /* sum of mean temperature times time held, and that time */
    double mean_a;         /* current, over the last second */
    bool heats;            /* with the current of a heating */
    bool fault;            /* of its own, now */
    int reheats;
    int losses_seen, false_losses; /* sights of lost phase; of a spring that had lost none */
    double settled_hold_s;         /* in which they were counted */
    double known_s, inside_s;      /* bounds were given; temperature and phase were within them */
    double inside_c_s, inside_phase_s;    /* either alone */
    double half_width_k, half_distance_k; /* sums over hold_s */
} score_spring_t;

typedef struct {
    int springs;
    double allowed_s; /* for a start: later a spring must be there or be reported */
    unsigned ticks;
    uint32_t next_sight; /* that is not counted yet */
    score_spring_t spring[WORLD_SPRINGS_MAX];
} score_t;

/* driven[k] != 0: spring k is asked for. */
void score_begin(score_t *score, const world_t *world, const bool driven[], double allowed_s);
/* The controller starts anew: what it must reach, it must reach again. */
void score_restart(score_t *score, const world_t *world);
/* A spring is to be driven from now on, or not, or as it was. */
void score_ask(score_t *score, const world_t *world, int spring, bool driven);
/* After every tick. While the board is off, controller is NULL: only what is hot counts. */
void score_tick(score_t *score, const world_t *world, const controller_t *controller);
/* Closes the run: springs that have reached nothing and reported nothing have settled_s INFINITY.
 */
void score_end(score_t *score);

#endif
