/* What it is for: the estimator's rules one at a time, from beliefs that are written down.
 * What it owns: tables of what must come of them.
 * What it never does: live a spring's life (test_spring_estimator.c does). */
#ifndef RULES_H
#define RULES_H

#include <stddef.h>

#define M SPRING_PHASE_MARTENSITE
#define B SPRING_PHASE_BETWEEN
#define A SPRING_PHASE_AUSTENITE

/* A turn's readings of a resistance: 12 of them tell it to 1/24 mohm at 2 A. */
void give_readings(int readings, double current_a, double ohm);

#endif
