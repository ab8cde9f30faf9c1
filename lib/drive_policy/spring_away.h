/* What it is for: how long a driven spring has not been where it was asked to be, and how often it
 * was heated again in vain.
 * What it owns: the times after which that is said, and how many tries there are.
 * What it never does: know where a spring is. */
#ifndef SPRING_AWAY_H
#define SPRING_AWAY_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Zero: nothing was asked of it yet. */
typedef struct {
    uint16_t turns; /* since it was asked for; ahead by FIRST - LEFT once it was there */
    uint16_t tried; /* turns that its tries still count */
} spring_away_t;

/* A turn in which it is driven. */
void spring_away_turn(spring_away_t *away, bool there);
/* True if and only if it is not there 85 s after it was asked, or 15 s after it left. */
bool spring_away_says(const spring_away_t *away);
/* It has lost its phase: true, and a try is taken, if it may be heated again. There are four
 * (for a load that comes and goes), one more every ten minutes, and one for each 15 s in which it
 * is there. Else it stays as it is. */
bool spring_away_try(spring_away_t *away);

#ifdef __cplusplus
}
#endif
#endif
