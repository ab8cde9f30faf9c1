#include "belief_adapter.h"

#include <math.h>

double belief_temperature_c(const controller_t *controller, int spring)
{
    return controller_temperature_c7(controller, (uint8_t)spring) / 128.0;
}

double belief_austenite(const controller_t *controller, int spring)
{
    return controller_austenite_permille(controller, (uint8_t)spring) / 1000.0;
}

static belief_bounds_t bounds(spring_bounds_t b)
{
    return (belief_bounds_t){(double)b.low, (double)b.high};
}
belief_bounds_t belief_temperature_bounds_c(const controller_t *c, int spring)
{
    return bounds(controller_temperature_bounds_c(c, (uint8_t)spring));
}

belief_bounds_t belief_austenite_bounds(const controller_t *c, int spring)
{
    return bounds(controller_austenite_bounds(c, (uint8_t)spring));
}

belief_bounds_t belief_distance_bounds_k(const controller_t *c, int spring)
{
    return bounds(controller_distance_bounds_k(c, (uint8_t)spring));
}

/* For a fault of another spring, which stands in the status line, all are off. */
static bool stands_still(const controller_t *controller)
{
    return controller_is_locked(controller) || controller_supply_is_off(controller);
}

bool belief_reported(const controller_t *controller, int spring)
{
    /* 'blind' says how the spring is known, not that it is not where it was asked to be. */
    return (belief_said(controller, spring) & ~BELIEF_SAID_BLIND) != 0u;
}

unsigned belief_said(const controller_t *controller, int spring)
{
    const unsigned limits = controller_limits(controller, (uint8_t)spring);
    /* 'current' only says that the spring heats as fast as it may */
    const unsigned known =
        DRIVE_POLICY_LIMIT_CURRENT | DRIVE_POLICY_LIMIT_BLIND | DRIVE_POLICY_LIMIT_AWAY;
    const unsigned others = limits & ~known;
    return (belief_fault(controller, spring) != SAFETY_FAULT_NONE || stands_still(controller)
                ? BELIEF_SAID_FAULT
                : 0u) |
           ((limits & DRIVE_POLICY_LIMIT_AWAY) != 0 ? BELIEF_SAID_AWAY : 0u) |
           (others != 0 ? BELIEF_SAID_LIMIT : 0u) |
           ((limits & DRIVE_POLICY_LIMIT_BLIND) != 0 ? BELIEF_SAID_BLIND : 0u);
}

int belief_fault(const controller_t *controller, int spring)
{
    const safety_fault_t own = controller_fault(controller, (uint8_t)spring);
    return (int)(own != SAFETY_FAULT_NONE ? own : controller_board_fault(controller));
}

int belief_next_loss(const controller_t *controller, uint32_t *from)
{
    const spring_sights_t *sights = controller_sights(controller);
    const spring_sight_t *sight;
    while ((sight = spring_sights_from(sights, SPRING_SIGHTS_ANY, *from)) != NULL) {
        *from = sight->number + 1u;
        if (sight->kind == SPRING_SIGHT_LOST) {
            return sight->spring;
        }
    }
    return -1;
}

/* As lib/learnt_store does, at once and without an EEPROM. */
void belief_keep(const controller_t *controller, belief_memory_t *memory)
{
    for (uint8_t k = 0; k < controller_springs(controller); k++) {
        memory->learnt[k] = controller_to_keep(controller, k);
    }
    memory->valid = true;
}

void belief_restore(controller_t *controller, const belief_memory_t *memory)
{
    for (uint8_t k = 0; memory->valid && k < controller_springs(controller); k++) {
        controller_restore_learnt(controller, k, &memory->learnt[k]);
    }
}
