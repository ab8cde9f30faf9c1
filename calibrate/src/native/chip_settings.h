/* What it is for: console lines `$name=value` over the firmware's defaults, as the chip would have
 * them. What it owns: which lines are settings and which mean nothing. What it never does: judge
 * whether the settings fit together. */
#ifndef CHIP_SETTINGS_H
#define CHIP_SETTINGS_H

#include <stdbool.h>
#include <stddef.h>

#include "settings.h"

/* Defaults for an array of rows x columns, then each line; comments (#) and empty lines mean
 * nothing. Fails if and only if a line is refused, message (size > 0) gets that line, the lines are
 * of an array of another size, or a board has not so many springs. */
bool chip_settings(settings_t *settings, int rows, int columns, const char *lines, char *message,
                   size_t size);

#endif
