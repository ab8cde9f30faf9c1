#include "scrub.h"

#include "crc16.h"

static void begin_pass(scrub_t *scrub)
{
    scrub->running = CRC16_START;
    scrub->at = 0;
    scrub->index = 0;
}

static uint16_t checksum(scrub_stretches_t stretches, const void *owner)
{
    uint16_t crc = CRC16_START;
    uint8_t index = 0;
    scrub_stretch_t stretch = stretches(owner, index);
    while (stretch.length != 0) {
        crc = crc16_add_bytes(crc, stretch.bytes, stretch.length);
        stretch = stretches(owner, ++index);
    }
    return crc;
}

void scrub_start(scrub_t *scrub, scrub_stretches_t stretches, const void *owner)
{
    scrub->broken = false;
    scrub_seal(scrub, stretches, owner);
}

void scrub_open(scrub_t *scrub, scrub_stretches_t stretches, const void *owner)
{
    scrub->broken = scrub->broken || checksum(stretches, owner) != scrub->sealed;
}

void scrub_seal(scrub_t *scrub, scrub_stretches_t stretches, const void *owner)
{
    scrub->sealed = checksum(stretches, owner);
    begin_pass(scrub);
}

bool scrub_step(scrub_t *scrub, scrub_stretches_t stretches, const void *owner, uint8_t bytes)
{
    while (bytes > 0) {
        const scrub_stretch_t stretch = stretches(owner, scrub->index);
        if (stretch.length == 0) {
            scrub->broken = scrub->broken || scrub->running != scrub->sealed;
            begin_pass(scrub);
            return true;
        }
        /* a bit of at may have turned over, too: where it is beyond the end the pass fails. Byte by
         * byte, not by crc16_add_bytes: that each is within the stretch is then proved
         * (script/prove) */
        const uint8_t *const next = stretch.bytes;
        for (; bytes > 0 && scrub->at < stretch.length; bytes--, scrub->at++) {
            scrub->running = crc16_add(scrub->running, next[scrub->at]);
        }
        if (scrub->at >= stretch.length) {
            scrub->at = 0;
            scrub->index++;
        }
    }
    return false;
}

bool scrub_is_sound(const scrub_t *scrub)
{
    return !scrub->broken;
}
