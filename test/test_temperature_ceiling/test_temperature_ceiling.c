/* The ceiling follows the declared network by power alone, and nothing that is done to the model
 * lowers it. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "../run_tests.h"
#include "temperature_ceiling.h"

#define WHOLE TEMPERATURE_CEILING_WHOLE_SHARE

static thermal_model_parameters_t parameters;
static thermal_model_t model;
static temperature_ceiling_t ceiling;
static temperature_ceiling_drive_t drive;

void setUp(void)
{
    thermal_model_parameters_default(&parameters);
    TEST_ASSERT_EQUAL(THERMAL_MODEL_OK, thermal_model_init(&model, &parameters, NULL));
    memset(&ceiling, 0xA5, sizeof ceiling); /* what was in memory must not matter */
    temperature_ceiling_begin(&ceiling, 20 * 128);
}

void tearDown(void)
{
    TEST_ASSERT_EQUAL_UINT8(0, temperature_ceiling_broken_seals(&ceiling));
}

/* What a test has written is as if it had been kept. */
static void seal_all(void)
{
    for (unsigned k = 0; k < THERMAL_MODEL_MAX_SPRINGS; k++) {
        uint16_t halves[6], sum = 0x5EA1u;
        memcpy(&halves[0], &ceiling.temperature_c23[k], 4);
        halves[2] = ceiling.austenite[k];
        halves[3] = ceiling.loss_share[k];
        halves[4] = ceiling.capacity_share[k];
        halves[5] = ceiling.rest_turns[k];
        for (unsigned n = 0; n < 6; n++) {
            sum = (uint16_t)((uint16_t)(sum << 1u | sum >> 15u) + halves[n]);
        }
        ceiling.seal[k] = sum;
    }
}

/* power_w into every spring of the ceiling; the model is stepped with its own. */
static void run(float power_w, uint32_t model_uw, float seconds)
{
    uint32_t power_uw[THERMAL_MODEL_MAX_SPRINGS];
    for (uint8_t k = 0; k < THERMAL_MODEL_MAX_SPRINGS; k++) {
        power_uw[k] = model_uw;
    }
    for (float s = 0.0f; s < seconds; s += TEMPERATURE_CEILING_TURN_S) {
        for (uint8_t n = 0; n < 6; n++) {
            thermal_model_step(&model, power_uw);
        }
        for (uint8_t k = 0; k < model.springs; k++) {
            temperature_ceiling_step(&ceiling, &model, k, power_w);
        }
    }
}

static float model_c(uint8_t k)
{
    return (float)thermal_model_temperature_c7(&model, k) / 128.0f;
}

/* Heated through the transformation and cooled again: within 3 K of the exact network, whose
 * kinetics are a cosine. */
TEST(it_follows_the_declared_network)
{
    for (int phase = 0; phase < 40; phase++) {
        const bool heats = phase < 20;
        run(heats ? 0.6f : 0.1f, heats ? 600000u : 100000u, 6.0f);
        for (uint8_t k = 0; k < 9; k++) {
            TEST_ASSERT_FLOAT_WITHIN(3.0f, model_c(k), temperature_ceiling_c(&ceiling, k));
        }
    }
}

/* Other numbers are declared, by settings that arrive now. */
static void declare_model(const thermal_model_parameters_t *now)
{
    temperature_ceiling_declared_t before[THERMAL_MODEL_MAX_SPRINGS];
    thermal_model_state_t state;
    for (uint8_t k = 0; k < model.springs; k++) {
        before[k] = temperature_ceiling_declared(&model, k);
    }
    thermal_model_get_state(&model, &state);
    const uint8_t fan_percent = model.fan_percent;
    TEST_ASSERT_EQUAL(THERMAL_MODEL_OK, thermal_model_init(&model, now, NULL));
    thermal_model_set_fan(&model, fan_percent);
    (void)thermal_model_set_state(&model, &state);
    for (uint8_t k = 0; k < model.springs; k++) {
        temperature_ceiling_declare(&ceiling, &model, k, &before[k]);
    }
}

static void declare_scaled(float loss, float capacity, float scale)
{
    thermal_model_parameters_t now = parameters;
    now.loss_uw_per_k = (uint16_t)(loss * (float)parameters.loss_uw_per_k);
    now.heat_capacity_mj_per_k = (uint16_t)(capacity * (float)parameters.heat_capacity_mj_per_k);
    for (uint8_t k = 0; k < model.springs; k++) {
        now.heat_capacity_scale_permille[k] = (uint16_t)(1000.0f * scale);
    }
    declare_model(&now);
}

static void declare(float loss, float capacity)
{
    declare_scaled(loss, capacity, 1.0f);
}

/* Beside a twin to which nothing was declared, and that goes first, it is at most so much colder or
 * hotter at the same moment. */
static void expect_beside_twin(bool is_twin, int moment, float colder_k, float hotter_k)
{
    static float twin_c[60];
    const float c = temperature_ceiling_c(&ceiling, 4);
    twin_c[moment] = is_twin ? c : twin_c[moment];
    TEST_ASSERT_TRUE(c > twin_c[moment] - colder_k);
    TEST_ASSERT_TRUE(c < twin_c[moment] + hotter_k);
}

#define HOWEVER_HOT 1000.0f

/* A scale is of the latent heat, too: no spring that transforms is colder. */
TEST(a_scale_that_is_declared_to_a_warm_spring_takes_no_more_latent_heat)
{
    for (int twin = 1; twin >= 0; twin--) {
        setUp();
        run(0.6f, 600000u, 12.0f);
        declare_scaled(1.0f, 1.0f, twin ? 1.0f : 3.0f);
        for (int m = 0; m < 30; m++) {
            run(0.6f, 600000u, 6.0f);
            expect_beside_twin(twin, m, 3.0f, 3.0f);
        }
    }
}

/* What it took up it gives back, whatever is declared then: no spring that cools is colder. */
TEST(a_warm_spring_gives_back_the_latent_heat_that_it_took_up)
{
    for (int twin = 1; twin >= 0; twin--) {
        setUp();
        run(0.6f, 600000u, 180.0f);
        TEST_ASSERT_TRUE(temperature_ceiling_c(&ceiling, 4) > 100.0f);
        declare(1.0f, twin ? 1.0f : 1.5f);
        for (int m = 0; m < 20; m++) {
            run(0.0f, 0u, 6.0f);
            expect_beside_twin(twin, m, 1.0f, HOWEVER_HOT);
        }
    }
}

/* Heated, then driven on for as long: what is declared makes no warm spring colder, however often
 * it arrives; but hotter, if it is. Of a larger heat capacity it is hotter by as much as it then
 * counts less latent heat, all of which is 29 K. */
TEST(of_warm_springs_the_more_careful_numbers_count)
{
    static const struct {
        float loss, capacity, twin_loss, twin_capacity;
    } row[] = {{1.4f, 1.0f, 1.0f, 1.0f}, {3.4f, 1.0f, 1.0f, 1.0f}, {1.0f, 10.0f, 1.0f, 1.0f},
               {3.4f, 4.0f, 1.0f, 1.0f}, {0.8f, 1.0f, 0.8f, 1.0f}, {1.0f, 0.5f, 1.0f, 0.5f}};
    for (unsigned n = 0; n < ROWS(row); n++) {
        const float hotter_k = row[n].capacity > row[n].twin_capacity ? 29.0f : 3.0f;
        for (int twin = 1; twin >= 0; twin--) {
            setUp();
            run(0.6f, 600000u, 60.0f);
            for (int m = 0; m < 60; m++) {
                if (m == 0 || (m % 3 == 0 && twin == 0)) {
                    declare(twin ? row[n].twin_loss : row[n].loss,
                            twin ? row[n].twin_capacity : row[n].capacity);
                }
                run(m < 20 ? 0.0f : 0.6f, m < 20 ? 0u : 600000u, 6.0f);
                expect_beside_twin(twin, m, 3.0f, hotter_k);
            }
        }
    }
}

/* These numbers are declared at a moment of a heating, or not, and the fan goes on at another. */
static void heat_beside_twin(const thermal_model_parameters_t *now, int when, bool alone,
                             uint8_t before_percent, uint8_t then_percent)
{
    for (int twin = 1; twin >= 0; twin--) {
        setUp();
        thermal_model_set_fan(&model, before_percent);
        for (int m = 0; m < 60; m++) {
            for (int turn = 0; turn < 10; turn++) {
                for (uint8_t k = 0; k < 9; k++) {
                    temperature_ceiling_step(&ceiling, &model, k, k == 4 || !alone ? 0.6f : 0.0f);
                }
            }
            if (m == when && !twin) {
                declare_model(now);
            }
            if (m == when + 1) {
                thermal_model_set_fan(&model, then_percent);
            }
            expect_beside_twin(twin, m, 3.0f, HOWEVER_HOT);
        }
    }
    declare_model(&parameters);
    TEST_ASSERT_UINT16_WITHIN(66, WHOLE, ceiling.loss_share[4]);
}

static thermal_model_parameters_t with_plate(uint16_t coupling_uw_per_k)
{
    thermal_model_parameters_t now = parameters;
    now.plate_coupling_uw_per_k = coupling_uw_per_k;
    now.plate_heat_capacity_mj_per_k = 2000000;
    now.plate_loss_uw_per_k = 65535;
    return now;
}

/* A plate, neighbours or a latent heat that are said to take more, at any moment of a heating: no
 * spring is colder, driven alone or beside the others; taken back, all is as before. */
TEST(what_else_is_said_to_take_heat_takes_no_more_of_a_warm_spring)
{
    for (unsigned n = 0; n < 16u; n++) {
        thermal_model_parameters_t now = with_plate(n % 4u == 0 ? 50000 : 0);
        now.orthogonal_uw_per_k = n % 4u == 1 ? 12000 : parameters.orthogonal_uw_per_k;
        now.diagonal_uw_per_k = n % 4u == 2 ? 12000 : parameters.diagonal_uw_per_k;
        now.latent_heat_mj = n % 4u == 3 ? 23800 : parameters.latent_heat_mj;
        heat_beside_twin(&now, n < 8u ? 1 : 20, n / 4u % 2u != 0, 0, 0);
        TEST_ASSERT_UINT16_WITHIN(66, WHOLE, ceiling.capacity_share[4]);
    }
}

/* What is declared of a fan that is switched on or off only then: as above. */
TEST(what_a_fan_is_said_to_take_counts_before_it_is_told)
{
    static const struct {
        uint16_t loss_uw, orthogonal_uw, diagonal_uw, half_permille, plate_uw;
        uint8_t before_percent, then_percent;
    } row[] = {{38000, 658, 329, 500, 0, 0, 100},    {38000, 658, 329, 500, 0, 0, 30},
               {11300, 12000, 329, 500, 0, 0, 100},  {11300, 658, 12000, 500, 0, 0, 60},
               {11300, 658, 329, 900, 0, 0, 50},     {11300, 658, 329, 900, 0, 100, 50},
               {11300, 658, 329, 500, 50000, 100, 0}};
    for (unsigned n = 0; n < ROWS(row); n++) {
        thermal_model_parameters_t now = with_plate(row[n].plate_uw);
        now.loss_fan_uw_per_k = row[n].loss_uw;
        now.orthogonal_fan_uw_per_k = row[n].orthogonal_uw;
        now.diagonal_fan_uw_per_k = row[n].diagonal_uw;
        now.fan_half_share_permille = row[n].half_permille;
        heat_beside_twin(&now, 10, true, row[n].before_percent, row[n].then_percent);
    }
}

/* From the first power on, however little it is by now: declared before or behind its first step,
 * which is no 5 K. The springs that get none count with it. */
TEST(what_is_declared_as_power_begins_is_declared_to_warm_springs)
{
    for (unsigned stepped = 0; stepped < 2; stepped++) {
        float undeclared_c = 0.0f;
        for (unsigned declared = 0; declared < 2; declared++) {
            setUp();
            if (stepped) {
                run(0.6f, 600000u, TEMPERATURE_CEILING_TURN_S);
                TEST_ASSERT_FALSE(temperature_ceiling_is_warm(&ceiling, 4));
            } else {
                temperature_ceiling_give(&ceiling, &model, 8);
            }
            if (declared) {
                declare(3.4f, 10.0f);
                TEST_ASSERT_UINT16_WITHIN(1, WHOLE / 10u, ceiling.capacity_share[0]);
            }
            run(0.6f, 600000u, 60.0f);
            if (!declared) {
                undeclared_c = temperature_ceiling_c(&ceiling, 8);
            }
        }
        TEST_ASSERT_TRUE(temperature_ceiling_c(&ceiling, 8) > undeclared_c - 3.0f);
    }
    setUp(); /* and of cold ones, that got power before, it is what they are */
    run(0.6f, 600000u, TEMPERATURE_CEILING_TURN_S);
    run(0.0f, 0u, 2.0f * TEMPERATURE_CEILING_TURN_S);
    declare(3.4f, 10.0f);
    TEST_ASSERT_EQUAL_UINT16(WHOLE, ceiling.capacity_share[4]);
}

/* What is declared by so little more at a time that no single step shows: it goes by the least of
 * all, or up to a fiftieth below it. */
TEST(many_small_declarations_escape_no_more_than_one_large_one)
{
    static const float step[][2] = {{0.001f, 0.0f}, {0.0005f, 0.002f}, {0.0f, 0.001f}};
    for (unsigned n = 0; n < ROWS(step); n++) {
        setUp();
        run(0.6f, 600000u, 60.0f);
        const temperature_ceiling_declared_t least = temperature_ceiling_declared(&model, 4);
        for (unsigned m = 1; m <= 1000; m++) {
            declare(1.0f + step[n][0] * (float)m, 1.0f + step[n][1] * (float)m);
        }
        const temperature_ceiling_declared_t now = temperature_ceiling_declared(&model, 4);
        const float loss =
            now.now.own_w_per_k / least.now.own_w_per_k * (float)ceiling.loss_share[4];
        const float heat =
            now.capacity_j_per_k / least.capacity_j_per_k * (float)ceiling.capacity_share[4];
        TEST_ASSERT_FLOAT_WITHIN(0.01f, 0.99f, loss / (float)WHOLE);
        TEST_ASSERT_FLOAT_WITHIN(0.01f, 0.99f, heat / (float)WHOLE);
    }
}

/* Back to what it was, all is as before, to a thousandth; and what never was warm goes by what is
 * declared. */
TEST(what_was_declared_is_over_when_it_is_taken_back_or_all_are_cold)
{
    declare(3.4f, 10.0f);
    TEST_ASSERT_EQUAL_UINT16(WHOLE, ceiling.loss_share[4]);
    TEST_ASSERT_EQUAL_UINT16(WHOLE, ceiling.capacity_share[4]);
    declare(1.0f, 1.0f);
    run(0.6f, 600000u, 60.0f);
    for (int n = 0; n < 20; n++) {
        declare(n % 2 == 0 ? 3.4f : 1.0f, n % 3 == 0 ? 10.0f : 1.0f);
    }
    declare(1.0f, 1.0f);
    TEST_ASSERT_UINT16_WITHIN(66, WHOLE, ceiling.loss_share[4]);
    TEST_ASSERT_UINT16_WITHIN(66, WHOLE, ceiling.capacity_share[4]);
    declare(3.4f, 10.0f);
    TEST_ASSERT_UINT16_WITHIN(66, WHOLE / 3.4f, ceiling.loss_share[4]);
    TEST_ASSERT_UINT16_WITHIN(66, WHOLE / 10, ceiling.capacity_share[4]);
    run(0.0f, 0, 600.0f);
    TEST_ASSERT_FALSE(temperature_ceiling_is_warm(&ceiling, 4));
    TEST_ASSERT_EQUAL_UINT16(WHOLE, ceiling.loss_share[4]);
    TEST_ASSERT_EQUAL_UINT16(WHOLE, ceiling.capacity_share[4]);
}

/* Each alone, from the edge on. */
TEST(two_declarations_contradict_where_no_tolerance_explains_both)
{
    static const struct {
        float loss, capacity;
        int16_t air_c7;
        bool contradicts;
    } row[] = {{1.0f, 1.0f, 20 * 128, false}, {1.48f, 1.48f, 20 * 128, false},
               {1.55f, 1.0f, 20 * 128, true}, {1.0f, 1.55f, 20 * 128, true},
               {1.0f, 1.0f, 0, false},        {1.0f, 1.0f, -1, true},
               {0.3f, 0.5f, 45 * 128, false}};
    for (unsigned n = 0; n < ROWS(row); n++) {
        setUp();
        run(0.6f, 600000u, 60.0f);
        declare(row[n].loss, row[n].capacity);
        thermal_model_set_ambient(&model, row[n].air_c7);
        for (uint8_t k = 0; k < 9; k++) {
            TEST_ASSERT_EQUAL(row[n].contradicts,
                              temperature_ceiling_contradicts(&ceiling, &model, k));
        }
    }
    temperature_ceiling_begin(&ceiling, 20 * 128);
    for (int off = -2; off < 3; off++) { /* two thirds are still none */
        uint16_t *const shares[] = {&ceiling.loss_share[1], &ceiling.capacity_share[2]};
        for (uint8_t k = 0; k < 2; k++) {
            *shares[k] = (uint16_t)(WHOLE / 3 * 2 + off);
            TEST_ASSERT_EQUAL(off < 0,
                              temperature_ceiling_contradicts(&ceiling, &model, (uint8_t)(k + 1u)));
            *shares[k] = WHOLE;
        }
    }
}

/* Each number of one step by the equation of the header's network, in double: power in, losses out
 * as the model declares them, the neighbours' excess, the flow's own change taken at its end. */
TEST(one_step_is_the_implicit_one)
{
    for (int n = 0; n < 12; n++) {
        setUp();
        parameters.heat_capacity_mj_per_k = (uint16_t)(n % 2 == 0 ? 300 : 120);
        parameters.plate_coupling_uw_per_k = (uint16_t)(n % 3 == 0 ? 0 : 4000);
        parameters.plate_heat_capacity_mj_per_k = 13000;
        TEST_ASSERT_EQUAL(THERMAL_MODEL_OK, thermal_model_init(&model, &parameters, NULL));
        for (uint8_t k = 0; k < 9; k++) { /* far from the ceiling's: much flows */
            thermal_model_set_temperature(&model, k, (int16_t)((k == 1 ? 30 : -20) * 128));
        }
        thermal_model_t warmer = model;
        for (uint8_t k = 0; k < 9; k++) {
            thermal_model_set_temperature(&warmer, k, (int16_t)((25 + 4 * k) * 128));
        }
        temperature_ceiling_raise(&ceiling, &warmer);
        const uint8_t k = (uint8_t)(n % 9);
        const double power_w = 0.1 * n;
        double stiffness_w_per_k =
            1e-6 * (model.spring[k].loss_uw_per_k + parameters.plate_coupling_uw_per_k);
        double from_neighbours_w = 0.0;
        for (uint8_t j = 0; j < 9; j++) {
            const double g = 1e-6 * thermal_model_coupling_uw_per_k(&model, k, j);
            stiffness_w_per_k += g;
            from_neighbours_w +=
                g * ((25.0 + 4.0 * j) - thermal_model_temperature_c7(&model, j) / 128.0);
        }
        const double loss_w =
            1e-6 * thermal_model_power_to_hold_uw(&model, k, (int16_t)((25 + 4 * k) * 128));
        const double dt_s = (double)TEMPERATURE_CEILING_TURN_S;
        const double c = 1e-3 * parameters.heat_capacity_mj_per_k;
        const double rise_k =
            (power_w + from_neighbours_w - loss_w) * dt_s / (c + dt_s * stiffness_w_per_k);
        temperature_ceiling_step(&ceiling, &model, k, (float)power_w);
        TEST_ASSERT_FLOAT_WITHIN(0.0004f + 0.001f * (float)fabs(rise_k),
                                 (float)(25.0 + 4.0 * k + rise_k),
                                 temperature_ceiling_c(&ceiling, k));
    }
}

/* 0.64 of what the declared circuit gives an austenite, less the diode's drop. */
TEST(power_of_a_duty_is_of_the_declared_circuit)
{
    current_control_parameters_t circuit;
    current_control_parameters_default(&circuit);
    for (uint16_t drop_mv = 0; drop_mv <= 700; drop_mv = (uint16_t)(drop_mv + 350u)) {
        circuit.freewheel_mv = drop_mv;
        temperature_ceiling_prepare(&drive, &model, &circuit);
        const double ohm = 1e-6 * parameters.resistance_austenite_uohm;
        const double loop_ohm = ohm + 1e-3 * (circuit.shunt_mohm + circuit.wiring_mohm);
        for (int duty = 0; duty <= 800; duty += 100) {
            for (int more_mv = 0; more_mv <= 300; more_mv += 300) {
                const double drops_v = 1e-3 * (drop_mv + more_mv);
                const double behind_v =
                    (1e-3 * circuit.supply_mv + drops_v) * duty / 800.0 - drops_v;
                const double amps = behind_v > 0.0 ? behind_v / loop_ohm : 0.0;
                TEST_ASSERT_FLOAT_WITHIN(
                    1e-3f * (float)(1.0 + amps * amps * ohm), (float)(0.64 * amps * amps * ohm),
                    temperature_ceiling_power_w(&drive, (float)duty, 1e-3f * (float)more_mv));
            }
        }
    }
}

/* Nine tenths: the rise that trips the ceiling over the one that trips the model; and its end. */
TEST(it_trips_a_ninth_above_the_rise_that_trips_the_model)
{
    static const int16_t ambient_c[] = {0, 20, 35};
    for (int n = 0; n < 3; n++) {
        temperature_ceiling_begin(&ceiling, (int16_t)(ambient_c[n] * 128));
        const double trips_c = ambient_c[n] + (130.0 - ambient_c[n]) / 0.9;
        for (int side = -1; side <= 1; side += 2) {
            ceiling.temperature_c23[3] = (int32_t)((trips_c + 0.02 * side) * 8388608.0);
            TEST_ASSERT_EQUAL(side > 0, temperature_ceiling_trips(&ceiling, 3, 13000));
            TEST_ASSERT_FALSE(temperature_ceiling_trips(&ceiling, 2, 13000));
        }
        ceiling.temperature_c23[3] = (214 * 128 - 1) * 65536;
        TEST_ASSERT_FALSE(temperature_ceiling_trips(&ceiling, 3, 30000));
        ceiling.temperature_c23[3] = 214 * 128 * 65536;
        TEST_ASSERT_TRUE(temperature_ceiling_trips(&ceiling, 3, 30000));
    }
}

TEST(it_ends_at_its_highest_and_lowest)
{
    run(50.0f, 0, 120.0f);
    TEST_ASSERT_EQUAL_FLOAT(215.0f, temperature_ceiling_c(&ceiling, 0));
    run(-50.0f, 0, 300.0f);
    TEST_ASSERT_EQUAL_FLOAT(-40.0f, temperature_ceiling_c(&ceiling, 0));
}

/* Since power above a sensor's offset: turns of its own; and never before there was any. */
TEST(rest_is_counted_from_the_last_power)
{
    TEST_ASSERT_EQUAL_UINT16(TEMPERATURE_CEILING_NEVER, temperature_ceiling_rest_s(&ceiling, 4));
    run(0.01f, 0, 6.0f);
    TEST_ASSERT_EQUAL_UINT16(TEMPERATURE_CEILING_NEVER, temperature_ceiling_rest_s(&ceiling, 4));
    TEST_ASSERT_FALSE(ceiling.delivered);
    run(0.011f, 0, 0.5f);
    TEST_ASSERT_EQUAL_UINT16(0, temperature_ceiling_rest_s(&ceiling, 4));
    run(0.0f, 0, 60.0f);
    TEST_ASSERT_UINT16_WITHIN(1, 60, temperature_ceiling_rest_s(&ceiling, 4));
    temperature_ceiling_step(&ceiling, &model, 4, 1.0f);
    for (int n = 0; n < 4; n++) {
        temperature_ceiling_step(&ceiling, &model, 4, 0.0f);
    }
    TEST_ASSERT_EQUAL_UINT16(2, temperature_ceiling_rest_s(&ceiling, 4)); /* 2.4 s */
}

/* What is given counts as power at once, of springs that nobody knew of, too. */
TEST(who_is_given_power_has_no_rest)
{
    ceiling.doubtful = true;
    temperature_ceiling_begin(&ceiling, 20 * 128);
    TEST_ASSERT_FALSE(ceiling.doubtful);
    run(0.0f, 0, 60.0f);
    temperature_ceiling_give(&ceiling, &model, 4);
    TEST_ASSERT_TRUE(ceiling.delivered);
    TEST_ASSERT_EQUAL_UINT16(0, temperature_ceiling_rest_s(&ceiling, 4));
    TEST_ASSERT_EQUAL_UINT16(TEMPERATURE_CEILING_NEVER, temperature_ceiling_rest_s(&ceiling, 5));
    run(0.0f, 0, 12.0f); /* its record is sound: see tearDown */
    ceiling.temperature_c23[4] ^= 1;
    temperature_ceiling_give(&ceiling, &model, 4);
    TEST_ASSERT_EQUAL_UINT8(1, temperature_ceiling_broken_seals(&ceiling));
    temperature_ceiling_begin(&ceiling, 20 * 128);
}

/* All are cold: what is kept of each is looked at before its shares are whole again. */
TEST(what_turned_over_in_a_cold_spring_is_found_as_all_are_cold)
{
    ceiling.loss_share[7] ^= 1;
    temperature_ceiling_step(&ceiling, &model, 0, 0.0f);
    TEST_ASSERT_EQUAL_UINT8(1, temperature_ceiling_broken_seals(&ceiling));
    TEST_ASSERT_TRUE(temperature_ceiling_is_warm(&ceiling, 7));
    temperature_ceiling_begin(&ceiling, 20 * 128);
}

/* Up to the rise that is declared for it, with its latent heat. */
TEST(heat_that_is_declared_is_of_both_numbers)
{
    const float capacity = 1e-3f * (float)parameters.heat_capacity_mj_per_k;
    const float latent_j = 1e-3f * (float)parameters.latent_heat_mj;
    const temperature_ceiling_declared_t declared = temperature_ceiling_declared(&model, 4);
    TEST_ASSERT_FLOAT_WITHIN(1e-3f, capacity, declared.capacity_j_per_k);
    TEST_ASSERT_FLOAT_WITHIN(0.05f, capacity * TEMPERATURE_CEILING_HEATED_K + latent_j,
                             declared.heat_j);
}

/* Losses to the air that are declared lower by a third, beside a plate that takes half of them; or
 * higher by a tenth, beside neighbours that take nothing any more: the larger change counts, and
 * makes it hotter. */
TEST(of_two_changes_the_larger_one_counts)
{
    for (int neighbours = 0; neighbours < 2; neighbours++) {
        setUp();
        run(0.6f, 600000u, 60.0f);
        thermal_model_parameters_t now = neighbours ? parameters : with_plate(3000);
        now.loss_uw_per_k = (uint16_t)((neighbours ? 1.1f : 0.67f) * (float)now.loss_uw_per_k);
        if (neighbours) {
            now.orthogonal_uw_per_k = now.diagonal_uw_per_k = 0;
        }
        ceiling.loss_share[4] = WHOLE / 2u;
        seal_all();
        const temperature_ceiling_losses_t was = temperature_ceiling_declared(&model, 4).now;
        declare_model(&now);
        const temperature_ceiling_losses_t is = temperature_ceiling_declared(&model, 4).now;
        const float larger = neighbours ? was.with_neighbours_w_per_k / is.with_neighbours_w_per_k
                                        : was.own_w_per_k / is.own_w_per_k;
        TEST_ASSERT_TRUE(larger > 1.2f);
        TEST_ASSERT_UINT16_WITHIN(WHOLE / 100u, (uint16_t)(WHOLE / 2u * larger),
                                  ceiling.loss_share[4]);
    }
}

/* Each bit of each spring's record, and of the ambient: it is as hot as it may be, and counted. */
TEST(whatever_bit_turns_over_it_is_taken_to_be_hot)
{
    uint8_t *const fields[] = {
        (uint8_t *)&ceiling.temperature_c23[4], (uint8_t *)&ceiling.austenite[4],
        (uint8_t *)&ceiling.loss_share[4],      (uint8_t *)&ceiling.capacity_share[4],
        (uint8_t *)&ceiling.rest_turns[4],      (uint8_t *)&ceiling.seal[4],
        (uint8_t *)&ceiling.ambient_c7,         (uint8_t *)&ceiling.not_ambient_c7,
    };
    const uint8_t bytes[] = {4, 2, 2, 2, 2, 2, 2, 2};
    for (unsigned field = 0; field < 8; field++) {
        for (unsigned bit = 0; bit < 8u * bytes[field]; bit++) {
            setUp();
            run(0.6f, 600000u, 30.0f);
            run(0.0f, 0u, 12.0f);
            const float was_c = temperature_ceiling_c(&ceiling, 4);
            ceiling.delivered = field >= 6; /* as of springs that are cold */
            fields[field][bit / 8u] ^= (uint8_t)(1u << bit % 8u);
            temperature_ceiling_step(&ceiling, &model, 4, 0.0f);
            TEST_ASSERT_EQUAL_UINT8(1, temperature_ceiling_broken_seals(&ceiling));
            TEST_ASSERT_FLOAT_WITHIN(0.5f, field < 6 ? 118.5f : was_c - 0.5f,
                                     temperature_ceiling_c(&ceiling, 4));
            TEST_ASSERT_EQUAL_UINT16(field < 6 ? 0 : 12, temperature_ceiling_rest_s(&ceiling, 4));
            TEST_ASSERT_TRUE(temperature_ceiling_is_warm(&ceiling, 4));
            TEST_ASSERT_EQUAL_INT16(thermal_model_ambient_c7(&model), ceiling.ambient_c7);
            run(0.6f, 0u, 60.0f); /* and goes on from there */
            TEST_ASSERT_EQUAL_UINT8(1, temperature_ceiling_broken_seals(&ceiling));
        }
    }
    for (unsigned n = 0; n < 600;
         n++) { /* whoever else uses it looks at it, too; 255 is the most */
        ceiling.temperature_c23[n % 9u] ^= 1;
        if (n % 2u == 0) {
            temperature_ceiling_raise(&ceiling, &model);
        } else {
            const temperature_ceiling_declared_t same = temperature_ceiling_declared(&model, 0);
            temperature_ceiling_declare(&ceiling, &model, (uint8_t)(n % 9u), &same);
        }
        TEST_ASSERT_EQUAL_UINT8(n + 2u < 255u ? n + 2u : 255u,
                                temperature_ceiling_broken_seals(&ceiling));
    }
    temperature_ceiling_begin(&ceiling, 20 * 128);
    TEST_ASSERT_EQUAL_UINT8(0, temperature_ceiling_broken_seals(&ceiling));
}

/* Warm is what power was given to and is still so far above the warmest air that was told. */
TEST(warm_is_what_was_heated_and_has_not_cooled)
{
    for (uint8_t k = 0; k < 9; k += 4) {
        temperature_ceiling_begin(&ceiling, 20 * 128);
        ceiling.temperature_c23[k] = 60 * 128 * 65536;
        TEST_ASSERT_FALSE(temperature_ceiling_is_warm(&ceiling, k)); /* nobody gave it power */
        ceiling.delivered = true;
        TEST_ASSERT_TRUE(temperature_ceiling_is_warm(&ceiling, k));
        TEST_ASSERT_FALSE(temperature_ceiling_is_warm(&ceiling, (uint8_t)((k + 1) % 9)));
        const double edge_c = 20.0 + (double)TEMPERATURE_CEILING_WARM_K;
        ceiling.temperature_c23[k] = (int32_t)((edge_c - 0.01) * 8388608.0);
        TEST_ASSERT_FALSE(temperature_ceiling_is_warm(&ceiling, k));
        ceiling.temperature_c23[k] = (int32_t)((edge_c + 0.01) * 8388608.0);
        TEST_ASSERT_TRUE(temperature_ceiling_is_warm(&ceiling, k));
    }
}

/* A model that is told to be hotter takes the ceiling with it, spring by spring, and that is heat;
 * of whose power, and when, it does not say. */
TEST(a_hotter_model_raises_it_and_a_colder_one_does_not)
{
    for (uint8_t k = 0; k < 9; k += 4) {
        setUp();
        run(0.0f, 0, 6.0f);
        thermal_model_set_temperature(&model, k, 110 * 128);
        temperature_ceiling_raise(&ceiling, &model);
        TEST_ASSERT_EQUAL_INT32(110 * 128 * 65536, ceiling.temperature_c23[k]);
        TEST_ASSERT_EQUAL_UINT16(THERMAL_MODEL_AUSTENITE_FULL, ceiling.austenite[k]);
        TEST_ASSERT_EQUAL_UINT16(TEMPERATURE_CEILING_NEVER, ceiling.rest_turns[k]);
        TEST_ASSERT_TRUE(temperature_ceiling_is_warm(&ceiling, k));
        TEST_ASSERT_EQUAL_INT32(20 * 128 * 65536, ceiling.temperature_c23[9]); /* of no spring */
        ceiling.austenite[k] = 5000; /* one that is as hot changes nothing */
        seal_all();
        temperature_ceiling_raise(&ceiling, &model);
        TEST_ASSERT_EQUAL_UINT16(5000, ceiling.austenite[k]);
        thermal_model_set_temperature(&model, k, 30 * 128);
        thermal_model_set_ambient(&model, 35 * 128); /* once heat was given, no air of it */
        temperature_ceiling_raise(&ceiling, &model);
        TEST_ASSERT_FLOAT_WITHIN(0.01f, 110.0f, temperature_ceiling_c(&ceiling, k));
        TEST_ASSERT_EQUAL_INT16(20 * 128, ceiling.ambient_c7);
    }
}

/* Until something was given the air is as it is now: springs said to be as warm are cold. */
TEST(air_that_is_told_to_be_warmer_is_no_heat)
{
    run(0.0f, 0, 6.0f);
    thermal_model_set_ambient(&model, 35 * 128);
    thermal_model_reset(&model, 35 * 128);
    temperature_ceiling_raise(&ceiling, &model);
    for (uint8_t k = 0; k < 9; k++) {
        TEST_ASSERT_FALSE(temperature_ceiling_is_warm(&ceiling, k));
        TEST_ASSERT_FLOAT_WITHIN(0.01f, 35.0f, temperature_ceiling_c(&ceiling, k));
    }
}

/* The air's warmest counts while anything is warm, and what is told after that. */
TEST(warmest_air_counts_until_all_are_cold)
{
    for (uint8_t k = 0; k < 9; k += 4) {
        setUp();
        ceiling.temperature_c23[k] = 100 * 128 * 65536;
        ceiling.delivered = true;
        ceiling.loss_share[k] = ceiling.capacity_share[k] = 100;
        thermal_model_set_ambient(&model, 30 * 128);
        seal_all();
        temperature_ceiling_step(&ceiling, &model, 0, 0.0f);
        TEST_ASSERT_EQUAL_INT16(30 * 128, ceiling.ambient_c7);
        thermal_model_set_ambient(&model, 15 * 128);
        temperature_ceiling_step(&ceiling, &model, 0, 0.0f);
        TEST_ASSERT_EQUAL_INT16(30 * 128, ceiling.ambient_c7);
        TEST_ASSERT_TRUE(ceiling.delivered);
        ceiling.temperature_c23[k] = 20 * 128 * 65536;
        seal_all();
        temperature_ceiling_step(&ceiling, &model, 1, 0.0f); /* looked at once a round */
        TEST_ASSERT_TRUE(ceiling.delivered);
        temperature_ceiling_step(&ceiling, &model, 0, 0.0f);
        TEST_ASSERT_FALSE(ceiling.delivered);
        TEST_ASSERT_EQUAL_UINT16(WHOLE, ceiling.loss_share[k]);
        TEST_ASSERT_EQUAL_UINT16(WHOLE, ceiling.capacity_share[k]);
        TEST_ASSERT_EQUAL_INT16(15 * 128, ceiling.ambient_c7);
    }
    /* what only another size of the array has is neither looked at nor touched */
    setUp();
    ceiling.temperature_c23[9] = 100 * 128 * 65536;
    ceiling.loss_share[9] = 100;
    ceiling.delivered = true;
    seal_all();
    temperature_ceiling_step(&ceiling, &model, 0, 0.0f);
    TEST_ASSERT_FALSE(ceiling.delivered);
    TEST_ASSERT_EQUAL_UINT16(100, ceiling.loss_share[9]);
}

/* It loses what is declared where it is, less what the air has cooled by since: as fast as a twin
 * that is colder by as much. */
TEST(it_gives_off_what_is_declared_in_the_warmest_air)
{
    for (int16_t cooler_c7 = -256; cooler_c7 <= 256; cooler_c7 = (int16_t)(cooler_c7 + 128)) {
        setUp();
        ceiling.temperature_c23[4] = 60 * 128 * 65536;
        ceiling.delivered = true;
        seal_all();
        thermal_model_set_ambient(&model, (int16_t)(20 * 128 - cooler_c7));
        const double held_w =
            1e-6 * thermal_model_power_to_hold_uw(
                       &model, 4, (int16_t)(60 * 128 - (cooler_c7 > 0 ? cooler_c7 : 0)));
        temperature_ceiling_step(&ceiling, &model, 4, (float)held_w);
        TEST_ASSERT_FLOAT_WITHIN(1e-4f, 60.0f, temperature_ceiling_c(&ceiling, 4));
    }
}
