#include "parameters.h"

#include <string.h>

#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "fields are read and written as their lower bytes"
#endif

#define STRUCT_MODEL   thermal_model_parameters_t
#define STRUCT_CURRENT current_control_parameters_t
#define STRUCT_SAFETY  safety_parameters_t
#define STRUCT_POLICY  drive_policy_parameters_t
#define STRUCT_BOARD   board_settings_t
#define COUNT_ONE      1
#define COUNT_EACH     THERMAL_MODEL_MAX_SPRINGS

/* Rounded, by the compiler. */
#define WHOLE(value, decimals) ((int32_t)((value)*1e##decimals + ((value) < 0 ? -0.5 : 0.5)))

static const parameter_row_t table[PARAMETER_COUNT] FLASH_MEMORY = {
#define PARAMETER(part_, id_, name_, unit_, decimals_, type_, count_, field, low, high, usual,     \
                  ...)                                                                             \
    {.name = #name_,                                                                               \
     .unit = unit_,                                                                                \
     .id = (id_),                                                                                  \
     .part = PARAMETER_PART_##part_,                                                               \
     .type = PARAMETER_##type_,                                                                    \
     .count = COUNT_##count_,                                                                      \
     .decimals = (decimals_),                                                                      \
     .offset = offsetof(STRUCT_##part_, field),                                                    \
     .minimum = WHOLE(low, decimals_),                                                             \
     .maximum = WHOLE(high, decimals_),                                                            \
     .standard = WHOLE(usual, decimals_)},
#include "parameters.def"
};

parameter_row_t parameter_row(uint16_t row)
{
    parameter_row_t copy;
    flash_copy(&copy, &table[row], sizeof copy);
    return copy;
}

uint8_t parameter_width(uint8_t type)
{
    return type == PARAMETER_U8 ? 1 : type == PARAMETER_U32 ? 4 : 2;
}

static size_t place(const parameter_row_t *row, spring_index_t element)
{
    return row->offset + (size_t)element * parameter_width(row->type);
}

int32_t parameter_decode(const void *bytes, uint8_t type)
{
    int32_t value = 0;
    memcpy(&value, bytes, parameter_width(type));
    return type == PARAMETER_S16 ? (int16_t)value : value;
}

int32_t parameter_get(const void *values, const parameter_row_t *row, spring_index_t element)
{
    return parameter_decode((const uint8_t *)values + place(row, element), row->type);
}

void parameter_set(void *values, const parameter_row_t *row, spring_index_t element, int32_t value)
{
    memcpy((uint8_t *)values + place(row, element), &value, parameter_width(row->type));
}

static const parameter_pair_t pairs[PARAMETER_PAIRS] FLASH_MEMORY = {
    {PARAMETER_martensite_finish_c, PARAMETER_martensite_start_c, 200, 0},
    {PARAMETER_martensite_start_c, PARAMETER_austenite_start_c, 0, 0},
    {PARAMETER_austenite_start_c, PARAMETER_austenite_finish_c, 200, 0},
    {PARAMETER_hold_margin_k, PARAMETER_unsure_margin_k, 0, 0},
    {PARAMETER_temperature_limit_c, PARAMETER_temperature_trip_c, 0, 0},
    {PARAMETER_maximum_current_a, PARAMETER_over_current_a, 0, 0},
    {PARAMETER_check_current_a, PARAMETER_over_current_a, 0, 0},
    {PARAMETER_stuck_on_a, PARAMETER_over_current_a, 0, 0},
    {PARAMETER_probe_current_a, PARAMETER_boost_current_a, 0, 0},
    {PARAMETER_supply_reserve_a, PARAMETER_supply_limit_a, 1, 0},
    {PARAMETER_resistance_minimum_ohm, PARAMETER_resistance_maximum_ohm, 1, 1}};

parameter_pair_t parameter_pair(uint8_t index)
{
    parameter_pair_t copy;
    flash_copy(&copy, &pairs[index], sizeof copy);
    return copy;
}

uint16_t parameter_partner(uint16_t row)
{
    /* those whose judgement is more than one being above the other */
    static const uint8_t others[][2] FLASH_MEMORY = {
        {PARAMETER_columns, PARAMETER_rows},
        {PARAMETER_latent_heat_j, PARAMETER_heat_capacity_j_per_k},
        {PARAMETER_loss_w_per_k, PARAMETER_heat_capacity_j_per_k},
        {PARAMETER_loss_fan_w_per_k, PARAMETER_heat_capacity_j_per_k},
        {PARAMETER_plate_heat_capacity_j_per_k, PARAMETER_plate_coupling_w_per_k},
        {PARAMETER_wake_w_per_k, PARAMETER_loss_fan_w_per_k},
        {PARAMETER_transformation_shift_k, PARAMETER_austenite_finish_c}};
    for (uint8_t k = 0; k < PARAMETER_PAIRS; k++) {
        const parameter_pair_t pair = parameter_pair(k);
        if (pair.larger == row) {
            return pair.smaller;
        }
    }
    for (uint8_t k = 0; k < sizeof others / sizeof others[0]; k++) {
        if (flash_byte(&others[k][0]) == row) {
            return flash_byte(&others[k][1]);
        }
    }
    return PARAMETER_COUNT;
}

bool parameter_check(parameter_part_t part, const void *values, uint16_t *bad)
{
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        if (flash_byte(&table[k].part) != part) {
            continue;
        }
        const parameter_row_t row = parameter_row(k);
        for (spring_index_t element = 0; element < row.count; element++) {
            const int32_t value = parameter_get(values, &row, element);
            if (value < row.minimum || value > row.maximum) {
                if (bad != NULL) {
                    *bad = k;
                }
                return false;
            }
        }
    }
    return true;
}

static void set_defaults(parameter_part_t part, void *values)
{
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        if (flash_byte(&table[k].part) != part) {
            continue;
        }
        const parameter_row_t row = parameter_row(k);
        for (spring_index_t element = 0; element < row.count; element++) {
            parameter_set(values, &row, element, row.standard);
        }
    }
}

void thermal_model_parameters_default(thermal_model_parameters_t *parameters)
{
    set_defaults(PARAMETER_PART_MODEL, parameters);
    parameters->step_ms = 100;
}

void current_control_parameters_default(current_control_parameters_t *parameters)
{
    set_defaults(PARAMETER_PART_CURRENT, parameters);
}

void safety_parameters_default(safety_parameters_t *parameters)
{
    set_defaults(PARAMETER_PART_SAFETY, parameters);
}

void drive_policy_parameters_default(drive_policy_parameters_t *parameters)
{
    set_defaults(PARAMETER_PART_POLICY, parameters);
}

void board_settings_default(board_settings_t *settings)
{
    set_defaults(PARAMETER_PART_BOARD, settings);
}
