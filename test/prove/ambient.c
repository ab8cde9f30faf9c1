/* sources: lib/ambient/ambient.c */
#include "ambient.h"

#include "prove.h"

void main(void)
{
    ambient_t ambient = {0};
    while (any_bool()) {
        const int16_t set_c7 = (int16_t)any_between(AMBIENT_LOW_C7, AMBIENT_HIGH_C7);
        const int16_t taken_c7 = ambient_take(&ambient, any_bool(), any_s16(), set_c7);
        /*@ assert a_room: AMBIENT_LOW_C7 <= taken_c7 <= AMBIENT_HIGH_C7; */
        (void)ambient_is_held(&ambient);
    }
}
