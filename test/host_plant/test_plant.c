/* What users of plant.h call: what it accepts and refuses, and that it is exact. Its equations, and
 * what each effect touches, are held to a second implementation by against_scipy.py; here is what
 * that does not look at: overlapping bands, loads that are logged, contacts, correlations. */
#include <math.h>
#include <string.h>

#include "../run_tests.h"
#include "convection.h"
#include "electrics.h"
#include "plant.h"

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
static double get(const char *name)
{
    double value;
    OK(plant_get(plant, name, &value));
    return value;
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

#define LOG_ROWS 600
static double log_time[LOG_ROWS], log_drive[LOG_ROWS * 9], log_fan[LOG_ROWS], log_ambient[LOG_ROWS];
static double shown[2][LOG_ROWS * 9], real[2][LOG_ROWS * 9];
static plant_drive_mode_t log_mode[9];

static void make_log(plant_drive_mode_t mode, double largest, unsigned seed)
{
    random_state = seed;
    for (int r = 0; r < LOG_ROWS; r++) {
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
    OK(plant_simulate(plant, LOG_ROWS, log_time, log_mode, log_drive, log_fan, log_ambient,
                      shown[k], real[k]));
}

TEST(tolerance_governs_the_error)
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

TEST(everything_is_off_by_default)
{
    for (size_t k = 0; k < plant_effect_count(); k++) {
        TEST_ASSERT_FALSE(plant_effect_is_on(plant, k));
        TEST_ASSERT_EQUAL_INT((int)k, plant_effect_index(plant_effect_name(k)));
        size_t own = 0;
        for (size_t j = 0; j < plant_parameter_count(); j++) {
            const char *effect = plant_parameter(j)->effect;
            TEST_ASSERT_TRUE(effect == NULL || plant_effect_index(effect) >= 0);
            own += effect && strcmp(effect, plant_effect_name(k)) == 0;
        }
        TEST_ASSERT_TRUE_MESSAGE(own > 0, plant_effect_name(k));
    }
}

TEST(faults_stop_the_heat)
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
    OK(plant_set_fault(plant, 1, PLANT_FAULT_RESISTOR));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5 / (0.18 + ELECTRICS_DUMMY_OHM), plant_current_a(plant, 1));
    TEST_ASSERT_EQUAL_DOUBLE(0.0, plant_power_w(plant, 1));
    OK(plant_set_fault(plant, 0, PLANT_FAULT_NONE));
    OK(plant_step(plant, 50.0));
    TEST_ASSERT_TRUE(at(0) > 40.0);
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_set_fault(plant, 0, (plant_fault_t)7));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_INDEX, plant_set_fault(plant, 9, PLANT_FAULT_OPEN));
}

TEST(every_bad_parameter_is_refused_and_changes_nothing)
{
    for (size_t k = 0; k < plant_parameter_count(); k++) {
        const plant_parameter_t *parameter = plant_parameter(k);
        const double bad[] = {(double)NAN, (double)INFINITY, -(double)INFINITY,
                              nextafter(parameter->minimum, -1e300),
                              nextafter(parameter->maximum, 1e300)};
        double value;
        TEST_ASSERT_TRUE(parameter->default_value >= parameter->minimum &&
                         parameter->default_value <= parameter->maximum);
        for (size_t j = 0; j < ROWS(bad); j++) {
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
    for (size_t k = 0; k < ROWS(names); k++)
        TEST_ASSERT_EQUAL_INT(PLANT_ERROR_NAME, plant_set(plant, names[k], 1.0));
    static const char *const springs[] = {"loss_w_per_k[0]",  "loss_w_per_k[10]",
                                          "loss_w_per_k[",    "loss_w_per_k[1",
                                          "loss_w_per_k[1]x", "loss_w_per_k[x]",
                                          "loss_w_per_k[-1]", "ambient_c[1]",
                                          "loss_w_per_k[]",   "loss_w_per_k[99999999999999999999]"};
    for (size_t k = 0; k < ROWS(springs); k++)
        TEST_ASSERT_EQUAL_INT_MESSAGE(PLANT_ERROR_INDEX, plant_set(plant, springs[k], 0.01),
                                      springs[k]);
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_set(plant, "wake_direction", 0.5));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_NAME, plant_set_effect(plant, "gravity", true));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_NAME,
                          plant_set_effect_index(plant, plant_effect_count(), true));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_NAME,
                          plant_set_index(plant, plant_parameter_count(), -1, 1.0));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_INDEX, plant_set_index(plant, 0, 9, 1.0));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_INDEX, plant_set_index(plant, 0, -2, 1.0));
    TEST_ASSERT_NULL(plant_parameter(plant_parameter_count()));
    TEST_ASSERT_NULL(plant_effect_name(plant_effect_count()));
}

TEST(per_spring_values_stay_with_their_spring)
{
    const double standard = get("loss_w_per_k");
    set("loss_w_per_k[9]", 0.01);
    TEST_ASSERT_EQUAL_DOUBLE(0.01, get("loss_w_per_k[9]"));
    TEST_ASSERT_EQUAL_DOUBLE(standard, get("loss_w_per_k[8]"));
    OK(plant_set_index(plant, (size_t)plant_parameter_index("loss_w_per_k"), 8, 0.02));
    TEST_ASSERT_EQUAL_DOUBLE(0.02, get("loss_w_per_k[9]"));
    set("loss_w_per_k", 0.03);
    TEST_ASSERT_EQUAL_DOUBLE(0.03, get("loss_w_per_k[9]"));
}

TEST(transformation_temperatures_out_of_order_stop_the_step)
{
    static const struct {
        const char *name;
        double bad, good;
    } cases[] = {{"martensite_finish_c", 78, 68},
                 {"austenite_finish_c", 88, 98},
                 {"austenite_start_c", 68, 88},
                 {"martensite_start_c", 98, 78}};
    for (size_t k = 0; k < ROWS(cases); k++) {
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

TEST(a_spring_that_runs_away_ends_the_simulation)
{
    on("resistance_temperature");
    set("resistance_martensite_rise_per_k", 0.005);
    set("resistance_austenite_rise_per_k", 0.005);
    OK(plant_drive(plant, 0, PLANT_DRIVE_CURRENT, 20.0));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_step(plant, 3600.0));
}

TEST(bad_drives_and_steps_are_refused)
{
    static const double top[5] = {100, 20, 1, 1, 300}, bottom[5] = {-100, 0, 0, 0, -60};
    for (int mode = 0; mode < 5; mode++) {
        TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE,
                              plant_drive(plant, 0, (plant_drive_mode_t)mode, top[mode] * 1.001));
        TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE,
                              plant_drive(plant, 0, (plant_drive_mode_t)mode, bottom[mode] - 0.1));
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
    on("ambient_drift"); /* it never settles */
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_TIME, plant_settle(plant, 100.0));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_set(plant, "supply_chopped", 0.5));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_set_fan(plant, 1.01));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_set_fan(plant, (double)NAN));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_set_ambient(plant, 200.0));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_RANGE, plant_set_temperature(plant, 0, 1000.0));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_INDEX, plant_set_temperature(plant, 9, 20.0));
    TEST_ASSERT_NULL(plant_create(0, 3));
    TEST_ASSERT_NULL(plant_create(3, -1));
    TEST_ASSERT_NULL(plant_create(25, 41));
    TEST_ASSERT_NULL(plant_create(65536, 65536));
}

TEST(a_log_in_one_call_equals_the_same_by_steps)
{
    on("latent_heat");
    on("sensor_lag");
    make_log(PLANT_DRIVE_POWER, 0.8, 4);
    for (int r = 0; r < LOG_ROWS; r++)
        for (int i = 0; i < 9; i++)
            if (r % 40 && r % 7)
                log_drive[r * 9 + i] = (double)NAN; /* keeps */
    for (int r = 0; r < LOG_ROWS; r++)
        log_ambient[r] = r % 100 ? (double)NAN : 20.0 + r / 100;
    plant_reset(plant);
    plant_t *other = plant_copy(plant);
    OK(plant_simulate(plant, LOG_ROWS, log_time, log_mode, log_drive, log_fan, log_ambient,
                      shown[0], real[0]));
    for (int r = 0; r < LOG_ROWS; r++) {
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

static void refuses_log(plant_status_t status, double *value, double bad)
{
    const double good = *value;
    *value = bad;
    TEST_ASSERT_EQUAL_INT(status, plant_simulate(plant, LOG_ROWS, log_time, log_mode, log_drive,
                                                 log_fan, log_ambient, shown[0], NULL));
    *value = good;
}

TEST(a_bad_log_is_refused_whole)
{
    make_log(PLANT_DRIVE_POWER, 0.8, 4);
    shown[0][0] = -1.0;
    refuses_log(PLANT_ERROR_TIME, &log_time[599], log_time[598]);
    refuses_log(PLANT_ERROR_TIME, &log_time[599], (double)NAN);
    refuses_log(PLANT_ERROR_RANGE, &log_drive[4000], -100.1);
    refuses_log(PLANT_ERROR_RANGE, &log_fan[599], 2.0);
    refuses_log(PLANT_ERROR_RANGE, &log_ambient[599], 99.0);
    TEST_ASSERT_EQUAL_DOUBLE(-1.0, shown[0][0]);
    TEST_ASSERT_EQUAL_DOUBLE(0.0, plant_time_s(plant));
    OK(plant_simulate(plant, LOG_ROWS, log_time, log_mode, log_drive, NULL, NULL, shown[0], NULL));
}

TEST(reset_starts_anew)
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

TEST(any_size_from_1_x_1_to_32_x_32)
{
    static const int sizes[][2] = {{1, 1}, {1, 2}, {2, 1}, {1, 1024}, {32, 32}};
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

/* A copy goes its own way, whatever its size. */
TEST(a_copy_shares_nothing)
{
    plant_t *p = plant_create(5, 7), *copy = plant_copy(p);
    OK(plant_drive(copy, 34, PLANT_DRIVE_POWER, 0.5));
    OK(plant_step(copy, 50.0));
    TEST_ASSERT_EQUAL_DOUBLE(20.0, plant_temperature_c(p, 34));
    plant_destroy(p);
    OK(plant_step(copy, 50.0));
    TEST_ASSERT_TRUE(plant_temperature_c(copy, 34) > 50.0);
    plant_destroy(copy);
}

TEST(two_layers_are_one_plant_of_twice_as_many_springs)
{
    plant_t *both = plant_create_layers(3, 4, 2);
    TEST_ASSERT_EQUAL_INT(24, plant_spring_count(both));
    TEST_ASSERT_EQUAL_INT(3, plant_rows(both));
    TEST_ASSERT_EQUAL_INT(2, plant_layers(both));
    OK(plant_set(both, "loss_w_per_k[24]", 0.01));
    TEST_ASSERT_EQUAL_INT(PLANT_ERROR_INDEX, plant_set(both, "loss_w_per_k[25]", 0.01));
    plant_destroy(both);
    TEST_ASSERT_NULL(plant_create_layers(3, 3, 3));
    TEST_ASSERT_NULL(plant_create_layers(3, 3, 0));
    TEST_ASSERT_NULL(plant_create_layers(32, 32, 2));
}

/* A figure of docs/physics.md. */
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

/* ---- the transformation, and a load on it ---- */

#define PI 3.141592653589793

static void lead(double t)
{
    hold(0, t);
    OK(plant_step(plant, 0.01));
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

/* ---- contacts and convection ---- */

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

/* Which is why it has no loss of its own, and is looked for only where springs are several. */
TEST(a_holder_that_loses_heat_shows_as_one_that_does_not)
{
    const double g = 4e-3, capacity = 0.8, loss = 3e-3, part = g / (g + loss);
    plant_t *leaking = plant_create(1, 1), *tight = plant_create(1, 1);
    OK(plant_set_effect(leaking, "plate_conduction",
                        true)); /* of one spring: a holder that loses */
    OK(plant_set(leaking, "plate_coupling_w_per_k", g));
    OK(plant_set(leaking, "plate_heat_capacity_j_per_k", capacity));
    OK(plant_set(leaking, "plate_loss_w_per_k", loss));
    OK(plant_set_effect(tight, "holder_mass", true));
    OK(plant_set(tight, "holder_coupling_w_per_k", g * part));
    OK(plant_set(tight, "holder_heat_capacity_j_per_k", capacity * part * part));
    double own_w_per_k;
    OK(plant_get(tight, "loss_w_per_k", &own_w_per_k));
    OK(plant_set(tight, "loss_w_per_k", own_w_per_k + loss * part));
    for (int row = 0; row < 300; row++) {
        const double power_w = row % 70 < 40 ? 0.4 : 0.0;
        OK(plant_drive(leaking, 0, PLANT_DRIVE_POWER, power_w));
        OK(plant_drive(tight, 0, PLANT_DRIVE_POWER, power_w));
        OK(plant_step(leaking, 3.0));
        OK(plant_step(tight, 3.0));
        TEST_ASSERT_DOUBLE_WITHIN(0.01, plant_temperature_c(leaking, 0),
                                  plant_temperature_c(tight, 0));
    }
    TEST_ASSERT_TRUE(plant_temperature_c(tight, 0) > 30.0);
    TEST_ASSERT_TRUE(fabs(plant_energy_balance_j(tight)) < 1e-9 * plant_energy_input_j(tight));
    plant_destroy(leaking);
    plant_destroy(tight);
}

TEST(a_holder_that_is_switched_on_is_as_warm_as_the_room_is_by_then)
{
    uncouple();
    OK(plant_set_ambient(plant, 35.0));
    OK(plant_set_temperature(plant, 0, 35.0));
    on("holder_mass");
    OK(plant_step(plant, 50.0));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 35.0, at(0));
}

/* Explicit steps go by the faster of both, or rest does not last: it grows as a step may err. */
TEST(a_spring_and_a_holder_that_weighs_little_or_much_stay_at_rest)
{
    static const double capacity[] = {1e-2, 3.0}, coupling[] = {0.5, 5.0};
    for (int k = 0; k < 2; k++) {
        plant_t *one = plant_create(1, 1);
        OK(plant_set_effect(one, "holder_mass", true));
        OK(plant_set(one, "holder_heat_capacity_j_per_k", capacity[k]));
        OK(plant_set(one, "holder_coupling_w_per_k", coupling[k]));
        OK(plant_drive(one, 0, PLANT_DRIVE_POWER, 0.3));
        OK(plant_settle(one, 1e5));
        double loss_w_per_k;
        OK(plant_get(one, "loss_w_per_k", &loss_w_per_k));
        const double rest_c = plant_temperature_c(one, 0);
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, 20.0 + 0.3 / loss_w_per_k, rest_c);
        for (int later = 0; later < 500; later++) {
            OK(plant_step(one, 11.0));
            TEST_ASSERT_DOUBLE_WITHIN(1e-6, rest_c, plant_temperature_c(one, 0));
        }
        plant_destroy(one);
    }
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
