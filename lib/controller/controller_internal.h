/* What it is for: what controller.c and controller_fixed.c share.
 * What it owns: nothing.
 * What it never does: serve anybody outside this folder. */
#ifndef CONTROLLER_INTERNAL_H
#define CONTROLLER_INTERNAL_H

#include "controller.h"

/* A scrub_stretches_t of a controller_t. */
scrub_stretch_t controller_fixed(const void *owner, uint8_t index);

#endif
