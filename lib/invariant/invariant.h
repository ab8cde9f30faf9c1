/* What it is for: says what is always true, so that whatever breaks it stops there and then.
 * What it owns: nothing. It is on in every build for a host; on the chip in firmware_checked.elf
 * (NINESPRING_CHECKED), which the swarm runs, and nowhere else: it then costs nothing.
 * What it never does: judge what comes from outside; that is refused, with a status. */
#ifndef INVARIANT_H
#define INVARIANT_H

#if defined(__AVR__) && defined(NINESPRING_CHECKED)
#include <avr/pgmspace.h>

#ifdef __cplusplus
extern "C" {
#endif
/* The firmware's: outputs off, and a reset that says which (board_mega.c). The text is in flash. */
void invariant_broken(const char *condition) __attribute__((noreturn));
#ifdef __cplusplus
}
#endif

#define INVARIANT(condition) ((condition) ? (void)0 : invariant_broken(PSTR("broken: " #condition)))
#elif defined(__AVR__)
#define INVARIANT(condition) ((void)sizeof(condition)) /* checked by the compiler, never run */
#else
#include <stdio.h>
#include <stdlib.h>

static inline void invariant_broken(const char *condition, const char *file, int line)
{
    fprintf(stderr, "%s:%d: broken: %s\n", file, line, condition);
    abort();
}

#define INVARIANT(condition)                                                                       \
    ((condition) ? (void)0 : invariant_broken(#condition, __FILE__, __LINE__))
#endif

#endif
