/* What it is for: the tests of what is noted for whoever asks why.
 * What it owns: nothing.
 * What it never does: look at a belief that no record is of. */
#ifndef SIGHTS_H
#define SIGHTS_H

#include "spring_sights.h"

/* The last one that was noted; there must be one. */
const spring_sight_t *newest(void);
/* A sight of that kind is among those that are kept. */
bool is_noted(spring_sight_kind_t kind);

#endif
