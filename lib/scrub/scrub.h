/* What it is for: finds that RAM which is written seldom has changed by itself.
 * What it owns: a checksum over some stretches of bytes, and how far the running pass over them is.
 * What it never does: mend, or write what it watches. */
#ifndef SCRUB_H
#define SCRUB_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    const void *bytes;
    uint16_t length; /* 0: there is no such stretch, nor one behind it */
} scrub_stretch_t;

/* The stretches of owner, by index from 0; the same ones at each call. It and owner are arguments
 * of all that follows, and not kept: a pointer in RAM could turn over, too. */
typedef scrub_stretch_t (*scrub_stretches_t)(const void *owner, uint8_t index);

/* Internal. All stretches together are below 4 KB (crc16.h). */
typedef struct {
    uint16_t sealed;  /* the checksum of what was written last */
    uint16_t running; /* of the pass under way, up to here */
    uint16_t at;      /* in that stretch */
    uint8_t index;
    bool broken;
} scrub_t;

/* What owner has now is right: for whoever writes all of it. O(bytes). */
void scrub_start(scrub_t *scrub, scrub_stretches_t stretches, const void *owner);
/* Around a change of a part of it: looks whether all is as it was, so that the seal does not take
 * for right what has changed by itself; then takes what is there now. Each O(bytes). */
void scrub_open(scrub_t *scrub, scrub_stretches_t stretches, const void *owner);
void scrub_seal(scrub_t *scrub, scrub_stretches_t stretches, const void *owner);

/* Goes on by at most that many bytes. True when this was the end of a pass. O(bytes). */
bool scrub_step(scrub_t *scrub, scrub_stretches_t stretches, const void *owner, uint8_t bytes);

/* False if and only if a pass or scrub_open has found a change that nobody sealed, since
 * scrub_start. */
bool scrub_is_sound(const scrub_t *scrub);

#ifdef __cplusplus
}
#endif
#endif
