/* What it is for: springs share a supply: tells whether one's circuit shows another share of it
 * than those of the others do, or than its own did.
 * What it owns: of each spring, what its last window showed, and what it shows beside the others.
 * What it never does: know the supply, latch a fault. It uses floating point, once in a window. */
#ifndef CIRCUIT_PEERS_H
#define CIRCUIT_PEERS_H

#include <stdbool.h>
#include <stdint.h>

#include "circuit_check.h"
#include "parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

#ifndef CIRCUIT_PEERS_MAX
#ifdef __AVR__
#define CIRCUIT_PEERS_MAX 9
#else
#define CIRCUIT_PEERS_MAX 64
#endif
#endif

#define CIRCUIT_PEERS_LEAST   3u /* others: one that lies is outvoted, whatever they show */
#define CIRCUIT_PEERS_WINDOWS 3u /* on end */

/* Shares: voltage found behind a switch, of the voltage that its duty should bring. */
typedef struct {
    uint16_t volts : 15;   /* in 16 mV: the sum of those at which it was learnt */
    uint16_t beside : 1;   /* was_q7 is of what the others showed, not of the supply */
    uint16_t own_q12 : 13; /* its share of the others'; 0: not known */
    uint16_t odd : 2;      /* windows on end */
    uint16_t agreed : 1;   /* a window that was not odd, since the last clear */
    uint8_t share_q7;      /* of the last window, over its own share; 0: it told nothing */
    uint8_t shown_16mv;    /* the voltage that should have been there then */
    uint8_t was_q7;        /* of some before the last, that were not odd; 0: none was */
    uint8_t was_16mv;      /* the voltage that should have been there then */
    uint8_t learnt;        /* windows that its own share is the mean of; at its most it stays */
} circuit_peer_t;

/* All zero: nothing is known. */
typedef struct {
    circuit_peer_t spring[CIRCUIT_PEERS_MAX];
} circuit_peers_t;

/* Takes a spring's window. True if and only if for CIRCUIT_PEERS_WINDOWS on end the voltage that
 * was found is off from the expected one, times the middle share of the other springs that are
 * driven and times its own share of theirs, by more than 5 % and what offsets make: at the least of
 * the voltages at which the two were read and its own share was learnt. As long as its own share is
 * not known, by 18 % (its wiring, its gains).
 * It takes CIRCUIT_PEERS_LEAST others to outvote one that lies, or two that agree if its own share
 * is known. Where they do, it is odd, too, if it is off by more than 5 % and 8 mV from what it
 * showed beside them before: a mean of such windows, each a quarter of it, that were at about the
 * same volts as theirs, so that supply, drop and offsets are in both. What offsets and an unknown
 * drop make of other volts, its own and theirs, is let pass; another belief changes nothing of it.
 * Beside fewer, the one at most volts is what a supply that moves is told by: a spring
 * that shows as much beside it as ever is acquitted; one that does not is odd if it has changed
 * itself, by 5 %, from what it showed before. Where nobody tells, the least that is odd is 10 %
 * less or 20 % more (its supply may move, and one that shows more makes its spring colder), and 5 %
 * once it was found and cleared. What it showed before is the window before the last at about the
 * same volts, as in the last one another share may begin, and none that is off by more than those,
 * though offsets may be that; offsets make of it what they make of other volts, and noise 8 mV.
 * What is not known of the drop teaches no share as far as volts differ, more where less of them is
 * found, and is let pass, and acquits nobody who was found; nor does a window that only offsets
 * explain. Its own share is the mean, by volts, of the first 127 windows that are not odd and in
 * which offsets make less than those 18 %, and stays: so a drift is found, however slow. Of the
 * first two it is what they show beside the mean of both. The others count each over its own share:
 * a set that changes moves nothing. A window that tells nothing, or of less than 0.1 V, is no
 * witness for the others, and changes nothing else. Fills in the window's beside, outvoted and
 * acquitted. springs at most CIRCUIT_PEERS_MAX, spring below springs. */
bool circuit_peers_judge(circuit_peers_t *peers, uint8_t springs, uint8_t spring,
                         circuit_window_t *window, const circuit_source_t *source);

/* Another rule has found that the spring's sensor began to lie: as if three windows had been odd.
 * before_q12: the share that it showed until then, above 0. */
void circuit_peers_suspect(circuit_peers_t *peers, uint8_t spring, uint16_t before_q12);

/* Supply and drop are believed to be others: shares of before are of no use, but for what one that
 * was found showed until then. */
void circuit_peers_renew(circuit_peers_t *peers, uint8_t springs, const circuit_source_t *before,
                         const circuit_source_t *now);

/* A fault is cleared: the spring's row ends, but for its last window where it was full: the next
 * window is enough then, as a heating of a sensor that lies costs 12 K a second. What is known of
 * it stays, as nobody mends a sensor by clearing; but not where its readings were doubted though
 * they agreed with it: then it is of a sensor that was wrong from the first, and may be another one
 * now. */
void circuit_peers_clear(circuit_peers_t *peers, uint8_t spring, bool doubted);

#ifdef __cplusplus
}
#endif
#endif
