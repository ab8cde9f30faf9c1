#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "console.h"
#include "unity.h"

#include "../fakes/eeprom.h"

#ifndef NINESPRING_SOURCE_DIR
#define NINESPRING_SOURCE_DIR "."
#endif

static char said[65536];
static size_t said_length;
static uint16_t room = 60000;

static uint16_t out_room(void *context)
{
    (void)context;
    return room;
}

static void out_write(void *context, const char *bytes, uint8_t length)
{
    (void)context;
    TEST_ASSERT_LESS_OR_EQUAL_UINT(room, length);
    TEST_ASSERT_LESS_THAN_UINT(sizeof said - 1u, said_length + length);
    memcpy(said + said_length, bytes, length);
    said_length += length;
    said[said_length] = '\0';
}

static const text_output_t output = {NULL, out_room, out_write};
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

void setUp(void)
{
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
    said_length = 0;
    said[0] = '\0';
}

void tearDown(void) {}

/* One control tick with every spring's current exactly as wanted. */
static void tick(void)
{
    for (uint8_t k = 0; k < 9; k++) {
        inputs.sensor[k].current_ma = (int16_t)controller_target_ma(&controller, k);
        if (k == 2 && weak_ma != 0 && inputs.sensor[k].current_ma > weak_ma) {
            inputs.sensor[k].current_ma = (int16_t)weak_ma;
        }
        inputs.sensor[k].voltage_mv = (int16_t)((inputs.sensor[k].current_ma * 18 + 50) / 100);
    }
    controller_tick(&controller, &inputs, &outputs);
    status.ticks++;
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
    said_length = 0;
    said[0] = '\0';
    type(line);
    type("\n");
    return said;
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

static void each_word_is_obeyed(void)
{
    expect_ok("on 3");
    TEST_ASSERT_EQUAL_UINT16(1000, controller_level_permille(&controller, 2));
    expect_ok("on 4 25");
    TEST_ASSERT_EQUAL_UINT16(250, controller_level_permille(&controller, 3));
    expect_ok("off 3");
    TEST_ASSERT_EQUAL_UINT16(0, controller_level_permille(&controller, 2));
    expect_ok("on all 50");
    TEST_ASSERT_EQUAL_UINT16(500, controller_level_permille(&controller, 8));
    expect_ok("off all");
    TEST_ASSERT_EQUAL_UINT16(0, controller_level_permille(&controller, 8));
    expect_ok("  pattern   111101111 ");
    TEST_ASSERT_EQUAL_UINT16(0, controller_level_permille(&controller, 4));
    TEST_ASSERT_EQUAL_UINT16(1000, controller_level_permille(&controller, 5));
    expect_ok("off all");
    expect_ok("policy open");
    expect_ok("fan 60");
    TEST_ASSERT_EQUAL_UINT8(60, controller_fan_percent(&controller));
    expect_ok("ambient 23.5");
    TEST_ASSERT_EQUAL_INT16(2350, settings.board.ambient_cc);
    expect_ok("model");
    TEST_ASSERT_NOT_NULL(strstr(said, "spring 9: "));
    expect_ok("model cold");
    expect_ok("faults");
    expect_ok("clear");
    expect_ok("unlock");
    expect_ok("help");
    TEST_ASSERT_NOT_NULL(strstr(said, "telemetry off|csv|teleplot"));
    expect_ok("version");
    TEST_ASSERT_NOT_NULL(strstr(said, "ninespring 0.0 mega2560, sensors test"));
    expect_ok("telemetry csv 10");
    TEST_ASSERT_EQUAL_STRING_LEN("time_s,i1_a,v1_v,m1_c,d1,i2_a", said, 29);
    TEST_ASSERT_EQUAL_UINT8(TELEMETRY_CSV, telemetry.format);
    TEST_ASSERT_EQUAL_UINT8(10, telemetry.hz);
    expect_ok("telemetry off");
    expect_ok("selftest");
    TEST_ASSERT_NOT_NULL(strstr(said, "spring 9: sensor ok, 0.180 ohm"));
    TEST_ASSERT_EQUAL_UINT16(0, controller_level_permille(&controller, 8));
}

static void each_error_says_its_number_and_changes_nothing(void)
{
    char longest[CONSOLE_LINE_BYTES + 2u];
    expect_error("frobnicate", CONSOLE_ERROR_UNKNOWN_WORD);
    expect_error("On 1", CONSOLE_ERROR_UNKNOWN_WORD);
    expect_error("on", CONSOLE_ERROR_MISSING_ARGUMENT);
    expect_error("pattern", CONSOLE_ERROR_MISSING_ARGUMENT);
    expect_error("on 1 2 3", CONSOLE_ERROR_SURPLUS_ARGUMENT);
    expect_error("help me", CONSOLE_ERROR_SURPLUS_ARGUMENT);
    expect_error("clear 1", CONSOLE_ERROR_SURPLUS_ARGUMENT);
    expect_error("on one", CONSOLE_ERROR_BAD_ARGUMENT);
    expect_error("on 1.5", CONSOLE_ERROR_BAD_ARGUMENT);
    expect_error("pattern 1111", CONSOLE_ERROR_BAD_ARGUMENT);
    expect_error("pattern 11110111x", CONSOLE_ERROR_BAD_ARGUMENT);
    expect_error("policy closed", CONSOLE_ERROR_BAD_ARGUMENT);
    expect_error("model hot", CONSOLE_ERROR_BAD_ARGUMENT);
    expect_error("telemetry json", CONSOLE_ERROR_BAD_ARGUMENT);
    expect_error("$loss_w_per_k=1e-3", CONSOLE_ERROR_BAD_ARGUMENT);
    expect_error("on 0", CONSOLE_ERROR_OUT_OF_RANGE);
    expect_error("on 10", CONSOLE_ERROR_OUT_OF_RANGE);
    expect_error("on 99999999999999", CONSOLE_ERROR_OUT_OF_RANGE);
    expect_error("on 1 101", CONSOLE_ERROR_OUT_OF_RANGE);
    expect_error("off -1", CONSOLE_ERROR_OUT_OF_RANGE);
    expect_error("fan 101", CONSOLE_ERROR_OUT_OF_RANGE);
    expect_error("ambient 200", CONSOLE_ERROR_OUT_OF_RANGE);
    expect_error("telemetry csv 0", CONSOLE_ERROR_OUT_OF_RANGE);
    expect_error("$loss_w_per_k=1", CONSOLE_ERROR_OUT_OF_RANGE);
    memset(longest, 'x', sizeof longest);
    longest[sizeof longest - 1u] = '\0';
    expect_error(longest, CONSOLE_ERROR_LINE_TOO_LONG);
    expect_error("on \x80 1", CONSOLE_ERROR_BAD_CHARACTER);
    expect_error("on\t1", CONSOLE_ERROR_BAD_CHARACTER);
    expect_error("$nonsense=1", CONSOLE_ERROR_UNKNOWN_SETTING);
    expect_error("$nonsense", CONSOLE_ERROR_UNKNOWN_SETTING);
    expect_error("$", CONSOLE_ERROR_UNKNOWN_SETTING);
    console_break_line(&console, CONSOLE_ERROR_INPUT_LOST);
    expect_error("on 1", CONSOLE_ERROR_INPUT_LOST);
    controller_lock(&controller);
    expect_error("on 1", CONSOLE_ERROR_LOCKED);
    expect_error("pattern 111111111", CONSOLE_ERROR_LOCKED);
    expect_error("selftest", CONSOLE_ERROR_LOCKED);
    expect_ok("off all");
    expect_ok("unlock");
    controller_emergency_stop(&controller);
    expect_error("on 1", CONSOLE_ERROR_FAULT);
    expect_ok("clear");
    expect_ok("on 1");
    expect_error("selftest", CONSOLE_ERROR_SPRINGS_ON);
    expect_error("model cold", CONSOLE_ERROR_SPRINGS_ON);
}

static void the_longest_line_is_taken(void)
{
    char line[CONSOLE_LINE_BYTES + 1u];
    memset(line, ' ', sizeof line);
    memcpy(line, "fan 7", 5);
    line[sizeof line - 1u] = '\0';
    expect_ok(line);
    TEST_ASSERT_EQUAL_UINT8(7, controller_fan_percent(&controller));
}

static void policy_precompensate_is_refused_or_taken_as_the_controller_says(void)
{
    const controller_t before = controller;
    const bool available = controller_set_policy(&controller, DRIVE_POLICY_PRECOMPENSATE);
    controller = before;
    if (available) {
        expect_ok("policy precompensate");
    } else {
        expect_error("policy precompensate", CONSOLE_ERROR_NOT_AVAILABLE);
    }
}

static void settings_that_do_not_fit_wait_until_they_do(void)
{
    expect_ok("$martensite_finish_c=80"); /* above its start, 78 */
    TEST_ASSERT_NOT_NULL(strstr(said, "[not active yet:"));
    TEST_ASSERT_EQUAL_INT16(6800, controller.model.parameters.martensite_finish_cc);
    expect_error("$save", CONSOLE_ERROR_SETTINGS_CONFLICT);
    expect_ok("$austenite_finish_c=110");
    expect_ok("$austenite_start_c=105");
    expect_ok("$martensite_start_c=100");
    TEST_ASSERT_NULL(strstr(said, "[not active yet:"));
    TEST_ASSERT_EQUAL_INT16(8000, controller.model.parameters.martensite_finish_cc);
    expect_ok("$save");
}

static void a_listing_pasted_into_another_board_makes_it_the_same(void)
{
    static char listing[32768];
    settings_t wanted;
    expect_ok("$loss_w_per_k=0.006543");
    expect_ok("$loss_scale_5=1.02");
    expect_ok("$martensite_finish_c=55");
    expect_ok("$martensite_start_c=60.25");
    expect_ok("$austenite_start_c=66");
    expect_ok("$austenite_finish_c=70");
    expect_ok("$ambient_c=-3.5");
    expect_ok("$supply_limit_a=12.5");
    wanted = settings;
    ask("$$");
    strcpy(listing, said);
    setUp();
    for (char *line = strtok(listing, "\r\n"); line != NULL; line = strtok(NULL, "\r\n")) {
        if (line[0] == '$') {
            expect_ok(line);
        }
    }
    TEST_ASSERT_EQUAL_MEMORY(&wanted, &settings, sizeof wanted);
    TEST_ASSERT_EQUAL_INT16(5500, controller.model.parameters.martensite_finish_cc);
}

static void saved_settings_are_there_after_a_restart(void)
{
    expect_ok("$open_current_a=1.234");
    expect_ok("$save");
    settings_t loaded;
    TEST_ASSERT_EQUAL(RECORD_LOADED, settings_load(&store, &storage, &loaded).found);
    TEST_ASSERT_EQUAL_UINT16(1234, loaded.controller.policy.open_current_ma);
    expect_ok("$defaults");
    TEST_ASSERT_EQUAL_UINT16(1500, settings.controller.policy.open_current_ma);
}

static void version_says_what_became_of_the_stored_settings(void)
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
    for (unsigned k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        status.loaded = cases[k].loaded;
        ask("version");
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said, cases[k].text), said);
    }
}

static void selftest_says_which_spring_has_too_little_current(void)
{
    expect_ok("selftest");
    TEST_ASSERT_NOT_NULL(strstr(said, "spring 3: sensor ok, 0.180 ohm\r"));
    weak_ma = SELFTEST_CURRENT_MA / 2u;
    ask("selftest");
    TEST_ASSERT_NOT_NULL(strstr(said, "error:17 "));
    TEST_ASSERT_NOT_NULL(strstr(said, "spring 3: sensor ok, too little current\r"));
    TEST_ASSERT_NOT_NULL(strstr(said, "spring 4: sensor ok, 0.180 ohm\r"));
}

static void selftest_gives_the_policy_back_also_when_it_is_stopped(void)
{
    expect_ok("policy precompensate");
    expect_ok("selftest");
    TEST_ASSERT_EQUAL(DRIVE_POLICY_PRECOMPENSATE, controller_policy(&controller));
    for (const char *octet = "selftest\n"; *octet != '\0'; octet++) {
        console_receive(&console, (uint8_t)*octet);
    }
    console_service(&console);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_OPEN, controller_policy(&controller));
    TEST_ASSERT_EQUAL_UINT16(200, controller_level_permille(&controller, 0));
    console_stop(&console);
    TEST_ASSERT_EQUAL(DRIVE_POLICY_PRECOMPENSATE, controller_policy(&controller));
    TEST_ASSERT_EQUAL_UINT16(0, controller_level_permille(&controller, 0));
}

static void stop_drops_the_line_that_had_begun(void)
{
    said_length = 0;
    type("on a");
    console_stop(&console);
    type("ll\n");
    TEST_ASSERT_EQUAL_STRING_LEN("error:12 ", said, 9);
    TEST_ASSERT_EQUAL_UINT(1, answers());
    TEST_ASSERT_EQUAL_UINT16(0, controller_level_permille(&controller, 0));
    expect_ok("on 1"); /* what is typed afterwards counts again */
}

static void stop_ends_a_long_answer(void)
{
    said_length = 0;
    for (const char *c = "$$\n"; *c != '\0'; c++) {
        console_receive(&console, (uint8_t)*c);
    }
    console_service(&console);
    console_stop(&console);
    TEST_ASSERT_TRUE(console_ready(&console));
    TEST_ASSERT_EQUAL_UINT(1, answers());
    TEST_ASSERT_NOT_NULL(strstr(said, "error:12 "));
}

static void empty_lines_are_not_answered(void)
{
    ask("");
    ask("\r");
    TEST_ASSERT_EQUAL_UINT(0, said_length);
    expect_ok("   ");
}

static void nothing_is_said_without_room(void)
{
    room = CONSOLE_ROOM_BYTES - 1u;
    TEST_ASSERT_FALSE(console_ready(&console));
    room = 60000;
    console_receive(&console, '$');
    console_receive(&console, '$');
    console_receive(&console, '\n');
    room = CONSOLE_ROOM_BYTES - 1u;
    console_service(&console);
    TEST_ASSERT_EQUAL_UINT(0, said_length);
}

static void status_is_one_line(void)
{
    expect_ok("model cold");
    said_length = 0;
    console_print_status(&console);
    TEST_ASSERT_EQUAL_STRING_LEN("<off|t:0.000|sum_a:0.000|hottest_c:20.00@1|fan:0|fault:0|", said,
                                 57);
    TEST_ASSERT_EQUAL_PTR(said + said_length - 1u, strchr(said, '\n'));
}

static void model_says_with_which_bounds(void)
{
    char wanted[160];
    expect_ok("model cold");
    expect_ok("model");
    const spring_bounds_t c = controller_temperature_bounds_c(&controller, 8);
    const spring_bounds_t k = controller_distance_bounds_k(&controller, 8);
    TEST_ASSERT_TRUE(c.low < 15.0f && c.low > 0.0f && c.high > 25.0f && c.high < 40.0f);
    snprintf(wanted, sizeof wanted,
             "spring 9: 20.0 degC, %.1f to %.1f, 58.0 K below martensite start (+-%.1f), "
             "austenite 0.0 %%, 0.0 to %.1f\r\n",
             (double)c.low, (double)c.high, (double)(k.high - k.value),
             100.0 * (double)controller_austenite_bounds(&controller, 8).high);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(said, wanted), wanted);
    TEST_ASSERT_NOT_NULL(strstr(said, "\r\n  0.000 A, 0.000 V, 0.000000 W, target 0.000 A\r\n"
                                      "ambient: 20.00 degC\r\nok\r\n"));
}

static void model_says_how_long_a_spring_waits_and_when_it_is_away(void)
{
    expect_ok("policy precompensate");
    expect_ok("on 2");
    for (unsigned t = 0; t < 50; t++) {
        tick();
    }
    expect_ok("model");
    TEST_ASSERT_NOT_NULL(strstr(said, ", heat\r\n"));
    const char *const waits = strstr(said, "  waits ");
    TEST_ASSERT_NOT_NULL(waits);
    TEST_ASSERT_NOT_NULL(strstr(waits, " s: it may still be hot from before power-on\r\n"));
    const float seconds = controller_cooling_s(&controller, 1);
    TEST_ASSERT_FLOAT_WITHIN(2.0f, seconds, strtof(waits + 8, NULL));
    TEST_ASSERT_NULL(strstr(waits + 8, "  waits ")); /* nobody else is driven */
    expect_ok("off all");
    controller.policy.spring[4].limits = DRIVE_POLICY_LIMIT_AWAY;
    room = CONSOLE_ROOM_BYTES * 2u;
    console.job = 0;
    said_length = 0;
    for (const char *c = "model\n"; *c != '\0'; c++) {
        console_receive(&console, (uint8_t)*c);
    }
    while (console_busy(&console)) { /* without a tick, which would judge the spring anew */
        console_service(&console);
    }
    TEST_ASSERT_NOT_NULL(strstr(said, ", limits away\r\n  away: not where it was asked to be"));
}

static void learnt_says_what_is_known_and_clear_forgets_it(void)
{
    const spring_learnt_t numbers = {.austenite_ohm = 0.219f,
                                     .change = 0.2f,
                                     .martensite_ohm = 0.1752f,
                                     .martensite_rise_per_k = 0.0004f,
                                     .loss_w_per_k = -0.00029f,
                                     .loss_sd_w_per_k = 0.000058f};
    expect_ok("learnt");
    TEST_ASSERT_NOT_NULL(strstr(said, "spring 9: nothing yet\r\n"));
    controller_restore_learnt(&controller, 8, &numbers);
    controller.policy.estimator.spring[8].shift_k = 2.5f;
    expect_ok("learnt");
    TEST_ASSERT_NOT_NULL(strstr(said, "spring 8: nothing yet\r\n"
                                      "spring 9: 0.1752 ohm at 20 degC, 0.040 % per K, austenite "
                                      "0.2190 ohm, 25.0 % more, loss -5.0 % (+-1.0), shift 2.5 K"));
    expect_error("learnt forget", CONSOLE_ERROR_BAD_ARGUMENT);
    expect_ok("on 1");
    expect_error("learnt clear", CONSOLE_ERROR_SPRINGS_ON);
    expect_ok("off all");
    expect_ok("learnt clear");
    expect_ok("learnt");
    TEST_ASSERT_NOT_NULL(strstr(said, "spring 9: nothing yet\r\n"));
}

static void silent(unsigned ticks)
{
    for (unsigned t = 0; t < ticks; t++) {
        tick();
    }
}

static void a_host_that_falls_silent_switches_its_springs_off(void)
{
    expect_ok("$host_timeout_s=2");
    silent(1000); /* nothing is driven */
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, controller_board_fault(&controller));
    expect_ok("on 1");
    for (unsigned line = 0; line < 5; line++) {
        silent(99);
        TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, controller_board_fault(&controller));
        type(line % 2u == 0 ? "\n" : "frobnicate\n");
    }
    type("fan 1"); /* has no end */
    silent(101);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_HOST_SILENT, controller_board_fault(&controller));
    TEST_ASSERT_EQUAL_UINT16(0, controller_level_permille(&controller, 0));
    TEST_ASSERT_EQUAL_UINT16(0, outputs.duty[0]);
    type("\n");
    expect_error("on 1", CONSOLE_ERROR_FAULT);
    expect_ok("clear");
    expect_ok("$host_timeout_s=0");
    expect_ok("on 1");
    silent(1000);
    TEST_ASSERT_EQUAL(SAFETY_FAULT_NONE, controller_board_fault(&controller));
}

static void random_bytes_get_one_answer_a_line(void)
{
    uint32_t seed = 4242;
    for (unsigned round = 0; round < 3000; round++) {
        char line[140];
        unsigned length = 0;
        seed = seed * 1664525u + 1013904223u;
        const unsigned wanted = (seed >> 16) % 130u;
        bool printable = true;
        for (; length < wanted; length++) {
            seed = seed * 1664525u + 1013904223u;
            char c = (char)(seed >> 20);
            if ((round & 1u) != 0) {
                c = "on of all123456789$=save_pattern.-"[(seed >> 12) % 34u];
            }
            if (c == '\n' || c == '\r' || c == '\0') {
                c = '~';
            }
            printable = printable && c >= ' ' && c <= '~';
            line[length] = c;
        }
        line[length] = '\0';
        ask(line);
        TEST_ASSERT_EQUAL_UINT(length == 0 ? 0u : 1u, answers());
        if (!printable || length > CONSOLE_LINE_BYTES) {
            TEST_ASSERT_EQUAL_STRING_LEN("error:", said, 6);
        }
    }
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

static void codes_table_holds_what_the_code_says(void)
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

static void documentation_names_every_error_fault_and_word(void)
{
    char wanted[120];
    const char *const text = read_file("docs/console.md");
    for (int number = 1; number < CONSOLE_ERROR_END; number++) {
        snprintf(wanted, sizeof wanted, "| %d | `%s` |", number,
                 console_error_name((console_error_t)number));
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, wanted), wanted);
    }
    for (int number = 1; number < SAFETY_FAULT_COUNT; number++) {
        snprintf(wanted, sizeof wanted, "| %d | `%s` |", number,
                 safety_fault_name((safety_fault_t)number));
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

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(each_word_is_obeyed);
    RUN_TEST(each_error_says_its_number_and_changes_nothing);
    RUN_TEST(the_longest_line_is_taken);
    RUN_TEST(policy_precompensate_is_refused_or_taken_as_the_controller_says);
    RUN_TEST(settings_that_do_not_fit_wait_until_they_do);
    RUN_TEST(a_listing_pasted_into_another_board_makes_it_the_same);
    RUN_TEST(saved_settings_are_there_after_a_restart);
    RUN_TEST(version_says_what_became_of_the_stored_settings);
    RUN_TEST(selftest_says_which_spring_has_too_little_current);
    RUN_TEST(selftest_gives_the_policy_back_also_when_it_is_stopped);
    RUN_TEST(stop_drops_the_line_that_had_begun);
    RUN_TEST(stop_ends_a_long_answer);
    RUN_TEST(empty_lines_are_not_answered);
    RUN_TEST(nothing_is_said_without_room);
    RUN_TEST(status_is_one_line);
    RUN_TEST(model_says_with_which_bounds);
    RUN_TEST(model_says_how_long_a_spring_waits_and_when_it_is_away);
    RUN_TEST(learnt_says_what_is_known_and_clear_forgets_it);
    RUN_TEST(a_host_that_falls_silent_switches_its_springs_off);
    RUN_TEST(random_bytes_get_one_answer_a_line);
    RUN_TEST(codes_table_holds_what_the_code_says);
    RUN_TEST(documentation_names_every_error_fault_and_word);
    return UNITY_END();
}
