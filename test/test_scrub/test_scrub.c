/* A change that nobody sealed is found within two passes, whatever bit it is and wherever; one that
 * was sealed is none. */
#include <string.h>

#include "../run_tests.h"
#include "scrub.h"

typedef struct {
    uint8_t before; /* not watched, as what is between */
    uint8_t first[5];
    uint8_t between;
    uint8_t second[20];
    uint8_t after;
} owner_t;

static owner_t owner;
static scrub_t scrub;

static scrub_stretch_t stretches(const void *of, uint8_t index)
{
    const owner_t *const o = of;
    if (index == 0) {
        return (scrub_stretch_t){o->first, sizeof o->first};
    }
    return index == 1 ? (scrub_stretch_t){o->second, sizeof o->second} : (scrub_stretch_t){0};
}

void setUp(void)
{
    for (uint8_t k = 0; k < sizeof owner; k++) {
        ((uint8_t *)&owner)[k] = (uint8_t)(37u * k);
    }
    memset(&scrub, 0xA5, sizeof scrub);
    scrub_start(&scrub, stretches, &owner);
}

static unsigned steps_of_a_pass(uint8_t bytes)
{
    unsigned steps = 1;
    while (!scrub_step(&scrub, stretches, &owner, bytes)) {
        TEST_ASSERT_LESS_THAN_UINT(100, steps++);
    }
    return steps;
}

static bool is_watched(size_t at)
{
    return (at >= 1 && at < 6) || (at >= 7 && at < 27);
}

TEST(a_pass_takes_all_bytes_in_steps_of_any_size)
{
    TEST_ASSERT_EQUAL_UINT(26, steps_of_a_pass(1));
    TEST_ASSERT_EQUAL_UINT(2, steps_of_a_pass(16));
    TEST_ASSERT_EQUAL_UINT(1, steps_of_a_pass(255));
    TEST_ASSERT_TRUE(scrub_is_sound(&scrub));
}

TEST(every_bit_that_turns_over_is_found_and_no_other)
{
    for (size_t at = 0; at < sizeof owner; at++) {
        for (uint8_t bit = 0; bit < 8; bit++) {
            setUp();
            (void)scrub_step(&scrub, stretches, &owner, 7);
            ((uint8_t *)&owner)[at] ^= (uint8_t)(1u << bit);
            (void)steps_of_a_pass(7);
            (void)steps_of_a_pass(7);
            TEST_ASSERT_EQUAL(!is_watched(at), scrub_is_sound(&scrub));
        }
    }
}

TEST(a_sealed_change_is_right_and_what_was_found_stays_found)
{
    scrub_open(&scrub, stretches, &owner);
    owner.second[3] ^= 1u;
    scrub_seal(&scrub, stretches, &owner);
    (void)steps_of_a_pass(16);
    TEST_ASSERT_TRUE(scrub_is_sound(&scrub));
    owner.second[3] ^= 1u;
    scrub_open(&scrub, stretches, &owner); /* before another change seals it */
    owner.first[0] = 9;
    scrub_seal(&scrub, stretches, &owner);
    TEST_ASSERT_FALSE(scrub_is_sound(&scrub));
    (void)steps_of_a_pass(16);
    TEST_ASSERT_FALSE(scrub_is_sound(&scrub));
    scrub_start(&scrub, stretches, &owner);
    TEST_ASSERT_TRUE(scrub_is_sound(&scrub));
}
