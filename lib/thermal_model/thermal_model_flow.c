#include "thermal_model_internal.h"

/* How heat flows, each law with what is derived for it and what of it fits:
 * thermal_model_check_flows adds up every path from a spring at its steepest, so that the sum of
 * flows_at never overflows. */

#define CONDUCTANCE_MAX     65535u
#define CONDUCTANCE_SUM_MAX 98000u    /* (2^31 / 64 uW - highest power) / 256 K */
#define LOSS_RISE_MAX_E6    63999511u /* 1e-6 uW/K per K: loss_rise is 16 bits of uW/K per 1024 K */
#define KELVIN_AT_0_C7      34963u    /* 273.15 K */

/* ---- what fits ---- */

static uint32_t larger(uint32_t a, uint32_t b)
{
    return a > b ? a : b;
}

thermal_model_neighbours_t thermal_model_neighbours(const thermal_model_parameters_t *p,
                                                    spring_index_t spring)
{
    const uint8_t row = (uint8_t)(spring / p->columns);
    const uint8_t column = (uint8_t)(spring % p->columns);
    const uint8_t vertical = (uint8_t)((row > 0) + (row + 1 < p->rows));
    const uint8_t horizontal = (uint8_t)((column > 0) + (column + 1 < p->columns));
    return (thermal_model_neighbours_t){.orthogonals = (uint8_t)(vertical + horizontal),
                                        .diagonals = (uint8_t)(vertical * horizontal)};
}

/* Radiation's slope at the highest temperature (488 K), uW/K: 4 sigma T^3 = 26.4 W/m2K. */
static uint32_t radiation_slope(const thermal_model_parameters_t *p)
{
    return ((uint32_t)p->radiating_area_cmm2 * 27u + 99u) / 100u;
}

/* Of one spring. */
static uint32_t scaled_loss(uint16_t loss_uw_per_k, uint16_t permille)
{
    return ((uint32_t)loss_uw_per_k * permille + 500u) / 1000u;
}

thermal_model_refusal_t thermal_model_check_flows(const thermal_model_parameters_t *p,
                                                  spring_index_t i)
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
    const thermal_model_neighbours_t neighbours = thermal_model_neighbours(p, i);
    const uint32_t orthogonal =
        neighbours.orthogonals * larger(p->orthogonal_uw_per_k, p->orthogonal_fan_uw_per_k);
    const uint32_t diagonal =
        neighbours.diagonals * larger(p->diagonal_uw_per_k, p->diagonal_fan_uw_per_k);
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
    if ((total * p->step_ms + 499u) / 500u >
        thermal_model_spring_capacity(p, i)) { /* step G <= C / 2 */
        REFUSE(UNSTABLE, heat_capacity_j_per_k);
    }
    return 0;
}

/* ---- what follows from the parameters, and from the fan ---- */

/* The spring from which the fan blows at that place; NO_SPRING at the edge where its air comes in.
 */
static spring_index_t upstream_of(const thermal_model_parameters_t *p, uint8_t row, uint8_t column)
{
    const spring_index_t i = (spring_index_t)(row * p->columns + column);
    switch ((thermal_model_wake_t)p->wake_direction) {
    case THERMAL_MODEL_WAKE_EAST:
        return column > 0 ? (spring_index_t)(i - 1u) : NO_SPRING;
    case THERMAL_MODEL_WAKE_SOUTH:
        return row > 0 ? (spring_index_t)(i - p->columns) : NO_SPRING;
    case THERMAL_MODEL_WAKE_WEST:
        return column + 1u < p->columns ? (spring_index_t)(i + 1u) : NO_SPRING;
    case THERMAL_MODEL_WAKE_NORTH:
        return row + 1u < p->rows ? (spring_index_t)(i + p->columns) : NO_SPRING;
    }
    return NO_SPRING;
}

static uint32_t derive_spring(thermal_model_t *model, spring_index_t i)
{
    const thermal_model_parameters_t *p = &model->parameters;
    thermal_model_spring_t *spring = &model->spring[i];
    const uint16_t scale = p->loss_scale_permille[i];
    spring->row = (uint8_t)(i / p->columns);
    spring->column = (uint8_t)(i % p->columns);
    spring->upstream = upstream_of(p, spring->row, spring->column);
    spring->loss_natural_uw_per_k = (uint16_t)scaled_loss(p->loss_uw_per_k, scale);
    spring->loss_fan_uw_per_k = (uint16_t)scaled_loss(p->loss_fan_uw_per_k, scale);
    /* 1024 / 1e6 */
    spring->loss_rise_natural =
        (uint16_t)(((uint32_t)spring->loss_natural_uw_per_k * p->loss_rise_ppm_per_k * 16u +
                    7812u) /
                   15625u);
    return larger(spring->loss_natural_uw_per_k, spring->loss_fan_uw_per_k);
}

uint32_t thermal_model_derive_flows(thermal_model_t *model)
{
    /* 1e-8 m2 sigma 512^4 K^4 64e6 / 2^16 = 0.0380535 a unit of area, to 1e-6 */
    model->radiation_factor =
        (uint16_t)((model->parameters.radiating_area_cmm2 * (uint32_t)39902 + 0x80000u) >> 20);
    uint32_t to_air_uw_per_k = 0;
    for (spring_index_t i = 0; i < model->springs; i++) {
        to_air_uw_per_k += derive_spring(model, i);
    }
    return to_air_uw_per_k;
}

/* natural + (forced - natural) fan, fan in Q2.14 */
static uint16_t between(uint16_t natural, uint16_t forced, uint16_t fan)
{
    int32_t difference = ((int32_t)forced - (int32_t)natural) * (int32_t)fan;
    return (uint16_t)(natural + ((difference + 8192) >> 14));
}

/* What the fan adds at a command, of what it adds at full, Q2.14: f h / (f h + (1 - f)(1 - h)), h
 * its part at half. Steep at first where h > 1/2, never falling, 0 at 0 and 1 at full, whatever h.
 * One division, on a change of the fan. 100 x 999 x 2^14 is below 2^31. */
static uint16_t fan_part(uint8_t percent, uint16_t half_permille)
{
    const uint32_t there = (uint32_t)percent * half_permille;
    const uint32_t rest = (uint32_t)(100u - percent) * (1000u - (uint32_t)half_permille);
    return (uint16_t)(((there << 14) + (there + rest) / 2u) / (there + rest));
}

void thermal_model_apply_fan(thermal_model_t *model)
{
    const thermal_model_parameters_t *p = &model->parameters;
    const uint16_t fan = fan_part(model->fan_percent, p->fan_half_share_permille);
    model->orthogonal_uw_per_k = between(p->orthogonal_uw_per_k, p->orthogonal_fan_uw_per_k, fan);
    model->diagonal_uw_per_k = between(p->diagonal_uw_per_k, p->diagonal_fan_uw_per_k, fan);
    model->wake_uw_per_k = between(0, p->wake_uw_per_k, fan);
    for (spring_index_t i = 0; i < model->springs; i++) {
        thermal_model_spring_t *spring = &model->spring[i];
        spring->loss_uw_per_k =
            between(spring->loss_natural_uw_per_k, spring->loss_fan_uw_per_k, fan);
        /* natural convection rises with temperature, the fan's does not */
        spring->loss_rise = between(spring->loss_rise_natural, 0, fan);
    }
}

/* ---- flows, 1/64 uW ---- */

static int32_t flow_through(uint16_t conductance_uw_per_k, int16_t difference_c6)
{
    return (int32_t)difference_c6 * conductance_uw_per_k;
}

/* Radiated at a temperature: factor (T / 512 K)^4. */
static int32_t radiated(const thermal_model_t *model, int16_t temperature_c6)
{
    if (model->radiation_factor == 0) {
        return 0;
    }
    const uint16_t kelvin_c7 = (uint16_t)(KELVIN_AT_0_C7 + 2u * (uint16_t)temperature_c6);
    const uint16_t square = fixed_point_high_u16(kelvin_c7, kelvin_c7);
    return (int32_t)((uint32_t)fixed_point_high_u16(square, square) * model->radiation_factor);
}

static int32_t from_neighbours(const thermal_model_t *model, spring_index_t i,
                               int16_t temperature_c6)
{
    const thermal_model_spring_t *own = &model->spring[i];
    const uint8_t columns = model->parameters.columns;
    const uint8_t top = own->row > 0 ? (uint8_t)(own->row - 1u) : 0;
    const uint8_t left = own->column > 0 ? (uint8_t)(own->column - 1u) : 0;
    int32_t flow = 0;
    for (uint8_t row = top; row <= own->row + 1u && row < model->parameters.rows; row++) {
        for (uint8_t column = left; column <= own->column + 1u && column < columns; column++) {
            const spring_index_t j = (spring_index_t)(row * columns + column);
            if (j == i) {
                continue;
            }
            const bool beside = row == own->row || column == own->column;
            flow += flow_through(beside ? model->orthogonal_uw_per_k : model->diagonal_uw_per_k,
                                 (int16_t)(model->spring[j].midstep_c6 - temperature_c6));
        }
    }
    return flow;
}

bool thermal_model_exchange_closes(const thermal_model_t *model)
{
    int64_t sum = 0;
    for (spring_index_t i = 0; i < model->springs; i++) {
        sum += from_neighbours(model, i, model->spring[i].midstep_c6);
    }
    return sum == 0;
}

/* What a spring gives the air around it. */
static int32_t given_to_air(const thermal_model_spring_t *spring, int16_t above_air_c6)
{
    uint16_t conductance = spring->loss_uw_per_k;
    if (above_air_c6 > 0) {
        conductance = (uint16_t)(conductance +
                                 (((uint32_t)spring->loss_rise * (uint16_t)above_air_c6) >> 16));
    }
    return flow_through(conductance, above_air_c6);
}

thermal_model_flows_t thermal_model_flows_at(const thermal_model_t *model, spring_index_t i,
                                             int16_t temperature_c6)
{
    const thermal_model_spring_t *own = &model->spring[i];
    const int16_t air_c6 = model->air.midstep_c6;
    const int16_t ambient_c6 = (int16_t)(model->ambient_c7 >> 1);
    thermal_model_flows_t flows;
    flows.to_air = given_to_air(own, (int16_t)(temperature_c6 - air_c6));
    if (own->upstream != NO_SPRING) { /* what the fan's air brings it took there */
        const int16_t above_c6 = (int16_t)(model->spring[own->upstream].midstep_c6 - air_c6);
        flows.to_air -= flow_through(model->wake_uw_per_k, above_c6);
    }
    flows.to_plate = flow_through(model->parameters.plate_coupling_uw_per_k,
                                  (int16_t)(temperature_c6 - model->plate.midstep_c6));
    flows.into_spring = from_neighbours(model, i, temperature_c6) - flows.to_air - flows.to_plate -
                        (radiated(model, temperature_c6) - radiated(model, ambient_c6));
    return flows;
}
