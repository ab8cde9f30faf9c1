/* What it is for: how much of a piece of NiTi is austenite, after the temperatures it has seen.
 * What it owns: six laws of transformation, and the memory that each needs.
 * What it never does: know of heat or time: it is rate-independent, as the alloy is. */
#ifndef WORLDS_KINETICS_H
#define WORLDS_KINETICS_H

#include <stdbool.h>

typedef enum {
    KINETICS_COSINE = 0,  /* Liang and Rogers 1990 */
    KINETICS_LINEAR,      /* straight between start and finish */
    KINETICS_EXPONENTIAL, /* Tanaka 1986; Koistinen and Marburger 1959: 1 % left at 'finish' */
    KINETICS_PREISACH,    /* relays of all switching temperatures: minor loops close */
    KINETICS_R_PHASE,     /* Preisach, and on cooling through an intermediate R-phase */
    KINETICS_PLAY,        /* smooth branches without ends, between which nothing transforms */
    KINETICS_COUNT
} kinetics_law_t;

#define KINETICS_LOOPS 12 /* nested minor loops that are told apart */

/* Of the R-phase. Its own hysteresis is a few kelvin wide (Otsuka and Ren 2005: 2 to 5 K) and its
 * share of the latent heat about a third; martensite follows well below it. */
#define KINETICS_R_HYSTERESIS_K 4.0
#define KINETICS_R_RANGE_K      10.0 /* martensite starts and finishes this much lower */
#define KINETICS_R_LATENT       0.3

typedef struct {
    kinetics_law_t law;
    double martensite_finish_c, martensite_start_c, austenite_start_c, austenite_finish_c;
} alloy_t;

/* One grain: a piece at one temperature. martensite + r_phase + austenite = 1. */
typedef struct {
    double austenite, r_phase;
    double latent;       /* 0..1: share of the latent heat that it holds */
    double latent_per_k; /* on the branch it last moved along; 0 where nothing transforms */
    /* cosine, linear, exponential: the transformation restarts at each turning point */
    double hottest_c, coldest_c; /* effective, since the other branch was last moved on */
    double martensite_from, austenite_from; /* fractions at which the branches began */
    /* Preisach: the staircase of nested turning points, as shares of switched relays */
    struct {
        double risen, fallen;
    } loop[KINETICS_LOOPS];
    int loops;
    double play_c; /* R-phase: temperature with its hysteresis taken off */
} grain_t;

/* A grain that came to the temperature from far below, or (was_austenite) from far above. */
void grain_start(grain_t *grain, const alloy_t *alloy, double temperature_c, bool was_austenite);

/* Moves it to a temperature. Stress moves the thresholds of heating and cooling by different
 * amounts, so that each branch has a temperature of its own: the true one less its shift. */
void grain_move(grain_t *grain, const alloy_t *alloy, double heating_c, double cooling_c);

#endif
