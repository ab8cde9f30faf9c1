/* sources: lib/safety/circuit_check.c
 * options: -eva-precision 2 */
#include "circuit_check.h"

#include "prove.h"

/* Frama-C knows its declaration only. */
float fmaxf(float a, float b)
{
    return a > b ? a : b;
}

void main(void)
{
    circuit_check_t check = {0};
    const circuit_source_t source = any_source();
    while (any_bool()) {
        for (uint8_t tick = 0; tick < CIRCUIT_CHECK_TICKS; tick++) {
            circuit_check_take(&check, any_u16(), any_u8(), (uint16_t)any_between(0, 800),
                               any_bool(), any_s16(), any_s16());
        }
        (void)circuit_check_judge(&check, &source, any_u16(), 0);
    }
}
