#include "crc16.h"

/* The well-known shift form of the CCITT polynomial, x << 12 ^ x << 5 ^ x, in bytes: no table, no
 * loop over bits, nothing wider than what the chip shifts at once. */
uint16_t crc16_add(uint16_t crc, uint8_t byte)
{
    uint8_t x = (uint8_t)((uint8_t)(crc >> 8) ^ byte);
    x = (uint8_t)(x ^ (x >> 4));
    const uint8_t high = (uint8_t)((uint8_t)crc ^ (uint8_t)(x << 4) ^ (x >> 3));
    const uint8_t low = (uint8_t)(x ^ (uint8_t)(x << 5));
    return (uint16_t)((uint16_t)high << 8 | low);
}

uint16_t crc16_add_bytes(uint16_t crc, const void *bytes, uint16_t length)
{
    const uint8_t *next = bytes;
    for (uint16_t i = 0; i < length; i++) {
        crc = crc16_add(crc, next[i]);
    }
    return crc;
}
