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
        /* at is below the length, or a bit of it has turned over, too: then the pass fails */
        const uint16_t left =
            scrub->at < stretch.length ? (uint16_t)(stretch.length - scrub->at) : 0u;
        const uint8_t now = (uint8_t)(left < bytes ? left : bytes);
        scrub->running =
            crc16_add_bytes(scrub->running, (const uint8_t *)stretch.bytes + scrub->at, now);
        scrub->at = (uint16_t)(scrub->at + now);
        bytes = (uint8_t)(bytes - now);
        if (now == left) {
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
