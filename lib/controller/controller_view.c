#include "controller_internal.h"

/* ---- what is believed ---- */

bool controller_is_warm(const controller_t *controller, uint8_t spring)
{
    return temperature_ceiling_is_warm(&controller->ceiling, spring);
}

bool controller_is_doubtful(const controller_t *controller, uint8_t spring)
{
    return controller->ceiling.doubtful && controller_cooling_s(controller, spring) > 0.0f;
}

float controller_delivered_c(const controller_t *controller, uint8_t spring)
{
    return temperature_ceiling_c(&controller->ceiling, spring);
}

uint16_t controller_rest_s(const controller_t *controller, uint8_t spring)
{
    return temperature_ceiling_rest_s(&controller->ceiling, spring);
}

spring_bounds_t controller_temperature_bounds_c(const controller_t *controller, uint8_t spring)
{
    return spring_estimator_temperature_c(&controller->estimator, &controller->model, spring);
}

spring_bounds_t controller_distance_bounds_k(const controller_t *controller, uint8_t spring)
{
    return spring_estimator_distance_k(&controller->estimator, &controller->model, spring);
}

spring_bounds_t controller_austenite_bounds(const controller_t *controller, uint8_t spring)
{
    return spring_estimator_austenite(&controller->estimator, &controller->model, spring);
}

bool controller_losses(const controller_t *controller, float *factor, float *sd)
{
    return spring_estimator_losses(&controller->estimator, factor, sd);
}

const circuit_source_t *controller_source(const controller_t *controller)
{
    return &controller->source;
}

float controller_shift_k(const controller_t *controller, uint8_t spring)
{
    return spring_estimator_shift_k(spring_estimator_of(&controller->estimator, spring));
}

uint16_t controller_belief_mark(const controller_t *controller, uint8_t spring)
{
    return spring_estimator_mark(&controller->estimator, &controller->model, spring);
}

uint8_t controller_broken_seals(const controller_t *controller)
{
    const uint8_t beliefs = spring_estimator_broken_seals(&controller->estimator);
    const uint8_t ceilings = temperature_ceiling_broken_seals(&controller->ceiling);
    return beliefs < UINT8_MAX - ceilings ? (uint8_t)(beliefs + ceilings) : UINT8_MAX;
}

const spring_sights_t *controller_sights(const controller_t *controller)
{
    return spring_estimator_sights(&controller->estimator);
}

float controller_cooling_s(const controller_t *controller, uint8_t spring)
{
    const float cooling_s =
        spring_estimator_cooling_s(&controller->estimator, &controller->model, spring);
    return cooling_s < CONTROLLER_COOLING_MOST_S ? cooling_s : CONTROLLER_COOLING_MOST_S;
}

/* ---- what is measured, driven and said ---- */

uint8_t controller_springs(const controller_t *controller)
{
    return controller->springs;
}

uint16_t controller_level_permille(const controller_t *controller, uint8_t spring)
{
    return controller->level_permille[spring];
}

uint16_t controller_target_ma(const controller_t *controller, uint8_t spring)
{
    return controller->policy.spring[spring].target_ma;
}

int16_t controller_measured_ma(const controller_t *controller, uint8_t spring)
{
    return controller->measured_ma[spring];
}

int16_t controller_measured_mv(const controller_t *controller, uint8_t spring)
{
    return controller->measured_mv[spring];
}

uint32_t controller_power_uw(const controller_t *controller, uint8_t spring)
{
    if (controller->current.channel[spring].blind_ticks != 0 &&
        controller_duty(controller, spring) == 0) {
        return 0;
    }
    const uint32_t measured_uw = (uint32_t)controller_flowing_ma(controller->measured_ma[spring]) *
                                 controller_positive_mv(controller->measured_mv[spring]);
    return measured_uw < THERMAL_MODEL_HIGHEST_POWER_UW ? measured_uw
                                                        : THERMAL_MODEL_HIGHEST_POWER_UW;
}

uint16_t controller_duty(const controller_t *controller, uint8_t spring)
{
    return current_control_duty(&controller->current, spring);
}

int16_t controller_temperature_c7(const controller_t *controller, uint8_t spring)
{
    return thermal_model_temperature_c7(&controller->model, spring);
}

uint16_t controller_austenite_permille(const controller_t *controller, uint8_t spring)
{
    return (uint16_t)((thermal_model_austenite(&controller->model, spring) * 1000ul) >> 15);
}

safety_fault_t controller_fault(const controller_t *controller, uint8_t spring)
{
    return safety_fault(&controller->safety, spring);
}

safety_fault_t controller_board_fault(const controller_t *controller)
{
    return safety_board_fault(&controller->safety);
}

uint16_t controller_limits(const controller_t *controller, uint8_t spring)
{
    const uint16_t limits = drive_policy_limits(&controller->policy, spring);
    return (limits & DRIVE_POLICY_LIMIT_SAFETY) != 0 && controller_waits_anew(controller, spring) &&
                   safety_allows(&controller->safety, spring)
               ? DRIVE_POLICY_LIMIT_COOLING
               : limits;
}

uint16_t controller_cut_ma(const controller_t *controller, uint8_t spring)
{
    return drive_policy_cut_ma(&controller->policy, spring);
}

drive_policy_stage_t controller_stage(const controller_t *controller, uint8_t spring)
{
    return drive_policy_stage(&controller->policy, spring);
}

bool controller_is_locked(const controller_t *controller)
{
    return safety_is_locked(&controller->safety);
}

uint8_t controller_fan_percent(const controller_t *controller)
{
    return controller->fan_percent;
}

drive_policy_kind_t controller_policy(const controller_t *controller)
{
    return (drive_policy_kind_t)controller->policy.parameters.policy;
}
