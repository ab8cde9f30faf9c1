#include "crc16.h"

/* The well-known shift form of the CCITT polynomial: no table, no loop over bits. */
uint16_t crc16_add(uint16_t crc, uint8_t byte)
{
    uint8_t x = (uint8_t)((uint8_t)(crc >> 8) ^ byte);
    x = (uint8_t)(x ^ (x >> 4));
    const uint16_t wide = x;
    return (uint16_t)((uint16_t)(crc << 8) ^ (uint16_t)(wide << 12) ^ (uint16_t)(wide << 5) ^ wide);
}

uint16_t crc16_add_bytes(uint16_t crc, const void *bytes, uint16_t length)
{
    const uint8_t *next = bytes;
    for (uint16_t i = 0; i < length; i++) {
        crc = crc16_add(crc, next[i]);
    }
    return crc;
}
