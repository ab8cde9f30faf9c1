#include "fixed_point.h"

uint32_t fixed_point_multiply_divide(uint32_t a, uint32_t b, uint32_t c)
{
    if (c == 0 || c > 0x80000000u) {
        return UINT32_MAX;
    }
    /* the product of the low bits of a, kept as quotient and remainder of c; term is 2^k b */
    uint32_t quotient = 0;
    uint32_t remainder = 0;
    uint32_t term_quotient = b / c;
    uint32_t term_remainder = b % c;
    bool term_fits = true;
    while (a != 0) {
        if ((a & 1u) != 0) {
            uint32_t sum = quotient + term_quotient;
            if (!term_fits || sum < quotient) {
                return UINT32_MAX;
            }
            quotient = sum;
            remainder += term_remainder; /* both below c <= 2^31 */
            if (remainder >= c) {
                remainder -= c;
                if (++quotient == 0) {
                    return UINT32_MAX;
                }
            }
        }
        a >>= 1;
        term_fits = term_fits && term_quotient < 0x80000000u;
        term_quotient <<= 1;
        term_remainder <<= 1;
        if (term_remainder >= c) {
            term_remainder -= c;
            if (++term_quotient == 0) {
                term_fits = false;
            }
        }
    }
    if (remainder >= c - remainder) {
        return quotient == UINT32_MAX ? UINT32_MAX : quotient + 1;
    }
    return quotient;
}
