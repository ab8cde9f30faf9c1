/* What it is for: that springs may be warm, noted over power-off.
 * What it owns: the cells of the EEPROM that say so, and which of them is written.
 * What it never does: keep anything in RAM, wait for a byte to be written, or know what is warm. */
#ifndef WARM_MARK_H
#define WARM_MARK_H

#include <stdbool.h>
#include <stdint.h>

#include "record_store.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A mark takes one cell, in turn, and is two writes a drive until all is cold, 3 minutes or more:
 * 100,000 writes of each are 800,000 drives, 4.5 years of nothing else. */
#define WARM_MARK_BYTES 16u

/* A cell that does not read as erased: also one whose write, of either kind, was cut short. */
bool warm_mark_is_set(const record_storage_t *storage, uint16_t base);

/* Writes at most one byte, where the mark is not as it should be and the storage is ready. Called
 * once a second, with a number that goes on: a mark that a worn cell does not keep then goes to
 * another one, and several that are to be taken away go one after the other. O(WARM_MARK_BYTES). */
void warm_mark_second(const record_storage_t *storage, uint16_t base, bool warm, uint32_t turn);

#ifdef __cplusplus
}
#endif
#endif
