#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../run_tests.h"
#include "console.h"

#include "../fakes/belief_inside.h"
#include "../fakes/eeprom.h"
#include "../fakes/said.h"

#ifndef NINESPRING_SOURCE_DIR
#define NINESPRING_SOURCE_DIR "."
#endif

static controller_t controller;
static controller_inputs_t inputs;
static controller_outputs_t outputs;
static settings_t settings;
static settings_store_t store;
static learnt_store_t learnt;
static telemetry_t telemetry;
static console_status_t status;
static console_t console;
static int32_t weak_ma; /* all that spring 3 ever has; 0: as much as is wanted */

static bool by_duty; /* readings are the circuit's: 5 V, 0.18 ohm of loop and as much of spring */

void setUp(void)
{
    by_duty = false;
    memset(memory, 0xFF, sizeof memory);
    memset(&status, 0, sizeof status);
    memset(&inputs, 0, sizeof inputs);
    status.reset_cause = "power-on";
    status.version = "0.0";
    status.sensors = "test";
    status.ambient_c7 = inputs.ambient_c7 = 20 * 128;
    status.loaded = settings_load(&store, &storage, &settings);
    TEST_ASSERT_TRUE(controller_init(&controller, &settings.controller, 20 * 128, NULL));
    learnt_store_open(&learnt, &storage, SETTINGS_LEARNT_BASE, SETTINGS_LEARNT_SLOT_BYTES,
                      &controller);
    telemetry_init(&telemetry);
    console_init(&console, &output, &controller, &settings, &store, &learnt, &telemetry, &status);
    weak_ma = 0;
    room = 60000;
    forget();
}

/* One control tick with every spring's current exactly as wanted. */
static void tick(void)
{
    for (uint8_t k = 0; k < 9; k++) {
        inputs.sensor[k].current_ma = by_duty ? (int16_t)(outputs.duty[k] * 625u / 36u)
                                              : (int16_t)controller_target_ma(&controller, k);
        if (k == 2 && weak_ma != 0 && inputs.sensor[k].current_ma > weak_ma) {
            inputs.sensor[k].current_ma = (int16_t)weak_ma;
        }
        inputs.sensor[k].voltage_mv = (int16_t)((inputs.sensor[k].current_ma * 18 + 50) / 100);
    }
    controller_tick(&controller, &inputs, &outputs);
    status.ticks++;
    /* whatever is typed in these tests writes in the ways that are known */
    TEST_ASSERT_TRUE(controller_is_sound(&controller));
    TEST_ASSERT_TRUE(console_hold_settings(&console));
}

static void receive(const char *text)
{
    for (; *text != '\0'; text++) {
        console_receive(&console, (uint8_t)*text);
    }
}

static void type(const char *text)
{
    for (; *text != '\0'; text++) {
        for (unsigned turn = 0; !console_ready(&console); turn++) {
            TEST_ASSERT_LESS_THAN_UINT(20000, turn);
            console_service(&console);
            tick();
        }
        console_receive(&console, (uint8_t)*text);
    }
    for (unsigned turn = 0; console.job != 0; turn++) {
        TEST_ASSERT_LESS_THAN_UINT(20000, turn);
        console_service(&console);
        tick();
    }
}

/* What one line is answered with. */
static const char *ask(const char *line)
{
    forget();
    type(line);
    type("\n");
    return said;
}

/* Without a tick, which would age what it tells. */
static void ask_at_once(const char *line)
{
    forget();
    receive(line);
    receive("\n");
    while (console_busy(&console)) {
        console_service(&console);
    }
}

static unsigned answers(void)
{
    unsigned count = 0;
    for (const char *line = said; *line != '\0';) {
        const char *const end = strchr(line, '\n');
        TEST_ASSERT_NOT_NULL(end);
        if (strncmp(line, "ok\r", 3) == 0 || strncmp(line, "error:", 6) == 0) {
            count++;
        }
        line = end + 1;
    }
    return count;
}

static void expect_error(const char *line, console_error_t error)
{
    char want[16];
    const settings_t before = settings;
    controller_host_heard(&controller); /* by any line */
    const controller_t before_controller = controller;
    snprintf(want, sizeof want, "error:%d ", (int)error);
    ask(line);
    TEST_ASSERT_EQUAL_STRING_LEN_MESSAGE(want, said, strlen(want), line);
    TEST_ASSERT_EQUAL_UINT(1, answers());
    TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&before, &settings, sizeof before, line);
    TEST_ASSERT_EQUAL_MEMORY_MESSAGE(&before_controller, &controller, sizeof controller, line);
}

static void expect_ok(const char *line)
{
    ask(line);
    TEST_ASSERT_EQUAL_UINT_MESSAGE(1, answers(), line);
    TEST_ASSERT_TRUE_MESSAGE(said_length >= 4 && strcmp(said + said_length - 4, "ok\r\n") == 0,
                             said);
}

/* In either case, edited as it is typed, with blanks or a percent sign, or without. */
TEST(each_word_that_drives_springs_is_obeyed)
{
    static const struct {
        const char *line;
        uint8_t spring;
        uint16_t permille;
    } table[] = {{"on 3", 2, 1000},
                 {"on 4 25", 3, 250},
                 {"off 3", 2, 0},
                 {"on all 50", 8, 500},
                 {"off all", 8, 0},
                 {"  pattern   111101111 ", 5, 1000},
                 {"pattern 111101111", 4, 0},
                 {"on 5 40%", 4, 400},
                 {"ON 5 30", 4, 300},
                 {"Off ALL", 4, 0},
                 {"om\b\x7Fon 55\b 45\b0", 4, 400},
                 {"\boff all", 4, 0},
                 {"   ", 4, 0}};
    for (size_t n = 0; n < ROWS(table); n++) {
        row(n);
        expect_ok(table[n].line);
        TEST_ASSERT_EQUAL_UINT16(table[n].permille,
                                 controller_level_permille(&controller, table[n].spring));
    }
    said_length = 0;
    type("x\b\b\b\n"); /* nothing is left: an empty line */
    TEST_ASSERT_EQUAL_UINT(0, said_length);
}

TEST(each_other_word_is_obeyed)
{
    static const char *const lines[][2] = {{"policy precompensate", ""},
                                           {"fan 60", ""},
                                           {"ambient 23.5", ""},
                                           {"$Supply_V=6", ""},
                                           {"model", "spring 9: "},
                                           {"model cold", ""},
                                           {"why 9", "s ago: it is said to be known\r\n"},
                                           {"faults", ""},
                                           {"clear", ""},
                                           {"unlock", ""},
                                           {"help", "telemetry off|csv|teleplot"},
                                           {"version", "ninespring 0.0 mega2560, sensors test"},
                                           {"telemetry csv 10", "time_s,i1_a,v1_v,m1_c,d1,i2_a"},
                                           {"selftest", "spring 9: sensor ok, 0.180 ohm"}};
    for (size_t n = 0; n < ROWS(lines); n++) {
        expect_ok(lines[n][0]);
        expect_said(lines[n][1]);
    }
    TEST_ASSERT_EQUAL(DRIVE_POLICY_PRECOMPENSATE, controller_policy(&controller));
    TEST_ASSERT_EQUAL_UINT8(60, controller_fan_percent(&controller));
    TEST_ASSERT_EQUAL_INT16(2350, settings.board.ambient_cc);
    TEST_ASSERT_EQUAL_UINT16(6000, settings.controller.current.supply_mv);
    TEST_ASSERT_EQUAL_UINT8(TELEMETRY_CSV, telemetry.format);
    TEST_ASSERT_EQUAL_UINT8(10, telemetry.hz);
    TEST_ASSERT_EQUAL_UINT16(0, controller_level_permille(&controller, 8));
    expect_ok("telemetry off");
    TEST_ASSERT_EQUAL_UINT8(TELEMETRY_OFF, telemetry.format);
    expect_ok("policy open");
    TEST_ASSERT_EQUAL(DRIVE_POLICY_OPEN, controller_policy(&controller));
    expect_ok("fan 70%");
    TEST_ASSERT_EQUAL_UINT8(70, controller_fan_percent(&controller));
}

/* And of a line of the right form no form is said. */
TEST(what_else_is_refused_changes_nothing_either)
{
    char longest[CONSOLE_LINE_BYTES + 2u];
    expect_error("telemetry inputs 5", CONSOLE_ERROR_SURPLUS_ARGUMENT);
    expect_error("why 0", CONSOLE_ERROR_OUT_OF_RANGE);
    expect_error("why 1 2", CONSOLE_ERROR_SURPLUS_ARGUMENT);
    expect_error("$loss_w_per_k=1e-3", CONSOLE_ERROR_BAD_ARGUMENT);
    expect_error("on 99999999999999", CONSOLE_ERROR_OUT_OF_RANGE);
    expect_error("$loss_w_per_k=1", CONSOLE_ERROR_OUT_OF_RANGE);
    memset(longest, 'x', sizeof longest);
    longest[sizeof longest - 1u] = '\0';
    expect_error(longest, CONSOLE_ERROR_LINE_TOO_LONG);
    snprintf(longest, sizeof longest, "of more than %u characters", CONSOLE_LINE_BYTES);
    expect_said(longest);
    memset(longest, ' ', CONSOLE_LINE_BYTES);
    memcpy(longest, "fan 7", 5);
    longest[CONSOLE_LINE_BYTES] = '\0'; /* and as long as a line may be */
    expect_ok(longest);
    expect_error("on \x80 1", CONSOLE_ERROR_BAD_CHARACTER);
    expect_error("on\t1", CONSOLE_ERROR_BAD_CHARACTER);
    expect_error("$nonsense", CONSOLE_ERROR_UNKNOWN_SETTING);
    expect_error("$", CONSOLE_ERROR_UNKNOWN_SETTING);
    console_break_line(&console, CONSOLE_ERROR_INPUT_LOST);
    expect_error("on 1", CONSOLE_ERROR_INPUT_LOST);
    controller_lock(&controller);
    expect_error("on 1", CONSOLE_ERROR_LOCKED);
    TEST_ASSERT_EQUAL_STRING("error:10 locked after a reset; type unlock\r\n", said);
    expect_error("pattern 111111111", CONSOLE_ERROR_LOCKED);
    expect_error("selftest", CONSOLE_ERROR_LOCKED);
    expect_ok("off all");
    expect_ok("unlock");
    controller_emergency_stop(&controller);
    expect_error("on 1", CONSOLE_ERROR_FAULT);
    TEST_ASSERT_EQUAL_STRING("error:11 a fault is latched; see faults and type clear\r\n", said);
    expect_ok("clear");
    /* a replay begins anew: a sensor that was found to lie would be believed, without a word */
    safety_trip(&controller.safety, 4, SAFETY_FAULT_SENSOR_MISMATCH);
    expect_error("telemetry inputs", CONSOLE_ERROR_FAULT);
    expect_ok("clear");
    expect_ok("on 1");
    expect_error("selftest", CONSOLE_ERROR_SPRINGS_ON);
    expect_error("model cold", CONSOLE_ERROR_SPRINGS_ON);
    expect_error("telemetry inputs", CONSOLE_ERROR_SPRINGS_ON);
}

/* It would begin everything anew, without a word, and believe hot springs of before power-on. */
TEST(another_size_is_refused_while_a_spring_is_driven)
{
    static const char *const line[] = {"$rows=2", "$columns=1", "$rows=2", "$defaults"};
    expect_ok("unlock");
    for (unsigned n = 0; n < 4; n++) {
        if (n == 3) {
            expect_ok("off all");
            expect_ok("$rows=2");
            TEST_ASSERT_EQUAL_UINT8(6, controller_springs(&controller));
        }
        expect_ok("on 1");
        expect_error(line[n], CONSOLE_ERROR_SPRINGS_ON);
        TEST_ASSERT_EQUAL_STRING("error:16 switch all springs off first\r\n", said);
        TEST_ASSERT_EQUAL_UINT8(n == 3 ? 6 : 9, controller_springs(&controller));
        TEST_ASSERT_EQUAL_UINT16(1000, controller_level_permille(&controller, 0));
        TEST_ASSERT_TRUE(console_hold_settings(&console));
        expect_ok("$rows");
        TEST_ASSERT_EQUAL_STRING(n == 3 ? "$rows=2\r\nok\r\n" : "$rows=3\r\nok\r\n", said);
        expect_ok(n == 3 ? "$rows=2" : "$rows=3"); /* the size that it has */
    }
}

/* It would open under what is driven, and each spring would be said to be broken. */
TEST(relay_is_declared_away_only_while_no_spring_is_driven)
{
    expect_ok("unlock");
    expect_ok("on 1");
    expect_error("$cut_off=0", CONSOLE_ERROR_SPRINGS_ON);
    expect_ok("$cut_off=1"); /* what it is */
    TEST_ASSERT_TRUE(controller_supply_is_fitted(&controller));
    TEST_ASSERT_EQUAL_UINT16(1000, controller_level_permille(&controller, 0));
    expect_ok("off all");
    expect_ok("$cut_off=0");
    TEST_ASSERT_FALSE(controller_supply_is_fitted(&controller));
}

/* Every word, and every way to write it wrong; settings, too: its number, and its cure. */
TEST(every_refusal_says_what_would_be_right)
{
    static const struct {
        console_error_t error;
        const char *line;
        const char *says;
    } cases[] = {
        {1, "frobnicate", "unknown word; help lists them\r\n"},
        {1, "patern 111101111", "unknown word; help lists them: write pattern 111101111\r\n"},
        {1, "onn 5", ": write on K|all [0..100]\r\n"},
        {3, "help me", "too many arguments: write help\r\n"},
        {3, "version 2", ": write version\r\n"},
        {2, "on", "an argument is missing: write on K|all [0..100]\r\n"},
        {3, "on 1 2 3", ": write on K|all [0..100]\r\n"},
        {5, "on 5 200", "a number is out of range: the level is 0 to 100 percent, whole\r\n"},
        {4, "on 5 x",
         "an argument is not of the right form: the level is 0 to 100 percent, whole\r\n"},
        {4, "on 5 33.5", ": the level is 0 to 100 percent, whole\r\n"},
        {5, "on 5 101%", ": the level is 0 to 100 percent, whole\r\n"},
        {4, "on 5 %", ": the level is 0 to 100 percent, whole\r\n"},
        {4, "on 5 50%%", ": the level is 0 to 100 percent, whole\r\n"},
        {5, "on 10", "a number is out of range: springs are 1 to 9, or all\r\n"},
        {4, "on five", "an argument is not of the right form: springs are 1 to 9, or all\r\n"},
        {2, "off", ": write off K|all\r\n"},
        {5, "off 0", ": springs are 1 to 9, or all\r\n"},
        {5, "off -1", ": springs are 1 to 9, or all\r\n"},
        {4, "off 1.5", ": springs are 1 to 9, or all\r\n"},
        {3, "off 1 2", ": write off K|all\r\n"},
        {2, "pattern", ": write pattern 111101111\r\n"},
        {4, "pattern 11110111",
         "an argument is not of the right form: a pattern has 9 digits, 0 or 1; this has 8 "
         "characters\r\n"},
        {4, "pattern 1111011112", ": a pattern has 9 digits, 0 or 1; this has 10 characters\r\n"},
        {4, "pattern 111101112", ": a pattern has 9 digits, 0 or 1; character 9 is neither\r\n"},
        {4, "pattern 1l1101112", ": a pattern has 9 digits, 0 or 1; character 2 is neither\r\n"},
        {3, "pattern 111 101 111", ": write pattern 111101111\r\n"},
        {2, "policy", ": write policy open|precompensate\r\n"},
        {4, "policy closed", ": write policy open|precompensate\r\n"},
        {2, "fan", ": write fan 0..100\r\n"},
        {5, "fan 101", ": the fan is 0 to 100 percent, whole\r\n"},
        {4, "fan on", ": the fan is 0 to 100 percent, whole\r\n"},
        {2, "ambient", ": write ambient C\r\n"},
        {5, "ambient 200", ": ambient_c is -40.00 to 50.00 degC\r\n"},
        {4, "ambient warm", ": ambient_c is -40.00 to 50.00 degC\r\n"},
        {4, "model hot", ": write model [cold]\r\n"},
        {2, "why", ": write why K\r\n"},
        {5, "why 10", ": springs are 1 to 9\r\n"},
        {4, "why all", ": springs are 1 to 9\r\n"},
        {4, "learnt all", ": write learnt [clear]\r\n"},
        {3, "faults 1", ": write faults\r\n"},
        {3, "clear 1", ": write clear\r\n"},
        {3, "unlock 1", ": write unlock\r\n"},
        {3, "selftest 1", ": write selftest\r\n"},
        {2, "telemetry", ": write telemetry off|csv|teleplot|inputs [1..50]\r\n"},
        {4, "telemetry json", ": write telemetry off|csv|teleplot|inputs [1..50]\r\n"},
        {5, "telemetry csv 100", ": 1 to 50 lines a second\r\n"},
        {5, "telemetry csv 0", ": 1 to 50 lines a second\r\n"},
        {2, "echo", ": write echo on|off\r\n"},
        {4, "echo loud", ": write echo on|off\r\n"},
        {4, "supply maybe", ": write supply on|off\r\n"},
        {5, "$supply_v=900", "a number is out of range: supply_v is 1.000 to 16.000 V\r\n"},
        {4, "ambient 21,5", ": a decimal point, no comma\r\n"},
        {4, "$supply_v=5,5", "an argument is not of the right form: a decimal point, no comma\r\n"},
        {5, "$fault_bad_samples=51",
         ": fault_bad_samples is 1 to 50, for what docs/safety.md promises\r\n"},
        {5, "$stuck_on_a=0.501",
         ": stuck_on_a is 0.010 to 0.500 A, for what docs/safety.md promises\r\n"},
        {5, "$dither_a=0.199", ": dither_a is 0.200 to 0.400 A\r\n"},
        {5, "$over_current_a=3.151",
         ": over_current_a is 0.100 to 3.150 A, for what docs/safety.md promises\r\n"},
        {4, "$supply_v=5.0001",
         "an argument is not of the right form: a number with at most 3 decimals\r\n"},
        {4, "$supply_v=5V", ": supply_v is 1.000 to 16.000 V\r\n"},
        {4, "$supply_v=", ": supply_v is 1.000 to 16.000 V\r\n"},
        {5, "$loss_scale_9=0", ": loss_scale_9 is 0.001 to 8.000\r\n"},
        {4, "$resistance_martensite_rise_per_k=1e-3",
         ": resistance_martensite_rise_per_k is -0.003000 to 0.005000 1/K\r\n"},
        {8, "$supply_v 5", "no such setting; $$ lists them: write $NAME=VALUE, without blanks\r\n"},
        {8, "$supply_v = 5", ": write $NAME=VALUE, without blanks\r\n"},
        {8, "$supply=5", ": did you mean $supply_v?\r\n"},
        {8, "$loss_scale=1", ": did you mean $loss_scale_1?\r\n"},
        {8, "$loss_scale_99", ": did you mean $loss_scale_1?\r\n"},
        {8, "$nonsense=1", "no such setting; $$ lists them\r\n"},
    };
    for (unsigned k = 0; k < ROWS(cases); k++) {
        expect_error(cases[k].line, cases[k].error);
        expect_said(cases[k].says);
    }
    ask("help"); /* no word was left out */
    char listed[4096];
    strcpy(listed, said);
    for (char *line = strtok(listed, "\r\n"); line != NULL; line = strtok(NULL, "\r\n")) {
        const size_t length = strcspn(line, " ");
        bool found = line[0] < 'a' || line[0] > 'z' || strcmp(line, "ok") == 0;
        for (unsigned k = 0; k < ROWS(cases); k++) {
            found = found || strncmp(cases[k].line, line, length) == 0;
        }
        TEST_ASSERT_TRUE_MESSAGE(found, line);
    }
}

TEST(echo_shows_what_is_typed_and_one_answer_comes_as_ever)
{
    expect_ok("echo on");
    TEST_ASSERT_EQUAL_STRING("fan 71\b \b0\r\nok\r\n", ask("fan 71\b0"));
    said_length = 0;
    type("\n\r\n"); /* that the host lives is no line */
    TEST_ASSERT_EQUAL_UINT(0, said_length);
    room = CONSOLE_ANSWER_BYTES; /* the answer's: it begins a line of its own, whatever was shown
                                    before */
    TEST_ASSERT_EQUAL_STRING("\r\nok\r\n", ask("fan 7"));
    room = 60000;
    forget();
    type("fa");
    room = CONSOLE_ANSWER_BYTES;
    type("n 7\n");
    TEST_ASSERT_EQUAL_STRING("fa\r\nok\r\n", said);
    room = 60000;
    ask("echo off");
    TEST_ASSERT_EQUAL_STRING("ok\r\n", ask("fan 7"));
}

TEST(settings_that_do_not_fit_wait_until_they_do)
{
    expect_ok("$martensite_finish_c=80"); /* above its start, 78 */
    static const char both[] = "[not active yet: martensite_start_c=78.00 does not fit "
                               "martensite_finish_c=80.00]\r\n";
    static const char *const words[] = {"$save", "on 1", "pattern 100000000", "selftest"};
    TEST_ASSERT_EQUAL_STRING_LEN(both, said, sizeof both - 1u);
    TEST_ASSERT_EQUAL_INT16(6800, controller.model.parameters.martensite_finish_cc);
    for (unsigned k = 0; k < ROWS(words); k++) {
        ask(words[k]); /* neither kept nor driven with */
        TEST_ASSERT_EQUAL_STRING_LEN(both, said, sizeof both - 1u);
        TEST_ASSERT_EQUAL_STRING_LEN("error:9 ", said + sizeof both - 1u, 8);
        TEST_ASSERT_EQUAL_UINT16(0, controller_level_permille(&controller, 0));
    }
    expect_ok("off all");
    expect_ok("$austenite_finish_c=110");
    expect_ok("$austenite_start_c=105");
    expect_ok("$martensite_start_c=100");
    TEST_ASSERT_NULL(strstr(said, "[not active yet:"));
    TEST_ASSERT_EQUAL_INT16(8000, controller.model.parameters.martensite_finish_cc);
    expect_ok("$save");
}

TEST(cold_in_a_room_that_was_told_just_now_is_not_heated)
{
    status.ambient_c7 = 35 * 128; /* as after `ambient 35` in the same tick */
    expect_ok("model cold");
    TEST_ASSERT_EQUAL_STRING("ok\r\n", said);
    TEST_ASSERT_INT16_WITHIN(64, 35 * 128, controller_temperature_c7(&controller, 1));
}

TEST(what_was_heated_is_not_cold_because_someone_says_so)
{
    by_duty = true;
    expect_ok("model cold"); /* nothing was given yet */
    TEST_ASSERT_EQUAL_STRING("ok\r\n", said);
    expect_ok("policy open");
    expect_ok("on 2");
    for (int t = 0; t < 60 * 50; t++) {
        tick();
    }
    expect_ok("off all");
    for (int t = 0; t < 12 * 50; t++) {
        tick();
    }
    const int16_t before_c7 = controller_temperature_c7(&controller, 1);
    TEST_ASSERT_GREATER_THAN_INT16(40 * 128, before_c7);
    ask("model cold");
    TEST_ASSERT_EQUAL_STRING_LEN("[spring 2 was heated 1", said, 22);
    expect_said(" degC or more]\r\n");
    TEST_ASSERT_EQUAL_UINT(1, answers());
    TEST_ASSERT_INT16_WITHIN(128, before_c7, controller_temperature_c7(&controller, 1));
    /* a belief above the account of heat is no heat that was given, nor to its neighbour */
    thermal_model_set_temperature(&controller.model, 1, 90 * 128);
    thermal_model_set_temperature(&controller.model, 2, 60 * 128);
    temperature_ceiling_raise(&controller.ceiling, &controller.model);
    ask("model cold");
    TEST_ASSERT_EQUAL_STRING_LEN("[spring 2 was heated 1", said, 22);
    expect_said("[spring 3 was heated by others: 60 degC or more]\r\n");
}

/* Whatever order a restore has, it ends with the same, and in between nothing is refused. */
TEST(a_listing_pasted_backwards_makes_it_the_same)
{
    static char listing[32768];
    static char *lines[1024];
    unsigned count = 0;
    static const char *const wanted_lines[] = {
        "$temperature_trip_c=60", "$temperature_limit_c=55",   "$martensite_finish_c=30",
        "$martensite_start_c=40", "$austenite_start_c=44",     "$austenite_finish_c=50",
        "$unsure_margin_k=2",     "$hold_margin_k=1",          "$supply_limit_a=1",
        "$supply_reserve_a=0.1",  "$resistance_minimum_ohm=1", "$resistance_maximum_ohm=2"};
    for (unsigned k = 0; k < ROWS(wanted_lines); k++) {
        expect_ok(wanted_lines[k]);
    }
    TEST_ASSERT_FALSE(console.conflict);
    const settings_t wanted = settings;
    ask("$$");
    strcpy(listing, said);
    setUp();
    for (char *line = strtok(listing, "\r\n"); line != NULL; line = strtok(NULL, "\r\n")) {
        lines[count++] = line;
    }
    while (count-- > 0) {
        if (lines[count][0] == '$') {
            expect_ok(lines[count]);
        }
    }
    TEST_ASSERT_FALSE(console.conflict);
    TEST_ASSERT_EQUAL_MEMORY(&wanted, &settings, sizeof wanted);
    TEST_ASSERT_EQUAL_INT16(6000, controller.safety.parameters.temperature_trip_cc);
}

/* Every setting at either end: what is said stays finite. Together: script/fuzz. */
TEST(every_corner_of_the_settings_is_answered_in_numbers)
{
    static const char *const never[] = {"nan", "inf", "2147483648", "2147483647", "214748364."};
    static const char *const words[] = {"model", "learnt", "model cold", "$$"};
    unsigned active = 0;
    for (unsigned corner = 0; corner < 2u * PARAMETER_COUNT; corner++) {
        const uint16_t number = (uint16_t)(corner / 2u);
        const parameter_row_t known = parameter_row(number);
        setUp();
        here("%s", known.name);
        settings_set(&settings, number, 0, corner % 2u != 0 ? known.maximum : known.minimum);
        if (!controller_apply_settings(&controller, &settings.controller, NULL)) {
            continue;
        }
        active++;
        console_init(&console, &output, &controller, &settings, &store, &learnt, &telemetry,
                     &status);
        (void)controller_set_target(&controller, 0, 1000);
        for (int t = 0; t < 150; t++) {
            tick();
        }
        for (uint8_t k = 0; k < controller_springs(&controller); k++) {
            const float numbers[] = {controller_temperature_bounds_c(&controller, k).low,
                                     controller_temperature_bounds_c(&controller, k).high,
                                     controller_distance_bounds_k(&controller, k).low,
                                     controller_distance_bounds_k(&controller, k).high,
                                     controller_austenite_bounds(&controller, k).value,
                                     controller_delivered_c(&controller, k)};
            for (unsigned n = 0; n < ROWS(numbers); n++) {
                TEST_ASSERT_TRUE(fabsf(numbers[n]) < 1e4f);
            }
            TEST_ASSERT_TRUE(controller_cooling_s(&controller, k) <= CONTROLLER_COOLING_MOST_S);
        }
        for (unsigned w = 0; w < ROWS(words); w++) {
            ask(words[w]);
            for (unsigned n = 0; n < ROWS(never); n++) {
                TEST_ASSERT_NULL_MESSAGE(strstr(said, never[n]), said);
            }
        }
    }
    TEST_ASSERT_GREATER_THAN_UINT(100, active);
}

TEST(a_loss_that_never_cools_is_refused_with_what_it_would_have_to_cool)
{
    expect_error("$loss_w_per_k=0", CONSOLE_ERROR_OUT_OF_RANGE);
    expect_ok("$loss_w_per_k=0.00001");
    expect_said("loss_w_per_k=0.000010 does not fit heat_capacity_j_per_k=0.300]");
}

TEST(version_says_what_became_of_the_stored_settings)
{
    static const struct {
        settings_loaded_t loaded;
        const char *text;
    } cases[] = {
        {{RECORD_LOADED, 0, 0, 0}, "settings loaded\r"},
        {{RECORD_LOADED, 4, 1, 71},
         "settings loaded; 4 not stored, at defaults; 1 dropped, first id 71\r"},
        {{RECORD_LOADED_OTHER, 0, 0, 0}, "the other copy is damaged or was cut short\r"},
        {{RECORD_EMPTY, PARAMETER_COUNT, 0, 0}, "settings none saved, defaults\r"},
        {{RECORD_DAMAGED, PARAMETER_COUNT, 0, 0}, "settings stored ones damaged, defaults\r"},
        {{RECORD_FOREIGN, PARAMETER_COUNT, 0, 0}, "settings stored by another version, defaults\r"},
    };
    for (unsigned k = 0; k < ROWS(cases); k++) {
        status.loaded = cases[k].loaded;
        ask("version");
        expect_said(cases[k].text);
    }
}

TEST(version_says_that_settings_were_saved_since_the_boot_found_none)
{
    status.loaded = (settings_loaded_t){.found = RECORD_EMPTY, .missing = PARAMETER_COUNT};
    expect_ok("$save");
    ask("version");
    expect_said("settings saved\r");
    expect_ok("$supply_v=5.2"); /* what is active is another matter */
    ask("version");
    expect_said("settings saved\r");
}

/* Nine springs take longer than a program may be silent. */
TEST(selftest_is_no_silence_of_the_host_and_says_which_spring_has_too_little_current)
{
    expect_ok("$host_timeout_s=1");
    expect_ok("selftest");
    expect_said("spring 3: sensor ok, 0.180 ohm\r");
    expect_said("spring 9: sensor ok, 0.180 ohm\r");
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, controller_board_fault(&controller));
    weak_ma = SELFTEST_CURRENT_MA / 2u;
    ask("selftest");
    expect_said("error:17 ");
    expect_said("spring 3: sensor ok, too little current\r");
    expect_said("spring 4: sensor ok, 0.180 ohm\r");
}

TEST(selftest_gives_the_policy_back_also_when_it_is_stopped)
{
    expect_ok("policy precompensate");
    expect_ok("selftest");
    TEST_ASSERT_EQUAL(DRIVE_POLICY_PRECOMPENSATE, controller_policy(&controller));
    receive("selftest\n");
    console_service(&console);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_OPEN, controller_policy(&controller));
    TEST_ASSERT_EQUAL_UINT16(1000, controller_level_permille(&controller, 0));
    TEST_ASSERT_EQUAL_UINT16(SELFTEST_CURRENT_MA, controller.policy.parameters.open_current_ma);
    console_stop(&console);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_PRECOMPENSATE, controller_policy(&controller));
    TEST_ASSERT_EQUAL_UINT16(0, controller_level_permille(&controller, 0));
    TEST_ASSERT_EQUAL_UINT16(1500, controller.policy.parameters.open_current_ma);
}

/* It was asked for what open_current_a is, and was not sound with 0.15 A of it or less. */
TEST(selftest_finds_a_sound_board_sound_whatever_current_was_set)
{
    static const char *const sets[] = {"$open_current_a=0", "$open_current_a=0.15",
                                       "$open_current_a=3.2", "$maximum_current_a=0.12"};
    for (unsigned k = 0; k < sizeof sets / sizeof *sets; k++) {
        expect_ok(sets[k]);
        expect_ok("selftest");
    }
    expect_ok("$maximum_current_a=0.04"); /* which tells nothing of a spring */
    ask("selftest");
    expect_said("spring 1: sensor ok, too little current\r");
}

TEST(nothing_is_said_without_room_and_a_stop_drops_what_had_begun)
{
    type("on a");
    console_stop(&console);
    type("ll\n");
    TEST_ASSERT_EQUAL_STRING_LEN("error:12 ", said, 9);
    TEST_ASSERT_EQUAL_UINT(1, answers());
    TEST_ASSERT_EQUAL_UINT16(0, controller_level_permille(&controller, 0));
    forget();
    room = CONSOLE_ROOM_BYTES - 1u;
    TEST_ASSERT_FALSE(console_ready(&console));
    room = 60000;
    receive("$$\n");
    room = CONSOLE_ROOM_BYTES - 1u;
    console_service(&console);
    TEST_ASSERT_EQUAL_UINT(0, said_length);
    room = 60000;
    console_service(&console);
    console_stop(&console);
    TEST_ASSERT_TRUE(console_ready(&console));
    TEST_ASSERT_EQUAL_UINT(1, answers());
    expect_said("error:12 ");
}

/* What begins to tell is silent until it does: a stop in between leaves what told before. */
TEST(a_stop_leaves_the_telemetry_that_was_on)
{
    static const char *const begins[] = {"telemetry teleplot 10\n", "telemetry off\n",
                                         "telemetry inputs\n"};
    for (size_t n = 0; n < sizeof begins / sizeof begins[0]; n++) {
        row(n);
        expect_ok("telemetry csv 7");
        receive(begins[n]);
        console_stop(&console);
        TEST_ASSERT_EQUAL_UINT8(TELEMETRY_CSV, telemetry.format);
        TEST_ASSERT_EQUAL_UINT8(7, telemetry.hz);
        TEST_ASSERT_EQUAL_UINT8(TELEMETRY_CSV, settings.board.telemetry_format);
    }
}

TEST(status_is_one_line_and_says_what_the_thermistor_cannot_mean)
{
    expect_ok("model cold");
    for (unsigned held = 0; held < 2; held++) {
        status.ambient_is_held = held != 0;
        expect_ok("faults");
        TEST_ASSERT_EQUAL(held != 0,
                          strstr(said, "thermistor: no room is as it says, 20.00 degC holds\r\n") !=
                              NULL);
        said_length = 0;
        console_print_status(&console);
        TEST_ASSERT_EQUAL_STRING_LEN("<off|t:0.000|sum_a:0.000|hottest_c:20.00@1|fan:0|fault:0|",
                                     said, 57);
        TEST_ASSERT_EQUAL_PTR(said + said_length - 1u, strchr(said, '\n'));
        TEST_ASSERT_EQUAL(held != 0, strstr(said, "|ambient:held>\r\n") != NULL);
    }
}

TEST(a_fault_that_a_clear_leaves_says_for_how_long)
{
    temperature_ceiling_step(&controller.ceiling, &controller.model, 3, 1.0f); /* heated just now */
    for (unsigned n = 0; n < 2; n++) {
        safety_trip(&controller.safety, 3, SAFETY_FAULT_SENSOR_MISMATCH);
        expect_ok("faults");
        expect_said("spring 4: fault 15 sensor_mismatch");
        TEST_ASSERT_EQUAL(n != 0, strstr(said, "mismatch: clear again in 5") != NULL);
        expect_ok("clear");
        TEST_ASSERT_EQUAL(n != 0,
                          strstr(said, "spring 4: fault 15 sensor_mismatch: clear ") != NULL);
        TEST_ASSERT_EQUAL(n == 0, strcmp(said, "ok\r\n") == 0);
    }
}

TEST(an_ambient_that_a_thermistor_overrules_says_so)
{
    expect_ok("ambient 25");
    TEST_ASSERT_EQUAL_STRING("ok\r\n", said);
    expect_ok("$ambient_source=1");
    expect_ok("ambient 26");
    expect_said("[not now: the thermistor tells it, ambient_source=1]\r\nok");
    TEST_ASSERT_EQUAL_INT16(2600, settings.board.ambient_cc);
}

/* And without a cut-off what may be switched says why it is refused. */
TEST(status_says_whether_the_stages_have_their_supply)
{
    const char *const lines[] = {"supply on", "supply off", "$cut_off=0", "$cut_off=1"};
    const char *const ends[] = {"|supply:on>\r\n", "|supply:off>\r\n", "|supply:none>\r\n",
                                "|supply:off>\r\n"}; /* as it was */
    for (unsigned k = 0; k < 4; k++) {
        expect_ok(lines[k]);
        controller_tick(&controller, &inputs, &outputs);
        said_length = 0;
        console_print_status(&console);
        TEST_ASSERT_EQUAL_STRING(ends[k], said + said_length - strlen(ends[k]));
    }
    expect_ok("supply on");
    expect_ok("$cut_off=0");
    expect_error("supply off", CONSOLE_ERROR_NOT_AVAILABLE);
    TEST_ASSERT_EQUAL_STRING(
        "error:15 not available on this board: by cut_off=0 no relay is fitted\r\n", said);
}

TEST(model_says_with_which_bounds)
{
    char wanted[160];
    expect_ok("model cold");
    ask_at_once("model"); /* a tick would move the bounds */
    const spring_bounds_t c = controller_temperature_bounds_c(&controller, 8);
    const spring_bounds_t k = controller_distance_bounds_k(&controller, 8);
    TEST_ASSERT_TRUE(c.low < 15.0f && c.low > 0.0f && c.high > 25.0f && c.high < 40.0f);
    snprintf(wanted, sizeof wanted,
             "spring 9: 20.0 degC, %.1f to %.1f, 58.0 K below martensite start (+-%.1f), "
             "austenite 0.0 %%, 0.0 to %.1f\r\n",
             (double)c.low, (double)c.high, (double)(k.high - k.value),
             100.0 * (double)controller_austenite_bounds(&controller, 8).high);
    expect_said(wanted);
    expect_said("\r\n  0.000 A, 0.000 V, 0.000000 W, target 0.000 A\r\n"
                "ambient: 20.00 degC\r\n"
                "found: supply 5.00 V, diodes 0.00 V +-0.30; declared: 5.00 V, 0.00 V\r\nok\r\n");
}

/* And `faults` where it was held against somebody. */
TEST(what_feeds_the_springs_is_told_as_it_was_found)
{
    static const char wanted[] =
        "\r\nfound: supply 4.86 V, diodes 0.38 V +-0.03; declared: 5.25 V, 0.30 V\r\nok\r\n";
    expect_ok("$supply_v=5.25");
    expect_ok("$freewheel_v=0.3");
    controller.source.drop_mv = 384.0f;
    controller.source.step_mv = (4856.0f + 384.0f) / 800.0f;
    controller.source.unsure_mv = 62.0f;
    ask_at_once("model");
    expect_said(wanted);
    ask_at_once("faults");
    TEST_ASSERT_EQUAL_STRING("ok\r\n", said);
    safety_trip(&controller.safety, 3, SAFETY_FAULT_SENSOR_MISMATCH);
    safety_trip(&controller.safety, 4, SAFETY_FAULT_OPEN_SPRING);
    ask_at_once("faults");
    expect_said("spring 4: fault 15 sensor_mismatch");
    expect_said(wanted);
    TEST_ASSERT_NOT_NULL(strstr(said, "\r\nspring 5: fault 2 "));
}

/* What the held springs have in common; one alone has nothing in common. */
TEST(model_says_what_the_surroundings_take)
{
    static const float more[] = {0.28f, 0.34f};
    expect_ok("model cold");
    const float loss_w_per_k = 1e-6f * (float)settings.controller.model.loss_uw_per_k;
    for (unsigned k = 0; k < 2; k++) {
        spring_belief_t *const inside = belief_inside(&controller.estimator, (uint8_t)k);
        const float sd_w_per_k = 0.05f * loss_w_per_k;
        inside->possible = SPRING_PHASE_AUSTENITE;
        inside->fresh = 1;
        inside->heating = false;
        inside->learnt.loss_w_per_k = more[k] * loss_w_per_k;
        inside->loss_variance = sd_w_per_k * sd_w_per_k;
        ask_at_once("model"); /* in a tick no current would flow */
        TEST_ASSERT_EQUAL_MESSAGE(
            k == 1,
            strstr(said, "surroundings: losses 1.31 +-0.05 of what is declared\r\nfound:") != NULL,
            said);
        expect_said("ok\r\n");
    }
}

TEST(model_says_how_long_a_spring_waits_and_when_it_is_away)
{
    expect_ok("model"); /* before anybody asks for a spring, too */
    const char *const unknown = strstr(said, ", target 0.000 A\r\n  not known for ");
    TEST_ASSERT_NOT_NULL(unknown);
    TEST_ASSERT_FLOAT_WITHIN(2.0f, controller_cooling_s(&controller, 0),
                             strtof(strstr(unknown, " for ") + 5, NULL));
    expect_ok("policy precompensate");
    expect_ok("on 2");
    for (unsigned t = 0; t < 50; t++) {
        tick();
    }
    expect_ok("model");
    expect_said(", heat\r\n");
    const char *const waits = strstr(said, "  waits ");
    TEST_ASSERT_NOT_NULL(waits);
    TEST_ASSERT_NOT_NULL(strstr(waits, " s: it may still be hot from before power-on\r\n"));
    const float seconds = controller_cooling_s(&controller, 1);
    TEST_ASSERT_FLOAT_WITHIN(2.0f, seconds, strtof(waits + 8, NULL));
    TEST_ASSERT_NULL(strstr(waits + 8, "  waits ")); /* nobody else is driven */
    expect_ok("off all");
    controller.policy.spring[4].limits = DRIVE_POLICY_LIMIT_AWAY;
    controller.policy.spring[5].limits = DRIVE_POLICY_LIMIT_SUPPLY | DRIVE_POLICY_LIMIT_TEMPERATURE;
    controller.policy.spring[5].wanted_ma = 3000;
    controller.policy.spring[5].target_ma = 1800;
    room = CONSOLE_ROOM_BYTES * 2u;
    ask_at_once("model"); /* a tick would judge the spring anew */
    expect_said(", limits away\r\n  away: not where it was asked to be");
    expect_said(", limits supply temperature: 1.200 A less\r\n");
}

TEST(why_says_the_last_sights_of_a_spring_in_words)
{
    spring_sights_t *const sights = sights_inside(&controller.estimator);
    ask_at_once("why 5");
    TEST_ASSERT_EQUAL_STRING("[nothing was seen of spring 5 in the last 4 hours]\r\nok\r\n", said);
    spring_sight_t *sight = spring_sights_add(sights, 4);
    sight->kind = SPRING_SIGHT_COOLED;
    sight->now = -580;
    sight->now_sd = 59;
    sight->did = SPRING_DID_HEAT;
    (void)spring_sights_add(sights, 3); /* of another spring */
    sights->turn = 481;
    *(sight = spring_sights_add(sights, 4)) = sight_with_numbers(4);
    sight->number = 2;
    sight->turn = 481;
    sight->did = SPRING_DID_OPEN | SPRING_DID_BLIND;
    sights->turn = 500;
    ask_at_once("WHY 5");
    TEST_ASSERT_EQUAL_STRING(
        "  125.0 s ago: it must have cooled by now\r\n"
        "    of martensite start: now 58.0 K below (sd 5.9)\r\n"
        "    moved 0.0 K, shift 0.0 K, loss 0.00 %; heated\r\n"
        "  4.7 s ago: it loses phase, reads 1.32 % less than predicted (sd 0.05)\r\n"
        "    of martensite start: believed 2.4 K above (sd 1.8), seen 0.8 K below (sd 1.2), now "
        "0.1 K above (sd 1.0)\r\n"
        "    moved -2.3 K, shift 0.4 K, loss 1.20 %; blind, a step of the surroundings\r\n"
        "ok\r\n",
        said);
}

/* As a spring is driven, its lines come one by one; others have much to tell meanwhile. */
TEST(why_goes_on_with_what_is_left_where_sights_give_way)
{
    spring_sights_t *const sights = sights_inside(&controller.estimator);
    for (unsigned n = 0; n < SPRING_SIGHTS_KEPT; n++) {
        spring_sights_add(sights, 8)->now_sd = 1;
    }
    forget();
    receive("why 9\n");
    console_service(&console);
    console_service(&console);
    for (unsigned n = 0; n < SPRING_SIGHTS_KEPT - 1u; n++) { /* all but one, and it is not it */
        spring_sights_add(sights, 8)->kind = SPRING_SIGHT_JUMPED;
    }
    while (console_busy(&console)) {
        console_service(&console);
    }
    /* one was begun, one was left */
    TEST_ASSERT_EQUAL_UINT(2, occurrences("it begins to transform"));
    TEST_ASSERT_EQUAL_UINT(SPRING_SIGHTS_KEPT - 1u,
                           occurrences("contact or sensor jumps\r\n    of"));
    TEST_ASSERT_EQUAL_UINT(1, answers());
}

TEST(the_longest_why_fits_its_lines)
{
    spring_sight_t *const sight = spring_sights_add(sights_inside(&controller.estimator), 8);
    *sight = sight_of_most_digits(8);
    for (uint8_t kind = 0; kind < SPRING_SIGHT_KINDS; kind++) {
        sight->kind = kind;
        sights_inside(&controller.estimator)->turn = SPRING_SIGHTS_TURNS;
        ask_at_once("why 9");
        expect_said("than predicted (sd 2.55)\r\n");
        expect_said("now 255.0 K below (sd 25.5)\r\n");
        expect_said("phase seems to be missing\r\nok\r\n");
    }
}

/* All begins anew but what was learnt; then each line is told where it takes effect. */
TEST(inputs_begin_anew_with_what_was_learnt)
{
    const spring_learnt_t numbers = {
        .austenite_ohm = 0.219f, .change = 0.2f, .loss_sd_w_per_k = 0.000058f};
    controller_restore_learnt(&controller, 8, &numbers);
    expect_ok("model cold");
    expect_ok("fan 30");
    TEST_ASSERT_EQUAL_FLOAT(0.0f, controller_cooling_s(&controller, 0));
    expect_ok("telemetry inputs");
    expect_said("<learnt|spring:9|8941603E"); /* 0.219 as it lies in RAM */
    expect_said(">\r\n<start|ambient_c7:2560|fan:30|warm:0>\r\nok\r\n");
    TEST_ASSERT_EQUAL_UINT8(TELEMETRY_INPUTS, telemetry.format);
    TEST_ASSERT_TRUE(controller_cooling_s(&controller, 0) > 30.0f);
    TEST_ASSERT_EQUAL_UINT8(30, controller_fan_percent(&controller));
    TEST_ASSERT_EQUAL_FLOAT(0.219f, controller_learnt(&controller, 8).austenite_ohm);
    expect_ok("ON 3");
    TEST_ASSERT_EQUAL_STRING("<typed|ON 3>\r\nok\r\n", said);
    expect_ok("$supply_v=5.00"); /* a setting does not end it */
    TEST_ASSERT_EQUAL_UINT8(TELEMETRY_INPUTS, telemetry.format);
    said_length = 0;
    console_stop(&console);
    TEST_ASSERT_EQUAL_STRING("<typed|!>\r\n", said);
    expect_ok("telemetry off");
    expect_ok("off all");
    TEST_ASSERT_EQUAL_STRING("ok\r\n", said);
    controller_lock(&controller);
    expect_error("telemetry inputs", CONSOLE_ERROR_LOCKED);
}

TEST(learnt_says_what_is_known_and_clear_forgets_it)
{
    const spring_learnt_t numbers = {.austenite_ohm = 0.219f,
                                     .change = 0.2f,
                                     .martensite_ohm = 0.1752f,
                                     .martensite_rise_per_k = 0.0004f,
                                     .loss_w_per_k = -0.00029f,
                                     .loss_sd_w_per_k = 0.000058f};
    expect_ok("learnt");
    expect_said("spring 9: nothing yet\r\n");
    controller_restore_learnt(&controller, 8, &numbers);
    belief_inside(&controller.estimator, 8)->shift_k = 2.5f;
    expect_ok("learnt");
    expect_said("spring 8: nothing yet\r\n"
                "spring 9: 0.1752 ohm at 20 degC, 0.040 % per K, austenite "
                "0.2190 ohm, 25.0 % more, loss -5.0 % (+-1.0), shift 2.5 K");
    expect_error("learnt forget", CONSOLE_ERROR_BAD_ARGUMENT);
    expect_ok("on 1");
    expect_error("learnt clear", CONSOLE_ERROR_SPRINGS_ON);
    expect_ok("off all");
    expect_ok("learnt clear");
    expect_ok("learnt");
    expect_said("spring 9: nothing yet\r\n");
}

/* --- one table of codes ----------------------------------------------------------------------- */

static char *read_file(const char *name)
{
    static char text[65536];
    char path[1024];
    snprintf(path, sizeof path, "%s/%s", NINESPRING_SOURCE_DIR, name);
    FILE *const file = fopen(path, "rb");
    TEST_ASSERT_NOT_NULL_MESSAGE(file, path);
    const size_t length = fread(text, 1, sizeof text - 1u, file);
    fclose(file);
    text[length] = '\0';
    return text;
}

TEST(codes_table_holds_what_the_code_says)
{
    unsigned errors = 0;
    unsigned faults = 0;
    char *const text = read_file("docs/codes.csv");
    char *line = strtok(text, "\r\n");
    TEST_ASSERT_EQUAL_STRING("kind,number,name,text", line);
    while ((line = strtok(NULL, "\r\n")) != NULL) {
        char kind[16];
        char name[40];
        char what[160];
        int number;
        TEST_ASSERT_EQUAL_MESSAGE(
            4, sscanf(line, "%15[^,],%d,%39[^,],%159[^\n]", kind, &number, name, what), line);
        if (strcmp(kind, "error") == 0) {
            TEST_ASSERT_EQUAL_STRING(console_error_name((console_error_t)number), name);
            TEST_ASSERT_EQUAL_STRING(console_error_text((console_error_t)number), what);
            errors++;
        } else {
            TEST_ASSERT_EQUAL_STRING("fault", kind);
            TEST_ASSERT_EQUAL_STRING(safety_fault_name((safety_fault_t)number), name);
            faults++;
        }
    }
    TEST_ASSERT_EQUAL_UINT(CONSOLE_ERROR_END - 1, errors);
    TEST_ASSERT_EQUAL_UINT(SAFETY_FAULT_COUNT - 1, faults);
}

TEST(documentation_names_every_error_fault_and_word)
{
    char wanted[120];
    const char *const text = read_file("docs/console.md");
    for (int number = 1; number < CONSOLE_ERROR_END + SAFETY_FAULT_COUNT - 1; number++) {
        const int fault = number - CONSOLE_ERROR_END + 1;
        snprintf(wanted, sizeof wanted, "| %d | `%s` |", fault > 0 ? fault : number,
                 fault > 0 ? safety_fault_name((safety_fault_t)fault)
                           : console_error_name((console_error_t)number));
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, wanted), wanted);
    }
    ask("help");
    for (char *line = strtok(said, "\r\n"); line != NULL; line = strtok(NULL, "\r\n")) {
        if (line[0] < 'a' || line[0] > 'z' || strcmp(line, "ok") == 0) {
            continue;
        }
        snprintf(wanted, sizeof wanted, "| `%.*s", (int)strcspn(line, " "), line);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, wanted), wanted);
    }
}

/* What the console works on: its words would land beside it. */
TEST(a_pointer_that_turned_over_is_found)
{
    uint8_t *const bytes[] = {(uint8_t *)&console.controller, (uint8_t *)&console.output.context,
                              (uint8_t *)&console.status};
    for (size_t k = 0; k < ROWS(bytes); k++) {
        setUp();
        TEST_ASSERT_TRUE(console_hold_settings(&console));
        *bytes[k] ^= 2u;
        bool sound = true;
        for (size_t tick_of_two = 0; tick_of_two < sizeof settings / 4; tick_of_two++) {
            sound = console_hold_settings(&console);
        }
        TEST_ASSERT_FALSE(sound);
    }
}

/* `$save` would keep what nobody set. */
TEST(a_setting_that_turned_over_is_found_and_never_saved)
{
    for (size_t at = 0; at < sizeof settings; at += 5) {
        setUp();
        ((uint8_t *)&settings)[at] ^= 0x20u;
        if (at % 2 == 0) {
            const uint16_t before = console.scrub.sealed;
            type("echo off\n"); /* a line that sets nothing seals nothing */
            TEST_ASSERT_EQUAL_UINT(before, console.scrub.sealed);
            for (size_t tick_of_two = 0; tick_of_two < sizeof settings / 4; tick_of_two++) {
                (void)console_hold_settings(&console);
            }
        } else {
            (void)ask("$save");
            expect_said("error:14");
            TEST_ASSERT_EQUAL_UINT8(0xFF, memory[0]);
        }
        TEST_ASSERT_FALSE(console_hold_settings(&console));
    }
    static const char *const writers[] = {"$loss_w_per_k=0.006", "$defaults", "policy open",
                                          "ambient 21"};
    for (size_t n = 0; n < ROWS(writers); n++) {
        setUp();
        settings.board.sensor_averaging ^= 8u;
        type(writers[n]);
        console_receive(&console, '\n');
        TEST_ASSERT_FALSE_MESSAGE(console_hold_settings(&console), writers[n]);
    }
}
