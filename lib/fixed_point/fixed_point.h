/* What it is for: the few integer products the tick needs, each one instruction sequence on the
 * AVR.
 * What it owns: the meaning of each product (width, rounding, sign), in C and, for AVR, in
 * assembly held to the C.
 * What it never does: keep state; in what a tick calls: divide, branch on data, produce a 64-bit
 * value. */
#ifndef FIXED_POINT_H
#define FIXED_POINT_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The same products in plain C, for every machine: the assembly is tested
 * against these on the target. */

/* accumulator + a b, modulo 2^32: partial sums may pass the ends as long as the
 * final sum fits. */
static inline uint32_t fixed_point_mac_u16_in_c(uint32_t accumulator, uint16_t a, uint16_t b)
{
    return accumulator + (uint32_t)a * (uint32_t)b;
}

/* accumulator - a b, modulo 2^32. */
static inline uint32_t fixed_point_subtract_u16_in_c(uint32_t accumulator, uint16_t a, uint16_t b)
{
    return accumulator - (uint32_t)a * (uint32_t)b;
}

/* accumulator + a b with a signed a, modulo 2^32. */
static inline uint32_t fixed_point_mac_s16_u16_in_c(uint32_t accumulator, int16_t a, uint16_t b)
{
    return accumulator + (uint32_t)(int32_t)a * (uint32_t)b;
}

/* a b / 2^16 for signed a of 24 bits (-2^23 .. 2^23 - 1) and b below 2^24: the floor, or up to 2
 * below it, as of the nine partial products the lowest is left out and two count with their upper
 * byte only. */
static inline int32_t fixed_point_scale_s24_in_c(int32_t a, uint32_t b)
{
    uint32_t a0 = (uint32_t)a & 0xffu;
    uint32_t a1 = ((uint32_t)a >> 8) & 0xffu;
    uint32_t a21 = (uint32_t)(a >> 8); /* signed */
    uint32_t a2 = (uint32_t)(a >> 16); /* signed */
    uint32_t b0 = b & 0xffu;
    uint32_t b1 = (b >> 8) & 0xffu;
    return (int32_t)(a21 * (b >> 8) + ((a0 * b1) >> 8) + a0 * (b >> 16) + ((a1 * b0) >> 8) +
                     a2 * b0);
}

#ifdef __AVR__

/* 22 cycles; avr-gcc's own call takes three times that, loads and stores
 * counted. */
static inline __attribute__((always_inline)) uint32_t fixed_point_mac_u16(uint32_t accumulator,
                                                                          uint16_t a, uint16_t b)
{
    uint8_t zero;
    __asm__("clr %[zero]\n\t"
            "mul %A[a], %A[b]\n\t"
            "add %A[sum], r0\n\t"
            "adc %B[sum], r1\n\t"
            "adc %C[sum], %[zero]\n\t"
            "adc %D[sum], %[zero]\n\t"
            "mul %B[a], %B[b]\n\t"
            "add %C[sum], r0\n\t"
            "adc %D[sum], r1\n\t"
            "mul %A[a], %B[b]\n\t"
            "add %B[sum], r0\n\t"
            "adc %C[sum], r1\n\t"
            "adc %D[sum], %[zero]\n\t"
            "mul %B[a], %A[b]\n\t"
            "add %B[sum], r0\n\t"
            "adc %C[sum], r1\n\t"
            "adc %D[sum], %[zero]\n\t"
            "clr r1"
            : [sum] "+r"(accumulator), [zero] "=&r"(zero)
            : [a] "r"(a), [b] "r"(b)
            : "r0");
    return accumulator;
}

static inline __attribute__((always_inline)) uint32_t
fixed_point_subtract_u16(uint32_t accumulator, uint16_t a, uint16_t b)
{
    uint8_t zero;
    __asm__("clr %[zero]\n\t"
            "mul %A[a], %A[b]\n\t"
            "sub %A[sum], r0\n\t"
            "sbc %B[sum], r1\n\t"
            "sbc %C[sum], %[zero]\n\t"
            "sbc %D[sum], %[zero]\n\t"
            "mul %B[a], %B[b]\n\t"
            "sub %C[sum], r0\n\t"
            "sbc %D[sum], r1\n\t"
            "mul %A[a], %B[b]\n\t"
            "sub %B[sum], r0\n\t"
            "sbc %C[sum], r1\n\t"
            "sbc %D[sum], %[zero]\n\t"
            "mul %B[a], %A[b]\n\t"
            "sub %B[sum], r0\n\t"
            "sbc %C[sum], r1\n\t"
            "sbc %D[sum], %[zero]\n\t"
            "clr r1"
            : [sum] "+r"(accumulator), [zero] "=&r"(zero)
            : [a] "r"(a), [b] "r"(b)
            : "r0");
    return accumulator;
}

/* The unsigned product less 2^16 b where a is negative: 26 cycles. */
static inline __attribute__((always_inline)) uint32_t fixed_point_mac_s16_u16(uint32_t accumulator,
                                                                              int16_t a, uint16_t b)
{
    accumulator = fixed_point_mac_u16(accumulator, (uint16_t)a, b);
    __asm__("sbrc %B[a], 7\n\t"
            "sub %C[sum], %A[b]\n\t"
            "sbrc %B[a], 7\n\t"
            "sbc %D[sum], %B[b]"
            : [sum] "+r"(accumulator)
            : [a] "r"(a), [b] "r"(b));
    return accumulator;
}

/* Bytes 2..5 of the unsigned product, less 2^24 b where a is negative: 49
 * cycles. */
static inline __attribute__((always_inline)) int32_t fixed_point_scale_s24(int32_t a, uint32_t b)
{
    int32_t result;
    uint8_t zero;
    __asm__("clr %[zero]\n\t"
            "mul %B[a], %B[b]\n\t"
            "movw %A[p], r0\n\t"
            "mul %C[a], %C[b]\n\t"
            "movw %C[p], r0\n\t"
            "mul %A[a], %B[b]\n\t"
            "add %A[p], r1\n\t"
            "adc %B[p], %[zero]\n\t"
            "adc %C[p], %[zero]\n\t"
            "adc %D[p], %[zero]\n\t"
            "mul %B[a], %A[b]\n\t"
            "add %A[p], r1\n\t"
            "adc %B[p], %[zero]\n\t"
            "adc %C[p], %[zero]\n\t"
            "adc %D[p], %[zero]\n\t"
            "mul %A[a], %C[b]\n\t"
            "add %A[p], r0\n\t"
            "adc %B[p], r1\n\t"
            "adc %C[p], %[zero]\n\t"
            "adc %D[p], %[zero]\n\t"
            "mul %C[a], %A[b]\n\t"
            "add %A[p], r0\n\t"
            "adc %B[p], r1\n\t"
            "adc %C[p], %[zero]\n\t"
            "adc %D[p], %[zero]\n\t"
            "mul %B[a], %C[b]\n\t"
            "add %B[p], r0\n\t"
            "adc %C[p], r1\n\t"
            "adc %D[p], %[zero]\n\t"
            "mul %C[a], %B[b]\n\t"
            "add %B[p], r0\n\t"
            "adc %C[p], r1\n\t"
            "adc %D[p], %[zero]\n\t"
            "sbrs %C[a], 7\n\t"
            "rjmp .+6\n\t"
            "sub %B[p], %A[b]\n\t"
            "sbc %C[p], %B[b]\n\t"
            "sbc %D[p], %C[b]\n\t"
            "clr r1"
            : [p] "=&r"(result), [zero] "=&r"(zero)
            : [a] "r"(a), [b] "r"(b)
            : "r0");
    return result;
}

#else

#define fixed_point_mac_u16      fixed_point_mac_u16_in_c
#define fixed_point_subtract_u16 fixed_point_subtract_u16_in_c
#define fixed_point_mac_s16_u16  fixed_point_mac_s16_u16_in_c
#define fixed_point_scale_s24    fixed_point_scale_s24_in_c

#endif

/* floor(a b / 2^16). */
static inline uint16_t fixed_point_high_u16(uint16_t a, uint16_t b)
{
    return (uint16_t)(fixed_point_mac_u16(0, a, b) >> 16);
}

/* floor(a b / 2^8), modulo 2^16. */
static inline int16_t fixed_point_scale_s16_u8(int16_t a, uint8_t b)
{
    return (int16_t)(uint16_t)(fixed_point_mac_s16_u16(0, a, b) >> 8);
}

/* a, held at -2^23 and 2^23 - 1. */
static inline int32_t fixed_point_clamp_s24(int32_t a)
{
    if (a > 0x7fffff) {
        return 0x7fffff;
    }
    return a < -0x800000 ? -0x800000 : a;
}

/* a + b, held at INT32_MIN and INT32_MAX. */
static inline int32_t fixed_point_add_saturated(int32_t a, int32_t b)
{
#ifdef __AVR__
    __asm__("add %A[a], %A[b]\n\t"
            "adc %B[a], %B[b]\n\t"
            "adc %C[a], %C[b]\n\t"
            "adc %D[a], %D[b]\n\t"
            "brvc 1f\n\t"
            "ldi %A[a], 0xff\n\t"
            "ldi %B[a], 0xff\n\t"
            "ldi %C[a], 0xff\n\t"
            "ldi %D[a], 0x7f\n\t"
            "sbrs %D[b], 7\n\t"
            "rjmp 1f\n\t"
            "clr %A[a]\n\t"
            "clr %B[a]\n\t"
            "clr %C[a]\n\t"
            "ldi %D[a], 0x80\n\t"
            "1:"
            : [a] "+d"(a)
            : [b] "r"(b));
    return a;
#else
    uint32_t sum = (uint32_t)a + (uint32_t)b;
    if ((int32_t)(((uint32_t)a ^ sum) & ((uint32_t)b ^ sum)) < 0) {
        return a < 0 ? INT32_MIN : INT32_MAX;
    }
    return (int32_t)sum;
#endif
}

/* a b / c rounded to the nearest, without a 64-bit division; UINT32_MAX where that does
 * not fit or c is 0 or above 2^31. 32 shifts: for start-up, not for the tick. */
uint32_t fixed_point_multiply_divide(uint32_t a, uint32_t b, uint32_t c);

/* 1/100 degC to Q9.7, rounded; at most 255 degC either way. Divides: not for the tick. */
int16_t fixed_point_c7_from_cc(int16_t cc);

#ifdef __cplusplus
}
#endif
#endif
