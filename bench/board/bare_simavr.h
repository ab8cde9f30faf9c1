/* What it is for: simavr alone with an ELF, as its own example program runs it: what the board is
 * measured against.
 * What it owns: one core.
 * What it never does: connect anything to its pins. */
#ifndef BARE_SIMAVR_H
#define BARE_SIMAVR_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct avr_t bare_simavr_t;

/* idle_pwm: timers 3 to 5 are kept from running and low pins from being polled, as on the board.
 * NULL if and only if simavr refuses the file. */
bare_simavr_t *bare_simavr_create(const char *elf, bool idle_pwm);
void bare_simavr_run(bare_simavr_t *core, uint64_t cycles);
/* Cycles that the core slept. */
uint64_t bare_simavr_idle_cycles(const bare_simavr_t *core);
void bare_simavr_destroy(bare_simavr_t *core);

#ifdef __cplusplus
}
#endif
#endif
