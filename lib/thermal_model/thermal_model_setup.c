#include "thermal_model_internal.h"

#include <stddef.h>
#include <string.h>

#include "fixed_point.h"

#define STEP_MAX_MS         1000u
#define SCALE_MAX_PERMILLE  8000u
#define LOSS_RISE_MAX_PPM   20000u
#define RESISTANCE_MAX_UOHM 16000000u
#define AIR_EXCHANGE_MAX    16000000u /* uW/K: 16 bits of 256 uW/K */
#define CONDUCTANCE_MAX     65535u
#define CONDUCTANCE_SUM_MAX                                                                        \
    98000u /* (2^31 / 64 uW - highest power) / 256 K                                               \
            */
#define CAPACITY_MAX_MJ 2000000u
#define FEW_SPRINGS     16
#define GAIN_MAX        0xffffffu
#define WIDTH_MIN_C7    (2 * 128)
#define WIDTH_MAX_C7    (100 * 128)

void thermal_model_parameters_default(thermal_model_parameters_t *parameters)
{
    memset(parameters, 0, sizeof *parameters);
    parameters->rows = 3;
    parameters->columns = 3;
    parameters->step_ms = 100;
    parameters->heat_capacity_mj_per_k = 300;
    parameters->loss_uw_per_k = 5800;
    parameters->loss_fan_uw_per_k = 11300;
    parameters->orthogonal_uw_per_k = 586;
    parameters->orthogonal_fan_uw_per_k = 658;
    parameters->diagonal_uw_per_k = 293;
    parameters->diagonal_fan_uw_per_k = 329;
    parameters->latent_heat_mj = 8650;
    parameters->martensite_finish_cc = 6800;
    parameters->martensite_start_cc = 7800;
    parameters->austenite_start_cc = 8800;
    parameters->austenite_finish_cc = 9800;
    parameters->resistance_martensite_uohm = 175000;
    parameters->resistance_austenite_uohm = 219000;
    parameters->air_heat_capacity_mj_per_k = 50;
    parameters->plate_heat_capacity_mj_per_k = 20000;
    parameters->plate_loss_uw_per_k = 20000;
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

/* 1/100 degC to Q9.7, rounded. */
static int16_t c7_from_cc(int16_t cc)
{
    int32_t scaled = (int32_t)cc * 32;
    return (int16_t)((scaled + (scaled < 0 ? -12 : 12)) / 25);
}

static uint8_t neighbours_of(const thermal_model_parameters_t *p, uint8_t spring, uint8_t *diagonal)
{
    uint8_t row = (uint8_t)(spring / p->columns);
    uint8_t column = (uint8_t)(spring % p->columns);
    uint8_t vertical = (uint8_t)((row > 0) + (row + 1 < p->rows));
    uint8_t horizontal = (uint8_t)((column > 0) + (column + 1 < p->columns));
    *diagonal = (uint8_t)(vertical * horizontal);
    return (uint8_t)(vertical + horizontal);
}

/* Radiation's slope at the highest temperature (488 K), uW/K: 4 sigma T^3 = 26.4 W/m2K. */
static uint32_t radiation_slope(const thermal_model_parameters_t *p)
{
    return ((uint32_t)p->radiating_area_cmm2 * 27u + 99u) / 100u;
}

static uint32_t spring_capacity(const thermal_model_parameters_t *p, uint8_t i)
{
    return (uint32_t)p->heat_capacity_mj_per_k * p->heat_capacity_scale_permille[i];
}

static thermal_model_status_t check_array(const thermal_model_parameters_t *p,
                                          thermal_model_parameter_t *bad)
{
    *bad = THERMAL_MODEL_ROWS;
    if (p->rows == 0 || p->rows > THERMAL_MODEL_MAX_SPRINGS) {
        return THERMAL_MODEL_ERROR_RANGE;
    }
    *bad = THERMAL_MODEL_COLUMNS;
    if (p->columns == 0 || (uint16_t)p->rows * p->columns > THERMAL_MODEL_MAX_SPRINGS) {
        return THERMAL_MODEL_ERROR_RANGE;
    }
    *bad = THERMAL_MODEL_STEP;
    if (p->step_ms == 0 || p->step_ms > STEP_MAX_MS) {
        return THERMAL_MODEL_ERROR_RANGE;
    }
    uint8_t count = (uint8_t)(p->rows * p->columns);
    for (uint8_t i = 0; i < count; i++) {
        *bad = THERMAL_MODEL_LOSS_SCALE;
        if (p->loss_scale_permille[i] == 0 || p->loss_scale_permille[i] > SCALE_MAX_PERMILLE) {
            return THERMAL_MODEL_ERROR_RANGE;
        }
        *bad = THERMAL_MODEL_HEAT_CAPACITY_SCALE;
        if (p->heat_capacity_scale_permille[i] == 0 ||
            p->heat_capacity_scale_permille[i] > SCALE_MAX_PERMILLE) {
            return THERMAL_MODEL_ERROR_RANGE;
        }
        *bad = THERMAL_MODEL_HEAT_CAPACITY;
        /* 1e3 2^41 / 1e6 step / (capacity scale): the gain of the step must fit 24 bits */
        if (spring_capacity(p, i) < 1000u ||
            fixed_point_multiply_divide(2199023256u, p->step_ms, spring_capacity(p, i)) >
                GAIN_MAX) {
            return THERMAL_MODEL_ERROR_RANGE;
        }
    }
    return THERMAL_MODEL_OK;
}

static thermal_model_status_t check_phase(const thermal_model_parameters_t *p,
                                          thermal_model_parameter_t *bad)
{
    *bad = THERMAL_MODEL_MARTENSITE_FINISH;
    if (p->martensite_finish_cc < -3000) {
        return THERMAL_MODEL_ERROR_RANGE;
    }
    int16_t finish_m = c7_from_cc(p->martensite_finish_cc);
    int16_t start_m = c7_from_cc(p->martensite_start_cc);
    int16_t start_a = c7_from_cc(p->austenite_start_cc);
    int16_t finish_a = c7_from_cc(p->austenite_finish_cc);
    *bad = THERMAL_MODEL_MARTENSITE_START;
    if (p->martensite_start_cc <= p->martensite_finish_cc) {
        return THERMAL_MODEL_ERROR_ORDER;
    }
    int32_t width_m = (int32_t)start_m - finish_m;
    if (width_m < WIDTH_MIN_C7 || width_m > WIDTH_MAX_C7) {
        return THERMAL_MODEL_ERROR_RANGE;
    }
    *bad = THERMAL_MODEL_AUSTENITE_START;
    if (p->austenite_start_cc < p->martensite_start_cc) {
        return THERMAL_MODEL_ERROR_ORDER;
    }
    *bad = THERMAL_MODEL_AUSTENITE_FINISH;
    if (p->austenite_finish_cc <= p->austenite_start_cc) {
        return THERMAL_MODEL_ERROR_ORDER;
    }
    int32_t width_a = (int32_t)finish_a - start_a;
    if (width_a < WIDTH_MIN_C7 || width_a > WIDTH_MAX_C7 || p->austenite_finish_cc > 20000) {
        return THERMAL_MODEL_ERROR_RANGE;
    }
    *bad = THERMAL_MODEL_LATENT_HEAT;
    uint32_t latent_c7 =
        fixed_point_multiply_divide(p->latent_heat_mj, 128u, p->heat_capacity_mj_per_k);
    uint32_t narrower = (uint32_t)(width_m < width_a ? width_m : width_a);
    if (latent_c7 > LATENT_MAX_K * 128u || latent_c7 > 20u * narrower ||
        (int32_t)latent_c7 + finish_a > 200 * 128) {
        return THERMAL_MODEL_ERROR_RANGE;
    }
    *bad = THERMAL_MODEL_RESISTANCE_MARTENSITE;
    if (p->resistance_martensite_uohm == 0 || p->resistance_martensite_uohm > RESISTANCE_MAX_UOHM) {
        return THERMAL_MODEL_ERROR_RANGE;
    }
    *bad = THERMAL_MODEL_RESISTANCE_AUSTENITE;
    if (p->resistance_austenite_uohm == 0 || p->resistance_austenite_uohm > RESISTANCE_MAX_UOHM) {
        return THERMAL_MODEL_ERROR_RANGE;
    }
    return THERMAL_MODEL_OK;
}

static thermal_model_status_t check_flows(const thermal_model_parameters_t *p,
                                          thermal_model_parameter_t *bad)
{
    *bad = THERMAL_MODEL_AIR_EXCHANGE;
    if (p->air_exchange_uw_per_k > AIR_EXCHANGE_MAX) {
        return THERMAL_MODEL_ERROR_RANGE;
    }
    *bad = THERMAL_MODEL_AIR_HEAT_CAPACITY;
    if (p->air_heat_capacity_mj_per_k > CAPACITY_MAX_MJ) {
        return THERMAL_MODEL_ERROR_RANGE;
    }
    *bad = THERMAL_MODEL_PLATE_HEAT_CAPACITY;
    if (p->plate_heat_capacity_mj_per_k > CAPACITY_MAX_MJ) {
        return THERMAL_MODEL_ERROR_RANGE;
    }
    *bad = THERMAL_MODEL_LOSS_RISE;
    if (p->loss_rise_ppm_per_k > LOSS_RISE_MAX_PPM) {
        return THERMAL_MODEL_ERROR_RANGE;
    }
    *bad = THERMAL_MODEL_WAKE_TOWARDS;
    if (p->wake_direction > THERMAL_MODEL_WAKE_NORTH) {
        return THERMAL_MODEL_ERROR_RANGE;
    }
    uint8_t count = (uint8_t)(p->rows * p->columns);
    uint32_t orthogonal = larger(p->orthogonal_uw_per_k, p->orthogonal_fan_uw_per_k);
    uint32_t diagonal = larger(p->diagonal_uw_per_k, p->diagonal_fan_uw_per_k);
    for (uint8_t i = 0; i < count; i++) {
        uint8_t diagonals;
        uint8_t orthogonals = neighbours_of(p, i, &diagonals);
        uint32_t scale = p->loss_scale_permille[i];
        uint32_t natural = (uint32_t)p->loss_uw_per_k * scale / 1000u;
        uint32_t natural_risen =
            natural + fixed_point_multiply_divide(
                          natural, (uint32_t)p->loss_rise_ppm_per_k * LEAD_SPAN_K, 1000000u);
        uint32_t forced = (uint32_t)p->loss_fan_uw_per_k * scale / 1000u;
        uint32_t loss = larger(natural_risen, forced) + 1u;
        *bad = THERMAL_MODEL_WAKE;
        if (p->wake_uw_per_k > forced) {
            return THERMAL_MODEL_ERROR_RANGE;
        }
        *bad = forced > natural_risen                                    ? THERMAL_MODEL_LOSS_FAN
               : p->loss_rise_ppm_per_k > 0 && natural < CONDUCTANCE_MAX ? THERMAL_MODEL_LOSS_RISE
                                                                         : THERMAL_MODEL_LOSS;
        if (loss > CONDUCTANCE_MAX) {
            return THERMAL_MODEL_ERROR_OVERFLOW;
        }
        /* loss_rise is kept as uW/K per 2^16/64 K: below 64 uW/K per K */
        *bad = THERMAL_MODEL_LOSS_RISE;
        if (fixed_point_multiply_divide(natural, (uint32_t)p->loss_rise_ppm_per_k * 1024u,
                                        1000000u) > 65535u) {
            return THERMAL_MODEL_ERROR_OVERFLOW;
        }
        uint32_t between = orthogonals * orthogonal + diagonals * diagonal;
        uint32_t conduction = between + p->plate_coupling_uw_per_k;
        *bad = p->plate_coupling_uw_per_k > between ? THERMAL_MODEL_PLATE_COUPLING
               : diagonals * diagonal > orthogonals * orthogonal
                   ? (p->diagonal_fan_uw_per_k > p->diagonal_uw_per_k ? THERMAL_MODEL_DIAGONAL_FAN
                                                                      : THERMAL_MODEL_DIAGONAL)
               : p->orthogonal_fan_uw_per_k > p->orthogonal_uw_per_k ? THERMAL_MODEL_ORTHOGONAL_FAN
                                                                     : THERMAL_MODEL_ORTHOGONAL;
        if (conduction > CONDUCTANCE_MAX) {
            return THERMAL_MODEL_ERROR_OVERFLOW;
        }
        uint32_t total = loss + conduction + p->wake_uw_per_k + radiation_slope(p);
        if (total > CONDUCTANCE_SUM_MAX) {
            if (loss > conduction) {
                *bad = forced > natural ? THERMAL_MODEL_LOSS_FAN : THERMAL_MODEL_LOSS;
            }
            return THERMAL_MODEL_ERROR_OVERFLOW;
        }
        *bad = THERMAL_MODEL_STEP;
        /* step G <= C / 2 */
        if (fixed_point_multiply_divide(total, p->step_ms, 500u) > spring_capacity(p, i)) {
            return THERMAL_MODEL_ERROR_UNSTABLE;
        }
    }
    if (p->plate_coupling_uw_per_k > 0) {
        *bad = THERMAL_MODEL_PLATE_HEAT_CAPACITY;
        if (p->plate_heat_capacity_mj_per_k == 0) {
            return THERMAL_MODEL_ERROR_RANGE;
        }
        uint32_t total = (uint32_t)p->plate_coupling_uw_per_k * count + p->plate_loss_uw_per_k;
        if (fixed_point_multiply_divide(total, p->step_ms, 500000u) >
            p->plate_heat_capacity_mj_per_k) {
            return THERMAL_MODEL_ERROR_UNSTABLE;
        }
    }
    return THERMAL_MODEL_OK;
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
    node->gain = fixed_point_multiply_divide(2199023256u, steps, capacity);
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

static uint16_t slope_factor(uint32_t width_c7)
{
    uint32_t factor = (0x1000000u + width_c7 / 2u) / width_c7; /* 2^17 / width in K */
    return (uint16_t)(factor > 65535u ? 65535u : factor);
}

static void derive(thermal_model_t *model)
{
    const thermal_model_parameters_t *p = &model->parameters;
    model->pass.count = (uint8_t)(p->rows * p->columns);
    for (uint8_t i = 0; i < model->pass.count; i++) {
        thermal_model_spring_t *spring = &model->spring[i];
        uint32_t scale = p->loss_scale_permille[i];
        spring->step_gain =
            fixed_point_multiply_divide(2199023256u, p->step_ms, spring_capacity(p, i));
        spring->loss_natural =
            (uint16_t)fixed_point_multiply_divide(p->loss_uw_per_k, scale, 1000u);
        spring->loss_fan =
            (uint16_t)fixed_point_multiply_divide(p->loss_fan_uw_per_k, scale, 1000u);
        spring->loss_rise_natural = (uint16_t)fixed_point_multiply_divide(
            p->loss_uw_per_k * scale, (uint32_t)p->loss_rise_ppm_per_k * 1024u, 1000000000u);
        uint8_t diagonals;
        spring->orthogonals = neighbours_of(p, i, &diagonals) & 7u;
        spring->diagonals = diagonals & 7u;
    }
    model->latent_full_c23 = (int32_t)fixed_point_multiply_divide((uint32_t)p->latent_heat_mj << 10,
                                                                  8192u, p->heat_capacity_mj_per_k);
    int16_t highest_c7 = (int16_t)(255 * 128 - (int16_t)(model->latent_full_c23 >> 16));
    model->highest_c7 =
        highest_c7 < THERMAL_MODEL_HIGHEST_C7 ? highest_c7 : (int16_t)THERMAL_MODEL_HIGHEST_C7;
    model->martensite_finish_c7 = c7_from_cc(p->martensite_finish_cc);
    model->martensite_start_c7 = c7_from_cc(p->martensite_start_cc);
    model->austenite_start_c7 = c7_from_cc(p->austenite_start_cc);
    model->austenite_finish_c7 = c7_from_cc(p->austenite_finish_cc);
    uint32_t heating = (uint32_t)(model->austenite_finish_c7 - model->austenite_start_c7);
    uint32_t cooling = (uint32_t)(model->martensite_start_c7 - model->martensite_finish_c7);
    model->heating_position = position_factor(heating);
    model->cooling_position = position_factor(cooling);
    model->heating_slope = slope_factor(heating);
    model->cooling_slope = slope_factor(cooling);
    model->pass.flags = p->loss_rise_ppm_per_k != 0 ? PASS_RISES : 0;
    /* 1e-8 m2 sigma 512^4 K^4 64e6 / 2^16 = 0.0380535 a unit of area */
    model->radiation_factor =
        (uint16_t)fixed_point_multiply_divide(p->radiating_area_cmm2, 380535u, 10000000u);

    uint32_t loss_sum = 0;
    for (uint8_t i = 0; i < model->pass.count; i++) {
        loss_sum += (uint32_t)p->loss_scale_permille[i] *
                    larger(p->loss_uw_per_k, p->loss_fan_uw_per_k) / 1000u;
    }
    slow_node(&model->air, p->air_heat_capacity_mj_per_k, loss_sum + p->air_exchange_uw_per_k,
              p->air_exchange_uw_per_k, p->step_ms, model->pass.count);
    slow_node(&model->plate, p->plate_heat_capacity_mj_per_k,
              (uint32_t)p->plate_coupling_uw_per_k * model->pass.count + p->plate_loss_uw_per_k,
              p->plate_loss_uw_per_k, p->step_ms, model->pass.count);

    bool tall = p->rows >= p->columns;
    int8_t along_row = tall ? 1 : THERMAL_MODEL_FRAME_STRIDE;
    int8_t along_column = tall ? THERMAL_MODEL_FRAME_STRIDE : 1;
    for (uint8_t i = 0; i < model->pass.count; i++) {
        model->spring[i].frame =
            (thermal_model_place_t)((uint16_t)(i / p->columns) * (uint8_t)along_column +
                                    (uint16_t)(i % p->columns) * (uint8_t)along_row);
        model->spring[i].block_offset =
            (int16_t)((int32_t)(offsetof(thermal_model_t, lead) + 2u * model->spring[i].frame) -
                      (int32_t)(offsetof(thermal_model_t, spring) +
                                i * sizeof(thermal_model_spring_t)));
    }
    for (uint8_t i = 0; i < model->pass.count; i++) {
        uint8_t row = (uint8_t)(i / p->columns);
        uint8_t column = (uint8_t)(i % p->columns);
        const bool upstream = p->wake_direction == THERMAL_MODEL_WAKE_EAST    ? column > 0
                              : p->wake_direction == THERMAL_MODEL_WAKE_SOUTH ? row > 0
                              : p->wake_direction == THERMAL_MODEL_WAKE_WEST
                                  ? column + 1 < p->columns
                                  : row + 1 < p->rows;
        model->spring[i].upstream = upstream ? 1u : 0u;
    }
    model->wake_offset = p->wake_direction == THERMAL_MODEL_WAKE_EAST    ? (int8_t)-along_row
                         : p->wake_direction == THERMAL_MODEL_WAKE_SOUTH ? (int8_t)-along_column
                         : p->wake_direction == THERMAL_MODEL_WAKE_WEST  ? along_row
                                                                         : along_column;
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
                                          thermal_model_parameter_t *bad)
{
    thermal_model_parameter_t refused = THERMAL_MODEL_PARAMETER_COUNT;
    thermal_model_status_t status = check_array(parameters, &refused);
    if (status == THERMAL_MODEL_OK) {
        status = check_phase(parameters, &refused);
    }
    if (status == THERMAL_MODEL_OK) {
        status = check_flows(parameters, &refused);
    }
    if (status != THERMAL_MODEL_OK) {
        if (bad != NULL) {
            *bad = refused;
        }
        return status;
    }
    thermal_model_parameters_t copy = *parameters; /* may be the model's own */
    memset(model, 0, sizeof *model);
    model->parameters = copy;
    derive(model);
    thermal_model_apply_fan(model);
    model->ambient_c7 = 20 * 128;
    thermal_model_reset(model, 20 * 128);
    return THERMAL_MODEL_OK;
}
