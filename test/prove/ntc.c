/* sources: lib/ntc/ntc.c */
#include "ntc.h"

#include "prove.h"

void main(void)
{
    int16_t temperature_c7;
    if (ntc_temperature_c7(any_u16(), &temperature_c7)) {
        /*@ assert in_range: -20 * 128 <= temperature_c7 <= 80 * 128; */
    }
}
