/* What one supply and honest circuits can show passes, whatever supply it is; a circuit that shows
 * another share of it than it did is found in three windows. */
#include <math.h>
#include <string.h>

#include "circuit_peers.h"
#include "unity.h"

#define SPRINGS  9
#define HEATS_MV 1140.0f /* 3 A in 0.38 ohm */
#define HOLDS_MV 400.0f

static circuit_peers_t peers;
static current_control_parameters_t circuit;

void setUp(void)
{
    memset(&peers, 0, sizeof peers);
    current_control_parameters_default(&circuit);
}

void tearDown(void) {}

static bool takes(uint8_t spring, float expected_mv, float share)
{
    const circuit_window_t window = {share * expected_mv, expected_mv, true};
    return circuit_peers_judge(&peers, SPRINGS, spring, &window, &circuit);
}

static void is_off(uint8_t spring)
{
    const circuit_window_t window = {0.0f, 0.0f, false};
    TEST_ASSERT_FALSE(circuit_peers_judge(&peers, SPRINGS, spring, &window, &circuit));
}

/* Windows of all that are driven, spring 0 first; those that are found, bit by bit. */
static unsigned rounds(unsigned count, uint8_t driven, float expected_mv, float first, float others)
{
    unsigned found = 0;
    for (unsigned n = 0; n < count; n++) {
        for (uint8_t k = 0; k < driven; k++) {
            found |= (unsigned)takes(k, expected_mv, k == 0 ? first : others) << k;
        }
    }
    return found;
}

static void one_that_changes_is_found_in_three_windows_and_the_others_are_not(void)
{
    const float expected_mv[] = {HEATS_MV, HOLDS_MV};
    const float changed[2][2] = {{0.88f, 1.12f}, {0.83f, 1.17f}}; /* offsets are more of less */
    for (unsigned heats = 0; heats < 2; heats++) {
        for (unsigned n = 0; n < 2; n++) {
            setUp();
            TEST_ASSERT_EQUAL_HEX(0, rounds(5, SPRINGS, expected_mv[heats], 1.0f, 1.0f));
            const float share = changed[heats][n];
            TEST_ASSERT_EQUAL_HEX(0, rounds(2, SPRINGS, expected_mv[heats], share, 1.0f));
            TEST_ASSERT_EQUAL_HEX(1, rounds(1, SPRINGS, expected_mv[heats], share, 1.0f));
            TEST_ASSERT_EQUAL_HEX(0, rounds(5, SPRINGS, expected_mv[heats], 1.0f, 1.0f));
        }
    }
}

static void what_all_show_is_the_supply(void)
{
    for (float share = 0.5f; share < 1.6f; share += 0.1f) {
        TEST_ASSERT_EQUAL_HEX(0, rounds(4, SPRINGS, HEATS_MV, 1.0f, 1.0f));
        TEST_ASSERT_EQUAL_HEX(0, rounds(40, SPRINGS, HEATS_MV, share, share));
    }
}

/* 4.2 V and 0.04 ohm more for one, and it is known from then on: what it may have otherwise at
 * first is a change later. */
static void wiring_of_its_own_is_none_but_another_one_later_is(void)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(100, SPRINGS, HEATS_MV, 0.84f * 0.88f, 0.84f));
    TEST_ASSERT_EQUAL_HEX(0, rounds(2, SPRINGS, HEATS_MV, 0.84f, 0.84f));
    TEST_ASSERT_EQUAL_HEX(1, rounds(1, SPRINGS, HEATS_MV, 0.84f, 0.84f));
}

static void one_that_was_wrong_from_the_first_is_found_where_no_wiring_is_so(void)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(100, SPRINGS, HEATS_MV, 0.82f, 1.0f));
    setUp();
    TEST_ASSERT_EQUAL_HEX(0, rounds(3, SPRINGS, HEATS_MV, 0.78f, 1.0f)); /* it comes first */
    TEST_ASSERT_EQUAL_HEX(1, rounds(1, SPRINGS, HEATS_MV, 0.78f, 1.0f));
}

/* Fewer than three others: it may be the supply; as much as none may be that. */
static void alone_more_is_let_pass(void)
{
    for (uint8_t driven = 1; driven <= 3; driven++) {
        setUp();
        TEST_ASSERT_EQUAL_HEX(0, rounds(5, driven, HEATS_MV, 1.0f, 1.0f));
        TEST_ASSERT_EQUAL_HEX(0, rounds(5, driven, HEATS_MV, 0.83f, 1.0f));
        TEST_ASSERT_EQUAL_HEX(0, rounds(2, driven, HEATS_MV, 0.63f, 1.0f));
        TEST_ASSERT_EQUAL_HEX(1, rounds(1, driven, HEATS_MV, 0.63f, 1.0f));
    }
    setUp(); /* a fourth tells */
    TEST_ASSERT_EQUAL_HEX(0, rounds(5, 4, HEATS_MV, 1.0f, 1.0f));
    TEST_ASSERT_EQUAL_HEX(1, rounds(3, 4, HEATS_MV, 0.83f, 1.0f));
}

/* Those that are off or clear say nothing of a supply as it is now. */
static void who_is_off_is_no_peer(void)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(5, SPRINGS, HEATS_MV, 0.85f, 0.85f)); /* all on a long cable */
    for (uint8_t k = 1; k < SPRINGS; k++) {
        is_off(k);
    }
    TEST_ASSERT_EQUAL_HEX(0, rounds(5, 1, HEATS_MV, 1.0f, 0.0f)); /* alone on it */
}

/* And one window is enough then; a good one makes it three again. */
static void what_is_known_outlives_who_clears(void)
{
    for (uint8_t driven = 1; driven <= SPRINGS; driven = (uint8_t)(driven + 8u)) {
        const float share = driven == 1 ? 0.7f : 0.86f;
        setUp();
        TEST_ASSERT_EQUAL_HEX(0, rounds(5, driven, HEATS_MV, 1.0f, 1.0f));
        TEST_ASSERT_EQUAL_HEX(0, rounds(2, driven, HEATS_MV, share, 1.0f));
        for (unsigned cleared = 0; cleared < 3; cleared++) {
            TEST_ASSERT_EQUAL_HEX(1, rounds(1, driven, HEATS_MV, share, 1.0f));
            circuit_peers_clear(&peers, 0, true);
            is_off(0);
        }
        TEST_ASSERT_EQUAL_HEX(0, rounds(1, driven, HEATS_MV, 1.0f, 1.0f));
        TEST_ASSERT_EQUAL_HEX(0, rounds(2, driven, HEATS_MV, share, 1.0f));
        TEST_ASSERT_EQUAL_HEX(1, rounds(1, driven, HEATS_MV, share, 1.0f));
    }
}

/* Found as it is off, and until it is cleared. */
static void what_is_found_stays_found_until_cleared(void)
{
    const circuit_window_t nothing = {0.0f, 0.0f, false};
    TEST_ASSERT_EQUAL_HEX(0, rounds(5, SPRINGS, HEATS_MV, 1.0f, 1.0f));
    TEST_ASSERT_EQUAL_HEX(1, rounds(3, SPRINGS, HEATS_MV, 0.7f, 1.0f));
    for (unsigned n = 0; n < 100; n++) {
        TEST_ASSERT_TRUE(circuit_peers_judge(&peers, SPRINGS, 0, &nothing, &circuit));
    }
    (void)rounds(500, SPRINGS, HEATS_MV, 0.7f, 1.0f); /* nor is it learnt */
    circuit_peers_clear(&peers, 0, true);
    TEST_ASSERT_EQUAL_HEX(1, rounds(1, SPRINGS, HEATS_MV, 0.7f, 1.0f));
    circuit_peers_clear(&peers, 0, true);
    TEST_ASSERT_FALSE(circuit_peers_judge(&peers, SPRINGS, 0, &nothing, &circuit));
}

/* Found by others: from the first it was of another shunt, and the right one is put in. */
static void a_sensor_that_was_wrong_from_the_first_may_be_another_one_after_a_clear(void)
{
    for (uint8_t driven = 1; driven <= SPRINGS; driven = (uint8_t)(driven + 8u)) {
        setUp();
        TEST_ASSERT_EQUAL_HEX(0, rounds(5, driven, HEATS_MV, 0.83f, 1.0f));
        TEST_ASSERT_EQUAL_HEX(0, rounds(2, driven, HEATS_MV, 1.06f, 1.0f));
        circuit_peers_clear(&peers, 0, true);
        TEST_ASSERT_EQUAL_HEX(0, rounds(50, driven, HEATS_MV, 1.06f, 1.0f));
        TEST_ASSERT_EQUAL_HEX(0, rounds(2, driven, HEATS_MV, 0.8f, 1.0f));
        circuit_peers_clear(&peers, 0, false); /* another spring's fault */
        TEST_ASSERT_EQUAL_HEX(1, rounds(3, driven, HEATS_MV, 0.8f, 1.0f));
    }
}

/* Cleared, and found by others before it told anything: it is the same sensor. */
static void what_was_not_agreed_with_since_a_clear_stays_known(void)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(5, SPRINGS, HEATS_MV, 1.0f, 1.0f));
    TEST_ASSERT_EQUAL_HEX(1, rounds(3, SPRINGS, HEATS_MV, 0.86f, 1.0f));
    circuit_peers_clear(&peers, 0, true);
    circuit_peers_clear(&peers, 0, true);
    TEST_ASSERT_EQUAL_HEX(1, rounds(3, SPRINGS, HEATS_MV, 0.86f, 1.0f));
}

static void what_tells_nothing_changes_nothing(void)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(5, SPRINGS, HEATS_MV, 1.0f, 1.0f));
    TEST_ASSERT_EQUAL_HEX(0, rounds(2, SPRINGS, HEATS_MV, 0.7f, 1.0f));
    for (unsigned n = 0; n < 10; n++) {
        is_off(0);
        TEST_ASSERT_FALSE(takes(0, 99.0f, 0.3f));
        TEST_ASSERT_FALSE(takes(0, 99.0f, 1.0f));
    }
    TEST_ASSERT_EQUAL_HEX(1, rounds(1, SPRINGS, HEATS_MV, 0.7f, 1.0f));
}

/* A minute's third part of a gain is found on its way; what wiring does in hours is not. */
static void a_drift_is_found_where_it_is_faster_than_wiring(void)
{
    for (unsigned slow = 0; slow < 2; slow++) {
        setUp();
        float share = 1.0f;
        unsigned found = 0;
        for (unsigned n = 0; n < (slow ? 3000u : 40u) && found == 0; n++) {
            share -= slow ? 0.00003f : 0.004f;
            found = rounds(1, SPRINGS, HEATS_MV, share, 1.0f);
        }
        TEST_ASSERT_EQUAL_HEX(slow ? 0 : 1, found);
    }
}

/* The drop that is declared moves with current and heat by a sixth: 60 mV of 400. */
static void a_diode_may_be_another_one(void)
{
    circuit.freewheel_mv = 400;
    TEST_ASSERT_EQUAL_HEX(0, rounds(5, SPRINGS, HOLDS_MV, 1.0f, 1.0f));
    TEST_ASSERT_EQUAL_HEX(0, rounds(5, SPRINGS, HOLDS_MV, 0.8f, 1.0f));
    TEST_ASSERT_EQUAL_HEX(1, rounds(3, SPRINGS, HOLDS_MV, 0.67f, 1.0f));
}

/* Of whatever is found something is remembered, and no number overflows. */
static void any_share_is_taken(void)
{
    const float shares[] = {0.0f, 0.001f, 1.9f, 3.0f, 100.0f};
    for (unsigned n = 0; n < 25; n++) {
        (void)rounds(3, SPRINGS, HEATS_MV, shares[n / 5u], shares[n % 5u]);
        TEST_ASSERT_TRUE(peers.spring[0].share_q7 != 0);
        TEST_ASSERT_TRUE(peers.spring[0].odd <= CIRCUIT_PEERS_WINDOWS);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(one_that_changes_is_found_in_three_windows_and_the_others_are_not);
    RUN_TEST(what_all_show_is_the_supply);
    RUN_TEST(wiring_of_its_own_is_none_but_another_one_later_is);
    RUN_TEST(one_that_was_wrong_from_the_first_is_found_where_no_wiring_is_so);
    RUN_TEST(alone_more_is_let_pass);
    RUN_TEST(who_is_off_is_no_peer);
    RUN_TEST(what_is_known_outlives_who_clears);
    RUN_TEST(what_is_found_stays_found_until_cleared);
    RUN_TEST(a_sensor_that_was_wrong_from_the_first_may_be_another_one_after_a_clear);
    RUN_TEST(what_was_not_agreed_with_since_a_clear_stays_known);
    RUN_TEST(what_tells_nothing_changes_nothing);
    RUN_TEST(a_drift_is_found_where_it_is_faster_than_wiring);
    RUN_TEST(a_diode_may_be_another_one);
    RUN_TEST(any_share_is_taken);
    return UNITY_END();
}
