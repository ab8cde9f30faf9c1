/* What the flashed ELF was given, again on this machine: the same belief, to the last bit. */
#include <sstream>
#include <string>

#include "board_test.h"
#include "rerun.h"

using namespace board_test;
using ninespring::rerun;

namespace
{

/* All that the board says, in order. */
class tape_of
{
public:
    explicit tape_of(rig &mega) : mega_(mega) {}

    void type(const std::string &line) { text_ += mega_.say(line); }

    void run_s(double seconds)
    {
        for (; seconds > 0.0; seconds -= 1.0) {
            mega_.run_ms(1000.0);
            text_ += mega_.board.take_output();
        }
    }

    void begin()
    {
        std::istringstream lines(mega_.say("$$"));
        for (std::string line; std::getline(lines, line);) {
            text_ += line[0] == '$' ? "# " + line + "\n" : "";
        }
        type("telemetry inputs");
    }

    [[nodiscard]] const std::string &text() const { return text_; }

private:
    rig &mega_;
    std::string text_;
};

void play(rerun &again, const std::string &tape)
{
    std::istringstream lines(tape);
    for (std::string line; std::getline(lines, line);) {
        again.line(line);
    }
}

TEST(the_flashed_elf_believes_what_this_machine_does)
{
    rig mega(elf(), 1, 1e-5, 0.004);
    make_niti(mega.plant.get());
    mega.boot(false);
    tape_of tape(mega);
    tape.begin();
    tape.type("pattern 111101111");
    tape.run_s(150.0);
    tape.type("why 1"); /* an answer between the lines */
    TEST_ASSERT_EQUAL(PLANT_OK, plant_set_effect(mega.plant.get(), "natural_convection", true));
    tape.run_s(60.0);
    tape.type("fan 30");
    tape.type("off 2");
    tape.type("$hold_margin_k=3.00");
    tape.run_s(20.0);
    mega.board.send("!");
    tape.run_s(1.0);
    tape.type("clear");
    tape.type("on 5");
    tape.run_s(10.0);

    rerun again;
    play(again, tape.text());
    const rerun::tally &tally = again.so_far();
    std::printf("%.0f s again: %llu beliefs, %llu differ; %llu ticks missing; first spring %u at "
                "%.2f s\n",
                again.time_s(), static_cast<unsigned long long>(tally.marks),
                static_cast<unsigned long long>(tally.other),
                static_cast<unsigned long long>(tally.missing), tally.other_spring, tally.other_s);
    TEST_ASSERT_TRUE(contains(again.ask("why 3"), "it has transformed"));
    TEST_ASSERT_TRUE(contains(again.ask("model"), "spring 5: "));
    TEST_ASSERT_TRUE(again.time_s() > 230.0 && tally.marks > 2000u);
    TEST_ASSERT_EQUAL_UINT64(0, tally.missing);
    TEST_ASSERT_EQUAL_UINT64(0, tally.other);
}

} // namespace
