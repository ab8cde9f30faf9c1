/* What each effect does to an array, by what anyone could measure on one. The equations themselves
 * are held to a second implementation by against_scipy.py. */
#include "plant_rig.h"

/* Which effects touch the temperatures in which drive modes, and which only the picture of them. */
static void each_effect_changes_what_it_should_and_only_that(void)
{
    enum { POWER = 1, CURRENT = 2, DUTY = 4, COMMAND = 8, HEAT = 15, PICTURE = 16 };
    static const struct {
        const char *name;
        unsigned changes;
    } expected[] = {
        {"radiation", HEAT},
        {"natural_convection", HEAT},
        {"latent_heat", HEAT},
        {"resistance_phase", CURRENT | DUTY},
        {"shared_air", HEAT},
        {"plate_conduction", HEAT},
        {"fan_wake", HEAT},
        {"edge_loss", HEAT},
        {"spring_mismatch", HEAT},
        {"supply_sag", DUTY | COMMAND},
        {"ambient_drift", HEAT},
        {"sensor_lag", PICTURE},
        {"sensor_gain", PICTURE},
        {"optical_mixing", PICTURE},
        {"resistance_temperature", CURRENT | DUTY},
        {"transformation_shift", 0}, /* alone: nothing depends on the phase */
        {"contact_resistance", POWER | DUTY},
        {"fan_curve", HEAT},
    };
    static const double largest[4] = {0.8, 2.2, 0.2, 1.0};
    TEST_ASSERT_EQUAL_UINT(plant_effect_count(), sizeof expected / sizeof expected[0]);
    set("loss_scale[3]", 1.2);
    set("command_power_w", 0.8);
    set("resistance_martensite_rise_per_k", 1e-3);
    set("transformation_shift_k", 5.0);
    set("contact_ohm", 0.02);
    for (int mode = 0; mode < 4; mode++) {
        make_log((plant_drive_mode_t)mode, largest[mode], 21);
        run_log(0);
        TEST_ASSERT_EQUAL_MEMORY(shown[0], real[0], sizeof shown[0]);
        for (size_t k = 0; k < plant_effect_count(); k++) {
            const unsigned changes = expected[k].changes;
            OK(plant_set_effect(plant, expected[k].name, true));
            run_log(1);
            const double heat = largest_difference(real[0], real[1]);
            const double seen = largest_difference(shown[0], shown[1]);
            const bool hot = changes & (1u << mode), pictured = hot || changes == PICTURE;
            TEST_ASSERT_TRUE_MESSAGE(hot ? heat > 0.3 : heat == 0.0, expected[k].name);
            TEST_ASSERT_TRUE_MESSAGE(pictured ? seen > 0.3 : seen == 0.0, expected[k].name);
            OK(plant_set_effect(plant, expected[k].name, false));
        }
    }
}

static void a_hot_spring_radiates_a_seventh_of_its_loss(void)
{
    uncouple();
    hold(0, 105.0);
    settle();
    const double without = plant_power_w(plant, 0);
    on("radiation");
    settle();
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 0.082, plant_power_w(plant, 0) - without);
}

static void natural_convection_loses_less_where_it_is_cooler_and_leaves_the_fan_alone(void)
{
    uncouple();
    for (int windy = 0; windy < 2; windy++) {
        double per_k[2][2];
        OK(plant_set_fan(plant, windy));
        for (int k = 0; k < 2; k++) {
            OK(plant_set_effect(plant, "natural_convection", k));
            hold(0, 20.0 + get("convection_reference_k"));
            hold(1, 40.0);
            settle();
            per_k[k][0] = plant_power_w(plant, 0) / get("convection_reference_k");
            per_k[k][1] = plant_power_w(plant, 1) / 20.0;
        }
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, per_k[0][0], per_k[1][0]); /* there it holds */
        TEST_ASSERT_TRUE(windy ? per_k[1][1] == per_k[0][1] : per_k[1][1] < 0.8 * per_k[0][1]);
    }
}

static void heat_reaches_an_undriven_spring_through_the_air(void)
{
    uncouple();
    on("shared_air");
    drive_all(PLANT_DRIVE_POWER, 0.4);
    drive(4, PLANT_DRIVE_POWER, 0.0);
    settle();
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 3.2, get("air_exchange_w_per_k") * (plant_air_c(plant) - 20.0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, plant_air_c(plant), at(4));
}

static void a_plate_warms_the_far_corner_as_much_as_the_neighbour(void)
{
    uncouple();
    on("plate_conduction");
    drive(0, PLANT_DRIVE_POWER, 0.4);
    settle();
    TEST_ASSERT_TRUE(at(8) > 20.2 && plant_plate_c(plant) > at(8));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, at(1), at(8));
}

static void wake_turns_with_its_direction(void)
{
    static const int downstream[4] = {5, 7, 3, 1};
    uncouple();
    on("fan_wake");
    OK(plant_set_fan(plant, 1.0));
    drive(4, PLANT_DRIVE_POWER, 0.5);
    for (int direction = 0; direction < 4; direction++) {
        set("wake_direction", direction);
        plant_reset(plant);
        settle();
        const double loss = get("loss_fan_w_per_k"), hot = 0.5 / loss;
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 20.0 + hot, at(4)); /* one way: upstream feels nothing */
        for (int i = 0; i < 9; i++) {
            const double rise = i == downstream[direction] ? get("wake_w_per_k") / loss * hot : 0.0;
            if (i != 4)
                TEST_ASSERT_DOUBLE_WITHIN(1e-6, 20.0 + rise, at(i));
        }
    }
    OK(plant_set_fan(plant, 0.0));
    plant_reset(plant);
    settle();
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 20.0, at(1));
}

static void edges_lose_more_and_corners_twice_as_much_more(void)
{
    uncouple();
    on("edge_loss");
    drive_all(PLANT_DRIVE_POWER, 0.4);
    settle();
    const double e = get("edge_loss_fraction"), rise = at(4) - 20.0;
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, rise, (1.0 + e) * (at(1) - 20.0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, rise, (1.0 + 2.0 * e) * (at(0) - 20.0));
}

static void mismatch_is_of_one_spring(void)
{
    uncouple();
    on("spring_mismatch");
    set("loss_scale[3]", 1.25);
    set("resistance_scale[5]", 1.1);
    drive_all(PLANT_DRIVE_CURRENT, 1.2);
    settle();
    for (int i = 0; i < 9; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-3,
                                  (at(0) - 20.0) * (i == 2   ? 1.0 / 1.25
                                                    : i == 4 ? 1.1
                                                             : 1.0),
                                  at(i) - 20.0);
}

/* Kirchhoff: what the supply falls by is its resistance times all that is drawn from it. */
static void supply_sags_by_all_that_is_drawn(void)
{
    on("supply_sag");
    drive(0, PLANT_DRIVE_COMMAND, 0.8);
    drive(1, PLANT_DRIVE_POWER, 3.0);
    drive(2, PLANT_DRIVE_CURRENT, 2.0);
    drive(3, PLANT_DRIVE_DUTY, 0.12);
    const double v = plant_supply_v(plant), v0 = get("supply_v");
    const double loop_ohm = get("loop_resistance_ohm");
    double drawn_a = plant_power_w(plant, 0) / v + 3.0 / v;
    drawn_a += 2.0 * (plant_voltage_v(plant, 2) + 2.0 * loop_ohm) / v;
    drawn_a += 0.12 * plant_current_a(plant, 3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, v0 - get("supply_resistance_ohm") * drawn_a, v);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.12 * v,
                              plant_voltage_v(plant, 3) + plant_current_a(plant, 3) * loop_ohm);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.8 * get("command_power_w") * (v / v0) * (v / v0),
                              plant_power_w(plant, 0));
}

/* A chopped load draws all of its current while it is on: its own command costs it nothing. */
static void chopped_loads_lose_only_by_the_others(void)
{
    on("supply_sag");
    set("supply_resistance_ohm", 2.0);
    set("supply_chopped", 1.0);
    set("command_power_w[2]", 1.0);
    for (double command = 0.1; command < 1.05; command += 0.3) {
        drive(0, PLANT_DRIVE_COMMAND, command);
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5 * command, plant_power_w(plant, 0));
    }
    drive(1, PLANT_DRIVE_COMMAND, 0.6);
    drive(0, PLANT_DRIVE_COMMAND, 0.8);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.4 * (1.0 - 2.0 * 0.6 * 0.2 / 5.0), plant_power_w(plant, 0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.6 * (1.0 - 2.0 * 0.8 * 0.1 / 5.0), plant_power_w(plant, 1));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_set(plant, "supply_chopped", 0.5));
}

static void an_undriven_spring_follows_the_drift_by_its_time_constant(void)
{
    on("ambient_drift");
    set("ambient_amplitude_k", 0.0);
    set("ambient_ramp_k_per_h", 36.0);
    OK(plant_step(plant, 1000.0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 30.0, plant_ambient_c(plant));
    TEST_ASSERT_DOUBLE_WITHIN(
        1e-3, 30.0 - 0.01 * get("heat_capacity_j_per_k") / get("loss_w_per_k"), at(4));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_TIME, plant_settle(plant, 100.0));
    set("ambient_ramp_k_per_h", 0.0);
    set("ambient_amplitude_k", 3.0);
    plant_reset(plant);
    OK(plant_step(plant, 0.25 * get("ambient_period_s")));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 23.0, plant_ambient_c(plant));
}

static void sensor_lags_by_its_time_constant(void)
{
    const double tau_s = get("sensor_lag_s");
    on("sensor_lag");
    hold(0, 70.0);
    for (int k = 1; k < 20; k++) {
        OK(plant_step(plant, 1.3));
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 70.0 - 50.0 * exp(-1.3 * k / tau_s),
                                  plant_measured_c(plant, 0));
    }
    /* behind a ramp, too: a spring without loss, 1 K/s */
    uncouple();
    set("loss_w_per_k", 0.0);
    plant_reset(plant);
    drive(1, PLANT_DRIVE_POWER, get("heat_capacity_j_per_k"));
    OK(plant_step(plant, 40.0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 60.0 - tau_s * (1.0 - exp(-40.0 / tau_s)),
                              plant_measured_c(plant, 1));
}

static void sensor_gain_is_about_ambient(void)
{
    on("sensor_gain");
    set("sensor_gain[1]", 0.9);
    set("sensor_offset_k[1]", 0.7);
    hold(0, 70.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 20.0 + 45.0 + 0.7, plant_measured_c(plant, 0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 20.0, plant_measured_c(plant, 1));
}

/* A spring's steady rise at a fixed power tells its loss. */
static double loss_with_fan(double fan)
{
    OK(plant_set_fan(plant, fan));
    settle();
    return plant_power_w(plant, 0) / (at(0) - 20.0);
}

static void half_a_fan_gives_its_part_of_the_cooling(void)
{
    uncouple();
    drive(0, PLANT_DRIVE_POWER, 0.3);
    const double still = get("loss_w_per_k"), blown = get("loss_fan_w_per_k");
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.5 * (still + blown), loss_with_fan(0.5));
    on("fan_curve");
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, still + 0.735 * (blown - still), loss_with_fan(0.5));
    set("fan_half_share", 0.3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, still + 0.3 * (blown - still), loss_with_fan(0.5));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, still, loss_with_fan(0.0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, blown, loss_with_fan(1.0));
    double before = still;
    for (int k = 1; k <= 20; k++) {
        const double now = loss_with_fan(0.05 * k);
        TEST_ASSERT_TRUE(now > before);
        before = now;
    }
}

static void a_pixel_sees_its_neighbours(void)
{
    on("optical_mixing");
    set("optical_share", 0.2);
    set("optical_width", 0.1); /* so narrow that only the nearest count: a quarter each */
    set("optical_beyond", 0.0);
    for (int i = 0; i < 9; i++)
        hold(i, i == 4 ? 50.0 : 105.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 50.0 + 55.0 * 0.2, plant_measured_c(plant, 4));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 105.0 - 55.0 * 0.05, plant_measured_c(plant, 1));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 105.0, plant_measured_c(plant, 0));
    set("optical_beyond", 1.0); /* of 20 degC: one side at spring 2, two at spring 1 */
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 50.0 + 55.0 * 0.2, plant_measured_c(plant, 4));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 105.0 - 55.0 * 0.05 - 85.0 * 0.05, plant_measured_c(plant, 1));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 105.0 - 85.0 * 0.1, plant_measured_c(plant, 0));
    set("optical_background", 0.1);
    set("optical_background_rise_k", 5.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.9 * (50.0 + 55.0 * 0.2) + 2.5, plant_measured_c(plant, 4));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 50.0, at(4));
}

/* Spring 1 alone is warmer: what the others show above the ambient is what they see of it. */
static void a_camera_blurs_as_its_point_spread_falls(void)
{
    on("optical_mixing");
    hold(0, 120.0);
    for (int i = 1; i < 9; i++)
        hold(i, 20.0);
    const double shapes[] = {1.0, 2.0, 6.0};
    for (int k = 0; k < 3; k++) {
        set("optical_width", 1.3);
        set("optical_shape", shapes[k]);
        set("optical_share", 0.6);
        const double side = plant_measured_c(plant, 1) - 20.0;
        const double corner = plant_measured_c(plant, 4) - 20.0;
        const double far = plant_measured_c(plant, 8) - 20.0;
        const double one = pow(1.0 / 1.3, shapes[k]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, exp(one - pow(sqrt(2.0) / 1.3, shapes[k])), corner / side);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, exp(one - pow(sqrt(8.0) / 1.3, shapes[k])), far / side);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 40.0, plant_measured_c(plant, 0) - 20.0);
        set("optical_share", 0.3); /* the same picture, half of it */
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5 * side, plant_measured_c(plant, 1) - 20.0);
    }
}

static void resistance_follows_phase_and_each_phase_its_temperature(void)
{
    on("resistance_phase");
    const double martensite = get("resistance_martensite_ohm");
    const double austenite = get("resistance_austenite_ohm");
    TEST_ASSERT_EQUAL_DOUBLE(martensite, plant_resistance_ohm(plant, 0));
    hold(0, 93.0); /* half way */
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5 * (martensite + austenite),
                              plant_resistance_ohm(plant, 0));
    on("resistance_temperature");
    set("resistance_martensite_rise_per_k", 0.0012);
    set("resistance_austenite_rise_per_k", -0.0003);
    hold(1, 70.0);
    hold(2, 120.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.5 * (1.0876 * martensite + 0.9781 * austenite),
                              plant_resistance_ohm(plant, 0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1.06 * martensite, plant_resistance_ohm(plant, 1));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.97 * austenite, plant_resistance_ohm(plant, 2));
    TEST_ASSERT_EQUAL_DOUBLE(martensite, plant_resistance_ohm(plant, 3));
}

/* A sensor at the terminals sees the contact; the spring does not feel it. */
static void a_contact_takes_voltage_and_keeps_its_heat(void)
{
    uncouple();
    on("contact_resistance");
    set("contact_ohm[1]", 0.03);
    drive(0, PLANT_DRIVE_CURRENT, 1.2);
    drive(1, PLANT_DRIVE_CURRENT, 1.2);
    settle();
    TEST_ASSERT_EQUAL_DOUBLE(at(1), at(0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1.2 * 0.03,
                              plant_voltage_v(plant, 0) - plant_voltage_v(plant, 1));
    /* driven by what is measured at the terminals, less than that heats it */
    const double measured_w = 1.2 * plant_voltage_v(plant, 0);
    drive(0, PLANT_DRIVE_POWER, measured_w);
    settle();
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, at(1), at(0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1.2, plant_current_a(plant, 0));
    /* a stage gives less current through it, from the moment it appears */
    drive(0, PLANT_DRIVE_DUTY, 0.1);
    drive(1, PLANT_DRIVE_DUTY, 0.1);
    TEST_ASSERT_TRUE(plant_current_a(plant, 0) < 0.95 * plant_current_a(plant, 1));
    set("contact_ohm[1]", 0.0);
    OK(plant_step(plant, 0.02));
    TEST_ASSERT_EQUAL_DOUBLE(plant_current_a(plant, 1), plant_current_a(plant, 0));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(each_effect_changes_what_it_should_and_only_that);
    RUN_TEST(a_hot_spring_radiates_a_seventh_of_its_loss);
    RUN_TEST(natural_convection_loses_less_where_it_is_cooler_and_leaves_the_fan_alone);
    RUN_TEST(heat_reaches_an_undriven_spring_through_the_air);
    RUN_TEST(a_plate_warms_the_far_corner_as_much_as_the_neighbour);
    RUN_TEST(wake_turns_with_its_direction);
    RUN_TEST(edges_lose_more_and_corners_twice_as_much_more);
    RUN_TEST(mismatch_is_of_one_spring);
    RUN_TEST(supply_sags_by_all_that_is_drawn);
    RUN_TEST(chopped_loads_lose_only_by_the_others);
    RUN_TEST(an_undriven_spring_follows_the_drift_by_its_time_constant);
    RUN_TEST(sensor_lags_by_its_time_constant);
    RUN_TEST(sensor_gain_is_about_ambient);
    RUN_TEST(half_a_fan_gives_its_part_of_the_cooling);
    RUN_TEST(a_pixel_sees_its_neighbours);
    RUN_TEST(a_camera_blurs_as_its_point_spread_falls);
    RUN_TEST(resistance_follows_phase_and_each_phase_its_temperature);
    RUN_TEST(a_contact_takes_voltage_and_keeps_its_heat);
    return UNITY_END();
}
