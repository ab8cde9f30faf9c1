/* What it is for: what the controller says publicly of each spring, in the campaign's units.
 * What it owns: the one place that knows which of the controller's functions say it.
 * What it never does: judge it, or look at the truth. */
#ifndef BELIEF_ADAPTER_H
#define BELIEF_ADAPTER_H

#include <stdbool.h>
#include <stdint.h>

#include "controller.h"

/* Both NaN: nothing is said. */
typedef struct {
    double low, high;
} belief_bounds_t;

double belief_temperature_c(const controller_t *controller, int spring); /* best guess */
double belief_austenite(const controller_t *controller, int spring);     /* 0..1, best guess */
belief_bounds_t belief_temperature_bounds_c(const controller_t *controller, int spring);
belief_bounds_t belief_austenite_bounds(const controller_t *controller, int spring);
/* Temperature above martensite start, as the spring is loaded now, K. */
belief_bounds_t belief_distance_bounds_k(const controller_t *controller, int spring);

/* A fault, or a limit that says why the spring is not where it was asked to be. */
bool belief_reported(const controller_t *controller, int spring);

/* What is said of it, of any kind: BELIEF_SAID_ bits. */
#define BELIEF_SAID_FAULT 1u
#define BELIEF_SAID_AWAY  2u
#define BELIEF_SAID_LIMIT 4u /* any other that cuts the drive */
#define BELIEF_SAID_BLIND 8u
unsigned belief_said(const controller_t *controller, int spring);
/* The fault of a spring, else of the board; SAFETY_FAULT_NONE (0): none. */
int belief_fault(const controller_t *controller, int spring);

/* The spring of the next sight of lost phase, of those whose number is *from or later; -1: none.
 * *from is then the number of what comes after. */
int belief_next_loss(const controller_t *controller, uint32_t *from);

/* What is kept over power-off. */
typedef struct {
    spring_learnt_t learnt[CONTROLLER_MAX_SPRINGS];
    bool valid;
} belief_memory_t;
void belief_keep(const controller_t *controller, belief_memory_t *memory);
void belief_restore(controller_t *controller, const belief_memory_t *memory);

#endif
