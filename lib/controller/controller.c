#include "controller_internal.h"

#include <stddef.h>
#include <string.h>

#include "crc16.h"
#include "fixed_point.h"
#include "invariant.h"

#define MODEL_STEP_MS        100u
#define TICKS_PER_STEP       (MODEL_STEP_MS / CONTROLLER_TICK_MS)
#define TICKS_PER_S          (1000u / CONTROLLER_TICK_MS)
#define SILENT_MOST          (3600ul * TICKS_PER_S) /* host_timeout_s at its most */
#define SUPPLY_TICKS         3u /* the relay closes 10 ms after the second pulse */
#define FLOOR_TURNS          (CIRCUIT_CHECK_TICKS - CIRCUIT_CHECK_TICKS / TICKS_PER_STEP)
#define RESISTANCES_A_TURN   2u /* of nine springs six turns are left: each is told in 0.5 s */
#define TIME_CONSTANT_MOST_S 3600ul

void controller_settings_default(controller_settings_t *settings)
{
    thermal_model_parameters_default(&settings->model);
    current_control_parameters_default(&settings->current);
    safety_parameters_default(&settings->safety);
    drive_policy_parameters_default(&settings->policy);
}

static int32_t value_of(const controller_settings_t *settings, uint16_t row, spring_index_t spring)
{
    const parameter_row_t known = parameter_row(row);
    const void *const parts[] = {&settings->model, &settings->current, &settings->safety,
                                 &settings->policy};
    return parameter_get(parts[known.part], &known, spring);
}

bool controller_settings_pair(const controller_settings_t *settings, uint16_t pair[2])
{
    for (uint8_t k = 0; k < PARAMETER_PAIRS; k++) {
        const parameter_pair_t judged = parameter_pair(k);
        const int32_t larger = value_of(settings, judged.larger, 0);
        if (larger - value_of(settings, judged.smaller, 0) < judged.least &&
            !(judged.zero_is_off && larger == 0)) {
            pair[0] = judged.larger;
            pair[1] = judged.smaller;
            return false;
        }
    }
    return true;
}

static uint32_t capacity_uj_per_k(const thermal_model_parameters_t *p, spring_index_t spring)
{
    return (uint32_t)p->heat_capacity_mj_per_k * p->heat_capacity_scale_permille[spring];
}

/* Of a loss as declared for all. */
static uint32_t own_loss_uw_per_k(const thermal_model_parameters_t *p, spring_index_t spring,
                                  uint16_t loss_uw_per_k)
{
    return (uint32_t)loss_uw_per_k * p->loss_scale_permille[spring] / 1000u;
}

/* Every spring cools to a part of its excess within TIME_CONSTANT_MOST_S: else what waits for it
 * waits for ever. */
static bool check_time_constants(const thermal_model_parameters_t *p, uint16_t *bad)
{
    for (spring_index_t k = 0;
         k < (spring_index_t)(p->rows * p->columns) && k < (spring_index_t)CONTROLLER_MAX_SPRINGS;
         k++) {
        const uint16_t losses_uw_per_k[] = {p->loss_uw_per_k, p->loss_fan_uw_per_k};
        for (uint8_t n = 0; n < 2; n++) {
            if (capacity_uj_per_k(p, k) >
                TIME_CONSTANT_MOST_S * own_loss_uw_per_k(p, k, losses_uw_per_k[n])) {
                if (bad != NULL) {
                    *bad = n == 0 ? PARAMETER_loss_w_per_k : PARAMETER_loss_fan_w_per_k;
                }
                return false;
            }
        }
    }
    return true;
}

/* Parts of the settings; bits. */
enum { MODEL_PART = 1, CURRENT_PART = 2, SAFETY_PART = 4, POLICY_PART = 8, ALL_PARTS = 15 };

static uint8_t if_other(const void *now, const void *was, size_t bytes, uint8_t part)
{
    return memcmp(now, was, bytes) != 0 ? part : 0;
}

/* Those that are others than the controller has. */
static uint8_t others(const controller_t *c, const controller_settings_t *s)
{
    return if_other(&s->model, &c->model.parameters, sizeof s->model, MODEL_PART) |
           if_other(&s->current, &c->current.parameters, sizeof s->current, CURRENT_PART) |
           if_other(&s->safety, &c->safety.parameters, sizeof s->safety, SAFETY_PART) |
           if_other(&s->policy, &c->policy.parameters, sizeof s->policy, POLICY_PART);
}

/* Those of parts but the model, which checks itself when it takes its parameters. */
static bool check(const controller_settings_t *settings, uint8_t parts, uint16_t *bad)
{
    if (settings->model.step_ms != MODEL_STEP_MS) {
        if (bad != NULL) {
            *bad = PARAMETER_COUNT;
        }
        return false;
    }
    uint16_t pair[2];
    if (!controller_settings_pair(settings, pair)) {
        if (bad != NULL) {
            *bad = pair[0];
        }
        return false;
    }
    return ((parts & MODEL_PART) == 0 || check_time_constants(&settings->model, bad)) &&
           ((parts & CURRENT_PART) == 0 || current_control_check(&settings->current, bad)) &&
           ((parts & SAFETY_PART) == 0 || safety_check(&settings->safety, bad)) &&
           ((parts & POLICY_PART) == 0 || drive_policy_check(&settings->policy, bad));
}

static bool init_model(thermal_model_t *model, const thermal_model_parameters_t *parameters,
                       uint16_t *bad)
{
    return thermal_model_init(model, parameters, bad) == THERMAL_MODEL_OK;
}

static void tell_resistance(controller_t *controller, uint8_t spring)
{
    /* 2097 / 2^21 is a thousandth, less 74 millionths: a division of 32 bits takes 600 cycles */
    const uint32_t resistance_mohm =
        ((thermal_model_resistance_uohm(&controller->model, spring) >> 5) * 2097u + 0x8000u) >> 16;
    current_control_set_resistance(&controller->current, spring,
                                   resistance_mohm < UINT16_MAX ? (uint16_t)resistance_mohm
                                                                : UINT16_MAX);
}

static void tell_resistances(controller_t *controller)
{
    for (uint8_t k = 0; k < controller->springs; k++) {
        tell_resistance(controller, k);
    }
}

/* After check and init_model nothing can be refused any more. */
static void start(controller_t *controller, const controller_settings_t *settings,
                  int16_t ambient_c7, bool keeps_learnt)
{
    thermal_model_t *model = &controller->model;
    const size_t kept = offsetof(controller_t, current); /* model, and what was delivered */
    const size_t belief = offsetof(controller_t, estimator);
    const size_t behind = belief + sizeof controller->estimator;
    if (!keeps_learnt) {
        controller->estimator = (spring_estimator_t){0};
    }
    memset((uint8_t *)controller + kept, 0, belief - kept);
    memset((uint8_t *)controller + behind, 0, sizeof *controller - behind);
    controller->ambient_c7 = ambient_c7;
    controller->springs = (uint8_t)(settings->model.rows * settings->model.columns);
    thermal_model_set_ambient(model, ambient_c7);
    thermal_model_reset(model, ambient_c7);
    temperature_ceiling_prepare(&controller->drive, model, &settings->current);
    (void)current_control_init(&controller->current, &settings->current, NULL);
    circuit_source_begin(&controller->source, &settings->current);
    (void)safety_init(&controller->safety, &settings->safety, controller->springs, NULL);
    spring_estimator_restart(&controller->estimator, model);
    if (controller->ceiling.delivered || controller->ceiling.doubtful) {
        spring_estimator_doubt(&controller->estimator);
    }
    (void)drive_policy_init(&controller->policy, &settings->policy, model, NULL);
    spring_estimator_prepare(&controller->estimator, model, settings->policy.observer != 0);
    tell_resistances(controller);
    scrub_start(&controller->scrub, controller_fixed, controller);
}

/* In mid-life: what is latched stays, also of springs that another size has not for a while. */
static void start_anew(controller_t *controller, const controller_settings_t *settings,
                       bool keeps_learnt)
{
    const uint8_t board_fault = controller->safety.board_fault;
    const bool locked = controller->safety.locked;
    const uint8_t fan_percent = controller->fan_percent;
    uint8_t fault[CONTROLLER_MAX_SPRINGS];
    for (uint8_t k = 0; k < CONTROLLER_MAX_SPRINGS; k++) {
        fault[k] = controller->safety.spring[k].fault;
    }
    start(controller, settings, controller->ambient_c7, keeps_learnt);
    controller->safety.board_fault = board_fault;
    controller->safety.locked = locked;
    controller->fan_percent = fan_percent;
    for (uint8_t k = 0; k < CONTROLLER_MAX_SPRINGS; k++) {
        controller->safety.spring[k].fault = fault[k];
    }
}

bool controller_init(controller_t *controller, const controller_settings_t *settings,
                     int16_t ambient_c7, uint16_t *bad)
{
    if (!check(settings, ALL_PARTS, bad) ||
        !init_model(&controller->model, &settings->model, bad)) {
        return false;
    }
    /* by what it is given from here on: where it may be from before is the estimator's to wait for
     */
    temperature_ceiling_begin(&controller->ceiling, ambient_c7);
    controller->supply_off = false;
    controller->supply_ticks = 0;
    memset(controller->mistrusted, 0, sizeof controller->mistrusted);
    memset(controller->resumed, 0, sizeof controller->resumed);
    start(controller, settings, ambient_c7, false);
    return true;
}

static bool apply_policy(controller_t *controller, const drive_policy_parameters_t *parameters)
{
    if (!drive_policy_apply(&controller->policy, parameters, &controller->model, NULL)) {
        return false;
    }
    spring_estimator_prepare(&controller->estimator, &controller->model, parameters->observer != 0);
    return true;
}

/* Openly nobody waits until it is known how hot a spring is, and the model's temperature alone
 * limits it: that is no less than what this board has given makes. */
static void heed_given(controller_t *controller)
{
    thermal_model_t *const model = &controller->model;
    if (controller->policy.parameters.policy != DRIVE_POLICY_OPEN) {
        return;
    }
    for (uint8_t k = 0; k < controller->springs; k++) {
        const int16_t given_c7 = (int16_t)(128.0f * temperature_ceiling_c(&controller->ceiling, k));
        if (controller_cooling_s(controller, k) > 0.0f &&
            given_c7 > thermal_model_temperature_c7(model, k)) {
            thermal_model_set_temperature(model, k, given_c7);
        }
    }
}

/* Of a spring, by the model that is declared until now. */
typedef struct {
    temperature_ceiling_declared_t ceiling;
    float gives_w;
} declared_t;

/* Other parameters of the model: the springs are what they were. */
static bool declare(controller_t *controller, const thermal_model_parameters_t *parameters,
                    uint16_t *bad)
{
    thermal_model_t *const model = &controller->model;
    declared_t before[CONTROLLER_MAX_SPRINGS];
    for (uint8_t k = 0; k < controller->springs; k++) {
        if (controller->duty_sum[k] != 0) {
            temperature_ceiling_give(&controller->ceiling, model, k);
        }
        before[k].ceiling = temperature_ceiling_declared(model, k);
        before[k].gives_w = spring_estimator_declared_w(model, k);
    }
    if (thermal_model_declare(model, parameters, bad) != THERMAL_MODEL_OK) {
        return false;
    }
    for (uint8_t k = 0; k < controller->springs; k++) {
        temperature_ceiling_declare(&controller->ceiling, model, k, &before[k].ceiling);
        spring_estimator_keep_loss(&controller->estimator, model, k, before[k].gives_w);
        if (controller_duty(controller, k) != 0 &&
            spring_estimator_lacks_contact(&controller->estimator, model, k)) {
            safety_trip(&controller->safety, k, SAFETY_FAULT_SENSOR_MISMATCH);
        }
    }
    return true;
}

bool controller_is_mistrusted(const controller_t *controller, uint8_t spring)
{
    return (controller->mistrusted[spring / 8u] & controller_bit_of(spring)) != 0;
}

static bool is_same_circuit(const current_control_parameters_t *a,
                            const current_control_parameters_t *b)
{
    return a->supply_mv == b->supply_mv && a->freewheel_mv == b->freewheel_mv &&
           a->shunt_mohm == b->shunt_mohm && a->wiring_mohm == b->wiring_mohm;
}

/* What springs showed was shown by what was declared until now. Of one that had lied that told of
 * it: it is believed once it has rested, as after a reset. */
static void begin_circuit(controller_t *controller, const current_control_parameters_t *circuit)
{
    controller->peers = (circuit_peers_t){0};
    circuit_source_begin(&controller->source, circuit);
    for (uint8_t k = 0; k < controller->springs; k++) {
        if (controller_is_mistrusted(controller, k)) {
            controller_mistrust(controller, k);
        }
    }
}

bool controller_apply_settings(controller_t *controller, const controller_settings_t *settings,
                               uint16_t *bad)
{
    scrub_open(&controller->scrub, controller_fixed, controller);
    if (!controller_is_sound(controller)) {
        return false; /* not even how many springs there are is known */
    }
    const thermal_model_parameters_t *old = &controller->model.parameters;
    const uint8_t other = others(controller, settings);
    if (!check(settings, other, bad)) {
        return false;
    }
    if (settings->model.rows == old->rows && settings->model.columns == old->columns) {
        if ((other & MODEL_PART) != 0 && !declare(controller, &settings->model, bad)) {
            return false;
        }
        if ((other & CURRENT_PART) != 0) {
            if (!is_same_circuit(&controller->current.parameters, &settings->current)) {
                begin_circuit(controller, &settings->current);
            }
            (void)current_control_apply(&controller->current, &settings->current, NULL);
            current_control_set_drop(&controller->current, controller->source.driven_drop_mv);
        }
        if ((other & SAFETY_PART) != 0) {
            (void)safety_apply(&controller->safety, &settings->safety, NULL);
        }
        /* No more than must be: ticks that are late let the relay of the supply open. */
        if ((other & (MODEL_PART | CURRENT_PART)) != 0) {
            temperature_ceiling_prepare(&controller->drive, &controller->model, &settings->current);
            tell_resistances(controller);
        }
        if ((other & (MODEL_PART | POLICY_PART)) != 0) {
            (void)apply_policy(controller, &settings->policy);
            heed_given(controller);
        }
        scrub_seal(&controller->scrub, controller_fixed, controller); /* all of it is new */
        return true;
    }
    if (!init_model(&controller->model, &settings->model, bad)) {
        return false;
    }
    start_anew(controller, settings, false);
    return true;
}

bool controller_restart(controller_t *controller, const controller_settings_t *settings)
{
    scrub_open(&controller->scrub, controller_fixed, controller);
    if (!controller_is_sound(controller)) {
        return false;
    }
    thermal_model_set_fan(&controller->model, 0); /* as it is initialised; the next step tells */
    controller->supply_ticks = 0;
    memset(controller->resumed, 0, sizeof controller->resumed);
    start_anew(controller, settings, true);
    return true;
}

/* The most that a duty brings to a spring, and a quarter more for a supply that is another one. */
static uint16_t most_mv(const controller_t *controller, uint8_t spring, uint16_t duty)
{
    const uint16_t before = controller->circuit[spring].last_duty;
    const uint32_t duty_mv = fixed_point_mac_u16(0, duty > before ? duty : before,
                                                 controller->current.parameters.supply_mv);
    const uint16_t share_q16 = 26214u; /* 0.4: times 256 / 800 is 1.25 of the duty's share */
    return fixed_point_high_u16((uint16_t)(duty_mv >> 8), share_q16);
}

/* Takes the readings and has them judged; returns the sum of what flows. */
static uint32_t take_sensors(controller_t *controller, const controller_sensor_t sensor[],
                             bool valid[])
{
    uint32_t sum_ma = 0;
    const uint8_t dead_steps = current_control_dead_steps(&controller->current);
    for (uint8_t k = 0; k < controller->springs; k++) {
        const uint16_t duty = controller_duty(controller, k);
        const safety_sample_t sample = {
            .sensor_status = sensor[k].status,
            .current_ma = sensor[k].current_ma,
            .voltage_mv = sensor[k].voltage_mv,
            .off = duty == 0 && controller->circuit[k].last_duty == 0,
            .may_be_dead = duty <= controller->source.dead_steps,
            .expected_ma = current_control_reference_ma(&controller->current, k),
            .most_mv = most_mv(controller, k, duty),
            .temperature_c7 = thermal_model_temperature_c7(&controller->model, k)};
        valid[k] = safety_tick_spring(&controller->safety, k, &sample);
        circuit_check_take(&controller->circuit[k], controller->current.fixed_mohm, dead_steps,
                           duty, valid[k], sensor[k].current_ma, sensor[k].voltage_mv);
        controller->duty_sum[k] = (uint16_t)(controller->duty_sum[k] + duty);
        if (valid[k]) {
            controller->measured_ma[k] = sensor[k].current_ma;
            controller->measured_mv[k] = sensor[k].voltage_mv;
        } else if (duty == 0) {
            continue;
        }
        sum_ma += controller_flowing_ma(controller->measured_ma[k]);
        const uint16_t flowing_ma = controller_flowing_ma(controller->measured_ma[k]);
        const uint16_t positive_mv = controller_positive_mv(controller->measured_mv[k]);
        controller->power_sum_uw[k] +=
            thermal_model_heating_uw(&controller->model, k, flowing_ma, positive_mv);
        /* with what a contact is declared to take: the ceiling believes none */
        controller->heat_sum_uw[k] += fixed_point_mac_u16(0, flowing_ma, positive_mv);
    }
    safety_tick_board(&controller->safety, sum_ma);
    return sum_ma;
}

/* What was held against a spring by another belief is another share by this one. */
static void learn_source(controller_t *controller)
{
    const circuit_source_t before = controller->source;
    const bool other = circuit_source_fit(&controller->source, &controller->current.parameters);
    current_control_set_drop(&controller->current, controller->source.driven_drop_mv);
    if (other) {
        circuit_peers_renew(&controller->peers, controller->springs, &before, &controller->source);
        circuit_step_renew(controller->step, controller->springs, &before, &controller->source);
    }
}

void controller_hurry(controller_t *controller)
{
    for (uint8_t k = 0; k < controller->springs; k++) {
        circuit_check_hurry(&controller->circuit[k]);
    }
}

/* What no belief can talk away: is it a circuit, and how hot could it be by now? */
static void judge_circuit(controller_t *controller, uint8_t k)
{
    circuit_source_t *const source = &controller->source;
    circuit_window_t window;
    if (circuit_check_drop(&controller->circuit[k])) {
        return;
    }
    const bool is_none = circuit_check_judge(&controller->circuit[k], source,
                                             controller->current.parameters.supply_mv, &window);
    const bool is_odd =
        circuit_peers_judge(&controller->peers, controller->springs, k, &window, source);
    const bool steps =
        circuit_step_judge(&controller->step[k], &window, source, &controller->current.parameters);
    if (steps) {
        circuit_peers_suspect(&controller->peers, k, circuit_step_before_q12(&controller->step[k]));
    }
    if (window.steady && window.found_mv >= CIRCUIT_WINDOW_LEAST_MV &&
        circuit_check_is_sound(&controller->circuit[k]) && controller->peers.spring[k].odd == 0 &&
        controller->step[k].odd == 0) {
        circuit_source_take(source, window.duty, window.found_mv);
    }
    if (is_none || is_odd || steps ||
        spring_estimator_is_unlike(spring_estimator_of(&controller->estimator, k))) {
        safety_trip(&controller->safety, k, SAFETY_FAULT_SENSOR_MISMATCH);
    }
}

static void raise_ceiling(controller_t *controller, uint8_t k)
{
    const uint8_t bit = controller_bit_of(k);
    if ((controller->resumed[k / 8u] & bit) != 0 && !(controller_cooling_s(controller, k) > 0.0f)) {
        controller->resumed[k / 8u] &= (uint8_t)~bit;
    }
    const float measured_w = 1e-6f / (float)CIRCUIT_CHECK_TICKS * (float)controller->heat_sum_uw[k];
    const float driven_w = temperature_ceiling_power_w(
        &controller->drive, 1.0f / (float)CIRCUIT_CHECK_TICKS * (float)controller->duty_sum[k],
        controller->source.more_drop_v);
    temperature_ceiling_step(&controller->ceiling, &controller->model, k,
                             measured_w > driven_w ? measured_w : driven_w);
    controller->heat_sum_uw[k] = 0;
    controller->duty_sum[k] = 0;
    /* where one of two declarations must be wrong, no belief by either of them is waited for, and
     * no tolerance around it */
    const bool trips =
        temperature_ceiling_contradicts(&controller->ceiling, &controller->model, k)
            ? temperature_ceiling_c(&controller->ceiling, k) >
                  0.01f * (float)controller->policy.parameters.temperature_limit_cc
            : temperature_ceiling_trips(&controller->ceiling, k,
                                        controller->safety.parameters.temperature_trip_cc);
    if (trips) {
        safety_trip(&controller->safety, k, SAFETY_FAULT_OVER_TEMPERATURE);
    }
}

/* The current loop of one spring after the other learns of its phase, which moves slowly; its
 * readings' steps are told by that loop. */
static void take_resistance_turn(controller_t *controller)
{
    const uint8_t k = controller->resistance_turn;
    tell_resistance(controller, k);
    spring_estimator_sweep(&controller->estimator, k,
                           current_control_gain_q16(&controller->current, k),
                           controller->policy.parameters.dither_ma);
    controller->resistance_turn = (uint8_t)(k + 1u < controller->springs ? k + 1u : 0u);
}

/* In the ticks between two steps of the model, half a round apart for each spring: its circuit, its
 * ceiling; what may wait is done in the others. */
static void take_floor_turn(controller_t *controller)
{
    const uint8_t turn = controller->floor_turn;
    const uint8_t ahead = (uint8_t)(turn + FLOOR_TURNS / 2u);
    const uint8_t raised = (uint8_t)(ahead < FLOOR_TURNS ? ahead : ahead - FLOOR_TURNS);
    controller->floor_turn = (uint8_t)(turn + 1u < FLOOR_TURNS ? turn + 1u : 0u);
    for (uint16_t k = turn; k < controller->springs; k += FLOOR_TURNS) {
        judge_circuit(controller, (uint8_t)k);
    }
    for (uint16_t k = raised; k < controller->springs; k += FLOOR_TURNS) {
        raise_ceiling(controller, (uint8_t)k);
    }
    if (turn < controller->springs && controller->springs < FLOOR_TURNS) {
        return;
    }
    if (raised >= controller->springs) {
        for (uint8_t n = 0; n < RESISTANCES_A_TURN; n++) {
            take_resistance_turn(controller);
        }
    }
    if (scrub_step(&controller->scrub, controller_fixed, controller, CONTROLLER_SCRUB_BYTES)) {
        thermal_model_refresh(&controller->model);
    }
}

/* A fifth, 16 millionths less than that: a division of 32 bits takes 600 cycles of the target. */
static uint32_t mean_of_step(uint32_t sum)
{
    const uint16_t share_q16 = 65536u / TICKS_PER_STEP;
    return fixed_point_mac_u16(fixed_point_high_u16((uint16_t)sum, share_q16),
                               (uint16_t)(sum >> 16), share_q16);
}

static void step_model(controller_t *controller, const controller_inputs_t *inputs)
{
    if (++controller->model_tick < TICKS_PER_STEP) {
        take_floor_turn(controller);
        return;
    }
    controller->model_tick = 0;
    if (controller->floor_turn == FLOOR_TURNS / 2u) {
        learn_source(controller);
    }
    for (uint8_t k = 0; k < controller->springs; k++) {
        controller->power_sum_uw[k] = spring_estimator_model_power_uw(
            &controller->estimator, k, mean_of_step(controller->power_sum_uw[k]));
    }
    controller->ambient_c7 = inputs->ambient_c7;
    thermal_model_set_ambient(&controller->model, inputs->ambient_c7);
    thermal_model_set_fan(&controller->model, inputs->fan_percent);
    thermal_model_step(&controller->model, controller->power_sum_uw);
    memset(controller->power_sum_uw, 0, sizeof controller->power_sum_uw);
}

/* Held from one tick to the next, or off for good. */
static void watch_supply(controller_t *controller)
{
    if (!controller_supply_is_fitted(controller)) {
        controller->supply_ticks = SUPPLY_TICKS;
        return;
    }
    if (safety_cuts_supply(&controller->safety)) {
        (void)controller_set_supply(controller, false);
    }
    if (controller->supply_off || controller_is_locked(controller) ||
        !controller_is_sound(controller)) {
        controller->supply_ticks = 0;
    } else if (controller->supply_ticks < SUPPLY_TICKS) {
        controller->supply_ticks++;
    }
}

static bool targets_are_allowed(const controller_t *controller, const bool allowed[],
                                const uint16_t target_ma[])
{
    uint32_t sum_ma = 0;
    for (uint8_t k = 0; k < controller->springs; k++) {
        if (target_ma[k] != 0 && !allowed[k]) {
            return false;
        }
        sum_ma += target_ma[k];
    }
    return sum_ma <= controller->safety.parameters.supply_limit_ma;
}

static bool duties_are_allowed(const controller_t *controller, const bool allowed[],
                               const uint16_t duty[])
{
    for (uint8_t k = 0; k < controller->springs; k++) {
        if (duty[k] > CONTROLLER_DUTY_MAX || (duty[k] != 0 && !allowed[k])) {
            return false;
        }
    }
    return true;
}

static void drive(controller_t *controller, const bool valid[], uint32_t sum_ma, uint16_t duty[])
{
    bool allowed[CONTROLLER_MAX_SPRINGS];
    for (uint8_t k = 0; k < controller->springs; k++) {
        allowed[k] = controller->supply_ticks == SUPPLY_TICKS &&
                     safety_allows(&controller->safety, k) && controller_is_sound(controller) &&
                     !controller_waits_anew(controller, k);
        if (!allowed[k]) {
            current_control_reset(&controller->current, k);
        }
    }
    uint16_t target_ma[CONTROLLER_MAX_SPRINGS];
    const safety_parameters_t *limits = &controller->safety.parameters;
    drive_policy_input_t input = {.belief = &controller->estimator,
                                  .model = &controller->model,
                                  .level_permille = controller->level_permille,
                                  .allowed = allowed,
                                  .maximum_current_ma =
                                      controller->current.parameters.maximum_current_ma,
                                  .supply_limit_ma = limits->supply_limit_ma};
    drive_policy_tick(&controller->policy, &input, target_ma);
    INVARIANT(targets_are_allowed(controller, allowed, target_ma));

    /* Targets fit the budget; while loops still settle, what flows may not: then none rises
     * further. */
    bool may_rise =
        sum_ma + controller->policy.parameters.supply_reserve_ma <= limits->supply_limit_ma;
    current_control_tick(&controller->current, controller->springs, target_ma,
                         controller->measured_ma, valid, may_rise, duty);
    INVARIANT(duties_are_allowed(controller, allowed, duty));
    for (uint8_t k = 0; k < controller->springs; k++) {
        if ((drive_policy_limits(&controller->policy, k) & DRIVE_POLICY_LIMIT_TRIP) != 0) {
            safety_trip(&controller->safety, k, SAFETY_FAULT_LIMIT_TRIP);
        }
    }
}

/* With a timeout of n seconds the springs are off in the tick that ends the n-th. */
static void listen(controller_t *controller)
{
    const uint32_t most = controller->safety.parameters.host_timeout_s * (uint32_t)TICKS_PER_S;
    if (controller->silent_ticks < SILENT_MOST) {
        controller->silent_ticks++;
    }
    if (most == 0 || controller->silent_ticks < most) {
        return;
    }
    for (uint8_t k = 0; k < controller->springs; k++) {
        if (controller->level_permille[k] != 0) {
            controller_stop(controller);
            safety_host_silent(&controller->safety);
        }
    }
}

void controller_tick(controller_t *controller, const controller_inputs_t *inputs,
                     controller_outputs_t *outputs)
{
    bool valid[CONTROLLER_MAX_SPRINGS];
    uint32_t sum_ma = take_sensors(controller, inputs->sensor, valid);
    listen(controller);
    step_model(controller, inputs);
    spring_estimator_tick(&controller->estimator, &controller->model, controller->measured_ma,
                          controller->measured_mv, valid);
    watch_supply(controller);
    memset(outputs->duty, 0, sizeof outputs->duty);
    drive(controller, valid, sum_ma, outputs->duty);
    outputs->fan_percent = controller->fan_percent;
    outputs->supply =
        controller_supply_is_held(controller) && !safety_doubts_supply(&controller->safety);
}

bool controller_is_sound(const controller_t *controller)
{
    return scrub_is_sound(&controller->scrub);
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

bool controller_set_open(controller_t *controller, drive_policy_kind_t kind,
                         uint16_t open_current_ma)
{
    drive_policy_parameters_t parameters = controller->policy.parameters;
    parameters.policy = (uint8_t)kind;
    parameters.open_current_ma = open_current_ma;
    scrub_open(&controller->scrub, controller_fixed, controller);
    const bool applied = apply_policy(controller, &parameters);
    scrub_seal(&controller->scrub, controller_fixed, controller);
    return applied;
}

bool controller_set_policy(controller_t *controller, drive_policy_kind_t kind)
{
    const bool applied =
        controller_set_open(controller, kind, controller->policy.parameters.open_current_ma);
    heed_given(controller);
    return applied;
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

void controller_emergency_cut(controller_t *controller)
{
    controller_emergency_stop(controller);
    (void)controller_set_supply(controller, false);
}

bool controller_set_supply(controller_t *controller, bool on)
{
    if (!controller_supply_is_fitted(controller) ||
        (on && (safety_cuts_supply(&controller->safety) ||
                controller_board_fault(controller) == SAFETY_FAULT_EMERGENCY_STOP))) {
        return false;
    }
    if (!on || controller->supply_off) { /* nothing starts by switching it on, either */
        controller_stop(controller);
    }
    controller->supply_off = !on;
    return true;
}

bool controller_supply_is_fitted(const controller_t *controller)
{
    return controller->safety.parameters.cut_off != 0;
}

bool controller_supply_is_held(const controller_t *controller)
{
    return controller_supply_is_fitted(controller) && controller->supply_ticks != 0;
}

bool controller_supply_is_off(const controller_t *controller)
{
    return controller_supply_is_fitted(controller) && controller->supply_off;
}

void controller_host_heard(controller_t *controller)
{
    controller->silent_ticks = 0;
}

/* What a clear may not end at once a second time: as long as its cause stays, each time heats. */
static bool heats_when_cleared(safety_fault_t fault)
{
    return fault == SAFETY_FAULT_SENSOR_MISMATCH || fault == SAFETY_FAULT_STUCK_ON;
}

uint16_t controller_clear_wait_s(const controller_t *controller, uint8_t spring)
{
    const thermal_model_parameters_t *const p = &controller->model.parameters;
    if (!controller_is_mistrusted(controller, spring) ||
        !heats_when_cleared(safety_fault(&controller->safety, spring))) {
        return 0;
    }
    /* at most TIME_CONSTANT_MOST_S: check_time_constants */
    const uint16_t whole_s =
        (uint16_t)(capacity_uj_per_k(p, spring) / own_loss_uw_per_k(p, spring, p->loss_uw_per_k));
    const uint16_t rest_s = controller_rest_s(controller, spring);
    return rest_s < whole_s ? (uint16_t)(whole_s - rest_s) : 0;
}

/* Of a spring without a fault nothing is forgotten: who clears each second would else see that its
 * circuit is never judged. */
void controller_clear_faults(controller_t *controller)
{
    safety_fault_t stays[CONTROLLER_MAX_SPRINGS];
    controller_stop(controller);
    for (uint8_t k = 0; k < controller->springs; k++) {
        const safety_fault_t fault = safety_fault(&controller->safety, k);
        stays[k] = controller_clear_wait_s(controller, k) != 0 ? fault : SAFETY_FAULT_NONE;
        if (heats_when_cleared(fault)) {
            controller->mistrusted[k / 8u] |= controller_bit_of(k);
        }
        if (fault != SAFETY_FAULT_NONE && stays[k] == SAFETY_FAULT_NONE) {
            circuit_peers_clear(&controller->peers, k, fault == SAFETY_FAULT_SENSOR_MISMATCH);
            controller->circuit[k] = (circuit_check_t){0};
            controller->step[k] = (circuit_step_t){0};
        }
    }
    safety_clear(&controller->safety);
    for (uint8_t k = 0; k < controller->springs; k++) {
        if (stays[k] != SAFETY_FAULT_NONE) {
            safety_trip(&controller->safety, k, stays[k]);
        }
    }
    drive_policy_clear(&controller->policy);
}

void controller_mistrust(controller_t *controller, uint8_t spring)
{
    safety_trip(&controller->safety, spring, SAFETY_FAULT_SENSOR_MISMATCH);
    controller->mistrusted[spring / 8u] |= controller_bit_of(spring);
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

static bool is_warm_or_in_doubt(const controller_t *controller, uint8_t spring)
{
    return controller_is_warm(controller, spring) || controller_is_doubtful(controller, spring);
}

static bool any_is_warm(const controller_t *controller)
{
    for (uint8_t k = 0; k < controller->springs; k++) {
        if (is_warm_or_in_doubt(controller, k)) {
            return true;
        }
    }
    return false;
}

bool controller_is_known(const controller_t *controller)
{
    for (uint8_t k = 0; k < controller->springs; k++) {
        if (controller_cooling_s(controller, k) > 0.0f) {
            return false;
        }
    }
    return true;
}

bool controller_knows_cold(const controller_t *controller)
{
    for (uint8_t k = 0; k < controller->springs; k++) {
        if (!controller_is_warm(controller, k) && controller_cooling_s(controller, k) > 0.0f) {
            return false;
        }
    }
    return true;
}

void controller_get_model_state(const controller_t *controller, thermal_model_state_t *state)
{
    thermal_model_get_state(&controller->model, state);
}

void controller_get_delivered(const controller_t *controller, temperature_ceiling_t *delivered)
{
    *delivered = controller->ceiling;
}

/* By way of martensite. */
static void cool_to(thermal_model_t *model, uint8_t k, int16_t temperature_c7)
{
    const int16_t finish_c7 = thermal_model_transformation(model, k).martensite_finish_c7;
    thermal_model_set_temperature(model, k, (int16_t)(finish_c7 - 128));
    thermal_model_set_temperature(model, k, temperature_c7);
}

bool controller_resume(controller_t *controller, const temperature_ceiling_t *delivered,
                       const thermal_model_state_t *state)
{
    thermal_model_t *const model = &controller->model;
    controller->ceiling = *delivered;
    if (delivered->delivered || delivered->doubtful) {
        spring_estimator_doubt(&controller->estimator);
    }
    int16_t unknown_c7[CONTROLLER_MAX_SPRINGS];
    for (uint8_t k = 0; k < controller->springs; k++) {
        unknown_c7[k] = thermal_model_temperature_c7(model, k);
    }
    const bool taken = state != NULL && thermal_model_set_state(model, state);
    if (taken) {
        temperature_ceiling_raise(&controller->ceiling, model);
    }
    for (uint8_t k = 0; k < controller->springs; k++) {
        if (controller_is_warm(controller, k)) {
            controller->resumed[k / 8u] |= controller_bit_of(k);
        }
        if (taken && is_warm_or_in_doubt(controller, k)) {
            cool_to(model, k, unknown_c7[k]);
        } else if (taken) {
            spring_estimator_trust_spring(&controller->estimator, model, k);
        }
    }
    heed_given(controller);
    tell_resistances(controller);
    return taken;
}

void controller_set_temperature(controller_t *controller, int16_t temperature_c7)
{
    if (!any_is_warm(controller)) { /* then air and plate are not, either */
        thermal_model_reset(&controller->model, temperature_c7);
        thermal_model_set_ambient(&controller->model, temperature_c7); /* told with it, or before */
    }
    bool guesses = false; /* of a spring that is in doubt: no heat that was given */
    for (uint8_t k = 0; k < controller->springs; k++) {
        guesses = guesses || controller_is_doubtful(controller, k);
        if (is_warm_or_in_doubt(controller, k)) {
            continue;
        }
        cool_to(&controller->model, k, temperature_c7);
        spring_estimator_trust_spring(&controller->estimator, &controller->model, k);
    }
    if (!guesses) {
        temperature_ceiling_raise(&controller->ceiling, &controller->model);
    }
    tell_resistances(controller);
}

void controller_doubt_cold(controller_t *controller)
{
    controller->ceiling.doubtful = true;
    spring_estimator_doubt(&controller->estimator);
}

bool controller_may_be_warm(controller_t *controller)
{
    if (controller->ceiling.doubtful && controller_is_known(controller)) {
        controller->ceiling.doubtful = false;
    }
    return controller->ceiling.delivered || controller->ceiling.doubtful;
}

spring_learnt_t controller_learnt(const controller_t *controller, uint8_t spring)
{
    return spring_estimator_learnt(&controller->estimator, spring);
}

spring_learnt_t controller_to_keep(const controller_t *controller, uint8_t spring)
{
    return spring_estimator_to_keep(&controller->estimator, spring);
}

void controller_restore_learnt(controller_t *controller, uint8_t spring,
                               const spring_learnt_t *learnt)
{
    spring_estimator_restore(&controller->estimator, spring, learnt);
}

void controller_forget_learnt(controller_t *controller, uint8_t spring)
{
    spring_estimator_forget(&controller->estimator, spring);
}

void controller_forget_loss(controller_t *controller, uint8_t spring)
{
    spring_estimator_forget_loss(&controller->estimator, spring);
}

uint16_t controller_model_mark(const controller_t *controller)
{
    uint16_t crc = CRC16_START;
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        const parameter_row_t row = parameter_row(k);
        for (spring_index_t n = 0; row.part == PARAMETER_PART_MODEL && n < row.count; n++) {
            const int32_t value = parameter_get(&controller->model.parameters, &row, n);
            crc = crc16_add_bytes(crc, &value, sizeof value);
        }
    }
    return crc;
}
