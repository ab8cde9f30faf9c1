#include "spring_sights.h"

#include <stddef.h>

/* How many were noted since: their numbers come round. */
static uint32_t since(const spring_sights_t *sights, const spring_sight_t *sight)
{
    return sights->numbers - sight->number;
}

static bool is_of(const spring_sight_t *sight, uint8_t spring)
{
    return spring == SPRING_SIGHTS_ANY || sight->spring == spring;
}

/* Of a spring, or of any; NULL where there is none. */
static spring_sight_t *oldest(spring_sights_t *sights, uint8_t spring)
{
    spring_sight_t *found = NULL;
    for (uint8_t i = 0; i < sights->count; i++) {
        spring_sight_t *const sight = &sights->sight[i];
        if (is_of(sight, spring) &&
            (found == NULL || since(sights, sight) > since(sights, found))) {
            found = sight;
        }
    }
    return found;
}

void spring_sights_drop(spring_sights_t *sights, const spring_sight_t *sight)
{
    sights->count--;
    sights->sight[sight - sights->sight] = sights->sight[sights->count];
}

void spring_sights_turn(spring_sights_t *sights)
{
    sights->turn++;
    const spring_sight_t *const first = oldest(sights, SPRING_SIGHTS_ANY);
    if (first != NULL && spring_sights_age_turns(sights, first) > SPRING_SIGHTS_TURNS) {
        spring_sights_drop(sights, first);
    }
}

/* The oldest of the spring that has most: one that has much to tell leaves the others theirs. One
 * that is of no spring, as a bit of it has turned over, is missed least. */
static spring_sight_t *least_missed(spring_sights_t *sights)
{
    uint8_t of[THERMAL_MODEL_MAX_SPRINGS] = {0};
    uint8_t most = 0;
    for (uint8_t i = 0; i < sights->count; i++) {
        const uint8_t spring = sights->sight[i].spring;
        if (spring >= THERMAL_MODEL_MAX_SPRINGS) {
            return &sights->sight[i];
        }
        of[spring]++;
        most = of[spring] > of[most] ? spring : most;
    }
    return oldest(sights, most);
}

spring_sight_t *spring_sights_add(spring_sights_t *sights, uint8_t spring)
{
    spring_sight_t *const sight = sights->count == SPRING_SIGHTS_KEPT
                                      ? least_missed(sights)
                                      : &sights->sight[sights->count++];
    *sight = (spring_sight_t){.turn = sights->turn, .number = sights->numbers++, .spring = spring};
    return sight;
}

void spring_sights_renew(spring_sights_t *sights, spring_sight_t *sight)
{
    sight->turn = sights->turn;
    sight->number = sights->numbers++;
}

spring_sight_t *spring_sights_newest(spring_sights_t *sights, uint8_t spring)
{
    spring_sight_t *found = NULL;
    for (uint8_t i = 0; i < sights->count; i++) {
        spring_sight_t *const sight = &sights->sight[i];
        if (sight->spring == spring &&
            (found == NULL || since(sights, sight) < since(sights, found))) {
            found = sight;
        }
    }
    return found;
}

const spring_sight_t *spring_sights_from(const spring_sights_t *sights, uint8_t spring,
                                         uint32_t from)
{
    const spring_sight_t *found = NULL;
    for (uint8_t i = 0; i < sights->count; i++) {
        const spring_sight_t *const sight = &sights->sight[i];
        if (is_of(sight, spring) && sight->number - from <= INT32_MAX &&
            (found == NULL || sight->number - from < found->number - from)) {
            found = sight;
        }
    }
    return found;
}

uint32_t spring_sights_first(const spring_sights_t *sights)
{
    return sights->numbers - (uint32_t)INT32_MAX;
}

uint16_t spring_sights_age_turns(const spring_sights_t *sights, const spring_sight_t *sight)
{
    return (uint16_t)(sights->turn - sight->turn);
}
