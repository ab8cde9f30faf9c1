/* What begins and ends each test, and what may be restored; what a turn does is in rules.c, law.c
 * and watch.c, what is believed over minutes in test/worlds. */
#include <math.h>
#include <stdio.h>

#include "../run_tests.h"
#include "one_spring.h"
#include "spring_estimator_internal.h"

void setUp(void)
{
    begin_cold();
}

/* In all that is done to it here nothing was taken for a bit that has turned over. */
void tearDown(void)
{
    TEST_ASSERT_EQUAL_UINT8(0, spring_estimator_broken_seals(&estimator));
}

TEST(numbers_that_no_spring_has_are_not_restored)
{
    const spring_learnt_t good = {.austenite_ohm = 0.22f, .change = 0.2f, .loss_sd_w_per_k = 1e-4f};
    spring_learnt_t bad[15];
    for (unsigned n = 0; n < 15; n++) {
        bad[n] = good;
    }
    bad[0].austenite_ohm = NAN;
    bad[1].austenite_ohm = 20.0f;
    bad[2].change = NAN;
    bad[3].change = 1.0f;
    bad[4].loss_w_per_k = 1.0f;
    bad[5].loss_sd_w_per_k = -1e-4f;
    bad[6].martensite_rise_per_k = INFINITY;
    bad[7].loss_sd_w_per_k = NAN;
    bad[8].slow_noise = NAN;
    bad[9].slow_noise = 0.02f;
    bad[10].austenite_ohm = 0.0099f;
    bad[11].change = 0.0f;
    bad[12].offset_v = 0.013f;
    bad[13].loss_w_per_k = -0.46f * 0.0058f;
    bad[14].loss_sd_w_per_k = 0.121f * 0.0058f;
    for (unsigned n = 0; n < 15; n++) {
        power_comes_on();
        spring_estimator_restore(&estimator, 0, &bad[n]);
        here("%u", n);
        TEST_ASSERT_EQUAL_FLOAT(0.0f, LEARNT.austenite_ohm);
    }
    static const float possible_ohm[] = {0.0101f, 0.22f, 15.9f};
    for (unsigned n = 0; n < 3; n++) {
        spring_learnt_t own = good;
        own.austenite_ohm = possible_ohm[n];
        own.slow_noise = 0.01f;
        spring_estimator_restore(&estimator, 0, &own);
        TEST_ASSERT_EQUAL_FLOAT(possible_ohm[n], LEARNT.austenite_ohm);
        TEST_ASSERT_EQUAL_FLOAT(1e-8f, INSIDE.loss_variance);
    }
    spring_learnt_t sure = good;
    sure.loss_sd_w_per_k = 0.0f;
    power_comes_on();
    spring_estimator_restore(&estimator, 0, &sure);
    TEST_ASSERT_EQUAL_FLOAT(0.22f, LEARNT.austenite_ohm);
    INSIDE.loss_variance = 1e-4f; /* known less than a declared one is, it is that one */
    TEST_ASSERT_FLOAT_WITHIN(1e-7f, 0.12f * 0.0058f, LEARNT.loss_sd_w_per_k);
    begin_cold();
}
