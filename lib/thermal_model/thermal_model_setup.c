#include "thermal_model_internal.h"

#include <stddef.h>
#include <string.h>

#include "fixed_point.h"

#define CONDUCTANCE_MAX     65535u
#define CONDUCTANCE_SUM_MAX 98000u    /* (2^31 / 64 uW - highest power) / 256 K */
#define LOSS_RISE_MAX_E6    63999511u /* 1e-6 uW/K per K: loss_rise is 16 bits of uW/K per 1024 K */
#define FEW_SPRINGS         16
#define GAIN_MAX            0xffffffu
#define STEP_GAIN_UJ_PER_MS 2199023256u /* 2^41 / 1e3: thermal_model_spring_t.step_gain */
#define CAPACITY_UJ_PER_MS  132u        /* least: STEP_GAIN_UJ_PER_MS over this is below GAIN_MAX */
#define WIDTH_MIN_CC        200
#define WIDTH_MAX_CC        10000
#define HIGHEST_CC          20000

static __attribute__((noinline)) uint32_t larger(uint32_t a, uint32_t b)
{
    return a > b ? a : b;
}

typedef struct {
    uint8_t row;
    uint8_t column;
    uint8_t orthogonals; /* neighbours */
    uint8_t diagonals;
} place_t;

static place_t place_of(const thermal_model_parameters_t *p, uint8_t spring)
{
    place_t place = {.row = (uint8_t)(spring / p->columns),
                     .column = (uint8_t)(spring % p->columns)};
    const uint8_t vertical = (uint8_t)((place.row > 0) + (place.row + 1 < p->rows));
    const uint8_t horizontal = (uint8_t)((place.column > 0) + (place.column + 1 < p->columns));
    place.diagonals = (uint8_t)(vertical * horizontal);
    place.orthogonals = (uint8_t)(vertical + horizontal);
    return place;
}

/* Radiation's slope at the highest temperature (488 K), uW/K: 4 sigma T^3 = 26.4 W/m2K. */
static uint32_t radiation_slope(const thermal_model_parameters_t *p)
{
    return ((uint32_t)p->radiating_area_cmm2 * 27u + 99u) / 100u;
}

/* Of the plate, to all springs and to ambient: below 2^32 / 1000 uW/K. */
static uint32_t plate_conductance(const thermal_model_parameters_t *p)
{
    return (uint32_t)p->plate_coupling_uw_per_k * (uint8_t)(p->rows * p->columns) +
           p->plate_loss_uw_per_k;
}

static __attribute__((noinline)) uint32_t spring_capacity(const thermal_model_parameters_t *p,
                                                          uint8_t i)
{
    return (uint32_t)p->heat_capacity_mj_per_k * p->heat_capacity_scale_permille[i];
}

/* Of one spring. */
static __attribute__((noinline)) uint32_t scaled_loss(uint16_t loss_uw_per_k, uint16_t permille)
{
    return ((uint32_t)loss_uw_per_k * permille + 500u) / 1000u;
}

/* A refusal: the status and the row, in one value; 0 is none. */
typedef uint16_t refusal_t;
#define REFUSED(status, row)                                                                       \
    (refusal_t)((uint16_t)(row) << 8 | (uint8_t)-THERMAL_MODEL_ERROR_##status)
#define REFUSE(status, name) return REFUSED(status, PARAMETER_##name)

static refusal_t check_array(const thermal_model_parameters_t *p)
{
    uint16_t outside;
    if (!parameter_check(PARAMETER_PART_MODEL, p, &outside)) {
        return REFUSED(RANGE, outside);
    }
    if (p->step_ms < 1u || p->step_ms > 1000u) {
        return REFUSED(RANGE, PARAMETER_COUNT);
    }
    if ((uint16_t)p->rows * p->columns > THERMAL_MODEL_MAX_SPRINGS) {
        REFUSE(RANGE, columns);
    }
    for (uint8_t i = 0; i < (uint8_t)(p->rows * p->columns); i++) {
        const uint32_t capacity = spring_capacity(p, i);
        if (capacity < 1000u || capacity < (uint32_t)p->step_ms * CAPACITY_UJ_PER_MS) {
            REFUSE(RANGE, heat_capacity_j_per_k);
        }
    }
    return 0;
}

static bool is_width(int16_t from_cc, int16_t to_cc)
{
    const int16_t width_cc = (int16_t)(to_cc - from_cc);
    return width_cc >= WIDTH_MIN_CC && width_cc <= WIDTH_MAX_CC;
}

static refusal_t check_phase(const thermal_model_parameters_t *p)
{
    const int16_t finish_m = p->martensite_finish_cc;
    const int16_t start_m = p->martensite_start_cc;
    const int16_t start_a = p->austenite_start_cc;
    const int16_t finish_a = p->austenite_finish_cc;
    if (start_m <= finish_m) {
        REFUSE(ORDER, martensite_start_c);
    }
    if (!is_width(finish_m, start_m)) {
        REFUSE(RANGE, martensite_start_c);
    }
    if (start_a < start_m) {
        REFUSE(ORDER, austenite_start_c);
    }
    if (finish_a <= start_a) {
        REFUSE(ORDER, austenite_finish_c);
    }
    if (!is_width(start_a, finish_a)) {
        REFUSE(RANGE, austenite_finish_c);
    }
    const uint32_t latent_cc = p->latent_heat_mj * (uint32_t)100 / p->heat_capacity_mj_per_k;
    if (latent_cc > LATENT_MAX_K * 100u) {
        REFUSE(RANGE, latent_heat_j);
    }
    const int16_t least_width_cc = (int16_t)(((int16_t)latent_cc + 19) / 20);
    if (least_width_cc > start_m - finish_m || least_width_cc > finish_a - start_a ||
        (int16_t)latent_cc > HIGHEST_CC - finish_a) {
        REFUSE(RANGE, latent_heat_j);
    }
    return 0;
}

static refusal_t check_spring(const thermal_model_parameters_t *p, uint8_t i)
{
    const uint32_t natural = scaled_loss(p->loss_uw_per_k, p->loss_scale_permille[i]);
    const uint32_t forced = scaled_loss(p->loss_fan_uw_per_k, p->loss_scale_permille[i]);
    if (natural >= CONDUCTANCE_MAX && natural >= forced) {
        REFUSE(OVERFLOW, loss_w_per_k);
    }
    if (forced >= CONDUCTANCE_MAX) {
        REFUSE(OVERFLOW, loss_fan_w_per_k);
    }
    if (p->wake_uw_per_k > (uint16_t)forced) {
        REFUSE(RANGE, wake_w_per_k);
    }
    const uint32_t rise_e6 = natural * p->loss_rise_ppm_per_k;
    const uint32_t risen = natural + rise_e6 / (1000000u / LEAD_SPAN_K) + 1u;
    if (rise_e6 > LOSS_RISE_MAX_E6 || risen > CONDUCTANCE_MAX) {
        REFUSE(OVERFLOW, loss_rise_per_k);
    }
    const place_t place = place_of(p, i);
    const uint32_t orthogonal =
        place.orthogonals * larger(p->orthogonal_uw_per_k, p->orthogonal_fan_uw_per_k);
    const uint32_t diagonal =
        place.diagonals * larger(p->diagonal_uw_per_k, p->diagonal_fan_uw_per_k);
    const uint32_t conduction = orthogonal + diagonal + p->plate_coupling_uw_per_k;
    const uint32_t loss = larger(risen, forced + 1u);
    const uint32_t total = loss + conduction + p->wake_uw_per_k + radiation_slope(p);
    if (conduction <= CONDUCTANCE_MAX && total > CONDUCTANCE_SUM_MAX && loss > conduction) {
        if (forced > natural) {
            REFUSE(OVERFLOW, loss_fan_w_per_k);
        }
        REFUSE(OVERFLOW, loss_w_per_k);
    }
    if (conduction > CONDUCTANCE_MAX || total > CONDUCTANCE_SUM_MAX) {
        if (p->plate_coupling_uw_per_k > orthogonal + diagonal) {
            REFUSE(OVERFLOW, plate_coupling_w_per_k);
        }
        if (diagonal > orthogonal) {
            if (p->diagonal_fan_uw_per_k > p->diagonal_uw_per_k) {
                REFUSE(OVERFLOW, diagonal_fan_w_per_k);
            }
            REFUSE(OVERFLOW, diagonal_w_per_k);
        }
        if (p->orthogonal_fan_uw_per_k > p->orthogonal_uw_per_k) {
            REFUSE(OVERFLOW, orthogonal_fan_w_per_k);
        }
        REFUSE(OVERFLOW, orthogonal_w_per_k);
    }
    if ((total * p->step_ms + 499u) / 500u > spring_capacity(p, i)) { /* step G <= C / 2 */
        REFUSE(UNSTABLE, heat_capacity_j_per_k);
    }
    return 0;
}

static refusal_t check_plate(const thermal_model_parameters_t *p)
{
    if (p->plate_coupling_uw_per_k == 0) {
        return 0;
    }
    if (p->plate_heat_capacity_mj_per_k == 0) {
        REFUSE(RANGE, plate_heat_capacity_j_per_k);
    }
    const uint32_t total = plate_conductance(p);
    if ((total * p->step_ms + 499999u) / 500000u > p->plate_heat_capacity_mj_per_k) {
        REFUSE(UNSTABLE, plate_heat_capacity_j_per_k);
    }
    return 0;
}

static refusal_t check(const thermal_model_parameters_t *p)
{
    refusal_t refusal = check_array(p);
    if (refusal == 0) {
        refusal = check_phase(p);
    }
    for (uint8_t i = 0; refusal == 0 && i < (uint8_t)(p->rows * p->columns); i++) {
        refusal = check_spring(p, i);
    }
    return refusal != 0 ? refusal : check_plate(p);
}

/* The node leads (see thermal_model.c) where a step is short against its own time; else its own
 * flow is taken implicitly, so that any step is stable. */
static void slow_node(thermal_model_slow_node_t *node, uint32_t capacity_mj_per_k,
                      uint32_t conductance_uw_per_k, uint32_t loss_uw_per_k, uint16_t step_ms,
                      uint8_t count)
{
    const bool coarse = loss_uw_per_k > UINT16_MAX;
    const bool many = count > FEW_SPRINGS;
    node->units = (uint8_t)((coarse ? SLOW_NODE_COARSE : 0) | (many ? SLOW_NODE_MANY : 0));
    node->loss = (uint16_t)(coarse ? (loss_uw_per_k + 128u) / 256u : loss_uw_per_k);
    uint32_t exchanged =
        fixed_point_multiply_divide(conductance_uw_per_k, step_ms, 1000u); /* uJ/K */
    uint32_t capacity = capacity_mj_per_k * 1000u;                         /* uJ/K */
    node->leads = exchanged <= capacity / 4u;
    if (!node->leads) {
        capacity += exchanged;
    }
    if (capacity == 0) {
        capacity = 1; /* a node without flows: nothing moves it */
    }
    /* 24 bits of 4 uW hold 33 W: for a few springs; of 64 uW for many */
    uint32_t steps = (uint32_t)step_ms << (many ? 4 : 0);
    /* 4e-6 2^23 2^16 step[ms] 1e-3 / (capacity[uJ/K] 1e-6) */
    node->gain = fixed_point_multiply_divide(STEP_GAIN_UJ_PER_MS, steps, capacity);
    node->wide = node->gain > GAIN_MAX;
    if (node->wide) {
        node->gain = fixed_point_multiply_divide(8589935u, steps, capacity);
        if (node->gain > GAIN_MAX) {
            node->gain = GAIN_MAX;
        }
    }
}

static uint16_t position_factor(uint32_t width_c7)
{
    return (uint16_t)((0x200000u + width_c7 / 2u) / width_c7);
}

static __attribute__((noinline)) uint16_t slope_factor(uint32_t width_c7)
{
    uint32_t factor = (0x1000000u + width_c7 / 2u) / width_c7; /* 2^17 / width in K */
    return (uint16_t)(factor > 65535u ? 65535u : factor);
}

static void derive_springs(thermal_model_t *model)
{
    const thermal_model_parameters_t *p = &model->parameters;
    const bool tall = p->rows >= p->columns;
    const uint8_t along_row = tall ? 1 : THERMAL_MODEL_FRAME_STRIDE;
    const uint8_t along_column = tall ? THERMAL_MODEL_FRAME_STRIDE : 1;
    const bool by_row = (p->wake_direction & 1u) != 0; /* south, north */
    const bool rises = p->wake_direction < THERMAL_MODEL_WAKE_WEST;
    const int8_t upstream = (int8_t)(by_row ? along_column : along_row);
    model->wake_offset = rises ? (int8_t)-upstream : upstream;
    for (uint8_t i = 0; i < model->pass.count; i++) {
        thermal_model_spring_t *spring = &model->spring[i];
        const uint16_t scale = p->loss_scale_permille[i];
        const place_t place = place_of(p, i);
        spring->step_gain =
            fixed_point_multiply_divide(STEP_GAIN_UJ_PER_MS, p->step_ms, spring_capacity(p, i));
        spring->loss_natural = (uint16_t)scaled_loss(p->loss_uw_per_k, scale);
        spring->loss_fan = (uint16_t)scaled_loss(p->loss_fan_uw_per_k, scale);
        /* 1024 / 1e6 */
        spring->loss_rise_natural =
            (uint16_t)(((uint32_t)spring->loss_natural * p->loss_rise_ppm_per_k * 16u + 7812u) /
                       15625u);
        spring->orthogonals = place.orthogonals & 7u;
        spring->diagonals = place.diagonals & 7u;
        const uint8_t at = by_row ? place.row : place.column;
        const uint8_t last = (uint8_t)((by_row ? p->rows : p->columns) - 1u);
        spring->upstream = at != (rises ? 0 : last);
        spring->frame =
            (thermal_model_place_t)(place.row * along_column + place.column * along_row);
        spring->block_offset =
            (int16_t)((const char *)&model->lead[spring->frame] - (const char *)spring);
    }
}

static void derive(thermal_model_t *model)
{
    const thermal_model_parameters_t *p = &model->parameters;
    model->pass.count = (uint8_t)(p->rows * p->columns);
    derive_springs(model);
    model->latent_full_c23 = (int32_t)fixed_point_multiply_divide((uint32_t)p->latent_heat_mj << 10,
                                                                  8192u, p->heat_capacity_mj_per_k);
    int16_t highest_c7 = (int16_t)(255 * 128 - (int16_t)(model->latent_full_c23 >> 16));
    model->highest_c7 =
        highest_c7 < THERMAL_MODEL_HIGHEST_C7 ? highest_c7 : (int16_t)THERMAL_MODEL_HIGHEST_C7;
    model->martensite_finish_c7 = fixed_point_c7_from_cc(p->martensite_finish_cc);
    model->martensite_start_c7 = fixed_point_c7_from_cc(p->martensite_start_cc);
    model->austenite_start_c7 = fixed_point_c7_from_cc(p->austenite_start_cc);
    model->austenite_finish_c7 = fixed_point_c7_from_cc(p->austenite_finish_cc);
    uint32_t heating = (uint32_t)(model->austenite_finish_c7 - model->austenite_start_c7);
    uint32_t cooling = (uint32_t)(model->martensite_start_c7 - model->martensite_finish_c7);
    model->heating_position = position_factor(heating);
    model->cooling_position = position_factor(cooling);
    model->heating_slope = slope_factor(heating);
    model->cooling_slope = slope_factor(cooling);
    model->pass.flags = p->loss_rise_ppm_per_k != 0 ? PASS_RISES : 0;
    /* 1e-8 m2 sigma 512^4 K^4 64e6 / 2^16 = 0.0380535 a unit of area, to 1e-6 */
    model->radiation_factor =
        (uint16_t)((p->radiating_area_cmm2 * (uint32_t)39902 + 0x80000u) >> 20);

    uint32_t loss_sum = 0;
    for (uint8_t i = 0; i < model->pass.count; i++) {
        const thermal_model_spring_t *spring = &model->spring[i];
        loss_sum += larger(spring->loss_natural, spring->loss_fan);
    }
    slow_node(&model->air, p->air_heat_capacity_mj_per_k, loss_sum + p->air_exchange_uw_per_k,
              p->air_exchange_uw_per_k, p->step_ms, model->pass.count);
    slow_node(&model->plate, p->plate_heat_capacity_mj_per_k, plate_conductance(p),
              p->plate_loss_uw_per_k, p->step_ms, model->pass.count);
}

/* natural + (forced - natural) fan, fan in Q2.14 */
static __attribute__((noinline)) uint16_t between(uint16_t natural, uint16_t forced, uint16_t fan)
{
    int32_t difference = ((int32_t)forced - (int32_t)natural) * (int32_t)fan;
    return (uint16_t)(natural + ((difference + 8192) >> 14));
}

void thermal_model_apply_fan(thermal_model_t *model)
{
    const thermal_model_parameters_t *p = &model->parameters;
    uint16_t fan = (uint16_t)(((uint32_t)model->fan_percent * 41943u + 128u) >> 8); /* Q2.14 */
    uint16_t orthogonal = between(p->orthogonal_uw_per_k, p->orthogonal_fan_uw_per_k, fan);
    uint16_t diagonal = between(p->diagonal_uw_per_k, p->diagonal_fan_uw_per_k, fan);
    model->wake = between(0, p->wake_uw_per_k, fan);
    model->pass.flags = (uint8_t)(model->pass.flags & ~PASS_EXTRA);
    if (model->wake != 0 || model->radiation_factor != 0) {
        model->pass.flags |= PASS_EXTRA;
    }
    for (uint8_t i = 0; i < model->pass.count; i++) {
        thermal_model_spring_t *spring = &model->spring[i];
        spring->loss = between(spring->loss_natural, spring->loss_fan, fan);
        /* natural convection rises with temperature, the fan's does not */
        spring->loss_rise = between(spring->loss_rise_natural, 0, fan);
        spring->orthogonal = orthogonal;
        spring->diagonal = diagonal;
        spring->conduction = (uint16_t)(spring->orthogonals * orthogonal +
                                        spring->diagonals * diagonal + p->plate_coupling_uw_per_k);
    }
}

thermal_model_status_t thermal_model_init(thermal_model_t *model,
                                          const thermal_model_parameters_t *parameters,
                                          uint16_t *bad)
{
    const refusal_t refusal = check(parameters);
    if (refusal != 0) {
        if (bad != NULL) {
            *bad = refusal >> 8;
        }
        return (thermal_model_status_t)(-(int)(refusal & 0xFFu));
    }
    memmove(&model->parameters, parameters, sizeof *parameters); /* may be the model's own */
    memset(model, 0, offsetof(thermal_model_t, parameters));
    derive(model);
    thermal_model_apply_fan(model);
    model->ambient_c7 = 20 * 128;
    thermal_model_reset(model, 20 * 128);
    return THERMAL_MODEL_OK;
}
