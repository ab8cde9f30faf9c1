#include "text.h"

#include <stddef.h>

#define LARGEST     2147483647ul
#define MOST_DIGITS 10u

static const uint32_t powers[MOST_DIGITS] FLASH_MEMORY = {
    1ul, 10ul, 100ul, 1000ul, 10000ul, 100000ul, 1000000ul, 10000000ul, 100000000ul, 1000000000ul};

/* size = 10 size + digit. Fails if and only if that is above LARGEST; then size is as before. */
static bool append_digit(uint32_t *size, uint8_t digit)
{
    if (*size > LARGEST / 10u) {
        return false;
    }
    const uint32_t longer = *size * 10u + digit;
    if (longer > LARGEST) {
        return false;
    }
    *size = longer;
    return true;
}

text_result_t text_parse_decimal(const char *text, uint8_t decimals, int32_t *value)
{
    bool any_digit = false;
    bool point = false;
    bool fits = true;
    uint32_t size = 0;
    uint8_t missing = decimals;
    const bool negative = *text == '-';

    if (*text == '-' || *text == '+') {
        text++;
    }
    for (;; text++) {
        char digit = *text;
        if (digit == '.' && !point) {
            point = true;
            continue;
        }
        if (digit == '\0') { /* decimals that are not written are 0 */
            if (missing == 0) {
                break;
            }
            digit = '0';
            missing--;
            text--;
        } else if (digit < '0' || digit > '9') {
            return TEXT_NOT_A_NUMBER;
        } else {
            any_digit = true;
            if (point) {
                if (missing == 0) {
                    if (digit != '0') {
                        return TEXT_NOT_A_NUMBER; /* finer than wanted: not dropped silently */
                    }
                    continue;
                }
                missing--;
            }
        }
        fits = fits && append_digit(&size, (uint8_t)(digit - '0'));
    }
    if (!any_digit) {
        return TEXT_NOT_A_NUMBER;
    }
    if (!fits) {
        return TEXT_TOO_LARGE;
    }
    *value = negative ? -(int32_t)size : (int32_t)size;
    return TEXT_OK;
}

uint8_t text_format_decimal(int32_t value, uint8_t decimals, char *text)
{
    uint8_t length = 0;
    uint32_t rest = value < 0 ? 0u - (uint32_t)value : (uint32_t)value;
    uint32_t power;
    bool started = false;

    if (value < 0) {
        text[length++] = '-';
    }
    for (uint8_t place = MOST_DIGITS; place-- > 0;) {
        flash_copy(&power, &powers[place], sizeof power);
        char digit = '0';
        while (rest >= power) {
            rest -= power;
            digit++;
        }
        started = started || digit != '0' || place <= decimals;
        if (!started) {
            continue;
        }
        text[length++] = digit;
        if (place == decimals && decimals > 0) {
            text[length++] = '.';
        }
    }
    text[length] = '\0';
    return length;
}

void text_line_start(text_line_t *line, char *bytes, uint8_t size)
{
    line->bytes = bytes;
    line->size = size;
    line->length = 0;
}

void text_add_char(text_line_t *line, char character)
{
    if (line->length < line->size) {
        line->bytes[line->length++] = character;
    }
}

void text_add(text_line_t *line, const char *text)
{
    for (; *text != '\0'; text++) {
        text_add_char(line, *text);
    }
}

void text_add_flash(text_line_t *line, const char *text)
{
    text_add_values(line, text, NULL);
}

void text_add_decimal(text_line_t *line, int32_t value, uint8_t decimals)
{
    char digits[TEXT_DECIMAL_SIZE];
    text_format_decimal(value, decimals, digits);
    text_add(line, digits);
}

void text_add_values(text_line_t *line, const char *text, const int32_t values[])
{
    for (;; text++) {
        const char character = (char)flash_byte(text);
        if (character == '\0') {
            return;
        }
        if (character == '#' && values != NULL) {
            text++;
            text_add_decimal(line, *values++, (uint8_t)(flash_byte(text) - '0'));
        } else {
            text_add_char(line, character);
        }
    }
}

void text_time_add(text_time_t *time, uint32_t by_ms)
{
    const uint32_t ms = time->ms + (by_ms < UINT32_MAX - 999u ? by_ms : UINT32_MAX - 999u);
    if (ms < 1000u) {
        time->ms = (uint16_t)ms;
        return;
    }
    time->s += ms / 1000u;
    time->ms = (uint16_t)(ms % 1000u);
}

static void add_thousandths(text_line_t *line, uint16_t ms)
{
    char digits[TEXT_DECIMAL_SIZE];
    text_format_decimal(1000 + (int32_t)ms, 0, digits); /* with its leading zeros */
    text_add(line, digits + 1);
}

void text_add_time_s(text_line_t *line, const text_time_t *time)
{
    text_add_decimal(line, (int32_t)(time->s & LARGEST), 0);
    text_add_char(line, '.');
    add_thousandths(line, time->ms);
}

void text_add_time_ms(text_line_t *line, const text_time_t *time)
{
    if (time->s == 0) {
        text_add_decimal(line, time->ms, 0);
        return;
    }
    text_add_decimal(line, (int32_t)(time->s & LARGEST), 0);
    add_thousandths(line, time->ms);
}

const char *text_item(const char *texts, uint8_t index)
{
    while (index > 0) {
        if (flash_byte(texts++) == '\0') {
            index--;
        }
    }
    return texts;
}

/* Kept out of its callers: measured to be smaller. */
int16_t text_centi_from_c7(int16_t temperature_c7)
{
    return (int16_t)(((int32_t)temperature_c7 * 25 + 16) >> 5); /* x 100 / 128 */
}
