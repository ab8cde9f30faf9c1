#include <stddef.h>

#include "spring_estimator_internal.h"
#include "sum16.h"

#define SEALED_FROM offsetof(spring_belief_t, variance_k2)

static uint16_t checksum_of(const spring_estimator_t *e, uint8_t k)
{
    const uint8_t *const belief = (const uint8_t *)&e->spring[k];
    return sum16_add_bytes(SUM16_START, belief + SEALED_FROM,
                           sizeof(spring_belief_t) - SEALED_FROM);
}

/* Of the sights what finds them: their own words decide nothing. */
static uint16_t checksum_of_shared(const spring_estimator_t *e)
{
    return sum16_add_bytes(SUM16_START, &e->r_phase_odds,
                           offsetof(spring_estimator_t, sights) + offsetof(spring_sights_t, sight) -
                               offsetof(spring_estimator_t, r_phase_odds));
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
    spring_begin_alloy(e);
    e->stepped_turns = 0;
    e->stepped_spring = 0;
    e->doubtful = true; /* where it turned over by itself; who begins says what it is */
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
