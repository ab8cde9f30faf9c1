/* From power-on to eight springs held, with the README's words and nothing else: nobody tells the
 * board anything of its springs. */
#include <algorithm>

#include "board_test.h"

using namespace board_test;

namespace
{

constexpr unsigned SPRINGS = BOARD_CHANNELS;
constexpr unsigned CENTRE = 4;
constexpr double FIRST_START_S = 180.0; /* of a board that has learnt nothing */
constexpr double LATER_START_S = 90.0;
constexpr double COOLS_S = 240.0;    /* until the board counts none of its springs as warm */
constexpr unsigned HELD_S = 120;     /* long enough for what was learnt to be kept */
constexpr double ON = 0.95;          /* austenite of a spring that is on */
constexpr double UNDRIVEN_ON = 0.05; /* and what an undriven one may have */
constexpr double HOTTEST_C = 120.0;

void type_what_the_readme_says(rig &mega)
{
    mega.expect_ok("pattern 111101111");
}

bool eight_are_on(const rig &mega)
{
    for (unsigned k = 0; k < SPRINGS; ++k) {
        if (k != CENTRE && phase(mega, k) < ON) {
            return false;
        }
    }
    return true;
}

/* A second, in which no spring becomes too hot and the centre stays off. */
void a_second(rig &mega)
{
    mega.run_ms(1000.0);
    for (unsigned k = 0; k < SPRINGS; ++k) {
        TEST_ASSERT_TRUE(plant_temperature_c(mega.plant.get(), static_cast<int>(k)) < HOTTEST_C);
    }
    TEST_ASSERT_TRUE(phase(mega, CENTRE) < UNDRIVEN_ON);
}

void expect_on_within(rig &mega, double limit_s)
{
    double waited_s = 0.0;
    while (!eight_are_on(mega)) {
        TEST_ASSERT_TRUE_MESSAGE(waited_s < limit_s, mega.say("model").c_str());
        a_second(mega);
        waited_s += 1.0;
    }
    std::printf("eight springs on after %.0f s\n", waited_s);
}

void expect_no_fault(rig &mega)
{
    const board_view_t seen = mega.view();
    TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_NONE, seen.board_fault);
    for (unsigned k = 0; k < SPRINGS; ++k) {
        TEST_ASSERT_EQUAL_UINT8(SAFETY_FAULT_NONE, seen.spring[k].fault);
    }
}

std::unique_ptr<rig> new_board(const std::uint8_t *eeprom = nullptr)
{
    auto mega = std::make_unique<rig>();
    make_niti(mega->plant.get());
    if (eeprom != nullptr) {
        std::copy_n(eeprom, BOARD_EEPROM_BYTES, board_eeprom(mega->raw()));
    }
    mega->boot(false);
    return mega;
}

TEST(the_readmes_words_bring_eight_springs_up_and_hold_them)
{
    const auto mega = new_board();
    type_what_the_readme_says(*mega);
    mega->run_ms(2000.0);
    const std::string waits = mega->say("model");
    expect_in(waits, ", limits cooling\r\n  waits ");
    expect_in(waits, " s: it may still be hot from before power-on");
    expect_on_within(*mega, FIRST_START_S);

    for (unsigned s = 0; s < HELD_S; ++s) {
        a_second(*mega);
        TEST_ASSERT_TRUE_MESSAGE(eight_are_on(*mega), mega->say("model").c_str());
    }
    expect_no_fault(*mega);
    const std::string model = mega->say("model");
    TEST_ASSERT_FALSE_MESSAGE(contains(model, "waits"), model.c_str());
    expect_in(model, " K above martensite start (+-");
    expect_in(model, ", hold\r\n");
    const std::string learnt = mega->say("learnt");
    expect_in(learnt, "spring 5: nothing yet\r\n");
    std::printf("%s", learnt.c_str());

    /* the same board a day later, switched off once it was cold: of what it had only the EEPROM is
     * left. (Where its plug is pulled while springs are warm it waits as at first.) */
    mega->expect_ok("off all");
    mega->run_ms(1000.0 * COOLS_S);
    const auto later = new_board(board_eeprom(mega->raw()));
    type_what_the_readme_says(*later);
    expect_on_within(*later, LATER_START_S);
    expect_no_fault(*later);
}

TEST(a_host_that_leaves_takes_its_springs_with_it)
{
    const auto mega = new_board();
    mega->expect_ok("$host_timeout_s=2");
    mega->expect_ok("policy open"); /* driven at once */
    mega->expect_ok("on 1");
    mega->run_ms(1900.0);
    mega->board.send("?");
    mega->run_ms(1900.0);
    TEST_ASSERT_TRUE_MESSAGE(board_duty(mega->raw(), 0) > 0.0, "a ? was not taken for a host");
    mega->run_ms(200.0);
    TEST_ASSERT_TRUE(board_all_off(mega->raw()));
    mega->expect_says("faults", "board: fault 16 host_silent");
    mega->expect_ok("clear");
    mega->expect_ok("on 1");
}

} // namespace
