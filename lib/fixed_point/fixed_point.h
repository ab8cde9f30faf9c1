/* What it is for: the few integer products the tick needs.
 * What it owns: the meaning of each product (width, rounding, sign).
 * What it never does: keep state; divide in what a tick calls. */
#ifndef FIXED_POINT_H
#define FIXED_POINT_H

#include <stdbool.h>
#include <stdint.h>

#include "invariant.h"

#ifdef __cplusplus
extern "C" {
#endif

/* accumulator + a b, modulo 2^32: partial sums may pass the ends as long as the
 * final sum fits. */
static inline uint32_t fixed_point_mac_u16(uint32_t accumulator, uint16_t a, uint16_t b)
{
    return accumulator + (uint32_t)a * (uint32_t)b;
}

/* accumulator + a b with a signed a, modulo 2^32. */
static inline uint32_t fixed_point_mac_s16_u16(uint32_t accumulator, int16_t a, uint16_t b)
{
    return accumulator + (uint32_t)(int32_t)a * (uint32_t)b;
}

/* a b / 2^31, rounded to the nearest; not for a and b of both -2^31. */
static inline int32_t fixed_point_scale_q31(int32_t a, int32_t b)
{
    const int64_t scaled = ((int64_t)a * b + INT64_C(0x40000000)) >> 31;
    INVARIANT(scaled >= INT32_MIN && scaled <= INT32_MAX);
    return (int32_t)scaled;
}

/* floor(a b / 2^16). */
static inline uint16_t fixed_point_high_u16(uint16_t a, uint16_t b)
{
    return (uint16_t)(fixed_point_mac_u16(0, a, b) >> 16);
}

/* a + b, held at INT32_MIN and INT32_MAX. */
static inline int32_t fixed_point_add_saturated(int32_t a, int32_t b)
{
    uint32_t sum = (uint32_t)a + (uint32_t)b;
    if ((int32_t)(((uint32_t)a ^ sum) & ((uint32_t)b ^ sum)) < 0) {
        return a < 0 ? INT32_MIN : INT32_MAX;
    }
    return (int32_t)sum;
}

/* a b / c rounded to the nearest; UINT32_MAX where that does not fit or c is 0. Divides in 64 bits:
 * for start-up, not for the tick. */
uint32_t fixed_point_multiply_divide(uint32_t a, uint32_t b, uint32_t c);

/* 1/100 degC to Q9.7, rounded; at most 255 degC either way. Divides: not for the tick. */
int16_t fixed_point_c7_from_cc(int16_t cc);

#ifdef __cplusplus
}
#endif
#endif
