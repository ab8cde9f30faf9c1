#include "fixed_point.h"

uint32_t fixed_point_multiply_divide(uint32_t a, uint32_t b, uint32_t c)
{
    if (c == 0 || c > 0x80000000u) {
        return UINT32_MAX;
    }
    const uint64_t product = (uint64_t)a * b;
    uint32_t remainder = (uint32_t)(product >> 32);
    uint32_t quotient = (uint32_t)product; /* its bits make room for the quotient's */
    if (remainder >= c) {
        return UINT32_MAX;
    }
    for (uint8_t bit = 0; bit < 32; bit++) {
        remainder = remainder << 1 | quotient >> 31; /* was below c <= 2^31 */
        quotient <<= 1;
        if (remainder >= c) {
            remainder -= c;
            quotient |= 1u;
        }
    }
    if (remainder >= c - remainder && quotient != UINT32_MAX) {
        quotient++;
    }
    return quotient;
}

int16_t fixed_point_c7_from_cc(int16_t cc)
{
    const int32_t scaled = (int32_t)cc * 32;
    return (int16_t)((scaled + (scaled < 0 ? -12 : 12)) / 25);
}
