/* What a spring, its contacts, its wiring and the supply can do within two windows passes; a sensor
 * that begins to show another current or voltage is found. */
#include <math.h>
#include <string.h>

#include "../circuit_window.h"
#include "../run_tests.h"
#include "circuit_step.h"

static circuit_step_t step;
static current_control_parameters_t circuit;
static circuit_source_t source;

void setUp(void)
{
    memset(&step, 0, sizeof step);
    current_control_parameters_default(&circuit);
    source = (circuit_source_t){0};
}

/* A circuit whose current is kept at what its sensor shows. */
typedef struct {
    float shown_a, spring_ohm, wiring_ohm; /* shunt included */
    float supply, current_gain, voltage_gain;
    float offset_a, offset_mv;
} shown_t;

static const shown_t honest = {0.9f, 0.219f, 0.18f, 1.0f, 1.0f, 1.0f, 0.0f, 0.0f};

static circuit_window_t window_of_shown(shown_t s)
{
    const float a = (s.shown_a - s.offset_a) / s.current_gain;
    const float behind_mv = 1e3f * a * (s.spring_ohm + s.wiring_ohm);
    const float read_mv = 1e3f * a * s.spring_ohm * s.voltage_gain + s.offset_mv;
    return window_of(read_mv + 1e3f * s.shown_a * 0.18f, behind_mv / s.supply, 1e3f * s.shown_a);
}

static bool takes(shown_t s)
{
    const circuit_window_t window = window_of_shown(s);
    return circuit_step_judge(&step, &window, &source, &circuit);
}

static void is_silent(void)
{
    const circuit_window_t window = {.tells = false};
    TEST_ASSERT_FALSE(circuit_step_judge(&step, &window, &source, &circuit));
}

/* Windows until it is found, the one in which it began the first; 0: never. part: how much of the
 * change that one shows. */
static unsigned found_after(shown_t before, shown_t after, float part)
{
    setUp();
    for (unsigned n = 0; n < 5; n++) {
        TEST_ASSERT_FALSE(takes(before));
    }
    const float *const from = (const float *)&before, *const to = (const float *)&after;
    shown_t between;
    for (unsigned k = 0; k < sizeof between / sizeof(float); k++) {
        ((float *)&between)[k] = from[k] + part * (to[k] - from[k]);
    }
    if (takes(between)) {
        return 1;
    }
    for (unsigned n = 2; n < 10; n++) {
        if (takes(after)) {
            return n;
        }
    }
    return 0;
}

static shown_t with(float shown_a, unsigned field, float value)
{
    shown_t s = honest;
    s.shown_a = shown_a;
    ((float *)&s)[field] = value;
    return s;
}
enum { SHOWN, SPRING, WIRING, SUPPLY, CURRENT_GAIN, VOLTAGE_GAIN, OFFSET_A, OFFSET_MV };

/* As it holds and as it heats; by the third window, of whatever part the first was. */
TEST(a_sensor_that_begins_to_lie_is_found)
{
    static const struct {
        unsigned field;
        float honest, lies, passes, shown_a;
    } lies[] = {
        {CURRENT_GAIN, 1.0f, 0.85f, 0.92f, 0.9f}, {CURRENT_GAIN, 1.0f, 1.17f, 1.08f, 0.9f},
        {VOLTAGE_GAIN, 1.0f, 0.85f, 0.92f, 0.9f}, {VOLTAGE_GAIN, 1.0f, 1.16f, 1.08f, 0.9f},
        {CURRENT_GAIN, 1.0f, 0.87f, 0.92f, 2.5f}, {CURRENT_GAIN, 1.0f, 1.14f, 1.08f, 2.5f},
        {VOLTAGE_GAIN, 1.0f, 0.87f, 0.92f, 2.5f}, {VOLTAGE_GAIN, 1.0f, 1.13f, 1.08f, 2.5f},
        {OFFSET_A, 0.0f, -0.17f, -0.06f, 0.9f},   {OFFSET_A, 0.0f, 0.14f, 0.06f, 0.9f},
        {OFFSET_MV, 0.0f, -30.0f, -12.0f, 0.9f},  {OFFSET_MV, 0.0f, 30.0f, 12.0f, 0.9f},
    };
    for (unsigned n = 0; n < ROWS(lies); n++) {
        const shown_t before = with(lies[n].shown_a, lies[n].field, lies[n].honest);
        for (unsigned tenths = 0; tenths <= 10; tenths++) {
            const float part = 0.1f * (float)tenths;
            const unsigned found =
                found_after(before, with(lies[n].shown_a, lies[n].field, lies[n].lies), part);
            TEST_ASSERT_TRUE(found == 2 || found == 3);
            TEST_ASSERT_EQUAL(
                0, found_after(before, with(lies[n].shown_a, lies[n].field, lies[n].passes), part));
        }
    }
}

/* One thing at a time, however much: with wiring that is not as declared, too. */
TEST(what_is_no_lie_passes)
{
    for (unsigned wired = 0; wired < 3; wired++) {
        shown_t before = honest;
        before.wiring_ohm = 0.14f + 0.04f * (float)wired;
        for (unsigned n = 0; n < 8; n++) {
            shown_t after = before;
            const float more = 0.6f + 0.1f * (float)n;
            after.supply *= more;
            TEST_ASSERT_EQUAL(0, found_after(before, after, 0.5f));
            after = before;
            after.wiring_ohm *= more;
            TEST_ASSERT_EQUAL(0, found_after(before, after, 0.5f));
            after = before; /* a contact */
            after.spring_ohm += 0.01f * (float)n;
            TEST_ASSERT_EQUAL(0, found_after(before, after, 0.5f));
        }
        shown_t after = before; /* it transforms as others switch */
        after.spring_ohm *= 1.09f;
        after.supply *= 0.95f;
        TEST_ASSERT_EQUAL(0, found_after(before, after, 0.5f));
    }
}

/* A window beside others that show so much of the supply, and outvote it or tell the same. */
static bool takes_beside(shown_t s, float others, bool outvoted, bool acquitted)
{
    circuit_window_t window = window_of_shown(s);
    window.beside = window.share / others;
    window.outvoted = outvoted;
    window.acquitted = acquitted;
    return circuit_step_judge(&step, &window, &source, &circuit);
}

/* A supply that sags as many transform is what all show; a lie is not. */
TEST(a_supply_that_moves_for_all_is_no_lie_of_one)
{
    for (unsigned how = 0; how < 4; how++) {
        const bool outvoted = how == 0 || how == 3, acquitted = how == 1;
        setUp();
        for (unsigned n = 0; n < 5; n++) {
            TEST_ASSERT_FALSE(takes_beside(honest, 1.0f, outvoted, acquitted));
        }
        shown_t after = honest;
        after.spring_ohm *= how == 3 ? 1.0f : 0.8f;
        after.supply = how == 3 ? 1.0f : 0.88f;
        after.current_gain = how == 3 ? 0.8f : 1.0f;
        bool found = false;
        for (unsigned n = 0; n < CIRCUIT_STEP_WINDOWS; n++) {
            found = takes_beside(after, after.supply, outvoted, acquitted);
        }
        TEST_ASSERT_EQUAL(how >= 2, found);
    }
}

/* One is as much of the others by whatever supply is believed. */
TEST(another_supply_moves_nothing_beside_others)
{
    for (unsigned outvoted = 0; outvoted < 2; outvoted++) {
        setUp();
        (void)takes_beside(honest, 1.0f, outvoted != 0, false);
        const uint16_t share_q12 = step.was[0].share_q12;
        const circuit_source_t before = {.step_mv = 6.0f}, now = {.step_mv = 5.0f};
        circuit_step_renew(&step, 1, &before, &now);
        TEST_ASSERT_UINT_WITHIN(1, outvoted != 0 ? share_q12 : 1.2f * share_q12,
                                step.was[0].share_q12);
    }
}

/* A row ends what is compared; another current begins it anew. */
TEST(windows_must_follow_on_each_other)
{
    const shown_t lies = with(0.9f, CURRENT_GAIN, 0.8f);
    TEST_ASSERT_FALSE(takes(honest));
    TEST_ASSERT_FALSE(takes(lies));
    TEST_ASSERT_FALSE(takes(honest)); /* it was noise */
    TEST_ASSERT_FALSE(takes(lies));
    is_silent();
    for (unsigned n = 0; n < 5; n++) {
        TEST_ASSERT_FALSE(takes(lies));
    }
    for (unsigned less = 0; less < 2; less++) {
        for (unsigned other = 0; other < 2; other++) {
            setUp();
            TEST_ASSERT_FALSE(takes(honest));
            TEST_ASSERT_FALSE(takes(honest));
            const float like[2][2] = {{0.9f * 1.48f, 0.9f * 0.68f}, {0.9f * 1.52f, 0.9f * 0.65f}};
            const shown_t now = with(like[other][less], CURRENT_GAIN, 0.75f);
            TEST_ASSERT_FALSE(takes(now));
            TEST_ASSERT_EQUAL(other == 0, takes(now));
        }
    }
}

/* A share of what it is to come to, in so many windows; the gain or offset at which it is found, or
 * as it was at the end. */
static float found_on_its_way(shown_t from, unsigned field, float to, unsigned windows)
{
    setUp();
    float *const value = (float *)&from + field;
    const float begun = *value;
    for (unsigned n = 0; n < windows; n++) {
        *value = begun + (to - begun) * (float)n / (float)windows;
        if (takes(from)) {
            return *value;
        }
    }
    return to;
}

/* In one minute, or in fifty; one that lets its spring get colder is no harm, and may be a supply
 * that steps as it transforms. */
TEST(a_lie_that_grows_is_found_however_slowly)
{
    static const struct {
        unsigned field;
        float to, least, most;
    } lies[] = {
        {CURRENT_GAIN, 0.4f, 0.85f, 0.92f},
        {VOLTAGE_GAIN, 0.4f, 0.85f, 0.92f},
        {OFFSET_A, -0.5f, -0.17f, -0.06f},
        {OFFSET_MV, -90.0f, -30.0f, -12.0f},
    };
    static const unsigned lasts[] = {100, 500, 1500, 5000};
    for (unsigned n = 0; n < ROWS(lies); n++) {
        for (unsigned k = 0; k < ROWS(lasts); k++) {
            const float found =
                found_on_its_way(with(0.9f, SHOWN, 0.9f), lies[n].field, lies[n].to, lasts[k]);
            TEST_ASSERT_TRUE(found > lies[n].least);
            TEST_ASSERT_TRUE(found < lies[n].most);
        }
    }
}

/* Heated between two holds, or off: what it showed at a hold's current is kept, if it did for some
 * windows. Others that switched meanwhile, or phase that was lost, make no lie of it. */
TEST(what_it_showed_at_this_current_before_another_is_known)
{
    static const struct {
        unsigned windows, field;
        float to;
        bool found;
    } table[] = {{5, CURRENT_GAIN, 0.8f, true},  {5, CURRENT_GAIN, 0.86f, false},
                 {5, VOLTAGE_GAIN, 0.85f, true}, {5, VOLTAGE_GAIN, 0.92f, false},
                 {3, CURRENT_GAIN, 0.8f, true},  {2, CURRENT_GAIN, 0.8f, false},
                 {5, SPRING, 0.175f, false},     {5, SPRING, 0.3f, false},
                 {5, SUPPLY, 0.9f, false}};
    for (unsigned off = 0; off < 2; off++) {
        for (unsigned n = 0; n < ROWS(table); n++) {
            setUp();
            for (unsigned k = 0; k < table[n].windows; k++) {
                TEST_ASSERT_FALSE(takes(honest));
            }
            for (unsigned k = 0; k < 4; k++) {
                if (off) {
                    is_silent();
                } else {
                    TEST_ASSERT_FALSE(takes(with(2.5f, table[n].field, table[n].to)));
                }
            }
            bool found = false;
            for (unsigned k = 0; k < 5; k++) {
                found = takes(with(0.9f, table[n].field, table[n].to)) || found;
            }
            TEST_ASSERT_EQUAL(table[n].found, found);
        }
    }
}

/* It is kept, too, where it comes back to it for one window only. */
TEST(what_it_showed_before_outlasts_a_short_return)
{
    for (unsigned k = 0; k < 5; k++) {
        TEST_ASSERT_FALSE(takes(honest));
    }
    for (unsigned turn = 0; turn < 3; turn++) {
        for (unsigned k = 0; k < 4; k++) {
            TEST_ASSERT_FALSE(takes(with(2.5f, CURRENT_GAIN, 0.95f)));
        }
        TEST_ASSERT_FALSE(takes(with(0.9f, CURRENT_GAIN, turn < 2 ? 0.95f : 0.8f)));
    }
    TEST_ASSERT_TRUE(takes(with(0.9f, CURRENT_GAIN, 0.8f)));
}

/* A window in which the current falls from one to the other is of neither. */
TEST(a_window_of_two_currents_is_left_out)
{
    circuit_window_t between = window_of(680.0f, 680.0f, 1700.0f);
    between.steady = false;
    for (unsigned k = 0; k < 5; k++) {
        TEST_ASSERT_FALSE(takes(honest));
    }
    for (unsigned k = 0; k < 5; k++) {
        TEST_ASSERT_FALSE(takes(with(2.5f, CURRENT_GAIN, 0.8f)));
    }
    TEST_ASSERT_FALSE(circuit_step_judge(&step, &between, &source, &circuit));
    const shown_t lies = with(0.9f, CURRENT_GAIN, 0.8f);
    TEST_ASSERT_FALSE(takes(lies));
    TEST_ASSERT_FALSE(circuit_step_judge(&step, &between, &source, &circuit));
    TEST_ASSERT_TRUE(takes(lies));
    TEST_ASSERT_TRUE(circuit_step_judge(&step, &between, &source, &circuit));
    for (unsigned left_out = 0; left_out < 2; left_out++) { /* behind it less is told */
        setUp();
        for (unsigned k = 0; k < 5; k++) {
            TEST_ASSERT_FALSE(takes(honest));
        }
        if (left_out) {
            TEST_ASSERT_FALSE(circuit_step_judge(&step, &between, &source, &circuit));
        }
        TEST_ASSERT_FALSE(takes(with(0.9f, CURRENT_GAIN, 0.87f)));
        TEST_ASSERT_EQUAL(!left_out, takes(with(0.9f, CURRENT_GAIN, 0.87f)));
    }
}

/* A user who pulses a spring makes each window one of two currents: none of them was judged, and a
 * sensor that showed 0.6 of its current had its spring, alone, at 135 degC. */
TEST(a_lie_is_found_though_no_window_is_of_one_current)
{
    for (unsigned k = 0; k < 5; k++) {
        TEST_ASSERT_FALSE(takes(honest));
    }
    for (unsigned n = 0; n < 2; n++) {
        circuit_window_t pulsed = window_of(498.0f, 600.0f, 900.0f); /* shows 0.6 of 1.5 A */
        pulsed.steady = false;
        TEST_ASSERT_EQUAL(n == 1, circuit_step_judge(&step, &pulsed, &source, &circuit));
    }
}

/* Both at once, as by chance: phase that is lost where others have begun at one end of a cable. */
TEST(a_twentieth_of_the_supply_makes_no_lie_of_what_changed_meanwhile)
{
    for (int by = -5; by <= 5; by++) {
        for (int ohm = -20; ohm <= 30; ohm++) {
            setUp();
            for (unsigned k = 0; k < 5; k++) {
                TEST_ASSERT_FALSE(takes(honest));
            }
            is_silent();
            shown_t s = honest;
            s.supply += 0.01f * (float)by;
            s.spring_ohm *= 1.0f + 0.01f * (float)ohm;
            for (unsigned k = 0; k < 5; k++) {
                TEST_ASSERT_FALSE(takes(s));
            }
        }
    }
    is_silent(); /* a share that moves by more than the resistance is the supply's */
    shown_t s = honest;
    s.supply = 0.8f;
    s.spring_ohm *= 1.12f;
    for (unsigned k = 0; k < 5; k++) {
        TEST_ASSERT_FALSE(takes(s));
    }
}

/* One end of a cable moves by a twentieth, and back. */
TEST(a_spring_that_transforms_as_others_switch_passes)
{
    for (unsigned lasts = 10; lasts < 200; lasts += 7) {
        for (unsigned at = 0; at < lasts; at++) {
            for (int by = -5; by <= 5; by++) {
                setUp();
                shown_t s = honest;
                for (unsigned n = 0; n < lasts; n++) {
                    s.spring_ohm = 0.175f + 0.044f * (float)n / (float)lasts;
                    s.supply = n < at ? 1.0f : 1.0f + 0.01f * (float)by;
                    TEST_ASSERT_FALSE(takes(s));
                }
            }
        }
    }
}

/* What is compared with stays while resistance and share keep within a sixteenth and a
 * thirty-second of it, or move as a lie that makes its spring hotter moves both: the share falls;
 * of a current the resistance rises, of a voltage it falls, too. Else it is the second window on
 * end in which something has moved. */
TEST(what_moves_otherwise_than_a_lie_is_compared_with_anew)
{
    static const struct {
        uint16_t share_q12, ohm_q12; /* 4096 and 1600 before */
        bool stays;
    } table[] = {
        {4096, 1700, true},  {4096, 1701, false}, {4096, 1500, true},  {4096, 1499, false},
        {4224, 1600, true},  {4225, 1600, false}, {3968, 1600, true},  {3967, 1600, false},
        {4480, 1750, false}, {4192, 1750, false}, {4519, 1450, false}, {3745, 1750, true},
        {3744, 1750, false}, {4008, 1750, true},  {4009, 1750, false}, {3712, 1450, true},
        {3711, 1450, false}, {4000, 1450, true},  {4001, 1450, false},
    };
    const circuit_shown_t before = {4096, 1600, 62};
    for (unsigned n = 0; n < ROWS(table); n++) {
        step = (circuit_step_t){.was = {before}, .odd = 1, .again = 1};
        const float found_mv = 1e3f * (((float)table[n].ohm_q12 + 0.25f) / 4096.0f + 0.18f);
        const circuit_window_t window =
            window_of(found_mv, found_mv * 4096.0f / ((float)table[n].share_q12 + 0.25f), 1e3f);
        for (unsigned times = 1; times <= 4; times++) {
            TEST_ASSERT_FALSE(circuit_step_judge(&step, &window, &source, &circuit));
            const bool stays = table[n].stays || times < 2;
            TEST_ASSERT_EQUAL_UINT(stays ? 4096 : table[n].share_q12, step.was[0].share_q12);
            TEST_ASSERT_EQUAL_UINT(stays ? 1600 : table[n].ohm_q12, step.was[0].ohm_q12);
            TEST_ASSERT_EQUAL_UINT(stays, step.again);
            TEST_ASSERT_EQUAL_UINT(0, step.odd);
        }
    }
}

/* Of a supply that is believed a quarter higher it showed 0.8; of another drop nothing is known. */
TEST(another_belief_of_the_supply_makes_another_share)
{
    static const struct {
        float drop_mv;
        bool known;
    } table[] = {{350.0f, true}, {353.9f, true},  {354.0f, false}, {354.1f, false},
                 {346.1f, true}, {345.9f, false}, {0.0f, false}};
    const circuit_source_t before = {.step_mv = 10.0f, .drop_mv = 350.0f};
    for (unsigned n = 0; n < ROWS(table); n++) {
        const circuit_step_t was = {.was = {{4096, 900, 62}, {2000, 901, 61}}, .odd = 1};
        circuit_step_t steps[3] = {was, was, was};
        const circuit_source_t now = {.step_mv = 12.5f, .drop_mv = table[n].drop_mv};
        circuit_step_renew(steps, 2, &before, &now);
        for (unsigned k = 0; k < 2; k++) {
            TEST_ASSERT_UINT_WITHIN(1, table[n].known ? 3277 : 0, steps[k].was[0].share_q12);
            TEST_ASSERT_UINT_WITHIN(1, table[n].known ? 1600 : 0, steps[k].was[1].share_q12);
            TEST_ASSERT_EQUAL_UINT(900, steps[k].was[0].ohm_q12);
            TEST_ASSERT_EQUAL_UINT(901, steps[k].was[1].ohm_q12);
            TEST_ASSERT_EQUAL_UINT(1, steps[k].odd);
        }
        TEST_ASSERT_EQUAL_MEMORY(&was, &steps[2], sizeof was); /* no spring of this array */
    }
}

TEST(found_stays_found_until_it_begins_anew)
{
    TEST_ASSERT_FALSE(takes(honest));
    for (unsigned n = 0; n < 300; n++) {
        TEST_ASSERT_EQUAL(n != 0, takes(with(0.9f, CURRENT_GAIN, 0.8f)));
        TEST_ASSERT_TRUE(step.odd <= CIRCUIT_STEP_WINDOWS);
    }
}

TEST(windows_that_tell_are_kept_within_16_bits)
{
    static const struct {
        float found_mv, expected_mv, current_ma;
        bool tells;
        uint16_t share_q12, ohm_q12;
    } kept[] = {
        {400.0f, 400.0f, 1000.0f, true, 4096, 901},
        {400.0f, 100.0f, 1000.0f, true, 16384, 901},
        {400.0f, 99.9f, 1000.0f, true, 0, 0},
        {184.0f, 200.0f, 1000.0f, true, 3768, 16}, /* a step of the register */
        {183.9f, 200.0f, 1000.0f, true, 0, 0},
        {300.0f, 300.0f, 16.0f, true, 4096, UINT16_MAX},
        {300.0f, 300.0f, 15.9f, true, 0, 0},
        {60000.0f, 200.0f, 4095.0f, true, UINT16_MAX, 59277},
        {60000.0f, 200.0f, 4500.0f, true, UINT16_MAX, 53876},
        {400.0f, 400.0f, 1000.0f, false, 0, 0},
    };
    for (unsigned n = 0; n < ROWS(kept); n++) {
        setUp();
        circuit_window_t window =
            window_of(kept[n].found_mv, kept[n].expected_mv, kept[n].current_ma);
        window.tells = kept[n].tells;
        TEST_ASSERT_FALSE(circuit_step_judge(&step, &window, &source, &circuit));
        TEST_ASSERT_EQUAL_UINT(kept[n].share_q12, step.was[0].share_q12);
        TEST_ASSERT_UINT_WITHIN(1, kept[n].ohm_q12, step.was[0].ohm_q12);
        const float shown = kept[n].share_q12 != 0 ? kept[n].current_ma / 16.0f : 0.0f;
        TEST_ASSERT_EQUAL_UINT(fminf(shown, 255.0f), step.was[0].current_16ma);
    }
}

/* Behind a diode that nobody has declared, 350 mV of which all is believed to be the spring's. */
static bool takes_behind_a_diode(float current_ma, float spring_ohm)
{
    const float found_mv = current_ma * (spring_ohm + 0.18f);
    const circuit_window_t window = window_of(found_mv, found_mv + 350.0f, current_ma);
    return circuit_step_judge(&step, &window, &source, &circuit);
}

/* A share that moves with its volts as a drop makes it may be one, as long as that is not known:
 * not against them, nor where they stay, as those of a sensor that begins to lie. */
TEST(what_is_not_known_of_a_drop_is_let_pass_as_far_as_volts_move)
{
    static const struct {
        float more_mv, less_mv;
        bool diode, found;
    } table[] = {{275.0f, 0.0f, true, true}, /* 284 are enough */
                 {292.0f, 0.0f, true, false}, {0.0f, 0.0f, true, true},
                 {350.0f, 0.0f, true, false}, {0.0f, 350.0f, true, true},
                 {350.0f, 0.0f, false, true}, {250.0f, 0.0f, false, true},
                 {0.0f, 0.0f, false, true}};
    for (unsigned n = 0; n < ROWS(table); n++) {
        setUp();
        source.more_mv = table[n].more_mv;
        source.less_mv = table[n].less_mv;
        bool found = false;
        for (unsigned window = 0; window < 5; window++) {
            const bool after = window >= 2;
            if (table[n].diode) {
                found = takes_behind_a_diode(after ? 1100.0f : 800.0f, after ? 0.25f : 0.2f);
            } else {
                shown_t lies = honest;
                lies.current_gain = after ? 0.8f : 1.0f;
                found = takes(lies);
            }
        }
        TEST_ASSERT_EQUAL(table[n].found, found);
    }
}
