/* What it is for: the checksum of everything that is stored or sent: settings record, frames, kept
 * state.
 * What it owns: nothing.
 * What it never does: keep a table; it is called for a few bytes at a time. */
#ifndef CRC16_H
#define CRC16_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define CRC16_START 0xFFFFu

/* CRC-16/CCITT-FALSE (polynomial 0x1021, start 0xFFFF, not reflected): all single, double and odd
 * bit errors and every burst up to 16 bits are detected in records below 4 KB.
 * Adds one byte to crc and returns the new crc. Never fails. */
uint16_t crc16_add(uint16_t crc, uint8_t byte);

/* The same over length bytes. */
uint16_t crc16_add_bytes(uint16_t crc, const void *bytes, uint16_t length);

#ifdef __cplusplus
}
#endif
#endif
