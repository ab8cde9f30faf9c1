/* What the board does after each kind of reset: the lock, and the temperatures it believes in. */
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
    mega.expect_ok("on 1");
    mega.run_ms(200.0);
    TEST_ASSERT_TRUE(board_duty(mega.raw(), 0) > 0.0);
}

void a_new_board_starts_unlocked_and_off()
{
    rig mega;
    const std::string greeting = mega.boot();
    TEST_ASSERT_TRUE_MESSAGE(contains(greeting, "ninespring"), greeting.c_str());
    TEST_ASSERT_FALSE(mega.view().locked);
    TEST_ASSERT_TRUE(board_all_off(mega.raw()));
}

void a_hang_ends_with_the_watchdog_and_leaves_the_board_locked()
{
    rig mega;
    heat(mega);
    board_hang(mega.raw());
    mega.run_ms(WATCHDOG_MS + 20.0);
    TEST_ASSERT_EQUAL_UINT(1, board_reset_count(mega.raw()));
    TEST_ASSERT_TRUE(board_all_off(mega.raw()));
    mega.boot(false);
    off_until_unlocked(mega);
}

void a_brown_out_leaves_the_board_locked()
{
    rig mega;
    heat(mega);
    board_reset(mega.raw(), BOARD_RESET_BROWN_OUT);
    mega.boot(false);
    off_until_unlocked(mega);
}

void the_reset_button_keeps_the_models_temperatures()
{
    rig mega;
    heat(mega);
    const int before_c7 = mega.view().spring[4].temperature_c7;
    board_reset(mega.raw(), BOARD_RESET_EXTERNAL);
    mega.boot(false);
    TEST_ASSERT_INT_WITHIN(128, before_c7, mega.view().spring[4].temperature_c7);
    TEST_ASSERT_TRUE(board_all_off(mega.raw()));
}

void a_watchdog_reset_keeps_the_models_temperatures()
{
    rig mega;
    heat(mega);
    const int before_c7 = mega.view().spring[4].temperature_c7;
    board_hang(mega.raw());
    mega.run_ms(WATCHDOG_MS + 20.0);
    mega.boot(false);
    TEST_ASSERT_INT_WITHIN(128, before_c7, mega.view().spring[4].temperature_c7);
}

/* Nobody knows how long it was off: the springs may be as hot as they ever get. */
void after_power_on_a_spring_waits_until_it_cannot_be_hot()
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
    const std::string before = mega.say("model");
    TEST_ASSERT_TRUE_MESSAGE(contains(before, "  waits "), before.c_str());
    mega.expect_ok("off all");
    mega.expect_ok("model cold");
    mega.expect_ok("on 5");
    mega.run_ms(2000.0);
    TEST_ASSERT_TRUE_MESSAGE(board_duty(mega.raw(), 4) > 0.0, "it waits though it is cold");
}

void the_watchdog_is_never_hungry_in_normal_work()
{
    rig mega;
    heat(mega);
    mega.board.send("$$\n");
    mega.run_ms(1000.0);
    mega.expect_ok("$save");
    mega.run_ms(4000.0);
    TEST_ASSERT_EQUAL_UINT(0, board_reset_count(mega.raw()));
}

} // namespace

void setUp() {}
void tearDown() {}

int main()
{
    need_elf(elf());
    UNITY_BEGIN();
    RUN_TEST(a_new_board_starts_unlocked_and_off);
    RUN_TEST(a_hang_ends_with_the_watchdog_and_leaves_the_board_locked);
    RUN_TEST(a_brown_out_leaves_the_board_locked);
    RUN_TEST(the_reset_button_keeps_the_models_temperatures);
    RUN_TEST(a_watchdog_reset_keeps_the_models_temperatures);
    RUN_TEST(after_power_on_a_spring_waits_until_it_cannot_be_hot);
    RUN_TEST(the_watchdog_is_never_hungry_in_normal_work);
    return UNITY_END();
}
