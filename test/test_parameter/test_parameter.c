/* Limits in a table: each type at and beyond its bounds, and which field is named. */
#include "parameter.h"

#include <unity.h>

typedef struct {
    uint8_t small;
    int16_t either;
    uint16_t plain;
    uint32_t wide;
} fields_t;

static const struct {
    parameter_range_t small, either, plain, wide;
} ranges FLASH_MEMORY = {PARAMETER_RANGE(fields_t, small, U8, 1, 250),
                         PARAMETER_RANGE(fields_t, either, S16, -3000, 20000),
                         PARAMETER_RANGE(fields_t, plain, U16, 10, 65535),
                         PARAMETER_RANGE(fields_t, wide, U32, 1, 16000)};

static fields_t fields;

void setUp(void)
{
    fields = (fields_t){.small = 1, .either = -3000, .plain = 10, .wide = 16000000};
}

void tearDown(void) {}

static void values_at_their_bounds_are_kept(void)
{
    uint16_t bad = 999;
    TEST_ASSERT_TRUE(parameter_check(&fields, &ranges, sizeof ranges, &bad));
    fields = (fields_t){.small = 250, .either = 20000, .plain = 65535, .wide = 1};
    TEST_ASSERT_TRUE(parameter_check(&fields, &ranges, sizeof ranges, &bad));
    TEST_ASSERT_EQUAL_UINT16(999, bad);
}

static void refused(size_t offset)
{
    uint16_t bad = 999;
    TEST_ASSERT_FALSE(parameter_check(&fields, &ranges, sizeof ranges, &bad));
    TEST_ASSERT_EQUAL_UINT16(offset, bad);
    TEST_ASSERT_FALSE(parameter_check(&fields, &ranges, sizeof ranges, NULL));
    setUp();
}

static void a_value_beyond_is_refused_and_its_field_is_named(void)
{
    fields.small = 0;
    refused(offsetof(fields_t, small));
    fields.small = 251;
    refused(offsetof(fields_t, small));
    fields.either = -3001;
    refused(offsetof(fields_t, either));
    fields.either = 20001;
    refused(offsetof(fields_t, either));
    fields.plain = 9;
    refused(offsetof(fields_t, plain));
    fields.wide = 0;
    refused(offsetof(fields_t, wide));
    fields.wide = 16000001;
    refused(offsetof(fields_t, wide));
    fields.wide = UINT32_MAX;
    refused(offsetof(fields_t, wide));
    fields.wide = 0;
    fields.either = 32767; /* the first one counts */
    refused(offsetof(fields_t, either));
}

static void what_is_set_is_read(void)
{
    parameter_set(&fields.small, PARAMETER_U8, 200);
    parameter_set(&fields.either, PARAMETER_S16, -2);
    parameter_set(&fields.plain, PARAMETER_U16, 60000);
    parameter_set(&fields.wide, PARAMETER_U32, 70000);
    TEST_ASSERT_EQUAL_UINT8(200, fields.small);
    TEST_ASSERT_EQUAL_INT16(-2, fields.either);
    TEST_ASSERT_EQUAL_UINT16(60000, fields.plain);
    TEST_ASSERT_EQUAL_UINT32(70000, fields.wide);
    TEST_ASSERT_EQUAL_INT32(200, parameter_get(&fields.small, PARAMETER_U8));
    TEST_ASSERT_EQUAL_INT32(-2, parameter_get(&fields.either, PARAMETER_S16));
    TEST_ASSERT_EQUAL_INT32(60000, parameter_get(&fields.plain, PARAMETER_U16));
    TEST_ASSERT_EQUAL_INT32(70000, parameter_get(&fields.wide, PARAMETER_U32));
    fields.wide = UINT32_MAX;
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, parameter_get(&fields.wide, PARAMETER_U32));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(values_at_their_bounds_are_kept);
    RUN_TEST(a_value_beyond_is_refused_and_its_field_is_named);
    RUN_TEST(what_is_set_is_read);
    return UNITY_END();
}
