#include "controller_internal.h"

#include <stddef.h>

/* What settings decide, of every part: it changes where settings do and nowhere else. */
scrub_stretch_t controller_fixed(const void *owner, uint8_t index)
{
    const controller_t *const c = owner;
    const thermal_model_t *const model = &c->model;
    switch (index) {
    case 0:
        return (scrub_stretch_t){model, offsetof(thermal_model_t, fan_percent)};
    case 1:
        return (scrub_stretch_t){&model->air, offsetof(thermal_model_slow_node_t, midstep_c6)};
    case 2:
        return (scrub_stretch_t){&model->plate, offsetof(thermal_model_slow_node_t, midstep_c6)};
    case 3:
        return (scrub_stretch_t){&c->drive, sizeof c->drive};
    case 4:
        return (scrub_stretch_t){&c->current, offsetof(current_control_t, even_turn)};
    case 5:
        return (scrub_stretch_t){&c->safety, offsetof(safety_t, board_fault)};
    case 6:
        return (scrub_stretch_t){&c->estimator, SPRING_ESTIMATOR_FIXED_BYTES};
    case 7:
        return (scrub_stretch_t){&c->policy, offsetof(drive_policy_t, queue)};
    case 8:
        return (scrub_stretch_t){&c->springs, sizeof c->springs};
    default:
        if (index - 9u < THERMAL_MODEL_MAX_SPRINGS) {
            return (scrub_stretch_t){&model->spring[index - 9u],
                                     offsetof(thermal_model_spring_t, loss_uw_per_k)};
        }
        return (scrub_stretch_t){0};
    }
}
