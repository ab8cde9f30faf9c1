/* The two tables: each row's limits hold at and beyond their bounds, defaults keep them, ids are
 * used once, and the documentation says what the tables say. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../run_tests.h"

#include "descriptions.h"
#include "drive_policy.h"
#include "parameters.h"
#include "text.h"

static union {
    thermal_model_parameters_t model;
    current_control_parameters_t current;
    safety_parameters_t safety;
    drive_policy_parameters_t policy;
    board_settings_t board;
} values;

static void take_defaults(uint8_t part)
{
    switch (part) {
    case PARAMETER_PART_MODEL:
        thermal_model_parameters_default(&values.model);
        break;
    case PARAMETER_PART_CURRENT:
        current_control_parameters_default(&values.current);
        break;
    case PARAMETER_PART_SAFETY:
        safety_parameters_default(&values.safety);
        break;
    case PARAMETER_PART_POLICY:
        drive_policy_parameters_default(&values.policy);
        break;
    default:
        board_settings_default(&values.board);
        break;
    }
}

TEST(each_value_is_kept_at_its_limits_and_refused_beyond)
{
    /* what a field of that type can hold at all */
    static const int32_t least_of[] = {[PARAMETER_S16] = INT16_MIN, [PARAMETER_U32] = 0};
    static const int32_t most_of[] = {[PARAMETER_U8] = UINT8_MAX,
                                      [PARAMETER_U16] = UINT16_MAX,
                                      [PARAMETER_S16] = INT16_MAX,
                                      [PARAMETER_U32] = INT32_MAX};
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        const parameter_row_t row = parameter_row(k);
        here("%s", row.name);
        const parameter_part_t part = (parameter_part_t)row.part;
        const uint8_t last = (uint8_t)(row.count - 1u);
        const int32_t inside[] = {row.minimum, row.maximum, row.standard};
        uint16_t bad = UINT16_MAX;
        take_defaults(row.part);
        TEST_ASSERT_TRUE(row.minimum < row.maximum);
        for (unsigned i = 0; i < 3; i++) {
            parameter_set(&values, &row, last, inside[i]);
            TEST_ASSERT_EQUAL_INT32(inside[i], parameter_get(&values, &row, last));
            TEST_ASSERT_TRUE(parameter_check(part, &values, &bad));
        }
        TEST_ASSERT_EQUAL_UINT16(UINT16_MAX, bad);
        if (row.minimum > least_of[row.type]) {
            parameter_set(&values, &row, last, row.minimum - 1);
            TEST_ASSERT_FALSE(parameter_check(part, &values, &bad));
            TEST_ASSERT_EQUAL_UINT16(k, bad);
        }
        if (row.maximum < most_of[row.type]) {
            parameter_set(&values, &row, last, row.maximum + 1);
            TEST_ASSERT_FALSE(parameter_check(part, &values, &bad));
            TEST_ASSERT_EQUAL_UINT16(k, bad);
            TEST_ASSERT_FALSE(parameter_check(part, &values, NULL));
        }
    }
}

TEST(a_value_beyond_what_is_read_is_refused)
{
    take_defaults(PARAMETER_PART_MODEL);
    values.model.contact_uohm[0] = UINT32_MAX;
    TEST_ASSERT_FALSE(parameter_check(PARAMETER_PART_MODEL, &values, NULL));
}

/* And no name is the beginning of another one's with a number, `name_3`: that is a spring. */
TEST(names_and_ids_are_used_once)
{
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        const parameter_row_t row = parameter_row(k);
        here("%s", row.name);
        TEST_ASSERT_NOT_EQUAL(0, row.id);
        TEST_ASSERT_TRUE(strlen(row.name) < PARAMETER_NAME_SIZE - 1u);
        const char *const last = strrchr(row.name, '_');
        TEST_ASSERT_TRUE(last == NULL || last[1] < '0' || last[1] > '9');
        for (uint16_t other = 0; other < k; other++) {
            const parameter_row_t earlier = parameter_row(other);
            TEST_ASSERT_NOT_EQUAL(earlier.id, row.id);
            TEST_ASSERT_TRUE(strcmp(earlier.name, row.name) != 0);
        }
    }
}

/* --- documentation -------------------------------------------------------------------------- */

static char page[100000];

static void read_page(const char *path)
{
    FILE *const file = fopen(path, "rb");
    TEST_ASSERT_NOT_NULL_MESSAGE(file, path);
    const size_t length = fread(page, 1, sizeof page - 1u, file);
    (void)fclose(file);
    page[length] = '\0';
}

/* The page's table that begins with these titles is, line by line, what the tables say. With
 * NINESPRING_WRITE_DOCS set it is written so (script/docs). */
static void expect_table(const char *path, const char *titles, const char *wanted)
{
    static char whole[120000];
    read_page(path);
    char *const begin = strstr(page, titles);
    TEST_ASSERT_NOT_NULL_MESSAGE(begin, titles);
    char *const end = strstr(begin, "\n\n");
    TEST_ASSERT_NOT_NULL_MESSAGE(end, "a table ends with an empty line");
    char *const rest = end + 1;
    if (getenv("NINESPRING_WRITE_DOCS") != NULL) {
        (void)snprintf(whole, sizeof whole, "%.*s%s%s", (int)(begin - page), page, wanted, rest);
        FILE *const file = fopen(path, "wb");
        TEST_ASSERT_NOT_NULL_MESSAGE(file, path);
        (void)fputs(whole, file);
        (void)fclose(file);
        return;
    }
    *rest = '\0';
    for (const char *found = begin; *wanted != '\0' || *found != '\0';) {
        const size_t length = strcspn(wanted, "\n");
        char line[400];
        (void)snprintf(line, sizeof line, "%.*s", (int)length, wanted);
        TEST_ASSERT_TRUE_MESSAGE(strncmp(found, wanted, length + 1u) == 0, line);
        wanted += length + 1u;
        found += length + 1u;
    }
}

TEST(the_settings_page_says_what_the_table_says)
{
    static const char titles[] =
        "| name | unit | default | range | what |\n|---|---|---|---|---|\n";
    static char wanted[30000];
    size_t used = (size_t)snprintf(wanted, sizeof wanted, "%s", titles);
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        const parameter_row_t row = parameter_row(k);
        char number[3][TEXT_DECIMAL_SIZE];
        (void)text_format_decimal(row.standard, row.decimals, number[0]);
        (void)text_format_decimal(row.minimum, row.decimals, number[1]);
        (void)text_format_decimal(row.maximum, row.decimals, number[2]);
        used += (size_t)snprintf(wanted + used, sizeof wanted - used,
                                 "| `%s%s` | %s | %s | %s .. %s | %s |\n", row.name,
                                 row.count > 1 ? "_K" : "", row.unit, number[0], number[1],
                                 number[2], parameter_description(k)->sentence);
    }
    expect_table(NINESPRING_SOURCE_DIR "/docs/console.md", titles, wanted);
}

TEST(the_effects_page_says_what_the_table_says)
{
    static const char titles[] = "| effect | what it is | on the chip |\n|---|---|---|\n";
    static char wanted[10000];
    size_t used = (size_t)snprintf(wanted, sizeof wanted, "%s", titles);
    for (size_t k = 0; k < EFFECT_COUNT; k++) {
        const effect_row_t *const row = effect_row(k);
        used += (size_t)snprintf(wanted + used, sizeof wanted - used, "| `%s` | %s | %s%s |\n",
                                 row->name, row->sentence, row->not_on_chip ? "no: " : "yes",
                                 row->not_on_chip ? row->not_on_chip : "");
    }
    expect_table(NINESPRING_SOURCE_DIR "/docs/adding-an-effect.md", titles, wanted);
}

TEST(each_effect_has_its_law_in_the_physics_page)
{
    read_page(NINESPRING_SOURCE_DIR "/docs/physics.md");
    for (size_t k = 0; k < EFFECT_COUNT; k++) {
        char row[80];
        (void)snprintf(row, sizeof row, "\n| `%s` | ", effect_row(k)->name);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(page, row), row);
    }
}

TEST(the_driving_page_has_each_setting_of_the_policy_and_each_limit)
{
    static const struct {
        drive_policy_limit_t bit;
        const char *name;
    } limits[] = {
        {DRIVE_POLICY_LIMIT_SAFETY, "safety"},     {DRIVE_POLICY_LIMIT_CURRENT, "current"},
        {DRIVE_POLICY_LIMIT_SUPPLY, "supply"},     {DRIVE_POLICY_LIMIT_TEMPERATURE, "temperature"},
        {DRIVE_POLICY_LIMIT_UNDRIVEN, "undriven"}, {DRIVE_POLICY_LIMIT_OVERLOAD, "overload"},
        {DRIVE_POLICY_LIMIT_TRIP, "trip"},         {DRIVE_POLICY_LIMIT_BLIND, "blind"}};
    char wanted[120], number[TEXT_DECIMAL_SIZE];
    read_page(NINESPRING_SOURCE_DIR "/docs/driving.md");
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        const parameter_row_t row = parameter_row(k);
        (void)text_format_decimal(row.standard, row.decimals, number);
        (void)snprintf(wanted, sizeof wanted, "| `%s` |%s%s | %s |", row.name,
                       row.unit[0] != '\0' ? " " : "", row.unit, number);
        TEST_ASSERT_TRUE_MESSAGE(row.part != PARAMETER_PART_POLICY || strstr(page, wanted), wanted);
    }
    for (size_t k = 0; k < ROWS(limits); k++) {
        (void)snprintf(wanted, sizeof wanted, "| %u | `%s` |", limits[k].bit, limits[k].name);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(page, wanted), wanted);
    }
}
