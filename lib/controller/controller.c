#include "controller.h"

#include <stddef.h>
#include <string.h>

#include "fixed_point.h"

#define MODEL_STEP_MS   100u
#define TICKS_PER_STEP  (MODEL_STEP_MS / CONTROLLER_TICK_MS)
#define CURRENT_MOST_MA 4095 /* the sensor ends at 3200: a step's sum of power fits 32 bits */

#ifdef __AVR__
#define HOT    __attribute__((noinline, optimize("O2")))
#define ALWAYS __attribute__((always_inline))
#else
#define HOT
#define ALWAYS
#endif

void controller_settings_default(controller_settings_t *settings)
{
    thermal_model_parameters_default(&settings->model);
    current_control_parameters_default(&settings->current);
    safety_parameters_default(&settings->safety);
    drive_policy_parameters_default(&settings->policy);
}

/* All parts but the model, which checks itself when it takes its parameters. */
static bool check(const controller_settings_t *settings, uint16_t *bad)
{
    if (settings->model.step_ms != MODEL_STEP_MS) {
        if (bad != NULL) {
            *bad = PARAMETER_COUNT;
        }
        return false;
    }
    return current_control_check(&settings->current, bad) && safety_check(&settings->safety, bad) &&
           drive_policy_check(&settings->policy, bad);
}

static bool init_model(thermal_model_t *model, const thermal_model_parameters_t *parameters,
                       uint16_t *bad)
{
    return thermal_model_init(model, parameters, bad) == THERMAL_MODEL_OK;
}

/* martensite + austenite x difference, in mohm: below 16 ohm each. */
static void tell_resistance(controller_t *controller, uint8_t spring)
{
    uint16_t austenite = thermal_model_austenite(&controller->model, spring); /* Q0.15 */
    int32_t change_q15 = (int32_t)fixed_point_mac_s16_u16(0, controller->change_mohm, austenite);
    current_control_set_resistance(
        &controller->current, spring,
        (uint16_t)(controller->martensite_mohm + (uint16_t)((uint32_t)change_q15 * 2u >> 16)));
}

static void tell_all_resistances(controller_t *controller)
{
    const thermal_model_parameters_t *p = &controller->model.parameters;
    controller->martensite_mohm = (uint16_t)(p->resistance_martensite_uohm / 1000u);
    controller->change_mohm =
        (int16_t)((int32_t)(p->resistance_austenite_uohm / 1000u) - controller->martensite_mohm);
    for (uint8_t k = 0; k < controller->springs; k++) {
        tell_resistance(controller, k);
    }
}

/* After check and init_model nothing can be refused any more. */
static void start(controller_t *controller, const controller_settings_t *settings,
                  int16_t ambient_c7)
{
    thermal_model_t *model = &controller->model;
    memset((uint8_t *)controller + sizeof *model, 0, sizeof *controller - sizeof *model);
    controller->ambient_c7 = ambient_c7;
    controller->springs = (uint8_t)(settings->model.rows * settings->model.columns);
    thermal_model_set_ambient(model, ambient_c7);
    thermal_model_reset(model, ambient_c7);
    (void)current_control_init(&controller->current, &settings->current, NULL);
    (void)safety_init(&controller->safety, &settings->safety, controller->springs, NULL);
    (void)drive_policy_init(&controller->policy, &settings->policy, controller->springs, NULL);
    drive_policy_prepare(&controller->policy, model);
    tell_all_resistances(controller);
}

bool controller_init(controller_t *controller, const controller_settings_t *settings,
                     int16_t ambient_c7, uint16_t *bad)
{
    if (!check(settings, bad) || !init_model(&controller->model, &settings->model, bad)) {
        return false;
    }
    start(controller, settings, ambient_c7);
    return true;
}

/* The remembered state suits the new parameters as it is, or temperature by temperature. */
static void restore(thermal_model_t *model, const thermal_model_state_t *state, uint8_t springs)
{
    if (thermal_model_set_state(model, state)) {
        return;
    }
    for (uint8_t k = 0; k < springs; k++) {
        thermal_model_set_temperature(model, k, (int16_t)(state->spring[k].temperature_c23 >> 16));
    }
}

bool controller_apply_settings(controller_t *controller, const controller_settings_t *settings,
                               uint16_t *bad)
{
    const thermal_model_parameters_t *old = &controller->model.parameters;
    bool same_size = settings->model.rows == old->rows && settings->model.columns == old->columns;
    thermal_model_state_t state;
    thermal_model_follow_phases(&controller->model, UINT8_MAX);
    thermal_model_get_state(&controller->model, &state);
    if (!check(settings, bad) || !init_model(&controller->model, &settings->model, bad)) {
        return false;
    }
    if (same_size) {
        thermal_model_set_ambient(&controller->model, controller->ambient_c7);
        restore(&controller->model, &state, controller->springs);
        (void)current_control_apply(&controller->current, &settings->current, NULL);
        (void)safety_apply(&controller->safety, &settings->safety, NULL);
        (void)drive_policy_apply(&controller->policy, &settings->policy, NULL);
        drive_policy_prepare(&controller->policy, &controller->model);
        tell_all_resistances(controller);
        return true;
    }
    uint8_t board_fault = controller->safety.board_fault;
    bool locked = controller->safety.locked;
    uint8_t fan_percent = controller->fan_percent;
    start(controller, settings, controller->ambient_c7);
    controller->safety.board_fault = board_fault;
    controller->safety.locked = locked;
    controller->fan_percent = fan_percent;
    return true;
}

/* A fifth, to 2e-5 and 1 uW: 13107 = 2^16 / 5. */
static inline ALWAYS uint32_t fifth(uint32_t sum)
{
    uint32_t low = fixed_point_mac_u16(0, (uint16_t)sum, 13107u);
    return fixed_point_mac_u16(low >> 16, (uint16_t)(sum >> 16), 13107u);
}

/* What flows, 0..CURRENT_MOST_MA. */
static inline ALWAYS uint16_t flowing_ma(int16_t current_ma)
{
    if (current_ma <= 0) {
        return 0;
    }
    return current_ma > CURRENT_MOST_MA ? CURRENT_MOST_MA : (uint16_t)current_ma;
}

/* value / 2^16. The AVR's compiler would load all four bytes. */
static inline ALWAYS int16_t upper_half(const int32_t *value)
{
#ifdef __AVR__
    int16_t half;
    memcpy(&half, (const uint8_t *)value + sizeof half, sizeof half);
    return half;
#else
    return (int16_t)(*value >> 16);
#endif
}

/* Takes the readings and has them judged; returns the sum of what flows. */
static HOT uint32_t take_sensors(controller_t *controller, const controller_sensor_t *sensor,
                                 bool valid[])
{
    uint32_t sum_ma = 0;
    for (uint8_t k = 0; k < controller->springs; k++, sensor++) {
        uint8_t status = (uint8_t)sensor->status;
        int16_t current_ma = sensor->current_ma;
        int16_t voltage_mv = sensor->voltage_mv;
        uint16_t expected_ma = controller->current.channel[k].reference_ma;
        int16_t temperature_c7 = upper_half(&controller->model.state.spring[k].temperature_c23);
        if (!safety_tick_good(&controller->safety, &controller->safety.spring[k], status,
                              current_ma, voltage_mv, expected_ma, temperature_c7)) {
            safety_sample_t sample = {.sensor_status = status,
                                      .current_ma = current_ma,
                                      .voltage_mv = voltage_mv,
                                      .expected_ma = expected_ma,
                                      .temperature_c7 = temperature_c7};
            safety_tick_spring(&controller->safety, k, &sample);
        }
        valid[k] = status == CONTROLLER_SENSOR_OK;
        if (valid[k]) {
            controller->measured_ma[k] = current_ma;
            controller->measured_mv[k] = voltage_mv;
        } else if (controller->duty[k] != 0) {
            current_ma = controller->measured_ma[k];
            voltage_mv = controller->measured_mv[k];
        } else {
            continue;
        }
        uint16_t amount_ma = flowing_ma(current_ma);
        sum_ma += amount_ma;
        if (voltage_mv > 0) {
            controller->power_sum_uw[k] =
                fixed_point_mac_u16(controller->power_sum_uw[k], amount_ma, (uint16_t)voltage_mv);
        }
    }
    safety_tick_board(&controller->safety, sum_ma);
    return sum_ma;
}

/* True if a step of the model began. */
static bool step_model(controller_t *controller, const controller_inputs_t *inputs)
{
    /* One spring in each tick: the phase moves slowly, looking it up costs. */
    uint8_t turn = controller->resistance_turn;
    tell_resistance(controller, turn);
    turn++;
    controller->resistance_turn = turn < controller->springs ? turn : 0;
    if (++controller->model_tick < TICKS_PER_STEP) {
        /* a quarter of them, and the policy settles its own: the last of the four finds as many
         * left */
        bool last = controller->model_tick == TICKS_PER_STEP - 1u;
        thermal_model_follow_phases(&controller->model,
                                    last ? UINT8_MAX : (uint8_t)(controller->springs / 4u));
        return false;
    }
    controller->model_tick = 0;
    for (uint8_t k = 0; k < controller->springs; k++) {
        controller->power_sum_uw[k] =
            drive_policy_model_power_uw(&controller->policy, k, fifth(controller->power_sum_uw[k]));
    }
    controller->ambient_c7 = inputs->ambient_c7;
    thermal_model_set_ambient(&controller->model, inputs->ambient_c7);
    thermal_model_set_fan(&controller->model, inputs->fan_percent);
    thermal_model_begin_step(&controller->model, controller->power_sum_uw);
    memset(controller->power_sum_uw, 0, sizeof controller->power_sum_uw);
    return true;
}

static void drive(controller_t *controller, const bool valid[], uint32_t sum_ma, bool model_stepped)
{
    const safety_t *safety = &controller->safety;
    const bool any_allowed = !safety->locked && safety->board_fault == SAFETY_FAULT_NONE;
    bool allowed[CONTROLLER_MAX_SPRINGS];
    for (uint8_t k = 0; k < controller->springs; k++) {
        allowed[k] = any_allowed && safety->spring[k].fault == SAFETY_FAULT_NONE;
        if (!allowed[k]) {
            current_control_reset(&controller->current, k);
        }
    }
    uint16_t target_ma[CONTROLLER_MAX_SPRINGS];
    const safety_parameters_t *limits = &controller->safety.parameters;
    drive_policy_input_t input = {.model = &controller->model,
                                  .level_permille = controller->level_permille,
                                  .allowed = allowed,
                                  .maximum_current_ma =
                                      controller->current.parameters.maximum_current_ma,
                                  .supply_limit_ma = limits->supply_limit_ma,
                                  .measured_ma = controller->measured_ma,
                                  .measured_mv = controller->measured_mv,
                                  .valid = valid,
                                  .model_stepped = model_stepped};
    drive_policy_tick(&controller->policy, &input, target_ma);

    /* Targets fit the budget; while loops still settle, what flows may not: then none rises
     * further. */
    bool may_rise =
        sum_ma + controller->policy.parameters.supply_reserve_ma <= limits->supply_limit_ma;
    current_control_tick(&controller->current, controller->springs, target_ma,
                         controller->measured_ma, valid, may_rise, controller->duty);
    /* the policy gives it nothing, so that its latch can wait for its turn */
    uint8_t turn = controller->resistance_turn;
    if ((controller->policy.spring[turn].limits & DRIVE_POLICY_LIMIT_TRIP) != 0) {
        safety_trip_limit(&controller->safety, turn);
    }
}

__attribute__((noinline)) void controller_tick(controller_t *controller,
                                               const controller_inputs_t *inputs,
                                               controller_outputs_t *outputs)
{
    bool valid[CONTROLLER_MAX_SPRINGS];
    uint32_t sum_ma = take_sensors(controller, inputs->sensor, valid);
    bool model_stepped = step_model(controller, inputs);
    drive(controller, valid, sum_ma, model_stepped);
    memcpy(outputs->duty, controller->duty, sizeof outputs->duty);
    outputs->fan_percent = controller->fan_percent;
}

bool controller_set_target(controller_t *controller, uint8_t spring, uint16_t level_permille)
{
    if (spring >= controller->springs || level_permille > DRIVE_POLICY_LEVEL_FULL) {
        return false;
    }
    controller->level_permille[spring] = level_permille;
    return true;
}

void controller_set_pattern(controller_t *controller, const bool on[])
{
    for (uint8_t k = 0; k < controller->springs; k++) {
        controller->level_permille[k] = on[k] ? DRIVE_POLICY_LEVEL_FULL : 0;
    }
}

bool controller_set_policy(controller_t *controller, drive_policy_kind_t kind)
{
    drive_policy_parameters_t parameters = controller->policy.parameters;
    parameters.policy = (uint8_t)kind;
    if (!drive_policy_apply(&controller->policy, &parameters, NULL)) {
        return false;
    }
    drive_policy_prepare(&controller->policy, &controller->model);
    return true;
}

bool controller_set_fan(controller_t *controller, uint8_t percent)
{
    if (percent > 100) {
        return false;
    }
    controller->fan_percent = percent;
    return true;
}

void controller_stop(controller_t *controller)
{
    memset(controller->level_permille, 0, sizeof controller->level_permille);
}

void controller_emergency_stop(controller_t *controller)
{
    controller_stop(controller);
    safety_emergency_stop(&controller->safety);
}

void controller_clear_faults(controller_t *controller)
{
    controller_stop(controller);
    safety_clear(&controller->safety);
    drive_policy_clear(&controller->policy);
}

void controller_lock(controller_t *controller)
{
    safety_lock(&controller->safety);
}

void controller_unlock(controller_t *controller)
{
    controller_stop(controller);
    safety_unlock(&controller->safety);
}

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
    if (controller->current.channel[spring].blind_ticks != 0 && controller->duty[spring] == 0) {
        return 0;
    }
    int16_t voltage_mv = controller->measured_mv[spring];
    uint32_t power_uw = fixed_point_mac_u16(0, flowing_ma(controller->measured_ma[spring]),
                                            voltage_mv > 0 ? (uint16_t)voltage_mv : 0u);
    return power_uw < THERMAL_MODEL_HIGHEST_POWER_UW ? power_uw : THERMAL_MODEL_HIGHEST_POWER_UW;
}

uint16_t controller_duty(const controller_t *controller, uint8_t spring)
{
    return controller->duty[spring];
}

int16_t controller_temperature_c7(const controller_t *controller, uint8_t spring)
{
    return thermal_model_temperature_c7(&controller->model, spring);
}

uint16_t controller_austenite_permille(const controller_t *controller, uint8_t spring)
{
    return (uint16_t)((thermal_model_austenite(&controller->model, spring) * 1000ul) >> 15);
}

__attribute__((noinline)) safety_fault_t controller_fault(const controller_t *controller,
                                                          uint8_t spring)
{
    return safety_fault(&controller->safety, spring);
}

safety_fault_t controller_board_fault(const controller_t *controller)
{
    return safety_board_fault(&controller->safety);
}

uint8_t controller_limits(const controller_t *controller, uint8_t spring)
{
    return drive_policy_limits(&controller->policy, spring);
}

uint16_t controller_cut_ma(const controller_t *controller, uint8_t spring)
{
    return drive_policy_cut_ma(&controller->policy, spring);
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
