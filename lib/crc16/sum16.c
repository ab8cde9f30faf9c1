#include "sum16.h"

uint16_t sum16_add_bytes(uint16_t sum, const void *bytes, uint16_t length)
{
    const uint8_t *next = bytes;
    for (uint16_t left = length / 2u; left != 0; left--, next += 2) {
        const uint16_t two = (uint16_t)(next[0] | (uint16_t)next[1] << 8u);
        sum = (uint16_t)((uint16_t)(sum << 1u | sum >> 15u) + two);
    }
    return length % 2u != 0 ? (uint16_t)(sum + *next) : sum;
}
