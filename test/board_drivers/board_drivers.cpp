/* Both current sensor drivers, the Adafruit library's and the small integer one, do the same to the
 * same sensors. */
#include "board_test.h"

using namespace board_test;

namespace
{

struct pair {
    pair() : integer(elf("firmware.elf")), adafruit(elf("firmware_adafruit.elf"))
    {
        for (rig *mega : both) {
            mega->boot();
            mega->expect_ok("pattern 101010101");
            mega->run_ms(800.0);
        }
    }
    rig integer;
    rig adafruit;
    rig *both[2] = {&integer, &adafruit};
};

TEST(the_registers_that_they_write_and_the_readings_that_they_give_are_the_same)
{
    pair drivers;
    const board_view_t integer = drivers.integer.view();
    const board_view_t adafruit = drivers.adafruit.view();
    for (unsigned k = 0; k < BOARD_CHANNELS; ++k) {
        for (const unsigned number : {0U, 5U}) { /* configuration, calibration */
            TEST_ASSERT_EQUAL_HEX16(board_sensor_register(drivers.integer.raw(), k, number),
                                    board_sensor_register(drivers.adafruit.raw(), k, number));
        }
        /* a duty step is 14 mA and is dithered: the two may be at different steps of it */
        TEST_ASSERT_INT_WITHIN(20, integer.spring[k].measured_ma, adafruit.spring[k].measured_ma);
        TEST_ASSERT_INT_WITHIN(8, integer.spring[k].measured_mv, adafruit.spring[k].measured_mv);
        TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_NONE, adafruit.spring[k].fault);
    }
}

/* Each kind of failure gets the same name from both, and then the bus is stuck. */
TEST(the_failures_that_they_report_are_the_same)
{
    pair drivers;
    for (rig *mega : drivers.both) {
        board_set_fault(mega->raw(), BOARD_FAULT_NACK, 0, true);
        board_set_fault(mega->raw(), BOARD_FAULT_STALE, 2, true);
        board_reset_sensor(mega->raw(), 4);
        mega->run_ms(1000.0);
        const board_view_t seen = mega->view();
        for (unsigned k = 0; k < BOARD_CHANNELS; ++k) {
            TEST_ASSERT_EQUAL_UINT8(k == 0   ? SAFETY_FAULT_SENSOR_ABSENT
                                    : k == 2 ? SAFETY_FAULT_SENSOR_STALE
                                             : SAFETY_FAULT_NONE,
                                    seen.spring[k].fault);
        }
        board_set_fault(mega->raw(), BOARD_FAULT_SDA_LOW, 0, true);
        mega->run_ms(1500.0);
        TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_SENSOR_BUS, mega->view().spring[4].fault);
        TEST_ASSERT_EQUAL_UINT(0, board_reset_count(mega->raw()));
        TEST_ASSERT_TRUE(board_all_off(mega->raw()));
    }
}

} // namespace
