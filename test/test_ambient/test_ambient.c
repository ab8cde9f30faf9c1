/* What a room does is believed at once; what no room does holds what was before, and is said. */
#include <string.h>

#include "../run_tests.h"
#include "ambient.h"

#define SET_C7 (21 * 128)

static ambient_t ambient;

void setUp(void)
{
    memset(&ambient, 0, sizeof ambient);
}

static int16_t takes(int ticks, bool reads, double c)
{
    int16_t is_c7 = 0;
    for (int n = 0; n < ticks; n++) {
        is_c7 = ambient_take(&ambient, reads, (int16_t)(128.0 * c), SET_C7);
    }
    return is_c7;
}

TEST(a_room_is_believed_at_once)
{
    const double rooms_c[] = {-10.0, 0.0, 21.0, 50.0};
    for (int n = 0; n < 4; n++) {
        setUp();
        TEST_ASSERT_EQUAL_INT16(128.0 * rooms_c[n], takes(1, true, rooms_c[n]));
        TEST_ASSERT_EQUAL_INT16(128.0 * rooms_c[n], takes(100, true, rooms_c[n]));
        TEST_ASSERT_FALSE(ambient_is_held(&ambient));
    }
    setUp(); /* carried from the cold into the warm and back, as fast as a bead follows */
    for (int n = 0; n < 2000; n++) {
        const double c = n < 1000 ? -10.0 + (n < 250 ? 0.16 * n : 40.0)
                                  : 30.0 - (n < 1250 ? 0.16 * (n - 1000) : 40.0);
        TEST_ASSERT_EQUAL_INT16((int16_t)(128.0 * c), takes(1, true, c < -10.0 ? -10.0 : c));
    }
}

TEST(what_no_room_can_be_is_not)
{
    const double not_c[] = {-10.1, 50.1, 80.0, -20.0};
    for (int n = 0; n < 5; n++) {
        setUp();
        TEST_ASSERT_EQUAL_INT16(SET_C7, takes(4, n < 4, n < 4 ? not_c[n] : 20.0));
        TEST_ASSERT_FALSE(ambient_is_held(&ambient));
        TEST_ASSERT_EQUAL_INT16(SET_C7, takes(1, n < 4, n < 4 ? not_c[n] : 20.0));
        TEST_ASSERT_TRUE(ambient_is_held(&ambient));
        TEST_ASSERT_EQUAL_INT16(SET_C7, takes(1000, n < 4, n < 4 ? not_c[n] : 20.0));
        TEST_ASSERT_EQUAL_INT16(128 * 25, takes(1, true, 25.0)); /* it is put right */
        TEST_ASSERT_FALSE(ambient_is_held(&ambient));
    }
}

TEST(a_step_that_no_room_makes_holds_what_was_before)
{
    static const struct {
        double step_k;
        bool reads, is_room;
    } steps[] = {{10.0, true, true},   {-10.0, true, true},  {10.1, true, false},
                 {-10.1, true, false}, {-25.0, true, false}, {0.0, false, false}};
    for (unsigned n = 0; n < ROWS(steps); n++) {
        for (int before = 51; before < 210; before += 13) {
            setUp();
            (void)takes(before, true, 20.0);
            const double then_c = 20.0 + steps[n].step_k;
            const int16_t expected_c7 = (int16_t)(steps[n].is_room ? 128.0 * then_c : 128 * 20);
            TEST_ASSERT_EQUAL_INT16(expected_c7, takes(3000, steps[n].reads, then_c));
            TEST_ASSERT_EQUAL(!steps[n].is_room, ambient_is_held(&ambient));
            if (!steps[n].is_room) { /* a loose wire that touches again */
                TEST_ASSERT_EQUAL_INT16(128 * 22, takes(1, true, 22.0));
                TEST_ASSERT_FALSE(ambient_is_held(&ambient));
            }
        }
    }
}

/* As a filter makes it of a step, whenever it begins: what holds is of before. */
TEST(a_step_that_is_filtered_holds_what_was_before)
{
    for (int before = 51; before < 210; before++) {
        setUp();
        (void)takes(before, true, 20.0);
        double c = 20.0;
        int16_t is_c7 = 0;
        for (int n = 0; n < 100; n++) {
            c += (-5.0 - c) / 16.0;
            is_c7 = takes(1, true, c);
        }
        TEST_ASSERT_TRUE(ambient_is_held(&ambient));
        TEST_ASSERT_EQUAL_INT16(128 * 20, is_c7);
    }
}

/* A wire is put right, and a filter goes through all that lies between. */
TEST(what_jumps_within_its_first_second_begins_anew)
{
    for (int before = 0; before < 60; before++) {
        setUp();
        double c = 70.0;
        (void)takes(before, true, c);
        for (int n = 0; n < 200; n++) {
            c += (21.5 - c) / 16.0;
            (void)takes(1, true, c);
        }
        TEST_ASSERT_FALSE(ambient_is_held(&ambient));
        TEST_ASSERT_EQUAL_INT16(128.0 * 21.5, takes(1, true, 21.5));
    }
    setUp();
    (void)takes(50, true, 20.0);
    TEST_ASSERT_EQUAL_INT16(SET_C7, takes(1, true, 31.0));
    setUp();
    (void)takes(51, true, 20.0);
    TEST_ASSERT_EQUAL_INT16(128 * 20, takes(1, true, 31.0));
    TEST_ASSERT_EQUAL_INT16(128 * 20, takes(3, true, 31.0));
    TEST_ASSERT_FALSE(ambient_is_held(&ambient));
    (void)takes(1, true, 20.0); /* a good one: counted anew */
    (void)takes(4, true, 31.0);
    TEST_ASSERT_FALSE(ambient_is_held(&ambient));
    (void)takes(300, true, 31.0);
    TEST_ASSERT_TRUE(ambient_is_held(&ambient));
}

/* What holds is of the second before the last: rises of a kelvin a second. */
TEST(what_holds_is_of_one_to_two_seconds_before)
{
    for (int second = 2; second < 6; second++) {
        setUp();
        (void)takes(1, true, 20.0);
        for (int n = 1; n <= second; n++) {
            (void)takes(50, true, 20.0 + n);
        }
        TEST_ASSERT_EQUAL_INT16(128 * (20 + second - 1), takes(100, false, 0.0));
    }
}
