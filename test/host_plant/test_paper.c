/* The paper's display and what NiTi makes of it: figures of docs/physics.md. */
#include "paper.h"
#include "plant_rig.h"

TEST(balance_of_design_section_1)
{
    /* 1.5 A in austenite, 0.219 ohm, against 5.8 mW/K: 105 degC, time constant 52 s */
    set("resistance_ohm", 0.219);
    for (int i = 0; i < 9; i++)
        drive(i, PLANT_DRIVE_CURRENT, 1.5);
    settle();
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 105.0, at(4));
    /* the fan's 11.3 mW/K at the same current: far from 105 */
    OK(plant_set_fan(plant, 1.0));
    settle();
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 20.0 + 2.25 * 0.219 / 0.0113, at(4));
    TEST_ASSERT_TRUE(at(4) < 64.0);
}

TEST(constant_current_from_cold_never_transforms_at_1_5_a_but_runs_past_at_a_little_more)
{
    on("latent_heat");
    on("resistance_phase");
    drive(0, PLANT_DRIVE_CURRENT, 1.5); /* one corner alone: its neighbours cool it */
    settle();
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 75.0, at(0));
    for (int i = 0; i < 9; i++)
        if (i != 4)
            drive(i, PLANT_DRIVE_CURRENT, 1.5);
    settle();
    TEST_ASSERT_DOUBLE_WITHIN(1.0, 85.0, at(0));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, plant_austenite(plant, 0));
    drive(4, PLANT_DRIVE_CURRENT, 1.5);
    settle();
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 87.9, at(0)); /* 0.394 W / 5.8 mW/K, all alike */
    for (int i = 0; i < 9; i++)
        drive(i, PLANT_DRIVE_CURRENT, 1.53);
    settle();
    TEST_ASSERT_EQUAL_DOUBLE(1.0, plant_austenite(plant, 0));
    TEST_ASSERT_TRUE(at(0) > 108.0);
}

TEST(no_current_holds_a_spring_within_the_transformation)
{
    /* dP/dT beats the loss there: steady states exist only (nearly) all martensite or all austenite
     */
    uncouple();
    on("resistance_phase");
    on("latent_heat");
    for (double current = 1.40; current < 1.60; current += 0.005) {
        drive(0, PLANT_DRIVE_CURRENT, current);
        plant_reset(plant);
        settle();
        TEST_ASSERT_TRUE(plant_austenite(plant, 0) < 0.2 || plant_austenite(plant, 0) > 0.8);
    }
    /* the opposite sign is stable: some current leaves it in between */
    set("resistance_martensite_ohm", 0.219);
    set("resistance_austenite_ohm", 0.175);
    int between = 0;
    for (double current = 1.40; current < 1.60; current += 0.005) {
        drive(0, PLANT_DRIVE_CURRENT, current);
        plant_reset(plant);
        settle();
        between += plant_austenite(plant, 0) > 0.3 && plant_austenite(plant, 0) < 0.7;
    }
    TEST_ASSERT_TRUE(between > 3);
}

TEST(holding_above_martensite_start_saves_a_quarter)
{
    uncouple();
    hold(0, 105.0);
    settle();
    const double hot = plant_power_w(plant, 0);
    hold(0, 80.0);
    settle();
    TEST_ASSERT_EQUAL_DOUBLE(1.0, plant_austenite(plant, 0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 60.0 / 85.0, plant_power_w(plant, 0) / hot); /* -29 % */
}

TEST(six_paper_conditions_within_1_5_degrees)
{
    double squares[2] = {0.0, 0.0};
    for (int k = 0; k < PAPER_CASE_COUNT; k++) {
        double centre;
        OK(paper_centre_c(plant, &paper_cases[k], &centre));
        const double error = centre - paper_cases[k].t_centre_c;
        if (k < 6)
            TEST_ASSERT_DOUBLE_WITHIN(1.5, 0.0, error);
        squares[k / 6] += error * error;
        /* by hand: 6 G_orth (hot - T) = loss (T - 20) */
        const double g = 6.0 * paper_orthogonal_w_per_k(paper_cases[k].pitch_mm);
        const double loss = paper_loss_w_per_k(paper_cases[k].fan);
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, (g * paper_cases[k].t_hot_c + loss * 20.0) / (g + loss),
                                  centre);
    }
    TEST_ASSERT_TRUE(sqrt(squares[0] / 6) < 0.6);
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 15.55, sqrt(squares[1] / 6)); /* not tuned away */
    plant_t *small = plant_create(1, 2);
    double centre;
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_SIZE, paper_centre_c(small, &paper_cases[0], &centre));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, paper_configure(plant, (double)NAN));
    plant_destroy(small);
}
