#include "settings.h"

#include <stddef.h>
#include <string.h>

#include "text.h"

void settings_default(settings_t *settings)
{
    memset(settings, 0, sizeof *settings);
    controller_settings_default(&settings->controller);
    board_settings_default(&settings->board);
}

/* Where the part's struct begins in settings_t. */
static size_t offset_of(uint8_t part)
{
    switch (part) {
    case PARAMETER_PART_MODEL:
        return offsetof(settings_t, controller.model);
    case PARAMETER_PART_CURRENT:
        return offsetof(settings_t, controller.current);
    case PARAMETER_PART_SAFETY:
        return offsetof(settings_t, controller.safety);
    case PARAMETER_PART_POLICY:
        return offsetof(settings_t, controller.policy);
    default:
        return offsetof(settings_t, board);
    }
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

bool settings_find(const char *name, uint16_t *row, uint8_t *element)
{
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        const parameter_row_t known = parameter_row(k);
        const size_t length = strlen(known.name);
        if (strncmp(name, known.name, length) != 0) {
            continue;
        }
        const char *const rest = name + length;
        uint8_t number = *rest == '\0';
        if (known.count > 1) {
            number = *rest == '_' ? element_number(rest + 1, known.count) : 0u;
        }
        if (number != 0) {
            *row = k;
            *element = (uint8_t)(number - 1u);
            return true;
        }
    }
    return false;
}

void settings_name(uint16_t row, uint8_t element, char name[SETTINGS_NAME_SIZE])
{
    const parameter_row_t known = parameter_row(row);
    text_line_t line;
    text_line_start(&line, name, SETTINGS_NAME_SIZE - 1);
    text_add(&line, known.name);
    if (known.count > 1) {
        text_add_char(&line, '_');
        text_add_decimal(&line, element + 1, 0);
    }
    name[line.length] = '\0';
}

int32_t settings_get(const settings_t *settings, uint16_t row, uint8_t element)
{
    const parameter_row_t known = parameter_row(row);
    return parameter_get((const uint8_t *)settings + offset_of(known.part), &known, element);
}

settings_result_t settings_set(settings_t *settings, uint16_t row, uint8_t element, int32_t value)
{
    const parameter_row_t known = parameter_row(row);
    if (value < known.minimum || value > known.maximum) {
        return SETTINGS_OUT_OF_RANGE;
    }
    parameter_set((uint8_t *)settings + offset_of(known.part), &known, element, value);
    return SETTINGS_OK;
}

settings_result_t settings_assign(settings_t *settings, const char *name, const char *value)
{
    uint16_t row;
    uint8_t element;
    int32_t number;
    if (!settings_find(name, &row, &element)) {
        return SETTINGS_UNKNOWN_NAME;
    }
    switch (text_parse_decimal(value, parameter_row(row).decimals, &number)) {
    case TEXT_OK:
        return settings_set(settings, row, element, number);
    case TEXT_TOO_LARGE:
        return SETTINGS_OUT_OF_RANGE;
    default:
        return SETTINGS_NOT_A_NUMBER;
    }
}
