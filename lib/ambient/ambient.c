#include "ambient.h"

static bool is_far(int16_t one_c7, int16_t other_c7)
{
    const int16_t more_c7 = (int16_t)(one_c7 - other_c7);
    return more_c7 > AMBIENT_MOST_C7 || more_c7 < -AMBIENT_MOST_C7;
}

static int16_t hold(ambient_t *ambient, int16_t set_c7)
{
    if (ambient->bad < AMBIENT_BAD) {
        ambient->bad++;
    }
    if (!ambient->settled) {
        ambient->known = false;
    }
    return ambient->known ? ambient->before_c7 : set_c7;
}

int16_t ambient_take(ambient_t *ambient, bool reads, int16_t measured_c7, int16_t set_c7)
{
    if (!reads || measured_c7 < AMBIENT_LOW_C7 || measured_c7 > AMBIENT_HIGH_C7 ||
        (ambient->known && is_far(measured_c7, ambient->second_c7))) {
        return hold(ambient, set_c7);
    }
    ambient->bad = 0;
    if (!ambient->known) {
        *ambient = (ambient_t){measured_c7, measured_c7, .known = true};
    } else if (++ambient->tick >= AMBIENT_TICKS) {
        ambient->tick = 0;
        ambient->settled = true;
        ambient->before_c7 = ambient->second_c7;
        ambient->second_c7 = measured_c7;
    }
    return measured_c7;
}
