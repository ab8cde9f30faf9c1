#include "thermal_model.h"

#include <string.h>

#include "fixed_point.h"
#include "thermal_model_internal.h"
#ifdef __AVR__
#include "thermal_model_pass_avr.h"
#else
#define thermal_model_pass thermal_model_pass_in_c
#endif

/* How one step works.
 *
 * Heat flows are taken at the middle of the step: from `lead`, the temperature
 * extrapolated by half a step (Adams-Bashforth of second order, with the power
 * left out of the extrapolation as it may jump). A conductance in uW/K times a
 * lead in 1/64 K is a flow in 1/64 uW. Flows add modulo 2^32; init has made
 * sure that a spring's total fits. flow / 2^8 times step / capacity is the
 * spring's gain of enthalpy, in 2^-23 K. Enthalpy over heat capacity is the
 * state, h = T + (L / C) austenite, so that latent heat is neither lost nor
 * made. Where the phase rests, T = h - latent is one subtraction. Where it
 * transforms, T follows from h by one Newton step on the branch's cosine: the
 * residual is taken anew each step, so that errors do not add up. */

#ifdef __AVR__
#include <avr/pgmspace.h>
#define IN_FLASH           PROGMEM
#define READ_WORD(address) pgm_read_word(address)
#define READ_BYTE(address) pgm_read_byte(address)
#else
#define IN_FLASH
#define READ_WORD(address) (*(address))
#define READ_BYTE(address) (*(address))
#endif

/* A phase that moves, and what it calls: fast, since nine may move at a time. */
#define ALWAYS __attribute__((always_inline))
#ifdef __AVR__
#define HOT __attribute__((noinline, noclone))
/* The address stays in a pointer register instead of being worked out anew for each field. */
#define KEEP_ADDRESS(pointer) __asm__("" : "+b"(pointer))
#else
#define HOT
#define KEEP_ADDRESS(pointer) (void)(pointer)
#endif

#define SEGMENTS         32
#define GAIN_ONE         255u
#define LATENT_SLACK_C23 0x1000000 /* 2 K: what Newton may leave for the next step */

/* 2^15 (1 + cos(pi k / 32)) / 2 */
static const uint16_t cosine[SEGMENTS + 1] IN_FLASH = {
    32768, 32689, 32453, 32063, 31521, 30833, 30007, 29049, 27969, 26778, 25486,
    24107, 22654, 21140, 19580, 17990, 16384, 14778, 13188, 11628, 10114, 8661,
    7282,  5990,  4799,  3719,  2761,  1935,  1247,  705,   315,   79,    0,
};

/* 256 / (1 + (k + 1/2) / 8): dT/dh where the branch's slope d(latent)/dT is k/8 */
static const uint8_t gains[128] IN_FLASH = {
    241, 216, 195, 178, 164, 152, 141, 132, 124, 117, 111, 105, 100, 95, 91, 87, 84, 80, 77,
    74,  72,  69,  67,  65,  63,  61,  59,  58,  56,  55,  53,  52,  51, 49, 48, 47, 46, 45,
    44,  43,  42,  41,  41,  40,  39,  38,  38,  37,  36,  36,  35,  34, 34, 33, 33, 32, 32,
    31,  31,  30,  30,  29,  29,  29,  28,  28,  27,  27,  27,  26,  26, 26, 25, 25, 25, 25,
    24,  24,  24,  23,  23,  23,  23,  22,  22,  22,  22,  21,  21,  21, 21, 21, 20, 20, 20,
    20,  20,  19,  19,  19,  19,  19,  19,  18,  18,  18,  18,  18,  18, 17, 17, 17, 17, 17,
    17,  17,  16,  16,  16,  16,  16,  16,  16,  16,  15,  15,  15,  15,
};

static uint8_t clamp_index(const thermal_model_t *model, uint8_t spring)
{
    return spring < model->pass.count ? spring : 0;
}

/* ---- phase ---- */

/* S at a distance (c7) into a transformation: Q0.15, and by how much it falls in this segment. */
static inline ALWAYS uint16_t shape_inline(uint16_t distance_c7, uint16_t position_factor,
                                           uint16_t *fall)
{
    uint16_t position = (uint16_t)(fixed_point_mac_u16(0, distance_c7, position_factor) >> 8);
    uint8_t segment = (uint8_t)(position >> 8);
    if (segment >= SEGMENTS) {
        *fall = 0;
        return 0;
    }
    uint16_t left = READ_WORD(&cosine[segment]);
    *fall = (uint16_t)(left - READ_WORD(&cosine[segment + 1]));
    return (uint16_t)(left - (uint16_t)(fixed_point_mac_u16(0, *fall, (uint8_t)position) >> 8));
}

static uint16_t branch_shape(uint16_t distance_c7, uint16_t position_factor)
{
    uint16_t fall;
    return shape_inline(distance_c7, position_factor, &fall);
}

static uint16_t austenite_of(const thermal_model_t *model,
                             const thermal_model_spring_state_t *state)
{
    if (state->branch == THERMAL_MODEL_BRANCH_HEATING) {
        if (state->heating_c7 >= model->austenite_finish_c7) {
            return THERMAL_MODEL_AUSTENITE_FULL;
        }
        uint16_t distance = (uint16_t)(state->heating_c7 - model->austenite_start_c7);
        uint16_t shape = branch_shape(distance, model->heating_position);
        return (uint16_t)(THERMAL_MODEL_AUSTENITE_FULL -
                          (fixed_point_mac_u16(0, shape, state->amplitude) >> 15));
    }
    if (state->cooling_c7 <= model->martensite_finish_c7) {
        return 0;
    }
    uint16_t distance = (uint16_t)(model->martensite_start_c7 - state->cooling_c7);
    uint16_t shape = branch_shape(distance, model->cooling_position);
    return (uint16_t)(fixed_point_mac_u16(0, shape, state->amplitude) >> 15);
}

/* What follows from amplitude and branch. */
static void refresh_branch(const thermal_model_t *model, thermal_model_spring_t *spring,
                           const thermal_model_spring_state_t *state)
{
    uint16_t full = (uint16_t)(model->latent_full_c23 >> 15);
    spring->branch_latent = (uint16_t)(fixed_point_mac_u16(0, full, state->amplitude) >> 15);
    spring->branch_slope =
        fixed_point_high_u16(spring->branch_latent, state->branch == THERMAL_MODEL_BRANCH_HEATING
                                                        ? model->heating_slope
                                                        : model->cooling_slope);
}

static inline ALWAYS int16_t high_word(int32_t value)
{
    return (int16_t)((uint32_t)value >> 16);
}

/* Nothing is left to transform: all austenite, or all martensite. */
static __attribute__((noinline)) void complete(const thermal_model_t *model,
                                               thermal_model_spring_state_t *state, bool austenite)
{
    state->amplitude = THERMAL_MODEL_AUSTENITE_FULL;
    state->gain = GAIN_ONE;
    if (austenite) {
        state->branch = THERMAL_MODEL_BRANCH_HEATING;
        state->heating_c7 = model->highest_c7;
        state->cooling_c7 = model->martensite_start_c7;
        state->latent_c23 = model->latent_full_c23;
    } else {
        state->branch = THERMAL_MODEL_BRANCH_COOLING;
        state->heating_c7 = model->austenite_start_c7;
        state->cooling_c7 = THERMAL_MODEL_LOWEST_C7;
        state->latent_c23 = 0;
    }
}

/* Onto the branch of heating or cooling, unless it is on that; what it has left to transform. */
static uint16_t turn_to(const thermal_model_t *model, thermal_model_spring_state_t *state,
                        bool heats)
{
    const uint8_t branch = heats ? THERMAL_MODEL_BRANCH_HEATING : THERMAL_MODEL_BRANCH_COOLING;
    if (state->branch != branch) {
        const uint16_t austenite = austenite_of(model, state);
        state->amplitude = heats ? (uint16_t)(THERMAL_MODEL_AUSTENITE_FULL - austenite) : austenite;
        state->branch = branch;
        state->gain = GAIN_ONE;
        if (heats) {
            state->cooling_c7 = model->martensite_start_c7;
        } else {
            state->heating_c7 = model->austenite_start_c7;
        }
    }
    return state->amplitude;
}

/* How far (c7) into a transformation the spring is now; `turn` is how far it was, `beyond` the
 * enthalpy added since. Solves distance - A S(distance) = enthalpy_past_start for the branch's
 * latent heat A; never goes back. */
static inline ALWAYS int16_t newton(uint16_t turn, uint16_t beyond, uint16_t width,
                                    uint16_t position_factor, const thermal_model_spring_t *spring,
                                    uint8_t *gain, int16_t enthalpy_past_start)
{
    uint16_t target = (uint16_t)(turn + (uint16_t)(fixed_point_mac_u16(0, beyond, *gain) >> 8));
    if (target >= width) {
        target = (uint16_t)(width - 1u);
    }
    for (uint8_t pass = 0; pass < 4; pass++) { /* nearly always one: see the end */
        uint16_t fall;
        uint16_t shape = shape_inline(target, position_factor, &fall);
        uint32_t used = fixed_point_mac_u16(0, spring->branch_latent, shape); /* c23 */
        uint8_t index = (uint8_t)(fixed_point_mac_u16(0, spring->branch_slope, fall) >> 16);
        if (index > 127u) {
            index = 127u;
        }
        *gain = READ_BYTE(&gains[index]);
        int16_t residual =
            (int16_t)(enthalpy_past_start - (int16_t)target + high_word((int32_t)(used + 0x8000u)));
        int16_t correction = fixed_point_scale_s16_u8(residual, *gain);
        int16_t next = (int16_t)((int16_t)target + correction);
        if (next < (int16_t)turn) {
            next = (int16_t)turn;
        }
        if (next >= (int16_t)width) {
            next = (int16_t)(width - 1u);
        }
        target = (uint16_t)next;
        if (residual < 32 && residual > -32) {
            break;
        }
    }
    return (int16_t)target;
}

/* A spring with this enthalpy passes a threshold if its phase is held, and comes to held_c7: lets
 * the phase follow. What is left in state is the phase's memory and the latent heat; the
 * temperature is the rest of the enthalpy. */
static inline ALWAYS void transform(const thermal_model_t *model, thermal_model_spring_t *spring,
                                    thermal_model_spring_state_t *state, int16_t held_c7,
                                    int32_t enthalpy_c23)
{
    uint16_t width, turn, beyond, position;
    int16_t past;
    bool heats = held_c7 > state->heating_c7;
    if (heats != (state->branch == THERMAL_MODEL_BRANCH_HEATING)) {
        (void)turn_to(model, state, heats);
        refresh_branch(model, spring, state);
    }
    if (heats) {
        int16_t austenitic_c7 = high_word(enthalpy_c23 - model->latent_full_c23);
        if (austenitic_c7 >= model->austenite_finish_c7 || state->amplitude == 0) {
            complete(model, state, true);
            return;
        }
        if (model->latent_full_c23 == 0) {
            state->heating_c7 = held_c7;
            return;
        }
        width = (uint16_t)(model->austenite_finish_c7 - model->austenite_start_c7);
        turn = (uint16_t)(state->heating_c7 - model->austenite_start_c7);
        beyond = (uint16_t)(held_c7 - state->heating_c7);
        past = (int16_t)(austenitic_c7 - model->austenite_start_c7);
        position = model->heating_position;
    } else {
        int16_t martensitic_c7 = high_word(enthalpy_c23);
        if (martensitic_c7 <= model->martensite_finish_c7 || state->amplitude == 0) {
            complete(model, state, false);
            return;
        }
        if (model->latent_full_c23 == 0) {
            state->cooling_c7 = held_c7;
            return;
        }
        width = (uint16_t)(model->martensite_start_c7 - model->martensite_finish_c7);
        turn = (uint16_t)(model->martensite_start_c7 - state->cooling_c7);
        beyond = (uint16_t)(state->cooling_c7 - held_c7);
        past = (int16_t)(model->martensite_start_c7 - martensitic_c7);
        position = model->cooling_position;
    }
    int16_t distance = newton(turn, beyond, width, position, spring, &state->gain, past);
    int16_t temperature_c7;
    if (heats) {
        temperature_c7 = (int16_t)(model->austenite_start_c7 + distance);
        state->heating_c7 = temperature_c7;
    } else {
        temperature_c7 = (int16_t)(model->martensite_start_c7 - distance);
        state->cooling_c7 = temperature_c7;
    }
    state->latent_c23 = enthalpy_c23 - (int32_t)((uint32_t)(uint16_t)temperature_c7 << 16);
}

/* ---- flows ---- */

/* Radiated at a lead, 1/64 uW: factor (T / 512 K)^4. */
static uint32_t radiation_of(uint16_t lead, uint16_t factor)
{
    uint16_t kelvin = (uint16_t)(2u * lead + LEAD_ORIGIN_KELVIN);
    uint16_t square = fixed_point_high_u16(kelvin, kelvin);
    return fixed_point_mac_u16(0, fixed_point_high_u16(square, square), factor);
}

/* What the fan's air brings from upstream, having taken it there; 0 at the edge where it comes in.
 */
static uint32_t brought(const thermal_model_t *model, const thermal_model_spring_t *spring)
{
    if (spring->upstream == 0) {
        return 0;
    }
    const uint16_t *own = &model->lead[spring->frame + BLOCK_CENTRE];
    uint16_t upstream = own[model->wake_offset];
    return fixed_point_mac_s16_u16(0, (int16_t)(upstream - model->pass.air_lead), model->wake);
}

/* Flows that are the same for every spring: from the plate, and radiation from the surroundings. */
static inline __attribute__((always_inline)) uint32_t common_flow(const thermal_model_t *model)
{
    return fixed_point_mac_u16(model->ambient_radiation, model->plate_lead,
                               model->parameters.plate_coupling_uw_per_k);
}

static __attribute__((noinline)) int32_t clamp_c23(int32_t value)
{
    int16_t c7 = high_word(value);
    if (c7 < THERMAL_MODEL_LOWEST_C7) {
        return (int32_t)THERMAL_MODEL_LOWEST_C7 * 65536;
    }
    if (c7 >= THERMAL_MODEL_HIGHEST_C7) {
        return (int32_t)THERMAL_MODEL_HIGHEST_C7 * 65536;
    }
    return value;
}

/* One step of air or plate: flow (4 uW) in, less what it loses to ambient. 1/64 K times a coarse
 * loss is a unit of flow. */
static inline __attribute__((always_inline)) void relax(const thermal_model_slow_node_t *node,
                                                        int32_t *state_c23, uint16_t *lead,
                                                        uint16_t ambient_lead, int32_t flow)
{
    int32_t lost = (int32_t)fixed_point_mac_s16_u16(0, (int16_t)(*lead - ambient_lead), node->loss);
    if (node->units == 0) { /* one look where nothing is unusual */
        flow -= lost >> 8;
    } else {
        flow -= (node->units & SLOW_NODE_COARSE) != 0 ? lost : lost >> 8;
        if ((node->units & SLOW_NODE_MANY) != 0) {
            flow >>= 4;
        }
    }
    int32_t gain = fixed_point_scale_s24(fixed_point_clamp_s24(flow), node->gain);
    if (node->wide) {
        gain = fixed_point_clamp_s24(gain) * 256;
    }
    int16_t before = high_word(*state_c23);
    int32_t after = clamp_c23(fixed_point_add_saturated(*state_c23, gain));
    *state_c23 = after;
    int16_t now = high_word(after);
    *lead = lead_ahead(now, node->leads ? before : now);
}

static void set_lead(thermal_model_t *model, uint8_t spring, uint16_t lead)
{
    uint16_t *place = &model->lead[model->spring[spring].frame + BLOCK_CENTRE];
    model->pass.lead_sum += (uint32_t)lead - *place;
    *place = lead;
}

/* Flows that only some springs have, into their gain_c23. Returns what the wake takes from the air.
 */
static int32_t extra_flows(thermal_model_t *model)
{
    int32_t taken = 0;
    for (uint8_t i = 0; i < model->pass.count; i++) {
        thermal_model_spring_t *spring = &model->spring[i];
        const uint16_t *block = &model->lead[spring->frame];
        uint32_t flow = 0;
        if (model->wake != 0) {
            flow = brought(model, spring);
            taken += (int32_t)flow >> 8;
        }
        if (model->radiation_factor != 0) {
            flow -= radiation_of(block[BLOCK_CENTRE], model->radiation_factor);
        }
        spring->gain_c23 = (int32_t)flow;
    }
    return taken;
}

/* A spring that the pass left as it was, since the step takes it past a threshold. */
static HOT void follow_phase(thermal_model_t *model, uint8_t i)
{
    thermal_model_spring_t *spring = &model->spring[i];
    thermal_model_spring_state_t *state = &model->state.spring[i];
    KEEP_ADDRESS(spring);
    KEEP_ADDRESS(state);
    int16_t before = high_word(state->temperature_c23);
    int32_t held_c23 = fixed_point_add_saturated(state->temperature_c23, spring->gain_c23);
    int32_t enthalpy_c23 = fixed_point_add_saturated(held_c23, state->latent_c23);
    spring->pending = 0;
    transform(model, spring, state, high_word(held_c23), enthalpy_c23);
    int32_t temperature_c23 = enthalpy_c23 - state->latent_c23;
    int16_t temperature_c7 = high_word(temperature_c23);
    if (temperature_c7 > model->highest_c7 || temperature_c7 < THERMAL_MODEL_LOWEST_C7) {
        temperature_c7 = temperature_c7 < 0 ? THERMAL_MODEL_LOWEST_C7 : model->highest_c7;
        temperature_c23 = (int32_t)temperature_c7 * 65536;
    }
    state->temperature_c23 = temperature_c23;
    set_lead(model, i, lead_ahead(temperature_c7, before));
}

void thermal_model_settle(thermal_model_t *model, uint8_t spring)
{
    spring = clamp_index(model, spring);
    if (model->spring[spring].pending != 0) {
        follow_phase(model, spring);
    }
}

void thermal_model_follow_phases(thermal_model_t *model, uint8_t most)
{
    if (model->pass.pending == 0) {
        return;
    }
    for (uint8_t i = 0; i < model->pass.count; i++) {
        if (model->spring[i].pending == 0) {
            continue;
        }
        if (most-- == 0) {
            return;
        }
        follow_phase(model, i);
    }
    model->pass.pending = 0;
}

__attribute__((noinline)) void thermal_model_begin_step(thermal_model_t *model,
                                                        const uint32_t power_uw[])
{
    thermal_model_follow_phases(model, UINT8_MAX);
    int32_t above_plate = (int32_t)(model->pass.lead_sum -
                                    fixed_point_mac_u16(0, model->plate_lead, model->pass.count));
    model->pass.common = common_flow(model) + 128u; /* half of what the shift drops */
    model->pass.air_flow = 0;
    model->pass.power_uw = power_uw;
    if ((model->pass.flags & PASS_EXTRA) != 0) {
        model->pass.air_flow = -extra_flows(model);
    }
    thermal_model_pass(model);
    /* air, then plate, in a loop: the AVR's code for it is long */
    for (uint8_t plate = 0; plate < 2; plate++) {
        const uint16_t coupling = model->parameters.plate_coupling_uw_per_k;
        if ((plate ? coupling : model->air.loss) == 0) {
            continue;
        }
        relax(plate ? &model->plate : &model->air,
              plate ? &model->state.plate_c23 : &model->state.air_c23,
              plate ? &model->plate_lead : &model->pass.air_lead, model->ambient_lead,
              plate ? fixed_point_scale_s24(above_plate, (uint32_t)coupling << 8)
                    : model->pass.air_flow);
    }
}

void thermal_model_step(thermal_model_t *model, const uint32_t power_uw[])
{
    thermal_model_begin_step(model, power_uw);
    thermal_model_follow_phases(model, UINT8_MAX);
}

/* ---- setting and reading ---- */

void thermal_model_refresh_ambient(thermal_model_t *model)
{
    model->ambient_lead = lead_from_c7(model->ambient_c7);
    model->ambient_radiation = model->radiation_factor != 0
                                   ? radiation_of(model->ambient_lead, model->radiation_factor)
                                   : 0;
    if (model->parameters.air_exchange_uw_per_k == 0) {
        model->pass.air_lead = model->ambient_lead;
        model->state.air_c23 = (int32_t)model->ambient_c7 * 65536;
    }
    if (model->parameters.plate_coupling_uw_per_k == 0) {
        model->plate_lead = model->ambient_lead;
        model->state.plate_c23 = (int32_t)model->ambient_c7 * 65536;
    }
}

static __attribute__((noinline)) int16_t clamp_c7(int16_t temperature_c7)
{
    if (temperature_c7 < THERMAL_MODEL_LOWEST_C7) {
        return THERMAL_MODEL_LOWEST_C7;
    }
    return temperature_c7 > THERMAL_MODEL_HIGHEST_C7 ? THERMAL_MODEL_HIGHEST_C7 : temperature_c7;
}

void thermal_model_set_ambient(thermal_model_t *model, int16_t ambient_c7)
{
    ambient_c7 = clamp_c7(ambient_c7);
    if (ambient_c7 != model->ambient_c7) {
        model->ambient_c7 = ambient_c7;
        thermal_model_refresh_ambient(model);
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

void thermal_model_reset(thermal_model_t *model, int16_t temperature_c7)
{
    temperature_c7 = clamp_c7(temperature_c7);
    model->state.air_c23 = (int32_t)temperature_c7 * 65536;
    model->state.plate_c23 = model->state.air_c23;
    model->pass.air_lead = lead_from_c7(temperature_c7);
    model->plate_lead = model->pass.air_lead;
    thermal_model_refresh_ambient(model);
    for (uint8_t i = 0; i < model->pass.count; i++) {
        model->spring[i].pending = 0;
        complete(model, &model->state.spring[i], false);
        thermal_model_set_temperature(model, i, temperature_c7);
    }
}

void thermal_model_set_temperature(thermal_model_t *model, uint8_t spring, int16_t temperature_c7)
{
    spring = clamp_index(model, spring);
    thermal_model_settle(model, spring);
    temperature_c7 = clamp_c7(temperature_c7);
    if (temperature_c7 > model->highest_c7) {
        temperature_c7 = model->highest_c7;
    }
    thermal_model_spring_state_t *state = &model->state.spring[spring];
    const bool heats = temperature_c7 > state->heating_c7;
    if (heats || temperature_c7 < state->cooling_c7) {
        const bool beyond = heats ? temperature_c7 >= model->austenite_finish_c7
                                  : temperature_c7 <= model->martensite_finish_c7;
        if (beyond || turn_to(model, state, heats) == 0) {
            complete(model, state, heats);
        } else if (heats) {
            state->heating_c7 = temperature_c7;
        } else {
            state->cooling_c7 = temperature_c7;
        }
    }
    refresh_branch(model, &model->spring[spring], state);
    /* latent = L/C austenite, in two products: Q8.8 times Q0.15 is Q8.23 */
    state->latent_c23 = (int32_t)fixed_point_mac_u16(0, (uint16_t)(model->latent_full_c23 >> 15),
                                                     austenite_of(model, state));
    state->temperature_c23 = (int32_t)temperature_c7 * 65536;
    set_lead(model, spring, lead_from_c7(temperature_c7));
}

void thermal_model_add_temperature(thermal_model_t *model, uint8_t spring, int16_t difference_c7)
{
    spring = clamp_index(model, spring);
    thermal_model_settle(model, spring);
    int32_t sum = (int32_t)high_word(model->state.spring[spring].temperature_c23) + difference_c7;
    if (sum < THERMAL_MODEL_LOWEST_C7) {
        sum = THERMAL_MODEL_LOWEST_C7;
    }
    if (sum > THERMAL_MODEL_HIGHEST_C7) {
        sum = THERMAL_MODEL_HIGHEST_C7;
    }
    thermal_model_set_temperature(model, spring, (int16_t)sum);
}

int16_t thermal_model_enthalpy_c7(const thermal_model_t *model, uint8_t spring)
{
    const thermal_model_spring_state_t *state = &model->state.spring[clamp_index(model, spring)];
    return high_word(fixed_point_add_saturated(state->temperature_c23, state->latent_c23));
}

void thermal_model_add_enthalpy(thermal_model_t *model, uint8_t spring, int16_t difference_c7)
{
    spring = clamp_index(model, spring);
    thermal_model_settle(model, spring);
    thermal_model_spring_state_t *state = &model->state.spring[spring];
    int32_t difference_c23 = (int32_t)difference_c7 * 65536;
    int32_t held_c23 = fixed_point_add_saturated(state->temperature_c23, difference_c23);
    if (high_word(held_c23) > state->heating_c7 || high_word(held_c23) < state->cooling_c7) {
        model->spring[spring].gain_c23 = difference_c23;
        follow_phase(model, spring);
    } else {
        state->temperature_c23 = clamp_c23(held_c23);
    }
    set_lead(model, spring, lead_from_c7(high_word(state->temperature_c23)));
}

int16_t thermal_model_temperature_c7(const thermal_model_t *model, uint8_t spring)
{
    return high_word(model->state.spring[clamp_index(model, spring)].temperature_c23);
}

uint16_t thermal_model_austenite(const thermal_model_t *model, uint8_t spring)
{
    return austenite_of(model, &model->state.spring[clamp_index(model, spring)]);
}

uint32_t thermal_model_resistance_uohm(const thermal_model_t *model, uint8_t spring)
{
    uint16_t austenite = thermal_model_austenite(model, spring);
    int32_t difference = (int32_t)(model->parameters.resistance_austenite_uohm -
                                   model->parameters.resistance_martensite_uohm);
    int32_t change = (difference >> 15) * (int32_t)austenite +
                     (int32_t)(((uint32_t)difference & 0x7fffu) * austenite >> 15);
    return model->parameters.resistance_martensite_uohm + (uint32_t)change;
}

int16_t thermal_model_air_c7(const thermal_model_t *model)
{
    return high_word(model->state.air_c23);
}

int16_t thermal_model_plate_c7(const thermal_model_t *model)
{
    return high_word(model->state.plate_c23);
}

int32_t thermal_model_power_to_hold_uw(const thermal_model_t *model, uint8_t spring,
                                       int16_t temperature_c7)
{
    spring = clamp_index(model, spring);
    uint16_t lead = lead_from_c7(temperature_c7);
    const thermal_model_spring_t *own = &model->spring[spring];
    const uint16_t *block = &model->lead[own->frame];
    uint32_t flow = thermal_model_conducted(common_flow(model), block, own, lead);
    flow -= thermal_model_lost((int16_t)(lead - model->pass.air_lead), own);
    if (model->wake != 0) {
        flow += brought(model, own);
    }
    if (model->radiation_factor != 0) {
        flow -= radiation_of(lead, model->radiation_factor);
    }
    return -((int32_t)flow >> POWER_SHIFT);
}

void thermal_model_get_state(const thermal_model_t *model, thermal_model_state_t *state)
{
    *state = model->state;
}

static bool spring_is_consistent(const thermal_model_t *model,
                                 const thermal_model_spring_state_t *state)
{
    if (state->branch > THERMAL_MODEL_BRANCH_HEATING ||
        state->amplitude > THERMAL_MODEL_AUSTENITE_FULL || state->latent_c23 < -LATENT_SLACK_C23 ||
        state->latent_c23 > model->latent_full_c23 + LATENT_SLACK_C23) {
        return false;
    }
    int16_t temperature_c7 = high_word(state->temperature_c23);
    if (temperature_c7 > state->heating_c7 || temperature_c7 < state->cooling_c7) {
        return false;
    }
    if (state->branch == THERMAL_MODEL_BRANCH_HEATING) {
        return (state->heating_c7 == model->highest_c7 ||
                (state->heating_c7 >= model->austenite_start_c7 &&
                 state->heating_c7 < model->austenite_finish_c7)) &&
               state->cooling_c7 == model->martensite_start_c7;
    }
    return (state->cooling_c7 == THERMAL_MODEL_LOWEST_C7 ||
            (state->cooling_c7 <= model->martensite_start_c7 &&
             state->cooling_c7 > model->martensite_finish_c7)) &&
           state->heating_c7 == model->austenite_start_c7;
}

static bool state_is_consistent(const thermal_model_t *model, const thermal_model_state_t *state)
{
    if (clamp_c23(state->air_c23) != state->air_c23 ||
        clamp_c23(state->plate_c23) != state->plate_c23) {
        return false;
    }
    for (uint8_t i = 0; i < model->pass.count; i++) {
        if (!spring_is_consistent(model, &state->spring[i])) {
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
    model->pass.air_lead = lead_from_c7(high_word(state->air_c23));
    model->plate_lead = lead_from_c7(high_word(state->plate_c23));
    thermal_model_refresh_ambient(model);
    for (uint8_t i = 0; i < model->pass.count; i++) {
        model->spring[i].pending = 0;
        refresh_branch(model, &model->spring[i], &model->state.spring[i]);
        set_lead(model, i, lead_from_c7(high_word(state->spring[i].temperature_c23)));
    }
    return true;
}

bool thermal_model_is_consistent(const thermal_model_t *model)
{
    if (model->pass.count == 0 || model->pass.count > THERMAL_MODEL_MAX_SPRINGS ||
        model->pass.count != model->parameters.rows * model->parameters.columns) {
        return false;
    }
    uint32_t sum = 0;
    for (uint16_t k = 0; k < sizeof model->lead / sizeof model->lead[0]; k++) {
        if (model->lead[k] > LEAD_HIGHEST) {
            return false;
        }
        sum += model->lead[k];
    }
    for (uint8_t i = 0; i < model->pass.count; i++) {
        sum -= model->lead[model->spring[i].frame + BLOCK_CENTRE];
    }
    if (sum != 0) { /* the frame is zeros */
        return false;
    }
    return state_is_consistent(model, &model->state);
}
