/* What it is for: a driver that knows all that is true: what it cannot do, no controller can.
 * What it owns: which springs heat.
 * What it never does: read a sensor, or believe anything. */
#ifndef WORLDS_KNOWING_H
#define WORLDS_KNOWING_H

#include <stdbool.h>
#include <stdint.h>

#include "world.h"

typedef struct {
    bool heats[WORLD_SPRINGS_MAX];
} knowing_t;

/* Duties of the next tick, 0..CONTROLLER_DUTY_MAX, for levels of 0 (off) to 1000 (fully on). No
 * part of a spring is heated above 120 degC; no more is given than the supply has. */
void knowing_drive(knowing_t *knowing, const world_parameters_t *parameters, const world_t *world,
                   const uint16_t level_permille[], uint16_t duty[]);

#endif
