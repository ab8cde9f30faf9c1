#include "sum16.h"

static inline uint16_t add_two(uint16_t sum, const uint8_t *bytes)
{
    const uint16_t two = (uint16_t)(bytes[0] | (uint16_t)bytes[1] << 8u);
    return (uint16_t)((uint16_t)(sum << 1u | sum >> 15u) + two);
}

/* Four in a round: to count them takes the target as long as to add two. */
uint16_t sum16_add_bytes(uint16_t sum, const void *bytes, uint16_t length)
{
    const uint8_t *next = bytes;
    for (uint16_t left = length / 4u; left != 0; left--, next += 4) {
        sum = add_two(add_two(sum, next), next + 2);
    }
    if ((length & 2u) != 0) {
        sum = add_two(sum, next);
        next += 2;
    }
    return (length & 1u) != 0 ? (uint16_t)(sum + *next) : sum;
}
