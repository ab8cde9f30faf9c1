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
#define HIGHEST_CC          20000

#define RANGE(field, type, minimum, maximum)                                                       \
    PARAMETER_RANGE(thermal_model_parameters_t, field, type, minimum, maximum)
const thermal_model_ranges_t thermal_model_ranges FLASH_MEMORY = {
    RANGE(rows, U8, 1, THERMAL_MODEL_MAX_SPRINGS),
    RANGE(columns, U8, 1, THERMAL_MODEL_MAX_SPRINGS),
    RANGE(step_ms, U16, 1, 1000),
    RANGE(heat_capacity_mj_per_k, U16, 1, 65535),
    RANGE(loss_uw_per_k, U16, 0, 65535),
    RANGE(loss_fan_uw_per_k, U16, 0, 65535),
    RANGE(orthogonal_uw_per_k, U16, 0, 65535),
    RANGE(orthogonal_fan_uw_per_k, U16, 0, 65535),
    RANGE(diagonal_uw_per_k, U16, 0, 65535),
    RANGE(diagonal_fan_uw_per_k, U16, 0, 65535),
    RANGE(loss_rise_ppm_per_k, U16, 0, 20000),
    RANGE(radiating_area_cmm2, U16, 0, 65535),
    RANGE(latent_heat_mj, U16, 0, 65535),
    RANGE(martensite_finish_cc, S16, -3000, HIGHEST_CC),
    RANGE(martensite_start_cc, S16, -3000, HIGHEST_CC),
    RANGE(austenite_start_cc, S16, -3000, HIGHEST_CC),
    RANGE(austenite_finish_cc, S16, -3000, HIGHEST_CC),
    RANGE(resistance_martensite_uohm, U32, 1, 16000),
    RANGE(resistance_austenite_uohm, U32, 1, 16000),
    RANGE(air_heat_capacity_mj_per_k, U32, 0, 2000),
    RANGE(air_exchange_uw_per_k, U32, 0, 16000), /* 16 bits of 256 uW/K */
    RANGE(plate_coupling_uw_per_k, U16, 0, 65535),
    RANGE(plate_heat_capacity_mj_per_k, U32, 0, 2000),
    RANGE(plate_loss_uw_per_k, U16, 0, 65535),
    RANGE(wake_uw_per_k, U16, 0, 65535),
    RANGE(wake_direction, U8, 0, THERMAL_MODEL_WAKE_NORTH),
    RANGE(loss_scale_permille, U16, 1, 8000),
    RANGE(heat_capacity_scale_permille, U16, 1, 8000)};

void thermal_model_parameters_default(thermal_model_parameters_t *parameters)
{
    static const thermal_model_parameters_t usual FLASH_MEMORY = {
        .rows = 3,
        .columns = 3,
        .step_ms = 100,
        .heat_capacity_mj_per_k = 300,
        .loss_uw_per_k = 5800,
        .loss_fan_uw_per_k = 11300,
        .orthogonal_uw_per_k = 586,
        .orthogonal_fan_uw_per_k = 658,
        .diagonal_uw_per_k = 293,
        .diagonal_fan_uw_per_k = 329,
        .latent_heat_mj = 8650,
        .martensite_finish_cc = 6800,
        .martensite_start_cc = 7800,
        .austenite_start_cc = 8800,
        .austenite_finish_cc = 9800,
        .resistance_martensite_uohm = 175000,
        .resistance_austenite_uohm = 219000,
        .air_heat_capacity_mj_per_k = 50,
        .plate_heat_capacity_mj_per_k = 20000,
        .plate_loss_uw_per_k = 20000};
    flash_copy(parameters, &usual, sizeof usual);
    for (uint8_t i = 0; i < THERMAL_MODEL_MAX_SPRINGS; i++) {
        parameters->loss_scale_permille[i] = 1000;
        parameters->heat_capacity_scale_permille[i] = 1000;
    }
}

const char *thermal_model_parameter_name(thermal_model_parameter_t parameter)
{
    static const char *const names[THERMAL_MODEL_PARAMETER_COUNT] = {
        "rows",
        "columns",
        "step_ms",
        "heat_capacity_mj_per_k",
        "loss_uw_per_k",
        "loss_fan_uw_per_k",
        "orthogonal_uw_per_k",
        "orthogonal_fan_uw_per_k",
        "diagonal_uw_per_k",
        "diagonal_fan_uw_per_k",
        "loss_rise_ppm_per_k",
        "radiating_area_cmm2",
        "latent_heat_mj",
        "martensite_finish_cc",
        "martensite_start_cc",
        "austenite_start_cc",
        "austenite_finish_cc",
        "resistance_martensite_uohm",
        "resistance_austenite_uohm",
        "air_heat_capacity_mj_per_k",
        "air_exchange_uw_per_k",
        "plate_coupling_uw_per_k",
        "plate_heat_capacity_mj_per_k",
        "plate_loss_uw_per_k",
        "wake_uw_per_k",
        "wake_direction",
        "loss_scale_permille",
        "heat_capacity_scale_permille",
    };
    if ((unsigned)parameter >= (unsigned)THERMAL_MODEL_PARAMETER_COUNT) {
        return "";
    }
    return names[parameter];
}

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

/* A refusal: the status and the parameter, in one value; 0 is none. */
typedef uint16_t refusal_t;
#define REFUSE(status, parameter)                                                                  \
    return (refusal_t)((uint16_t)(THERMAL_MODEL_##parameter) << 8 | -THERMAL_MODEL_ERROR_##status)

static refusal_t check_array(const thermal_model_parameters_t *p)
{
    const uint8_t outside =
        parameter_first_outside(p, &thermal_model_ranges, THERMAL_MODEL_LOSS_SCALE);
    if (outside < THERMAL_MODEL_LOSS_SCALE) {
        return (refusal_t)((uint16_t)outside << 8 | -THERMAL_MODEL_ERROR_RANGE);
    }
    if ((uint16_t)p->rows * p->columns > THERMAL_MODEL_MAX_SPRINGS) {
        REFUSE(RANGE, COLUMNS);
    }
    const parameter_range_t scale = parameter_range(&thermal_model_ranges.loss_scale_permille);
    for (uint8_t i = 0; i < (uint8_t)(p->rows * p->columns); i++) {
        if (!parameter_is_within(&scale, p->loss_scale_permille[i])) {
            REFUSE(RANGE, LOSS_SCALE);
        }
        if (!parameter_is_within(&scale, p->heat_capacity_scale_permille[i])) {
            REFUSE(RANGE, HEAT_CAPACITY_SCALE);
        }
        const uint32_t capacity = spring_capacity(p, i);
        if (capacity < 1000u || capacity < (uint32_t)p->step_ms * CAPACITY_UJ_PER_MS) {
            REFUSE(RANGE, HEAT_CAPACITY);
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
        REFUSE(ORDER, MARTENSITE_START);
    }
    if (!is_width(finish_m, start_m)) {
        REFUSE(RANGE, MARTENSITE_START);
    }
    if (start_a < start_m) {
        REFUSE(ORDER, AUSTENITE_START);
    }
    if (finish_a <= start_a) {
        REFUSE(ORDER, AUSTENITE_FINISH);
    }
    if (!is_width(start_a, finish_a)) {
        REFUSE(RANGE, AUSTENITE_FINISH);
    }
    const uint32_t latent_cc = p->latent_heat_mj * (uint32_t)100 / p->heat_capacity_mj_per_k;
    if (latent_cc > LATENT_MAX_K * 100u) {
        REFUSE(RANGE, LATENT_HEAT);
    }
    const int16_t least_width_cc = (int16_t)(((int16_t)latent_cc + 19) / 20);
    if (least_width_cc > start_m - finish_m || least_width_cc > finish_a - start_a ||
        (int16_t)latent_cc > HIGHEST_CC - finish_a) {
        REFUSE(RANGE, LATENT_HEAT);
    }
    return 0;
}

static refusal_t check_spring(const thermal_model_parameters_t *p, uint8_t i)
{
    const uint32_t natural = scaled_loss(p->loss_uw_per_k, p->loss_scale_permille[i]);
    const uint32_t forced = scaled_loss(p->loss_fan_uw_per_k, p->loss_scale_permille[i]);
    if (natural >= CONDUCTANCE_MAX && natural >= forced) {
        REFUSE(OVERFLOW, LOSS);
    }
    if (forced >= CONDUCTANCE_MAX) {
        REFUSE(OVERFLOW, LOSS_FAN);
    }
    if (p->wake_uw_per_k > (uint16_t)forced) {
        REFUSE(RANGE, WAKE);
    }
    const uint32_t rise_e6 = natural * p->loss_rise_ppm_per_k;
    const uint32_t risen = natural + rise_e6 / (1000000u / SPAN_K) + 1u;
    if (rise_e6 > LOSS_RISE_MAX_E6 || risen > CONDUCTANCE_MAX) {
        REFUSE(OVERFLOW, LOSS_RISE);
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
            REFUSE(OVERFLOW, LOSS_FAN);
        }
        REFUSE(OVERFLOW, LOSS);
    }
    if (conduction > CONDUCTANCE_MAX || total > CONDUCTANCE_SUM_MAX) {
        if (p->plate_coupling_uw_per_k > orthogonal + diagonal) {
            REFUSE(OVERFLOW, PLATE_COUPLING);
        }
        if (diagonal > orthogonal) {
            if (p->diagonal_fan_uw_per_k > p->diagonal_uw_per_k) {
                REFUSE(OVERFLOW, DIAGONAL_FAN);
            }
            REFUSE(OVERFLOW, DIAGONAL);
        }
        if (p->orthogonal_fan_uw_per_k > p->orthogonal_uw_per_k) {
            REFUSE(OVERFLOW, ORTHOGONAL_FAN);
        }
        REFUSE(OVERFLOW, ORTHOGONAL);
    }
    if ((total * p->step_ms + 499u) / 500u > spring_capacity(p, i)) { /* step G <= C / 2 */
        REFUSE(UNSTABLE, STEP);
    }
    return 0;
}

static refusal_t check_plate(const thermal_model_parameters_t *p)
{
    if (p->plate_coupling_uw_per_k == 0) {
        return 0;
    }
    if (p->plate_heat_capacity_mj_per_k == 0) {
        REFUSE(RANGE, PLATE_HEAT_CAPACITY);
    }
    const uint32_t total = plate_conductance(p);
    if ((total * p->step_ms + 499999u) / 500000u > p->plate_heat_capacity_mj_per_k) {
        REFUSE(UNSTABLE, PLATE_HEAT_CAPACITY);
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
    /* 1024 / 1e6 */
    spring->loss_rise_natural =
        (uint16_t)(((uint32_t)spring->loss_natural_uw_per_k * p->loss_rise_ppm_per_k * 16u +
                    7812u) /
                   15625u);
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
                                          thermal_model_parameter_t *bad)
{
    const refusal_t refusal = check(parameters);
    if (refusal != 0) {
        if (bad != NULL) {
            *bad = (thermal_model_parameter_t)(refusal >> 8);
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
