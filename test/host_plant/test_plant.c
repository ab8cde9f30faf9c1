#include <math.h>
#include <string.h>
#include <unity.h>

#include "convection.h"
#include "electrics.h"
#include "paper.h"
#include "plant.h"

#define PI 3.141592653589793

static plant_t *plant;

void setUp(void)
{
    plant = plant_create(3, 3);
}
void tearDown(void)
{
    plant_destroy(plant);
}

#define OK(call) TEST_ASSERT_EQUAL_INT(PLANT_OK, (call))

static void set(const char *name, double value)
{
    OK(plant_set(plant, name, value));
}
static void on(const char *effect)
{
    OK(plant_set_effect(plant, effect, true));
}
static double at(int spring)
{
    return plant_temperature_c(plant, spring);
}
static void drive(int spring, plant_drive_mode_t mode, double quantity)
{
    OK(plant_drive(plant, spring, mode, quantity));
}
static void hold(int spring, double t)
{
    drive(spring, PLANT_DRIVE_TEMPERATURE, t);
}
static void settle(void)
{
    OK(plant_settle(plant, 1e6));
}

static void uncouple(void)
{
    set("orthogonal_w_per_k", 0);
    set("orthogonal_fan_w_per_k", 0);
    set("diagonal_w_per_k", 0);
    set("diagonal_fan_w_per_k", 0);
}

static unsigned random_state;
static double uniform(void) /* the same numbers everywhere */
{
    random_state = random_state * 1664525u + 1013904223u;
    return (double)(random_state >> 8) / 16777216.0;
}

#define ROWS 600
static double log_time[ROWS], log_drive[ROWS * 9], log_fan[ROWS], log_ambient[ROWS];
static double shown[2][ROWS * 9], real[2][ROWS * 9];
static plant_drive_mode_t log_mode[9];

static void make_log(plant_drive_mode_t mode, double largest, unsigned seed)
{
    random_state = seed;
    for (int r = 0; r < ROWS; r++) {
        log_time[r] = r;
        log_fan[r] = r < 300 ? 0.0 : 0.7;
        log_ambient[r] = 20.0;
        for (int i = 0; i < 9; i++)
            log_drive[r * 9 + i] =
                r % 40 ? log_drive[(r - 1) * 9 + i] : (uniform() < 0.4 ? 0.0 : largest * uniform());
    }
    for (int i = 0; i < 9; i++)
        log_mode[i] = mode;
}

static void run_log(int k)
{
    plant_reset(plant);
    OK(plant_simulate(plant, ROWS, log_time, log_mode, log_drive, log_fan, log_ambient, shown[k],
                      real[k]));
}

static double largest_difference(const double *a, const double *b)
{
    double largest = 0.0;
    for (int k = 0; k < ROWS * 9; k++)
        largest = fmax(largest, fabs(a[k] - b[k]));
    return largest;
}

/* ------------------------------------------------------------ what is known in closed form */

static void single_spring_follows_the_exponential(void)
{
    uncouple();
    drive(4, PLANT_DRIVE_POWER, 0.493);
    for (int k = 1; k <= 30; k++) {
        OK(plant_step(plant, 7.0));
        const double t = 20.0 + 0.493 / 0.0058 * (1.0 - exp(-7.0 * k * 0.0058 / 0.300));
        TEST_ASSERT_DOUBLE_WITHIN(2e-3, t, at(4));
        TEST_ASSERT_DOUBLE_WITHIN(1e-12, 20.0, at(0));
    }
}

static void balance_of_design_section_1(void)
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

static void
constant_current_from_cold_never_transforms_at_1_5_a_but_runs_past_at_a_little_more(void)
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

static void no_current_holds_a_spring_within_the_transformation(void)
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

static void holding_above_martensite_start_saves_a_quarter(void)
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

static void six_paper_conditions_within_1_5_degrees(void)
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

/* ------------------------------------------------------------ energy, symmetry, accuracy */

static void energy_closes_in_every_combination_of_effects(void)
{
    const size_t effects = plant_effect_count();
    TEST_ASSERT_EQUAL_INT(14, (int)effects);
    make_log(PLANT_DRIVE_CURRENT, 2.6, 11);
    log_mode[1] = PLANT_DRIVE_DUTY;
    log_mode[2] = PLANT_DRIVE_COMMAND;
    log_mode[3] = PLANT_DRIVE_TEMPERATURE;
    log_mode[4] = PLANT_DRIVE_POWER;
    for (int r = 0; r < ROWS; r++) {
        log_drive[r * 9 + 1] *= 0.1;
        log_drive[r * 9 + 2] *= 0.35;
        log_drive[r * 9 + 3] = 40.0 + 25.0 * log_drive[r * 9 + 3];
        log_drive[r * 9 + 4] *= 0.3;
        log_fan[r] = r < 50 ? 0.0 : 0.7;
    }
    set("latent_cooling_ratio", 0.336);
    set("loss_scale[2]", 1.3);
    double worst = 0.0;
    int transformed = 0;
    for (unsigned mask = 0; mask < 1u << effects; mask++) {
        for (size_t k = 0; k < effects; k++)
            OK(plant_set_effect_index(plant, k, (mask >> k) & 1u));
        plant_reset(plant);
        OK(plant_simulate(plant, 130, log_time, log_mode, log_drive, log_fan, NULL, NULL, NULL));
        worst = fmax(worst, fabs(plant_energy_balance_j(plant)) / plant_energy_input_j(plant));
        TEST_ASSERT_TRUE(plant_energy_input_j(plant) > 10.0);
        for (int i = 0; i < 9; i++)
            transformed += plant_austenite(plant, i) > 0.0;
    }
    TEST_ASSERT_TRUE(transformed > 10000);
    TEST_ASSERT_TRUE_MESSAGE(worst < 1e-9, "energy balance");
}

static void rotating_the_pattern_rotates_the_temperatures(void)
{
    static const int turned[9] = {6, 3, 0, 7, 4, 1, 8, 5, 2};
    static const char *const isotropic[] = {
        "radiation",        "natural_convection", "latent_heat", "resistance_phase", "shared_air",
        "plate_conduction", "edge_loss",          "supply_sag",  "optical_mixing",   "sensor_lag"};
    for (size_t k = 0; k < sizeof isotropic / sizeof isotropic[0]; k++)
        on(isotropic[k]);
    make_log(PLANT_DRIVE_CURRENT, 2.2, 3);
    run_log(0);
    static double rotated[ROWS * 9];
    for (int r = 0; r < ROWS; r++)
        for (int i = 0; i < 9; i++)
            rotated[r * 9 + turned[i]] = log_drive[r * 9 + i];
    memcpy(log_drive, rotated, sizeof rotated);
    run_log(1);
    for (int r = 0; r < ROWS; r++)
        for (int i = 0; i < 9; i++) {
            TEST_ASSERT_DOUBLE_WITHIN(1e-9, real[0][r * 9 + i], real[1][r * 9 + turned[i]]);
            TEST_ASSERT_DOUBLE_WITHIN(1e-9, shown[0][r * 9 + i], shown[1][r * 9 + turned[i]]);
        }
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
        const double hot = 0.5 / 0.0113;
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 20.0 + hot, at(4)); /* one way: upstream feels nothing */
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 20.0 + hot * 0.001 / 0.0113, at(downstream[direction]));
        for (int i = 0; i < 9; i++)
            if (i != 4 && i != downstream[direction])
                TEST_ASSERT_DOUBLE_WITHIN(1e-9, 20.0, at(i));
    }
    OK(plant_set_fan(plant, 0.0));
    plant_reset(plant);
    settle();
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 20.0, at(1));
}

static void default_tolerance_is_within_a_hundredth_of_a_degree(void)
{
    for (int kind = 0; kind < 4; kind++) {
        for (size_t k = 0; k < plant_effect_count(); k++)
            OK(plant_set_effect_index(plant, k,
                                      kind == 3 || (kind > 0 && k == 2) || (kind > 1 && k == 3)));
        make_log(PLANT_DRIVE_CURRENT, 2.4, 17u + (unsigned)kind);
        set("integration_tolerance_c", 1e-3);
        run_log(0);
        set("integration_tolerance_c", 1e-8);
        run_log(1);
        double top = 0.0;
        for (int k = 0; k < ROWS * 9; k++)
            top = fmax(top, real[1][k]);
        TEST_ASSERT_TRUE(top > 100.0); /* the transformation took part */
        TEST_ASSERT_TRUE(largest_difference(real[0], real[1]) < 0.01);
        TEST_ASSERT_TRUE(largest_difference(shown[0], shown[1]) < 0.01);
    }
}

static void long_steps_are_as_good_as_short_ones(void)
{
    on("latent_heat");
    drive(0, PLANT_DRIVE_POWER, 0.6);
    plant_t *fine = plant_copy(plant);
    OK(plant_step(plant, 100.0));
    for (int k = 0; k < 5000; k++)
        OK(plant_step(fine, 0.02));
    for (int i = 0; i < 9; i++)
        TEST_ASSERT_DOUBLE_WITHIN(0.01, plant_temperature_c(fine, i), at(i));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 100.0, plant_time_s(fine));
    plant_destroy(fine);
}

static void tolerance_governs_the_error(void)
{
    double error[2];
    on("latent_heat");
    for (int i = 0; i < 9; i++)
        drive(i, PLANT_DRIVE_POWER, 0.1 * i);
    for (int k = 0; k < 2; k++) {
        plant_t *fine = plant_copy(plant);
        plant_t *coarse = plant_copy(plant);
        OK(plant_set(fine, "integration_tolerance_c", 1e-9));
        OK(plant_set(coarse, "integration_tolerance_c", k ? 1e-6 : 1e-3));
        OK(plant_step(fine, 90.0));
        OK(plant_step(coarse, 90.0));
        error[k] = 0.0;
        for (int i = 0; i < 9; i++)
            error[k] =
                fmax(error[k], fabs(plant_temperature_c(fine, i) - plant_temperature_c(coarse, i)));
        plant_destroy(fine);
        plant_destroy(coarse);
    }
    TEST_ASSERT_TRUE(error[0] < 1e-2);
    TEST_ASSERT_TRUE(error[1] < 1e-5);
}

/* ------------------------------------------------------------ kinetics */

static void lead(double t)
{
    hold(0, t);
    OK(plant_step(plant, 0.01));
}

static void outer_loop_is_liang_and_rogers_cosine(void)
{
    const double up[][2] = {
        {87, 0}, {90.5, 0.5 - 0.35355339}, {93, 0.5}, {95.5, 0.85355339}, {98, 1}, {120, 1}};
    const double down[][2] = {{98, 1}, {79, 1}, {75.5, 0.85355339}, {73, 0.5}, {68, 0}, {20, 0}};
    for (int k = 0; k < 6; k++) {
        lead(up[k][0]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-7, up[k][1], plant_austenite(plant, 0));
    }
    for (int k = 0; k < 6; k++) {
        lead(down[k][0]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-7, down[k][1], plant_austenite(plant, 0));
    }
}

static void minor_loops_by_hand(void)
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
    for (size_t k = 0; k < sizeof path / sizeof path[0]; k++) {
        lead(path[k][0]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, path[k][1], plant_austenite(plant, 0));
    }
}

static void overlapping_bands_stay_within_the_outer_loop(void)
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

static void turning_within_overlapping_bands_does_not_jump(void)
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

static void latent_heat_delays_by_its_energy_and_changes_no_steady_state(void)
{
    uncouple();
    set("loss_w_per_k", 0.0);
    on("latent_heat");
    drive(0, PLANT_DRIVE_POWER, 0.5);
    /* 20 -> 100 degC: 24 J and 8.65 J at 0.5 W */
    OK(plant_step(plant, (24.0 + 8.65) / 0.5));
    TEST_ASSERT_DOUBLE_WITHIN(2e-3, 100.0, at(0));
    TEST_ASSERT_EQUAL_DOUBLE(1.0, plant_austenite(plant, 0));
    set("loss_w_per_k", 0.0058);
    settle();
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 20.0 + 0.5 / 0.0058, at(0));
}

static void cooling_gives_back_its_own_share(void)
{
    uncouple();
    set("loss_w_per_k", 0.0);
    on("latent_heat");
    set("latent_cooling_ratio", 0.336);
    hold(0, 100.0);
    OK(plant_step(plant, 1.0));
    const double in = plant_energy_input_j(plant);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.3 * 80 + 8.65, in);
    hold(0, 20.0);
    OK(plant_step(plant, 1.0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 8.65 * (1 - 0.336), plant_energy_input_j(plant));
}

/* ------------------------------------------------------------ each effect alone */

static void everything_is_off_by_default(void)
{
    static const char *const names[14] = {
        "radiation",        "natural_convection", "latent_heat", "resistance_phase", "shared_air",
        "plate_conduction", "fan_wake",           "edge_loss",   "spring_mismatch",  "supply_sag",
        "ambient_drift",    "sensor_lag",         "sensor_gain", "optical_mixing"};
    for (size_t k = 0; k < 14; k++) {
        TEST_ASSERT_EQUAL_STRING(names[k], plant_effect_name(k));
        TEST_ASSERT_FALSE(plant_effect_is_on(plant, k));
        size_t own = 0;
        for (size_t j = 0; j < plant_parameter_count(); j++) {
            const char *effect = plant_parameter(j)->effect;
            own += effect && strcmp(effect, names[k]) == 0;
        }
        TEST_ASSERT_TRUE(own > 0);
    }
}

/* Parameters of an effect that is off, moved anywhere, change nothing to the last bit. */
static void parameters_of_an_effect_that_is_off_do_nothing(void)
{
    make_log(PLANT_DRIVE_DUTY, 0.2, 8);
    run_log(0);
    for (size_t k = 0; k < plant_parameter_count(); k++) {
        const plant_parameter_t *parameter = plant_parameter(k);
        if (!parameter->effect)
            continue;
        set(parameter->name, parameter->maximum);
        run_log(1);
        TEST_ASSERT_EQUAL_MEMORY_MESSAGE(shown[0], shown[1], sizeof shown[0], parameter->name);
        set(parameter->name, parameter->default_value);
    }
}

/* Which effects touch the temperatures, which only the picture of them, in which drive modes. */
static void each_effect_changes_what_it_should_and_only_that(void)
{
    static const struct {
        const char *name;
        bool power, current, duty, command, picture;
    } expected[14] = {
        {"radiation", 1, 1, 1, 1, 1},       {"natural_convection", 1, 1, 1, 1, 1},
        {"latent_heat", 1, 1, 1, 1, 1},     {"resistance_phase", 0, 1, 1, 0, 0},
        {"shared_air", 1, 1, 1, 1, 1},      {"plate_conduction", 1, 1, 1, 1, 1},
        {"fan_wake", 1, 1, 1, 1, 1},        {"edge_loss", 1, 1, 1, 1, 1},
        {"spring_mismatch", 1, 1, 1, 1, 1}, {"supply_sag", 0, 0, 1, 1, 0},
        {"ambient_drift", 1, 1, 1, 1, 1},   {"sensor_lag", 0, 0, 0, 0, 1},
        {"sensor_gain", 0, 0, 0, 0, 1},     {"optical_mixing", 0, 0, 0, 0, 1},
    };
    static const double largest[4] = {0.8, 2.2, 0.2, 1.0};
    set("loss_scale[3]", 1.2);
    set("command_power_w", 0.8);
    for (int mode = 0; mode < 4; mode++) {
        make_log((plant_drive_mode_t)mode, largest[mode], 21);
        run_log(0);
        TEST_ASSERT_EQUAL_MEMORY(shown[0], real[0], sizeof shown[0]);
        for (int k = 0; k < 14; k++) {
            OK(plant_set_effect(plant, expected[k].name, true));
            run_log(1);
            const bool changes[4] = {expected[k].power, expected[k].current, expected[k].duty,
                                     expected[k].command};
            const double size = largest_difference(real[0], real[1]);
            TEST_ASSERT_TRUE_MESSAGE(changes[mode] ? size > 0.3 : size == 0.0, expected[k].name);
            const double pictured = largest_difference(shown[0], shown[1]);
            if (mode == PLANT_DRIVE_POWER) {
                TEST_ASSERT_TRUE_MESSAGE(expected[k].picture ? pictured > 0.3 : pictured == 0.0,
                                         expected[k].name);
            }
            OK(plant_set_effect(plant, expected[k].name, false));
        }
    }
}

static void radiation_by_hand(void)
{
    uncouple();
    on("radiation");
    hold(0, 105.0);
    settle();
    const double watts = 0.4 * 5.670374419e-8 * 277e-6 * (pow(378.15, 4) - pow(293.15, 4));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0058 * 85 + watts, plant_power_w(plant, 0));
    TEST_ASSERT_DOUBLE_WITHIN(0.002, 0.082, watts);
}

static void natural_convection_by_hand(void)
{
    uncouple();
    on("natural_convection");
    hold(0, 105.0);
    hold(1, 20.0 + 85.0 / 16.0);
    settle();
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0058 * 85, plant_power_w(plant, 0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0058 / 2 * 85 / 16, plant_power_w(plant, 1));
    /* at full fan it is the fan's loss, whatever the temperature */
    OK(plant_set_fan(plant, 1.0));
    settle();
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.0113 * 85 / 16, plant_power_w(plant, 1));
}

static void correlations_against_the_table(void)
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

static void shared_air_by_hand(void)
{
    uncouple();
    on("shared_air");
    for (int i = 0; i < 9; i++)
        drive(i, PLANT_DRIVE_POWER, i == 4 ? 0.0 : 0.4);
    settle();
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 20.0 + 3.2 / 0.25, plant_air_c(plant));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, plant_air_c(plant), at(4));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, plant_air_c(plant) + 0.4 / 0.0058, at(0));
}

static void plate_by_hand(void)
{
    uncouple();
    set("loss_w_per_k", 0.0);
    on("plate_conduction");
    drive(0, PLANT_DRIVE_POWER, 0.1);
    settle();
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 20.0 + 0.1 / 0.05, plant_plate_c(plant));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, plant_plate_c(plant) + 0.1 / 0.0015, at(0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, plant_plate_c(plant), at(8));
}

static void edges_lose_more_and_corners_most(void)
{
    uncouple();
    on("edge_loss");
    for (int i = 0; i < 9; i++)
        drive(i, PLANT_DRIVE_POWER, 0.4);
    settle();
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 20.0 + 0.4 / (0.0058 * 1.2), at(0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 20.0 + 0.4 / (0.0058 * 1.1), at(1));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 20.0 + 0.4 / 0.0058, at(4));
}

static void mismatch_is_of_one_spring(void)
{
    uncouple();
    on("spring_mismatch");
    set("loss_scale[3]", 1.25);
    set("resistance_scale[5]", 1.1);
    for (int i = 0; i < 9; i++)
        drive(i, PLANT_DRIVE_CURRENT, 1.2);
    settle();
    const double rise = 1.44 * 0.219 / 0.0058;
    for (int i = 0; i < 9; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, 20.0 + rise * (i == 2 ? 0.8 : i == 4 ? 1.1 : 1.0), at(i));
}

static void supply_sags_while_others_draw(void)
{
    on("supply_sag");
    drive(0, PLANT_DRIVE_DUTY, 0.12);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 5.0 / (1.0 + 0.2 * 0.0144 / 0.399), plant_supply_v(plant));
    const double alone = plant_current_a(plant, 0);
    for (int i = 1; i < 9; i++)
        drive(i, PLANT_DRIVE_DUTY, 0.12);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9,
                              alone * (1.0 + 0.2 * 0.0144 / 0.399) / (1.0 + 1.8 * 0.0144 / 0.399),
                              plant_current_a(plant, 0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, plant_current_a(plant, 0) * plant_voltage_v(plant, 0),
                              plant_power_w(plant, 0));
}

static void sag_takes_the_square_of_the_voltage_from_a_commanded_spring(void)
{
    on("supply_sag");
    drive(0, PLANT_DRIVE_COMMAND, 0.8);
    drive(1, PLANT_DRIVE_POWER, 3.0);
    const double v = plant_supply_v(plant);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, v, 5.0 - 0.2 * (0.8 * 0.5 / 25.0 * v + 3.0 / v));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.4 * v * v / 25.0, plant_power_w(plant, 0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 3.0, plant_power_w(plant, 1));
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
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 5.0 - 2.0 * (0.8 * 0.1 + 0.6 * 0.2), plant_supply_v(plant));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.4 * (1.0 - 2.0 * 0.6 * 0.2 / 5.0), plant_power_w(plant, 0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.6 * (1.0 - 2.0 * 0.8 * 0.1 / 5.0), plant_power_w(plant, 1));
    /* the others' load bends a mixed drive too, and never lifts a spring above what it has alone */
    drive(2, PLANT_DRIVE_POWER, 1.0);
    const double v = plant_supply_v(plant);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, v, 5.0 - 2.0 * (0.2 + 1.0 / v));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.4 * (v + 2.0 * 0.08) / 5.0, plant_power_w(plant, 0));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_set(plant, "supply_chopped", 0.5));
}

static void ambient_drifts_and_springs_follow(void)
{
    on("ambient_drift");
    set("ambient_phase_rad", 0.5);
    OK(plant_step(plant, 1000.0));
    const double expected = 20.0 + 2.0 / 3.6 + sin(2.0 * PI * 1000.0 / 1800.0 + 0.5);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, expected, plant_ambient_c(plant));
    /* undriven: lags by the time constant of 51.7 s */
    const double w = 2.0 * PI / 1800.0, tau = 0.3 / 0.0058;
    const double lagged = 20.0 + 2.0 / 3600.0 * (1000.0 - tau) +
                          sin(1000.0 * w + 0.5 - atan(w * tau)) / sqrt(1.0 + w * w * tau * tau);
    TEST_ASSERT_DOUBLE_WITHIN(5e-3, lagged, at(4));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_TIME, plant_settle(plant, 100.0));
}

static void sensor_lags_by_its_time_constant(void)
{
    on("sensor_lag");
    hold(0, 70.0);
    for (int k = 1; k < 20; k++) {
        OK(plant_step(plant, 1.3));
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 70.0 - 50.0 * exp(-1.3 * k / 5.0),
                                  plant_measured_c(plant, 0));
    }
    /* behind a ramp, too: a spring without loss */
    uncouple();
    set("loss_w_per_k", 0.0);
    plant_reset(plant);
    drive(1, PLANT_DRIVE_POWER, 0.3);
    OK(plant_step(plant, 40.0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 20.0 + 40.0 - 5.0 * (1.0 - exp(-8.0)),
                              plant_measured_c(plant, 1));
}

static void sensor_lags_behind_an_exponential_in_long_steps(void)
{
    uncouple();
    on("sensor_lag");
    drive(0, PLANT_DRIVE_POWER, 0.493);
    const double tau = 0.300 / 0.0058, rise = 0.493 / 0.0058;
    for (int k = 1; k <= 20; k++) {
        OK(plant_step(plant, 13.0));
        const double t = 13.0 * k;
        const double behind = (tau * exp(-t / tau) - 5.0 * exp(-t / 5.0)) / (tau - 5.0);
        TEST_ASSERT_DOUBLE_WITHIN(3e-3, 20.0 + rise * (1.0 - behind), plant_measured_c(plant, 0));
    }
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

static void a_pixel_sees_its_neighbours(void)
{
    on("optical_mixing");
    for (int i = 0; i < 9; i++)
        hold(i, i == 4 ? 50.0 : 105.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 50.0 + 55.0 * 0.25, plant_measured_c(plant, 4));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 105.0 - 55.0 * 0.05, plant_measured_c(plant, 1));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 105.0 - 55.0 * 0.0125, plant_measured_c(plant, 0));
    set("optical_background", 0.1);
    set("optical_background_rise_k", 5.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.9 * (50.0 + 55.0 * 0.25) + 2.5, plant_measured_c(plant, 4));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 50.0, at(4));
}

static void resistance_follows_phase_and_temperature(void)
{
    TEST_ASSERT_EQUAL_DOUBLE(0.219, plant_resistance_ohm(plant, 0));
    on("resistance_phase");
    TEST_ASSERT_EQUAL_DOUBLE(0.175, plant_resistance_ohm(plant, 0));
    hold(0, 93.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.197, plant_resistance_ohm(plant, 0));
    set("resistance_coefficient_per_k", 1e-3);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0.197 * 1.073, plant_resistance_ohm(plant, 0));
}

/* ------------------------------------------------------------ faults, input, bad input */

static void faults_stop_the_heat(void)
{
    for (int i = 0; i < 3; i++)
        drive(i, PLANT_DRIVE_DUTY, 0.1);
    OK(plant_set_fault(plant, 0, PLANT_FAULT_OPEN));
    OK(plant_set_fault(plant, 1, PLANT_FAULT_SHORT));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, plant_current_a(plant, 0));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, plant_power_w(plant, 0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5 / (0.18 + ELECTRICS_SHORT_OHM), plant_current_a(plant, 1));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, plant_current_a(plant, 1) * ELECTRICS_SHORT_OHM,
                              plant_voltage_v(plant, 1));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, plant_power_w(plant, 1));
    uncouple();
    OK(plant_step(plant, 50.0));
    TEST_ASSERT_EQUAL_DOUBLE(20.0, at(0));
    TEST_ASSERT_EQUAL_DOUBLE(20.0, at(1));
    TEST_ASSERT_TRUE(at(2) > 40.0);
    OK(plant_set_fault(plant, 0, PLANT_FAULT_NONE));
    OK(plant_step(plant, 50.0));
    TEST_ASSERT_TRUE(at(0) > 40.0);
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_set_fault(plant, 0, (plant_fault_t)7));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_INDEX, plant_set_fault(plant, 9, PLANT_FAULT_OPEN));
}

static void every_bad_parameter_is_refused_and_changes_nothing(void)
{
    for (size_t k = 0; k < plant_parameter_count(); k++) {
        const plant_parameter_t *parameter = plant_parameter(k);
        const double bad[] = {(double)NAN, (double)INFINITY, -(double)INFINITY,
                              nextafter(parameter->minimum, -1e300),
                              nextafter(parameter->maximum, 1e300)};
        double value;
        TEST_ASSERT_TRUE(parameter->default_value >= parameter->minimum &&
                         parameter->default_value <= parameter->maximum);
        for (size_t j = 0; j < sizeof bad / sizeof bad[0]; j++) {
            TEST_ASSERT_EQUAL_INT_MESSAGE(
                PLANT_ERROR_RANGE, plant_set(plant, parameter->name, bad[j]), parameter->name);
            OK(plant_get(plant, parameter->name, &value));
            TEST_ASSERT_TRUE(value == parameter->default_value);
        }
        OK(plant_set(plant, parameter->name, parameter->minimum));
        OK(plant_set(plant, parameter->name, parameter->maximum));
        OK(plant_set(plant, parameter->name, parameter->default_value));
        TEST_ASSERT_EQUAL_INT((int)k, plant_parameter_index(parameter->name));
        TEST_ASSERT_TRUE(strlen(parameter->description) > 0 && strlen(parameter->unit) > 0);
    }
    static const char *const names[] = {"",    "nonsense", "loss", "loss_w_per_kk",
                                        "[1]", "Ambient_c"};
    for (size_t k = 0; k < sizeof names / sizeof names[0]; k++)
        TEST_ASSERT_EQUAL_INT(PLANT_ERROR_NAME, plant_set(plant, names[k], 1.0));
    static const char *const springs[] = {"loss_w_per_k[0]",  "loss_w_per_k[10]",
                                          "loss_w_per_k[",    "loss_w_per_k[1",
                                          "loss_w_per_k[1]x", "loss_w_per_k[x]",
                                          "loss_w_per_k[-1]", "ambient_c[1]",
                                          "loss_w_per_k[]",   "loss_w_per_k[99999999999999999999]"};
    for (size_t k = 0; k < sizeof springs / sizeof springs[0]; k++)
        TEST_ASSERT_EQUAL_INT_MESSAGE(PLANT_ERROR_INDEX, plant_set(plant, springs[k], 0.01),
                                      springs[k]);
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_set(plant, "wake_direction", 0.5));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_NAME, plant_set_effect(plant, "gravity", true));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_NAME, plant_set_effect_index(plant, 14, true));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_NAME,
                          plant_set_index(plant, plant_parameter_count(), -1, 1.0));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_INDEX, plant_set_index(plant, 0, 9, 1.0));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_INDEX, plant_set_index(plant, 0, -2, 1.0));
    TEST_ASSERT_NULL(plant_parameter(plant_parameter_count()));
    TEST_ASSERT_NULL(plant_effect_name(14));
}

static void per_spring_values_stay_with_their_spring(void)
{
    double value;
    set("loss_w_per_k[9]", 0.01);
    OK(plant_get(plant, "loss_w_per_k[9]", &value));
    TEST_ASSERT_EQUAL_DOUBLE(0.01, value);
    OK(plant_get(plant, "loss_w_per_k[8]", &value));
    TEST_ASSERT_EQUAL_DOUBLE(0.0058, value);
    OK(plant_set_index(plant, (size_t)plant_parameter_index("loss_w_per_k"), 8, 0.02));
    OK(plant_get(plant, "loss_w_per_k[9]", &value));
    TEST_ASSERT_EQUAL_DOUBLE(0.02, value);
    set("loss_w_per_k", 0.03);
    OK(plant_get(plant, "loss_w_per_k[9]", &value));
    TEST_ASSERT_EQUAL_DOUBLE(0.03, value);
}

static void transformation_temperatures_out_of_order_stop_the_step(void)
{
    static const struct {
        const char *name;
        double bad, good;
    } cases[] = {{"martensite_finish_c", 78, 68},
                 {"austenite_finish_c", 88, 98},
                 {"austenite_start_c", 68, 88},
                 {"martensite_start_c", 98, 78}};
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        const char *message;
        set(cases[k].name, cases[k].bad);
        TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_check(plant, &message));
        TEST_ASSERT_NOT_NULL(strstr(message, cases[k].name));
        TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_step(plant, 1.0));
        TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_settle(plant, 1.0));
        TEST_ASSERT_EQUAL_DOUBLE(0.0, plant_time_s(plant));
        set(cases[k].name, cases[k].good);
        OK(plant_check(plant, &message));
        TEST_ASSERT_NULL(message);
    }
    OK(plant_step(plant, 1.0));
}

static void bad_drives_and_steps_are_refused(void)
{
    static const double top[5] = {100, 20, 1, 1, 300};
    for (int mode = 0; mode < 5; mode++) {
        TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE,
                              plant_drive(plant, 0, (plant_drive_mode_t)mode, top[mode] * 1.001));
        TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE,
                              plant_drive(plant, 0, (plant_drive_mode_t)mode, -61.0));
        TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE,
                              plant_drive(plant, 0, (plant_drive_mode_t)mode, (double)NAN));
    }
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_drive(plant, 0, (plant_drive_mode_t)5, 0.1));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_INDEX, plant_drive(plant, 9, PLANT_DRIVE_POWER, 0.1));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_INDEX, plant_drive(plant, -1, PLANT_DRIVE_POWER, 0.1));
    const double bad_steps[] = {0.0, -1.0, (double)NAN, (double)INFINITY, 1.1e7};
    for (int k = 0; k < 5; k++) {
        TEST_ASSERT_EQUAL_INT(PLANT_ERROR_TIME, plant_step(plant, bad_steps[k]));
        TEST_ASSERT_EQUAL_INT(PLANT_ERROR_TIME, plant_settle(plant, bad_steps[k]));
    }
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_set_fan(plant, 1.01));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_set_fan(plant, (double)NAN));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_set_ambient(plant, 200.0));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_set_temperature(plant, 0, 1000.0));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_INDEX, plant_set_temperature(plant, 9, 20.0));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_set_austenite(plant, 0, 1.5));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_INDEX, plant_set_austenite(plant, 9, 0.5));
    TEST_ASSERT_NULL(plant_create(0, 3));
    TEST_ASSERT_NULL(plant_create(3, -1));
    TEST_ASSERT_NULL(plant_create(5, 13));
    TEST_ASSERT_NULL(plant_create(65536, 65536));
}

static void a_log_in_one_call_equals_the_same_by_steps(void)
{
    on("latent_heat");
    on("sensor_lag");
    make_log(PLANT_DRIVE_POWER, 0.8, 4);
    for (int r = 0; r < ROWS; r++)
        for (int i = 0; i < 9; i++)
            if (r % 40 && r % 7)
                log_drive[r * 9 + i] = (double)NAN; /* keeps */
    for (int r = 0; r < ROWS; r++)
        log_ambient[r] = r % 100 ? (double)NAN : 20.0 + r / 100;
    plant_reset(plant);
    plant_t *other = plant_copy(plant);
    OK(plant_simulate(plant, ROWS, log_time, log_mode, log_drive, log_fan, log_ambient, shown[0],
                      real[0]));
    for (int r = 0; r < ROWS; r++) {
        for (int i = 0; i < 9; i++) {
            TEST_ASSERT_EQUAL_DOUBLE(shown[0][r * 9 + i], plant_measured_c(other, i));
            TEST_ASSERT_EQUAL_DOUBLE(real[0][r * 9 + i], plant_temperature_c(other, i));
            if (!isnan(log_drive[r * 9 + i]))
                OK(plant_drive(other, i, PLANT_DRIVE_POWER, log_drive[r * 9 + i]));
        }
        OK(plant_set_fan(other, log_fan[r]));
        if (!isnan(log_ambient[r]))
            OK(plant_set_ambient(other, log_ambient[r]));
        OK(plant_step(other, 1.0));
    }
    plant_destroy(other);
}

static void a_bad_log_is_refused_whole(void)
{
    make_log(PLANT_DRIVE_POWER, 0.8, 4);
    shown[0][0] = -1.0;
    const double good_time = log_time[599], good_drive = log_drive[4000];
    log_time[599] = log_time[598];
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_TIME, plant_simulate(plant, ROWS, log_time, log_mode,
                                                           log_drive, NULL, NULL, shown[0], NULL));
    log_time[599] = (double)NAN;
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_TIME, plant_simulate(plant, ROWS, log_time, log_mode,
                                                           log_drive, NULL, NULL, shown[0], NULL));
    log_time[599] = good_time;
    log_drive[4000] = -0.1;
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_simulate(plant, ROWS, log_time, log_mode,
                                                            log_drive, NULL, NULL, shown[0], NULL));
    log_drive[4000] = good_drive;
    log_fan[599] = 2.0;
    TEST_ASSERT_EQUAL_INT(
        PLANT_ERROR_RANGE,
        plant_simulate(plant, ROWS, log_time, log_mode, log_drive, log_fan, NULL, shown[0], NULL));
    log_ambient[599] = 99.0;
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE,
                          plant_simulate(plant, ROWS, log_time, log_mode, log_drive, NULL,
                                         log_ambient, shown[0], NULL));
    TEST_ASSERT_EQUAL_DOUBLE(-1.0, shown[0][0]);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, plant_time_s(plant));
}

static void reset_starts_anew(void)
{
    for (size_t k = 0; k < plant_effect_count(); k++)
        OK(plant_set_effect_index(plant, k, true));
    make_log(PLANT_DRIVE_CURRENT, 2.4, 9);
    run_log(0);
    for (int i = 0; i < 9; i++)
        drive(i, PLANT_DRIVE_POWER, 0.0);
    OK(plant_set_fan(plant, 0.0));
    plant_reset(plant);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, plant_time_s(plant));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, plant_energy_input_j(plant));
    run_log(1);
    TEST_ASSERT_EQUAL_MEMORY(shown[0], shown[1], sizeof shown[0]);
}

static void any_size_from_1_x_1_to_8_x_8(void)
{
    static const int sizes[][2] = {{1, 1}, {1, 2}, {2, 1}, {1, 64}, {8, 8}};
    for (int k = 0; k < 5; k++) {
        plant_t *p = plant_create(sizes[k][0], sizes[k][1]);
        TEST_ASSERT_NOT_NULL(p);
        const int n = plant_spring_count(p);
        TEST_ASSERT_EQUAL_INT(sizes[k][0], plant_rows(p));
        TEST_ASSERT_EQUAL_INT(sizes[k][1], plant_columns(p));
        for (size_t e = 0; e < plant_effect_count(); e++)
            OK(plant_set_effect_index(p, e, true));
        for (int i = 0; i < n; i++)
            OK(plant_drive(p, i, PLANT_DRIVE_CURRENT, 2.0));
        OK(plant_step(p, 500.0));
        TEST_ASSERT_TRUE(plant_temperature_c(p, n - 1) > 60.0);
        TEST_ASSERT_TRUE(fabs(plant_energy_balance_j(p)) < 1e-9 * plant_energy_input_j(p));
        plant_destroy(p);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(single_spring_follows_the_exponential);
    RUN_TEST(balance_of_design_section_1);
    RUN_TEST(constant_current_from_cold_never_transforms_at_1_5_a_but_runs_past_at_a_little_more);
    RUN_TEST(no_current_holds_a_spring_within_the_transformation);
    RUN_TEST(holding_above_martensite_start_saves_a_quarter);
    RUN_TEST(six_paper_conditions_within_1_5_degrees);
    RUN_TEST(energy_closes_in_every_combination_of_effects);
    RUN_TEST(rotating_the_pattern_rotates_the_temperatures);
    RUN_TEST(wake_turns_with_its_direction);
    RUN_TEST(default_tolerance_is_within_a_hundredth_of_a_degree);
    RUN_TEST(long_steps_are_as_good_as_short_ones);
    RUN_TEST(tolerance_governs_the_error);
    RUN_TEST(outer_loop_is_liang_and_rogers_cosine);
    RUN_TEST(minor_loops_by_hand);
    RUN_TEST(overlapping_bands_stay_within_the_outer_loop);
    RUN_TEST(turning_within_overlapping_bands_does_not_jump);
    RUN_TEST(latent_heat_delays_by_its_energy_and_changes_no_steady_state);
    RUN_TEST(cooling_gives_back_its_own_share);
    RUN_TEST(everything_is_off_by_default);
    RUN_TEST(parameters_of_an_effect_that_is_off_do_nothing);
    RUN_TEST(each_effect_changes_what_it_should_and_only_that);
    RUN_TEST(radiation_by_hand);
    RUN_TEST(natural_convection_by_hand);
    RUN_TEST(correlations_against_the_table);
    RUN_TEST(shared_air_by_hand);
    RUN_TEST(plate_by_hand);
    RUN_TEST(edges_lose_more_and_corners_most);
    RUN_TEST(mismatch_is_of_one_spring);
    RUN_TEST(supply_sags_while_others_draw);
    RUN_TEST(sag_takes_the_square_of_the_voltage_from_a_commanded_spring);
    RUN_TEST(chopped_loads_lose_only_by_the_others);
    RUN_TEST(ambient_drifts_and_springs_follow);
    RUN_TEST(sensor_lags_by_its_time_constant);
    RUN_TEST(sensor_lags_behind_an_exponential_in_long_steps);
    RUN_TEST(sensor_gain_is_about_ambient);
    RUN_TEST(a_pixel_sees_its_neighbours);
    RUN_TEST(resistance_follows_phase_and_temperature);
    RUN_TEST(faults_stop_the_heat);
    RUN_TEST(every_bad_parameter_is_refused_and_changes_nothing);
    RUN_TEST(per_spring_values_stay_with_their_spring);
    RUN_TEST(transformation_temperatures_out_of_order_stop_the_step);
    RUN_TEST(bad_drives_and_steps_are_refused);
    RUN_TEST(a_log_in_one_call_equals_the_same_by_steps);
    RUN_TEST(a_bad_log_is_refused_whole);
    RUN_TEST(reset_starts_anew);
    RUN_TEST(any_size_from_1_x_1_to_8_x_8);
    return UNITY_END();
}
