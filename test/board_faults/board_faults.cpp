/* Each thing that a scenario can break, and what the firmware makes of it. */
#include "board_test.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <vector>

using namespace board_test;

namespace
{

constexpr double TICK_MS = CONTROLLER_TICK_MS;

std::unique_ptr<rig> driven()
{
    auto mega = std::make_unique<rig>();
    mega->boot();
    mega->expect_ok("on all");
    mega->run_ms(600.0);
    const board_view_t seen = mega->view();
    for (unsigned k = 0; k < BOARD_CHANNELS; ++k) {
        TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_NONE, seen.spring[k].fault);
        TEST_ASSERT_TRUE(board_duty(mega->raw(), k) > 0.0);
    }
    return mega;
}

/* That spring has the fault and is off; the others are as they were. */
void only(rig &mega, unsigned spring, safety_fault_t fault)
{
    const board_view_t seen = mega.view();
    for (unsigned k = 0; k < BOARD_CHANNELS; ++k) {
        const int wanted = k == spring ? fault : SAFETY_FAULT_NONE;
        here("spring %u", k + 1);
        TEST_ASSERT_EQUAL_INT(wanted, seen.spring[k].fault);
        TEST_ASSERT_EQUAL_INT(k != spring, board_duty(mega.raw(), k) > 0.0);
    }
}

/* And in a sensor that fails, no failed read becomes a number. */
TEST(each_fault_is_of_its_spring_and_its_neighbours_go_on)
{
    static const struct {
        board_fault_t fault;
        unsigned spring;
        double ms;
        std::initializer_list<safety_fault_t> named;
    } table[] = {
        {BOARD_FAULT_OPEN, 4, 1000.0, {SAFETY_FAULT_OPEN_SPRING}},
        {BOARD_FAULT_SHORT, 0, 500.0, {SAFETY_FAULT_SHORT_SPRING, SAFETY_FAULT_OVER_CURRENT}},
        {BOARD_FAULT_NACK, 8, 1000.0, {SAFETY_FAULT_SENSOR_ABSENT}},
        {BOARD_FAULT_STALE, 3, 1000.0, {SAFETY_FAULT_SENSOR_STALE}},
    };
    auto mega = driven();
    const auto has_its_fault = [&mega](const auto &one) {
        const auto &spring = [&] { return mega->view().spring[one.spring]; };
        const int before_ma = spring().measured_ma;
        TEST_ASSERT_TRUE(before_ma > 1000);
        board_set_fault(mega->raw(), one.fault, one.spring, true);
        for (double ms = 0.0; ms < one.ms; ms += TICK_MS) {
            mega->run_ms(TICK_MS);
            if (one.fault == BOARD_FAULT_NACK && ms < 20 * TICK_MS) {
                TEST_ASSERT_INT_WITHIN(100, before_ma, spring().measured_ma);
            }
        }
        const auto fault = static_cast<safety_fault_t>(spring().fault);
        TEST_ASSERT_TRUE(std::find(one.named.begin(), one.named.end(), fault) != one.named.end());
        only(*mega, one.spring, fault);
    };
    for (const auto &one : table) {
        try_from_here([&] { has_its_fault(one); });
    }
    board_scale_sensor(mega->raw(), 4, 0.5, 0.5);
    mega->run_ms(3000.0);
    only(*mega, 4, SAFETY_FAULT_SENSOR_MISMATCH);
}

/* No current and no voltage: of a wire ahead of the sensor, too. Fault 2 names both. */
TEST(a_sensor_that_hung_at_none_is_said_with_the_broken_wire_that_it_looks_like)
{
    rig mega;
    mega.boot_niti({"policy precompensate", "on 1"});
    board_set_fault(mega.raw(), BOARD_FAULT_FREEZE, 4, true);
    mega.run_ms(1000.0);
    mega.expect_ok("on 5");
    mega.run_ms(1500.0);
    const board_view_t seen = mega.view();
    TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_OPEN_SPRING, seen.spring[4].fault);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, board_duty(mega.raw(), 4));
    TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_NONE, seen.spring[0].fault);
}

double shown_a(rig &mega, unsigned k)
{
    return 1e-4 * static_cast<std::int16_t>(board_sensor_register(mega.raw(), k, 1));
}

/* Of a frozen one, or one that lies, the tests below show it by what is found. */
TEST(swapped_sensors_show_each_others_current)
{
    auto mega = driven();
    mega->expect_ok("off 8");
    mega->run_ms(400.0);
    board_swap_sensors(mega->raw(), 7, 8);
    mega->run_ms(20.0); /* two pairs of conversions */
    TEST_ASSERT_EQUAL_DOUBLE(0.0, shown_a(*mega, 8));
    TEST_ASSERT_TRUE(shown_a(*mega, 7) > 0.5);
    board_swap_sensors(mega->raw(), 7, 8);
    mega->run_ms(20.0);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, shown_a(*mega, 7));
}

/* The policy sweeps the current; the sensor, or one of its registers, answers, converts, and shows
 * the same for ever: while it heats, and in a hold. Below what a fault needs, it costs nothing. */
TEST(a_frozen_sensor_is_found_in_two_seconds_and_readings_that_are_lost_cost_nothing)
{
    rig mega;
    mega.boot_niti({"policy precompensate", "on 1", "on 5"});
    static const struct {
        double more_ms;
        std::uint8_t stage;
    } table[] = {{4000.0, DRIVE_POLICY_STAGE_HEAT}, {31000.0, DRIVE_POLICY_STAGE_HOLD}};
    for (const auto &[more_ms, stage] : table) {
        mega.run_ms(more_ms);
        TEST_ASSERT_EQUAL_UINT8(stage, mega.view().spring[4].stage);
        for (const board_fault_t fault :
             {BOARD_FAULT_FREEZE, BOARD_FAULT_FREEZE_CURRENT, BOARD_FAULT_FREEZE_VOLTAGE}) {
            try_from_here([&] {
                TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_NONE, mega.view().spring[4].fault);
                board_set_fault(mega.raw(), fault, 4, true);
                mega.run_ms(2000.0);
                const board_view_t seen = mega.view();
                here("fault %d after %.0f ms more", fault, more_ms);
                TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_SENSOR_MISMATCH, seen.spring[4].fault);
                TEST_ASSERT_EQUAL_DOUBLE(0.0, board_duty(mega.raw(), 4));
                TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_NONE, seen.spring[0].fault);
                TEST_ASSERT_TRUE(board_duty(mega.raw(), 0) > 0.0);
            });
        }
    }
    for (int n = 0; n < 30; ++n) {
        const board_fault_t fault = n % 2 == 0 ? BOARD_FAULT_NACK : BOARD_FAULT_STALE;
        board_set_fault(mega.raw(), fault, 4, true);
        mega.run_ms(TICK_MS);
        board_set_fault(mega.raw(), fault, 4, false);
        mega.run_ms(4 * TICK_MS);
    }
    TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_NONE, mega.view().spring[4].fault);
    TEST_ASSERT_EQUAL_UINT8(DRIVE_POLICY_STAGE_HOLD, mega.view().spring[4].stage);
    TEST_ASSERT_TRUE(phase(mega, 4) >= 0.98 && hottest_c(mega) < 100.0);
}

/* Half of the shunt, as R050 for R100. */
TEST(another_shunt_is_found_as_its_spring_begins_to_heat)
{
    auto mega = std::make_unique<rig>();
    mega->boot_niti();
    board_scale_sensor(mega->raw(), 4, 0.5, 1.0);
    mega->expect_ok("model cold");
    mega->expect_ok("policy precompensate");
    mega->expect_ok("on 1");
    mega->expect_ok("on 5");
    mega->run_ms(4000.0);
    TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_SENSOR_MISMATCH, mega->view().spring[4].fault);
    TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_NONE, mega->view().spring[0].fault);
    TEST_ASSERT_TRUE(plant_temperature_c(mega->plant.get(), 4) < 60.0);
}

/* It has been sound, and shows a part of one of its numbers from some moment of a heating or a hold
 * on: no resistance is out of its limits, but beside the others it takes another share of the
 * supply than it did. Who clears the fault has mended nothing: heated, it is found again; with the
 * little current of a probe it may not be, and stays cool. */
TEST(a_sensor_that_begins_to_lie_is_found_beside_the_others_however_often_it_is_cleared)
{
    struct lie {
        double current, voltage;
    };
    static const struct {
        const char *pattern;
        double at_ms[2];
        std::vector<lie> lies[2];
    } table[] = {{"pattern 111101111",
                  {4000.0, 70e3},
                  {{{0.52, 1.0}, {1.0, 0.5}, {1.0, 0.8}}, {{0.52, 1.0}, {0.8, 1.0}}}},
                 {"pattern 100000000", {4000.0}, {{{0.8, 1.0}}}}};
    for (const auto &one : table) {
        rig mega;
        mega.boot_niti({"policy precompensate", one.pattern});
        const auto lies = [&](double at_ms, const lie &lie) {
            board_scale_sensor(mega.raw(), 0, lie.current, lie.voltage);
            double highest_c = -300.0;
            for (int cleared = 0; cleared <= 3; ++cleared) {
                int ms = 0;
                for (; ms < 3000 && mega.view().spring[0].fault == SAFETY_FAULT_NONE; ms += 20) {
                    mega.run_ms(20.0);
                    highest_c = std::fmax(highest_c, plant_temperature_c(mega.plant.get(), 0));
                }
                std::printf("shows %.2f A/A, %.2f V/V after %g s, cleared %d times: %s in %.2f s\n",
                            lie.current, lie.voltage, 1e-3 * at_ms, cleared,
                            ms < 3000 ? "found" : "not found", 1e-3 * ms);
                TEST_ASSERT_TRUE(cleared > 0 || ms <= 2000);
                for (unsigned k = 1; k < BOARD_CHANNELS; ++k) {
                    TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_NONE, mega.view().spring[k].fault);
                }
                mega.expect_ok("clear");
                mega.expect_ok(one.pattern);
            }
            std::printf("    hottest %.1f degC\n", highest_c);
            TEST_ASSERT_TRUE(highest_c < 110.0);
        };
        double now_ms = 0.0;
        for (unsigned n = 0; n < 2 && !one.lies[n].empty(); ++n) {
            mega.run_ms(one.at_ms[n] - now_ms);
            now_ms = one.at_ms[n];
            TEST_ASSERT_EQUAL_UINT8(n == 0 ? DRIVE_POLICY_STAGE_HEAT : DRIVE_POLICY_STAGE_HOLD,
                                    mega.view().spring[0].stage);
            for (const lie &lie : one.lies[n]) {
                try_from_here([&] { lies(now_ms, lie); });
            }
        }
    }
}

/* Its clock is stretched: in ticks that take longer than they may, the springs would heat on while
 * the board's time stands still. */
TEST(a_bus_that_is_too_slow_is_a_bus_that_hangs)
{
    auto mega = driven();
    for (const double times : {5.0, 8.0, 15.0, 40.0}) {
        try_from_here([&] {
            board_stretch_bus(mega->raw(), times);
            mega->run_ms(250.0);
            TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_NO_SENSOR, mega->view().board_fault);
            TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_SENSOR_BUS, mega->view().spring[0].fault);
            TEST_ASSERT_TRUE(board_all_off(mega->raw()));
            TEST_ASSERT_FALSE(board_is_fed(mega->raw()));
            mega->expect_says("faults", "board: fault 17 no_sensor: cut the supply\r\n");
        });
    }
    board_stretch_bus(mega->raw(), 3.0); /* not yet */
    mega->run_ms(2000.0);
    only(*mega, BOARD_CHANNELS, SAFETY_FAULT_NONE);
}

/* For a moment, from any place of a tick on, nothing comes of it; for longer the supply is off, and
 * it is for whoever clears it to switch it on. */
TEST(the_bus_comes_back_when_it_is_released)
{
    auto mega = driven();
    for (double at_ms = 0.0; at_ms < 20.0; at_ms += 3.0) {
        board_set_fault(mega->raw(), BOARD_FAULT_SDA_LOW, 0, true);
        mega->run_ms(60.0 + at_ms);
        board_set_fault(mega->raw(), BOARD_FAULT_SDA_LOW, 0, false);
        mega->run_ms(600.0);
        only(*mega, BOARD_CHANNELS, SAFETY_FAULT_NONE);
        TEST_ASSERT_TRUE(board_is_fed(mega->raw()));
    }
    board_set_fault(mega->raw(), BOARD_FAULT_SDA_LOW, 0, true);
    mega->run_ms(2000.0); /* and the watchdog does not miss it */
    TEST_ASSERT_EQUAL_UINT(0, board_reset_count(mega->raw()));
    TEST_ASSERT_TRUE(board_all_off(mega->raw()));
    TEST_ASSERT_FALSE(board_is_fed(mega->raw()));
    TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_SENSOR_BUS, mega->view().spring[0].fault);
    mega->expect_says("faults", "board: fault 17 no_sensor: cut the supply\r\n");
    mega->expect_ok("clear");
    mega->run_ms(150.0);
    mega->expect_error("supply on", 11);
    board_set_fault(mega->raw(), BOARD_FAULT_SDA_LOW, 0, false);
    mega->run_ms(500.0);
    TEST_ASSERT_FALSE(board_is_fed(mega->raw()));
    mega->board.take_output();
    mega->expect_ok("clear");
    mega->expect_ok("supply on");
    mega->run_ms(100.0);
    mega->expect_ok("on all");
    mega->run_ms(600.0);
    only(*mega, BOARD_CHANNELS, SAFETY_FAULT_NONE);
}

TEST(a_sensor_that_lost_its_configuration_gets_it_again)
{
    auto mega = driven();
    const std::uint16_t config = board_sensor_register(mega->raw(), 6, 0);
    const std::uint16_t calibration = board_sensor_register(mega->raw(), 6, 5);
    TEST_ASSERT_TRUE(config != 0x399F);
    board_reset_sensor(mega->raw(), 6);
    TEST_ASSERT_EQUAL_HEX16(0x399F, board_sensor_register(mega->raw(), 6, 0));
    mega->run_ms(15 * TICK_MS);
    TEST_ASSERT_EQUAL_HEX16(config, board_sensor_register(mega->raw(), 6, 0));
    TEST_ASSERT_EQUAL_HEX16(calibration, board_sensor_register(mega->raw(), 6, 5));
    only(*mega, BOARD_CHANNELS, SAFETY_FAULT_NONE);
}

TEST(a_stopped_fan_does_not_cool)
{
    auto turning = driven();
    auto stopped = driven();
    board_set_fault(stopped->raw(), BOARD_FAULT_FAN, 0, true);
    for (rig *mega : {turning.get(), stopped.get()}) {
        mega->expect_ok("fan 100");
        mega->run_ms(3000.0);
        TEST_ASSERT_EQUAL_DOUBLE(1.0, board_fan(mega->raw())); /* what it is told */
    }
    TEST_ASSERT_TRUE(plant_temperature_c(stopped->plant.get(), 4) >
                     plant_temperature_c(turning->plant.get(), 4) + 0.05);
}

/* The divider's voltage: 20.8 degC, and what is no room's or no step of one. */
TEST(a_thermistor_that_says_what_no_room_does_is_said_and_not_believed)
{
    auto mega = driven();
    const auto says = [&mega](double lies_v) {
        mega->expect_ok("$ambient_c=15");
        board_set_analog_v(mega->raw(), 0, lies_v == 4.0 ? 2.74 : lies_v);
        mega->expect_ok("$ambient_source=1");
        mega->run_ms(1500.0);
        const int from_c7 = mega->view().ambient_c7;
        TEST_ASSERT_INT_WITHIN(64, static_cast<int>(128 * (lies_v == 4.0 ? 20.8 : 15.0)), from_c7);
        board_set_analog_v(mega->raw(), 0, lies_v);
        mega->run_ms(500.0);
        TEST_ASSERT_EQUAL_INT(from_c7, mega->view().ambient_c7);
        mega->expect_says("faults", "thermistor: no room is as it says");
        board_set_analog_v(mega->raw(), 0, 2.7);
        mega->run_ms(1500.0);
        TEST_ASSERT_FALSE(contains(mega->say("faults"), "thermistor"));
        TEST_ASSERT_INT_WITHIN(128, 128 * 21, mega->view().ambient_c7);
    };
    for (const double lies_v : {4.0 /* -5 degC */, 0.9 /* 61 */, 5.0, 0.0}) {
        try_from_here([&] { says(lies_v); });
    }
}

} // namespace
