/* What it is for: tells whether a spring's circuit has changed as a sensor does that begins to lie,
 * at once or little by little, and no spring, contact or supply.
 * What it owns: what the last window of one spring showed, and one since which nothing else has
 * changed.
 * What it never does: ask another spring but for what a window is told of them, latch a fault. It
 * uses floating point, once in a window. */
#ifndef CIRCUIT_STEP_H
#define CIRCUIT_STEP_H

#include <stdbool.h>
#include <stdint.h>

#include "circuit_check.h"
#include "parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CIRCUIT_STEP_WINDOWS 2u /* on end */

typedef struct {
    uint16_t share_q12; /* voltage found behind the switch, of the expected; 0: it told nothing */
    uint16_t ohm_q12;
    uint8_t current_16ma;
} circuit_shown_t;

/* Of one spring; all zero: nothing is known. */
typedef struct {
    /* What it showed at its present current, and at the one before: the first window since which
     * resistance and share have moved by little, or as a lie that grows moves both. */
    circuit_shown_t was[2];
    uint8_t odd : 2;     /* windows on end, which were not kept */
    uint8_t windows : 2; /* at this current, saturating */
    uint8_t again : 1;   /* it has come back to this current */
    uint8_t moved : 1;   /* the last window was one that something else has changed */
    uint8_t beside : 1;  /* shares are of what the others showed, not of the supply */
} circuit_step_t;

/* Takes a spring's window. True if and only if for CIRCUIT_STEP_WINDOWS on end, at a current within
 * a half of what it was, resistance is off by more than 10 % AND the share of the expected voltage
 * that is found behind the switch by more than 4 % (and what 4 mV make of either) from what the
 * window that is kept showed. Supply and wiring change the share and not the resistance; a contact
 * changes the resistance and hardly the share; a spring changes its resistance by a tenth in 1.8 s
 * at the most (3 A, the least latent heat in print), and never the share. A sensor that begins to
 * show another part of its current changes the share by about half of the lie. What is kept goes
 * along in the second window on end that is off by more than 6 or 3 %; but it stays as long as both
 * move as a lie moves them that lets its spring get hotter, the share down, by a fourth part to all
 * of the resistance: so such a lie is found, however slowly it grows. One that grows the other way
 * makes its spring colder, and is not told from a supply that rises as it transforms.
 * A window that others outvote is judged by its share of theirs in place of that of the supply, so
 * that a supply that all see move is nothing of its own; from the one kind to the other all begins
 * anew. Of the others, one that is acquitted beside them is not odd.
 * At another current, or where a window tells nothing, is of less than 0.1 V or of less than 16 mA,
 * another window is kept, and this one beside it, if it was for 3 of them: a lie that has the
 * spring heated again is held against the hold before. There both must be off as such a lie moves
 * them, the share by 6 %: others may have begun since. A window of two currents is judged so, too,
 * where their mean is as before; else it is left out. */
bool circuit_step_judge(circuit_step_t *step, const circuit_window_t *window,
                        const circuit_source_t *source,
                        const current_control_parameters_t *circuit);

/* Another supply is believed: of that, the voltages that the springs showed are another share. With
 * another drop, too, each is another one by its duty, and what was known ends. */
void circuit_step_renew(circuit_step_t steps[], uint8_t springs, const circuit_source_t *before,
                        const circuit_source_t *now);

/* The share that it is held against at its present current; 0: none is known. */
static inline uint16_t circuit_step_before_q12(const circuit_step_t *step)
{
    return step->was[0].share_q12;
}

#ifdef __cplusplus
}
#endif
#endif
