#include "../run_tests.h"
#include "fixed_point.h"

static uint32_t random_state = 7;

static uint32_t random_bits(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 17;
    random_state ^= random_state << 5;
    return random_state;
}

TEST(products_accumulate_modulo_2_32)
{
    TEST_ASSERT_EQUAL_UINT32(7u + 65535u * 65535u, fixed_point_mac_u16(7, 65535, 65535));
    TEST_ASSERT_EQUAL_UINT32(0, fixed_point_mac_u16(0xffffffffu, 1, 1));
    TEST_ASSERT_EQUAL_INT32(-32768 * 65535, (int32_t)fixed_point_mac_s16_u16(0, INT16_MIN, 65535));
    TEST_ASSERT_EQUAL_INT32(-1, (int32_t)fixed_point_mac_s16_u16(0, -1, 1));
}

TEST(scale_rounds_to_the_nearest)
{
    TEST_ASSERT_EQUAL_INT32(0, fixed_point_scale_q31(0, INT32_MAX));
    TEST_ASSERT_EQUAL_INT32(1, fixed_point_scale_q31(1, 0x40000000));
    TEST_ASSERT_EQUAL_INT32(0, fixed_point_scale_q31(1, 0x3fffffff));
    TEST_ASSERT_EQUAL_INT32(0, fixed_point_scale_q31(-1, 0x40000000));
    TEST_ASSERT_EQUAL_INT32(-1, fixed_point_scale_q31(-1, 0x40000001));
    TEST_ASSERT_EQUAL_INT32(INT32_MIN + 1, fixed_point_scale_q31(INT32_MIN, INT32_MAX));
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, fixed_point_scale_q31(INT32_MIN, -INT32_MAX));
}

TEST(add_holds_at_the_ends)
{
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, fixed_point_add_saturated(INT32_MAX, 1));
    TEST_ASSERT_EQUAL_INT32(INT32_MIN, fixed_point_add_saturated(INT32_MIN, -1));
    TEST_ASSERT_EQUAL_INT32(INT32_MIN, fixed_point_add_saturated(INT32_MIN, INT32_MIN));
    TEST_ASSERT_EQUAL_INT32(-1, fixed_point_add_saturated(INT32_MAX, INT32_MIN));
}

TEST(multiply_divide_rounds_and_says_what_does_not_fit)
{
    TEST_ASSERT_EQUAL_UINT32(3, fixed_point_multiply_divide(5, 1, 2));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, fixed_point_multiply_divide(1, 1, 0));
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, fixed_point_multiply_divide(65536, 65536, 1));
    TEST_ASSERT_EQUAL_UINT32(0, fixed_point_multiply_divide(0, 1234, 5));
    for (int k = 0; k < 100000; k++) {
        uint32_t a = random_bits() >> (k % 31);
        uint32_t b = random_bits() >> (k % 29);
        uint32_t c = 1u + (random_bits() >> (1 + k % 23));
        uint64_t exact = ((uint64_t)a * b + c / 2u) / c;
        uint32_t wanted = exact > UINT32_MAX ? UINT32_MAX : (uint32_t)exact;
        TEST_ASSERT_EQUAL_UINT32(wanted, fixed_point_multiply_divide(a, b, c));
    }
}
