#include "settings.h"

#include <stddef.h>
#include <string.h>

#include "text.h"

#define MODEL(field)   offsetof(settings_t, controller.model.field)
#define CURRENT(field) offsetof(settings_t, controller.current.field)
#define SAFETY(field)  offsetof(settings_t, controller.safety.field)
#define POLICY(field)  offsetof(settings_t, controller.policy.field)
#define BOARD(field)   offsetof(settings_t, board.field)
#define EACH_SPRING    THERMAL_MODEL_MAX_SPRINGS

/* Order is part of the stored record: only ever append. Limits here are those of one value alone;
 * whether values fit together is decided by controller_apply_settings.
 * X(name, unit, decimals, type, count, offset, minimum, maximum) */
/* clang-format off */
#define SETTINGS_TABLE(X) \
    X(rows, NONE, 0, U8, 1, MODEL(rows), 1, 8) \
    X(columns, NONE, 0, U8, 1, MODEL(columns), 1, 8) \
    X(heat_capacity_j_per_k, J_PER_K, 3, U16, 1, MODEL(heat_capacity_mj_per_k), 1, 65535) \
    X(loss_w_per_k, W_PER_K, 6, U16, 1, MODEL(loss_uw_per_k), 0, 65535) \
    X(loss_fan_w_per_k, W_PER_K, 6, U16, 1, MODEL(loss_fan_uw_per_k), 0, 65535) \
    X(orthogonal_w_per_k, W_PER_K, 6, U16, 1, MODEL(orthogonal_uw_per_k), 0, 65535) \
    X(orthogonal_fan_w_per_k, W_PER_K, 6, U16, 1, MODEL(orthogonal_fan_uw_per_k), 0, 65535) \
    X(diagonal_w_per_k, W_PER_K, 6, U16, 1, MODEL(diagonal_uw_per_k), 0, 65535) \
    X(diagonal_fan_w_per_k, W_PER_K, 6, U16, 1, MODEL(diagonal_fan_uw_per_k), 0, 65535) \
    X(loss_rise_per_k, PER_K, 6, U16, 1, MODEL(loss_rise_ppm_per_k), 0, 65535) \
    X(radiating_area_mm2, MM2, 2, U16, 1, MODEL(radiating_area_cmm2), 0, 65535) \
    X(latent_heat_j, J, 3, U16, 1, MODEL(latent_heat_mj), 0, 65535) \
    X(martensite_finish_c, DEG_C, 2, S16, 1, MODEL(martensite_finish_cc), -4000, 21500) \
    X(martensite_start_c, DEG_C, 2, S16, 1, MODEL(martensite_start_cc), -4000, 21500) \
    X(austenite_start_c, DEG_C, 2, S16, 1, MODEL(austenite_start_cc), -4000, 21500) \
    X(austenite_finish_c, DEG_C, 2, S16, 1, MODEL(austenite_finish_cc), -4000, 21500) \
    X(resistance_martensite_ohm, OHM, 6, U32, 1, MODEL(resistance_martensite_uohm), 1, 100000000) \
    X(resistance_austenite_ohm, OHM, 6, U32, 1, MODEL(resistance_austenite_uohm), 1, 100000000) \
    X(air_heat_capacity_j_per_k, J_PER_K, 3, U32, 1, MODEL(air_heat_capacity_mj_per_k), 0, 100000000) \
    X(air_exchange_w_per_k, W_PER_K, 6, U32, 1, MODEL(air_exchange_uw_per_k), 0, 16000000) \
    X(plate_coupling_w_per_k, W_PER_K, 6, U16, 1, MODEL(plate_coupling_uw_per_k), 0, 65535) \
    X(plate_heat_capacity_j_per_k, J_PER_K, 3, U32, 1, MODEL(plate_heat_capacity_mj_per_k), 0, 100000000) \
    X(plate_loss_w_per_k, W_PER_K, 6, U16, 1, MODEL(plate_loss_uw_per_k), 0, 65535) \
    X(wake_w_per_k, W_PER_K, 6, U16, 1, MODEL(wake_uw_per_k), 0, 65535) \
    X(wake_direction, NONE, 0, U8, 1, MODEL(wake_direction), 0, 3) \
    X(loss_scale, NONE, 3, U16, EACH_SPRING, MODEL(loss_scale_permille), 1, 65535) \
    X(heat_capacity_scale, NONE, 3, U16, EACH_SPRING, MODEL(heat_capacity_scale_permille), 1, 65535) \
    X(supply_v, V, 3, U16, 1, CURRENT(supply_mv), 1000, 16000) \
    X(freewheel_v, V, 3, U16, 1, CURRENT(freewheel_mv), 0, 1000) \
    X(shunt_ohm, OHM, 3, U16, 1, CURRENT(shunt_mohm), 0, 1000) \
    X(wiring_ohm, OHM, 3, U16, 1, CURRENT(wiring_mohm), 0, 1000) \
    X(current_integral, NONE, 3, U16, 1, CURRENT(integral_permille), 1, 1000) \
    X(current_slew_a_per_tick, A, 3, U16, 1, CURRENT(slew_ma_per_tick), 1, 3200) \
    X(maximum_current_a, A, 3, U16, 1, CURRENT(maximum_current_ma), 1, 3200) \
    X(maximum_duty_steps, NONE, 0, U16, 1, CURRENT(maximum_duty_steps), 1, 800) \
    X(current_trim_limit_ohm, OHM, 3, U16, 1, CURRENT(trim_limit_mohm), 0, 1000) \
    X(current_hold_ticks, NONE, 0, U8, 1, CURRENT(hold_ticks), 0, 250) \
    X(over_current_a, A, 3, U16, 1, SAFETY(over_current_ma), 100, 3200) \
    X(supply_limit_a, A, 3, U16, 1, SAFETY(supply_limit_ma), 100, 60000) \
    X(check_current_a, A, 3, U16, 1, SAFETY(check_current_ma), 50, 3200) \
    X(resistance_minimum_ohm, OHM, 3, U16, 1, SAFETY(resistance_minimum_mohm), 0, 10000) \
    X(resistance_maximum_ohm, OHM, 3, U16, 1, SAFETY(resistance_maximum_mohm), 0, 10000) \
    X(stuck_on_a, A, 3, U16, 1, SAFETY(stuck_on_ma), 10, 3200) \
    X(temperature_trip_c, DEG_C, 2, S16, 1, SAFETY(temperature_trip_cc), 0, 25000) \
    X(maximum_on_s, S, 0, U16, 1, SAFETY(maximum_on_s), 0, 65535) \
    X(fault_bad_samples, NONE, 0, U8, 1, SAFETY(bad_samples), 1, 250) \
    X(policy, NONE, 0, U8, 1, POLICY(policy), 0, 1) \
    X(open_current_a, A, 3, U16, 1, POLICY(open_current_ma), 0, 3200) \
    X(supply_reserve_a, A, 3, U16, 1, POLICY(supply_reserve_ma), 0, 10000) \
    X(ambient_c, DEG_C, 2, S16, 1, BOARD(ambient_cc), -4000, 8500) \
    X(ambient_source, NONE, 0, U8, 1, BOARD(ambient_source), 0, 1) \
    X(sensor_averaging, NONE, 0, U8, 1, BOARD(sensor_averaging), 8, 16) \
    X(telemetry_format, NONE, 0, U8, 1, BOARD(telemetry_format), 0, 2) \
    X(telemetry_hz, HZ, 0, U8, 1, BOARD(telemetry_hz), 1, 50) \
    X(boost_current_a, A, 3, U16, 1, POLICY(boost_current_ma), 100, 3200) \
    X(probe_current_a, A, 3, U16, 1, POLICY(probe_current_ma), 100, 1000) \
    X(dither_a, A, 3, U16, 1, POLICY(dither_ma), 0, 400) \
    X(hold_margin_k, K, 2, U16, 1, POLICY(hold_margin_cc), 50, 3000) \
    X(unsure_margin_k, K, 2, U16, 1, POLICY(unsure_margin_cc), 50, 5000) \
    X(search_k_per_s, K_PER_S, 3, U16, 1, POLICY(search_mk_per_s), 0, 1000) \
    X(observer, NONE, 0, U8, 1, POLICY(observer), 0, 1) \
    X(probe_period_s, S, 0, U8, 1, POLICY(probe_period_s), 0, 250) \
    X(temperature_limit_c, DEG_C, 2, S16, 1, POLICY(temperature_limit_cc), -4000, 20000) \
    X(temperature_band_k, K, 2, U16, 1, POLICY(temperature_band_cc), 100, 5000) \
    X(undriven_margin_k, K, 2, U16, 1, POLICY(undriven_margin_cc), 0, 5000) \
    X(overload_current_a, A, 3, U16, 1, POLICY(overload_current_ma), 100, 60000) \
    X(overload_time_s, S, 0, U16, 1, POLICY(overload_time_s), 1, 3000) \
    X(trip_time_s, S, 0, U16, 1, POLICY(trip_time_s), 0, 600)
/* clang-format on */

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

static const char units[UNIT_COUNT][SETTINGS_UNIT_SIZE] FLASH_MEMORY = {
    "", "J/K", "W/K", "1/K", "mm2", "J", "degC", "ohm", "V", "A", "s", "Hz", "K", "K/s"};

/* All names behind one another, each as long as it is. */
#define NAME_FIELD(name, ...)                                                                      \
    char name[sizeof #name <= SETTINGS_NAME_SIZE ? (int)sizeof #name : -1];
#define NAME_TEXT(name, ...) #name,
typedef struct {
    SETTINGS_TABLE(NAME_FIELD)
} names_t;
static const names_t names FLASH_MEMORY = {SETTINGS_TABLE(NAME_TEXT)};

/* settings_entry_t without what would be zeros in flash. */
typedef struct {
    uint16_t name; /* offset in names */
    uint16_t offset;
    int32_t maximum;
    int16_t minimum;
    uint8_t unit; /* unit_t */
    uint8_t decimals;
    uint8_t type;
    uint8_t count;
} row_t;

#define ROW(name_, unit_, decimals_, type_, count_, offset_, minimum_, maximum_)                   \
    {.name = (uint16_t)offsetof(names_t, name_),                                                   \
     .offset = (uint16_t)(offset_),                                                                \
     .maximum = (maximum_),                                                                        \
     .minimum = (minimum_),                                                                        \
     .unit = UNIT_##unit_,                                                                         \
     .decimals = (decimals_),                                                                      \
     .type = SETTINGS_##type_,                                                                     \
     .count = (count_)},
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
    flash_copy(&row, &table[index], sizeof row);
    const char *from = (const char *)&names + row.name;
    char *to = entry->name;
    do {
        *to = (char)flash_byte(from++);
    } while (*to++ != '\0');
    flash_copy(entry->unit, units[row.unit], sizeof entry->unit);
    entry->decimals = row.decimals;
    entry->type = row.type;
    entry->count = row.count;
    entry->offset = row.offset;
    entry->minimum = row.minimum;
    entry->maximum = row.maximum;
}

/* 1..count as written without leading zeros; 0 where it is no such number. */
static uint8_t element_number(const char *text, uint8_t count)
{
    uint16_t number = 0;
    if (*text == '0') {
        return 0;
    }
    for (; *text != '\0'; text++) {
        if (*text < '0' || *text > '9' || number > 25u) {
            return 0;
        }
        number = (uint16_t)(number * 10u + (uint16_t)(*text - '0'));
    }
    return number <= count ? (uint8_t)number : 0u;
}

bool settings_find(const char *name, uint8_t *index, uint8_t *element)
{
    settings_entry_t entry;
    for (uint8_t i = 0; i < TABLE_COUNT; i++) {
        settings_entry(i, &entry);
        const uint8_t length = (uint8_t)strlen(entry.name);
        if (strncmp(name, entry.name, length) != 0) {
            continue;
        }
        if (entry.count == 1) {
            if (name[length] != '\0') {
                continue;
            }
            *index = i;
            *element = 0;
            return true;
        }
        const uint8_t number =
            name[length] == '_' ? element_number(&name[length + 1u], entry.count) : 0u;
        if (number != 0) {
            *index = i;
            *element = (uint8_t)(number - 1u);
            return true;
        }
    }
    return false;
}

int32_t settings_get(const settings_t *settings, uint8_t index, uint8_t element)
{
    settings_entry_t entry;
    settings_entry(index, &entry);
    const uint8_t *const first = (const uint8_t *)settings + entry.offset;
    uint32_t wide;
    uint16_t narrow;
    switch (entry.type) {
    case SETTINGS_U8:
        return first[element];
    case SETTINGS_U32:
        memcpy(&wide, first + 4u * element, sizeof wide);
        return wide > (uint32_t)INT32_MAX ? INT32_MAX : (int32_t)wide;
    default:
        memcpy(&narrow, first + 2u * element, sizeof narrow);
        return entry.type == SETTINGS_S16 ? (int32_t)(int16_t)narrow : (int32_t)narrow;
    }
}

settings_result_t settings_set(settings_t *settings, uint8_t index, uint8_t element, int32_t value)
{
    settings_entry_t entry;
    settings_entry(index, &entry);
    if (value < entry.minimum || value > entry.maximum) {
        return SETTINGS_OUT_OF_RANGE;
    }
    uint8_t *const first = (uint8_t *)settings + entry.offset;
    const uint32_t wide = (uint32_t)value;
    const uint16_t narrow = (uint16_t)wide;
    switch (entry.type) {
    case SETTINGS_U8:
        first[element] = (uint8_t)wide;
        break;
    case SETTINGS_U32:
        memcpy(first + 4u * element, &wide, sizeof wide);
        break;
    default:
        memcpy(first + 2u * element, &narrow, sizeof narrow);
        break;
    }
    return SETTINGS_OK;
}

bool settings_find_offset(uint16_t offset, uint8_t *index, uint8_t *element)
{
    settings_entry_t entry;
    offset = (uint16_t)(offset + offsetof(settings_t, controller));
    for (uint8_t i = 0; i < TABLE_COUNT; i++) {
        settings_entry(i, &entry);
        const uint8_t width = entry.type == SETTINGS_U8 ? 1u : entry.type == SETTINGS_U32 ? 4u : 2u;
        uint16_t at = entry.offset;
        for (uint8_t k = 0; k < entry.count; k++) {
            if (at == offset) {
                *index = i;
                *element = k;
                return true;
            }
            at = (uint16_t)(at + width);
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
