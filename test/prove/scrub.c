/* sources: lib/scrub/scrub.c lib/crc16/crc16.c */
#include "scrub.h"
#include "prove.h"

/* Two stretches of any content, with nothing to read between them or beyond; of one length, as
 * intervals would not know which of two belongs to which. */
static uint8_t first[300], second[300];

static scrub_stretch_t stretches(const void *owner, uint8_t index)
{
    (void)owner;
    if (index == 0) {
        return (scrub_stretch_t){first, sizeof first};
    }
    return index == 1 ? (scrub_stretch_t){second, sizeof second} : (scrub_stretch_t){first, 0};
}

void main(void)
{
    /* What it keeps is RAM as well: any of it may have turned over. */
    scrub_t scrub = {any_u16(), any_u16(), any_u16(), any_u8(), any_bool()};
    for (uint16_t k = 0; k < sizeof first; k++) {
        first[k] = any_u8();
        second[k] = any_u8();
    }
    if (any_bool()) {
        scrub_start(&scrub, stretches, NULL);
    }
    while (any_bool()) {
        if (any_bool()) {
            scrub_open(&scrub, stretches, NULL);
            second[any_between(0, sizeof first - 1)] = any_u8();
            scrub_seal(&scrub, stretches, NULL);
        }
        (void)scrub_step(&scrub, stretches, NULL, any_u8());
        (void)scrub_is_sound(&scrub);
    }
}
