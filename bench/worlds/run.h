/* What it is for: one run of the controller in one world, from power-on, as a user would start it.
 * What it owns: the words that are typed (pattern, policy), the reset, the score.
 * What it never does: hint: the controller is told nothing that a user would not tell it. */
#ifndef WORLDS_RUN_H
#define WORLDS_RUN_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "losses.h"
#include "score.h"
#include "world.h"

#define RUN_COMMANDS_MAX 64

/* Typed in the run: which springs are on from then on. */
typedef struct {
    double time_s;
    bool on[WORLD_SPRINGS_MAX];
    uint16_t level_permille[WORLD_SPRINGS_MAX]; /* of one that is on; 0: fully */
} run_command_t;

/* Who drives. */
typedef enum {
    RUN_CONTROLLER = 0, /* as it is */
    RUN_GIVES_UP,       /* a worse one, for tests: what must be heated again is switched off */
    RUN_KNOWS           /* whoever knows all that is true (knowing.h): what physics leaves */
} run_driver_t;

typedef struct {
    world_parameters_t world;
    bool on[WORLD_SPRINGS_MAX]; /* asked for at the beginning */
    int commands;
    run_command_t command[RUN_COMMANDS_MAX]; /* in order of time */
    double seconds;
    controller_settings_t settings; /* what the board is told of its array */
    uint8_t fan_percent;            /* the same of its fan: typed at power-on */
    double reset_s, reset_gap_s;    /* power goes off then, for so long; 0: never */
    double step_s, stepped_s; /* the surroundings change for good from then to then; 0: never */
    run_driver_t driver;
    bool learnt; /* the same array was driven before, and the board has kept what it learnt */
} run_case_t;

typedef struct {
    score_t score;
    losses_t losses;
    double wall_s; /* processor time of this thread */
} run_result_t;

/* trace: CSV of truth and belief every 0.2 s, or NULL. False if and only if the world or the
 * controller refuses its parameters. */
bool run_case(const run_case_t *run, run_result_t *result, FILE *trace);

#endif
