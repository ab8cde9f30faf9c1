/* The sensor's registers against its data sheet (TI SBOS448G): no simulator, no firmware. How it
 * fails: board_faults. */
#include "ina219.h"

#include "../run_tests.h"

#define US                INA219_CYCLES_PER_US
#define CONFIG_8_SAMPLES  0x1DDFu /* 16 V, gain /8, 8 samples each, continuous */
#define CONFIG_TRIGGERED  0x199Bu /* 12 bit, shunt and bus, triggered */
#define PAIR_8_SAMPLES_US 8520u

static ina219_t sensor;
static ina219_inputs_t inputs;
static double shunt_v, bus_v;

/* Lets time pass at constant voltages, conversion by conversion. */
static void pass_us(uint64_t us)
{
    uint64_t end = inputs.cycle + us * US;
    while (inputs.cycle < end) {
        uint64_t next = sensor.conversion_end_cycle < end ? sensor.conversion_end_cycle : end;
        double cycles = (double)(next - inputs.cycle);
        inputs.shunt_v_cycles += shunt_v * cycles;
        inputs.bus_v_cycles += bus_v * cycles;
        inputs.cycle = next;
        if (next == sensor.conversion_end_cycle) {
            ina219_conversion_ended(&sensor, &inputs);
        }
    }
}

static void write_register(uint8_t number, uint16_t value)
{
    TEST_ASSERT_TRUE(ina219_begin(&sensor, false));
    ina219_write(&sensor, number, &inputs);
    ina219_write(&sensor, (uint8_t)(value >> 8), &inputs);
    ina219_write(&sensor, (uint8_t)value, &inputs);
}

static uint16_t read_register(uint8_t number)
{
    TEST_ASSERT_TRUE(ina219_begin(&sensor, false));
    ina219_write(&sensor, number, &inputs);
    TEST_ASSERT_TRUE(ina219_begin(&sensor, true));
    unsigned high = ina219_read(&sensor);
    return (uint16_t)(high << 8 | ina219_read(&sensor));
}

static int ready(void)
{
    return (read_register(INA219_REGISTER_BUS) >> 1) & 1;
}

void setUp(void)
{
    inputs = (ina219_inputs_t){0};
    shunt_v = 0.0;
    bus_v = 0.0;
    sensor = (ina219_t){0};
    ina219_power_on(&sensor, &inputs);
}

TEST(power_on_values_are_the_data_sheets)
{
    TEST_ASSERT_EQUAL_HEX16(0x399F, read_register(INA219_REGISTER_CONFIG));
    TEST_ASSERT_EQUAL_HEX16(0, read_register(INA219_REGISTER_CALIBRATION));
    TEST_ASSERT_EQUAL_HEX16(0, read_register(INA219_REGISTER_SHUNT));
    TEST_ASSERT_EQUAL_HEX16(0, read_register(INA219_REGISTER_BUS));
}

/* 10 uV and 4 mV, two's complement, ends by gain and range; with fewer bits coarser. */
TEST(results_are_in_the_data_sheets_steps_and_end_where_it_says)
{
    static const struct {
        uint16_t config;
        double shunt_v, bus_v;
        int16_t shunt;
        uint16_t bus;
    } table[] = {
        {0x399F, 0.1500049, 0.3281, 15000, 82}, {0x399F, -0.00123, 0.0, -123, 0},
        {0x199F, 1.0, 30.0, 32000, 4000}, /* 16 V, /8 */
        {0x219F, 1.0, 30.0, 4000, 7500},  /* 32 V, /1 */
        {0x1807, 0.00013, 0.0, 16, 0},    /* 9 bit */
    };
    for (size_t n = 0; n < ROWS(table); n++) {
        setUp();
        pass_us(2 * 532);
        TEST_ASSERT_TRUE(ready());
        write_register(INA219_REGISTER_CONFIG, table[n].config); /* begins anew */
        TEST_ASSERT_FALSE(ready());
        shunt_v = table[n].shunt_v;
        bus_v = table[n].bus_v;
        pass_us(2 * 532);
        TEST_ASSERT_EQUAL_INT16(table[n].shunt, (int16_t)read_register(INA219_REGISTER_SHUNT));
        TEST_ASSERT_EQUAL_UINT16(table[n].bus, read_register(INA219_REGISTER_BUS) >> 3);
    }
}

TEST(a_result_is_ready_at_its_true_time_and_not_before)
{
    write_register(INA219_REGISTER_CONFIG, CONFIG_8_SAMPLES);
    pass_us(PAIR_8_SAMPLES_US - 1);
    TEST_ASSERT_FALSE(ready());
    pass_us(1);
    TEST_ASSERT_TRUE(ready());
}

TEST(reading_the_power_register_clears_ready_and_reading_the_bus_does_not)
{
    pass_us(2 * 532);
    TEST_ASSERT_TRUE(ready());
    TEST_ASSERT_TRUE(ready());
    read_register(INA219_REGISTER_POWER);
    TEST_ASSERT_FALSE(ready());
    pass_us(2 * 532);
    TEST_ASSERT_TRUE(ready());
}

TEST(a_result_is_the_mean_over_its_own_window)
{
    write_register(INA219_REGISTER_CONFIG, CONFIG_8_SAMPLES);
    shunt_v = 0.1;
    pass_us(1065); /* a quarter of the shunt's 4260 us */
    shunt_v = 0.0;
    bus_v = 2.0; /* still the shunt's turn: the bus conversion has not begun */
    pass_us(4260 - 1065);
    bus_v = 1.0;
    shunt_v = 0.3;
    pass_us(4260);
    TEST_ASSERT_EQUAL_INT16(2500, (int16_t)read_register(INA219_REGISTER_SHUNT));
    TEST_ASSERT_EQUAL_UINT16(250, read_register(INA219_REGISTER_BUS) >> 3);
}

TEST(conversion_times_are_the_data_sheets)
{
    static const uint32_t expected_us[16] = {84,  148,  276,  532,  84,   148,   276,   532,
                                             532, 1060, 2130, 4260, 8510, 17020, 34050, 68100};
    for (uint8_t k = 0; k < 16; k++) {
        TEST_ASSERT_EQUAL_UINT32(expected_us[k], ina219_conversion_us(k));
    }
}

TEST(triggered_mode_converts_once)
{
    write_register(INA219_REGISTER_CONFIG, CONFIG_TRIGGERED);
    bus_v = 1.0;
    pass_us(2 * 532);
    TEST_ASSERT_TRUE(ready());
    bus_v = 2.0;
    pass_us(100000);
    TEST_ASSERT_EQUAL_UINT16(250, read_register(INA219_REGISTER_BUS) >> 3);
    TEST_ASSERT_EQUAL_UINT64(INA219_NEVER, sensor.conversion_end_cycle);
}

TEST(current_and_power_need_a_calibration)
{
    shunt_v = 0.15;
    bus_v = 0.32;
    pass_us(2 * 532);
    TEST_ASSERT_EQUAL_HEX16(0, read_register(INA219_REGISTER_CURRENT));
    write_register(INA219_REGISTER_CALIBRATION, 4096);
    pass_us(2 * 532);
    TEST_ASSERT_EQUAL_UINT16(15000, read_register(INA219_REGISTER_CURRENT));
    TEST_ASSERT_EQUAL_UINT16(15000u * 80u / 5000u, read_register(INA219_REGISTER_POWER));
}

TEST(an_impossible_calibration_sets_overflow)
{
    shunt_v = 0.3;
    bus_v = 4.0;
    write_register(INA219_REGISTER_CALIBRATION, 0xFFFF); /* its lowest bit is void */
    TEST_ASSERT_EQUAL_HEX16(0xFFFE, read_register(INA219_REGISTER_CALIBRATION));
    pass_us(2 * 532);
    TEST_ASSERT_EQUAL_UINT16(1, read_register(INA219_REGISTER_BUS) & 1u);
}

TEST(reset_bit_restores_the_power_on_values)
{
    write_register(INA219_REGISTER_CALIBRATION, 4096);
    write_register(INA219_REGISTER_CONFIG, 0x8000u | CONFIG_8_SAMPLES);
    TEST_ASSERT_EQUAL_HEX16(0x399F, read_register(INA219_REGISTER_CONFIG));
    TEST_ASSERT_EQUAL_HEX16(0, read_register(INA219_REGISTER_CALIBRATION));
}
