#include "thermal_model.h"

#include <string.h>

#include "fixed_point.h"
#include "flash_memory.h"
#include "invariant.h"
#include "thermal_model_internal.h"

/* How one step works.
 *
 * Heat flows are taken at the middle of the step: from `midstep`, the temperature extrapolated by
 * half a step (Adams-Bashforth of second order, with the power left out of the extrapolation as it
 * may jump). What leaves one spring enters its neighbour by the same product, so no heat is lost or
 * made between them; init has made sure that a spring's flows fit. Flow times step / capacity is
 * the spring's gain of enthalpy, in 2^-23 K. Enthalpy over heat capacity is the state,
 * h = T + (L / C) austenite, so that latent heat is neither lost nor made. Where the phase rests,
 * T = h - latent. Where it transforms, the h of a temperature rises with it along the branch, and T
 * is found by halving; the latent heat is then what h leaves, so that errors do not add up. */

#define SEGMENTS                32
#define LATENT_SLACK_C23        0x400000 /* 0.5 K: 1/128 K times the steepest slope of h, and rounding */
#define RESISTANCE_REFERENCE_C7 (20 * 128)

/* 2^15 (1 + cos(pi k / 32)) / 2 */
static const uint16_t cosine[SEGMENTS + 1] FLASH_MEMORY = {
    32768, 32689, 32453, 32063, 31521, 30833, 30007, 29049, 27969, 26778, 25486,
    24107, 22654, 21140, 19580, 17990, 16384, 14778, 13188, 11628, 10114, 8661,
    7282,  5990,  4799,  3719,  2761,  1935,  1247,  705,   315,   79,    0,
};

/* Kept over a warm reset and read from outside: no padding on the chip. */
#ifdef __AVR__
_Static_assert(sizeof(thermal_model_spring_state_t) == 15, "size of what a spring remembers");
_Static_assert(sizeof(thermal_model_state_t) == 8 + 15 * THERMAL_MODEL_MAX_SPRINGS, "and of all");
#endif

static spring_index_t clamp_index(const thermal_model_t *model, spring_index_t spring)
{
    return spring < model->springs ? spring : 0;
}

static int16_t c7_of(int32_t value_c23)
{
    return (int16_t)(value_c23 >> 16);
}

static int32_t c23_of(int16_t value_c7)
{
    return (int32_t)value_c7 * 65536;
}

static int16_t clamp_c7(int32_t temperature_c7)
{
    if (temperature_c7 < THERMAL_MODEL_LOWEST_C7) {
        return THERMAL_MODEL_LOWEST_C7;
    }
    return temperature_c7 > THERMAL_MODEL_HIGHEST_C7 ? THERMAL_MODEL_HIGHEST_C7
                                                     : (int16_t)temperature_c7;
}

/* In the unit of flows, from one in Q9.7. */
static int16_t c6_of(int16_t temperature_c7)
{
    return (int16_t)(temperature_c7 >> 1);
}

/* Where a temperature is half a step later if it goes on as in the last. */
static int16_t midstep_c6(int16_t before_c7, int16_t now_c7)
{
    return c6_of(clamp_c7(now_c7 + (((int32_t)now_c7 - before_c7) >> 1)));
}

/* ---- phase ---- */

thermal_model_transformation_t thermal_model_transformation(const thermal_model_t *model,
                                                            spring_index_t spring)
{
    const int16_t shift_c7 = model->spring[clamp_index(model, spring)].transformation_shift_c7;
    thermal_model_transformation_t points = model->transformation;
    points.martensite_finish_c7 = (int16_t)(points.martensite_finish_c7 + shift_c7);
    points.martensite_start_c7 = (int16_t)(points.martensite_start_c7 + shift_c7);
    points.austenite_start_c7 = (int16_t)(points.austenite_start_c7 + shift_c7);
    points.austenite_finish_c7 = (int16_t)(points.austenite_finish_c7 + shift_c7);
    return points;
}

/* a b for two shares in Q0.15. */
static uint16_t product_q15(uint16_t a, uint16_t b)
{
    return (uint16_t)(((uint32_t)a * b << 1) >> 16);
}

/* S at a distance into a transformation: Q0.15, from 1 down to 0. */
static uint16_t shape(int16_t distance_c7, uint16_t position_factor)
{
    if (distance_c7 <= 0) {
        return THERMAL_MODEL_AUSTENITE_FULL;
    }
    const uint32_t position = ((uint32_t)(uint16_t)distance_c7 * position_factor) >> 8;
    if (position >= SEGMENTS * 256u) {
        return 0;
    }
    const uint16_t *segment = &cosine[position >> 8];
    const uint16_t left = flash_word(segment);
    const uint16_t fall = (uint16_t)(left - flash_word(segment + 1));
    return (uint16_t)(left - (uint16_t)(((uint32_t)fall * (uint8_t)position) >> 8));
}

/* The phase at a temperature of a branch. */
static uint16_t austenite_on_branch(const thermal_model_t *model,
                                    const thermal_model_transformation_t *points, uint8_t branch,
                                    uint16_t amplitude, int16_t temperature_c7)
{
    if (branch == THERMAL_MODEL_BRANCH_HEATING) {
        const int16_t distance_c7 = (int16_t)(temperature_c7 - points->austenite_start_c7);
        return (uint16_t)(THERMAL_MODEL_AUSTENITE_FULL -
                          product_q15(amplitude, shape(distance_c7, model->heating_position)));
    }
    const int16_t distance_c7 = (int16_t)(points->martensite_start_c7 - temperature_c7);
    return product_q15(amplitude, shape(distance_c7, model->cooling_position));
}

/* How far it came on its branch is where the phase stands. */
static uint16_t austenite_of(const thermal_model_t *model,
                             const thermal_model_transformation_t *points,
                             const thermal_model_spring_state_t *state)
{
    return austenite_on_branch(model, points, state->branch, state->amplitude,
                               state->branch == THERMAL_MODEL_BRANCH_HEATING ? state->heating_c7
                                                                             : state->cooling_c7);
}

static int32_t latent_c23_of(const thermal_model_t *model, uint16_t austenite)
{
    return (int32_t)((uint32_t)model->latent_full_c8 * austenite); /* Q8.8 times Q0.15 */
}

/* Nothing is left to transform: all austenite, or all martensite. */
static void complete(const thermal_model_t *model, const thermal_model_transformation_t *points,
                     thermal_model_spring_state_t *state, bool austenite)
{
    state->amplitude = THERMAL_MODEL_AUSTENITE_FULL;
    if (austenite) {
        state->branch = THERMAL_MODEL_BRANCH_HEATING;
        state->heating_c7 = model->highest_c7;
        state->cooling_c7 = points->martensite_start_c7;
    } else {
        state->branch = THERMAL_MODEL_BRANCH_COOLING;
        state->heating_c7 = points->austenite_start_c7;
        state->cooling_c7 = THERMAL_MODEL_LOWEST_C7;
    }
}

/* Onto the branch of heating or cooling, unless it is on that; what it has left to transform. */
static uint16_t turn_to(const thermal_model_t *model, const thermal_model_transformation_t *points,
                        thermal_model_spring_state_t *state, bool heats)
{
    const uint8_t branch = heats ? THERMAL_MODEL_BRANCH_HEATING : THERMAL_MODEL_BRANCH_COOLING;
    if (state->branch != branch) {
        const uint16_t austenite = austenite_of(model, points, state);
        state->amplitude = heats ? (uint16_t)(THERMAL_MODEL_AUSTENITE_FULL - austenite) : austenite;
        state->branch = branch;
        if (heats) {
            state->cooling_c7 = points->martensite_start_c7;
        } else {
            state->heating_c7 = points->austenite_start_c7;
        }
    }
    return state->amplitude;
}

static int32_t clamp_c23(int32_t value_c23, int32_t lowest_c23, int32_t highest_c23)
{
    return value_c23 < lowest_c23 ? lowest_c23 : value_c23 > highest_c23 ? highest_c23 : value_c23;
}

/* How far a spring comes on its branch towards held_c7, which it would reach without latent heat:
 * up to where temperature and latent heat add up to its enthalpy. Never back. */
static int16_t reached_c7(const thermal_model_t *model,
                          const thermal_model_transformation_t *points,
                          const thermal_model_spring_state_t *state, int16_t held_c7,
                          int32_t enthalpy_c23)
{
    const bool heats = state->branch == THERMAL_MODEL_BRANCH_HEATING;
    int16_t from_c7 = heats ? state->heating_c7 : state->cooling_c7;
    int16_t to_c7 = (int16_t)(heats ? held_c7 + 1 : held_c7 - 1); /* too far */
    if (heats && to_c7 > points->austenite_finish_c7) {
        to_c7 = points->austenite_finish_c7;
    } else if (!heats && to_c7 < points->martensite_finish_c7) {
        to_c7 = points->martensite_finish_c7;
    }
    while (to_c7 - from_c7 > 1 || from_c7 - to_c7 > 1) {
        const int16_t middle_c7 = (int16_t)(from_c7 + (to_c7 - from_c7) / 2);
        const int16_t there_c7 =
            c7_of(c23_of(middle_c7) +
                  latent_c23_of(model, austenite_on_branch(model, points, state->branch,
                                                           state->amplitude, middle_c7)));
        if (heats ? there_c7 <= c7_of(enthalpy_c23) : there_c7 >= c7_of(enthalpy_c23)) {
            from_c7 = middle_c7;
        } else {
            to_c7 = middle_c7;
        }
    }
    return from_c7;
}

/* A spring passes a threshold if its phase is held, and comes to held_c23: lets the phase follow.
 */
static void transform(const thermal_model_t *model, const thermal_model_transformation_t *points,
                      thermal_model_spring_state_t *state, int32_t held_c23)
{
    const int32_t enthalpy_c23 = fixed_point_add_saturated(held_c23, state->latent_c23);
    const bool heats = c7_of(held_c23) > state->heating_c7;
    const uint16_t all = heats ? THERMAL_MODEL_AUSTENITE_FULL : 0;
    const int32_t done_c23 = enthalpy_c23 - latent_c23_of(model, all);
    int32_t temperature_c23;
    if (turn_to(model, points, state, heats) == 0) {
        complete(model, points, state, heats);
        temperature_c23 = held_c23;
    } else if (heats ? c7_of(done_c23) >= points->austenite_finish_c7
                     : c7_of(done_c23) <= points->martensite_finish_c7) {
        complete(model, points, state, heats);
        state->latent_c23 = latent_c23_of(model, all);
        temperature_c23 = done_c23;
    } else {
        const int16_t now_c7 = reached_c7(model, points, state, c7_of(held_c23), enthalpy_c23);
        if (heats) {
            state->heating_c7 = now_c7;
        } else {
            state->cooling_c7 = now_c7;
        }
        const uint16_t austenite = austenite_of(model, points, state);
        temperature_c23 = clamp_c23(enthalpy_c23 - latent_c23_of(model, austenite), c23_of(now_c7),
                                    c23_of(now_c7) + 0xffff);
        state->latent_c23 = enthalpy_c23 - temperature_c23;
    }
    state->temperature_c23 =
        clamp_c23(temperature_c23, c23_of(THERMAL_MODEL_LOWEST_C7), c23_of(model->highest_c7));
}

static bool is_held_at_a_limit(const thermal_model_t *model, int32_t temperature_c23)
{
    return temperature_c23 == c23_of(THERMAL_MODEL_LOWEST_C7) ||
           temperature_c23 == c23_of(model->highest_c7);
}

/* Heat into a spring, over its heat capacity: its phase follows. */
static void add_heat(thermal_model_t *model, spring_index_t i, int32_t gain_c23)
{
    thermal_model_spring_state_t *state = &model->state.spring[i];
    const int32_t held_c23 = fixed_point_add_saturated(state->temperature_c23, gain_c23);
    const int16_t held_c7 = c7_of(held_c23);
    if (held_c7 <= state->heating_c7 && held_c7 >= state->cooling_c7) {
        state->temperature_c23 = held_c23;
        return;
    }
    const int64_t enthalpy_c23 = (int64_t)held_c23 + state->latent_c23;
    const thermal_model_transformation_t points = thermal_model_transformation(model, i);
    transform(model, &points, state, held_c23);
    INVARIANT((int64_t)state->temperature_c23 + state->latent_c23 == enthalpy_c23 ||
              is_held_at_a_limit(model, state->temperature_c23));
    (void)enthalpy_c23;
}

/* ---- step ---- */

/* One step of air or plate with this flow from the springs. */
static void step_node(thermal_model_slow_node_t *node, int32_t *state_c23, int16_t ambient_c7,
                      int64_t flow)
{
    flow -= (int64_t)(int16_t)(node->midstep_c6 - c6_of(ambient_c7)) * node->loss_uw_per_k;
    const int64_t gain_c23 = (flow * node->gain + (INT64_C(1) << 27)) >> 28;
    const int16_t before_c7 = c7_of(*state_c23);
    const int64_t after_c23 = *state_c23 + gain_c23;
    const int32_t lowest_c23 = c23_of(THERMAL_MODEL_LOWEST_C7);
    const int32_t highest_c23 = c23_of(THERMAL_MODEL_HIGHEST_C7);
    *state_c23 = after_c23 < lowest_c23    ? lowest_c23
                 : after_c23 > highest_c23 ? highest_c23
                                           : (int32_t)after_c23;
    const int16_t now_c7 = c7_of(*state_c23);
    node->midstep_c6 = node->quick ? c6_of(now_c7) : midstep_c6(before_c7, now_c7);
}

void thermal_model_step(thermal_model_t *model, const uint32_t power_uw[])
{
    int32_t gain_c23[THERMAL_MODEL_MAX_SPRINGS];
    int64_t to_air = 0;
    int64_t to_plate = 0;
    INVARIANT(thermal_model_exchange_closes(model));
    for (spring_index_t i = 0; i < model->springs; i++) {
        const thermal_model_flows_t flows =
            thermal_model_flows_at(model, i, model->spring[i].midstep_c6);
        const uint32_t power = power_uw[i] < THERMAL_MODEL_HIGHEST_POWER_UW
                                   ? power_uw[i]
                                   : THERMAL_MODEL_HIGHEST_POWER_UW;
        gain_c23[i] = fixed_point_scale_q31((int32_t)(power << 6) + flows.into_spring,
                                            model->spring[i].step_gain);
        to_air += flows.to_air;
        to_plate += flows.to_plate;
    }
    for (spring_index_t i = 0; i < model->springs; i++) {
        const int16_t before_c7 = thermal_model_temperature_c7(model, i);
        add_heat(model, i, gain_c23[i]);
        model->spring[i].midstep_c6 = midstep_c6(before_c7, thermal_model_temperature_c7(model, i));
    }
    if (model->parameters.air_exchange_uw_per_k != 0) {
        step_node(&model->air, &model->state.air_c23, model->ambient_c7, to_air);
    }
    if (model->parameters.plate_coupling_uw_per_k != 0) {
        step_node(&model->plate, &model->state.plate_c23, model->ambient_c7, to_plate);
    }
    INVARIANT(thermal_model_is_consistent(model));
}

/* ---- setting and reading ---- */

static bool spring_is_consistent(const thermal_model_t *model, spring_index_t i,
                                 const thermal_model_spring_state_t *state)
{
    const int32_t most_c23 = latent_c23_of(model, THERMAL_MODEL_AUSTENITE_FULL) + LATENT_SLACK_C23;
    if (state->branch > THERMAL_MODEL_BRANCH_HEATING ||
        state->amplitude > THERMAL_MODEL_AUSTENITE_FULL || state->latent_c23 < -LATENT_SLACK_C23 ||
        state->latent_c23 > most_c23) {
        return false;
    }
    const int16_t temperature_c7 = c7_of(state->temperature_c23);
    if (temperature_c7 > state->heating_c7 || temperature_c7 < state->cooling_c7) {
        return false;
    }
    const thermal_model_transformation_t points = thermal_model_transformation(model, i);
    if (state->branch == THERMAL_MODEL_BRANCH_HEATING) {
        return (state->heating_c7 == model->highest_c7 ||
                (state->heating_c7 >= points.austenite_start_c7 &&
                 state->heating_c7 < points.austenite_finish_c7)) &&
               state->cooling_c7 == points.martensite_start_c7;
    }
    return (state->cooling_c7 == THERMAL_MODEL_LOWEST_C7 ||
            (state->cooling_c7 <= points.martensite_start_c7 &&
             state->cooling_c7 > points.martensite_finish_c7)) &&
           state->heating_c7 == points.austenite_start_c7;
}

void thermal_model_set_ambient(thermal_model_t *model, int16_t ambient_c7)
{
    model->ambient_c7 = clamp_c7(ambient_c7);
    if (model->parameters.air_exchange_uw_per_k == 0) {
        model->air.midstep_c6 = c6_of(model->ambient_c7);
        model->state.air_c23 = c23_of(model->ambient_c7);
    }
    if (model->parameters.plate_coupling_uw_per_k == 0) {
        model->plate.midstep_c6 = c6_of(model->ambient_c7);
        model->state.plate_c23 = c23_of(model->ambient_c7);
    }
}

void thermal_model_set_fan(thermal_model_t *model, uint8_t percent)
{
    if (percent > 100) {
        percent = 100;
    }
    if (percent != model->fan_percent) {
        model->fan_percent = percent;
        thermal_model_apply_fan(model);
    }
}

void thermal_model_refresh(thermal_model_t *model)
{
    thermal_model_apply_fan(model);
}

void thermal_model_reset(thermal_model_t *model, int16_t temperature_c7)
{
    temperature_c7 = clamp_c7(temperature_c7);
    model->state.air_c23 = c23_of(temperature_c7);
    model->state.plate_c23 = c23_of(temperature_c7);
    model->air.midstep_c6 = c6_of(temperature_c7);
    model->plate.midstep_c6 = c6_of(temperature_c7);
    thermal_model_set_ambient(model, model->ambient_c7); /* where there is no air or plate */
    for (spring_index_t i = 0; i < model->springs; i++) {
        const thermal_model_transformation_t points = thermal_model_transformation(model, i);
        complete(model, &points, &model->state.spring[i], false);
        thermal_model_set_temperature(model, i, temperature_c7);
    }
}

void thermal_model_set_temperature(thermal_model_t *model, spring_index_t spring,
                                   int16_t temperature_c7)
{
    spring = clamp_index(model, spring);
    temperature_c7 = clamp_c7(temperature_c7);
    if (temperature_c7 > model->highest_c7) {
        temperature_c7 = model->highest_c7;
    }
    thermal_model_spring_state_t *state = &model->state.spring[spring];
    const thermal_model_transformation_t points = thermal_model_transformation(model, spring);
    const bool heats = temperature_c7 > state->heating_c7;
    if (heats || temperature_c7 < state->cooling_c7) {
        const bool is_done = heats ? temperature_c7 >= points.austenite_finish_c7
                                   : temperature_c7 <= points.martensite_finish_c7;
        if (turn_to(model, &points, state, heats) == 0 || is_done) {
            complete(model, &points, state, heats);
        } else if (heats) {
            state->heating_c7 = temperature_c7;
        } else {
            state->cooling_c7 = temperature_c7;
        }
    }
    state->latent_c23 = latent_c23_of(model, austenite_of(model, &points, state));
    state->temperature_c23 = c23_of(temperature_c7);
    model->spring[spring].midstep_c6 = c6_of(temperature_c7);
    INVARIANT(spring_is_consistent(model, spring, state));
}

int16_t thermal_model_temperature_c7(const thermal_model_t *model, spring_index_t spring)
{
    return c7_of(model->state.spring[clamp_index(model, spring)].temperature_c23);
}

uint16_t thermal_model_austenite(const thermal_model_t *model, spring_index_t spring)
{
    spring = clamp_index(model, spring);
    const thermal_model_transformation_t points = thermal_model_transformation(model, spring);
    return austenite_of(model, &points, &model->state.spring[spring]);
}

/* A phase's own resistance: its rise times the distance from 20 degC fits 28 bits, as a share in
 * 2^-24 25 bits. */
static int32_t resistance_of_phase(uint32_t at_reference_uohm, int16_t rise_ppm_per_k,
                                   int16_t above_c7)
{
    const int32_t rise = (int32_t)rise_ppm_per_k * above_c7;           /* 1e-6 / 128 */
    const int32_t share_q24 = (int32_t)(((int64_t)rise * 8590) >> 16); /* 2^40 / 128e6 */
    const int32_t change_uohm = (int32_t)(((int64_t)(int32_t)at_reference_uohm * share_q24) >> 24);
    return (int32_t)at_reference_uohm + change_uohm;
}

uint32_t thermal_model_resistance_uohm_at(const thermal_model_t *model, spring_index_t spring,
                                          uint16_t austenite, int16_t temperature_c7)
{
    const thermal_model_parameters_t *p = &model->parameters;
    const int16_t above_c7 = (int16_t)(clamp_c7(temperature_c7) - RESISTANCE_REFERENCE_C7);
    const int32_t martensite_uohm = resistance_of_phase(
        p->resistance_martensite_uohm, p->resistance_martensite_rise_ppm_per_k, above_c7);
    const int32_t austenite_uohm = resistance_of_phase(
        p->resistance_austenite_uohm, p->resistance_austenite_rise_ppm_per_k, above_c7);
    const int32_t change_uohm =
        (int32_t)(((int64_t)(austenite_uohm - martensite_uohm) * austenite) >> 15);
    const uint32_t own_uohm = (uint32_t)(martensite_uohm + change_uohm);
    return (own_uohm > 0 ? own_uohm : 1u) + p->contact_uohm[clamp_index(model, spring)];
}

uint32_t thermal_model_resistance_uohm(const thermal_model_t *model, spring_index_t spring)
{
    return thermal_model_resistance_uohm_at(model, spring, thermal_model_austenite(model, spring),
                                            thermal_model_temperature_c7(model, spring));
}

uint32_t thermal_model_heating_uw(const thermal_model_t *model, spring_index_t spring,
                                  uint16_t current_ma, uint16_t voltage_mv)
{
    const uint16_t contact_q16 = model->spring[clamp_index(model, spring)].contact_q16;
    const uint16_t contact_mv = (uint16_t)(((uint32_t)current_ma * contact_q16) >> 16);
    return voltage_mv > contact_mv ? (uint32_t)current_ma * (uint16_t)(voltage_mv - contact_mv) : 0;
}

int16_t thermal_model_air_c7(const thermal_model_t *model)
{
    return c7_of(model->state.air_c23);
}

int16_t thermal_model_plate_c7(const thermal_model_t *model)
{
    return c7_of(model->state.plate_c23);
}

int16_t thermal_model_ambient_c7(const thermal_model_t *model)
{
    return model->ambient_c7;
}

uint16_t thermal_model_coupling_uw_per_k(const thermal_model_t *model, spring_index_t spring,
                                         spring_index_t other)
{
    const thermal_model_spring_t *a = &model->spring[spring];
    const thermal_model_spring_t *b = &model->spring[other];
    const int8_t down = (int8_t)(a->row - b->row);
    const int8_t along = (int8_t)(a->column - b->column);
    if (spring == other || down < -1 || down > 1 || along < -1 || along > 1) {
        return 0;
    }
    return down == 0 || along == 0 ? model->orthogonal_uw_per_k : model->diagonal_uw_per_k;
}

int32_t thermal_model_power_to_hold_uw(const thermal_model_t *model, spring_index_t spring,
                                       int16_t temperature_c7)
{
    const thermal_model_flows_t flows =
        thermal_model_flows_at(model, clamp_index(model, spring), c6_of(clamp_c7(temperature_c7)));
    return -(flows.into_spring >> 6);
}

void thermal_model_get_state(const thermal_model_t *model, thermal_model_state_t *state)
{
    *state = model->state;
}

static bool is_within_limits(int32_t temperature_c23)
{
    return temperature_c23 >= c23_of(THERMAL_MODEL_LOWEST_C7) &&
           temperature_c23 <= c23_of(THERMAL_MODEL_HIGHEST_C7);
}

static bool state_is_consistent(const thermal_model_t *model, const thermal_model_state_t *state)
{
    if (!is_within_limits(state->air_c23) || !is_within_limits(state->plate_c23)) {
        return false;
    }
    for (spring_index_t i = 0; i < model->springs; i++) {
        if (!spring_is_consistent(model, i, &state->spring[i])) {
            return false;
        }
    }
    return true;
}

bool thermal_model_set_state(thermal_model_t *model, const thermal_model_state_t *state)
{
    if (!state_is_consistent(model, state)) {
        return false;
    }
    model->state = *state;
    model->air.midstep_c6 = c6_of(c7_of(state->air_c23));
    model->plate.midstep_c6 = c6_of(c7_of(state->plate_c23));
    thermal_model_set_ambient(model, model->ambient_c7); /* where there is no air or plate */
    for (spring_index_t i = 0; i < model->springs; i++) {
        model->spring[i].midstep_c6 = c6_of(c7_of(state->spring[i].temperature_c23));
    }
    return true;
}

/* So much of a whole that shape makes this part of it. */
static uint16_t whole_of(uint16_t part, uint16_t shape_q15)
{
    return part >= shape_q15 ? (uint16_t)THERMAL_MODEL_AUSTENITE_FULL
                             : (uint16_t)(((uint32_t)part << 15) / shape_q15);
}

/* A spring of that temperature and phase, as if it had come there slowly. */
static void place(const thermal_model_t *model, const thermal_model_transformation_t *points,
                  thermal_model_spring_state_t *state, int16_t temperature_c7, uint16_t austenite)
{
    const bool heats = temperature_c7 > points->austenite_start_c7;
    const int16_t into_c7 = (int16_t)(heats ? temperature_c7 - points->austenite_start_c7
                                            : points->martensite_start_c7 - temperature_c7);
    const uint16_t left = shape(into_c7, heats ? model->heating_position : model->cooling_position);
    const uint16_t part = heats ? (uint16_t)(THERMAL_MODEL_AUSTENITE_FULL - austenite) : austenite;
    const bool rests = !heats && into_c7 <= 0;
    const bool is_done = heats ? temperature_c7 >= points->austenite_finish_c7
                               : temperature_c7 <= points->martensite_finish_c7;
    if (part == 0 || left == 0 || is_done || (rests && part == THERMAL_MODEL_AUSTENITE_FULL)) {
        complete(model, points, state, heats || (rests && part != 0));
        return;
    }
    state->branch = heats ? THERMAL_MODEL_BRANCH_HEATING : THERMAL_MODEL_BRANCH_COOLING;
    state->amplitude = whole_of(part, left);
    state->heating_c7 = heats ? temperature_c7 : points->austenite_start_c7;
    state->cooling_c7 = heats || rests ? points->martensite_start_c7 : temperature_c7;
}

void thermal_model_fit_state(thermal_model_t *model, const uint16_t austenite[])
{
    thermal_model_set_ambient(model, model->ambient_c7); /* where there is no air or plate */
    for (spring_index_t i = 0; i < model->springs; i++) {
        const thermal_model_transformation_t points = thermal_model_transformation(model, i);
        thermal_model_spring_state_t *const own = &model->state.spring[i];
        if (!spring_is_consistent(model, i, own) ||
            austenite_of(model, &points, own) != austenite[i]) {
            const int16_t was_c7 = c7_of(own->temperature_c23);
            const int16_t now_c7 = was_c7 < model->highest_c7 ? was_c7 : model->highest_c7;
            place(model, &points, own, now_c7, austenite[i]);
            own->temperature_c23 = c23_of(now_c7);
            model->spring[i].midstep_c6 = c6_of(now_c7);
        }
        own->latent_c23 = latent_c23_of(model, austenite_of(model, &points, own));
        INVARIANT(spring_is_consistent(model, i, own));
    }
}

bool thermal_model_is_consistent(const thermal_model_t *model)
{
    if (model->springs == 0 || model->springs > THERMAL_MODEL_MAX_SPRINGS ||
        model->springs != model->parameters.rows * model->parameters.columns) {
        return false;
    }
    for (spring_index_t i = 0; i < model->springs; i++) {
        if (model->spring[i].midstep_c6 < c6_of(THERMAL_MODEL_LOWEST_C7) ||
            model->spring[i].midstep_c6 > c6_of(THERMAL_MODEL_HIGHEST_C7)) {
            return false;
        }
    }
    return state_is_consistent(model, &model->state);
}
