/* What is promised of fixed point: 1 h of random drive, 200 random parameter sets, 0.05 degC rms
 * and 0.15 at most. The argument is how many of the sets. */
#include <stdlib.h>

#include "../run_tests.h"
#include "comparison.h"

#define SETS 200u

static uint32_t sets = SETS;

static void hold_to_the_figure(uint32_t count, bool latent)
{
    comparison_t result = compare_fixed_with_double(0, count, 36000, latent);
    TEST_ASSERT_TRUE(result.highest_c > 120.0);
    TEST_ASSERT_TRUE(result.transformed > 0.02);
    TEST_ASSERT_TRUE_MESSAGE(result.rms_c <= 0.05, "rms");
    TEST_ASSERT_TRUE_MESSAGE(result.max_c <= 0.15, "max");
    TEST_ASSERT_TRUE_MESSAGE(result.parted * 1000u < result.samples, "histories part too often");
    TEST_ASSERT_TRUE_MESSAGE(result.max_parted_c <= 1.0, "max after histories parted");
}

TEST(an_hour_of_random_drive_with_latent_heat)
{
    hold_to_the_figure(sets, true);
}
TEST(an_hour_of_random_drive_without_latent_heat)
{
    hold_to_the_figure(sets >= 50 ? sets / 5 : sets, false); /* fewer do not reach 120 degC */
}

int main(int argc, char **argv)
{
    if (argc > 1) {
        sets = (uint32_t)strtoul(argv[1], NULL, 10);
    }
    return run_tests();
}
