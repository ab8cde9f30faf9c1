#include "settings.h"

#include <stddef.h>
#include <string.h>

#include "crc16.h"
#include "text.h"

/* Order is part of the stored record: only ever append. Limits are those of the part's own table,
 * for one value alone; whether values fit together is decided by controller_apply_settings.
 * X(name, unit, decimals, part, field) */
/* clang-format off */
#define SETTINGS_TABLE(X) \
    X(rows, NONE, 0, ARRAY, rows) \
    X(columns, NONE, 0, ARRAY, columns) \
    X(heat_capacity_j_per_k, J_PER_K, 3, MODEL, heat_capacity_mj_per_k) \
    X(loss_w_per_k, W_PER_K, 6, MODEL, loss_uw_per_k) \
    X(loss_fan_w_per_k, W_PER_K, 6, MODEL, loss_fan_uw_per_k) \
    X(orthogonal_w_per_k, W_PER_K, 6, MODEL, orthogonal_uw_per_k) \
    X(orthogonal_fan_w_per_k, W_PER_K, 6, MODEL, orthogonal_fan_uw_per_k) \
    X(diagonal_w_per_k, W_PER_K, 6, MODEL, diagonal_uw_per_k) \
    X(diagonal_fan_w_per_k, W_PER_K, 6, MODEL, diagonal_fan_uw_per_k) \
    X(loss_rise_per_k, PER_K, 6, MODEL, loss_rise_ppm_per_k) \
    X(radiating_area_mm2, MM2, 2, MODEL, radiating_area_cmm2) \
    X(latent_heat_j, J, 3, MODEL, latent_heat_mj) \
    X(martensite_finish_c, DEG_C, 2, MODEL, martensite_finish_cc) \
    X(martensite_start_c, DEG_C, 2, MODEL, martensite_start_cc) \
    X(austenite_start_c, DEG_C, 2, MODEL, austenite_start_cc) \
    X(austenite_finish_c, DEG_C, 2, MODEL, austenite_finish_cc) \
    X(resistance_martensite_ohm, OHM, 6, MODEL, resistance_martensite_uohm) \
    X(resistance_austenite_ohm, OHM, 6, MODEL, resistance_austenite_uohm) \
    X(air_heat_capacity_j_per_k, J_PER_K, 3, MODEL, air_heat_capacity_mj_per_k) \
    X(air_exchange_w_per_k, W_PER_K, 6, MODEL, air_exchange_uw_per_k) \
    X(plate_coupling_w_per_k, W_PER_K, 6, MODEL, plate_coupling_uw_per_k) \
    X(plate_heat_capacity_j_per_k, J_PER_K, 3, MODEL, plate_heat_capacity_mj_per_k) \
    X(plate_loss_w_per_k, W_PER_K, 6, MODEL, plate_loss_uw_per_k) \
    X(wake_w_per_k, W_PER_K, 6, MODEL, wake_uw_per_k) \
    X(wake_direction, NONE, 0, MODEL, wake_direction) \
    X(loss_scale, NONE, 3, MODEL_EACH, loss_scale_permille) \
    X(heat_capacity_scale, NONE, 3, MODEL_EACH, heat_capacity_scale_permille) \
    X(supply_v, V, 3, CURRENT, supply_mv) \
    X(freewheel_v, V, 3, CURRENT, freewheel_mv) \
    X(shunt_ohm, OHM, 3, CURRENT, shunt_mohm) \
    X(wiring_ohm, OHM, 3, CURRENT, wiring_mohm) \
    X(current_integral, NONE, 3, CURRENT, integral_permille) \
    X(current_slew_a_per_tick, A, 3, CURRENT, slew_ma_per_tick) \
    X(maximum_current_a, A, 3, CURRENT, maximum_current_ma) \
    X(maximum_duty_steps, NONE, 0, CURRENT, maximum_duty_steps) \
    X(current_trim_limit_ohm, OHM, 3, CURRENT, trim_limit_mohm) \
    X(current_hold_ticks, NONE, 0, CURRENT, hold_ticks) \
    X(over_current_a, A, 3, SAFETY, over_current_ma) \
    X(supply_limit_a, A, 3, SAFETY, supply_limit_ma) \
    X(check_current_a, A, 3, SAFETY, check_current_ma) \
    X(resistance_minimum_ohm, OHM, 3, SAFETY, resistance_minimum_mohm) \
    X(resistance_maximum_ohm, OHM, 3, SAFETY, resistance_maximum_mohm) \
    X(stuck_on_a, A, 3, SAFETY, stuck_on_ma) \
    X(temperature_trip_c, DEG_C, 2, SAFETY, temperature_trip_cc) \
    X(maximum_on_s, S, 0, SAFETY, maximum_on_s) \
    X(fault_bad_samples, NONE, 0, SAFETY, bad_samples) \
    X(policy, NONE, 0, POLICY, policy) \
    X(open_current_a, A, 3, POLICY, open_current_ma) \
    X(supply_reserve_a, A, 3, POLICY, supply_reserve_ma) \
    X(ambient_c, DEG_C, 2, BOARD, ambient_cc) \
    X(ambient_source, NONE, 0, BOARD, ambient_source) \
    X(sensor_averaging, NONE, 0, BOARD, sensor_averaging) \
    X(telemetry_format, NONE, 0, BOARD, telemetry_format) \
    X(telemetry_hz, HZ, 0, BOARD, telemetry_hz) \
    X(boost_current_a, A, 3, POLICY, boost_current_ma) \
    X(probe_current_a, A, 3, POLICY, probe_current_ma) \
    X(dither_a, A, 3, POLICY, dither_ma) \
    X(hold_margin_k, K, 2, POLICY, hold_margin_cc) \
    X(unsure_margin_k, K, 2, POLICY, unsure_margin_cc) \
    X(search_k_per_s, K_PER_S, 3, POLICY, search_mk_per_s) \
    X(observer, NONE, 0, POLICY, observer) \
    X(probe_period_s, S, 0, POLICY, probe_period_s) \
    X(temperature_limit_c, DEG_C, 2, POLICY, temperature_limit_cc) \
    X(temperature_band_k, K, 2, POLICY, temperature_band_cc) \
    X(undriven_margin_k, K, 2, POLICY, undriven_margin_cc) \
    X(overload_current_a, A, 3, POLICY, overload_current_ma) \
    X(overload_time_s, S, 0, POLICY, overload_time_s) \
    X(trip_time_s, S, 0, POLICY, trip_time_s)
/* clang-format on */

/* The chip's own limits; the model takes larger arrays. */
typedef struct {
    parameter_range_t rows, columns;
} array_ranges_t;
static const array_ranges_t array_ranges FLASH_MEMORY = {
    PARAMETER_RANGE(thermal_model_parameters_t, rows, U8, 1, 8),
    PARAMETER_RANGE(thermal_model_parameters_t, columns, U8, 1, 8)};

typedef struct {
    parameter_range_t ambient_cc, ambient_source, sensor_averaging, telemetry_format, telemetry_hz;
} board_ranges_t;
#define RANGE(field, type, minimum, maximum)                                                       \
    PARAMETER_RANGE(board_settings_t, field, type, minimum, maximum)
static const board_ranges_t board_ranges FLASH_MEMORY = {
    RANGE(ambient_cc, S16, -4000, 8500), RANGE(ambient_source, U8, 0, 1),
    RANGE(sensor_averaging, U8, 8, 16), RANGE(telemetry_format, U8, 0, 2),
    RANGE(telemetry_hz, U8, 1, 50)};

typedef enum {
    UNIT_NONE,
    UNIT_J_PER_K,
    UNIT_W_PER_K,
    UNIT_PER_K,
    UNIT_MM2,
    UNIT_J,
    UNIT_DEG_C,
    UNIT_OHM,
    UNIT_V,
    UNIT_A,
    UNIT_S,
    UNIT_HZ,
    UNIT_K,
    UNIT_K_PER_S,
    UNIT_COUNT
} unit_t;

static const char units[UNIT_COUNT][5] FLASH_MEMORY = {
    "", "J/K", "W/K", "1/K", "mm2", "J", "degC", "ohm", "V", "A", "s", "Hz", "K", "K/s"};

/* All names behind one another, each as long as it is. */
#define NAME_FIELD(name, ...)                                                                      \
    char name[sizeof #name <= SETTINGS_NAME_SIZE ? (int)sizeof #name : -1];
#define NAME_TEXT(name, ...) #name,
typedef struct {
    SETTINGS_TABLE(NAME_FIELD)
} names_t;
static const names_t names FLASH_MEMORY = {SETTINGS_TABLE(NAME_TEXT)};

/* Where the values of each part are. */
typedef enum { PART_MODEL, PART_CURRENT, PART_SAFETY, PART_POLICY, PART_BOARD } part_t;
static const uint16_t parts[] FLASH_MEMORY = {
    offsetof(settings_t, controller.model), offsetof(settings_t, controller.current),
    offsetof(settings_t, controller.safety), offsetof(settings_t, controller.policy),
    offsetof(settings_t, board)};

typedef struct {
    const parameter_range_t *range; /* in flash */
    uint8_t part : 3;               /* part_t */
    uint8_t decimals : 4;
    uint8_t each : 1; /* an array, an element for each spring */
} row_t;

#define IN_MODEL(field)      &thermal_model_ranges.field, .part = PART_MODEL
#define IN_MODEL_EACH(field) &thermal_model_ranges.field, .part = PART_MODEL, .each = 1
#define IN_ARRAY(field)      &array_ranges.field, .part = PART_MODEL
#define IN_CURRENT(field)    &current_control_ranges.field, .part = PART_CURRENT
#define IN_SAFETY(field)     &safety_ranges.field, .part = PART_SAFETY
#define IN_POLICY(field)     &drive_policy_ranges.field, .part = PART_POLICY
#define IN_BOARD(field)      &board_ranges.field, .part = PART_BOARD
#define ROW(name, unit, decimals_, part_, field)                                                   \
    {.range = IN_##part_(field), .decimals = (decimals_)},
static const row_t table[] FLASH_MEMORY = {SETTINGS_TABLE(ROW)};

#define TABLE_COUNT ((uint8_t)(sizeof table / sizeof table[0]))

void settings_default(settings_t *settings)
{
    memset(settings, 0, sizeof *settings);
    controller_settings_default(&settings->controller);
    settings->board.ambient_cc = 2000;
    settings->board.ambient_source = SETTINGS_AMBIENT_SET;
    settings->board.sensor_averaging = 8;
    settings->board.telemetry_format = 0;
    settings->board.telemetry_hz = 5;
}

uint8_t settings_count(void)
{
    return TABLE_COUNT;
}

void settings_entry(uint8_t index, settings_entry_t *entry)
{
    row_t row;
    uint16_t part;
    flash_copy(&row, &table[index], sizeof row);
    flash_copy(&part, &parts[row.part], sizeof part);
    const parameter_range_t range = parameter_range(row.range);
    entry->decimals = row.decimals;
    entry->type = range.type;
    entry->count = row.each ? THERMAL_MODEL_MAX_SPRINGS : 1;
    entry->offset = (uint16_t)(part + range.offset);
    entry->minimum = range.minimum;
    entry->maximum = parameter_maximum(&range);
}

const char *settings_name(uint8_t index)
{
    return text_item((const char *)&names, index);
}

#define UNIT(name, unit, ...) UNIT_##unit,
const char *settings_unit(uint8_t index)
{
    static const uint8_t unit[] FLASH_MEMORY = {SETTINGS_TABLE(UNIT)};
    return units[flash_byte(&unit[index])];
}

uint16_t settings_fingerprint(uint8_t entries)
{
    uint16_t crc = CRC16_START;
    settings_entry_t entry;
    const char *name = (const char *)&names;
    for (uint8_t i = 0; i < entries; i++) {
        for (const char *const end = text_item(name, 1); name < end; name++) {
            crc = crc16_add(crc, flash_byte(name));
        }
        settings_entry(i, &entry);
        crc = crc16_add(crc, entry.type);
        crc = crc16_add(crc, entry.decimals);
        crc = crc16_add(crc, entry.count);
    }
    return crc;
}

/* 1..count as written without leading zeros; 0 where it is no such number. */
static uint8_t element_number(const char *text, uint8_t count)
{
    uint8_t number = 0;
    if (*text == '0') {
        return 0;
    }
    for (; *text != '\0'; text++) {
        if (*text < '0' || *text > '9' || number > 24u) {
            return 0;
        }
        number = (uint8_t)(number * 10u + (uint8_t)(*text - '0'));
    }
    return number <= count ? number : 0u;
}

/* What follows the entry's name in text; NULL where text begins otherwise. */
static const char *after_name(const char *text, const char *name)
{
    for (;; text++, name++) {
        const char wanted = (char)flash_byte(name);
        if (wanted == '\0') {
            return text;
        }
        if (*text != wanted) {
            return NULL;
        }
    }
}

bool settings_find(const char *name, uint8_t *index, uint8_t *element)
{
    settings_entry_t entry;
    const char *known = (const char *)&names;
    for (uint8_t i = 0; i < TABLE_COUNT; i++, known = text_item(known, 1)) {
        const char *const rest = after_name(name, known);
        if (rest == NULL) {
            continue;
        }
        settings_entry(i, &entry);
        uint8_t number = *rest == '\0';
        if (entry.count > 1) {
            number = *rest == '_' ? element_number(rest + 1, entry.count) : 0u;
        }
        if (number != 0) {
            *index = i;
            *element = (uint8_t)(number - 1u);
            return true;
        }
    }
    return false;
}

static uint16_t offset_of(const settings_entry_t *entry, uint8_t element)
{
    return (uint16_t)(entry->offset + (uint16_t)(element * parameter_width(entry->type)));
}

int32_t settings_get(const settings_t *settings, uint8_t index, uint8_t element)
{
    settings_entry_t entry;
    settings_entry(index, &entry);
    return parameter_get((const uint8_t *)settings + offset_of(&entry, element), entry.type);
}

settings_result_t settings_set(settings_t *settings, uint8_t index, uint8_t element, int32_t value)
{
    settings_entry_t entry;
    settings_entry(index, &entry);
    if (value < entry.minimum || value > entry.maximum) {
        return SETTINGS_OUT_OF_RANGE;
    }
    parameter_set((uint8_t *)settings + offset_of(&entry, element), entry.type, value);
    return SETTINGS_OK;
}

bool settings_find_offset(uint16_t offset, uint8_t *index, uint8_t *element)
{
    settings_entry_t entry;
    offset = (uint16_t)(offset + offsetof(settings_t, controller));
    for (uint8_t i = 0; i < TABLE_COUNT; i++) {
        settings_entry(i, &entry);
        for (uint8_t k = 0; k < entry.count; k++) {
            if (offset_of(&entry, k) == offset) {
                *index = i;
                *element = k;
                return true;
            }
        }
    }
    return false;
}

settings_result_t settings_assign(settings_t *settings, const char *name, const char *value)
{
    uint8_t index;
    uint8_t element;
    int32_t number;
    settings_entry_t entry;
    if (!settings_find(name, &index, &element)) {
        return SETTINGS_UNKNOWN_NAME;
    }
    settings_entry(index, &entry);
    switch (text_parse_decimal(value, entry.decimals, &number)) {
    case TEXT_OK:
        return settings_set(settings, index, element, number);
    case TEXT_TOO_LARGE:
        return SETTINGS_OUT_OF_RANGE;
    default:
        return SETTINGS_NOT_A_NUMBER;
    }
}
