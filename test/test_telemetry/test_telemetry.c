#include <string.h>

#include "telemetry.h"
#include "unity.h"

static char said[8192];
static uint16_t said_length;
static uint16_t room;

static uint16_t out_room(void *context)
{
    (void)context;
    return room;
}

static void out_write(void *context, const char *bytes, uint8_t length)
{
    (void)context;
    TEST_ASSERT_LESS_OR_EQUAL_UINT(room, length);
    memcpy(said + said_length, bytes, length);
    said_length = (uint16_t)(said_length + length);
    said[said_length] = '\0';
    room = (uint16_t)(room - length);
}

static const text_output_t output = {NULL, out_room, out_write};
static controller_t controller;
static telemetry_t telemetry;

void setUp(void)
{
    controller_settings_t settings;
    controller_settings_default(&settings);
    TEST_ASSERT_TRUE(controller_init(&controller, &settings, 20 * 128, NULL));
    telemetry_init(&telemetry);
    said_length = 0;
    said[0] = '\0';
    room = 8000;
}

void tearDown(void) {}

static unsigned lines(void)
{
    unsigned count = 0;
    for (uint16_t i = 0; i < said_length; i++) {
        count += said[i] == '\n';
    }
    return count;
}

static void header_and_line_have_as_many_columns(void)
{
    char header[512];
    text_line_t line;
    unsigned columns = 1;
    unsigned fields = 1;
    uint16_t at = 0;
    for (uint8_t piece = 0;; piece++) {
        char bytes[64];
        text_line_start(&line, bytes, sizeof bytes);
        if (!telemetry_header(9, piece, &line)) {
            break;
        }
        memcpy(header + at, bytes, line.length);
        at = (uint16_t)(at + line.length);
    }
    header[at] = '\0';
    TEST_ASSERT_EQUAL_STRING_LEN("time_s,i1_a,v1_v,m1_c,d1,", header, 25);
    TEST_ASSERT_NOT_NULL(strstr(header, ",d9,fan,ambient_c,state\r\n"));
    TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_CSV, 50));
    telemetry_tick(&telemetry, &controller, 12345, 20 * 128, &output);
    for (const char *c = header; *c != '\0'; c++) {
        columns += *c == ',';
    }
    for (const char *c = said; *c != '\0'; c++) {
        fields += *c == ',';
    }
    TEST_ASSERT_EQUAL_UINT(columns, fields);
    TEST_ASSERT_EQUAL_STRING_LEN("12.345,0.000,0.000,20.00,0.000,", said, 31);
    TEST_ASSERT_NOT_NULL(strstr(said, ",0.00,20.00,ok\r\n"));
}

static void the_longest_line_fits_what_is_asked_for(void)
{
    for (uint8_t k = 0; k < 9; k++) {
        controller.measured_ma[k] = -32768;
        controller.measured_mv[k] = -32768;
        controller.duty[k] = 800;
        controller.model.state.spring[k].temperature_c23 = -40 * 8388608;
        controller.safety.spring[k].fault = SAFETY_FAULT_EMERGENCY_STOP;
    }
    TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_CSV, 50));
    room = TELEMETRY_LINE_BYTES(9);
    telemetry_tick(&telemetry, &controller, 0x7FFFFFFFul, -40 * 128, &output);
    TEST_ASSERT_EQUAL_UINT(1, lines());
    TEST_ASSERT_NOT_NULL(strstr(said, ",fault_13\r\n"));
    TEST_ASSERT_EQUAL_UINT16(0, telemetry.dropped);
}

static void a_line_without_room_is_dropped_whole_and_counted(void)
{
    TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_CSV, 50));
    room = (uint16_t)(TELEMETRY_LINE_BYTES(9) - 1u);
    telemetry_tick(&telemetry, &controller, 0, 0, &output);
    TEST_ASSERT_EQUAL_UINT(0, said_length);
    TEST_ASSERT_EQUAL_UINT16(1, telemetry.dropped);
    TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_TELEPLOT, 50));
    room = TELEMETRY_LEAVES_FREE_BYTES + 30; /* one line and a piece of the next */
    telemetry_tick(&telemetry, &controller, 1000, 0, &output);
    TEST_ASSERT_EQUAL('\n', said[said_length - 1u]);
    TEST_ASSERT_GREATER_THAN_UINT16(15, telemetry.dropped);
    TEST_ASSERT_TRUE(room >= TELEMETRY_LEAVES_FREE_BYTES);
    telemetry.dropped = 65535;
    room = 0;
    telemetry_tick(&telemetry, &controller, 1020, 0, &output);
    TEST_ASSERT_EQUAL_UINT16(65535, telemetry.dropped);
}

static void every_rate_gives_that_many_lines_a_second(void)
{
    for (uint8_t hz = 1; hz <= 50; hz++) {
        TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_CSV, hz));
        unsigned count = 0;
        for (unsigned tick = 0; tick < 500; tick++) {
            said_length = 0;
            room = 8000;
            telemetry_tick(&telemetry, &controller, tick * 20u, 0, &output);
            count += said_length > 0;
        }
        TEST_ASSERT_EQUAL_UINT(10u * hz, count);
    }
}

static void teleplot_lines_are_name_ms_value(void)
{
    controller.measured_ma[1] = 1500;
    TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_TELEPLOT, 50));
    telemetry_tick(&telemetry, &controller, 1234, 0, &output);
    TEST_ASSERT_NOT_NULL(strstr(said, ">i2:1234:1.500\r\n"));
    TEST_ASSERT_NOT_NULL(strstr(said, ">m9:1234:20.00\r\n"));
    TEST_ASSERT_NOT_NULL(strstr(said, ">fault:1234:0\r\n"));
    TEST_ASSERT_EQUAL_UINT(20, lines());
}

static void off_says_nothing_and_bad_settings_are_refused(void)
{
    telemetry_tick(&telemetry, &controller, 0, 0, &output);
    TEST_ASSERT_EQUAL_UINT(0, said_length);
    TEST_ASSERT_FALSE(telemetry_set(&telemetry, TELEMETRY_FORMAT_COUNT, 5));
    TEST_ASSERT_FALSE(telemetry_set(&telemetry, TELEMETRY_CSV, 0));
    TEST_ASSERT_FALSE(telemetry_set(&telemetry, TELEMETRY_CSV, 51));
    TEST_ASSERT_EQUAL_UINT8(TELEMETRY_OFF, telemetry.format);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(header_and_line_have_as_many_columns);
    RUN_TEST(the_longest_line_fits_what_is_asked_for);
    RUN_TEST(a_line_without_room_is_dropped_whole_and_counted);
    RUN_TEST(every_rate_gives_that_many_lines_a_second);
    RUN_TEST(teleplot_lines_are_name_ms_value);
    RUN_TEST(off_says_nothing_and_bad_settings_are_refused);
    return UNITY_END();
}
