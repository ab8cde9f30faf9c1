/* What one supply and honest circuits can show passes, whatever supply it is; a circuit that shows
 * another share of it than it did is found in three windows. */
#include <math.h>
#include <string.h>

#include "../circuit_window.h"
#include "../run_tests.h"
#include "circuit_peers.h"

#define SPRINGS  9
#define HEATS_MV 1140.0f /* 3 A in 0.38 ohm */
#define HOLDS_MV 400.0f

static circuit_peers_t peers;
static circuit_source_t source;

void setUp(void)
{
    memset(&peers, 0, sizeof peers);
    source = (circuit_source_t){0};
}

static bool takes(uint8_t spring, float expected_mv, float share)
{
    circuit_window_t window = window_of(share * expected_mv, expected_mv, 0.0f);
    return circuit_peers_judge(&peers, SPRINGS, spring, &window, &source);
}

static void is_off(uint8_t spring)
{
    circuit_window_t window = {.tells = false};
    TEST_ASSERT_FALSE(circuit_peers_judge(&peers, SPRINGS, spring, &window, &source));
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

TEST(what_all_show_is_the_supply)
{
    for (float share = 0.5f; share < 1.6f; share += 0.1f) {
        TEST_ASSERT_EQUAL_HEX(0, rounds(4, SPRINGS, HEATS_MV, 1.0f, 1.0f));
        TEST_ASSERT_EQUAL_HEX(0, rounds(40, SPRINGS, HEATS_MV, share, share));
    }
}

/* Found as it is off, and until it is cleared. */
TEST(what_is_found_stays_found_until_cleared)
{
    circuit_window_t nothing = {.tells = false};
    TEST_ASSERT_EQUAL_HEX(0, rounds(5, SPRINGS, HEATS_MV, 1.0f, 1.0f));
    TEST_ASSERT_EQUAL_HEX(1, rounds(3, SPRINGS, HEATS_MV, 0.7f, 1.0f));
    for (unsigned n = 0; n < 100; n++) {
        TEST_ASSERT_TRUE(circuit_peers_judge(&peers, SPRINGS, 0, &nothing, &source));
    }
    (void)rounds(500, SPRINGS, HEATS_MV, 0.7f, 1.0f); /* nor is it learnt */
    circuit_peers_clear(&peers, 0, true);
    TEST_ASSERT_EQUAL_HEX(1, rounds(1, SPRINGS, HEATS_MV, 0.7f, 1.0f));
    circuit_peers_clear(&peers, 0, true);
    TEST_ASSERT_FALSE(circuit_peers_judge(&peers, SPRINGS, 0, &nothing, &source));
}

/* A supply of 8 V instead of 5, or another shunt, begins within a window: what that shows is of
 * both. It is 5 V again, and cleared. */
TEST(the_window_in_which_another_share_begins_is_not_what_it_showed_before)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(5, 1, HEATS_MV, 1.0f, 0.0f));
    TEST_ASSERT_EQUAL_HEX(0, rounds(1, 1, HEATS_MV, 1.15f, 0.0f));
    TEST_ASSERT_EQUAL_HEX(1, rounds(3, 1, HEATS_MV, 1.6f, 0.0f));
    circuit_peers_clear(&peers, 0, true);
    TEST_ASSERT_EQUAL_HEX(0, rounds(10, 1, HEATS_MV, 1.0f, 0.0f));
    TEST_ASSERT_EQUAL_HEX(0, rounds(10, 1, HEATS_MV, 1.15f, 0.0f)); /* one that stays is */
    TEST_ASSERT_EQUAL_HEX(0, rounds(10, 1, HEATS_MV, 1.3f, 0.0f));
}

/* Of 110 mV 25 are a quarter. */
TEST(what_only_offsets_explain_is_not_what_it_showed_before)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(5, 1, HEATS_MV, 1.0f, 0.0f));
    TEST_ASSERT_EQUAL_HEX(0, rounds(5, 1, 110.0f, 1.33f, 0.0f));
    TEST_ASSERT_EQUAL_HEX(0, rounds(5, 1, HEATS_MV, 1.0f, 0.0f));
    setUp(); /* of the same volts they make the same, but for noise */
    TEST_ASSERT_EQUAL_HEX(0, rounds(3, 1, 150.0f, 1.0f, 0.0f));
    TEST_ASSERT_EQUAL_HEX(0, rounds(5, 1, 150.0f, 0.86f, 0.0f));
    TEST_ASSERT_EQUAL_HEX(1, rounds(3, 1, 150.0f, 0.7f, 0.0f));
}

/* However slow: what is soldered stays what it is; no share is learnt after 127 windows. */
TEST(a_drift_is_found_however_slow)
{
    for (unsigned slow = 0; slow < 2; slow++) {
        setUp();
        float share = 1.0f;
        unsigned found = rounds(255, SPRINGS, HEATS_MV, share, 1.0f);
        TEST_ASSERT_EQUAL_HEX(0, found);
        for (unsigned n = 0; n < (slow ? 30000u : 30u) && found == 0; n++) {
            share -= slow ? 0.000003f : 0.003f;
            found = rounds(1, SPRINGS, HEATS_MV, share, 1.0f);
        }
        TEST_ASSERT_EQUAL_HEX(1, found);
        TEST_ASSERT_FLOAT_WITHIN(0.01f, 0.925f, share);
    }
}

/* 1140 mV of 211 steps of 5.4 mV are all of it; of other steps, or behind a diode, they are not. */
TEST(what_one_that_was_found_showed_before_is_told_by_another_belief)
{
    static const float table[][5] = {{5.4f, 0.0f, 1.0f, 0.9f},
                                     {5.4f, 0.0f, 0.884f, 0.80f, 150.0f},
                                     {6.0f, 0.0f, 0.9f, 0.82f},
                                     {5.4f, 150.0f, 1.151f, 1.05f},
                                     {4.8f, 0.0f, 1.125f, 1.03f}};
    for (unsigned n = 0; n < ROWS(table); n++) {
        for (unsigned lies = 0; lies < 2; lies++) {
            setUp();
            source.step_mv = 5.4f;
            source.drop_mv = table[n][4];
            TEST_ASSERT_EQUAL_HEX(0, rounds(5, 1, HEATS_MV, 1.0f, 0.0f));
            circuit_peers_suspect(&peers, 0, 4096);
            circuit_peers_clear(&peers, 0, true);
            circuit_source_t now = source;
            now.step_mv = table[n][0];
            now.drop_mv = table[n][1];
            circuit_peers_renew(&peers, SPRINGS, &source, &now);
            const float duty = (HEATS_MV + source.drop_mv) / source.step_mv;
            const float mv = duty * now.step_mv - now.drop_mv;
            TEST_ASSERT_EQUAL(lies, takes(0, mv, table[n][2 + lies]));
        }
    }
}

/* But it ends a row that is not full. */
TEST(what_may_be_the_drop_is_not_odd)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(3, 1, HEATS_MV, 1.0f, 0.0f));
    TEST_ASSERT_FALSE(takes(0, HEATS_MV, 0.5f) || takes(0, HEATS_MV, 0.5f));
    source.more_mv = 300.0f;
    TEST_ASSERT_FALSE(takes(0, HOLDS_MV, 0.5f));
    TEST_ASSERT_EQUAL_UINT(0, peers.spring[0].odd);
    setUp(); /* nor one that has just begun */
    for (uint8_t k = 1; k < SPRINGS; k++) {
        (void)takes(k, HEATS_MV, 1.0f);
    }
    TEST_ASSERT_FALSE(takes(0, HEATS_MV, 0.5f));
    source.more_mv = 300.0f;
    TEST_ASSERT_FALSE(takes(0, HOLDS_MV, 0.55f));
    TEST_ASSERT_EQUAL_UINT(0, peers.spring[0].odd);
}

/* Who was not found, or of whom nothing is known, begins anew. */
TEST(of_who_was_not_found_nothing_is_told_by_another_belief)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(3, 1, HEATS_MV, 1.0f, 0.0f));
    TEST_ASSERT_FALSE(takes(0, HEATS_MV, 0.5f) || takes(0, HEATS_MV, 0.5f));
    TEST_ASSERT_EQUAL_UINT(2, peers.spring[0].odd); /* a supply that steps: not full */
    circuit_peers_renew(&peers, SPRINGS, &source, &source);
    TEST_ASSERT_EQUAL_UINT(0, peers.spring[0].was_q7);
    TEST_ASSERT_FALSE(takes(0, HEATS_MV, 0.5f));
    TEST_ASSERT_EQUAL_UINT(0, peers.spring[0].odd);
    setUp();
    for (uint8_t k = 1; k < SPRINGS; k++) {
        (void)takes(k, HEATS_MV, 1.0f);
    }
    for (unsigned window = 0; window < CIRCUIT_PEERS_WINDOWS; window++) {
        TEST_ASSERT_EQUAL(window == 2u, takes(0, HEATS_MV, 0.5f));
    }
    circuit_peers_renew(&peers, SPRINGS, &source, &source);
    TEST_ASSERT_EQUAL_UINT(0, peers.spring[0].was_q7);
}

/* Within an eighth a share is learnt whatever the drop is. */
TEST(beside_others_at_about_its_volts_a_share_is_learnt)
{
    static const float beside[][2] = {{0.90f, 1}, {0.86f, 0}, {1.12f, 1}, {1.17f, 0}};
    for (unsigned n = 0; n < ROWS(beside); n++) {
        setUp();
        source.unsure_mv = 600.0f;
        for (unsigned round = 0; round < 3; round++) {
            for (uint8_t k = 1; k < SPRINGS; k++) {
                (void)takes(k, HEATS_MV, 1.0f);
            }
            (void)takes(0, beside[n][0] * HEATS_MV, 1.0f);
        }
        TEST_ASSERT_EQUAL(beside[n][1] > 0.5f, peers.spring[0].learnt > 0);
    }
}

/* An eighth less is within an eighth. */
TEST(volts_an_eighth_apart_are_about_the_same)
{
    static const float table[][2] = {{896.0f, 1024.0f}, {1024.0f, 896.0f}};
    for (unsigned n = 0; n < ROWS(table); n++) {
        setUp();
        source.unsure_mv = 600.0f;
        for (uint8_t k = SPRINGS; k-- > 0;) {
            TEST_ASSERT_FALSE(takes(k, table[n][k == 0 ? 0 : 1], 1.0f));
        }
        TEST_ASSERT_EQUAL_UINT8(1, peers.spring[0].learnt);
    }
}

/* 0.18 of 1140 mV, less 25, are 180: not more where the others show more than all. What only the
 * drop explains is learnt of who was not found. */
TEST(what_a_drop_leaves_of_a_share_teaches)
{
    static const struct {
        float unsure_mv, more_mv, share;
        uint8_t learnt;
    } table[] = {{175.0f, 0.0f, 1.5f, 1}, {200.0f, 0.0f, 1.5f, 0}, {0.0f, 900.0f, 1.15f, 1}};
    for (unsigned n = 0; n < ROWS(table); n++) {
        setUp();
        source.unsure_mv = table[n].unsure_mv;
        source.more_mv = table[n].more_mv;
        for (uint8_t k = SPRINGS; k-- > 0;) {
            TEST_ASSERT_FALSE(
                takes(k, k == 0 ? HEATS_MV : 1500.0f, k == 0 ? table[n].share : 1.5f));
        }
        TEST_ASSERT_EQUAL_UINT8(table[n].learnt, peers.spring[0].learnt);
    }
}

/* A drop of which little is known may make any share of it: that is kept to 13 bits. */
TEST(a_share_of_its_own_is_twice_the_others_at_the_most)
{
    source.more_mv = 1e5f;
    for (uint8_t k = SPRINGS; k-- > 0;) {
        TEST_ASSERT_FALSE(takes(k, k == 0 ? 1500.0f : HEATS_MV, k == 0 ? 3.0f : 1.0f));
    }
    TEST_ASSERT_EQUAL_UINT16(8191, peers.spring[0].own_q12);
}

/* Of the supply it is what it showed beside the others, times its own: neither less than anything,
 * which would be that nothing is known, nor more than eight bits hold. */
TEST(what_it_showed_before_is_kept_within_a_byte)
{
    static const struct {
        uint8_t share_q7;
        uint16_t own_q12;
        uint8_t was_q7;
    } table[] = {{1, 100, 1}, {255, 8191, 255}, {100, 2048, 50}, {100, 0, 100}};
    for (unsigned n = 0; n < ROWS(table); n++) {
        setUp();
        peers.spring[0] = (circuit_peer_t){.own_q12 = table[n].own_q12 & 0x1FFFu,
                                           .agreed = 1,
                                           .share_q7 = table[n].share_q7,
                                           .shown_16mv = 71,
                                           .was_q7 = table[n].was_q7};
        TEST_ASSERT_FALSE(takes(0, HEATS_MV, (float)table[n].was_q7 / 128.0f));
        TEST_ASSERT_EQUAL_UINT8(table[n].was_q7, peers.spring[0].was_q7);
    }
}

/* A diode of 0.38 V that nobody declared, as currents rise: at a fifteenth more duty, half as much
 * again comes through. No share is learnt of that, and by the drop that is found all are alike. */
TEST(what_comes_through_an_unknown_drop_is_no_share)
{
    source = (circuit_source_t){.step_mv = 6.25f, .unsure_mv = 600.0f, .more_mv = 500.0f};
    const circuit_source_t now = {.drop_mv = 374.0f,
                                  .step_mv = 6.59f,
                                  .unsure_mv = 132.0f,
                                  .more_mv = 126.0f,
                                  .less_mv = 132.0f};
    for (uint8_t k = 1; k < SPRINGS; k++) {
        TEST_ASSERT_FALSE(takes(k, 440.0f, 0.13f));
    }
    for (unsigned n = 0; n < 2; n++) {
        TEST_ASSERT_FALSE(takes(0, 469.0f, 0.19f));
    }
    TEST_ASSERT_EQUAL_UINT8(0, peers.spring[0].learnt);
    circuit_peers_renew(&peers, SPRINGS, &source, &now);
    source = now;
    TEST_ASSERT_EQUAL_HEX(0, rounds(8, SPRINGS, 500.0f, 1.0f, 1.0f));
    TEST_ASSERT_EQUAL_UINT8(8, peers.spring[SPRINGS - 1u].learnt);
}

/* At each limit: a share that passes and one that is found in the third window. So many are driven;
 * the first one learnt `was` at learnt_mv, 0 mV: nothing yet; the others show `others` all along.
 * Of a drop, 200 mV that it may be more or less than believed make 130 mV between 1140 and 400, a
 * third of the lower ones; a drop that is more makes the share at fewer volts the lower one. */
TEST(limits_are_where_they_are_stated)
{
    static const struct {
        uint8_t driven;
        float learnt_mv, was, own_mv, others_mv, others;
        float drop_mv, more_mv, less_mv;
        float passes, found;
    } limits[] = {
        /* 5 % and 8 mV of what it showed beside them at the same volts; twice theirs is the most
           that is known */
        {9, HEATS_MV, 1.0f, HEATS_MV, HEATS_MV, 1.0f, 0, 0, 0, 0.946f, 0.940f},
        {9, HEATS_MV, 1.0f, HEATS_MV, HEATS_MV, 1.0f, 0, 0, 0, 1.054f, 1.060f},
        {9, HOLDS_MV, 1.0f, HOLDS_MV, HOLDS_MV, 1.0f, 0, 0, 0, 0.933f, 0.927f},
        {9, HEATS_MV, 0.75f, HEATS_MV, HEATS_MV, 0.75f, 0, 0, 0, 0.709f, 0.703f},
        {9, HEATS_MV, 1.1f, HEATS_MV, HEATS_MV, 1.0f, 0, 0, 0, 1.043f, 1.037f},
        {9, 144.0f, 0.4218f, 144.0f, 144.0f, 0.2109f, 0, 0, 0, 0.35f, 0.33f},
        /* at others, and the others at others than it was kept at */
        {9, HEATS_MV, 1.0f, HOLDS_MV, HEATS_MV, 1.0f, 0, 0, 0, 0.893f, 0.887f},
        {9, HEATS_MV, 1.0f, HEATS_MV, HOLDS_MV, 1.0f, 0, 0, 0, 0.906f, 0.899f},
        {9, HEATS_MV, 1.0f, HEATS_MV, HOLDS_MV, 1.0f, 0, 200, 0, 0.892f, 0.884f},
        /* 5 % and 25 mV of what was learnt */
        {9, 100.0f, 1.0f, 100.0f, 100.0f, 1.0f, 0, 0, 0, 0.60f, 0.54f}, /* of 0.1 V it tells */
        /* nothing is known: 18 % and 25 mV */
        {9, 0, 0, HEATS_MV, HEATS_MV, 1.0f, 0, 0, 0, 0.800f, 0.795f},
        {9, 0, 0, HEATS_MV, HEATS_MV, 0.75f, 0, 0, 0, 0.597f, 0.589f},
        {9, 0, 0, HEATS_MV, HEATS_MV, 1.5f, 0, 0, 0, 1.215f, 1.200f},
        /* beside one or two that show what they did: 5 % and what offsets make of other volts */
        {3, HEATS_MV, 1.0f, HEATS_MV, HEATS_MV, 1.0f, 0, 0, 0, 0.946f, 0.940f},
        {2, HEATS_MV, 1.0f, HEATS_MV, HEATS_MV, 1.0f, 0, 0, 0, 0.932f, 0.924f},
        {2, HEATS_MV, 0.75f, HEATS_MV, HEATS_MV, 0.75f, 0, 0, 0, 0.697f, 0.686f},
        {4, HEATS_MV, 1.0f, HEATS_MV, HEATS_MV, 1.0f, 0, 0, 0, 0.946f, 0.940f},
        /* a drop moves by a sixth: 60 mV of 400; at the same volts with those of the others, but
           for 20 mV */
        {9, 0, 0, HOLDS_MV, HOLDS_MV, 1.0f, 400, 0, 0, 0.72f, 0.69f},
        {9, 0, 0, HOLDS_MV, HEATS_MV, 1.0f, 400, 0, 0, 0.62f, 0.58f},
        {9, 0, 0, HEATS_MV, HEATS_MV, 1.0f, 400, 0, 0, 0.79f, 0.77f},
        {9, HOLDS_MV, 1.0f, HOLDS_MV, HOLDS_MV, 1.0f, 400, 0, 0, 0.933f, 0.927f},
        {9, HEATS_MV, 1.0f, HOLDS_MV, HOLDS_MV, 1.0f, 400, 0, 0, 0.85f, 0.82f},
        {9, HEATS_MV, 1.0f, HOLDS_MV, HEATS_MV, 1.0f, 400, 0, 0, 0.796f, 0.789f},
        {9, HEATS_MV, 1.0f, HEATS_MV, HEATS_MV, 1.0f, 400, 0, 0, 0.946f, 0.940f},
        /* what is not known of it is let pass on its own side, beside others driven otherwise */
        {9, 0, 0, HEATS_MV, HOLDS_MV, 1.0f, 0, 0, 200, 0.46f, 0.41f},
        {9, 0, 0, HEATS_MV, HOLDS_MV, 1.0f, 0, 200, 0, 1.54f, 1.59f},
        {9, 0, 0, HEATS_MV, HOLDS_MV, 1.0f, 0, 200, 0, 0.77f, 0.74f},
        {9, 0, 0, HOLDS_MV, HEATS_MV, 1.0f, 0, 200, 0, 0.46f, 0.41f},
        {9, 0, 0, HOLDS_MV, HEATS_MV, 1.0f, 0, 0, 200, 0.77f, 0.74f},
        /* alone: 10 % less or 20 % more, 8 mV, and of offsets and of what is not known of a drop
           what they make of other volts */
        {1, HEATS_MV, 1.0f, HEATS_MV, 0, 0, 0, 200, 200, 0.895f, 0.885f},
        {1, HEATS_MV, 1.0f, HEATS_MV, 0, 0, 0, 200, 200, 1.205f, 1.215f},
        {1, HOLDS_MV, 1.0f, HOLDS_MV, 0, 0, 0, 0, 0, 0.885f, 0.875f},
        {1, HEATS_MV, 1.0f, HOLDS_MV, 0, 0, 0, 200, 0, 0.53f, 0.50f},
        {1, HEATS_MV, 1.0f, HOLDS_MV, 0, 0, 0, 0, 200, 0.85f, 0.82f},
        {1, HEATS_MV, 1.0f, HOLDS_MV, 0, 0, 0, 0, 200, 1.56f, 1.60f},
        {1, HOLDS_MV, 1.0f, HEATS_MV, 0, 0, 0, 0, 200, 0.78f, 0.75f},
    };
    for (unsigned n = 0; n < ROWS(limits); n++) {
        for (unsigned found = 0; found < 2; found++) {
            setUp();
            row(n);
            source.drop_mv = limits[n].drop_mv;
            source.more_mv = limits[n].more_mv;
            source.less_mv = limits[n].less_mv;
            source.unsure_mv = fmaxf(source.more_mv, source.less_mv);
            if (limits[n].learnt_mv > 0.0f) {
                (void)rounds(2, limits[n].driven, limits[n].learnt_mv, limits[n].was,
                             limits[n].others);
                TEST_ASSERT_EQUAL_UINT(0, peers.spring[0].odd);
            }
            for (unsigned window = 1; window <= CIRCUIT_PEERS_WINDOWS; window++) {
                for (uint8_t k = 1; k < limits[n].driven; k++) {
                    (void)takes(k, limits[n].others_mv, limits[n].others);
                }
                const float share = found != 0 ? limits[n].found : limits[n].passes;
                TEST_ASSERT_EQUAL(found != 0 && window == CIRCUIT_PEERS_WINDOWS,
                                  takes(0, limits[n].own_mv, share));
            }
        }
    }
}

/* In whatever order they come, and whoever is asked; who is not of the array has no voice. */
TEST(the_middle_one_of_the_others_counts)
{
    static const float shares[6][3] = {{0.5f, 1.0f, 1.5f}, {0.5f, 1.5f, 1.0f}, {1.0f, 0.5f, 1.5f},
                                       {1.0f, 1.5f, 0.5f}, {1.5f, 0.5f, 1.0f}, {1.5f, 1.0f, 0.5f}};
    for (unsigned n = 0; n < 48; n++) {
        const uint8_t asked = (uint8_t)(n % 4u);
        const bool odd = n / 4u % 2u != 0;
        setUp();
        for (uint8_t k = 0, j = 0; k < 4; k++) {
            if (k != asked) {
                (void)takes(k, HEATS_MV, shares[n / 8u][j++]);
            }
        }
        (void)takes(4, HEATS_MV, 1.95f);
        circuit_window_t window = window_of((odd ? 0.79f : 0.80f) * HEATS_MV, HEATS_MV, 0.0f);
        for (unsigned times = 0; times < 3; times++) {
            const bool found = circuit_peers_judge(&peers, 4, asked, &window, &source);
            TEST_ASSERT_EQUAL(odd && times == 2, found);
        }
    }
    setUp();
    for (uint8_t k = 1; k < SPRINGS; k++) { /* of eight the fifth */
        (void)takes(k, HEATS_MV, 0.5f + 0.125f * (float)(k - 1));
    }
    for (unsigned n = 0; n < 3; n++) {
        TEST_ASSERT_EQUAL(n == 2, takes(0, HEATS_MV, 0.79f));
    }
}

TEST(what_is_learnt_is_the_mean_of_its_windows)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(1, SPRINGS, HEATS_MV, 0.95f, 1.0f)); /* it comes first: alone */
    for (unsigned n = 0; n < 50; n++) {
        TEST_ASSERT_EQUAL_HEX(0, rounds(1, SPRINGS, HEATS_MV, n % 2u != 0 ? 0.97f : 1.03f, 1.0f));
    }
    TEST_ASSERT_INT_WITHIN(26, 4096, peers.spring[0].own_q12);
    TEST_ASSERT_EQUAL_HEX(0, rounds(400, SPRINGS, HEATS_MV, 1.0f, 1.0f));
    TEST_ASSERT_INT_WITHIN(8, 4096, peers.spring[0].own_q12);
    TEST_ASSERT_EQUAL_UINT(127, peers.spring[0].learnt);
    TEST_ASSERT_EQUAL_HEX(0, rounds(1000, SPRINGS, HEATS_MV, 1.05f, 1.0f)); /* no more of it */
    TEST_ASSERT_INT_WITHIN(8, 4096, peers.spring[0].own_q12);
}

/* What offsets may have made of a share is what they make of the mean voltage it was learnt at. */
TEST(a_share_is_known_as_well_as_its_volts_tell)
{
    const circuit_peer_t *const own = &peers.spring[0];
    TEST_ASSERT_EQUAL_HEX(0, rounds(1, SPRINGS, 1600.0f, 1.0f, 1.0f)); /* it comes first: alone */
    TEST_ASSERT_FALSE(takes(0, 640.0f, 1.0f) || takes(0, 640.0f, 1.0f));
    TEST_ASSERT_EQUAL_UINT(80, own->volts);
    TEST_ASSERT_FALSE(takes(0, 1600.0f, 0.92f));
    TEST_ASSERT_EQUAL_UINT(0, own->odd);
    TEST_ASSERT_EQUAL_UINT(180, own->volts);
    TEST_ASSERT_INT_WITHIN(2, (80 * 4096 + 100 * 3768) / 180, own->own_q12);
    TEST_ASSERT_FALSE(takes(0, 5000.0f, 0.96f));
    TEST_ASSERT_EQUAL_UINT(255, own->shown_16mv);
    circuit_peers_clear(&peers, 0, true);
    TEST_ASSERT_EQUAL_UINT(0, own->volts);
}

/* One window is no row: until it is full, the supply may move. */
TEST(what_is_odd_once_is_not_yet_judged_as_if_it_were_known)
{
    TEST_ASSERT_FALSE(takes(0, HEATS_MV, 1.0f) || takes(0, HEATS_MV, 0.75f));
    TEST_ASSERT_EQUAL_UINT(1, peers.spring[0].odd);
    TEST_ASSERT_FALSE(takes(0, HEATS_MV, 0.91f));
    TEST_ASSERT_EQUAL_UINT(0, peers.spring[0].odd);
}

/* Found by another rule: as if by this one; a good window after the clear acquits it. Alone, too:
 * its supply is what it was. */
TEST(who_is_suspected_is_found_in_one_window_after_a_clear)
{
    for (unsigned n = 0; n < 4; n++) {
        const bool honest = n % 2u != 0;
        const uint8_t driven = n < 2 ? SPRINGS : 1;
        setUp();
        TEST_ASSERT_EQUAL_HEX(0, rounds(5, driven, HEATS_MV, 1.0f, 1.0f));
        TEST_ASSERT_EQUAL_HEX(0, rounds(2, driven, HEATS_MV, 0.92f, 1.0f));
        for (unsigned times = 0; times < 10; times++) {
            circuit_peers_suspect(&peers, 0, times == 0 ? 4096 : 2048); /* once is enough */
            TEST_ASSERT_EQUAL_HEX(1, rounds(1, driven, HEATS_MV, 0.92f, 1.0f));
        }
        circuit_peers_clear(&peers, 0, true);
        TEST_ASSERT_EQUAL_HEX(0, honest ? rounds(1, driven, HEATS_MV, 1.0f, 1.0f) : 0);
        TEST_ASSERT_EQUAL_HEX(!honest, rounds(1, driven, HEATS_MV, 0.92f, 1.0f));
    }
}

/* 5 % beyond what a cable makes is 30 mV of 600, and 20 of 400, which offsets may make. */
TEST(a_window_that_would_not_tell_a_lie_acquits_nobody_who_was_found)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(20, SPRINGS, 600.0f, 1.0f, 1.0f));
    TEST_ASSERT_EQUAL_HEX(1, rounds(3, SPRINGS, 600.0f, 0.9f, 1.0f));
    circuit_peers_clear(&peers, 0, true);
    const uint8_t learnt = peers.spring[0].learnt;
    for (unsigned n = 0; n < 10; n++) {
        for (uint8_t k = 1; k < SPRINGS; k++) {
            TEST_ASSERT_FALSE(takes(k, HOLDS_MV, 1.0f));
        }
        TEST_ASSERT_FALSE(takes(0, HEATS_MV, 0.9f));
    }
    TEST_ASSERT_EQUAL_UINT8(learnt, peers.spring[0].learnt);
    for (uint8_t k = 1; k < SPRINGS; k++) {
        TEST_ASSERT_FALSE(takes(k, 600.0f, 1.0f));
    }
    TEST_ASSERT_TRUE(takes(0, HEATS_MV, 0.9f));
}

/* 0 is for who says nothing; more than 255 / 128 is as much. */
TEST(a_share_is_kept_to_the_nearest_128th)
{
    static const float shares[][2] = {{0.0f, 1},     {0.4f, 1},     {1.4f, 1},
                                      {1.6f, 2},     {2.4f, 2},     {254.4f, 254},
                                      {254.6f, 255}, {300.0f, 255}, {600.0f, 255}};
    for (unsigned n = 0; n < ROWS(shares); n++) {
        (void)takes(0, 1e5f, shares[n][0] / 128.0f);
        TEST_ASSERT_EQUAL_UINT(shares[n][1], peers.spring[0].share_q7);
    }
}

/* A clear ends what its last window said for others, and a row that was not full. */
TEST(a_clear_ends_what_was_counted)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(5, 4, HEATS_MV, 1.0f, 1.0f));
    TEST_ASSERT_EQUAL_HEX(0, rounds(1, 4, HEATS_MV, 0.92f, 1.0f));
    TEST_ASSERT_EQUAL_UINT(1, peers.spring[0].odd);
    for (uint8_t k = 0; k < 4; k++) {
        circuit_peers_clear(&peers, k, false);
    }
    TEST_ASSERT_EQUAL_UINT(0, peers.spring[0].odd);
    for (unsigned n = 0; n < 5; n++) { /* alone: it may be the supply */
        TEST_ASSERT_FALSE(takes(0, HEATS_MV, 0.92f));
    }
}

/* At any volts of each, by as much as it may: both show it; at the same few, whatever offsets and a
 * diode's drop would make of them. */
TEST(a_supply_that_moves_is_no_lie_of_either_of_two)
{
    static const float volts_mv[][2] = {
        {HEATS_MV, HEATS_MV}, {HOLDS_MV, HOLDS_MV}, {HOLDS_MV, HEATS_MV}, {HEATS_MV, HOLDS_MV}};
    for (unsigned n = 0; n < ROWS(volts_mv); n++) {
        for (unsigned sensors = 0; sensors < (n < 2 ? 4u : 2u); sensors++) {
            for (float moved = 0.7f; moved < 1.4f; moved += 0.1f) {
                setUp();
                source.drop_mv = sensors / 2u != 0 ? 330.0f : 0.0f;
                const float own = sensors % 2u != 0 ? 0.93f : 1.0f; /* of the first one's wiring */
                for (unsigned window = 0; window < 20; window++) {
                    const float supply = window < 8 ? 1.0f : moved;
                    /* a duty that gives the same volts is as much longer */
                    TEST_ASSERT_FALSE(takes(0, volts_mv[n][0] / supply, own * supply));
                    TEST_ASSERT_FALSE(takes(1, volts_mv[n][1] / supply, supply));
                }
            }
        }
    }
}

/* One of the two has changed: that one, though they differ from then on. */
TEST(of_two_the_one_that_has_changed_lies)
{
    for (uint8_t liar = 0; liar < 2; liar++) {
        setUp();
        for (unsigned window = 0; window < 8; window++) {
            TEST_ASSERT_FALSE(takes(0, HEATS_MV, 1.0f) || takes(1, HEATS_MV, 1.0f));
        }
        for (unsigned window = 0; window < 30; window++) {
            for (uint8_t k = 0; k < 2; k++) {
                TEST_ASSERT_EQUAL(k == liar && window >= 2,
                                  takes(k, HEATS_MV, k == liar ? 0.9f : 1.0f));
            }
        }
    }
}

/* The volts are those of the window that is compared with, whichever that is. */
TEST(offsets_make_nothing_of_a_share_at_the_same_volts)
{
    TEST_ASSERT_FALSE(takes(0, HEATS_MV, 1.0f));
    TEST_ASSERT_EQUAL_HEX(1, rounds(3, 1, HEATS_MV, 0.885f, 0.0f));
    setUp();
    TEST_ASSERT_EQUAL_HEX(0, rounds(2, 1, HEATS_MV, 1.0f, 0.0f));
    TEST_ASSERT_EQUAL_HEX(0, rounds(3, 1, HOLDS_MV, 1.0f, 0.0f));
    TEST_ASSERT_EQUAL_HEX(1, rounds(3, 1, HOLDS_MV, 0.87f, 0.0f));
}

/* Half of the difference to each of two; beside those that outvote it, all of it. */
TEST(what_two_learn_of_each_other_stays)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(30, 2, HEATS_MV, 0.9f, 1.0f));
    const float first = (float)peers.spring[0].own_q12, second = (float)peers.spring[1].own_q12;
    TEST_ASSERT_FLOAT_WITHIN(0.01f, 0.9f, first / second);
    TEST_ASSERT_FLOAT_WITHIN(0.01f, 1.0f, first / 4096.0f / 0.947f);
    setUp();
    for (uint8_t k = 0; k < 4; k++) {
        TEST_ASSERT_FALSE(takes(k, HEATS_MV, k == 3 ? 0.9f : 1.0f));
    }
    TEST_ASSERT_INT_WITHIN(8, 3686, peers.spring[3].own_q12);
}

/* A lie of a hold has its spring heated in the next window: the others' few volts, and all that
 * their drop may be, are what they were when its share of theirs was kept. */
TEST(who_lies_and_is_heated_for_it_is_found_beside_others_that_hold)
{
    for (unsigned is_less = 0; is_less < 2; is_less++) {
        setUp();
        source.drop_mv = 400.0f;
        TEST_ASSERT_EQUAL_HEX(0, rounds(8, 4, HOLDS_MV, 1.02f, 1.05f));
        for (unsigned window = 0; window < CIRCUIT_PEERS_WINDOWS; window++) {
            for (uint8_t k = 1; k < 4; k++) {
                TEST_ASSERT_FALSE(takes(k, HOLDS_MV, 1.05f));
            }
            TEST_ASSERT_EQUAL(window == CIRCUIT_PEERS_WINDOWS - 1u,
                              takes(0, HEATS_MV, is_less != 0 ? 0.85f : 1.19f));
        }
    }
}

/* Where it began in the middle of a window, that one is kept by no more than a part. */
TEST(the_window_in_which_it_begins_is_not_what_it_showed_before)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(8, 4, HEATS_MV, 1.0f, 1.0f));
    TEST_ASSERT_EQUAL_HEX(0, rounds(1, 4, HEATS_MV, 0.965f, 1.0f));
    TEST_ASSERT_EQUAL_HEX(0, rounds(2, 4, HEATS_MV, 0.93f, 1.0f));
    TEST_ASSERT_EQUAL_HEX(1, rounds(1, 4, HEATS_MV, 0.93f, 1.0f));
}

/* Nor is one that noise may be, however often it is shown. */
TEST(what_noise_may_be_is_not_what_it_showed_before)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(8, 4, HEATS_MV, 1.0f, 1.0f));
    TEST_ASSERT_EQUAL_HEX(0, rounds(20, 4, HEATS_MV, 0.9455f, 1.0f));
    TEST_ASSERT_EQUAL_HEX(0, rounds(2, 4, HEATS_MV, 0.935f, 1.0f));
    TEST_ASSERT_EQUAL_HEX(1, rounds(1, 4, HEATS_MV, 0.935f, 1.0f));
}

/* 5 % and no 128th more; of two that do not agree, at the same volts, the one that shows less
 * tells. */
TEST(two_agree_within_what_a_cable_makes)
{
    static const struct {
        float second;
        bool outvotes;
    } table[] = {{0.953f, true}, {0.945f, false}, {0.8f, false}};
    for (unsigned n = 0; n < ROWS(table); n++) {
        setUp();
        row(n);
        TEST_ASSERT_EQUAL_HEX(0, rounds(8, 3, HEATS_MV, 1.0f, 1.0f));
        (void)takes(1, HEATS_MV, 1.0f);
        (void)takes(2, HEATS_MV, table[n].second);
        circuit_window_t window = window_of(HEATS_MV, HEATS_MV, 0.0f);
        TEST_ASSERT_FALSE(circuit_peers_judge(&peers, SPRINGS, 0, &window, &source));
        TEST_ASSERT_EQUAL(table[n].outvotes, window.outvoted);
        TEST_ASSERT_FLOAT_WITHIN(0.01f, table[n].outvotes ? 1.0f : 1.0f / table[n].second,
                                 window.beside);
    }
}

/* Found, and cleared or not: what noise or a drop may be says nothing for it. */
TEST(what_may_be_noise_or_a_drop_clears_nobody)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(5, 1, HOLDS_MV, 1.0f, 0.0f));
    TEST_ASSERT_EQUAL_HEX(1, rounds(3, 1, HOLDS_MV, 0.8f, 0.0f));
    source.unsure_mv = 2000.0f;
    TEST_ASSERT_TRUE(takes(0, HOLDS_MV, 1.0f));
    source.unsure_mv = 0.0f;
    circuit_peers_clear(&peers, 0, true);
    TEST_ASSERT_FALSE(takes(0, HOLDS_MV, 0.94f));
    TEST_ASSERT_TRUE(takes(0, HOLDS_MV, 0.8f));
}

/* Of the supply, by whoever has found it, though it was beside others until then. */
TEST(who_is_suspected_beside_others_is_known_where_it_is_alone)
{
    for (unsigned lies = 0; lies < 2; lies++) {
        setUp();
        TEST_ASSERT_EQUAL_HEX(0, rounds(8, 4, HEATS_MV, 0.8f, 0.8f));
        circuit_peers_suspect(&peers, 0, (uint16_t)(0.8f * 4096.0f));
        for (uint8_t k = 1; k < 4; k++) {
            is_off(k);
        }
        circuit_peers_clear(&peers, 0, true);
        TEST_ASSERT_EQUAL(lies != 0, takes(0, HEATS_MV, lies != 0 ? 0.74f : 0.8f));
    }
}

/* One is as much of the others by whatever supply is believed. */
TEST(another_belief_moves_nothing_beside_others)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(8, 4, HEATS_MV, 1.0f, 1.0f));
    const circuit_source_t other = {.step_mv = 6.0f};
    circuit_peers_renew(&peers, SPRINGS, &source, &other);
    TEST_ASSERT_EQUAL_HEX(0,
                          rounds(3, 4, HEATS_MV, 0.93f * 0.9f, 0.9f)); /* of one they come later */
    TEST_ASSERT_EQUAL_HEX(1, rounds(1, 4, HEATS_MV, 0.93f * 0.9f, 0.9f));
}

/* It is cleared, and driven alone on the same supply: as little of it shows the same lie. */
TEST(what_was_found_beside_others_is_known_where_it_is_alone)
{
    for (unsigned mended = 0; mended < 2; mended++) {
        setUp();
        TEST_ASSERT_EQUAL_HEX(0, rounds(8, 4, HEATS_MV, 0.9f, 0.9f));
        TEST_ASSERT_EQUAL_HEX(1, rounds(3, 4, HEATS_MV, 0.9f * 0.91f, 0.9f));
        for (uint8_t k = 1; k < 4; k++) {
            is_off(k);
        }
        circuit_peers_clear(&peers, 0, true);
        TEST_ASSERT_EQUAL(mended == 0, takes(0, HEATS_MV, mended != 0 ? 0.9f : 0.9f * 0.91f));
    }
}

/* They stop: of the supply alone it has shown nothing yet. */
TEST(what_it_showed_beside_others_is_no_share_of_the_supply)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(8, 4, HEATS_MV, 0.8f, 0.8f));
    for (uint8_t k = 1; k < 4; k++) {
        is_off(k);
    }
    TEST_ASSERT_EQUAL_HEX(0, rounds(5, 1, HEATS_MV, 0.8f, 0.0f));
    TEST_ASSERT_EQUAL_HEX(1, rounds(3, 1, HEATS_MV, 0.7f, 0.0f));
}

/* For who judges a window after it: what it is of the others, and whether they tell the same. */
TEST(a_window_is_told_what_it_is_beside_the_others)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(8, 4, HEATS_MV, 0.9f, 1.0f));
    static const struct {
        float own_mv, share;
        bool outvoted, acquitted;
    } table[] = {
        {HEATS_MV, 0.9f, true, true},   {HEATS_MV, 0.87f, true, true}, /* 5 % of its own share */
        {HEATS_MV, 0.8f, true, false},  {HOLDS_MV, 0.9f, false, true},
        {HOLDS_MV, 0.82f, false, true},                               /* 10 % */
        {HOLDS_MV, 0.8f, false, false}, {200.0f, 0.82f, false, true}, /* as little as it is */
        {200.0f, 0.8f, false, false}};
    for (unsigned n = 0; n < ROWS(table); n++) {
        row(n);
        circuit_window_t window =
            window_of(table[n].share * table[n].own_mv, table[n].own_mv, 0.0f);
        TEST_ASSERT_FALSE(circuit_peers_judge(&peers, SPRINGS, 0, &window, &source));
        TEST_ASSERT_FLOAT_WITHIN(1e-3f, table[n].share, window.beside);
        TEST_ASSERT_EQUAL(table[n].outvoted, window.outvoted);
        TEST_ASSERT_EQUAL(table[n].acquitted, window.acquitted);
    }
    for (uint8_t k = 2; k < 4; k++) { /* one is left, which outvotes nobody */
        is_off(k);
    }
    circuit_window_t window = window_of(0.9f * HEATS_MV, HEATS_MV, 0.0f);
    TEST_ASSERT_FALSE(circuit_peers_judge(&peers, SPRINGS, 0, &window, &source));
    TEST_ASSERT_FALSE(window.outvoted || window.acquitted);
}

/* Two that show what they ever did beside each other outvote a third one, whatever it showed in the
 * window before: supply and drop were believed anew just then. */
TEST(two_that_agree_outvote_a_third_one)
{
    TEST_ASSERT_EQUAL_HEX(0, rounds(8, 3, HEATS_MV, 1.0f, 1.0f));
    circuit_peers_renew(&peers, SPRINGS, &source, &source);
    TEST_ASSERT_EQUAL_HEX(0, rounds(2, 3, HEATS_MV, 0.9f, 1.0f));
    TEST_ASSERT_EQUAL_HEX(1, rounds(3, 3, HEATS_MV, 0.9f, 1.0f));
}

/* One of two lies from the first, and is half of what is known: the others that begin later are
 * not odd for it. */
TEST(one_that_lies_from_the_first_makes_no_liars_of_others)
{
    for (uint8_t liar = 0; liar < 2; liar++) {
        for (float lie = 0.84f; lie < 1.17f; lie += 0.04f) {
            setUp();
            for (unsigned window = 0; window < 40; window++) {
                const uint8_t driven = window < 20 ? 2 : SPRINGS;
                for (uint8_t k = 0; k < driven; k++) {
                    const float wiring = 1.0f + 0.01f * (float)(k % 5u) - 0.02f;
                    TEST_ASSERT_FALSE(takes(k, HEATS_MV, k == liar ? lie : wiring));
                }
            }
        }
    }
}
