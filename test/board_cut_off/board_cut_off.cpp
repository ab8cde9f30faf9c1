/* The stages' supply is off within 0.1 s of a program that no longer runs, and a switch that has
 * failed closed heats until then and no longer. */
#include "board_test.h"

#include <cmath>
#include <cstring>
#include <functional>

using namespace board_test;

namespace
{

constexpr double LIMIT_MS = 100.0;

/* All nine at 1.5 A for 25 s: 45 degC. */
void heat(rig &mega)
{
    mega.boot_niti({"on all"});
    mega.run_ms(25000.0);
    TEST_ASSERT_TRUE(board_is_fed(mega.raw()));
    TEST_ASSERT_FALSE(board_all_off(mega.raw()));
}

/* ms until the supply is off; then it stays so, no current flows and no spring becomes hotter. */
double off_after_ms(rig &mega, const char *what, double limit_ms)
{
    double ms = 0.0;
    double hottest = hottest_c(mega);
    const double before = hottest;
    for (; board_is_fed(mega.raw()) && ms < 1000.0; ms += 1.0) {
        (void)board_run_ms(mega.raw(), 1.0);
        hottest = std::fmax(hottest, hottest_c(mega));
    }
    std::printf("%s: supply off after %.0f ms, hottest %.1f degC, %.1f K more\n", what, ms, hottest,
                hottest - before);
    TEST_ASSERT_TRUE_MESSAGE(ms <= limit_ms, what);
    for (int k = 0; k < 100; ++k) {
        (void)board_run_ms(mega.raw(), 10.0);
        TEST_ASSERT_FALSE_MESSAGE(board_is_fed(mega.raw()), what);
        for (unsigned spring = 0; spring < BOARD_CHANNELS; ++spring) {
            TEST_ASSERT_TRUE_MESSAGE(board_current_a(mega.raw(), spring) < 0.001, what);
        }
        TEST_ASSERT_TRUE_MESSAGE(hottest_c(mega) <= hottest + 0.1, what);
    }
    return ms;
}

TEST(a_welded_switch_heats_until_the_supply_is_off)
{
    rig mega;
    heat(mega);
    const auto closes = [&mega](const char *what) {
        board_set_fault(mega.raw(), BOARD_FAULT_CLOSED, 4, true);
        off_after_ms(mega, what, LIMIT_MS);
        TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_STUCK_ON, mega.view().board_fault);
        TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_STUCK_ON, mega.view().spring[4].fault);
    };
    try_from_here([&] { closes("switch of a driven spring closed"); });
    mega.expect_ok("off 5");
    mega.run_ms(200.0);
    closes("switch of a spring that is off closed");
    const std::string faults = mega.say("faults");
    expect_in(faults, "board: fault 11 stuck_on: cut the supply\r\n");
    expect_in(faults, "spring 5: fault 11 stuck_on");
    expect_in(faults, "supply: off\r\n");
    mega.expect_error("supply on", 11);

    mega.expect_ok("clear"); /* and nothing comes back by that */
    mega.run_ms(200.0);
    TEST_ASSERT_FALSE(board_is_fed(mega.raw()));
    mega.expect_error("on 1", 18);

    try_from_here([&] { /* still closed: found and cut again, and the second time it has to rest */
                        mega.expect_ok("supply on");
                        mega.run_ms(60.0);
                        TEST_ASSERT_TRUE(board_is_fed(mega.raw()));
                        off_after_ms(mega, "the supply on again", LIMIT_MS);
                        board_set_fault(mega.raw(), BOARD_FAULT_CLOSED, 4, false);
                        mega.expect_ok("clear");
                        mega.expect_error("supply on", 11);
                        mega.expect_says("faults", "fault 11 stuck_on: cut the supply: clear ");
    });
    board_set_fault(mega.raw(), BOARD_FAULT_CLOSED, 4, false); /* mended */
    mega.expect_ok("supply on");
    mega.run_ms(100.0);
    TEST_ASSERT_TRUE_MESSAGE(board_all_off(mega.raw()), "the supply started a spring");
    mega.expect_ok("on 1");
    mega.run_ms(300.0);
    TEST_ASSERT_TRUE(board_current_a(mega.raw(), 0) > 0.1);
    TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_NONE, mega.view().spring[0].fault);
}

/* A line that takes longer than a tick costs pulses: not so many that the relay opens and the
 * current loops take nothing for a reading, whenever in a tick it comes. */
TEST(a_setting_in_mid_drive_opens_no_relay)
{
    rig mega;
    mega.boot_niti({"on all"});
    mega.run_ms(1000.0);
    for (double at_ms = 0.0; at_ms < 20.0; at_ms += 5.0) {
        for (const char *line : {"$martensite_start_c=76\n", "$loss_w_per_k=0.0064\n",
                                 "$latent_heat_j=9\n", "$supply_v=5.1\n", "$hold_margin_k=3\n",
                                 "$latent_heat_j=9\n$loss_scale_1=1.1\n$martensite_start_c=77\n"}) {
            try_from_here([&] {
                board_send(mega.raw(), line, std::strlen(line));
                for (int ms = 0; ms < 200; ++ms) {
                    (void)board_run_ms(mega.raw(), 1.0);
                    TEST_ASSERT_TRUE_MESSAGE(board_is_fed(mega.raw()), line);
                    TEST_ASSERT_TRUE_MESSAGE(board_current_a(mega.raw(), 4) > 1.0, line);
                }
                mega.expect_says("faults", "ok");
            });
        }
        mega.run_ms(5.0);
    }
}

/* Whenever in a tick it fails, and however much the spring was given. */
TEST(a_welded_switch_is_cut_at_any_moment_of_a_tick)
{
    for (const char *level : {"off 5", "on 5 30", "on 5 100"}) {
        rig mega;
        mega.boot_niti({level});
        mega.run_ms(600.0);
        for (double at_ms = 0.0; at_ms < 20.0; at_ms += 3.0) {
            try_from_here([&] {
                TEST_ASSERT_TRUE(board_is_fed(mega.raw()));
                board_set_fault(mega.raw(), BOARD_FAULT_CLOSED, 4, true);
                off_after_ms(mega, level, LIMIT_MS);
                TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_STUCK_ON, mega.view().board_fault);
            });
            mega.run_ms(3.0);
        }
    }
}

/* Nothing can be read, so nothing shows it. */
TEST(a_switch_that_welds_while_the_bus_hangs_is_cut)
{
    rig mega;
    heat(mega);
    for (const bool driven : {true, false}) {
        if (!driven) {
            mega.expect_ok("off all");
            mega.run_ms(200.0);
        }
        for (double weld_ms = 0.0; weld_ms < 100.0; weld_ms += 40.0) {
            try_from_here([&] {
                const double before = hottest_c(mega);
                board_set_fault(mega.raw(), BOARD_FAULT_SDA_LOW, 0, true);
                mega.run_ms(weld_ms);
                board_set_fault(mega.raw(), BOARD_FAULT_CLOSED, 4, true);
                off_after_ms(mega, "switch closed, bus hangs", 2.0 * LIMIT_MS - weld_ms);
                TEST_ASSERT_TRUE(hottest_c(mega) < before + 30.0);
                TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_NO_SENSOR, mega.view().board_fault);
            });
        }
    }
}

/* Contacts that chatter, springs that are plugged in give no current that their duty does not. */
TEST(a_spring_that_is_plugged_in_leaves_the_supply)
{
    rig mega;
    mega.boot_niti();
    for (const char *level : {"off 5", "on 5 30", "on 5 100"}) {
        mega.expect_ok(level);
        mega.run_ms(600.0);
        for (int k = 0; k < 40; ++k) {
            board_set_fault(mega.raw(), BOARD_FAULT_OPEN, 4, true);
            mega.run_ms(3.0 + 7.0 * (k % 9));
            board_set_fault(mega.raw(), BOARD_FAULT_OPEN, 4, false);
            mega.run_ms(5.0 + 11.0 * (k % 7));
            TEST_ASSERT_TRUE_MESSAGE(board_is_fed(mega.raw()), level);
            TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_NONE, mega.view().board_fault);
        }
        mega.expect_ok("clear");
    }
}

/* With a closed switch, too: nothing of the program is needed. */
TEST(a_program_that_hangs_holds_nothing)
{
    rig mega;
    heat(mega);
    for (const bool closed : {false, true}) {
        try_from_here([&] {
            board_set_fault(mega.raw(), BOARD_FAULT_CLOSED, 4, closed);
            board_hang(mega.raw());
            off_after_ms(mega, closed ? "hung, a switch closed" : "hung", LIMIT_MS);
            TEST_ASSERT_EQUAL_UINT(1, board_reset_count(mega.raw()));
            TEST_ASSERT_TRUE(mega.view().locked);
            board_set_fault(mega.raw(), BOARD_FAULT_CLOSED, 4, false);
            mega.boot(false);
            mega.expect_ok("unlock");
            mega.run_ms(60.0);
            TEST_ASSERT_TRUE(board_is_fed(mega.raw()));
        });
    }
}

TEST(what_stops_its_pulses_stops_the_supply)
{
    const struct {
        const char *what;
        double limit_ms;
        std::function<void(rig &)> happens;
    } ends[] = {
        {"interrupts off for ever", LIMIT_MS,
         [](rig &m) {
             board_flip(m.raw(), 0x5F, 0x80);
             board_hang(m.raw());
         }},
        {"crystal stopped", LIMIT_MS, [](rig &m) { board_stop_oscillator(m.raw()); }},
        {"pin shorted to ground", LIMIT_MS,
         [](rig &m) { board_set_fault(m.raw(), BOARD_FAULT_ENABLE_LOW, 0, true); }},
        {"pin shorted to 5 V", LIMIT_MS,
         [](rig &m) { board_set_fault(m.raw(), BOARD_FAULT_ENABLE_HIGH, 0, true); }},
        {"supply off", LIMIT_MS + 25.0, [](rig &m) { m.board.send("supply off\n"); }},
        {"!!", LIMIT_MS + 25.0, [](rig &m) { m.board.send("!!"); }},
    };
    rig mega;
    heat(mega);
    for (const auto &end : ends) {
        try_from_here([&] {
            end.happens(mega);
            off_after_ms(mega, end.what, end.limit_ms);
        });
    }
}

TEST(one_stop_leaves_the_supply_and_two_take_it)
{
    rig mega;
    heat(mega);
    mega.board.send("!");
    mega.run_ms(500.0);
    TEST_ASSERT_TRUE(board_is_fed(mega.raw()));
    mega.board.take_output();
    mega.expect_ok("clear");
    mega.board.send("!x\n!"); /* not in a row */
    mega.run_ms(500.0);
    TEST_ASSERT_TRUE(board_is_fed(mega.raw()));
    mega.board.send("!");
    mega.run_ms(150.0);
    TEST_ASSERT_FALSE(board_is_fed(mega.raw()));
    mega.board.take_output();
    mega.expect_error("supply on", 11);
    mega.expect_ok("clear");
    mega.expect_ok("supply on");
    for (int k = 0; k < 12; ++k) { /* whatever comes behind the two, and at any moment of a tick */
        mega.run_ms(1.7);
        try_from_here([&] {
            mega.board.send("!!\n!");
            mega.run_ms(150.0);
            TEST_ASSERT_FALSE(board_is_fed(mega.raw()));
        });
    }
}

/* PORT, DDR and the timer that can drive the pin: the next tick writes them. */
TEST(a_bit_of_the_pin_that_turns_over_is_written_again)
{
    constexpr struct {
        unsigned address;
        std::uint8_t mask;
    } bits[] = {{0x24, 0x40}, {0x25, 0x40}, {0x80, 0x20}, {0x80, 0x10}};
    rig mega;
    mega.boot();
    mega.expect_ok("on all 50");
    for (const auto &one : bits) {
        for (int k = 0; k < 10; ++k) { /* at any moment of a tick */
            mega.run_ms(23.0);
            board_flip(mega.raw(), one.address, one.mask);
            for (int ms = 0; ms < 150; ms += 5) {
                mega.run_ms(5.0);
                TEST_ASSERT_TRUE(board_is_fed(mega.raw()));
            }
        }
    }
    TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_NONE, mega.view().spring[0].fault);
}

TEST(without_a_cut_off_there_are_no_pulses)
{
    rig mega;
    mega.boot();
    TEST_ASSERT_TRUE(board_is_fed(mega.raw()));
    mega.expect_ok("$cut_off=0");
    mega.run_ms(150.0);
    TEST_ASSERT_FALSE(board_is_fed(mega.raw()));
    mega.expect_error("supply on", 15);
}

} // namespace
