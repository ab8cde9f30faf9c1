/* `!` switches every output off within 1 ms, whatever the board is doing; counted in CPU cycles. */
#include "board_test.h"

using namespace board_test;

namespace
{

constexpr double LIMIT_MS = 1.0;
/* The byte itself is ten bits long: the millisecond counts from its end. */
constexpr double BYTE_CYCLES = 16e6 * 10.0 / 115200.0;

void all_on(rig &mega)
{
    mega.boot();
    mega.expect_ok("on all");
    mega.run_ms(500.0);
    TEST_ASSERT_FALSE(board_all_off(mega.raw()));
}

/* `before` is what the serial line still carries ahead of the `!`. */
double off_after_ms(rig &mega, const std::string &before = "")
{
    const auto carried = static_cast<double>(before.size() + 1) * BYTE_CYCLES;
    const std::uint64_t begin = board_cycle(mega.raw());
    mega.board.send(before + "!");
    mega.run_ms(carried / CYCLES_PER_MS + LIMIT_MS + 1.0);
    TEST_ASSERT_TRUE_MESSAGE(board_all_off(mega.raw()), "an output is on");
    return (static_cast<double>(board_all_off_since(mega.raw()) - begin) - carried) / CYCLES_PER_MS;
}

void off_and_stays_off(rig &mega, const std::string &before = "")
{
    const double ms = off_after_ms(mega, before);
    char message[80];
    std::snprintf(message, sizeof message, "off after %.3f ms", ms);
    TEST_ASSERT_TRUE_MESSAGE(ms <= LIMIT_MS, message);
    for (int k = 0; k < 300; ++k) {
        mega.run_ms(1.0);
        TEST_ASSERT_TRUE_MESSAGE(board_all_off(mega.raw()), "an output came on again");
    }
}

void stops_while_it_drives()
{
    rig mega;
    all_on(mega);
    off_and_stays_off(mega);
    TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_EMERGENCY_STOP, mega.view().board_fault);
}

void stops_at_any_moment_of_a_tick()
{
    for (int k = 0; k < 20; ++k) {
        rig mega;
        all_on(mega);
        mega.run_ms(k + 0.13 * k);
        const double ms = off_after_ms(mega);
        TEST_ASSERT_TRUE(ms <= LIMIT_MS);
    }
}

void stops_in_the_middle_of_a_command()
{
    rig mega;
    all_on(mega);
    off_and_stays_off(mega, "on a");
}

void stops_while_it_prints_every_setting()
{
    rig mega;
    all_on(mega);
    mega.board.send("$$\n");
    mega.run_ms(20.0);
    off_and_stays_off(mega);
}

void stops_while_it_writes_the_eeprom()
{
    rig mega;
    all_on(mega);
    mega.board.send("$save\n");
    for (int ms = 0; ms < 200 && !board_eeprom_busy(mega.raw()); ++ms) {
        mega.run_ms(1.0);
    }
    TEST_ASSERT_TRUE_MESSAGE(board_eeprom_busy(mega.raw()), "$save writes nothing");
    off_and_stays_off(mega);
}

void stops_while_the_i2c_bus_hangs()
{
    rig mega;
    all_on(mega);
    board_set_fault(mega.raw(), BOARD_FAULT_SDA_LOW, 0, true);
    for (int k = 0; k < 10; ++k) { /* in different phases of its attempts to read */
        mega.run_ms(1.7);
        if (!board_all_off(mega.raw())) {
            break;
        }
    }
    TEST_ASSERT_FALSE_MESSAGE(board_all_off(mega.raw()), "off before the stop: nothing is tested");
    off_and_stays_off(mega);
}

void stops_behind_a_full_line_of_garbage()
{
    rig mega;
    all_on(mega);
    off_and_stays_off(mega, std::string(300, 'x'));
}

void stops_in_the_middle_of_telemetry()
{
    rig mega;
    all_on(mega);
    mega.board.send("telemetry csv 50\n");
    mega.run_ms(200.0);
    off_and_stays_off(mega);
}

void what_was_sent_before_the_stop_does_not_start_anything_after()
{
    rig mega;
    all_on(mega);
    off_and_stays_off(mega, "on 1\non 2\non 3\n");
}

/* Sent in one go: what comes behind the stop is none of what it drops. */
void a_line_right_behind_the_stop_is_obeyed_at_any_moment_of_a_tick()
{
    for (int k = 0; k < 20; ++k) {
        rig mega;
        all_on(mega);
        mega.run_ms(k + 0.13 * k);
        mega.board.take_output();
        mega.board.send("!clear\n");
        mega.run_ms(60.0);
        TEST_ASSERT_EQUAL_STRING("ok\r\n", mega.board.take_output().c_str());
        TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_NONE, mega.view().board_fault);
    }
}

void the_console_still_answers_and_the_board_can_be_cleared()
{
    rig mega;
    all_on(mega);
    off_and_stays_off(mega);
    mega.board.take_output();
    mega.expect_ok("clear");
    mega.expect_ok("on 1");
    mega.run_ms(200.0);
    TEST_ASSERT_FALSE(board_all_off(mega.raw()));
}

} // namespace

void setUp() {}
void tearDown() {}

int main()
{
    need_elf(elf());
    UNITY_BEGIN();
    RUN_TEST(stops_while_it_drives);
    RUN_TEST(stops_at_any_moment_of_a_tick);
    RUN_TEST(stops_in_the_middle_of_a_command);
    RUN_TEST(stops_while_it_prints_every_setting);
    RUN_TEST(stops_while_it_writes_the_eeprom);
    RUN_TEST(stops_while_the_i2c_bus_hangs);
    RUN_TEST(stops_behind_a_full_line_of_garbage);
    RUN_TEST(stops_in_the_middle_of_telemetry);
    RUN_TEST(what_was_sent_before_the_stop_does_not_start_anything_after);
    RUN_TEST(a_line_right_behind_the_stop_is_obeyed_at_any_moment_of_a_tick);
    RUN_TEST(the_console_still_answers_and_the_board_can_be_cleared);
    return UNITY_END();
}
