/* What it is for: what the files of telemetry share.
 * What it owns: nothing.
 * What it never does: serve anyone else. */
#ifndef TELEMETRY_INTERNAL_H
#define TELEMETRY_INTERNAL_H

#include "telemetry.h"

void telemetry_count_dropped(telemetry_t *telemetry, uint8_t lines);

#endif
