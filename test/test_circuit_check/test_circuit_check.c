/* What a circuit can show passes, at the corners of every tolerance; what none can show is found
 * within 2 s. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "../run_tests.h"
#include "circuit_check.h"

#define SHUNT_OHM 0.1

typedef struct {
    double supply_v, wiring_ohm, spring_ohm, ohm_per_s;
    double current_gain, current_offset_ma, voltage_offset_mv, noise_ma, noise_mv;
} circuit_t;

static const circuit_t declared = {5.0, 0.08, 0.2, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0};
static current_control_parameters_t parameters;
static circuit_source_t source;
static circuit_check_t check;
static uint32_t random_state;

/* It is what is declared. */
static void is_known(void)
{
    circuit_source_begin(&source, &parameters);
    source.unsure_mv = source.less_mv = source.more_mv = 0.0f;
}

void setUp(void)
{
    current_control_parameters_default(&parameters);
    is_known();
    memset(&check, 0, sizeof check);
    random_state = 1;
}

static bool judges(circuit_window_t *window)
{
    return circuit_check_judge(&check, &source, parameters.supply_mv, window);
}

/* Mean 0, deviation 1, up to 3.4. */
static double noise(void)
{
    double sum = 0.0;
    for (int n = 0; n < 12; n++) {
        random_state = random_state * 1664525u + 1013904223u;
        sum += (double)(random_state >> 8) / 16777216.0 - 0.5;
    }
    return sum;
}

/* A triangle of so many steps in 32 ticks, as the policy sweeps. */
static uint16_t swept(uint16_t duty, uint16_t steps, uint32_t tick)
{
    const uint32_t place = tick & 31u;
    return (uint16_t)(duty + (place < 16u ? place : 31u - place) * steps / 15u);
}

static double current_ma(const circuit_t *c, uint16_t duty, uint32_t tick)
{
    const double ohm = c->spring_ohm + c->ohm_per_s * 0.02 * tick;
    return 1e3 * c->supply_v * duty / 800.0 / (ohm + SHUNT_OHM + c->wiring_ohm);
}

/* Ticks until it is found, or `ticks`. shown: which duty the sensor's reading is of. */
typedef uint16_t shown_t(uint16_t duty, uint16_t steps, uint32_t tick);
static uint16_t same(uint16_t duty, uint16_t steps, uint32_t tick)
{
    return swept(duty, steps, tick);
}
static uint16_t frozen(uint16_t duty, uint16_t steps, uint32_t tick)
{
    (void)steps;
    (void)tick;
    return duty;
}
static uint16_t tick_late(uint16_t duty, uint16_t steps, uint32_t tick)
{
    return swept(duty, steps, tick - 1u);
}
static uint16_t higher(uint16_t duty, uint16_t steps, uint32_t tick)
{
    return (uint16_t)(1.6 * swept(duty, steps, tick));
}

static uint32_t found_after(const circuit_t *c, uint16_t duty, uint16_t steps, shown_t *shown,
                            uint32_t ticks)
{
    for (uint32_t tick = 0; tick < ticks; tick++) {
        const uint16_t of = shown(duty, steps, tick);
        const double ma = current_ma(c, of, tick);
        const double mv = ma * (c->spring_ohm + c->ohm_per_s * 0.02 * tick);
        const int16_t read_ma =
            (int16_t)lround(ma * c->current_gain + c->current_offset_ma + c->noise_ma * noise());
        const int16_t read_mv =
            (int16_t)(4 * lround((mv + c->voltage_offset_mv + c->noise_mv * noise()) / 4.0));
        circuit_check_take(&check, parameters.shunt_mohm + parameters.wiring_mohm, 0,
                           swept(duty, steps, tick), tick % 97u != 13u, read_ma, read_mv);
        if (tick % CIRCUIT_CHECK_TICKS == 17u && judges(NULL)) {
            return tick + 1u;
        }
    }
    return ticks;
}

#define HOUR (50u * 3600u)

TEST(every_corner_of_the_tolerances_is_a_circuit)
{
    for (unsigned corner = 0; corner < 64u; corner++) {
        circuit_t c = declared;
        c.supply_v = (corner & 1u) ? 4.2 : 5.5;
        c.wiring_ohm = (corner & 1u) ? 0.12 : 0.04;
        c.current_gain = (corner & 2u) ? 0.97 : 1.03;
        c.current_offset_ma = (corner & 4u) ? -5.0 : 5.0;
        c.voltage_offset_mv = (corner & 8u) ? -8.0 : 8.0;
        c.noise_ma = (corner & 16u) ? 4.0 : 0.0;
        c.noise_mv = (corner & 16u) ? 5.6 : 0.0;
        const bool heats = (corner & 32u) != 0;
        TEST_ASSERT_EQUAL_UINT32(
            HOUR / 20u, found_after(&c, heats ? 190 : 60, heats ? 3 : 16, same, HOUR / 20u));
    }
}

/* One of its registers still reads, and follows. */
TEST(frozen_register_is_found_within_two_seconds)
{
    for (unsigned n = 0; n < 8; n++) {
        const bool heats = (n & 1u) != 0;
        const bool current_stands = (n & 2u) != 0;
        circuit_t c = declared;
        c.noise_mv = (n & 4u) ? 5.6 : 0.0;
        setUp();
        uint32_t tick = 0;
        for (bool found = false; !found; tick++) {
            TEST_ASSERT_LESS_THAN_UINT32(100, tick);
            const uint16_t duty = swept(heats ? 190 : 60, heats ? 3 : 16, tick);
            const double ma = current_ma(&c, current_stands ? 60 : duty, 0);
            const double mv = current_ma(&c, current_stands ? duty : 60, 0) * c.spring_ohm;
            const double shown_mv = mv + (current_stands ? c.noise_mv * noise() : 0.0);
            circuit_check_take(&check, 180, 0, duty, true, (int16_t)lround(ma),
                               (int16_t)(4 * lround(shown_mv / 4.0)));
            found = tick % CIRCUIT_CHECK_TICKS == 29u && judges(NULL);
        }
    }
}

/* Of thick wire a step of the register hides the sweep; what transforms changes its resistance. */
TEST(another_output_is_found_within_two_seconds_and_a_slow_or_still_reading_is_none)
{
    static const struct {
        double spring_ohm, ohm_per_s;
        uint16_t duty, steps;
        shown_t *shown;
        bool found;
    } table[] = {
        {0.2, 0.0, 60, 16, higher, true},         {0.2, 0.0, 120, 0, higher, true},
        {0.2, 0.0, 60, 16, tick_late, false},     {0.2, 0.0, 190, 3, tick_late, false},
        {0.2, 0.0, 120, 0, frozen, false},        {0.03, 0.0, 128, 3, same, false},
        {0.175, 0.07 / 3.0, 480, 3, same, false}, {0.219, -0.044 / 3.0, 60, 16, same, false}};
    for (size_t n = 0; n < ROWS(table); n++) {
        circuit_t c = declared;
        c.spring_ohm = table[n].spring_ohm;
        c.ohm_per_s = table[n].ohm_per_s;
        setUp();
        row(n);
        const uint32_t ticks = c.ohm_per_s != 0.0 ? 150u : HOUR / 20u;
        const uint32_t after =
            found_after(&c, table[n].duty, table[n].steps, table[n].shown, ticks);
        TEST_ASSERT_EQUAL(table[n].found, after < ticks);
        TEST_ASSERT_TRUE(!table[n].found || after <= 100u);
    }
}

/* Its voltage is read 4 ms after its current. Where a drop may take all that the duty brings, or
 * the duty is not one, a voltage that moves is no supply's. */
TEST(supply_that_swings_is_found_within_two_seconds)
{
    static const struct {
        double hz, share;
        bool found;
        float unsure_mv;
        uint16_t moves_by;
    } swings[] = {{0.2, 0.1, false, 0.0f, 0},     {2.0, 0.15, true, 0.0f, 0},
                  {10.0, 0.06, false, 0.0f, 0},   {10.0, 0.1, true, 0.0f, 0},
                  {24.7, 0.2, true, 0.0f, 0},     {24.7, 0.06, false, 0.0f, 0},
                  {41.3, 0.1, true, 0.0f, 0},     {24.7, 0.2, true, 350.0f, 0},
                  {24.7, 0.2, false, 1300.0f, 0}, {24.7, 0.2, false, 0.0f, 30}};
    for (unsigned n = 0; n < 2u * ROWS(swings); n++) {
        const double turn = 6.283185307179586 * swings[n / 2u].hz;
        const double share = swings[n / 2u].share;
        uint32_t tick = 0;
        bool found = false;
        setUp();
        source.unsure_mv = swings[n / 2u].unsure_mv;
        for (; tick < 3000u && !found; tick++) {
            const uint16_t moves_by = swings[n / 2u].moves_by;
            const uint16_t duty = moves_by != 0
                                      ? swept(30, moves_by, tick)
                                      : swept(n % 2u != 0 ? 190 : 60, n % 2u != 0 ? 3 : 16, tick);
            const double at_s = 0.02 * tick;
            const double ma = current_ma(&declared, duty, 0);
            circuit_check_take(
                &check, 180, 0, duty, true, (int16_t)lround(ma * (1.0 + share * sin(turn * at_s))),
                (int16_t)(4 * lround(ma * (1.0 + share * sin(turn * (at_s + 0.004))) * 0.2 / 4.0)));
            found = tick % CIRCUIT_CHECK_TICKS == 29u && judges(NULL);
        }
        row(n);
        TEST_ASSERT_EQUAL(swings[n / 2u].found, found);
        TEST_ASSERT_TRUE(!found || tick <= 100u);
    }
}

TEST(a_window_says_what_its_readings_were)
{
    for (uint8_t readings = 11; readings <= 29; readings = (uint8_t)(readings + 1u)) {
        circuit_window_t window;
        memset(&window, 7, sizeof window);
        setUp();
        for (unsigned tick = 0; tick < 30; tick++) { /* the first one jumps */
            circuit_check_take(&check, 180, 0, 120, tick <= readings, 1000, 200);
        }
        TEST_ASSERT_FALSE(judges(&window));
        TEST_ASSERT_EQUAL(readings >= 12, window.tells);
        TEST_ASSERT_FLOAT_WITHIN(0.01f, window.tells ? 375.0f : 0.0f, window.found_mv);
        TEST_ASSERT_FLOAT_WITHIN(0.01f, window.tells ? 750.0f : 0.0f, window.expected_mv);
        TEST_ASSERT_FLOAT_WITHIN(0.001f, window.tells ? 0.5f : 0.0f, window.share);
        TEST_ASSERT_FLOAT_WITHIN(0.01f, window.tells ? 1000.0f : 0.0f, window.current_ma);
        TEST_ASSERT_FLOAT_WITHIN(0.01f, window.tells ? 120.0f : 0.0f, window.duty);
    }
}

/* A current that stands where it should be on average, beside a voltage that follows. */
TEST(current_that_stands_at_its_mean_is_found)
{
    uint32_t tick = 0;
    for (bool found = false; !found; tick++) {
        TEST_ASSERT_LESS_THAN_UINT32(100, tick);
        const uint16_t duty = swept(190, 16, tick);
        circuit_check_take(&check, 180, 0, duty, true,
                           (int16_t)lround(current_ma(&declared, 198, 0)),
                           (int16_t)(4 * lround(current_ma(&declared, duty, 0) * 0.2 / 4.0)));
        found = tick % CIRCUIT_CHECK_TICKS == 29u && judges(NULL);
    }
}

/* Eleven readings are too few: of a window with a late tick nothing is judged then, and what is
 * read next is another window's; of one without, it is judged as it is. */
TEST(window_of_late_ticks_is_dropped)
{
    for (unsigned n = 0; n < 8; n++) {
        const bool late = (n & 1u) != 0;
        const uint8_t dead_steps = (n & 2u) != 0 ? 20 : 0;
        const uint8_t readings = (n & 4u) != 0 ? 12 : 11;
        setUp();
        if (late) {
            circuit_check_hurry(&check);
        }
        for (unsigned tick = 0; tick < 30; tick++) { /* the first one jumps, or is late */
            circuit_check_take(&check, 180, dead_steps, 120, tick <= readings, 1000, 200);
        }
        const bool drops = late && readings < 12;
        row(n);
        TEST_ASSERT_EQUAL(drops, circuit_check_drop(&check));
        if (drops) {
            circuit_window_t window;
            TEST_ASSERT_FALSE(circuit_check_drop(&check));
            for (unsigned tick = 0; tick < 11; tick++) {
                circuit_check_take(&check, 180, dead_steps, 120, true, 1000, 200);
            }
            TEST_ASSERT_FALSE(judges(&window));
            TEST_ASSERT_FALSE(window.tells);
        }
    }
}

/* A window's readings: `share` of the sweep of so many steps shows, and the mean of all is as it
 * should be but for beyond_mv. From tick to tick it swings by swing_mv either way. What is read is
 * exact. */
static bool judged(uint16_t duty, uint16_t steps, double share, double beyond_mv, double swing_mv,
                   uint8_t readings)
{
    for (uint32_t tick = 0; tick < 30u; tick++) {
        const uint16_t given = tick < readings ? swept(duty, steps, tick) : duty;
        const double middle = duty + 0.47 * steps;
        const double behind_mv = 5000.0 / 800.0 * (middle + share * (given - middle)) + beyond_mv +
                                 ((tick & 1u) != 0 ? swing_mv : -swing_mv);
        /* the spring's half, and what 180 mohm drop of the current, rounded as the check does */
        const double ma = behind_mv / (0.2 + 180.0 / 1024.0);
        circuit_check_take(&check, 180, 0, given, tick < readings, (int16_t)lround(ma),
                           (int16_t)lround(ma * 0.2));
    }
    return judges(NULL);
}

/* Windows on end until it is found; 9: it is not. */
static int windows(uint16_t duty, uint16_t steps, double share, double beyond_mv, double swing_mv)
{
    memset(&check, 0, sizeof check);
    for (int n = 1; n < 9; n++) {
        if (judged(duty, steps, share, beyond_mv, swing_mv, 30)) {
            return n;
        }
    }
    return 9;
}

/* Each share and balance at both sides of its limit, and after how many windows on end. */
TEST(what_follows_too_little_or_too_much_is_found_after_its_windows)
{
    static const struct {
        uint16_t duty, steps;
        double share, beyond_mv, swing_mv;
        int windows;
    } cases[] = {
        {120, 30, 1.0, 0.0, 0.0, 9},
        {120, 30, 0.75, 0.0, 0.0, 9},
        {120, 30, 0.65, 0.0, 0.0, 2},
        {120, 30, 2.3, 0.0, 0.0, 9},
        {120, 30, 2.7, 0.0, 0.0, 2},
        {120, 30, -1.0, 0.0, 0.0, 2},
        {120, 30, 1.0, 220.0, 0.0, 9},
        {120, 30, 1.0, 300.0, 0.0, 3},
        {120, 30, 1.0, -220.0, 0.0, 9},
        {120, 30, 1.0, -300.0, 0.0, 3},
        {190, 3, 0.0, 0.0, 0.0, 3},
        {120, 0, 0.0, 0.0, 0.0, 9},
        {120, 0, 0.0, 300.0, 0.0, 3},
        {3, 0, 0.0, 10.0, 0.0, 9},
        {3, 0, 0.0, 30.0, 0.0, 3},
        {400, 3, 3.2, 0.0, 0.0, 9}, /* too little of it moves to tell by how much */
        {120, 0, 0.0, 0.0, 38.0, 9},
        {120, 0, 0.0, 0.0, 41.0, 3},
        {120, 30, 1.0, 0.0, 40.0, 9},
        {120, 30, 1.0, 0.0, 46.0, 3},
        {200, 0, 0.0, 0.0, 61.0, 9},
        {200, 0, 0.0, 0.0, 66.0, 3},
        {3, 0, 0.0, 0.0, 11.0, 9},
        {3, 0, 0.0, 0.0, 13.5, 3},
    };
    for (size_t n = 0; n < ROWS(cases); n++) {
        const int found = windows(cases[n].duty, cases[n].steps, cases[n].share, cases[n].beyond_mv,
                                  cases[n].swing_mv);
        row(n);
        TEST_ASSERT_EQUAL_INT(cases[n].windows, found);
    }
}

/* Of 838 mV behind a switch a drop takes its part, and all of them go with the duty: 0.7 of that
 * must be seen, less what is not known of the drop. */
TEST(what_follows_is_held_against_all_that_goes_with_the_duty)
{
    static const struct {
        float drop_mv, less_mv;
        double share;
        int windows;
    } table[] = {{0, 0, 0.71, 9},   {0, 0, 0.69, 2},    {350, 0, 0.71, 9},   {350, 0, 0.69, 2},
                 {0, 200, 0.54, 9}, {0, 200, 0.52, 2},  {350, 200, 0.54, 9}, {350, 200, 0.52, 2},
                 {0, 0, 2.49, 9},   {350, 200, 2.51, 2}};
    for (size_t n = 0; n < ROWS(table); n++) {
        source.drop_mv = table[n].drop_mv;
        source.less_mv = table[n].less_mv;
        row(n);
        TEST_ASSERT_EQUAL_INT(table[n].windows,
                              windows(120, 30, table[n].share, -table[n].drop_mv, 0.0));
    }
}

/* Behind a diode of 0.39 V: half of each window without a duty, before or after the pulse, or at a
 * duty that only overcomes the drop. */
TEST(where_nothing_flows_a_drop_takes_nothing)
{
    static const uint16_t rests[] = {0, 57};
    parameters.freewheel_mv = 390;
    is_known();
    for (unsigned n = 0; n < 4; n++) {
        memset(&check, 0, sizeof check);
        for (int round = 0; round < 5; round++) {
            for (uint16_t tick = 0; tick < 30; tick++) {
                const bool pulse = (tick < 15) == (n < 2);
                const uint16_t duty = pulse ? 200 : rests[n % 2u];
                const double ma = pulse ? (5390.0 * 0.25 - 390.0) / 0.3758 : 0.0;
                circuit_check_take(&check, 180, 57, duty, true, (int16_t)lround(ma),
                                   (int16_t)lround(0.2 * ma));
            }
            circuit_window_t window;
            TEST_ASSERT_FALSE(judges(&window));
            TEST_ASSERT_TRUE(window.tells);
            TEST_ASSERT_FLOAT_WITHIN(0.01f, 200.0f, window.duty);
        }
    }
    for (int round = 1; round <= 3; round++) { /* a voltage without a duty is found as ever */
        for (uint16_t tick = 0; tick < 30; tick++) {
            circuit_check_take(&check, 180, 57, tick < 20 ? 0 : 57, true, 0, 40);
        }
        TEST_ASSERT_EQUAL(round == 3, judges(NULL));
    }
}

/* And without one, duties and none are of one kind. */
TEST(without_a_drop_all_of_a_window_counts)
{
    circuit_window_t window;
    for (uint16_t tick = 0; tick < 30; tick++) {
        const uint16_t duty = tick < 15 ? 0 : 200;
        circuit_check_take(&check, 180, 0, duty, true, 0, 0);
    }
    (void)judges(&window);
    TEST_ASSERT_FLOAT_WITHIN(5.0f, 100.0f, window.duty); /* but for the step itself */
    for (uint16_t tick = 0; tick < 30; tick++) {
        circuit_check_take(&check, 180, 0, 0, true, 0, 0);
    }
    (void)judges(&window);
    TEST_ASSERT_TRUE(window.tells);
    TEST_ASSERT_FALSE(window.steady); /* at no duty there is nothing to learn */
}

/* The diode's drop takes its part of the voltage, and it stays found however long it lasts. */
TEST(the_drop_counts_and_what_is_found_stays_found)
{
    parameters.freewheel_mv = 1000;
    is_known();
    for (int off_mv = 0; off_mv <= 800; off_mv += 800) {
        memset(&check, 0, sizeof check);
        for (int window = 0; window < 300; window++) {
            for (uint32_t tick = 0; tick < 30u; tick++) {
                const double behind_mv = 400.0 * 6000.0 / 800.0 - 1000.0 + off_mv;
                const double ma = behind_mv / (0.2 + 180.0 / 1024.0);
                circuit_check_take(&check, 180, 0, 400, true, (int16_t)fmin(ma, 4095.0),
                                   (int16_t)lround(behind_mv - fmin(ma, 4095.0) * 180.0 / 1024.0));
            }
            TEST_ASSERT_EQUAL(off_mv != 0 && window >= 2, judges(NULL));
        }
    }
}

/* A voltage that stands though the sweep moves it by 3.2 mV, above half a step of its register. */
TEST(voltage_that_should_move_by_more_than_half_a_step_is_frozen)
{
    int window = 0;
    for (bool found = false; !found; window++) {
        TEST_ASSERT_LESS_THAN_INT(4, window);
        for (uint32_t tick = 0; tick < 30u; tick++) {
            const uint16_t given = swept(120, 3, tick);
            const double ma = 5000.0 / 800.0 * given / (0.2 + 180.0 / 1024.0);
            circuit_check_take(&check, 180, 0, given, true, (int16_t)lround(ma), 404);
        }
        found = judges(NULL);
    }
}

/* After a jump a reading may be of the duty before: it is none. */
TEST(a_reading_after_a_jump_is_left_out)
{
    static const uint16_t duty[] = {2, 4, 2, 5, 5, 2, 1, 3};
    static const uint8_t readings[] = {1, 2, 3, 3, 4, 4, 5, 6};
    for (unsigned n = 0; n < 8; n++) {
        circuit_check_take(&check, 180, 0, duty[n], true, 100, 20);
        TEST_ASSERT_EQUAL_UINT8(readings[n], check.readings);
    }
    circuit_check_take(&check, 180, 0, 3, false, 100, 20);
    TEST_ASSERT_EQUAL_UINT8(6, check.readings);
    TEST_ASSERT_EQUAL_UINT16(2 + 4 + 2 + 5 + 1 + 3, check.duty);
    TEST_ASSERT_EQUAL_UINT32(4 + 16 + 4 + 25 + 1 + 9, check.duty_square);
    TEST_ASSERT_EQUAL_UINT32(6u * (20u + (100u * 180u >> 10)), check.voltage_mv);
    TEST_ASSERT_EQUAL_UINT32(17u * (20u + (100u * 180u >> 10)), check.duty_voltage);
}

TEST(readings_beyond_the_sensor_count_as_its_ends)
{
    circuit_check_take(&check, 1024, 0, 0, true, -1, -1);
    TEST_ASSERT_EQUAL_UINT32(0, check.voltage_mv);
    circuit_check_take(&check, 1024, 0, 0, true, 0, 1);
    TEST_ASSERT_EQUAL_UINT32(1, check.voltage_mv);
    circuit_check_take(&check, 1024, 0, 0, true, 1, 0);
    TEST_ASSERT_EQUAL_UINT32(2, check.voltage_mv);
    circuit_check_take(&check, 1024, 0, 0, true, 0, 4095);
    TEST_ASSERT_EQUAL_UINT32(2 + 4095, check.voltage_mv);
    circuit_check_take(&check, 1024, 0, 0, true, 4096, 5000);
    TEST_ASSERT_EQUAL_UINT32(2 + 3 * 4095, check.voltage_mv);
    check.voltage_square = 0;
    for (unsigned n = 0; n < CIRCUIT_CHECK_TICKS; n++) { /* as many as fit */
        circuit_check_take(&check, 2000, 0, 0, true, 4095, 4095);
    }
    TEST_ASSERT_EQUAL_UINT32(30u * 11965u * 11965u, check.voltage_square);
}
