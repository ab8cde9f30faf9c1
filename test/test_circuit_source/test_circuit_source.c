/* What nine springs show of a supply and its diodes is found, as far as it can be and no further
 * than tolerances go. */
#include <math.h>

#include "../run_tests.h"
#include "circuit_source.h"

static current_control_parameters_t circuit;
static circuit_source_t source;

void setUp(void)
{
    current_control_parameters_default(&circuit);
    circuit_source_begin(&source, &circuit);
}

typedef struct {
    float supply_mv, drop_mv;
} true_t;

static float behind_mv(true_t is, float duty)
{
    return is.supply_mv * duty / 800.0f - is.drop_mv * (1.0f - duty / 800.0f);
}

/* Rounds of so many springs, driven alike; whether the last one brought another belief. */
static bool rounds(unsigned count, unsigned springs, true_t is, float duty)
{
    bool other = false;
    for (unsigned n = 0; n < count; n++) {
        for (unsigned k = 0; k < springs; k++) {
            circuit_source_take(&source, duty, behind_mv(is, duty));
        }
        other = circuit_source_fit(&source, &circuit);
    }
    return other;
}

static float expected_mv(float duty)
{
    return source.step_mv * duty - source.drop_mv;
}

static void expect_declared(float unsure_mv)
{
    const float drop_mv = (float)circuit.freewheel_mv;
    TEST_ASSERT_FLOAT_WITHIN(0.3f, 5000.0f, circuit_source_supply_mv(&source));
    TEST_ASSERT_FLOAT_WITHIN(0.3f, drop_mv, source.drop_mv);
    TEST_ASSERT_FLOAT_WITHIN(0.001f, (5000.0f + drop_mv) / 800.0f, source.step_mv);
    TEST_ASSERT_FLOAT_WITHIN(1.0f, unsure_mv, source.unsure_mv);
    TEST_ASSERT_EQUAL_UINT(circuit.freewheel_mv, source.driven_drop_mv);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, source.more_drop_v);
}

TEST(at_first_what_is_declared_is_believed)
{
    expect_declared(600.0f);
    circuit.freewheel_mv = 390;
    circuit_source_begin(&source, &circuit);
    expect_declared(150.0f);
}

/* A heating and a hold, by one spring or by all: duties apart tell supply from drop. */
TEST(a_heating_and_a_hold_tell_supply_and_drop)
{
    static const struct {
        float supply_mv, drop_mv;
        uint16_t declared_mv;
    } cases[] = {{5000, 390, 0},   {4500, 390, 0}, {5400, 330, 0},   {4300, 0, 0},
                 {5000, 0, 0},     {5500, 0, 0},   {5000, 450, 390}, {4500, 390, 390},
                 {5300, 300, 390}, {5000, 500, 0}};
    for (unsigned springs = 1; springs <= 9; springs += 4) {
        for (unsigned n = 0; n < ROWS(cases); n++) {
            const true_t is = {cases[n].supply_mv, cases[n].drop_mv};
            circuit.freewheel_mv = cases[n].declared_mv;
            circuit_source_begin(&source, &circuit);
            rounds(10, springs, is, 230.0f);
            /* what a round of it shows is expected at once, whatever makes it */
            TEST_ASSERT_FLOAT_WITHIN(0.04f * behind_mv(is, 230.0f), behind_mv(is, 230.0f),
                                     expected_mv(230.0f));
            rounds(springs > 1 ? 4 : 20, springs, is, 110.0f);
            TEST_ASSERT_FLOAT_WITHIN(springs > 1 ? 30.0f : 60.0f, is.drop_mv, source.drop_mv);
            TEST_ASSERT_FLOAT_WITHIN(springs > 1 ? 100.0f : 300.0f, is.supply_mv,
                                     circuit_source_supply_mv(&source));
            TEST_ASSERT_FLOAT_WITHIN(15.0f, behind_mv(is, 110.0f), expected_mv(110.0f));
            TEST_ASSERT_TRUE(source.unsure_mv < (springs > 1 ? 75.0f : 120.0f));
        }
    }
}

/* Some heat, some hold: what they show in one round is of one supply, whatever that does from round
 * to round, as where the last of a heating leave a weak one. */
TEST(a_round_of_several_duties_tells_them_whatever_the_supply_does)
{
    static const struct {
        float supply_mv, more_mv, drop_mv; /* of the first round, and more at the last */
        uint16_t declared_mv;
    } cases[] = {
        {4300, 400, 440, 0}, {5100, -500, 0, 0}, {4500, 300, 300, 390}, {5200, -400, 390, 0}};
    for (unsigned n = 0; n < ROWS(cases); n++) {
        circuit.freewheel_mv = cases[n].declared_mv;
        circuit_source_begin(&source, &circuit);
        for (unsigned turn = 0; turn <= 10; turn++) {
            const true_t is = {cases[n].supply_mv + 0.1f * (float)turn * cases[n].more_mv,
                               cases[n].drop_mv};
            for (unsigned k = 0; k < 6; k++) { /* one after the other ends its heating */
                const float duty = 2 * k < turn ? 100.0f : 230.0f;
                circuit_source_take(&source, duty, behind_mv(is, duty));
            }
            (void)circuit_source_fit(&source, &circuit);
        }
        TEST_ASSERT_FLOAT_WITHIN(30.0f, cases[n].drop_mv, source.drop_mv);
        TEST_ASSERT_TRUE(source.unsure_mv < 60.0f);
    }
}

/* What may be no drop at all is not driven by, nor does the ceiling count on it. */
TEST(what_is_driven_by_is_sure)
{
    rounds(2, 9, (true_t){4300, 0}, 230.0f);
    TEST_ASSERT_TRUE(source.drop_mv > 50.0f); /* it may be the supply */
    TEST_ASSERT_EQUAL_UINT(0, source.driven_drop_mv);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, source.more_drop_v);
    setUp();
    rounds(2, 9, (true_t){5000, 390}, 230.0f);
    TEST_ASSERT_TRUE(source.unsure_mv > 200.0f);
    TEST_ASSERT_UINT_WITHIN(1, (unsigned)source.drop_mv, source.driven_drop_mv);
    TEST_ASSERT_TRUE(source.driven_drop_mv > 250u);
    rounds(5, 9, (true_t){5000, 390}, 110.0f);
    TEST_ASSERT_UINT_WITHIN(25, 390, source.driven_drop_mv);
    TEST_ASSERT_TRUE(source.more_drop_v > 0.3f);
    TEST_ASSERT_FLOAT_WITHIN(0.021f, 1e-3f * (source.drop_mv - source.unsure_mv),
                             source.more_drop_v);
    circuit.freewheel_mv = 390; /* declared, and a little less: it is what is declared */
    circuit_source_begin(&source, &circuit);
    rounds(5, 9, (true_t){5000, 370}, 230.0f);
    rounds(5, 9, (true_t){5000, 370}, 110.0f);
    TEST_ASSERT_EQUAL_UINT(390, source.driven_drop_mv);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, source.more_drop_v);
    rounds(5, 9, (true_t){5000, 260}, 110.0f);
    rounds(5, 9, (true_t){5000, 260}, 230.0f);
    rounds(5, 9, (true_t){5000, 260}, 110.0f);
    TEST_ASSERT_UINT_WITHIN(30, 260, source.driven_drop_mv);
}

/* All sensors lie, or it is no such supply: no further than tolerances go; and less far where each
 * other duty looks like another supply, so that little is ever known. */
TEST(tolerances_bound_it)
{
    static const struct {
        float supply_mv, drop_mv;
        uint16_t declared_mv;
        float believed_mv, believed_drop_mv;
    } cases[] = {{2500, 0, 0, 4685, -1},    {9000, 0, 0, 5500, -1},  {5000, 1400, 0, -1, 500},
                 {5000, 700, 390, -1, 540}, {5000, 0, 390, -1, 240}, {5000, 0, 100, -1, -1},
                 {5000, -400, 100, -1, 0},  {5000, -400, 0, -1, 0}};
    for (unsigned n = 0; n < ROWS(cases); n++) {
        const true_t is = {cases[n].supply_mv, cases[n].drop_mv};
        circuit.freewheel_mv = cases[n].declared_mv;
        circuit_source_begin(&source, &circuit);
        for (unsigned turn = 0; turn < 4; turn++) {
            rounds(5, 9, is, 400.0f);
            rounds(5, 9, is, 150.0f);
        }
        if (cases[n].believed_mv >= 0.0f) {
            TEST_ASSERT_FLOAT_WITHIN(51.0f, cases[n].believed_mv,
                                     circuit_source_supply_mv(&source));
        }
        if (cases[n].believed_drop_mv >= 0.0f) {
            TEST_ASSERT_FLOAT_WITHIN(20.1f, cases[n].believed_drop_mv, source.drop_mv);
        }
        TEST_ASSERT_TRUE(circuit_source_supply_mv(&source) >= 4199.0f &&
                         circuit_source_supply_mv(&source) <= 5501.0f);
        TEST_ASSERT_TRUE(source.drop_mv >= 0.0f);
    }
}

/* One side of what is unsure ends where the tolerance does: no drop is below none. */
TEST(what_is_unsure_ends_at_the_tolerance)
{
    static const struct {
        uint16_t declared_mv;
        float less_mv, more_mv;
        uint16_t dead_steps; /* of 5 V and the believed drop, 800 steps */
    } cases[] = {{0, 0, 500, 80}, {390, 150, 150, 80}, {100, 100, 150, 39}};
    for (unsigned n = 0; n < ROWS(cases); n++) {
        circuit.freewheel_mv = cases[n].declared_mv;
        circuit_source_begin(&source, &circuit);
        TEST_ASSERT_FLOAT_WITHIN(0.4f, cases[n].less_mv, source.less_mv);
        TEST_ASSERT_FLOAT_WITHIN(0.4f, cases[n].more_mv, source.more_mv);
        TEST_ASSERT_UINT16_WITHIN(1, cases[n].dead_steps, source.dead_steps);
        TEST_ASSERT_EQUAL_FLOAT(5000.0f + (float)cases[n].declared_mv, 800.0f * source.step_mv);
    }
    circuit.freewheel_mv = 390;
    circuit_source_begin(&source, &circuit);
    rounds(3, 9, (true_t){5000, 300}, 230.0f);
    TEST_ASSERT_TRUE(source.drop_mv - 240.0f < source.unsure_mv);
    TEST_ASSERT_FLOAT_WITHIN(0.1f, source.drop_mv - 240.0f, source.less_mv);
    circuit_source_begin(&source, &circuit);
    rounds(3, 9, (true_t){5000, 480}, 230.0f);
    TEST_ASSERT_TRUE(540.0f - source.drop_mv < source.unsure_mv);
    TEST_ASSERT_FLOAT_WITHIN(0.1f, 540.0f - source.drop_mv, source.more_mv);
    circuit.freewheel_mv = 0;
    circuit_source_begin(&source, &circuit);
    rounds(3, 9, (true_t){5000, 1400}, 400.0f);
    TEST_ASSERT_EQUAL_FLOAT(500.0f, source.drop_mv);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, source.more_mv);
    circuit.freewheel_mv = 0;
    circuit_source_begin(&source, &circuit);
    rounds(8, 9, (true_t){5000, 390}, 230.0f);
    rounds(8, 9, (true_t){5000, 390}, 110.0f);
    TEST_ASSERT_EQUAL_FLOAT(source.unsure_mv, source.less_mv);
    TEST_ASSERT_EQUAL_FLOAT(source.unsure_mv, source.more_mv);
}

/* Of 314 mV in a hold 14 are no other belief. */
TEST(a_level_is_another_beyond_3_percent)
{
    for (unsigned n = 0; n < 2; n++) {
        setUp();
        rounds(8, 9, (true_t){5000, 0}, 230.0f);
        rounds(40, 9, (true_t){5000, 0}, 50.0f); /* 312 mV */
        const float believed_mv = expected_mv(50.0f);
        const true_t other = {n == 0 ? 4810.0f : 4720.0f, 0};
        TEST_ASSERT_FALSE(rounds(1, 9, (true_t){5000, 0}, 50.0f));
        rounds(20, 9, other, 50.0f);
        TEST_ASSERT_EQUAL(n == 0, fabsf(expected_mv(50.0f) - believed_mv) < 1e-3f);
    }
}

/* What the ceiling counts on begins where it is sure, with no step. */
TEST(what_is_sure_of_a_drop_grows_from_nothing)
{
    float more_v = 0.0f;
    for (float mv = 20.0f; mv < 100.0f && more_v == 0.0f; mv += 0.25f) {
        setUp();
        rounds(8, 9, (true_t){5000, mv}, 230.0f);
        rounds(8, 9, (true_t){5000, mv}, 110.0f);
        more_v = source.more_drop_v;
    }
    TEST_ASSERT_TRUE(more_v > 0.0f && more_v < 0.6e-3f);
}

/* Nor is a drop, by less than a quarter of what is not known of it. */
TEST(a_drop_is_another_beyond_a_quarter_of_what_is_unsure)
{
    rounds(8, 9, (true_t){5000, 390}, 230.0f);
    const float believed_mv = source.drop_mv;
    TEST_ASSERT_TRUE(source.unsure_mv > 200.0f);
    rounds(12, 9, (true_t){5000, 430}, 230.0f);
    TEST_ASSERT_EQUAL_FLOAT(believed_mv, source.drop_mv);
    rounds(12, 9, (true_t){5000, 490}, 230.0f);
    TEST_ASSERT_TRUE(source.drop_mv > believed_mv + 40.0f);
}

/* Nine springs forget nine tenths of a level in ten rounds, and nothing of how both moved. */
TEST(it_forgets_a_level_in_time)
{
    rounds(20, 9, (true_t){5000, 0}, 120.0f);
    rounds(20, 9, (true_t){5000, 0}, 110.0f);
    const float moved = source.duty_square;
    TEST_ASSERT_TRUE(moved > 500.0f && moved < 20000.0f);
    rounds(10, 9, (true_t){4700, 0}, 110.0f);
    TEST_ASSERT_FLOAT_WITHIN(8.0f, behind_mv((true_t){4700, 0}, 110.0f), source.mean_mv);
    TEST_ASSERT_FLOAT_WITHIN(1.0f, moved, source.duty_square);
}

/* A supply that steps by more than 8 % and 20 mV is another one: what was known of the old one
 * makes no drop of it. Of an unsure drop another duty may show as much. */
TEST(supply_that_steps_is_learnt_anew)
{
    static const struct {
        float supply_mv, duty;
        bool anew;
    } cases[] = {{4400, 110, true}, {4500, 110, false}, {5500, 110, false}, {5590, 110, true},
                 {4300, 330, true}, {4700, 330, false}, {5000, 330, false}, {5000, 40, false}};
    for (unsigned n = 0; n < ROWS(cases); n++) {
        circuit_source_begin(&source, &circuit);
        rounds(20, 9, (true_t){5000, 0}, 230.0f);
        rounds(20, 9, (true_t){5000, 0}, 110.0f);
        const float moved = source.duty_square;
        rounds(1, 9, (true_t){cases[n].supply_mv, 0}, cases[n].duty);
        TEST_ASSERT_EQUAL(cases[n].anew, source.duty_square < 0.5f * moved);
        TEST_ASSERT_EQUAL_FLOAT(cases[n].anew ? 9.0f : 30.0f, source.before);
        rounds(20, 9, (true_t){cases[n].supply_mv, 0}, cases[n].duty);
        if (cases[n].anew) { /* both are known no better than from the beginning */
            TEST_ASSERT_TRUE(source.unsure_mv > 100.0f);
            TEST_ASSERT_FLOAT_WITHIN(20.0f,
                                     behind_mv((true_t){cases[n].supply_mv, 0}, cases[n].duty),
                                     cases[n].duty * source.step_mv - source.drop_mv);
        }
    }
}

/* A bit of RAM turns over in any number: within some heatings all is as it was. */
TEST(whatever_turns_over_is_learnt_again)
{
    const true_t is = {5000, 390};
    float *const numbers[] = {&source.drop_mv,   &source.step_mv,    &source.unsure_mv,
                              &source.less_mv,   &source.more_mv,    &source.more_drop_v,
                              &source.duty,      &source.voltage_mv, &source.before,
                              &source.mean_duty, &source.mean_mv,    &source.duty_square,
                              &source.duty_mv};
    const float wrong[] = {NAN, INFINITY, -INFINITY, -1e30f, 1e30f, 0.0f};
    for (unsigned n = 0; n < ROWS(numbers); n++) {
        for (unsigned k = 0; k < ROWS(wrong); k++) {
            setUp();
            rounds(8, 9, is, 230.0f);
            rounds(8, 9, is, 110.0f);
            *numbers[n] = wrong[k];
            for (unsigned heating = 0; heating < 12; heating++) {
                rounds(8, 9, is, 230.0f);
                rounds(8, 9, is, 110.0f);
            }
            TEST_ASSERT_FLOAT_WITHIN(30.0f, 390.0f, source.drop_mv);
            TEST_ASSERT_FLOAT_WITHIN(25.0f, behind_mv(is, 110.0f), expected_mv(110.0f));
            TEST_ASSERT_TRUE(source.unsure_mv < 60.0f && source.less_mv < 60.0f);
        }
    }
}

/* It forgets levels within rounds, and how much both moved only by what moves. */
TEST(a_hold_forgets_a_supply_and_keeps_a_drop)
{
    rounds(8, 9, (true_t){5000, 390}, 230.0f);
    rounds(20, 9, (true_t){5000, 390}, 110.0f);
    const float moved = source.duty_square;
    rounds(2000, 9, (true_t){5000, 390}, 110.0f);
    TEST_ASSERT_FLOAT_WITHIN(0.01f * moved, moved, source.duty_square);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, source.voltage_mv);
    TEST_ASSERT_EQUAL_FLOAT(0.0f, source.duty);
    TEST_ASSERT_FLOAT_WITHIN(20.0f, 390.0f, source.drop_mv);
    TEST_ASSERT_FLOAT_WITHIN(60.0f, 5000.0f, circuit_source_supply_mv(&source));
    rounds(10, 9, (true_t){4800, 390}, 110.0f);
    TEST_ASSERT_FLOAT_WITHIN(14.0f, behind_mv((true_t){4800, 390}, 110.0f), expected_mv(110.0f));
    for (unsigned turn = 0; turn < 3; turn++) {
        rounds(8, 9, (true_t){4500, 390}, 230.0f);
        rounds(8, 9, (true_t){4500, 390}, 110.0f);
    }
    TEST_ASSERT_FLOAT_WITHIN(100.0f, 4500.0f, circuit_source_supply_mv(&source));
    TEST_ASSERT_FLOAT_WITHIN(25.0f, 390.0f, source.drop_mv);
}

/* Shares are of a belief: it does not change for a millivolt. */
TEST(small_changes_are_not_worth_another_belief)
{
    TEST_ASSERT_FALSE(circuit_source_fit(&source, &circuit)); /* a round without a window */
    TEST_ASSERT_TRUE(rounds(1, 9, (true_t){5000, 390}, 230.0f));
    TEST_ASSERT_FALSE(rounds(9, 9, (true_t){5000, 390}, 230.0f));
    TEST_ASSERT_TRUE(rounds(1, 9, (true_t){5000, 390}, 110.0f));
    rounds(9, 9, (true_t){5000, 390}, 110.0f);
    const circuit_source_t before = source;
    TEST_ASSERT_FALSE(rounds(9, 9, (true_t){5020, 395}, 110.0f));
    TEST_ASSERT_EQUAL_FLOAT(before.drop_mv, source.drop_mv);
    TEST_ASSERT_EQUAL_FLOAT(circuit_source_supply_mv(&before), circuit_source_supply_mv(&source));
    TEST_ASSERT_EQUAL_FLOAT(before.step_mv, source.step_mv);
    TEST_ASSERT_TRUE(rounds(1, 9, (true_t){4500, 390}, 110.0f) ||
                     rounds(1, 9, (true_t){4500, 390}, 110.0f));
}
