#include "spring_sights.h"

#include <stddef.h>
#include <string.h>

void spring_sights_drop(spring_sights_t *sights, const spring_sight_t *sight)
{
    const uint8_t at = (uint8_t)(sight - sights->sight);
    sights->count--;
    memmove(&sights->sight[at], &sights->sight[at + 1u],
            (size_t)(sights->count - at) * sizeof(spring_sight_t));
}

void spring_sights_turn(spring_sights_t *sights)
{
    sights->turn++;
    if (sights->count != 0 &&
        spring_sights_age_turns(sights, &sights->sight[0]) > SPRING_SIGHTS_TURNS) {
        spring_sights_drop(sights, &sights->sight[0]);
    }
}

/* The oldest of the spring that has most: one that has much to tell leaves the others theirs. One
 * that is of no spring, as a bit of it has turned over, is missed least. */
static uint8_t least_missed(const spring_sights_t *sights)
{
    uint8_t of[THERMAL_MODEL_MAX_SPRINGS] = {0};
    uint8_t most = 0;
    for (uint8_t i = 0; i < sights->count; i++) {
        if (sights->sight[i].spring >= THERMAL_MODEL_MAX_SPRINGS) {
            return i;
        }
        const uint8_t has = ++of[sights->sight[i].spring];
        most = has > most ? has : most;
    }
    uint8_t at = 0;
    while (of[sights->sight[at].spring] != most) {
        at++;
    }
    return at;
}

spring_sight_t *spring_sights_add(spring_sights_t *sights, uint8_t spring)
{
    if (sights->count == SPRING_SIGHTS_KEPT) {
        spring_sights_drop(sights, &sights->sight[least_missed(sights)]);
    }
    spring_sight_t *const sight = &sights->sight[sights->count++];
    *sight = (spring_sight_t){.turn = sights->turn, .number = sights->numbers++, .spring = spring};
    return sight;
}

spring_sight_t *spring_sights_renew(spring_sights_t *sights, const spring_sight_t *sight)
{
    const spring_sight_t goes_on = *sight;
    spring_sights_drop(sights, sight);
    spring_sight_t *const renewed = &sights->sight[sights->count++];
    *renewed = goes_on;
    renewed->turn = sights->turn;
    renewed->number = sights->numbers++;
    return renewed;
}

spring_sight_t *spring_sights_newest(spring_sights_t *sights, uint8_t spring)
{
    for (uint8_t i = sights->count; i != 0; i--) {
        if (sights->sight[i - 1u].spring == spring) {
            return &sights->sight[i - 1u];
        }
    }
    return NULL;
}

const spring_sight_t *spring_sights_from(const spring_sights_t *sights, uint8_t spring,
                                         uint32_t from)
{
    for (uint8_t i = 0; i < sights->count; i++) {
        const spring_sight_t *const sight = &sights->sight[i];
        if ((spring == SPRING_SIGHTS_ANY || sight->spring == spring) &&
            sight->number - from <= INT32_MAX) {
            return sight;
        }
    }
    return NULL;
}

uint32_t spring_sights_first(const spring_sights_t *sights)
{
    return sights->numbers - (uint32_t)INT32_MAX;
}

uint16_t spring_sights_age_turns(const spring_sights_t *sights, const spring_sight_t *sight)
{
    return (uint16_t)(sights->turn - sight->turn);
}
