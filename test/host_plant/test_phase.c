/* The transformation: its outer loop, its memory, its heat, and a load on it. */
#include "plant_rig.h"

#define PI 3.141592653589793

static void lead(double t)
{
    hold(0, t);
    OK(plant_step(plant, 0.01));
}

TEST(minor_loops_by_hand)
{
    static const double path[][2] = {
        {93, 0.5},                      /* half way up */
        {80, 0.5},                      /* back above M_s: nothing happens */
        {92, 0.5},                      /* up again below the turning point: no ratchet */
        {93, 0.5},          {73, 0.25}, /* half of the austenite back */
        {80, 0.25},                     /* still nothing until A_s */
        {70, 0.0477457514}, /* 0.5 (1 - cos(0.2 pi)) / 2: on along the same cooling branch */
        {93, 0.5238728757}, /* the heating branch starts at what is left */
        {98, 1.0},          {73, 0.5},  {93, 0.75}, {78, 0.75}, {73, 0.375}, {60, 0.0},
    };
    for (size_t k = 0; k < ROWS(path); k++) {
        lead(path[k][0]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, path[k][1], plant_austenite(plant, 0));
    }
}

TEST(overlapping_bands_stay_within_the_outer_loop)
{
    set("austenite_start_c", 72.0); /* below M_s */
    on("latent_heat");
    on("resistance_phase");
    uncouple();
    random_state = 5;
    double before = 0.0;
    for (int k = 0; k < 3000; k++) {
        const double t = 60.0 + 45.0 * uniform();
        const double from = at(0);
        lead(t);
        const double fraction = plant_austenite(plant, 0);
        const double rise = t <= 72 ? 0 : t >= 98 ? 1 : 0.5 - 0.5 * cos(PI * (t - 72) / 26);
        const double fall = t <= 68 ? 0 : t >= 78 ? 1 : 0.5 - 0.5 * cos(PI * (t - 68) / 10);
        TEST_ASSERT_TRUE(fraction >= rise - 1e-12 && fraction <= fall + 1e-12);
        TEST_ASSERT_TRUE(t >= from ? fraction >= before : fraction <= before);
        before = fraction;
    }
}

TEST(turning_within_overlapping_bands_does_not_jump)
{
    set("austenite_start_c", 72.0);
    lead(120.0);
    lead(75.5);
    TEST_ASSERT_DOUBLE_WITHIN(1e-7, 0.85355339, plant_austenite(plant, 0));
    lead(75.501);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.85355339, plant_austenite(plant, 0));
    lead(75.5);
    lead(75.499);
    TEST_ASSERT_DOUBLE_WITHIN(3e-4, 0.85355339, plant_austenite(plant, 0));
}

TEST(a_logged_load_moves_them_by_so_much_a_newton)
{
    on("transformation_shift");
    set("transformation_shift_k[1]", 2.0);
    set("transformation_shift_k_per_n", 4.0);
    set("load_n[1]", 1.0); /* 6 K in all */
    lead(99.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5, plant_austenite(plant, 0));
    set("load_n[1]", 0.0); /* the load is taken off: on at once to where 2 K would be */
    OK(plant_step(plant, 0.01));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5 - 0.5 * cos(PI * 0.9), plant_austenite(plant, 0));
    hold(1, 93.0);
    OK(plant_step(plant, 0.01));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5, plant_austenite(plant, 1));
}

TEST(a_load_on_a_held_spring_leaves_its_heat_with_whatever_holds_it)
{
    uncouple();
    set("loss_w_per_k", 0.0);
    on("latent_heat");
    on("transformation_shift");
    lead(100.0);
    lead(83.0);
    const double before_j = plant_energy_input_j(plant);
    set("transformation_shift_k[1]", 10.0);
    OK(plant_step(plant, 1.0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5, plant_austenite(plant, 0));
    TEST_ASSERT_EQUAL_DOUBLE(83.0, at(0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, -0.5 * get("latent_heat_j"),
                              plant_energy_input_j(plant) - before_j);
}
