/* What the console needs the board for: its clock, its load, its rates, its EEPROM, its springs;
 * words and refusals are in test/test_console. */
#include <cstring>
#include <sstream>
#include <vector>

#include "board_test.h"
#include "console_codes.h"
#include "hil_frame.h"

using namespace board_test;

namespace
{

std::unique_ptr<rig> booted()
{
    auto mega = std::make_unique<rig>();
    mega->boot();
    return mega;
}

/* The ticks of 1 ms are as they would be after so many of them. */
void set_clock(rig &mega, std::uint32_t ms)
{
    std::uint32_t size = 0;
    auto *const at =
        const_cast<std::uint8_t *>(board_variable(mega.raw(), "time_ms", &size)); /* of the ELF */
    TEST_ASSERT_NOT_NULL(at);
    TEST_ASSERT_EQUAL_UINT32(4, size);
    for (unsigned k = 0; k < 4; ++k) {
        at[k] = static_cast<std::uint8_t>(ms >> (8 * k));
    }
}

/* The numbers that stand before the first comma of a line, or between two colons. */
std::vector<double> times_in(const std::string &text, char begin, char end)
{
    std::vector<double> times;
    std::istringstream lines(text.substr(text.find('\n') + 1));
    for (std::string line; std::getline(lines, line);) {
        const std::size_t from = begin == 0 ? 0 : line.find(begin) + 1;
        const std::size_t to = line.find(end, from);
        if (!line.empty() && line.back() == '\r' && to != std::string::npos &&
            line.find_first_not_of("0123456789.", from) == to) {
            times.push_back(std::stod(line.substr(from, to - from)));
        }
    }
    return times;
}

TEST(time_goes_on_for_years)
{
    for (const double turn_ms : {2147483648.0, 4294967296.0}) {
        for (const bool csv : {true, false}) {
            auto mega = booted();
            mega->expect_ok(csv ? "telemetry csv 5" : "telemetry teleplot 5");
            mega->run_ms(100.0);
            set_clock(*mega, static_cast<std::uint32_t>(turn_ms - 1500.0));
            mega->run_ms(100.0);
            (void)mega->board.take_output();
            mega->run_ms(3000.0);
            const std::vector<double> times =
                times_in(mega->board.take_output(), csv ? '\0' : ':', csv ? ',' : ':');
            const double unit_ms = csv ? 1000.0 : 1.0;
            TEST_ASSERT_GREATER_THAN_UINT(10, times.size());
            for (std::size_t k = 1; k < times.size(); ++k) {
                TEST_ASSERT_TRUE(times[k] >= times[k - 1]);
            }
            TEST_ASSERT_TRUE(times.front() * unit_ms < turn_ms);
            TEST_ASSERT_TRUE(times.back() * unit_ms > turn_ms + 500.0);
            mega->expect_ok("telemetry off");
            mega->board.send("?");
            mega->run_ms(100.0);
            const std::string status = mega->board.take_output();
            const double status_s = std::stod(status.substr(status.find("|t:") + 3));
            TEST_ASSERT_TRUE(1000.0 * status_s > turn_ms + 1000.0);
        }
    }
}

/* The chip counts its sleep with a timer whose interrupt also wakes it. */
TEST(load_is_what_it_did_not_sleep)
{
    auto mega = booted();
    mega->run_ms(1500.0);
    const std::uint64_t begin = board_cycle(mega->raw());
    const std::uint64_t idle = board_idle_cycles(mega->raw());
    mega->run_ms(2500.0);
    const double passed = static_cast<double>(board_cycle(mega->raw()) - begin);
    const double slept = static_cast<double>(board_idle_cycles(mega->raw()) - idle);
    mega->board.send("?");
    mega->run_ms(100.0);
    const std::string status = mega->board.take_output();
    const std::size_t load = status.find("|load:");
    TEST_ASSERT_TRUE_MESSAGE(load != std::string::npos, status.c_str());
    TEST_ASSERT_DOUBLE_WITHIN(2.0, 100.0 * (1.0 - slept / passed),
                              std::atof(status.c_str() + load + std::strlen("|load:")));
}

/* Telemetry at 50 Hz while limits act, then `telemetry off`: does the console answer? */
std::string version_under(const std::string &format)
{
    auto mega = booted();
    mega->expect_ok("model cold"); /* else all wait, and for no turn */
    mega->expect_ok("policy precompensate");
    mega->expect_ok("on all");
    mega->board.send("telemetry " + format + " 50\n");
    mega->run_ms(2000.0);
    const std::string told = mega->board.take_output();
    /* 14.8 A let four of nine heat with 3 A: four and what is left wait for their turn, whoever. */
    unsigned waiting = 0;
    for (int k = 1; k <= 9; ++k) {
        const std::string name = (format == "csv" ? "<limits|spring:" : ">cut") + std::to_string(k);
        waiting += contains(told, name) ? 1u : 0u;
    }
    TEST_ASSERT_GREATER_OR_EQUAL_UINT_MESSAGE(5, waiting, told.c_str());
    TEST_ASSERT_TRUE(format != "csv" || contains(told, "|supply|cut_a:3.000>"));
    mega->board.send("telemetry off\n");
    mega->run_ms(1000.0);
    mega->board.take_output();
    return mega->say("version");
}

TEST(telemetry_at_its_fastest_leaves_the_console_usable)
{
    for (const char *const format : {"csv", "teleplot"}) {
        expect_in(version_under(format), "ticks late 0,");
    }
}

TEST(bytes_that_found_no_room_are_reported)
{
    auto mega = booted();
    /* while the long answer goes out nobody takes lines in */
    std::string flood = "$$\n";
    for (int k = 0; k < 60; ++k) {
        flood += "on 1\noff 1\n";
    }
    mega->board.send(flood);
    mega->run_ms(3000.0);
    expect_in(mega->board.take_output(), "error:13 ");
    mega->board.send("\n"); /* ends what is left of the last line */
    mega->run_ms(500.0);
    mega->board.take_output();
    mega->expect_ok("version");
}

TEST(an_eeprom_that_keeps_nothing_fails_the_save)
{
    auto mega = booted();
    mega->expect_ok("$loss_w_per_k=0.006543");
    board_set_fault(mega->raw(), BOARD_FAULT_EEPROM, 0, true);
    mega->expect_error("$save", CONSOLE_ERROR_SAVE_FAILED);
}

/* At once and while springs are driven, without a fault. */
TEST(averaging_is_set_while_it_runs)
{
    auto mega = booted();
    mega->expect_ok("on all");
    mega->run_ms(500.0);
    for (const char *samples : {"16", "8"}) {
        mega->expect_ok(std::string("$sensor_averaging=") + samples);
        mega->run_ms(300.0);
        const board_view_t seen = mega->view();
        for (unsigned k = 0; k < BOARD_CHANNELS; ++k) {
            TEST_ASSERT_EQUAL_HEX16(samples[0] == '8' ? 0x1DDF : 0x1E67,
                                    board_sensor_register(mega->raw(), k, 0));
            TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_NONE, seen.spring[k].fault);
            TEST_ASSERT_INT_WITHIN(60, 1500, seen.spring[k].measured_ma);
        }
    }
}

/* With hardware in the loop frames are taken beside the console: one that had a stop ahead of it
 * hid where that was, and what came next was dropped with error:12; and another averaging ended a
 * frame under way, whose rest was then a line. At any moment of a tick. */
TEST(in_the_loop_a_line_behind_a_frame_is_obeyed)
{
    rig mega(elf("firmware_hil.elf"));
    mega.boot(false);
    hil_frame_sensors_t sensors{};
    sensors.springs = HIL_FRAME_MAX_SPRINGS;
    char line[HIL_FRAME_MAX_LINE];
    const std::string frame(line, hil_frame_encode_sensors(&sensors, line));
    const auto is_obeyed = [&mega](const std::string &sent, double ms) {
        here("%.20s after %.2f ms", sent.c_str(), ms);
        mega.board.take_output();
        mega.board.send(sent);
        mega.run_ms(60.0);
        const std::string said = mega.board.take_output(); /* between the frames of its own */
        expect_in(said, "ok\r\n");
        TEST_ASSERT_FALSE_MESSAGE(contains(said, "error"), said.c_str());
    };
    constexpr double STEP_MS = 0.25;
    for (int n = 0; n < 80; ++n) {
        for (const std::string &sent :
             {"!" + frame + "clear\n", "$sensor_averaging=16\n" + frame}) {
            try_from_here([&] { is_obeyed(sent, STEP_MS * n); });
        }
        mega.run_ms(STEP_MS);
    }
}

TEST(selftest_wants_and_leaves_everything_off_and_finds_what_is_beyond_its_limits)
{
    auto mega = booted();
    expect_in(mega->say("selftest", 20000.0), "ok\r\n");
    mega->run_ms(100.0);
    TEST_ASSERT_TRUE(board_all_off(mega->raw()));
    mega->expect_ok("on 3");
    mega->expect_error("selftest", CONSOLE_ERROR_SPRINGS_ON);
    mega->expect_ok("off 3");
    board_set_fault(mega->raw(), BOARD_FAULT_OPEN, 6, true);
    const std::string text = mega->say("selftest", 20000.0);
    expect_in(text, "error:17 ");
    expect_in(text, "spring 7");
    mega->expect_ok("$resistance_minimum_ohm=0.3");
    const std::string limits = mega->say("selftest", 20000.0);
    expect_in(limits, "error:17 ");
    expect_in(limits, "spring 1: sensor ok, fault 3 short_spring");
}

} // namespace
