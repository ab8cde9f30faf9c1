/* What it is for: runs in which everything that test/worlds can do is drawn at once.
 * What it owns: the distributions (docs/worlds.md has them in words), and what each run is of.
 * What it never does: run or judge, or take a number from what the controller assumes. */
#ifndef WORLDS_SWARM_H
#define WORLDS_SWARM_H

#include <stdbool.h>
#include <stdint.h>

#include "run.h"

#define SWARM_SAYS_MAX 1024

/* By what lasts to the end; a load beside the surroundings counts with these. */
typedef enum {
    SWARM_NOTHING = 0,  /* what steps, if anything, is no such thing */
    SWARM_LOAD,         /* transformation temperatures of one, several or all springs */
    SWARM_SURROUNDINGS, /* the losses, the room's temperature, or both */
    SWARM_GROUPS
} swarm_group_t;

typedef enum {
    SWARM_SYNCHRONOUS = 0,
    SWARM_DECLARED,
    SWARM_UNDECLARED,
    SWARM_DIODES
} swarm_diode_t;

typedef struct {
    run_case_t
        run; /* run.step_s is set where the step is of the size that must be come back from */
    swarm_group_t group;
    swarm_diode_t diode; /* that freewheels */
    bool steps;          /* anything at all changes in the run but the noise */
    bool second;         /* the second truth: other equations of transformation and convection */
    bool levels;         /* springs are asked for levels, too */
    bool told;  /* its alloy's temperatures are: the board knows another martensite start */
    bool tells; /* the resistance changes enough with the phase to tell it */
    bool broken[WORLD_SPRINGS_MAX];       /* its sensor is: it is right to give it up */
    uint64_t drawn;                       /* a bit for each of swarm_says */
    double loss_change, ambient_change_k; /* the lasting step's; 0: none */
    char says[SWARM_SAYS_MAX];            /* what was drawn, in words */
} swarm_case_t;

/* Run number 'index' of that seed. Each disturbance is drawn from a sequence of its own, so that
 * one that is changed leaves the others as they are. */
void swarm_draw(uint64_t seed, int index, double seconds, swarm_case_t *swarm);

/* The list of what is drawn, for --help: NULL beyond its end. */
const char *swarm_says(int disturbance, double *probability);

#endif
