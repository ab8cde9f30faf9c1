#include <stdlib.h>
#include <string.h>

#include "../fakes/belief_inside.h"
#include "../fakes/said.h"
#include "telemetry.h"

static controller_t controller;
static telemetry_t telemetry;

void setUp(void)
{
    controller_settings_t settings;
    controller_settings_default(&settings);
    TEST_ASSERT_TRUE(controller_init(&controller, &settings, 20 * 128, NULL));
    controller_set_temperature(&controller, 20 * 128);
    telemetry_init(&telemetry);
    forget();
    room = 8000;
    room_fills = true;
}

static void tick_at(uint32_t time_ms, int16_t ambient_c7)
{
    const text_time_t time = {time_ms / 1000u, (uint16_t)(time_ms % 1000u)};
    telemetry_tick(&telemetry, &controller, &time, ambient_c7, &output);
}

static unsigned lines(void)
{
    return occurrences("\n");
}

TEST(header_and_line_have_as_many_columns)
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
    tick_at(12345, 20 * 128);
    for (const char *c = header; *c != '\0'; c++) {
        columns += *c == ',';
    }
    for (const char *c = said; *c != '\0'; c++) {
        fields += *c == ',';
    }
    TEST_ASSERT_EQUAL_UINT(columns, fields);
    TEST_ASSERT_EQUAL_STRING_LEN("12.345,0.000,0.000,20.00,0.000,", said, 31);
    expect_said(",0.00,20.00,ok\r\n");
}

TEST(the_longest_line_fits_what_is_asked_for)
{
    for (uint8_t k = 0; k < 9; k++) {
        controller.measured_ma[k] = -32768;
        controller.measured_mv[k] = -32768;
        controller.current.channel[k].duty = 800;
        controller.model.state.spring[k].temperature_c23 = -40 * 8388608;
        controller.safety.spring[k].fault = SAFETY_FAULT_EMERGENCY_STOP;
    }
    TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_CSV, 50));
    room = TELEMETRY_LINE_BYTES(9);
    const text_time_t years = {INT32_MAX, 999};
    telemetry_tick(&telemetry, &controller, &years, -40 * 128, &output);
    TEST_ASSERT_EQUAL_UINT(1, lines());
    expect_said(",fault_13\r\n");
    TEST_ASSERT_EQUAL_UINT16(0, telemetry.dropped);
}

TEST(what_of_a_round_found_no_room_is_dropped_and_every_spring_has_its_turn)
{
    TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_TELEPLOT, 50));
    for (uint32_t tick = 1; tick <= 45; tick++) {
        room = TELEMETRY_LEAVES_FREE_BYTES + 80; /* two springs of nine */
        tick_at(tick * 20u, 0);
    }
    TEST_ASSERT_EQUAL_UINT16(45u * 9u - occurrences(">i") - telemetry.left, telemetry.dropped);
    TEST_ASSERT_UINT_WITHIN(1, 9, occurrences(">i1:"));
    TEST_ASSERT_UINT_WITHIN(1, 9, occurrences(">m9:"));
    TEST_ASSERT_UINT_WITHIN(1, 9, occurrences(">fault:"));
    telemetry.dropped = 65533;
    room = 0;
    tick_at(1000, 0);
    TEST_ASSERT_EQUAL_UINT16(65535, telemetry.dropped);
}

/* As the policy would have it: these limits, and this much less than wanted. */
static void limit(uint8_t spring, unsigned limits, uint16_t cut_ma)
{
    controller.policy.spring[spring].limits = (uint16_t)limits;
    controller.policy.spring[spring].wanted_ma = 3000;
    controller.policy.spring[spring].target_ma = (uint16_t)(3000u - cut_ma);
}

/* So many ticks with an empty transmit buffer at each, from time_ms on. */
static void ticks(unsigned count, uint32_t time_ms)
{
    for (unsigned tick = 0; tick < count; tick++) {
        room = 329;
        tick_at(time_ms + tick * 20u, 20 * 128);
    }
}

TEST(csv_tells_a_limit_once_when_it_begins_and_once_when_it_ends)
{
    TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_CSV, 5));
    ticks(50, 20);
    TEST_ASSERT_EQUAL_UINT(0, occurrences("<"));
    limit(4, DRIVE_POLICY_LIMIT_SUPPLY | DRIVE_POLICY_LIMIT_TEMPERATURE, 2610);
    ticks(50, 12000);
    TEST_ASSERT_EQUAL_UINT(1, occurrences("<"));
    expect_said("\r\n<limits|spring:5|t:12.180|supply|temperature|cut_a:2.610>\r\n");
    TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_CSV, 5)); /* to whoever comes anew */
    ticks(50, 12000);
    TEST_ASSERT_EQUAL_UINT(2, occurrences("<"));
    limit(4, DRIVE_POLICY_LIMIT_NONE, 0);
    ticks(50, 13000);
    TEST_ASSERT_EQUAL_UINT(3, occurrences("<"));
    expect_said("\r\n<limits|spring:5|t:13.180|none|cut_a:0.000>\r\n");
    TEST_ASSERT_EQUAL_UINT(20, occurrences(",ok\r\n"));
}

TEST(csv_tells_again_when_the_cut_has_changed_by_half_an_ampere)
{
    TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_CSV, 50));
    for (uint16_t cut_ma = 10; cut_ma <= 1800; cut_ma = (uint16_t)(cut_ma + 10u)) {
        limit(0, DRIVE_POLICY_LIMIT_TEMPERATURE, cut_ma);
        ticks(1, 1000);
        forget();
        ticks(1, 1020);
        TEST_ASSERT_EQUAL_UINT(0, occurrences("<"));
    }
    ticks(1, 5000);
    forget();
    limit(0, DRIVE_POLICY_LIMIT_TEMPERATURE, 1900);
    ticks(2, 5020);
    TEST_ASSERT_EQUAL_UINT(0, occurrences("<"));
    limit(0, DRIVE_POLICY_LIMIT_TEMPERATURE, 1000);
    ticks(2, 5060);
    TEST_ASSERT_EQUAL_UINT(1, occurrences("|temperature|cut_a:1.000>"));
    limit(0, DRIVE_POLICY_LIMIT_TEMPERATURE, 1700);
    ticks(2, 5100);
    TEST_ASSERT_EQUAL_UINT(1, occurrences("|temperature|cut_a:1.700>"));
}

static void pass(unsigned turns)
{
    for (unsigned n = 0; n < turns; n++) {
        spring_sights_turn(sights_inside(&controller.estimator));
    }
}

/* In setUp each spring was told to be cold. */
TEST(csv_tells_each_sight_once_when_it_is_known_what_was_done)
{
    TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_CSV, 5));
    pass(8);
    ticks(50, 10000);
    TEST_ASSERT_EQUAL_UINT(9, occurrences("<sight|"));
    expect_said("\r\n<sight|spring:9|t:8.340|told|now_k:-58.0|now_sd:5.8|shift_k:"
                "0.0|loss:0.00>\r\n");
    forget();
    spring_sight_t *const sight = spring_sights_add(sights_inside(&controller.estimator), 4);
    const spring_sight_t added = *sight;
    *sight = sight_with_numbers(4);
    sight->number = added.number;
    sight->turn = added.turn;
    pass(1);
    ticks(50, 12000);
    TEST_ASSERT_EQUAL_UINT(0, occurrences("<"));
    sight->did = SPRING_DID_HEAT | SPRING_DID_OPEN;
    pass(1);
    ticks(50, 13000);
    TEST_ASSERT_EQUAL_UINT(1, occurrences("<"));
    expect_said("\r\n<sight|spring:5|t:12.500|lost|read:-1.32|read_sd:0.05|believed_k:2.4|"
                "believed_sd:1.8|seen_k:-0.8|seen_sd:1.2|now_k:0.1|now_sd:1.0|shift_k:0.4|"
                "loss:1.20|heated|opened>\r\n");
    TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_CSV, 5));
    ticks(50, 14000); /* to whoever comes anew, those that are kept */
    TEST_ASSERT_EQUAL_UINT(11, occurrences("<sight|"));
}

TEST(longest_sight_is_told_whole_and_waits_for_room)
{
    spring_sights_t *const sights = sights_inside(&controller.estimator);
    sights->count = 0;
    TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_CSV, 1));
    ticks(50, 0); /* the first row */
    forget();
    spring_sight_t *const sight = spring_sights_add(sights, 8);
    *sight = sight_of_most_digits(8);
    sight->number = sights->numbers - 1u;
    sight->kind = SPRING_SIGHT_TRANSFORMS;
    sight->did = 15;
    pass(2);
    for (unsigned tick = 0; tick < 10; tick++) {
        room = 150;
        const text_time_t years = {INT32_MAX, 999};
        telemetry_tick(&telemetry, &controller, &years, 0, &output);
    }
    TEST_ASSERT_EQUAL_UINT(0, said_length);
    const text_time_t years = {INT32_MAX, 999};
    room = 329;
    telemetry_tick(&telemetry, &controller, &years, 0, &output);
    TEST_ASSERT_EQUAL_UINT(1, occurrences("|blind|opened>\r\n"));
    TEST_ASSERT_EQUAL_UINT(1, lines());
}

TEST(limits_that_find_no_room_are_told_later)
{
    TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_CSV, 5));
    for (uint8_t k = 0; k < 9; k++) {
        limit(k, DRIVE_POLICY_LIMIT_OVERLOAD, 500);
    }
    for (unsigned tick = 0; tick < 100; tick++) {
        room = 40;
        tick_at(tick * 20u, 0);
    }
    TEST_ASSERT_EQUAL_UINT(0, said_length);
    TEST_ASSERT_EQUAL_UINT16(10, telemetry.dropped); /* CSV lines; what is told later is not */
    for (unsigned n = 1; n <= 9; n++) {
        ticks(1, 3000);
        TEST_ASSERT_EQUAL_UINT(n, occurrences("<limits|spring:")); /* one a tick */
    }
    for (char k = '1'; k <= '9'; k++) {
        char part[] = "<limits|spring:#|t:3.000|overload|cut_a:0.500>\r\n";
        *strchr(part, '#') = k;
        TEST_ASSERT_EQUAL_UINT(1, occurrences(part));
    }
    ticks(100, 4000);
    TEST_ASSERT_EQUAL_UINT(9, occurrences("<"));
}

TEST(limits_that_toggle_are_told_once_a_period_and_take_no_other_springs_turn)
{
    for (uint8_t hz = 1; hz <= 50; hz = (uint8_t)(hz + 7u)) {
        TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_CSV, hz));
        unsigned toggling = 0;
        unsigned rows = 0;
        unsigned last = 0;
        limit(8, DRIVE_POLICY_LIMIT_NONE, 0);
        for (unsigned tick = 0; tick < 500; tick++) {
            for (uint8_t k = 0; k < 8; k++) {
                const uint16_t now = controller.policy.spring[k].limits;
                limit(k, now ^ DRIVE_POLICY_LIMIT_SUPPLY, 0);
            }
            if (tick == 300) {
                limit(8, DRIVE_POLICY_LIMIT_CURRENT, 0);
            }
            forget();
            ticks(1, tick * 20u);
            TEST_ASSERT_LESS_OR_EQUAL_UINT(1, occurrences("<"));
            rows += occurrences(",ok\r\n");
            toggling += occurrences("<limits|spring:1|");
            last += occurrences("<limits|spring:9|");
        }
        TEST_ASSERT_EQUAL_UINT(10u * hz, rows);
        TEST_ASSERT_LESS_OR_EQUAL_UINT(10u * hz, toggling);
        TEST_ASSERT_EQUAL_UINT(1, last);
    }
}

TEST(all_limits_at_once_fit_and_are_told_whole)
{
    TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_CSV, 1));
    limit(8, 1023, 3000);
    ticks(60, 0x7FFFFFFFul - 49u * 20u);
    TEST_ASSERT_EQUAL_UINT(1, occurrences("<limits|spring:9|t:"));
    TEST_ASSERT_EQUAL_UINT(1, occurrences("|safety|current|supply|temperature|undriven|overload|"
                                          "trip|blind|cooling|away|cut_a:3.000>\r\n"));
}

TEST(teleplot_has_limits_while_they_act_and_once_when_they_have_ended)
{
    TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_TELEPLOT, 5));
    ticks(55, 0); /* the last round needs two ticks */
    TEST_ASSERT_EQUAL_UINT(0, occurrences(">limits") + occurrences(">cut"));
    limit(8, DRIVE_POLICY_LIMIT_SUPPLY, 2610);
    ticks(50, 1000);
    TEST_ASSERT_EQUAL_UINT(5, occurrences(">limits9:"));
    TEST_ASSERT_EQUAL_UINT(5, occurrences(":4\r\n"));
    TEST_ASSERT_EQUAL_UINT(5, occurrences(">cut9:"));
    TEST_ASSERT_EQUAL_UINT(5, occurrences(":2.610\r\n"));
    limit(8, DRIVE_POLICY_LIMIT_NONE, 0);
    forget();
    ticks(50, 2000);
    TEST_ASSERT_EQUAL_UINT(1, occurrences(">limits"));
    expect_said(">limits9:2100:0\r\n");
    TEST_ASSERT_EQUAL_UINT(1, occurrences(">cut"));
    expect_said(">cut9:2100:0.000\r\n");
    TEST_ASSERT_EQUAL_UINT16(0, telemetry.dropped);
}

/* The longest piece of it, whole. */
TEST(teleplots_longest_lines_are_whole)
{
    controller.measured_ma[8] = -32768;
    controller.model.state.spring[8].temperature_c23 = -40 * 8388608;
    controller.safety.spring[8].fault = SAFETY_FAULT_EMERGENCY_STOP;
    belief_inside(&controller.estimator, 8)->variance_k2 = 3000.0f;
    limit(8, 1023, 3000);
    TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_TELEPLOT, 50));
    telemetry.rounds = 49; /* of this second the last one: with bounds */
    room = 8000;
    const text_time_t years = {INT32_MAX, 7};
    telemetry_tick(&telemetry, &controller, &years, 0, &output);
    expect_said(">i9:2147483647007:-32.768\r\n");
    expect_said(">m9:2147483647007:-40.00\r\n");
    expect_said(">limits9:2147483647007:1023\r\n");
    expect_said(">cut9:2147483647007:3.000\r\n");
    expect_said(">fan:2147483647007:0.00\r\n");
    expect_said(">fault:2147483647007:13\r\n");
    expect_said(">low9:2147483647007:-1");
    expect_said(">high9:2147483647007:1");
    TEST_ASSERT_EQUAL_UINT(40, lines());
}

TEST(teleplot_has_the_bounds_of_temperature_once_a_second)
{
    TEST_ASSERT_TRUE(telemetry_set(&telemetry, TELEMETRY_TELEPLOT, 5));
    ticks(49, 1000);
    TEST_ASSERT_EQUAL_UINT(0, occurrences(">low"));
    ticks(9, 1000);
    TEST_ASSERT_EQUAL_UINT(9, occurrences(">low"));
    TEST_ASSERT_EQUAL_UINT(9, occurrences(">high"));
    const spring_bounds_t bounds_c = controller_temperature_bounds_c(&controller, 8);
    TEST_ASSERT_TRUE(bounds_c.low < 19.0f && bounds_c.high > 21.0f);
    const char *const high = strstr(said, ">high9:1");
    TEST_ASSERT_NOT_NULL(high);
    TEST_ASSERT_FLOAT_WITHIN(0.011f, bounds_c.high, strtof(strchr(high + 8, ':') + 1, NULL));
    forget();
    ticks(150, 2000);
    TEST_ASSERT_EQUAL_UINT(3u * 9u, occurrences(">low"));
}

TEST(off_says_nothing_and_bad_settings_are_refused)
{
    tick_at(0, 0);
    TEST_ASSERT_EQUAL_UINT(0, said_length);
    TEST_ASSERT_FALSE(telemetry_set(&telemetry, TELEMETRY_FORMAT_COUNT, 5));
    TEST_ASSERT_FALSE(telemetry_set(&telemetry, TELEMETRY_CSV, 0));
    TEST_ASSERT_FALSE(telemetry_set(&telemetry, TELEMETRY_CSV, 51));
    TEST_ASSERT_EQUAL_UINT8(TELEMETRY_OFF, telemetry.format);
}
