/* The readers and writers of docs/files.md: what they take, what they refuse, and where they say it
 * is. */
#include <cmath>
#include <functional>
#include <string>

#include "../run_tests.h"

#include "log_writer.h"
#include "scenario_file.h"
#include "text_file.h"

using namespace ninespring;

namespace
{

std::string error_of(const std::function<void()> &work)
{
    try {
        work();
    } catch (const input_error &error) {
        const std::string text = error.what();
        TEST_ASSERT_EQUAL_MESSAGE(std::string::npos, text.find('\n'), text.c_str());
        return text;
    }
    return "(no error)";
}

void expect(const std::string &text, const std::string &begin, const std::string &part)
{
    TEST_ASSERT_TRUE_MESSAGE(text.compare(0, begin.size(), begin) == 0, text.c_str());
    TEST_ASSERT_TRUE_MESSAGE(text.find(part) != std::string::npos, text.c_str());
}

void refuses_scenario(const std::string &text, const std::string &begin, const std::string &part)
{
    expect(error_of([&] { parse_scenario(make_text_file("s.ini", text, 197)); }), begin, part);
}

TEST(files_that_are_not_text_are_refused)
{
    expect(error_of([] { make_text_file("a", "x\n" + std::string(1000000, '1')); }),
           "a:2:65537: ", "1000000 characters");
    expect(error_of([] { make_text_file("a", std::string("\xFF\xFEt\0", 4)); }),
           "a:1:1: ", "UTF-16");
    expect(error_of([] { make_text_file("a", std::string("t\n0,\0", 5)); }),
           "a:2:3: ", "zero byte");
    expect(error_of([] { make_text_file("a", ""); }), "a:1:1: ", "empty");
    expect(error_of([] { read_text_file("no_such_file"); }), "no_such_file: ", "cannot be read");
    expect(error_of([] { read_text_file("."); }), ".: ", "is a folder");
}

TEST(number_is_refused_with_advice)
{
    const auto problem = [](const char *text) {
        double value = 0.0;
        return parse_number(text, value);
    };
    expect(problem(""), "", "is missing");
    expect(problem("1.5A"), "'1.5A'", "not a number");
    expect(problem("1e999"), "'1e999'", "too large");
    expect(problem("0x10"), "'0x10'", "not a number");
    expect(problem("1,5"), "'1,5'", "decimal comma");
    expect(problem("70%"), "'70%'", "fraction of 1");
    expect(problem("inf"), "'inf'", "not a finite number");
    TEST_ASSERT_EQUAL_STRING("", problem("+1.5e0").c_str());
}

TEST(log_is_written_with_fixed_decimals)
{
    log_writer writer;
    writer.comment("scenario", "x\ny");
    writer.column("time_s", 2);
    writer.column("u1", 3);
    writer.column("t1_c", 3);
    writer.row({0.0, 0.5, -0.0001});
    writer.row({0.02, 1.0, std::nan("")});
    TEST_ASSERT_EQUAL_STRING("# scenario: x y\ntime_s,u1,t1_c\n0.00,0.500,0.000\n0.02,1.000,\n",
                             writer.text().c_str());
}

const std::string SCENARIO = "[scenario]\nduration_s = 60\n";

TEST(scenario_is_read)
{
    const scenario s = parse_scenario(
        make_text_file("s.ini", "; comment\r\n[scenario]\r\nduration_s = 60\r\nseed=7\r\n"
                                "[array]\r\n  rows = 1\r\n  cols = 3 ; inline\r\n"
                                "[plant]\r\neffects = latent_heat,\r\n    radiation\r\n"
                                "loss_w_per_k[2] = 0.01\r\n"
                                "[chip]\r\n$open_current_ma = 1500\r\n"
                                "[events]\r\nat 30 = off all\r\nat 0 = pattern 101\r\n"
                                "at 30 = fail open 3\r\nat 10 = on 2 50\r\n"),
        {"scenario.seed=9", "loss_w_per_k[2]=0.02", "array.pitch_mm=5"});
    TEST_ASSERT_EQUAL(9, s.seed);
    TEST_ASSERT_EQUAL(1, s.rows);
    TEST_ASSERT_EQUAL(3, s.cols);
    TEST_ASSERT_EQUAL_DOUBLE(5.0, *s.pitch_mm);
    TEST_ASSERT_EQUAL(2, s.effects.size());
    TEST_ASSERT_EQUAL_STRING("radiation", s.effects[1].key.c_str());
    TEST_ASSERT_EQUAL(1, s.plant.size());
    TEST_ASSERT_EQUAL_STRING("0.02", s.plant[0].value.c_str());
    TEST_ASSERT_EQUAL_STRING("open_current_ma", s.settings[0].key.c_str());
    TEST_ASSERT_EQUAL(4, s.events.size());
    TEST_ASSERT_EQUAL(scenario_word::pattern, s.events[0].word);
    TEST_ASSERT_EQUAL_DOUBLE(50.0, s.events[1].amount);
    TEST_ASSERT_EQUAL(scenario_word::off, s.events[2].word);
    TEST_ASSERT_EQUAL(3, s.events[2].springs.size());
    TEST_ASSERT_EQUAL(scenario_failure::open, s.events[3].what);
    TEST_ASSERT_EQUAL(2, s.events[3].springs[0]);
}

/* Spring 9 + k is the stiffness spring below k; each layer has boards of its own. */
TEST(scenario_of_two_layers_is_read)
{
    const scenario s = parse_scenario(
        make_text_file("s.ini", SCENARIO + "[array]\nlayers = 2\n[board.2]\nsupply_limit_a = 5\n"
                                           "[events]\nat 1 = pattern 111101111/000010000\n"
                                           "at 2 = on 18\n"));
    TEST_ASSERT_EQUAL(18, s.springs());
    TEST_ASSERT_EQUAL(18, s.events[0].pattern.size());
    for (std::size_t k = 0; k < 18; ++k) {
        TEST_ASSERT_EQUAL(k < 9 ? k != 4 : k == 13, s.events[0].pattern[k]);
    }
    TEST_ASSERT_EQUAL(17, s.events[1].springs[0]);
    TEST_ASSERT_EQUAL(2, s.boards[0].number);
}

/* Every other word of the console's help goes to a board that has a console. */
TEST(scenario_takes_the_words_of_the_console)
{
    for (const std::string word : {"help", "version", "model cold", "learnt clear", "faults",
                                   "selftest", "telemetry csv 5", "$$", "?"}) {
        const scenario s =
            parse_scenario(make_text_file("s.ini", SCENARIO + "[events]\nat 1 = " + word + "\n"));
        TEST_ASSERT_TRUE_MESSAGE(s.events[0].word == scenario_word::console, word.c_str());
    }
}

TEST(scenario_with_errors_is_refused)
{
    refuses_scenario(SCENARIO + "colour = 3\n", "s.ini:3:1: ", "no key 'colour'");
    refuses_scenario(SCENARIO + "duration_s = 3\n", "s.ini:3:1: ", "appears twice");
    refuses_scenario(SCENARIO + "[plamt]\n", "s.ini:3:1: ", "did you mean plant?");
    refuses_scenario("[scenario]\n duration_s  =  1,5\n", "s.ini:2:17: ", "decimal comma");
    refuses_scenario("[scenario]\nduration_s = nan\n", "s.ini:2:14: ", "not a finite number");
    refuses_scenario("[scenario]\nduration_s = 60 min\n", "s.ini:2:14: ", "not a number");
    refuses_scenario("[scenario]\nduration_s = -1\n", "s.ini:2:14: ", "must be");
    refuses_scenario("[scenario]\nseed = 1\n", "s.ini:1:1: ", "without duration_s");
    refuses_scenario("duration_s = 60\n", "s.ini:1:1: ", "before any [section]");
    refuses_scenario(SCENARIO + "nonsense\n", "s.ini:3:1: ", "neither");
    refuses_scenario(SCENARIO + "[array\n", "s.ini:3:1: ", "neither");
    refuses_scenario(SCENARIO + "log_interval_s = 0.03\n", "s.ini:3:18: ", "multiple of 0.02");
    refuses_scenario(SCENARIO + "seed =\n", "s.ini:3:", "without a value");
    refuses_scenario(SCENARIO + "[plant]\nloss_w_per_k = 1\n  2\n", "s.ini:4:16: ", "continues");
    refuses_scenario(SCENARIO + "; " + std::string(200, 'x') + "\n",
                     "s.ini:3:198: ", "at most 197");
    refuses_scenario(SCENARIO + "[array]\nrows=9\ncols=9\n", "s.ini:1:1: ", "more than 64");
    refuses_scenario(SCENARIO + "[array]\nboard_rows=3\n", "s.ini:1:1: ", "go together");
    refuses_scenario(SCENARIO + "[board.2]\nsupply_limit_a=5\n",
                     "s.ini:4:1: ", "[board.2], but the array has 1");
    refuses_scenario(SCENARIO + "[array]\nlayers=2\n[board.3]\nsupply_limit_a=5\n",
                     "s.ini:6:1: ", "[board.3], but the array has 2");
    refuses_scenario(SCENARIO + "[array]\nlayers=3\n", "s.ini:4:8: ", "must be 1 to 2");
    refuses_scenario(SCENARIO + "[array]\nrows=32\ncols=32\nlayers=2\nboard_rows=8\nboard_cols=8\n",
                     "s.ini:1:1: ", "in two layers are more than 1024");
    refuses_scenario(SCENARIO + "[board.0]\nsupply_limit_a=5\n", "s.ini:3:", "no section");
}

TEST(scenario_events_with_errors_are_refused)
{
    const auto refuses = [](const char *line, const char *begin, const char *part) {
        refuses_scenario(SCENARIO + "[events]\n" + line + "\n", begin, part);
    };
    refuses("at 5 = dance", "s.ini:4:8: ", "there is no word 'dance'");
    refuses("at 5 = on 10", "s.ini:4:8: ", "1 to 9 or all");
    refuses("at 5 = on 0", "s.ini:4:8: ", "1 to 9 or all");
    refuses("at 5 = on 1 101", "s.ini:4:8: ", "0 to 100");
    refuses("at 5 = on", "s.ini:4:8: ", "on K [percent]");
    refuses("at 5 = off 1 2", "s.ini:4:8: ", "off K|all");
    refuses("at 5 = pattern 1111", "s.ini:4:8: ", "4 digits for 9 springs");
    refuses("at 5 = pattern 11111111x", "s.ini:4:8: ", "0 and 1");
    refuses("at 5 = pattern 111101111/000010000", "s.ini:4:8: ", "write [array] layers = 2");
    const auto refuses_of_two = [](const char *pattern, const char *part) {
        refuses_scenario(SCENARIO + "[array]\nlayers = 2\n[events]\nat 5 = pattern " + pattern +
                             "\n",
                         "s.ini:6:8: ", part);
    };
    refuses_of_two("111101111", "of one layer, the array has two");
    refuses_of_two("111101111000010000", "of one layer, the array has two");
    refuses_of_two("11110111/000010000", "elongation pattern has 8 digits for 9 springs");
    refuses_of_two("111101111/", "stiffness pattern has 0 digits for 9 springs");
    refuses_of_two("111101111/00001000/", "stiffness pattern '00001000/'");
    refuses_of_two("111101111/00001000x", "stiffness pattern '00001000x' holds something else");
    refuses("at 5 = policy best", "s.ini:4:8: ", "open or precompensate");
    refuses("at 5 = fan 101", "s.ini:4:8: ", "0 to 100");
    refuses("at 5 = fail swap 2 2", "s.ini:4:8: ", "two springs");
    refuses("at 5 = fan 12.5", "s.ini:4:8: ", "whole percent");
    refuses("at 5 = on 5 0.5", "s.ini:4:8: ", "whole percent");
    refuses("at 5 = ambient 51", "s.ini:4:8: ", "-40 to 50");
    refuses("at 5 = fail melt 1", "s.ini:4:8: ", "fail what? open K, short K, closed K, nack K");
    refuses("at 5 = fail open", "s.ini:4:8: ", "fail open K");
    refuses("at 5 = repair ina_reset 1", "s.ini:4:8: ", "over at once");
    refuses("at 5 =", "s.ini:4:", "what happens is missing");
    refuses("after 5 = on 1", "s.ini:4:1: ", "at SECONDS");
    refuses("at five = on 1", "s.ini:4:1: ", "not a number");
    refuses("at -1 = on 1", "s.ini:4:1: ", "0 or more");
    refuses("at 61 = on 1", "s.ini:4:1: ", "after the end");
}

TEST(scenario_arguments_with_errors_are_refused)
{
    const auto refuses = [](const char *argument, const char *part) {
        expect(error_of([&] { parse_scenario(make_text_file("s.ini", SCENARIO), {argument}); }),
               "--set '", part);
    };
    refuses("scenario.duration_s", "write --set key=value");
    refuses("=3", "write --set key=value");
    refuses("events.at 5=on 1", "there is no section 'events'");
    refuses("scenario.duration_s=x", "not a number");
    refuses("scenario.colour=1", "no key 'colour'");
}

} // namespace
