#include <stdio.h>
#include <string.h>

#include "../run_tests.h"
#include "text.h"

TEST(formats_fixed_decimals)
{
    static const struct {
        int32_t value;
        uint8_t decimals;
        const char *text;
    } cases[] = {{0, 0, "0"},
                 {0, 3, "0.000"},
                 {5, 3, "0.005"},
                 {-5, 3, "-0.005"},
                 {5800, 6, "0.005800"},
                 {1234567, 3, "1234.567"},
                 {INT32_MAX, 0, "2147483647"},
                 {INT32_MIN, 0, "-2147483648"},
                 {INT32_MIN, 9, "-2.147483648"}};
    for (unsigned i = 0; i < ROWS(cases); i++) {
        char text[TEXT_DECIMAL_SIZE];
        TEST_ASSERT_EQUAL_UINT8(strlen(cases[i].text),
                                text_format_decimal(cases[i].value, cases[i].decimals, text));
        TEST_ASSERT_EQUAL_STRING(cases[i].text, text);
    }
}

TEST(refuses_what_is_no_number)
{
    static const char *const bad[] = {"",   "-",  "+",   ".",      "1.2.3", "1e3", "0x1",   "nan",
                                      " 1", "1 ", "--1", "1.2345", "1,5",   "inf", "1.0001"};
    for (unsigned i = 0; i < ROWS(bad); i++) {
        int32_t value = 77;
        TEST_ASSERT_EQUAL_MESSAGE(TEXT_NOT_A_NUMBER, text_parse_decimal(bad[i], 3, &value), bad[i]);
        TEST_ASSERT_EQUAL_INT32(77, value);
    }
    int32_t value = 77;
    TEST_ASSERT_EQUAL(TEXT_TOO_LARGE, text_parse_decimal("2147483648", 0, &value));
    TEST_ASSERT_EQUAL(TEXT_TOO_LARGE, text_parse_decimal("2147484", 3, &value));
    TEST_ASSERT_EQUAL(TEXT_TOO_LARGE, text_parse_decimal("99999999999999999999", 0, &value));
    TEST_ASSERT_EQUAL_INT32(77, value);
    TEST_ASSERT_EQUAL(TEXT_OK, text_parse_decimal("2147483647", 0, &value));
    TEST_ASSERT_EQUAL(TEXT_OK, text_parse_decimal("+1.5000000", 3, &value));
    TEST_ASSERT_EQUAL_INT32(1500, value);
}

TEST(a_full_line_is_cut_not_overrun)
{
    char bytes[9];
    text_line_t line;
    memset(bytes, '#', sizeof bytes);
    text_line_start(&line, bytes, 8);
    text_add(&line, "abc");
    text_add_decimal(&line, -12345, 2);
    text_add_char(&line, 'x');
    TEST_ASSERT_EQUAL_UINT8(8, line.length);
    TEST_ASSERT_EQUAL_STRING_LEN("abc-123.#", bytes, 9);
}

TEST(values_stand_where_the_text_has_marks)
{
    char bytes[40] = {0};
    text_line_t line;
    const int32_t values[] = {-5, 1234, 7};
    text_line_start(&line, bytes, sizeof bytes - 1u);
    text_add_values(&line, FLASH_TEXT("#0|t:#3 s, #1%"), values);
    text_add_flash(&line, FLASH_TEXT(" #1"));
    TEST_ASSERT_EQUAL_STRING("-5|t:1.234 s, 0.7% #1", bytes);
}

TEST(an_item_is_found_by_counting)
{
    static const char texts[] FLASH_MEMORY = "one\0\0three";
    TEST_ASSERT_EQUAL_STRING("one", text_item(texts, 0));
    TEST_ASSERT_EQUAL_STRING("", text_item(texts, 1));
    TEST_ASSERT_EQUAL_STRING("three", text_item(texts, 2));
}

TEST(q97_becomes_hundredths)
{
    TEST_ASSERT_EQUAL_INT16(2000, text_centi_from_c7(20 * 128));
    TEST_ASSERT_EQUAL_INT16(-4000, text_centi_from_c7(-40 * 128));
    TEST_ASSERT_EQUAL_INT16(1, text_centi_from_c7(1));
    TEST_ASSERT_EQUAL_INT16(21500, text_centi_from_c7(215 * 128));
}
