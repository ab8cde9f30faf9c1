/* What it is for: that the second truth is true: heat, phase, resistance and sensors against what
 *                 physics says of them by another way.
 * What it owns: the reference values, worked out here.
 * What it never does: run a controller. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../run_tests.h"

#include "world.h"

#define TICKS_PER_S 50

static world_parameters_t parameters;
static world_t *world;
static controller_outputs_t outputs;
static controller_inputs_t inputs;

void setUp(void)
{
    world_parameters_default(&parameters);
    memset(&outputs, 0, sizeof outputs);
    world = NULL;
}

void tearDown(void)
{
    world_destroy(world);
}

static void make_world(void)
{
    world_destroy(world);
    world = world_create(&parameters);
    TEST_ASSERT_NOT_NULL(world);
}

static void single_spring(void)
{
    parameters.rows = parameters.columns = 1;
}

static void run_s(double seconds)
{
    for (long tick = lround(seconds * TICKS_PER_S); tick > 0; tick--) {
        world_tick(world, &outputs, &inputs);
    }
}

/* Joule heat in the wire of spring 0, W: what its crimps' contacts make aside. */
static double wire_w(double contact_ohm)
{
    double a = world_current_a(world, 0);
    return a * a * (world_resistance_ohm(world, 0) - contact_ohm);
}

/* The duty that makes this power in spring 0, to a step. */
static void hold_power_w(double w)
{
    double ohm = world_resistance_ohm(world, 0);
    double a = sqrt(w / ohm);
    outputs.duty[0] =
        (uint16_t)lround(a * (ohm + parameters.loop_ohm) / parameters.supply_v * 800.0);
}

/* Every heat path at once. What the wires hold, what came in and what went out must agree to what
 * the solver may leave in each node. */
TEST(energy_closes_in_every_law)
{
    for (int law = 0; law < KINETICS_COUNT; law++) {
        setUp();
        for (int k = 0; k < 9; k++) {
            parameters.spring[k].alloy.law = (kinetics_law_t)law;
            parameters.spring[k].contact_ohm = 0.01;
        }
        parameters.air_w_per_k = 0.06;
        parameters.air_j_per_k = 0.3;
        parameters.plate_w_per_k = 0.03;
        parameters.plate_j_per_k = 10.0;
        parameters.convection = (world_convection_t)(law % WORLD_CONVECTION_COUNT);
        parameters.gust_every_s = 10.0;
        parameters.gust_lasts_s = 5.0;
        parameters.gust_factor = 1.8;
        parameters.events = 1;
        parameters.event[0] = (world_event_t){WORLD_STRESS_MPA, 40.0, 4, 60.0};
        make_world();
        double before_j = world_energy(world).stored_j;
        for (int phase = 0; phase < 20; phase++) { /* heat, cool, minor loops */
            for (int k = 0; k < 9; k++) {
                outputs.duty[k] = (uint16_t)((phase * 7 + k * 5) % 3 * 80);
            }
            run_s(9.9);
            world_energy_t energy = world_energy(world);
            double added_j = energy.supplied_j - energy.lost_j;
            TEST_ASSERT_DOUBLE_WITHIN(1e-6, before_j + added_j, energy.stored_j);
        }
        TEST_ASSERT_TRUE(world_energy(world).supplied_j > 500.0);
        tearDown();
    }
    world = NULL;
}

/* A finger on a spring that cools: the latent heat that is set free warms it, but to no more than
 * where it transforms. Of a law that begins steeply a temperature is found that its heat has, too.
 */
TEST(what_is_pressed_gets_no_hotter_than_where_it_transforms_in_every_law)
{
    for (int law = 0; law < KINETICS_COUNT; law++) {
        setUp();
        single_spring();
        parameters.spring[0].alloy.law = (kinetics_law_t)law;
        parameters.spring[0].was_austenite = true;
        parameters.spring[0].start_c = parameters.spring[0].alloy.martensite_start_c + 3.0;
        parameters.events = 1;
        parameters.event[0] = (world_event_t){WORLD_STRESS_MPA, 0.5, 0, 60.0};
        make_world();
        for (int tick = 0; tick < 20 * TICKS_PER_S; tick++) {
            run_s(1.0 / TICKS_PER_S);
            const double most_c = fmax(world_martensite_start_c(world, 0),
                                       parameters.spring[0].alloy.martensite_start_c + 3.0);
            for (int node = 0; node < WORLD_NODES; node++) {
                TEST_ASSERT_TRUE(world_node_c(world, 0, node) < most_c + 0.01);
            }
        }
        tearDown();
    }
    world = NULL;
}

/* What a wire gives off, W, that is that much above the air, in moving air or not. */
static double given_off_w(world_convection_t convection, double rise_k, double moved)
{
    setUp();
    single_spring();
    parameters.convection = convection;
    parameters.spring[0].start_c = parameters.ambient_c + rise_k;
    parameters.events = 1;
    parameters.event[0] = (world_event_t){WORLD_LOSS_FACTOR, 0.0, 0, moved};
    make_world();
    run_s(1.0 / TICKS_PER_S);
    const double w = world_energy(world).lost_j * TICKS_PER_S;
    tearDown();
    world = NULL;
    return w;
}

TEST(both_laws_of_convection_lose_what_is_declared_where_it_is_declared)
{
    for (int law = 0; law < WORLD_CONVECTION_COUNT; law++) {
        const world_convection_t convection = (world_convection_t)law;
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.0058 * WORLD_LOSS_RISE_K,
                                  given_off_w(convection, WORLD_LOSS_RISE_K, 1.0));
        /* less for each kelvin further down */
        const double cooler_w = given_off_w(convection, 30.0, 1.0);
        TEST_ASSERT_TRUE(cooler_w < 0.95 * 0.0058 * 30.0 && cooler_w > 0.75 * 0.0058 * 30.0);
    }
    TEST_ASSERT_TRUE(fabs(given_off_w(WORLD_CONVECTION_MORGAN, 30.0, 1.0) -
                          given_off_w(WORLD_CONVECTION_CHURCHILL, 30.0, 1.0)) > 1e-3);
}

TEST(moved_air_carries_off_as_much_more_as_is_said)
{
    const double still_w = given_off_w(WORLD_CONVECTION_MORGAN, WORLD_LOSS_RISE_K, 1.0);
    const double none_w = given_off_w(WORLD_CONVECTION_MORGAN, WORLD_LOSS_RISE_K, 0.0);
    for (int law = 0; law < WORLD_CONVECTION_COUNT; law++) {
        const world_convection_t convection = (world_convection_t)law;
        for (double moved = 0.5; moved < 2.0; moved += 0.25) {
            TEST_ASSERT_DOUBLE_WITHIN(1e-6, none_w + moved * (still_w - none_w),
                                      given_off_w(convection, WORLD_LOSS_RISE_K, moved));
        }
    }
    /* in a draught what rises of itself matters less */
    const double churchill = given_off_w(WORLD_CONVECTION_CHURCHILL, 30.0, 1.6) /
                             given_off_w(WORLD_CONVECTION_CHURCHILL, 30.0, 1.0);
    const double morgan = given_off_w(WORLD_CONVECTION_MORGAN, 30.0, 1.6) /
                          given_off_w(WORLD_CONVECTION_MORGAN, 30.0, 1.0);
    TEST_ASSERT_TRUE(churchill > morgan);
}

/* Without any loss, the heat that leads from 20 degC martensite to 110 degC austenite is known. */
TEST(transforming_takes_the_latent_heat)
{
    single_spring();
    parameters.spring[0].loss_w_per_k = 0.0;
    parameters.spring[0].crimp_w_per_k = 0.0;
    parameters.spring[0].radiating_m2 = 0.0;
    make_world();
    outputs.duty[0] = 150;
    double supplied_j = 0.0;
    while (world_mean_c(world, 0) < 110.0 && world_time_s(world) < 100.0) {
        run_s(1.0 / TICKS_PER_S);
        supplied_j += wire_w(0.0) / TICKS_PER_S;
    }
    TEST_ASSERT_EQUAL_DOUBLE(1.0, world_austenite(world, 0));
    TEST_ASSERT_DOUBLE_WITHIN(0.02, 0.300 * (world_mean_c(world, 0) - 20.0) + 8.65, supplied_j);
}

/* Steady, below the transformation (in it the middle's higher resistance would add to this): all
 * thirds make the same heat. An end is colder by what its crimp takes, over what the difference
 * brings it: less loss of its own, and the wire, thrice, for the middle gives to both ends. */
TEST(crimped_ends_are_colder_by_what_the_crimps_take)
{
    single_spring();
    make_world();
    for (int s = 0; s < 900; s++) {
        hold_power_w(0.30);
        run_s(1.0);
    }
    double end_c = world_node_c(world, 0, 0), middle_c = world_node_c(world, 0, 1);
    double wire_w_per_k = 18.0 * 0.503e-6 / 0.0367; /* conductivity, section, length of a third */
    double third_w_per_k = wire_w(0.0) / 3.0 / (middle_c - 20.0);
    double expected_k = 0.0002 * (end_c - 20.0) / (third_w_per_k + 3.0 * wire_w_per_k);
    TEST_ASSERT_DOUBLE_WITHIN(0.1 * expected_k, expected_k, middle_c - end_c);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, end_c, world_node_c(world, 0, 2));
    TEST_ASSERT_EQUAL_DOUBLE(middle_c, world_hottest_c(world, 0));
}

TEST(a_heated_spring_warms_orthogonal_neighbours_most)
{
    make_world();
    outputs.duty[4] = 80;
    run_s(120.0);
    double side_k = world_mean_c(world, 1) - 20.0, corner_k = world_mean_c(world, 0) - 20.0;
    TEST_ASSERT_TRUE(corner_k > 1.0);
    TEST_ASSERT_TRUE(side_k > 1.2 * corner_k);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, world_mean_c(world, 1), world_mean_c(world, 7));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, world_mean_c(world, 0), world_mean_c(world, 8));
}

/* A tenth of the step changes next to nothing: heating, transforming, cooling, a minor loop. */
TEST(a_finer_step_tells_the_same)
{
    for (int law = 0; law < KINETICS_COUNT; law++) {
        double c[2][8], austenite[2][8];
        for (int fine = 0; fine < 2; fine++) {
            setUp();
            single_spring();
            parameters.spring[0].alloy.law = (kinetics_law_t)law;
            parameters.step_s = fine ? 0.002 : 0.02;
            make_world();
            const uint16_t duty[8] = {180, 180, 0, 0, 90, 150, 40, 0};
            for (int i = 0; i < 8; i++) {
                outputs.duty[0] = duty[i];
                run_s(12.0);
                c[fine][i] = world_mean_c(world, 0);
                austenite[fine][i] = world_austenite(world, 0);
            }
            tearDown();
            world = NULL;
        }
        for (int i = 0; i < 8; i++) {
            TEST_ASSERT_DOUBLE_WITHIN(0.05, c[1][i], c[0][i]);
            TEST_ASSERT_DOUBLE_WITHIN(0.003, austenite[1][i], austenite[0][i]);
        }
    }
}

static const alloy_t declared = {KINETICS_COSINE, 68.0, 78.0, 88.0, 98.0};

static grain_t grain_after(kinetics_law_t law, const double path_c[], int points)
{
    alloy_t alloy = declared;
    alloy.law = law;
    grain_t grain;
    grain_start(&grain, &alloy, path_c[0], false);
    for (int i = 1; i < points; i++) { /* in steps, as heat comes */
        for (int s = 1; s <= 100; s++) {
            double c = path_c[i - 1] + (path_c[i] - path_c[i - 1]) * s / 100.0;
            grain_move(&grain, &alloy, c, c);
        }
    }
    return grain;
}

static double austenite_after(kinetics_law_t law, const double path_c[], int points)
{
    return grain_after(law, path_c, points).austenite;
}

/* What is left half way: cosine and the relays' distribution 1/2, a line 1/2, 1 % to the power 1/2.
 * A heating that is interrupted goes on where it was; nothing moves between the branches. */
TEST(each_law_has_its_own_major_loop_and_rests_between_its_branches)
{
    const double full = 1.0 - pow(0.01, 3.2); /* of an exponential at 120 degC */
    const struct {
        double path_c[4];
        int points;
        double straight, tails; /* cosine, line and relays; an exponential */
    } table[] = {
        {{20, 88}, 2, 0.0, 0.0},
        {{20, 93}, 2, 0.5, 0.9},
        {{20, 98}, 2, 1.0, 0.99},
        {{20, 120, 78}, 3, 1.0, full},
        {{20, 120, 73}, 3, 0.5, 0.1 * full},
        {{20, 120, 68}, 3, 0.0, 0.01 * full},
        {{20, 93, 80}, 3, 0.5, 0.9},
        {{20, 93, 80, 93}, 4, 0.5, 0.9},
    };
    for (int law = 0; law <= KINETICS_PREISACH; law++) {
        for (size_t n = 0; n < ROWS(table); n++) {
            TEST_ASSERT_DOUBLE_WITHIN(
                1e-9, law == KINETICS_EXPONENTIAL ? table[n].tails : table[n].straight,
                austenite_after((kinetics_law_t)law, table[n].path_c, table[n].points));
        }
    }
    const double quarter[] = {20, 90.5}, straight[] = {20, 95}, paused[] = {20, 93, 80, 95};
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.25, austenite_after(KINETICS_LINEAR, quarter, 2));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.146446609, austenite_after(KINETICS_COSINE, quarter, 2));
    for (int law = 0; law < KINETICS_COUNT; law++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, austenite_after((kinetics_law_t)law, straight, 2),
                                  austenite_after((kinetics_law_t)law, paused, 4));
    }
    /* a play: steeper than straight, and not at all between; 1 % is left at its ends */
    const double there[] = {20, 93}, between[] = {20, 93, 79}, end[] = {20, 98};
    TEST_ASSERT_TRUE(grain_after(KINETICS_PLAY, there, 2).latent_per_k > 0.2);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5, austenite_after(KINETICS_PLAY, there, 2));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5, austenite_after(KINETICS_PLAY, between, 3));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, grain_after(KINETICS_PLAY, between, 3).latent_per_k);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, 0.99, austenite_after(KINETICS_PLAY, end, 2));
}

/* Return-point memory: loops within loops come back to where they left, and a wider swing forgets
 * them. Phase between the turning points differs, or the loop would be empty. */
TEST(minor_loops_close_in_preisach)
{
    const double outer[] = {20, 120, 72}, loop[] = {20, 120, 72, 94, 72};
    const double nested[] = {20, 120, 72, 94, 74, 92, 74, 94, 72};
    const double deeper[] = {20, 120, 70}, wiped[] = {20, 120, 72, 94, 74, 92, 70};
    const double at_94[] = {20, 120, 72, 94}, at_92[] = {20, 120, 72, 94, 74, 92};
    double start = austenite_after(KINETICS_PREISACH, outer, 3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, start, austenite_after(KINETICS_PREISACH, loop, 5));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, start, austenite_after(KINETICS_PREISACH, nested, 9));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, austenite_after(KINETICS_PREISACH, deeper, 3),
                              austenite_after(KINETICS_PREISACH, wiped, 7));
    TEST_ASSERT_TRUE(austenite_after(KINETICS_PREISACH, at_94, 4) > start + 0.2);
    TEST_ASSERT_TRUE(fabs(austenite_after(KINETICS_PREISACH, at_94, 4) -
                          austenite_after(KINETICS_PREISACH, at_92, 6)) > 0.01);
}

TEST(the_r_phase_comes_on_cooling_only)
{
    const double heating[] = {20, 93}, cooling[] = {20, 120, 68}, cold[] = {20, 120, 50};
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0, grain_after(KINETICS_R_PHASE, heating, 2).r_phase);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1.0, grain_after(KINETICS_R_PHASE, cooling, 3).r_phase);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.7, grain_after(KINETICS_R_PHASE, cooling, 3).latent);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0, grain_after(KINETICS_R_PHASE, cold, 3).r_phase);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0, grain_after(KINETICS_R_PHASE, cold, 3).latent);
    /* its own hysteresis: 3 K back brings no austenite, 6 K does */
    const double back_3[] = {20, 120, 70, 73}, back_6[] = {20, 120, 70, 76},
                 at_70[] = {20, 120, 70};
    double at = austenite_after(KINETICS_R_PHASE, at_70, 3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, at, austenite_after(KINETICS_R_PHASE, back_3, 4));
    TEST_ASSERT_TRUE(austenite_after(KINETICS_R_PHASE, back_6, 4) > at + 0.01);
}

TEST(resistance_peaks_on_cooling_through_the_r_phase)
{
    single_spring();
    parameters.spring[0].alloy.law = KINETICS_R_PHASE;
    make_world();
    outputs.duty[0] = 180;
    double most_heating = 0.0, most_cooling = 0.0;
    for (int tick = 0; tick < 40 * TICKS_PER_S && world_mean_c(world, 0) < 110.0; tick++) {
        run_s(1.0 / TICKS_PER_S);
        most_heating = fmax(most_heating, world_resistance_ohm(world, 0));
    }
    outputs.duty[0] = 0;
    for (int tick = 0; tick < 300 * TICKS_PER_S; tick++) {
        run_s(1.0 / TICKS_PER_S);
        most_cooling = fmax(most_cooling, world_resistance_ohm(world, 0));
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.219, most_heating);
    TEST_ASSERT_DOUBLE_WITHIN(0.003, 0.245, most_cooling);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.175, world_resistance_ohm(world, 0));
}

TEST(resistance_follows_each_phases_own_coefficient)
{
    single_spring();
    parameters.spring[0].martensite_per_k = 0.0010;
    parameters.spring[0].austenite_per_k = 0.0004;
    parameters.spring[0].contact_ohm = 0.005;
    parameters.spring[0].start_c = 70.0;
    make_world();
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.005 + 0.175 * 1.05, world_resistance_ohm(world, 0));
    parameters.spring[0].was_austenite = true;
    parameters.spring[0].start_c = 100.0;
    make_world();
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.005 + 0.219 * 1.032, world_resistance_ohm(world, 0));
}

/* 81 MPa: heating needs 10 K more, cooling begins 10.8 K sooner. */
TEST(stress_shifts_heating_and_cooling_by_their_own)
{
    single_spring();
    parameters.spring[0].start_c = 85.0;
    parameters.spring[0].was_austenite = true;
    parameters.events = 1;
    parameters.event[0] = (world_event_t){WORLD_STRESS_MPA, 1.0, 0, 81.0};
    make_world();
    TEST_ASSERT_EQUAL_DOUBLE(78.0, world_martensite_start_c(world, 0));
    run_s(0.9);
    double before_c = world_mean_c(world, 0);
    TEST_ASSERT_EQUAL_DOUBLE(1.0, world_austenite(world, 0));
    run_s(2.1);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 88.8, world_martensite_start_c(world, 0));
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 98.0, world_austenite_start_c(world, 0));
    /* what falls to martensite gives its latent heat back, until the rest may stay */
    TEST_ASSERT_TRUE(world_austenite(world, 0) < 0.98);
    TEST_ASSERT_TRUE(world_mean_c(world, 0) > before_c + 1.0);
}

TEST(the_sensor_reads_whole_steps_of_what_flowed_in_the_tick)
{
    single_spring();
    parameters.spring[0].sensor = (ina219_t){.current_gain = 1.0, .voltage_gain = 1.0};
    make_world();
    for (uint16_t duty = 0; duty <= 200; duty = (uint16_t)(duty + 7)) {
        outputs.duty[0] = duty;
        run_s(1.0 / TICKS_PER_S);
        TEST_ASSERT_EQUAL(CONTROLLER_SENSOR_OK, inputs.sensor[0].status);
        TEST_ASSERT_EQUAL_INT(0, inputs.sensor[0].voltage_mv % 4);
        double a = parameters.supply_v * duty / 800.0 / (world_resistance_ohm(world, 0) + 0.18);
        TEST_ASSERT_DOUBLE_WITHIN(a < 3.2 ? 1.0 : 1e9, 1000.0 * a, inputs.sensor[0].current_ma);
        TEST_ASSERT_DOUBLE_WITHIN(2.6, 1000.0 * a * world_resistance_ohm(world, 0),
                                  inputs.sensor[0].voltage_mv);
    }
    outputs.duty[0] = 800;
    run_s(1.0 / TICKS_PER_S);
    TEST_ASSERT_EQUAL_INT(3200, inputs.sensor[0].current_ma); /* full scale */
}

TEST(a_sensor_has_gain_offset_and_noise)
{
    ina219_t sensor = {1.03, 0.97, 0.005, -0.008, 0.0, 0.0, 0.0, 0.0, false, false};
    random_t random = random_seeded(3, 4);
    int16_t ma = 0, mv = 0;
    ina219_read(&sensor, &random, 1.0, 0.4, &ma, &mv);
    TEST_ASSERT_EQUAL_INT(1035, ma);
    TEST_ASSERT_EQUAL_INT(380, mv);
    sensor = (ina219_t){1.0, 1.0, 0.0, 0.0, 0.01, 0.02, 0.0, 0.0, false, false};
    double sum = 0.0, squares = 0.0;
    const int readings = 20000;
    for (int i = 0; i < readings; i++) {
        ina219_read(&sensor, &random, 1.0, 0.4, &ma, &mv);
        sum += ma - 1000.0;
        squares += (mv - 400.0) * (mv - 400.0);
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.3, 0.0, sum / readings);
    TEST_ASSERT_DOUBLE_WITHIN(0.4, 20.0, sqrt(squares / readings));

    sensor = (ina219_t){1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.1, 0.0, false, false};
    double apart = 0.0;
    squares = 0.0;
    for (int i = 0; i < 10 * readings; i++) {
        const double before_mv = mv;
        ina219_read(&sensor, &random, 1.0, 1.0, &ma, &mv);
        squares += (mv - 1000.0) * (mv - 1000.0);
        apart += (mv - before_mv) * (mv - before_mv);
    }
    TEST_ASSERT_DOUBLE_WITHIN(10.0, 100.0, sqrt(squares / (10 * readings)));
    TEST_ASSERT_DOUBLE_WITHIN(3.0, 20.0, sqrt(apart / (10 * readings))); /* sqrt(2 * 0.02) */
}

TEST(a_frozen_sensor_keeps_its_last_registers_and_changes_no_other)
{
    controller_inputs_t sound;
    for (int broken = 0; broken < 4; broken++) { /* none, both registers, either */
        parameters.events = broken > 0;
        parameters.event[0] = (world_event_t){WORLD_SENSOR_FREEZE, 5.0, 2, broken - 1.0};
        make_world();
        for (int k = 0; k < 9; k++) {
            outputs.duty[k] = 60;
        }
        run_s(5.0);
        controller_sensor_t last = inputs.sensor[2];
        for (int k = 0; k < 9; k++) {
            outputs.duty[k] = 120;
        }
        run_s(5.0);
        if (!broken) {
            sound = inputs;
            TEST_ASSERT_GREATER_THAN(last.current_ma + 500, sound.sensor[2].current_ma);
            continue;
        }
        TEST_ASSERT_EQUAL_INT(broken != 3 ? last.current_ma : sound.sensor[2].current_ma,
                              inputs.sensor[2].current_ma);
        TEST_ASSERT_EQUAL_INT(broken != 2 ? last.voltage_mv : sound.sensor[2].voltage_mv,
                              inputs.sensor[2].voltage_mv);
        inputs.sensor[2] = sound.sensor[2];
        TEST_ASSERT_EQUAL_MEMORY(&sound, &inputs, sizeof inputs);
    }
}

TEST(swapped_sensors_answer_for_each_other)
{
    parameters.events = 1;
    parameters.event[0] = (world_event_t){WORLD_SENSOR_SWAP, 0.0, 3, 7.0};
    make_world();
    outputs.duty[3] = 100;
    run_s(1.0);
    TEST_ASSERT_INT_WITHIN(10, 0, inputs.sensor[3].current_ma);
    TEST_ASSERT_GREATER_THAN(1000, inputs.sensor[7].current_ma);
}

TEST(contacts_and_supply_do_as_told)
{
    single_spring();
    parameters.events = 3;
    parameters.event[0] = (world_event_t){WORLD_CONTACT_OHM, 1.0, 0, 0.02};
    parameters.event[1] = (world_event_t){WORLD_CONTACT_OHM_PER_S, 2.0, 0, 0.001};
    parameters.event[2] = (world_event_t){WORLD_SUPPLY_V, 3.0, 0, 4.0};
    make_world();
    run_s(1.5);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.195, world_resistance_ohm(world, 0));
    run_s(1.5);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.196, world_resistance_ohm(world, 0));
    outputs.duty[0] = 80;
    run_s(0.02);
    double ohm = world_resistance_ohm(world, 0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.4 / (ohm + 0.18), world_current_a(world, 0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, ohm * world_current_a(world, 0), world_voltage_v(world, 0));
}

TEST(gusts_come_and_go)
{
    parameters.gust_every_s = 20.0;
    parameters.gust_lasts_s = 10.0;
    parameters.gust_factor = 1.5;
    make_world();
    double windy_s = 0.0;
    for (int s = 0; s < 6000; s++) {
        run_s(1.0);
        windy_s += world_loss_factor(world) > 1.0;
    }
    TEST_ASSERT_DOUBLE_WITHIN(400.0, 2000.0, windy_s); /* 200 gusts: their sum +- 2 sigma */
}

TEST(a_drawing_stays_within_its_tolerance_and_uses_it)
{
    double least = 1.0, most = 1.0;
    for (uint64_t seed = 0; seed < 200; seed++) {
        world_parameters_default(&parameters);
        world_draw(&parameters, seed, 0.15);
        for (int k = 0; k < 9; k++) {
            const world_spring_t *spring = &parameters.spring[k];
            double factor = spring->heat_capacity_j_per_k / 0.300;
            least = fmin(least, factor);
            most = fmax(most, factor);
            double change = spring->austenite_ohm / spring->martensite_ohm - 1.0;
            TEST_ASSERT_DOUBLE_WITHIN(0.15 * 44.0 / 175.0 + 1e-9, 44.0 / 175.0, change);
            TEST_ASSERT_DOUBLE_WITHIN(1.5 + 1e-9, 78.0, spring->alloy.martensite_start_c);
        }
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0.86, least);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 1.14, most);
}

TEST(what_cannot_be_is_refused)
{
    parameters.step_s = 0.003; /* does not divide the tick */
    TEST_ASSERT_NULL(world_create(&parameters));
    world_parameters_default(&parameters);
    parameters.rows = 5;
    parameters.columns = 4;
    TEST_ASSERT_NULL(world_create(&parameters));
    world_parameters_default(&parameters);
    parameters.spring[8].alloy.austenite_finish_c = parameters.spring[8].alloy.austenite_start_c;
    TEST_ASSERT_NULL(world_create(&parameters));
    world_parameters_default(&parameters);
    parameters.events = WORLD_EVENTS_MAX + 1;
    TEST_ASSERT_NULL(world_create(&parameters));
}
