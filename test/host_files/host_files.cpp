/* The readers and writers of docs/files.md: what they take, what they refuse, and where they say it
 * is. */
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

extern "C" {
#include <unity.h>
}

#include "log_file.h"
#include "model_file.h"
#include "scenario_file.h"
#include "text_file.h"

using namespace ninespring;

extern "C" void setUp(void) {}
extern "C" void tearDown(void) {}

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

void refuses_log(const std::string &text, const std::string &begin, const std::string &part)
{
    expect(error_of([&] { parse_log(make_text_file("a.csv", text)); }), begin, part);
}

void refuses_scenario(const std::string &text, const std::string &begin, const std::string &part)
{
    expect(error_of([&] { parse_scenario(make_text_file("s.ini", text, 197)); }), begin, part);
}

void refuses_model(const std::string &text, const std::string &begin, const std::string &part)
{
    expect(error_of([&] { parse_model(make_text_file("m.toml", text)); }), begin, part);
}

const std::string HEADER = "time_s,i1_a,t1_c\n";

void log_of_two_springs_is_read(void)
{
    const log_data log = parse_log(make_text_file(
        "a.csv", "\xEF\xBB\xBF# board: 7\r\n# no colon here\r\ntime_s, i1_a,v1_v,u2,t1_c,t2_c,fan,"
                 "ambient_c,m1_c,d1,limits1,cut1_a,state,note_who\r\n"
                 "0,1.5,0.26,0.5,20,,0,21,20,0.5,0,0.000,ok,me\r\n\r\n"
                 "# <limits|spring:1|t:0.480|supply|cut_a:0.500>\r\n"
                 "0.5,\"1.25\",0.25,1,20.5,30,1,21.5,x,0.5,4,0.500,ok,you"));
    TEST_ASSERT_EQUAL(2, log.springs.size());
    TEST_ASSERT_EQUAL(2, log.time_s.size());
    TEST_ASSERT_EQUAL_DOUBLE(1.25, log.springs[0].current_a[1]);
    TEST_ASSERT_EQUAL_DOUBLE(0.25, log.springs[0].voltage_v[1]);
    TEST_ASSERT_EQUAL(0, log.springs[0].command.size());
    TEST_ASSERT_EQUAL_DOUBLE(1.0, log.springs[1].command[1]);
    TEST_ASSERT_TRUE((std::isnan)(log.springs[1].temperature_c[0]));
    TEST_ASSERT_EQUAL_DOUBLE(30.0, log.springs[1].temperature_c[1]);
    TEST_ASSERT_EQUAL_DOUBLE(1.0, log.fan[1]);
    TEST_ASSERT_EQUAL_DOUBLE(21.5, log.ambient_c[1]);
}

void log_without_optional_columns_is_read(void)
{
    const log_data log = parse_log(make_text_file("a.csv", "u1,time_s\n1,0\n0.25,1e0\n"));
    TEST_ASSERT_EQUAL(1, log.springs.size());
    TEST_ASSERT_EQUAL(2, log.fan.size());
    TEST_ASSERT_EQUAL_DOUBLE(0.0, log.fan[1]);
    TEST_ASSERT_TRUE(log.ambient_c.empty());
    TEST_ASSERT_TRUE(log.springs[0].temperature_c.empty());
}

void log_columns_with_a_wrong_unit_are_refused_with_advice(void)
{
    refuses_log("time_s,i1_a,t1_f\n", "a.csv:1:13: ", "(F - 32) / 1.8 and name it t1_c");
    refuses_log("time_s,i12_ma,t1_c\n", "a.csv:1:8: ", "divide by 1000 and name it i12_a");
    refuses_log("time_s,i1_a,v1_mV\n", "a.csv:1:13: ", "divide by 1000 and name it v1_v");
    refuses_log("time_ms,i1_a\n", "a.csv:1:1: ", "divide by 1000 and name it time_s");
    refuses_log("Time,i1_a\n", "a.csv:1:1: ", "name it time_s");
    refuses_log("time_s,Q1_pct\n", "a.csv:1:8: ", "divide by 100 and name it u1");
    refuses_log("time_s,i1_a,t1\n", "a.csv:1:13: ", "if it is degC, name it t1_c");
    refuses_log("time_s,i1_a,ambient_f\n", "a.csv:1:13: ", "(F - 32) / 1.8");
    refuses_log("time_s,i1_a,weather\n", "a.csv:1:13: ", "note_");
}

void log_values_out_of_range_are_refused_with_advice(void)
{
    refuses_log(HEADER + "0,1500,20\n", "a.csv:2:3: ", "if it is in mA, divide by 1000");
    refuses_log("time_s,u1\n0,70\n", "a.csv:2:3: ", "if it is in percent, divide by 100");
    refuses_log("time_s,u1,fan\n0,0,50\n", "a.csv:2:5: ", "if it is in percent, divide by 100");
    refuses_log(HEADER + "0,1,900\n", "a.csv:2:5: ", "leave the field empty");
}

void log_values_that_are_no_numbers_are_refused(void)
{
    refuses_log(HEADER + "0,1,20\n1,nan,20\n", "a.csv:3:3: ", "column i1_a: 'nan'");
    refuses_log(HEADER + "0,1,NaN\n", "a.csv:2:5: ", "leave the field empty");
    refuses_log(HEADER + "0,inf,20\n", "a.csv:2:3: ", "not a finite number");
    refuses_log(HEADER + "0,,20\n", "a.csv:2:3: ", "a number is missing");
    refuses_log(HEADER + "0,1.5A,20\n", "a.csv:2:3: ", "'1.5A' is not a number");
    refuses_log(HEADER + "0,1e999,20\n", "a.csv:2:3: ", "too large");
    refuses_log(HEADER + "0,0x10,20\n", "a.csv:2:3: ", "not a number");
}

void decimal_commas_are_refused(void)
{
    refuses_log("time_s;i1_a;t1_c\n0;1,5;20,1\n", "a.csv:1:7: ", "separate them by ','");
    refuses_log(HEADER + "0,1,5,20,1\n", "a.csv:2:7: ", "decimal commas");
    refuses_log(HEADER + "0,\"1,5\",20\n", "a.csv:2:3: ", "decimal comma");
    refuses_log("time_s\ti1_a\n", "a.csv:1:7: ", "tabs");
}

void log_times_must_rise(void)
{
    refuses_log(HEADER + "0,1,20\n1,1,20\n1,1,20\n", "a.csv:4:1: ", "remove the duplicate row");
    refuses_log(HEADER + "5,1,20\n4,1,20\n", "a.csv:3:1: ", "does not rise: 4 after 5");
    refuses_log(HEADER + "nan,1,20\n", "a.csv:2:1: ", "time_s");
}

void log_with_missing_columns_is_refused(void)
{
    refuses_log("i1_a,t1_c\n0,20\n", "a.csv:1:1: ", "there is no column time_s");
    refuses_log("time_s,fan\n0,0\n", "a.csv:1:1: ", "there is no spring");
    refuses_log("time_s,i1_a,t3_c,i3_a\n", "a.csv:1:1: ", "spring 2 has neither i2_a nor u2");
    refuses_log("time_s,u1,v1_v\n", "a.csv:1:11: ", "v1_v is without i1_a");
    refuses_log("time_s,i1_a,i1_a\n", "a.csv:1:13: ", "appears twice");
    refuses_log("time_s,i1_a,,t1_c\n", "a.csv:1:13: ", "no name");
    refuses_log("time_s,i65_a\n", "a.csv:1:8: ", "at most 64");
    expect(
        error_of([] { parse_log(make_text_file("a.csv", "time_s,i1_a,i2_a,i3_a\n0,0,0,0\n"), 2); }),
        "a.csv:1:18: ", "the array has 2 springs");
}

void truncated_logs_are_refused(void)
{
    refuses_log(HEADER + "0,1,20\n1,1", "a.csv:3:4: ", "cut short");
    refuses_log(HEADER + "0,1\n1,1,20\n", "a.csv:2:4: ", "complete the row");
    refuses_log(HEADER, "a.csv:1:1: ", "no row");
    refuses_log("# a: b\n", "a.csv:1:1: ", "no line with column names");
    refuses_log("", "a.csv:1:1: ", "empty");
    refuses_log(HEADER + "0,\"1,20\n", "a.csv:2:3: ", "quote is not closed");
}

void files_that_are_not_text_are_refused(void)
{
    refuses_log(HEADER + "0," + std::string(1000000, '1') + ",20\n",
                "a.csv:2:65537: ", "1000005 characters");
    refuses_log(std::string("\xFF\xFEt\0", 4), "a.csv:1:1: ", "UTF-16");
    refuses_log(std::string("time_s,i1_a\n0,\0", 15), "a.csv:2:3: ", "zero byte");
    expect(error_of([] { read_log("no_such_file.csv"); }), "no_such_file.csv: ", "cannot be read");
    expect(error_of([] { read_log("."); }), ".: ", "is a folder");
}

void written_log_is_read_back(void)
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
    const log_data log = parse_log(make_text_file("w.csv", writer.text()));
    TEST_ASSERT_EQUAL_DOUBLE(0.5, log.springs[0].command[0]);
    TEST_ASSERT_TRUE((std::isnan)(log.springs[0].temperature_c[1]));
}

void file_is_written_whole_or_not_at_all(void)
{
    namespace fs = std::filesystem;
    const fs::path folder =
        fs::temp_directory_path() / ("ninespring_files_" + std::to_string(std::rand()));
    fs::create_directory(folder);
    const std::string path = (folder / "a.txt").string();
    write_file_whole(path, "one");
    write_file_whole(path, "two");
    std::ifstream stream(path);
    std::string text;
    stream >> text;
    TEST_ASSERT_EQUAL_STRING("two", text.c_str());
    bool failed = false;
    try {
        write_file_whole((folder / "none" / "a.txt").string(), "x");
    } catch (const work_error &) {
        failed = true;
    }
    TEST_ASSERT_TRUE(failed);
    TEST_ASSERT_EQUAL(1, std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
    fs::remove_all(folder);
}

const std::string MODEL = "schema = \"ninespring.model/1\"\n"
                          "[array]\nrows = 1\ncols = 2\npitch_mm = 30\n";

void model_is_read(void)
{
    const plant_parameter_t *per_spring = nullptr;
    const plant_parameter_t *of_array = nullptr;
    for (std::size_t k = 0; k < plant_parameter_count(); ++k) {
        const plant_parameter_t *one = plant_parameter(k);
        if (one->effect == nullptr) {
            (one->per_spring ? per_spring : of_array) = one;
        }
    }
    TEST_ASSERT_NOT_NULL(of_array);
    const auto block = [](const plant_parameter_t *one, const std::string &more) {
        return std::string("[[parameter]]\nname = \"") + one->name +
               "\"\nvalue = " + std::to_string(one->default_value) + "\nunit = \"" + one->unit +
               "\"\n" + more;
    };
    std::string text = "schema = \"ninespring.model/1\"\neffects = [\"latent_heat\"]\n"
                       "[array]\nrows = 1\ncols = 2\n" +
                       block(of_array, "stderr = 0.25\n");
    if (per_spring != nullptr) {
        text += block(per_spring, "spring = 2\n");
        refuses_model(MODEL + block(per_spring, "spring = 3\n"), "m.toml:10:10: ", "1 to 2");
    }
    const model_description model = parse_model(make_text_file("m.toml", text));
    TEST_ASSERT_EQUAL(2, model.array.cols);
    TEST_ASSERT_EQUAL_STRING("latent_heat", model.effects[0].first.c_str());
    TEST_ASSERT_EQUAL_DOUBLE(0.25, *model.parameters[0].stderr_value);
    refuses_model(MODEL + block(of_array, "") + block(of_array, ""),
                  "m.toml:12:9: ", "appears twice");
    refuses_model(MODEL + block(of_array, "effect = \"radiation\"\n"),
                  "m.toml:10:10: ", "belongs to no effect");
    refuses_model(MODEL + "[[parameter]]\nname = \"" + of_array->name +
                      "\"\nvalue = 1\nunit = \"furlong\"\n",
                  "m.toml:", of_array->unit);
    refuses_model(MODEL + "[[parameter]]\nname = \"" + of_array->name +
                      "\"\nvalue = nan\nunit = \"" + of_array->unit + "\"\n",
                  "m.toml:8:9: ", of_array->name);
}

void model_with_errors_is_refused(void)
{
    refuses_model("schema = \"other/9\"\n[array]\nrows=1\ncols=2\n",
                  "m.toml:1:10: ", "ninespring.model/1");
    refuses_model("[array]\nrows=1\ncols=2\n", "m.toml:1:1: ", "without schema");
    refuses_model("schema = \"ninespring.model/1\"\n", "m.toml:1:1: ", "without array");
    refuses_model(MODEL + "colour = 3\n", "m.toml:6:1: ", "no key 'colour'");
    refuses_model(MODEL + "rows = 2\n", "m.toml:6:8: ", "not TOML");
    refuses_model(MODEL + "[material]\nmass = 2\n", "m.toml:7:1: ", "no key 'mass'");
    refuses_model(MODEL + "[sensor]\nnoise_c = \"0.3\"\n", "m.toml:7:11: ", "without quotes");
    refuses_model(MODEL + "[spring]\nturns = inf\n", "m.toml:7:9: ", "turns");
    refuses_model("schema = \"ninespring.model/1\"\neffects = [\"latent_heet\"]\n[array]\nrows=1\n"
                  "cols=2\n",
                  "m.toml:2:12: ", "did you mean latent_heat?");
    refuses_model(MODEL + "[[parameter]]\nname = \"nothing\"\nvalue = 1\nunit = \"W\"\n",
                  "m.toml:7:8: ", "there is no parameter 'nothing'");
    refuses_model(MODEL + "[[parameter]]\nvalue = 1\n", "m.toml:6:", "without name");
    refuses_model(MODEL + "[[param", "m.toml:6:", "not TOML");
    refuses_model("schema = \"ninespring.model/1\"\n[array]\nrows=9\ncols=9\n",
                  "m.toml:4:6: ", "more than 64");
    refuses_model("schema = \"ninespring.model/1\"\n[array]\nrows=1.5\ncols=9\n",
                  "m.toml:3:6: ", "whole number");
}

const std::string SCENARIO = "[scenario]\nduration_s = 60\n";

void scenario_is_read(void)
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

void scenario_with_errors_is_refused(void)
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
}

void scenario_events_with_errors_are_refused(void)
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
    refuses("at 5 = policy best", "s.ini:4:8: ", "open or precompensate");
    refuses("at 5 = fan 101", "s.ini:4:8: ", "0 to 100");
    refuses("at 5 = fail melt 1", "s.ini:4:8: ", "fail what?");
    refuses("at 5 = fail open", "s.ini:4:8: ", "fail open K");
    refuses("at 5 = repair ina_reset 1", "s.ini:4:8: ", "over at once");
    refuses("at 5 =", "s.ini:4:", "what happens is missing");
    refuses("after 5 = on 1", "s.ini:4:1: ", "at SECONDS");
    refuses("at five = on 1", "s.ini:4:1: ", "not a number");
    refuses("at -1 = on 1", "s.ini:4:1: ", "0 or more");
    refuses("at 61 = on 1", "s.ini:4:1: ", "after the end");
}

void scenario_arguments_with_errors_are_refused(void)
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

void array_of_a_model_is_read_and_checked(void)
{
    const std::string schema = "schema = \"ninespring.model/1\"\n";
    const array_description array =
        parse_model(make_text_file("m.toml", schema + "[array]\nrows = 2\ncols = 3\npitch_mm = 4\n"
                                                      "[spring]\nwire_diameter_mm = 0.8\n"
                                                      "[sensor]\nkind = \"camera\"\n"))
            .array;
    TEST_ASSERT_EQUAL(2, array.rows);
    TEST_ASSERT_EQUAL_DOUBLE(4.0, *array.pitch_mm);
    TEST_ASSERT_EQUAL(1, array.spring.size());
    TEST_ASSERT_EQUAL_STRING("camera", array.sensor_kind.c_str());
    refuses_model(schema + "[array]\nrows = 2\n", "m.toml:2:1: ", "without cols");
    refuses_model(schema + "[array]\nrows = 2\ncols = 2\n[colour]\n",
                  "m.toml:5:2: ", "no key 'colour'");
}

} // namespace

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(log_of_two_springs_is_read);
    RUN_TEST(log_without_optional_columns_is_read);
    RUN_TEST(log_columns_with_a_wrong_unit_are_refused_with_advice);
    RUN_TEST(log_values_out_of_range_are_refused_with_advice);
    RUN_TEST(log_values_that_are_no_numbers_are_refused);
    RUN_TEST(decimal_commas_are_refused);
    RUN_TEST(log_times_must_rise);
    RUN_TEST(log_with_missing_columns_is_refused);
    RUN_TEST(truncated_logs_are_refused);
    RUN_TEST(files_that_are_not_text_are_refused);
    RUN_TEST(written_log_is_read_back);
    RUN_TEST(file_is_written_whole_or_not_at_all);
    RUN_TEST(model_is_read);
    RUN_TEST(model_with_errors_is_refused);
    RUN_TEST(array_of_a_model_is_read_and_checked);
    RUN_TEST(scenario_is_read);
    RUN_TEST(scenario_with_errors_is_refused);
    RUN_TEST(scenario_events_with_errors_are_refused);
    RUN_TEST(scenario_arguments_with_errors_are_refused);
    return UNITY_END();
}
