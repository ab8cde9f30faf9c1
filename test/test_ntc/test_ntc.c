#include <math.h>

#include "../run_tests.h"
#include "ntc.h"

TEST(follows_the_b_equation)
{
    for (double celsius = -19.5; celsius < 79.5; celsius += 0.1) {
        const double ratio = exp(3950.0 * (1.0 / (celsius + 273.15) - 1.0 / 298.15));
        const uint16_t adc = (uint16_t)lround(1024.0 * ratio / (1.0 + ratio));
        int16_t temperature_c7 = 0;
        TEST_ASSERT_TRUE(ntc_temperature_c7(adc, &temperature_c7));
        TEST_ASSERT_DOUBLE_WITHIN(0.3, celsius, temperature_c7 / 128.0);
    }
}

TEST(a_broken_wire_is_no_temperature)
{
    int16_t temperature_c7 = 1234;
    TEST_ASSERT_FALSE(ntc_temperature_c7(0, &temperature_c7));
    TEST_ASSERT_FALSE(ntc_temperature_c7(1023, &temperature_c7));
    TEST_ASSERT_FALSE(ntc_temperature_c7(65535, &temperature_c7));
    TEST_ASSERT_EQUAL_INT16(1234, temperature_c7);
}
