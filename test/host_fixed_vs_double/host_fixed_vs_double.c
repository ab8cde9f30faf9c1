/* What is promised of fixed point: 1 h of random drive, 200 random parameter sets, 0.05 degC rms
 * and 0.15 at most. */
#include "comparison.h"
#include "unity.h"

#ifndef SETS
#define SETS 200
#endif
#define SETS_WITHOUT_LATENT (SETS >= 50 ? SETS / 5 : SETS) /* fewer do not reach 120 degC */

void setUp(void) {}
void tearDown(void) {}

static void hold_to_the_figure(uint32_t sets, bool latent)
{
    comparison_t result = compare_fixed_with_double(0, sets, 36000, latent);
    TEST_ASSERT_TRUE(result.highest_c > 120.0);
    TEST_ASSERT_TRUE(result.transformed > 0.02);
    TEST_ASSERT_TRUE_MESSAGE(result.rms_c <= 0.05, "rms");
    TEST_ASSERT_TRUE_MESSAGE(result.max_c <= 0.15, "max");
    TEST_ASSERT_TRUE_MESSAGE(result.parted * 1000u < result.samples, "histories part too often");
    TEST_ASSERT_TRUE_MESSAGE(result.max_parted_c <= 1.0, "max after histories parted");
}

static void an_hour_of_random_drive_with_latent_heat(void)
{
    hold_to_the_figure(SETS, true);
}
static void an_hour_of_random_drive_without_latent_heat(void)
{
    hold_to_the_figure(SETS_WITHOUT_LATENT, false);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(an_hour_of_random_drive_with_latent_heat);
    RUN_TEST(an_hour_of_random_drive_without_latent_heat);
    return UNITY_END();
}
