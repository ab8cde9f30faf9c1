/* What it is for: keeps what was learnt of each spring over power-off, with few writes.
 * What it owns: how these numbers lie in a record, and when they are worth a save.
 * What it never does: judge a number (spring_estimator does), or wait for a byte to be written. */
#ifndef LEARNT_STORE_H
#define LEARNT_STORE_H

#include <stdbool.h>
#include <stdint.h>

#include "controller.h"
#include "record_store.h"

#ifdef __cplusplus
extern "C" {
#endif

#define LEARNT_STORE_KIND                                                                          \
    6u /* of record; a change of its bytes or of their meaning takes a new one */
#define LEARNT_STORE_MARK_BYTES 2u /* controller_model_mark, beside which losses were learnt */
#define LEARNT_STORE_BYTES(springs)                                                                \
    ((uint16_t)(LEARNT_STORE_MARK_BYTES + (springs) * sizeof(spring_learnt_t)))

/* After so long with every driven spring held, and no sooner than a pause after the save before.
 * Each save that only refines doubles the pause until the next: where learning never settles these
 * are 7 in the first day and 2.2 in each that follows.
 * A save writes byte 0 of one of the two slots twice, so 100,000 writes are 100,000 saves: 120
 * years of a board that is never switched off. The pause begins anew with the power: at worst, one
 * that is switched off after each save, every 11 minutes and never rests, 2 years. */
#define LEARNT_STORE_HELD_S        60u
#define LEARNT_STORE_PAUSE_S       600u
#define LEARNT_STORE_LONGEST_SHIFT 6u /* 10.7 h */

typedef struct {
    record_store_t record;
    uint16_t since_s;               /* the last save began; stays at 65535 */
    uint8_t refined;                /* saves that only refined; stays at the longest shift */
    uint8_t held_s;                 /* all driven springs, on end; stays at LEARNT_STORE_HELD_S */
    const controller_t *controller; /* whose springs are kept */
    spring_learnt_t written;        /* of the spring that is written, of a save under way */
} learnt_store_t;

/* Finds the record and gives the controller, which has been initialised, what it holds of each of
 * its springs, but no losses that were learnt beside another model than it has; it must stay valid.
 * slot_bytes must hold LEARNT_STORE_BYTES and RECORD_OVERHEAD_BYTES. */
record_found_t learnt_store_open(learnt_store_t *store, const record_storage_t *storage,
                                 uint16_t base, uint16_t slot_bytes, controller_t *controller);

/* Once a second. Starts a save if and only if both times above have passed (after what is new, the
 * shortest pause) and of a spring
 * something is known that the record has not: its first numbers, losses beside the present model, a
 * resistance that differs by 2 %, a loss that differs by its standard deviation or is known twice
 * as well, a noise that has doubled. */
void learnt_store_second(learnt_store_t *store, const controller_t *controller);
/* Goes on with a save under way: at most one byte. May be left out for a while. */
record_save_t learnt_store_step(learnt_store_t *store);
/* The controller's springs are forgotten, and a save of nothing starts. */
void learnt_store_clear(learnt_store_t *store, controller_t *controller);
/* Whether the record holds anything. */
bool learnt_store_keeps(const learnt_store_t *store);

#ifdef __cplusplus
}
#endif
#endif
