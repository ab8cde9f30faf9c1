#include <stddef.h>

#include "spring_estimator_internal.h"

#define SEALED_FROM offsetof(spring_belief_t, variance_k2)

#define SUM_OF_NOTHING 0x5EA1u /* bytes that are all 0 were never sealed */

/* A change of two bytes that lie side by side always shows, of anything else all but one in 65536:
 * a fifth of the cycles of a CRC, of which a tick has too few. */
static uint16_t checksum(const void *bytes, uint16_t length)
{
    const uint8_t *next = bytes;
    uint16_t sum = SUM_OF_NOTHING;
    for (uint16_t left = length / 2u; left != 0; left--, next += 2) {
        const uint16_t two = (uint16_t)(next[0] | (uint16_t)next[1] << 8u);
        sum = (uint16_t)((uint16_t)(sum << 1u | sum >> 15u) + two);
    }
    return length % 2u != 0 ? (uint16_t)(sum + *next) : sum;
}

static uint16_t checksum_of(const spring_estimator_t *e, uint8_t k)
{
    const uint8_t *const belief = (const uint8_t *)&e->spring[k];
    return checksum(belief + SEALED_FROM, sizeof(spring_belief_t) - SEALED_FROM);
}

/* Of the sights what finds them: their own words decide nothing. */
static uint16_t checksum_of_shared(const spring_estimator_t *e)
{
    return checksum(&e->stepped_turns, offsetof(spring_estimator_t, sights) +
                                           offsetof(spring_sights_t, sight) -
                                           offsetof(spring_estimator_t, stepped_turns));
}

bool spring_is_sound(const spring_estimator_t *e, uint8_t k)
{
    return e->seal[k] == checksum_of(e, k);
}

void spring_seal(spring_estimator_t *e, uint8_t k)
{
    e->seal[k] = checksum_of(e, k);
}

void spring_count_broken(spring_estimator_t *e)
{
    e->broken_seals = e->broken_seals < UINT8_MAX ? (uint8_t)(e->broken_seals + 1) : UINT8_MAX;
}

void spring_begin_shared(spring_estimator_t *e)
{
    e->stepped_turns = 0;
    e->stepped_spring = 0;
    e->sights.turn = 0;
    e->sights.count = 0; /* whoever has been told of some goes on by their numbers */
}

void spring_open_shared(spring_estimator_t *e)
{
    if (e->shared_seal != checksum_of_shared(e)) {
        spring_begin_shared(e);
        spring_count_broken(e);
    }
}

void spring_seal_shared(spring_estimator_t *e)
{
    e->shared_seal = checksum_of_shared(e);
}
