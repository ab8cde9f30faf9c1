/* Equations and what each effect touches are held to a second implementation by against_scipy.py;
 * here is what that does not look at. */
#include "convection.h"
#include "plant_rig.h"

/* A sensor at the terminals sees the contact; the spring does not feel it. */
TEST(a_contact_takes_voltage_and_keeps_its_heat)
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

TEST(correlations_against_the_table)
{
    /* Incropera and DeWitt, table A.4 */
    TEST_ASSERT_DOUBLE_WITHIN(0.005 * 20.92e-6, 20.92e-6, convection_air_viscosity_m2_per_s(350));
    TEST_ASSERT_DOUBLE_WITHIN(0.005 * 26.41e-6, 26.41e-6, convection_air_viscosity_m2_per_s(400));
    TEST_ASSERT_DOUBLE_WITHIN(0.005 * 30.0e-3, 30.0e-3, convection_air_conductivity_w_per_mk(350));
    /* worked out by hand at a film of 62.5 degC: nu 19.4e-6, k 29.1e-3, Ra 2.37 */
    TEST_ASSERT_DOUBLE_WITHIN(0.3, 34.1, convection_natural_w_per_m2k(8e-4, 105, 20));
    /* Re 25.9, Nu 2.76 */
    TEST_ASSERT_DOUBLE_WITHIN(0.8, 100.3, convection_forced_w_per_m2k(8e-4, 0.63, 105, 20));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, convection_forced_w_per_m2k(8e-4, 0.0, 105, 20));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 10.0, convection_mixed(10.0, 0.0));

    uncouple();
    on("natural_convection");
    set("convection_correlation", 1);
    hold(0, 105.0);
    settle();
    TEST_ASSERT_DOUBLE_WITHIN(0.1e-3 * 85, 5.8e-3 * 85, plant_power_w(plant, 0));
    OK(plant_set_fan(plant, 1.0));
    settle();
    TEST_ASSERT_DOUBLE_WITHIN(0.2e-3 * 85, 11.3e-3 * 85, plant_power_w(plant, 0));
}
