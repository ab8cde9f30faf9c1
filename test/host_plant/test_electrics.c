#include "../run_tests.h"
#include <math.h>

#include "electrics.h"

TEST(compare_register_zero_is_a_pulse_of_one_clock)
{
    TEST_ASSERT_EQUAL_DOUBLE(0.0, electrics_pwm_fraction(false, 0, 799));
    TEST_ASSERT_EQUAL_DOUBLE(1.0 / 800.0, electrics_pwm_fraction(true, 0, 799));
    TEST_ASSERT_EQUAL_DOUBLE(0.5, electrics_pwm_fraction(true, 399, 799));
    TEST_ASSERT_EQUAL_DOUBLE(1.0, electrics_pwm_fraction(true, 799, 799));
    TEST_ASSERT_EQUAL_DOUBLE(1.0, electrics_pwm_fraction(true, 800, 799));
    TEST_ASSERT_EQUAL_DOUBLE(1.0, electrics_pwm_fraction(true, 5000, 799));
}

TEST(mean_current_follows_from_the_loop)
{
    /* 5 V, 0.219 + 0.18 ohm: full duty 12.5 A; one step of 800 is 15.7 mA */
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 5.0 / 0.399,
                              electrics_buck_current_a(1.0, 5.0, 0.0, 0.219, 0.18));
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0.01566,
                              electrics_buck_current_a(1.0 / 800, 5.0, 0.0, 0.219, 0.18));
    /* a diode takes its drop for the rest of the period */
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, (0.2 * 5.0 - 0.8 * 0.4) / 0.4,
                              electrics_buck_current_a(0.2, 5.0, 0.4, 0.22, 0.18));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, electrics_buck_current_a(0.05, 5.0, 0.4, 0.22, 0.18));
}

TEST(supply_sags_to_where_source_and_load_agree)
{
    const double v = electrics_supply_v(5.0, 0.2, 0.5, 2.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, v, 5.0 - 0.2 * (0.5 * v + 2.0 / v));
    TEST_ASSERT_EQUAL_DOUBLE(5.0, electrics_supply_v(5.0, 0.0, 3.0, 50.0));
    /* more than the source can give: it stays at the voltage of greatest power */
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 2.5, electrics_supply_v(5.0, 1.0, 0.0, 100.0));
}

TEST(registers_have_the_data_sheets_steps_and_ends)
{
    TEST_ASSERT_EQUAL_INT16(15000, electrics_ina219_shunt_register(1.5));
    TEST_ASSERT_EQUAL_INT16(1, electrics_ina219_shunt_register(0.00014));
    TEST_ASSERT_EQUAL_INT16(2, electrics_ina219_shunt_register(0.00016));
    TEST_ASSERT_EQUAL_INT16(-2, electrics_ina219_shunt_register(-0.00016));
    TEST_ASSERT_EQUAL_INT16(0, electrics_ina219_shunt_register(0.00004));
    TEST_ASSERT_EQUAL_INT16(32000, electrics_ina219_shunt_register(3.2));
    TEST_ASSERT_EQUAL_INT16(32000, electrics_ina219_shunt_register(12.5));
    TEST_ASSERT_EQUAL_INT16(-32000, electrics_ina219_shunt_register(-12.5));
    TEST_ASSERT_EQUAL_UINT16(82, electrics_ina219_bus_register(0.3285));
    TEST_ASSERT_EQUAL_UINT16(83, electrics_ina219_bus_register(0.3305));
    TEST_ASSERT_EQUAL_UINT16(4000, electrics_ina219_bus_register(30.0));
    TEST_ASSERT_EQUAL_UINT16(0, electrics_ina219_bus_register(-1.0));
}

TEST(sensor_reports_the_mean_over_its_own_windows)
{
    electrics_ina219_t sensor;
    double current, voltage;
    TEST_ASSERT_TRUE(electrics_ina219_init(&sensor, 8, 0.0, 0.0, 1));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 2 * 8 * 532e-6, electrics_ina219_period_s(&sensor));
    const double window = 8 * 532e-6;
    electrics_ina219_advance(&sensor, 0.5 * window, 2.0, 9.0);
    electrics_ina219_advance(&sensor, 0.5 * window, 1.0, 9.0); /* shunt window: mean 1.5 A */
    TEST_ASSERT_FALSE(electrics_ina219_take(&sensor, &current, &voltage));
    electrics_ina219_advance(&sensor, window, 3.0, 0.4);
    TEST_ASSERT_TRUE(electrics_ina219_take(&sensor, &current, &voltage));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1.5, current);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.4, voltage);
    TEST_ASSERT_FALSE(electrics_ina219_take(&sensor, &current, &voltage));
}

TEST(averaging_takes_the_root_of_n_off_the_noise)
{
    double spread[2], bus_spread[2];
    for (int k = 0; k < 2; k++) {
        electrics_ina219_t sensor;
        TEST_ASSERT_TRUE(electrics_ina219_init(&sensor, k ? 16 : 1, 1e-3, 0.1, 7));
        double sum = 0.0, squares = 0.0, bus_squares = 0.0;
        for (int n = 0; n < 4000; n++) {
            double current, voltage;
            electrics_ina219_advance(&sensor, 1.0000001 * electrics_ina219_period_s(&sensor), 1.5,
                                     3.0);
            electrics_ina219_take(&sensor, &current, &voltage);
            sum += current - 1.5;
            squares += (current - 1.5) * (current - 1.5);
            bus_squares += (voltage - 3.0) * (voltage - 3.0);
        }
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0.0, sum / 4000);
        spread[k] = sqrt(squares / 4000);
        bus_spread[k] = sqrt(bus_squares / 4000);
    }
    TEST_ASSERT_DOUBLE_WITHIN(3e-3, 0.1, bus_spread[0]);
    TEST_ASSERT_DOUBLE_WITHIN(0.3, 4.0, bus_spread[0] / bus_spread[1]);
    TEST_ASSERT_DOUBLE_WITHIN(3e-4, 0.01, spread[0]); /* 1 mV over 0.1 ohm */
    TEST_ASSERT_DOUBLE_WITHIN(0.3, 4.0, spread[0] / spread[1]);
}

TEST(same_seed_gives_the_same_noise)
{
    electrics_noise_t a, b, c;
    electrics_noise_seed(&a, 5);
    electrics_noise_seed(&b, 5);
    electrics_noise_seed(&c, 6);
    bool differs = false;
    for (int k = 0; k < 100; k++) {
        const double x = electrics_noise_normal(&a);
        TEST_ASSERT_TRUE(x == electrics_noise_normal(&b));
        differs = differs || x != electrics_noise_normal(&c);
    }
    TEST_ASSERT_TRUE(differs);
}

TEST(bad_sensor_settings_are_refused)
{
    electrics_ina219_t sensor;
    TEST_ASSERT_FALSE(electrics_ina219_init(&sensor, 0, 0, 0, 1));
    TEST_ASSERT_FALSE(electrics_ina219_init(&sensor, 12, 0, 0, 1));
    TEST_ASSERT_FALSE(electrics_ina219_init(&sensor, 256, 0, 0, 1));
    TEST_ASSERT_FALSE(electrics_ina219_init(&sensor, 8, -1e-6, 0, 1));
    TEST_ASSERT_FALSE(electrics_ina219_init(&sensor, 8, 0, (double)NAN, 1));
    TEST_ASSERT_FALSE(electrics_ina219_init(&sensor, 8, (double)INFINITY, 0, 1));
}
