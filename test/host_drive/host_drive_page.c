/* docs/driving.md: every setting of the policy with unit and default, every limit with its bit. */
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "../run_tests.h"
#include "settings.h"

static char page[65536];

void setUp(void)
{
    FILE *file = fopen(NINESPRING_SOURCE_DIR "/docs/driving.md", "rb");
    TEST_ASSERT_NOT_NULL(file);
    size_t length = fread(page, 1, sizeof page - 1u, file);
    (void)fclose(file);
    page[length] = '\0';
}

TEST(every_setting_of_the_policy_is_there_with_unit_and_default)
{
    settings_t defaults;
    settings_default(&defaults);
    unsigned found = 0;
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        const parameter_row_t row = parameter_row(k);
        if (row.part != PARAMETER_PART_POLICY) {
            continue;
        }
        double value = settings_get(&defaults, k, 0);
        for (unsigned n = 0; n < row.decimals; n++) {
            value /= 10.0;
        }
        char wanted[120];
        (void)snprintf(wanted, sizeof wanted, "| `%s` |%s%s | %.*f |", row.name,
                       row.unit[0] != '\0' ? " " : "", row.unit, (int)row.decimals, value);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(page, wanted), wanted);
        found++;
    }
    TEST_ASSERT_GREATER_THAN_UINT(10, found);
}

TEST(every_limit_is_there_with_its_bit)
{
    static const struct {
        drive_policy_limit_t bit;
        const char *name;
    } limits[] = {
        {DRIVE_POLICY_LIMIT_SAFETY, "safety"},     {DRIVE_POLICY_LIMIT_CURRENT, "current"},
        {DRIVE_POLICY_LIMIT_SUPPLY, "supply"},     {DRIVE_POLICY_LIMIT_TEMPERATURE, "temperature"},
        {DRIVE_POLICY_LIMIT_UNDRIVEN, "undriven"}, {DRIVE_POLICY_LIMIT_OVERLOAD, "overload"},
        {DRIVE_POLICY_LIMIT_TRIP, "trip"},         {DRIVE_POLICY_LIMIT_BLIND, "blind"}};
    for (unsigned k = 0; k < ROWS(limits); k++) {
        char wanted[40];
        (void)snprintf(wanted, sizeof wanted, "| %u | `%s` |", (unsigned)limits[k].bit,
                       limits[k].name);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(page, wanted), wanted);
    }
}
