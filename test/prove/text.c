/* sources: lib/text/text.c */
#include "text.h"

#include "prove.h"

#define WORD 16

static void in(void)
{
    char word[WORD];
    int32_t value;
    for (uint8_t k = 0; k + 1 < WORD; k++) {
        word[k] = (char)any_u8();
    }
    word[WORD - 1] = '\0';
    (void)text_parse_decimal(word, (uint8_t)any_between(0, 9), &value);
}

static void out(void)
{
    char digits[TEXT_DECIMAL_SIZE], bytes[32];
    text_line_t line;
    text_time_t time = {any_u32(), (uint16_t)any_between(0, 999)};
    const int32_t values[2] = {any_s32(), any_s32()};
    for (uint8_t decimals = 0; decimals <= 9; decimals++) {
        (void)text_format_decimal(any_s32(), decimals, digits);
    }
    text_line_start(&line, bytes, (uint8_t)any_between(0, sizeof bytes));
    while (any_bool()) {
        text_add_char(&line, (char)any_u8());
        text_add_decimal(&line, any_s32(), 0);
        text_add_decimal(&line, any_s32(), 3);
        text_add_decimal(&line, any_s32(), 9);
        text_add_values(&line, FLASH_TEXT("a #0 and #3"), values);
        text_add_flash(&line, FLASH_TEXT("b"));
        text_time_add(&time, any_u32());
        text_add_time_s(&line, &time);
        text_add_time_ms(&line, &time);
    }
    (void)text_item("none\0one\0two", (uint8_t)any_between(0, 2));
    (void)text_centi_from_c7(any_s16());
}

void main(void)
{
    in();
    out();
}
