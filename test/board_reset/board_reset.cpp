/* What the board does after each kind of reset: the lock, and the temperatures it believes in. */
#include <algorithm>
#include <vector>

#include "board_test.h"

using namespace board_test;

namespace
{

constexpr double WATCHDOG_MS = 250.0;

void heat(rig &mega)
{
    mega.boot();
    mega.expect_ok("on all");
    mega.run_ms(4000.0);
    TEST_ASSERT_TRUE(mega.view().spring[4].temperature_c7 > 22 * 128);
}

/* By `?`, which every answer to comes from the receive interrupt; below 0: there is none. */
double time_ms(rig &mega)
{
    mega.board.take_output();
    mega.board.send("?");
    mega.run_ms(30.0);
    const std::string text = mega.board.take_output();
    const std::size_t at = text.find("|t:");
    return at == std::string::npos ? -1.0 : 1000.0 * std::atof(text.c_str() + at + 3);
}

void off_until_unlocked(rig &mega)
{
    TEST_ASSERT_TRUE(mega.view().locked);
    TEST_ASSERT_TRUE(board_all_off(mega.raw()));
    const std::string refused = mega.answer("on 1");
    TEST_ASSERT_TRUE_MESSAGE(refused.rfind("error:", 0) == 0, refused.c_str());
    mega.run_ms(200.0);
    TEST_ASSERT_TRUE(board_all_off(mega.raw()));
    mega.expect_ok("unlock");
    mega.run_ms(200.0);
    TEST_ASSERT_TRUE_MESSAGE(board_all_off(mega.raw()), "unlocking started something");
    mega.expect_ok("policy open"); /* which does not wait until what was warm is cold */
    mega.expect_ok("on 1");
    mega.run_ms(200.0);
    TEST_ASSERT_TRUE(board_duty(mega.raw(), 0) > 0.0);
}

/* After a hang, too; the heat that was given outlives what does not take the power away. */
TEST(each_reset_leaves_the_board_off_and_locked_and_keeps_what_it_may)
{
    enum { HANG = -1 };
    rig mega;
    heat(mega);
    const auto ends = [&mega](int cause) {
        const int before_c7 = mega.view().spring[4].temperature_c7;
        if (cause == HANG) {
            board_hang(mega.raw());
            mega.run_ms(WATCHDOG_MS + 20.0);
            TEST_ASSERT_EQUAL_UINT(1, board_reset_count(mega.raw()));
        } else {
            board_reset(mega.raw(), static_cast<board_reset_t>(cause));
        }
        TEST_ASSERT_TRUE(board_all_off(mega.raw()));
        mega.boot(false);
        mega.expect_ok("policy open"); /* which does not wait until what was warm is cold */
        if (cause != BOARD_RESET_BROWN_OUT) {
            TEST_ASSERT_TRUE(mega.view().spring[4].temperature_c7 > before_c7 - 128);
        }
        if (cause != BOARD_RESET_EXTERNAL) { /* who pressed the button knows of it */
            off_until_unlocked(mega);
        }
        TEST_ASSERT_TRUE(cause != BOARD_RESET_EXTERNAL || board_all_off(mega.raw()));
    };
    for (const int cause : {static_cast<int>(HANG), static_cast<int>(BOARD_RESET_BROWN_OUT),
                            static_cast<int>(BOARD_RESET_EXTERNAL)}) {
        try_from_here([&] { ends(cause); });
    }
}

/* Timer 2 compares, a conversion is complete, timer 1 overflows: nobody has asked for them. */
TEST(an_interrupt_that_nobody_has_ends_as_a_hang_does)
{
    rig mega;
    heat(mega);
    for (const unsigned vector : {14U, 29U, 20U}) {
        try_from_here([&] {
            here("vector %u", vector);
            TEST_ASSERT_TRUE(board_raise_interrupt(mega.raw(), vector));
            mega.run_ms(WATCHDOG_MS + 20.0);
            TEST_ASSERT_EQUAL_UINT(1, board_reset_count(mega.raw()));
            TEST_ASSERT_TRUE(board_all_off(mega.raw()));
            expect_in(mega.boot(false), "watchdog");
            off_until_unlocked(mega);
        });
    }
}

/* Clock, serial port, ADC, I2C: the board answers, its second is one, and its springs have what
 * they should or are off and locked. */
TEST(whatever_bit_turns_over_the_board_answers_and_nothing_stays_hot)
{
    constexpr unsigned registers[] = {
        0x37, 0x38, 0x39, 0x3A, 0x3B, 0x3C, 0x3D, 0x43, 0x44, 0x45, 0x47, 0x48, 0x64, 0x65,
        0x68, 0x69, 0x6A, 0x6E, 0x6F, 0x70, 0x71, 0x72, 0x73, 0x7A, 0x7B, 0x7C, 0x80, 0x81,
        0x86, 0x87, 0xB0, 0xB1, 0xB3, 0xB6, 0xB8, 0xB9, 0xBC, 0xC0, 0xC1, 0xC2, 0xC4, 0xC5};
    rig mega;
    mega.boot();
    mega.expect_ok("on all 50");
    mega.run_ms(60.0);
    const auto turns_over = [&mega](unsigned address, unsigned k) {
        here("register 0x%02X, bit %u", address, k);
        board_flip(mega.raw(), address, static_cast<std::uint8_t>(1u << k));
        mega.run_ms(60.0);
        mega.board.send("\n"); /* ends what had begun */
        mega.run_ms(20.0);
        const double begins_ms = time_ms(mega);
        mega.run_ms(170.0);
        const double ends_ms = time_ms(mega);
        if (board_reset_count(mega.raw()) != 0) {
            mega.run_ms(60.0); /* says its greeting to the end */
            TEST_ASSERT_TRUE(time_ms(mega) >= 0.0);
            TEST_ASSERT_TRUE(mega.view().locked);
            TEST_ASSERT_TRUE(board_all_off(mega.raw()));
            return;
        }
        TEST_ASSERT_TRUE_MESSAGE(begins_ms >= 0.0 && ends_ms >= 0.0, "no status");
        TEST_ASSERT_DOUBLE_WITHIN(21.0, 200.0, ends_ms - begins_ms);
        for (unsigned spring = 0; spring < BOARD_CHANNELS; ++spring) {
            TEST_ASSERT_TRUE(board_current_a(mega.raw(), spring) < 1.0);
        }
    };
    for (const unsigned address : registers) {
        for (unsigned k = 0; k < 8; ++k) {
            try_from_here([&] { turns_over(address, k); });
            mega.run_ms(1.13); /* at any moment of a tick */
        }
    }
}

/* A bit of RAM, in what the user set and in what the controller made of it: never driven by it for
 * longer than two passes, never saved; afterwards all is as it was saved and nothing is known. */
TEST(a_setting_that_turns_over_by_itself_ends_in_a_reset_that_says_so)
{
    struct place {
        const char *variable;
        std::uint32_t offset;
    };
    rig mega;
    heat(mega);
    const auto turns_over = [&mega](const place &where) {
        std::uint32_t size = 0;
        auto *const bytes =
            const_cast<std::uint8_t *>(board_variable(mega.raw(), where.variable, &size));
        TEST_ASSERT_NOT_NULL(bytes);
        TEST_ASSERT_TRUE(where.offset < size);
        bytes[where.offset] ^= 0x10U;
        mega.run_ms(2.0 * CONTROLLER_SCRUB_MS);
        TEST_ASSERT_EQUAL_UINT_MESSAGE(1, board_reset_count(mega.raw()), where.variable);
        TEST_ASSERT_TRUE(board_all_off(mega.raw()));
        const std::string greeting = mega.boot(false) + mega.say("version");
        expect_in(greeting, "memory");
        TEST_ASSERT_TRUE(mega.view().locked);
        mega.expect_ok("unlock");
        mega.expect_ok("on 5");
        mega.run_ms(1000.0);
        TEST_ASSERT_TRUE_MESSAGE(board_all_off(mega.raw()), "it takes the spring to be cold");
        TEST_ASSERT_BITS_HIGH(DRIVE_POLICY_LIMIT_COOLING, mega.view().spring[4].limits);
    };
    for (const place &where :
         {place{"controller", 0}, place{"controller", 41}, place{"settings", 7},
          place{"settings", 120}, place{"settings", 225}}) {
        try_from_here([&] { turns_over(where); });
    }
}

/* A bit of what is believed of a spring: no reset, the others go on, and this one waits until it
 * cannot be hot. */
TEST(a_belief_that_turns_over_by_itself_begins_anew_and_says_so)
{
    rig mega;
    heat(mega);
    mega.expect_ok("policy precompensate");
    mega.run_ms(2000.0);
    const std::uint32_t at = mega.view().spring[4].belief_at;
    auto *const bytes =
        const_cast<std::uint8_t *>(board_variable(mega.raw(), "controller", nullptr));
    TEST_ASSERT_NOT_NULL(bytes);
    bytes[at + 100] ^= 0x20U;
    mega.run_ms(600.0); /* two turns */
    TEST_ASSERT_EQUAL_UINT(0, board_reset_count(mega.raw()));
    TEST_ASSERT_BITS_HIGH(DRIVE_POLICY_LIMIT_COOLING, mega.view().spring[4].limits);
    TEST_ASSERT_EQUAL_UINT16(0, mega.view().spring[4].target_ma);
    TEST_ASSERT_TRUE(mega.view().spring[0].target_ma > 0);
    mega.expect_says("why 5", "had changed by itself: it begins anew");
    mega.expect_says("version", "in what was believed: 1, ");
}

/* Ticks become due faster than they are done: the board's time is not the world's any more. */
TEST(a_control_loop_that_cannot_keep_up_ends_in_a_reset_that_says_so)
{
    constexpr unsigned TIMER2_COMPA = 13;
    rig mega;
    heat(mega);
    for (int n = 0; n < 20000 && board_reset_count(mega.raw()) == 0; ++n) {
        TEST_ASSERT_TRUE(board_raise_interrupt(mega.raw(), TIMER2_COMPA));
        mega.run_ms(0.05); /* 20 times as fast as it should */
    }
    TEST_ASSERT_EQUAL_UINT(1, board_reset_count(mega.raw()));
    const std::string greeting = mega.boot(false);
    expect_in(greeting, "overload");
    off_until_unlocked(mega);
}

/* In the first 90 s the model's temperatures are guesses, which a reset must not make certain: what
 * open loop gave meanwhile is none. */
TEST(a_reset_keeps_the_heat_that_was_given_before_anything_was_known)
{
    rig mega;
    mega.boot(false);
    mega.expect_ok("policy open");
    mega.expect_ok("on 5");
    mega.run_ms(15000.0);
    for (const board_reset_t cause : {BOARD_RESET_EXTERNAL, BOARD_RESET_BROWN_OUT}) {
        board_reset(mega.raw(), cause);
        mega.boot(false);
        const std::string hinted = mega.say("model cold");
        expect_in(hinted, "spring 5 was heated");
        TEST_ASSERT_FALSE_MESSAGE(contains(hinted, "spring 1 "), hinted.c_str());
    }
    board_reset(mega.raw(), BOARD_RESET_POWER_ON);
    mega.boot(false);
    mega.expect_ok("model cold"); /* who can say how long it was off? */
    TEST_ASSERT_FALSE(contains(mega.say("model cold"), "was heated"));
}

/* Spring 5 alone is held, and for so long its sensor has shown so much of the current. */
void lie_in_a_hold(rig &mega, double shown, double ms)
{
    mega.boot_niti({"policy precompensate", "on 5"});
    mega.run_ms(35e3);
    TEST_ASSERT_EQUAL_UINT8(DRIVE_POLICY_STAGE_HOLD, mega.view().spring[4].stage);
    board_scale_sensor(mega.raw(), 4, shown, 1.0);
    mega.run_ms(ms);
}

/* Whoever opens a Mega's port resets it. What told of the lie, how its circuit showed before, is
 * lost by that: the spring was heated again by the same readings, 122 degC and after three resets
 * 152, and nothing was said. */
TEST(who_resets_the_board_believes_no_sensor_that_was_found_to_lie)
{
    rig mega;
    lie_in_a_hold(mega, 0.6, 2500.0);
    TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_SENSOR_MISMATCH, mega.view().spring[4].fault);
    mega.expect_ok("clear"); /* which the first time takes it: 149 degC after four of each */
    mega.run_ms(200.0);
    for (int n = 0; n < 2; ++n) {
        board_reset(mega.raw(), BOARD_RESET_EXTERNAL);
        mega.boot(false);
        mega.expect_says("faults", "spring 5: fault 15 sensor_mismatch: clear again in ");
        mega.expect_ok("clear");
        mega.expect_error("on 5", 11);
    }
    mega.expect_ok("on 1");
    mega.run_ms(52e3);
    mega.expect_ok("clear");
    mega.expect_ok("on 5");
    mega.run_ms(35e3); /* it waits until it cannot be hot: 83 s from the reset */
    TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_SENSOR_MISMATCH, mega.view().spring[4].fault);
    TEST_ASSERT_TRUE(hottest_c(mega) < 110.0);
}

/* What is kept over a reset is written while the board runs: at whichever of these writes it comes.
 * It was lost at one moment in a hundred. */
TEST(whenever_a_reset_comes_a_sensor_that_was_found_to_lie_is_known)
{
    constexpr double STEP_MS = 0.02;
    rig mega;
    mega.boot_niti({"policy precompensate", "on 5"});
    board_scale_sensor(mega.raw(), 4, 0.5, 1.0);
    mega.run_ms(3000.0);
    TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_SENSOR_MISMATCH, mega.view().spring[4].fault);
    std::uint32_t size = 0;
    const auto *const bytes = board_variable(mega.raw(), "kept", &size);
    TEST_ASSERT_NOT_NULL(bytes);
    const std::vector<std::uint8_t> before(bytes, bytes + size);
    int looks = 0;
    while (std::equal(before.begin(), before.end(), bytes)) {
        TEST_ASSERT_TRUE_MESSAGE(++looks < 5100, "nothing is kept");
        board_run_ms(mega.raw(), STEP_MS);
    }
    for (int n = 0; n < 100; ++n) {
        try_from_here([&] {
            here("%.2f ms after the first write", STEP_MS * n);
            board_reset(mega.raw(), BOARD_RESET_EXTERNAL);
            mega.boot(false);
            TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_SENSOR_MISMATCH, mega.view().spring[4].fault);
        });
        board_run_ms(mega.raw(), STEP_MS);
    }
}

/* In a hold it is found by what was shown before, which a reset takes away: the hold went on, its
 * spring 182 degC, and nothing was said. */
TEST(no_reset_in_a_hold_hides_a_sensor_that_has_begun_to_lie)
{
    double hottest = 0.0;
    rig mega;
    lie_in_a_hold(mega, 0.5, 1500.0);
    TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_NONE, mega.view().spring[4].fault);
    board_reset(mega.raw(), BOARD_RESET_EXTERNAL);
    mega.boot(false);
    mega.expect_ok("on 1");
    mega.expect_ok("on 5");
    mega.run_ms(1000.0);
    TEST_ASSERT_TRUE_MESSAGE(board_duty(mega.raw(), 0) > 0.0, "what is cold waits for nothing");
    mega.expect_ok("off 1");
    mega.expect_says("model", "  waits ");
    for (int s = 0; s < 100 && mega.view().spring[4].fault == SAFETY_FAULT_NONE; ++s) {
        mega.run_ms(1000.0);
        hottest = std::fmax(hottest, hottest_c(mega));
    }
    TEST_ASSERT_EQUAL_INT(SAFETY_FAULT_SENSOR_MISMATCH, mega.view().spring[4].fault);
    TEST_ASSERT_TRUE(hottest < 100.0);
}

/* Nobody knows how long it was off: the springs may be as hot as they ever get. */
TEST(after_power_on_a_spring_waits_until_it_cannot_be_hot)
{
    rig mega;
    heat(mega);
    board_reset(mega.raw(), BOARD_RESET_POWER_ON);
    mega.boot(false);
    mega.expect_ok("policy precompensate");
    mega.expect_ok("on 5");
    mega.run_ms(5000.0);
    TEST_ASSERT_TRUE(board_all_off(mega.raw()));
    TEST_ASSERT_BITS_HIGH(DRIVE_POLICY_LIMIT_COOLING, mega.view().spring[4].limits);
    mega.expect_says("model", "  waits ");
}

/* Of a board that was switched off before what it had heated was cold: it waits, whoever says
 * 'cold', and says how long; a warm reset meanwhile changes nothing. Once it has waited, 'cold' is
 * what the springs are, also after the next power-on; and so it is at the first one of all. */
TEST(nobody_calls_springs_cold_that_were_hot_as_the_power_was_cut)
{
    rig mega;
    heat(mega); /* told 'cold', and driven at once */
    board_reset(mega.raw(), BOARD_RESET_POWER_ON);
    for (const board_reset_t cause : {BOARD_RESET_POWER_ON, BOARD_RESET_EXTERNAL}) {
        mega.boot(false);
        mega.expect_ok("policy precompensate");
        const std::string hinted = mega.say("model cold");
        for (int k = 1; k <= 9; k++) {
            expect_in(hinted, "[spring " + std::to_string(k) +
                                  " may still be hot from before power-on: wait ");
        }
        mega.expect_ok("on 5");
        mega.run_ms(5000.0);
        TEST_ASSERT_TRUE(board_all_off(mega.raw()));
        board_reset(mega.raw(), cause == BOARD_RESET_POWER_ON ? BOARD_RESET_EXTERNAL : cause);
    }
    mega.boot(false);
    mega.run_ms(90000.0);
    TEST_ASSERT_EQUAL_STRING("ok", mega.answer("model cold").c_str());
    TEST_ASSERT_FALSE(contains(mega.say("model cold"), "may still be hot"));
    board_reset(mega.raw(), BOARD_RESET_POWER_ON);
    mega.boot(false);
    mega.expect_ok("policy precompensate");
    TEST_ASSERT_FALSE(contains(mega.say("model cold"), "may still be hot"));
    mega.expect_ok("on 5");
    mega.run_ms(2000.0);
    TEST_ASSERT_TRUE_MESSAGE(board_duty(mega.raw(), 4) > 0.0, "it waits though it is cold");
}

} // namespace
