/* What it is for: how warm the room is, by a thermistor that may lie.
 * What it owns: the last temperature that it could have been, and one of up to a second before.
 * What it never does: measure, know the setting's name. */
#ifndef AMBIENT_H
#define AMBIENT_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define AMBIENT_TICKS   50u        /* a second */
#define AMBIENT_MOST_C7 (10 * 128) /* in which no room changes by more */
#define AMBIENT_LOW_C7  (-10 * 128)
#define AMBIENT_HIGH_C7 (50 * 128)
#define AMBIENT_BAD     5u /* ticks on end: a reading may be disturbed */

/* All zero: nothing was measured yet. */
typedef struct {
    int16_t second_c7; /* as measured up to a second ago */
    int16_t before_c7; /* a second before that */
    uint8_t tick;
    uint8_t bad; /* ticks on end without a temperature that a room can have, to AMBIENT_BAD */
    bool known : 1;
    bool settled : 1; /* and has been for a second: before, a jump begins anew, as where a wire is
                     put right and a filter is on its way there */
} ambient_t;

/* One tick of 20 ms; reads: the thermistor gives a temperature at all. Returns the room's. A
 * temperature outside AMBIENT_LOW_C7 to AMBIENT_HIGH_C7, in which nobody works, or off by more than
 * AMBIENT_MOST_C7 from what it was within the second before is none: a bead follows air in 5 s or
 * more, so between the coldest and the warmest room, 40 K, it moves by 8 K/s. Then that of one to
 * two seconds before holds, as what followed may have been on the way there; or, where there was
 * none, set_c7. */
int16_t ambient_take(ambient_t *ambient, bool reads, int16_t measured_c7, int16_t set_c7);

/* True if and only if for AMBIENT_BAD ticks on end there was none. */
static inline bool ambient_is_held(const ambient_t *ambient)
{
    return ambient->bad >= AMBIENT_BAD;
}

#ifdef __cplusplus
}
#endif
#endif
