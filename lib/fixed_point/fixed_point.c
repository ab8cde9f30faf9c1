#include "fixed_point.h"

uint32_t fixed_point_multiply_divide(uint32_t a, uint32_t b, uint32_t c)
{
    if (c == 0) {
        return UINT32_MAX;
    }
    const uint64_t quotient = ((uint64_t)a * b + c / 2u) / c;
    return quotient > UINT32_MAX ? UINT32_MAX : (uint32_t)quotient;
}

int16_t fixed_point_c7_from_cc(int16_t cc)
{
    const int32_t scaled = (int32_t)cc * 32;
    return (int16_t)((scaled + (scaled < 0 ? -12 : 12)) / 25);
}
