/* What it is for: the checksum of what is in RAM and compared in each turn: a fifth of the cycles
 * of a CRC, of which a tick has too few. What it owns: nothing. What it never does: guard what is
 * stored or sent (crc16.h). */
#ifndef SUM16_H
#define SUM16_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* With it, bytes that are all 0 were never sealed. */
#define SUM16_START 0x5EA1u

/* Adds length bytes, two at a time, to sum and returns the new one. A change of two bytes that lie
 * side by side always shows, of anything else all but one in 65536. Never fails. O(length). */
uint16_t sum16_add_bytes(uint16_t sum, const void *bytes, uint16_t length);

#ifdef __cplusplus
}
#endif
#endif
