#include "thermal_model_internal.h"

#include <stddef.h>
#include <string.h>

#include "fixed_point.h"

#define CONDUCTANCE_MAX     65535u
#define CONDUCTANCE_SUM_MAX 98000u    /* (2^31 / 64 uW - highest power) / 256 K */
#define LOSS_RISE_MAX_E6    63999511u /* 1e-6 uW/K per K: loss_rise is 16 bits of uW/K per 1024 K */
#define STEP_GAIN_UJ_PER_MS 281474976711u /* 2^48 / 1e3: thermal_model_spring_t.step_gain */
#define NODE_GAIN_UJ_PER_MS 35184372089u  /* 2^45 / 1e3: thermal_model_slow_node_t.gain */
#define CAPACITY_UJ_PER_MS  132u          /* least: STEP_GAIN_UJ_PER_MS over this fits 31 bits */
#define WIDTH_MIN_CC        200
#define WIDTH_MAX_CC        10000
#define LOWEST_CC           (-3000)
#define HIGHEST_CC          20000

static uint32_t larger(uint32_t a, uint32_t b)
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

static uint32_t spring_capacity(const thermal_model_parameters_t *p, uint8_t i)
{
    return (uint32_t)p->heat_capacity_mj_per_k * p->heat_capacity_scale_permille[i];
}

/* Of one spring. */
static uint32_t scaled_loss(uint16_t loss_uw_per_k, uint16_t permille)
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
    for (uint8_t i = 0; i < (uint8_t)(p->rows * p->columns); i++) {
        const int16_t shift_cc = p->transformation_shift_cc[i];
        if (finish_m + shift_cc < LOWEST_CC ||
            finish_a + shift_cc > HIGHEST_CC - (int16_t)latent_cc) {
            REFUSE(RANGE, transformation_shift_k);
        }
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
    const uint32_t risen = natural + rise_e6 / (1000000u / SPAN_K) + 1u;
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

/* Where a step is long against the node's own time, its own flow is taken implicitly, so that any
 * step is stable. */
static void derive_node(thermal_model_slow_node_t *node, uint32_t capacity_mj_per_k,
                        uint32_t conductance_uw_per_k, uint32_t loss_uw_per_k, uint16_t step_ms)
{
    const uint32_t exchanged_uj_per_k =
        fixed_point_multiply_divide(conductance_uw_per_k, step_ms, 1000u);
    uint32_t capacity_uj_per_k = capacity_mj_per_k * 1000u;
    node->loss_uw_per_k = loss_uw_per_k;
    node->quick = exchanged_uj_per_k > capacity_uj_per_k / 4u;
    if (node->quick) {
        capacity_uj_per_k += exchanged_uj_per_k;
    }
    if (capacity_uj_per_k == 0) {
        capacity_uj_per_k = 1; /* a node without flows: nothing moves it */
    }
    node->gain =
        (int64_t)((NODE_GAIN_UJ_PER_MS * step_ms + capacity_uj_per_k / 2u) / capacity_uj_per_k);
}

static uint16_t position_factor(int16_t width_c7)
{
    return (uint16_t)((0x200000u + (uint16_t)width_c7 / 2u) / (uint16_t)width_c7);
}

/* The spring from which the fan blows at that place; NO_SPRING at the edge where its air comes in.
 */
static uint8_t upstream_of(const thermal_model_parameters_t *p, uint8_t row, uint8_t column)
{
    const uint8_t i = (uint8_t)(row * p->columns + column);
    switch ((thermal_model_wake_t)p->wake_direction) {
    case THERMAL_MODEL_WAKE_EAST:
        return column > 0 ? (uint8_t)(i - 1u) : NO_SPRING;
    case THERMAL_MODEL_WAKE_SOUTH:
        return row > 0 ? (uint8_t)(i - p->columns) : NO_SPRING;
    case THERMAL_MODEL_WAKE_WEST:
        return column + 1u < p->columns ? (uint8_t)(i + 1u) : NO_SPRING;
    case THERMAL_MODEL_WAKE_NORTH:
        return row + 1u < p->rows ? (uint8_t)(i + p->columns) : NO_SPRING;
    }
    return NO_SPRING;
}

static void derive_spring(thermal_model_t *model, uint8_t i)
{
    const thermal_model_parameters_t *p = &model->parameters;
    thermal_model_spring_t *spring = &model->spring[i];
    const uint16_t scale = p->loss_scale_permille[i];
    const uint32_t capacity_uj_per_k = spring_capacity(p, i);
    spring->row = (uint8_t)(i / p->columns);
    spring->column = (uint8_t)(i % p->columns);
    spring->upstream = upstream_of(p, spring->row, spring->column);
    spring->step_gain =
        (int32_t)((STEP_GAIN_UJ_PER_MS * p->step_ms + capacity_uj_per_k / 2u) / capacity_uj_per_k);
    spring->loss_natural_uw_per_k = (uint16_t)scaled_loss(p->loss_uw_per_k, scale);
    spring->loss_fan_uw_per_k = (uint16_t)scaled_loss(p->loss_fan_uw_per_k, scale);
    spring->transformation_shift_c7 = fixed_point_c7_from_cc(p->transformation_shift_cc[i]);
    const uint32_t contact_q16 = fixed_point_multiply_divide(p->contact_uohm[i], 65536u, 1000000u);
    spring->contact_q16 = contact_q16 > UINT16_MAX ? UINT16_MAX : (uint16_t)contact_q16;
    /* 1024 / 1e6 */
    spring->loss_rise_natural =
        (uint16_t)(((uint32_t)spring->loss_natural_uw_per_k * p->loss_rise_ppm_per_k * 16u +
                    7812u) /
                   15625u);
}

static int32_t resistance_rise(uint32_t resistance_uohm, int16_t ppm_per_k)
{
    return (int32_t)((int64_t)resistance_uohm * ppm_per_k * 512 / 1000000); /* 2^16 / 128 / 1e6 */
}

static void derive(thermal_model_t *model)
{
    const thermal_model_parameters_t *p = &model->parameters;
    model->springs = (uint8_t)(p->rows * p->columns);
    model->latent_full_c8 =
        (uint16_t)fixed_point_multiply_divide(p->latent_heat_mj, 256u, p->heat_capacity_mj_per_k);
    const int16_t highest_c7 = (int16_t)(SPAN_K * 128 - model->latent_full_c8 / 2u);
    model->highest_c7 =
        highest_c7 < THERMAL_MODEL_HIGHEST_C7 ? highest_c7 : (int16_t)THERMAL_MODEL_HIGHEST_C7;
    thermal_model_transformation_t *points = &model->transformation;
    points->martensite_finish_c7 = fixed_point_c7_from_cc(p->martensite_finish_cc);
    points->martensite_start_c7 = fixed_point_c7_from_cc(p->martensite_start_cc);
    points->austenite_start_c7 = fixed_point_c7_from_cc(p->austenite_start_cc);
    points->austenite_finish_c7 = fixed_point_c7_from_cc(p->austenite_finish_cc);
    model->martensite_rise =
        resistance_rise(p->resistance_martensite_uohm, p->resistance_martensite_rise_ppm_per_k);
    model->austenite_rise =
        resistance_rise(p->resistance_austenite_uohm, p->resistance_austenite_rise_ppm_per_k);
    model->heating_position =
        position_factor((int16_t)(points->austenite_finish_c7 - points->austenite_start_c7));
    model->cooling_position =
        position_factor((int16_t)(points->martensite_start_c7 - points->martensite_finish_c7));
    /* 1e-8 m2 sigma 512^4 K^4 64e6 / 2^16 = 0.0380535 a unit of area, to 1e-6 */
    model->radiation_factor =
        (uint16_t)((p->radiating_area_cmm2 * (uint32_t)39902 + 0x80000u) >> 20);

    uint32_t loss_sum_uw_per_k = p->air_exchange_uw_per_k;
    for (uint8_t i = 0; i < model->springs; i++) {
        const thermal_model_spring_t *spring = &model->spring[i];
        derive_spring(model, i);
        loss_sum_uw_per_k += larger(spring->loss_natural_uw_per_k, spring->loss_fan_uw_per_k);
    }
    derive_node(&model->air, p->air_heat_capacity_mj_per_k, loss_sum_uw_per_k,
                p->air_exchange_uw_per_k, p->step_ms);
    derive_node(&model->plate, p->plate_heat_capacity_mj_per_k, plate_conductance(p),
                p->plate_loss_uw_per_k, p->step_ms);
}

/* natural + (forced - natural) fan, fan in Q2.14 */
static uint16_t between(uint16_t natural, uint16_t forced, uint16_t fan)
{
    int32_t difference = ((int32_t)forced - (int32_t)natural) * (int32_t)fan;
    return (uint16_t)(natural + ((difference + 8192) >> 14));
}

void thermal_model_apply_fan(thermal_model_t *model)
{
    const thermal_model_parameters_t *p = &model->parameters;
    const uint16_t fan =
        (uint16_t)(((uint32_t)model->fan_percent * 41943u + 128u) >> 8); /* Q2.14 */
    model->orthogonal_uw_per_k = between(p->orthogonal_uw_per_k, p->orthogonal_fan_uw_per_k, fan);
    model->diagonal_uw_per_k = between(p->diagonal_uw_per_k, p->diagonal_fan_uw_per_k, fan);
    model->wake_uw_per_k = between(0, p->wake_uw_per_k, fan);
    for (uint8_t i = 0; i < model->springs; i++) {
        thermal_model_spring_t *spring = &model->spring[i];
        spring->loss_uw_per_k =
            between(spring->loss_natural_uw_per_k, spring->loss_fan_uw_per_k, fan);
        /* natural convection rises with temperature, the fan's does not */
        spring->loss_rise = between(spring->loss_rise_natural, 0, fan);
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
    const thermal_model_parameters_t taken = *parameters; /* may be the model's own */
    memset(model, 0, sizeof *model);
    model->parameters = taken;
    derive(model);
    thermal_model_apply_fan(model);
    model->ambient_c7 = 20 * 128;
    thermal_model_reset(model, 20 * 128);
    return THERMAL_MODEL_OK;
}
