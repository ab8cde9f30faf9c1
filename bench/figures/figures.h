/* What it is for: the figures of a benchmark: printed for a reader, kept for script/results.
 * What it owns: their table, its form as JSON, and the clock they are taken with.
 * What it never does: measure or judge. */
#ifndef FIGURES_H
#define FIGURES_H

#include <stdbool.h>

/* The file of `[--json FILE]`, or NULL. Ends the program for --help, and with 2 for anything else.
 */
const char *figures_json(int argc, char **argv, const char *program);

/* Prints a figure and keeps it. Texts are copied, the name's first 119 characters. target: empty
 * for none. Ends the program if there are more than 64. */
void figures_add(const char *figure, double value, const char *unit, const char *target);

/* Processor time of this process, s: other users of the machine do not count. */
double figures_cpu_s(void);

/* Writes what was added, whole or not at all, as [{"figure", "value", "unit", "target", "command"},
 * ...]. False if it cannot be written: it has said so on stderr, and nothing is left behind. */
bool figures_save(const char *path, const char *command);

#endif
