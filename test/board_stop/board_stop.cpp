/* `!` switches every output off within 1 ms, whatever the board is doing; counted in CPU cycles. */
#include "board_test.h"

#include <vector>

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
    here("off after %.3f ms", ms);
    TEST_ASSERT_TRUE(ms <= LIMIT_MS);
    for (int k = 0; k < 300; ++k) {
        mega.run_ms(1.0);
        TEST_ASSERT_TRUE_MESSAGE(board_all_off(mega.raw()), "an output came on again");
    }
}

/* As it drives, prints, tells; in the middle of a command, behind others that it drops, and behind
 * a line of garbage. Afterwards the console answers, and the board can be cleared. */
TEST(stops_whatever_is_sent_before)
{
    static const struct {
        const char *sent; /* so long before */
        double ms;
        std::string before; /* right before */
    } table[] = {{"", 0.0, ""},
                 {"", 0.0, "on a"},
                 {"$$\n", 20.0, ""},
                 {"telemetry csv 50\n", 200.0, ""},
                 {"", 0.0, "on 1\non 2\non 3\n"},
                 {"", 0.0, std::string(300, 'x')}};
    rig mega;
    all_on(mega);
    for (const auto &one : table) {
        try_from_here([&] {
            mega.board.send(one.sent);
            mega.run_ms(one.ms);
            off_and_stays_off(mega, one.before);
            TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_EMERGENCY_STOP, mega.view().board_fault);
            mega.board.send("\ntelemetry off\n"); /* and ends what is left of a line */
            mega.run_ms(300.0);
            mega.board.take_output();
            mega.expect_ok("clear");
            mega.expect_ok("on 1");
            mega.run_ms(200.0);
            TEST_ASSERT_FALSE(board_all_off(mega.raw()));
        });
    }
}

TEST(stops_while_it_writes_the_eeprom_and_while_the_i2c_bus_hangs)
{
    rig mega;
    all_on(mega);
    try_from_here([&] {
        mega.board.send("$save\n");
        for (int ms = 0; ms < 200 && !board_eeprom_busy(mega.raw()); ++ms) {
            mega.run_ms(1.0);
        }
        TEST_ASSERT_TRUE_MESSAGE(board_eeprom_busy(mega.raw()), "$save writes nothing");
        off_and_stays_off(mega);
    });
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

/* Each line once, whatever ends it, and an empty one not at all. */
TEST(each_line_that_a_stop_drops_is_answered_once)
{
    rig mega;
    mega.boot();
    mega.board.send("$$\n");
    mega.run_ms(30.0);
    mega.board.send("\r\n\n on 1\r\non 2\r\n!");
    mega.run_ms(300.0);
    const std::string said = mega.board.take_output();
    unsigned dropped = 0;
    for (std::size_t at = 0; (at = said.find("error:12 ", at)) != std::string::npos; ++at) {
        ++dropped;
    }
    TEST_ASSERT_EQUAL_UINT_MESSAGE(3, dropped, said.c_str()); /* `$$`, and the two behind it */
}

/* And a line right behind it, sent in one go, is obeyed: it is none of what the stop drops. */
TEST(stops_at_any_moment_of_a_tick)
{
    rig mega;
    all_on(mega);
    for (int k = 0; k < 20; ++k) {
        try_from_here([&] {
            const double ms = off_after_ms(mega);
            TEST_ASSERT_TRUE(ms <= LIMIT_MS);
        });
        try_from_here([&] {
            mega.board.take_output();
            mega.board.send("!clear\n");
            mega.run_ms(60.0);
            TEST_ASSERT_EQUAL_STRING("ok\r\n", mega.board.take_output().c_str());
            TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_NONE, mega.view().board_fault);
        });
        mega.run_ms(1.13);
    }
}

/* --- bits that turn over by themselves ------------------------------------------------------ */

constexpr unsigned DDRE = 0x2D, DDRH = 0x101, DDRL = 0x10A;
constexpr double TICK_MS = CONTROLLER_TICK_MS + 3.0; /* one of the chip's lies in it, whole */

struct bit {
    unsigned address;
    std::uint8_t mask;
};

/* Of the nine outputs: PORT and DDR of their pins, and timers 3 to 5 but for their counters. */
std::vector<bit> bits_of_the_outputs()
{
    std::vector<bit> all;
    for (const unsigned ddr : {DDRE, DDRH, DDRL}) {
        for (const unsigned address : {ddr, ddr + 1}) {
            for (int k = 3; k <= 5; ++k) {
                all.push_back({address, static_cast<std::uint8_t>(1u << k)});
            }
        }
    }
    for (const unsigned timer : {0x90u, 0xA0u, 0x120u}) {
        for (const unsigned offset : {0u, 1u, 2u, 6u, 7u, 8u, 9u, 10u, 11u, 12u, 13u}) {
            for (int k = 0; k < 8; ++k) {
                all.push_back({timer + offset, static_cast<std::uint8_t>(1u << k)});
            }
        }
    }
    return all;
}

void turn_over(rig &mega, const bit &one)
{
    here("register 0x%03X, bits 0x%02X", one.address, one.mask);
    board_flip(mega.raw(), one.address, one.mask);
}

TEST(stops_whatever_bit_of_an_output_has_turned_over)
{
    rig mega;
    all_on(mega);
    for (const bit &one : bits_of_the_outputs()) {
        turn_over(mega, one);
        const double ms = off_after_ms(mega);
        TEST_ASSERT_TRUE(ms <= LIMIT_MS);
        mega.run_ms(2.0 * TICK_MS);
        TEST_ASSERT_TRUE(board_all_off(mega.raw()));
        mega.expect_ok("clear");
        mega.expect_ok("on all 30");
        mega.run_ms(2.0 * TICK_MS);
        for (unsigned k = 0; k < BOARD_CHANNELS; ++k) {
            TEST_ASSERT_TRUE(board_duty(mega.raw(), k) > 0.0);
        }
    }
}

/* A part that has lost its clock, a serial port that is set otherwise: nothing else may notice. */
TEST(what_keeps_the_board_going_is_written_anew_within_a_tick)
{
    constexpr unsigned PRR0 = 0x64, PRR1 = 0x65, UCSR0B = 0xC1, UCSR0C = 0xC2, UBRR0L = 0xC4;
    constexpr bit REGISTERS[] = {
        {PRR0, 0xEF}, {PRR1, 0x3F}, {UCSR0B, 0xDC}, {UCSR0C, 0xFF}, {UBRR0L, 0xFF}};
    rig mega;
    mega.boot();
    for (const bit &one : REGISTERS) {
        const std::uint8_t was = board_register(mega.raw(), one.address);
        for (unsigned mask = 1; mask < 256; mask *= 2) {
            if ((mask & one.mask) != 0) {
                turn_over(mega, {one.address, static_cast<std::uint8_t>(mask)});
                TEST_ASSERT_TRUE(was != board_register(mega.raw(), one.address));
                mega.run_ms(TICK_MS);
                TEST_ASSERT_EQUAL_HEX8(was, board_register(mega.raw(), one.address));
            }
        }
    }
    mega.expect_ok("on all 30");
}

TEST(off_is_off_again_within_a_tick_whatever_bit_turns_over)
{
    rig mega;
    mega.boot();
    for (const bit &one : bits_of_the_outputs()) {
        turn_over(mega, one);
        mega.run_ms(TICK_MS);
        TEST_ASSERT_TRUE(board_all_off(mega.raw()));
    }
    mega.run_ms(500.0);
    TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_NONE, mega.view().board_fault);
    mega.expect_ok("on all");
    mega.run_ms(500.0);
    for (unsigned k = 0; k < BOARD_CHANNELS; ++k) {
        TEST_ASSERT_DOUBLE_WITHIN(0.05, 1.5, board_current_a(mega.raw(), k));
    }
}

/* 14 A may flow for a tick, from which the current loop has to recover: nothing is latched. */
TEST(a_driven_spring_has_its_current_again_whatever_bit_turns_over)
{
    rig mega;
    all_on(mega);
    mega.expect_ok("on all 50");
    mega.run_ms(300.0);
    for (const bit &one : bits_of_the_outputs()) {
        const bool port_h_or_timer_4 = one.address / 0x10u == 0x10u || one.address / 0x10u == 0xAu;
        if (!port_h_or_timer_4 || (one.mask & 0x29u) == 0) {
            continue; /* some, as each takes its time */
        }
        try_from_here([&] {
            turn_over(mega, one);
            mega.run_ms(600.0);
            for (unsigned k = 0; k < BOARD_CHANNELS; ++k) {
                TEST_ASSERT_DOUBLE_WITHIN(0.2, 0.75, board_current_a(mega.raw(), k));
            }
            TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_NONE, mega.view().board_fault);
        });
    }
}

} // namespace
