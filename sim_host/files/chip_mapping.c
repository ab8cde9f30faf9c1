#include "chip_mapping.h"

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "convection.h"

/* Rise above the air over which the chip's straight line replaces the law of natural convection. */
#define CONVECTION_SPAN_K  90
#define STEP_MS            100
#define SAME               1e-3 /* relative: springs nearer than this to each other count as equal */
#define FAN_FULL           1.0
#define CAPACITY_LONGEST   4294967295.0
#define RESISTANCE_HIGHEST 16e6 /* uohm */

typedef struct {
    const plant_t *plant;
    int springs;
    char *message;
    size_t size;
    bool failed;
} mapping_t;

static void say(mapping_t *m, const char *form, ...)
{
    const size_t used = strlen(m->message);
    if (used + 1 >= m->size) {
        return;
    }
    if (used > 0) {
        (void)snprintf(m->message + used, m->size - used, "; ");
    }
    const size_t start = strlen(m->message);
    va_list list;
    va_start(list, form);
    (void)vsnprintf(m->message + start, m->size - start, form, list);
    va_end(list);
}

static bool is_on(const mapping_t *m, const char *effect)
{
    const int index = plant_effect_index(effect);
    return index >= 0 && plant_effect_is_on(m->plant, (size_t)index);
}

static double value_of(const mapping_t *m, const char *name, int spring)
{
    double value = 0.0;
    const int index = plant_parameter_index(name);
    if (index >= 0) {
        (void)plant_get_index(m->plant, (size_t)index, spring, &value);
    }
    return value;
}

static double array_value(const mapping_t *m, const char *name)
{
    return value_of(m, name, 0);
}

/* A physical value as a whole number of the chip's units. The first one that does not fit is told.
 */
static double fitted(mapping_t *m, const char *name, double value, double unit, double low,
                     double high)
{
    const double whole = round(value / unit);
    if (whole >= low && whole <= high) {
        return whole;
    }
    if (!m->failed) {
        m->message[0] = '\0';
        say(m, "%s is %.6g, the chip holds %.6g to %.6g", name, value, low * unit, high * unit);
        m->failed = true;
    }
    return low;
}

static uint16_t fitted_u16(mapping_t *m, const char *name, double value, double unit)
{
    return (uint16_t)fitted(m, name, value, unit, 0.0, 65535.0);
}

static int16_t temperature_cc(mapping_t *m, const char *name)
{
    return (int16_t)fitted(m, name, array_value(m, name), 0.01, -32768.0, 32767.0);
}

/* Mean over the springs; *spread is the largest relative distance from it. */
static double mean_of(const mapping_t *m, const double *values, double *spread)
{
    double sum = 0.0;
    for (int i = 0; i < m->springs; i++) {
        sum += values[i];
    }
    const double mean = sum / m->springs;
    *spread = 0.0;
    for (int i = 0; i < m->springs; i++) {
        const double distance = fabs(values[i] - mean);
        *spread = fmax(*spread, mean > 0.0 ? distance / mean : distance);
    }
    return *spread < 1e-12 ? values[0] : mean;
}

/* Loss of the correlation's wire at `above_k` over the air, W/K. */
static double correlation_loss(const mapping_t *m, double above_k, double fan)
{
    const double diameter_m = 1e-3 * array_value(m, "wire_diameter_mm");
    const double air_c = array_value(m, "ambient_c");
    const double natural = array_value(m, "convection_scale") *
                           convection_natural_w_per_m2k(diameter_m, air_c + above_k, air_c);
    const double forced =
        array_value(m, "forced_scale") *
        convection_forced_w_per_m2k(diameter_m, fan * array_value(m, "fan_velocity_m_per_s"),
                                    air_c + above_k, air_c);
    return convection_mixed(natural, forced) * 1e-6 * array_value(m, "surface_mm2");
}

/* Natural convection as the chip has it: factor (1 + rise (T - air)), by least squares of the heat
 * flow over CONVECTION_SPAN_K. factor multiplies loss_w_per_k for the power law, or is W/K for the
 * correlation. */
static void straighten(const mapping_t *m, double *factor, double *rise_per_k, double *fan_loss)
{
    const bool correlation = array_value(m, "convection_correlation") >= 0.5;
    double s22 = 0.0, s23 = 0.0, s33 = 0.0, y2 = 0.0, y3 = 0.0, fan_y = 0.0;
    for (int k = 1; k <= CONVECTION_SPAN_K; k++) {
        const double above_k = (double)k;
        const double loss = correlation ? correlation_loss(m, above_k, 0.0)
                                        : pow(above_k / array_value(m, "convection_reference_k"),
                                              array_value(m, "convection_exponent"));
        s22 += above_k * above_k;
        s23 += above_k * above_k * above_k;
        s33 += above_k * above_k * above_k * above_k;
        y2 += loss * above_k * above_k;
        y3 += loss * above_k * above_k * above_k;
        if (correlation) {
            fan_y += correlation_loss(m, above_k, FAN_FULL) * above_k * above_k;
        }
    }
    const double determinant = s22 * s33 - s23 * s23;
    *factor = (y2 * s33 - y3 * s23) / determinant;
    *rise_per_k = fmax(0.0, (s22 * y3 - s23 * y2) / determinant / *factor);
    *fan_loss = fan_y / s22;
}

static void map_loss(mapping_t *m, thermal_model_parameters_t *p)
{
    const bool edge = is_on(m, "edge_loss"), mismatch = is_on(m, "spring_mismatch");
    const double per_side = array_value(m, "edge_loss_fraction");
    double scale[PLANT_MAX_SPRINGS];
    double natural[PLANT_MAX_SPRINGS] = {0.0}, forced[PLANT_MAX_SPRINGS] = {0.0};
    double factor = 1.0, rise = 0.0, fan_loss = 0.0;
    const bool convection = is_on(m, "natural_convection");
    const bool correlation = convection && array_value(m, "convection_correlation") >= 0.5;
    if (convection) {
        straighten(m, &factor, &rise, &fan_loss);
    }
    for (int i = 0; i < m->springs; i++) {
        const int row = i / p->columns, column = i % p->columns;
        const int free_sides =
            (row == 0) + (row == p->rows - 1) + (column == 0) + (column == p->columns - 1);
        scale[i] = mismatch ? value_of(m, "loss_scale", i) : 1.0;
        scale[i] *= edge ? 1.0 + per_side * free_sides : 1.0;
        natural[i] = scale[i] * (correlation ? factor : factor * value_of(m, "loss_w_per_k", i));
        forced[i] = scale[i] * (correlation ? fan_loss : value_of(m, "loss_fan_w_per_k", i));
    }
    double spread = 0.0, fan_spread = 0.0;
    const double mean = mean_of(m, natural, &spread);
    const double fan_mean = mean_of(m, forced, &fan_spread);
    p->loss_uw_per_k = fitted_u16(m, "loss_w_per_k", mean, 1e-6);
    p->loss_fan_uw_per_k = fitted_u16(m, "loss_fan_w_per_k", fan_mean, 1e-6);
    p->loss_rise_ppm_per_k = fitted_u16(m, "loss rise with temperature (1/K)", rise, 1e-6);
    double worst = 0.0;
    for (int i = 0; i < m->springs; i++) {
        const double own = mean > 0.0       ? natural[i] / mean
                           : fan_mean > 0.0 ? forced[i] / fan_mean
                                            : 1.0;
        const double fan_own = fan_mean > 0.0 ? forced[i] / fan_mean : own;
        worst = fmax(worst, fabs(fan_own - own));
        p->loss_scale_permille[i] = (uint16_t)fitted(m, "loss_scale", own, 1e-3, 1.0, 65535.0);
    }
    if (worst > SAME && !m->failed) {
        say(m, "springs that differ in loss with the fan otherwise than without: the chip takes "
               "the ratio without");
    }
}

static void map_capacity(mapping_t *m, thermal_model_parameters_t *p)
{
    const bool latent = is_on(m, "latent_heat"), mismatch = is_on(m, "spring_mismatch");
    double capacity[PLANT_MAX_SPRINGS] = {0.0}, latent_k[PLANT_MAX_SPRINGS] = {0.0};
    for (int i = 0; i < m->springs; i++) {
        const double own = value_of(m, "heat_capacity_j_per_k", i);
        capacity[i] = own * (mismatch ? value_of(m, "heat_capacity_scale", i) : 1.0);
        latent_k[i] = latent ? value_of(m, "latent_heat_j", i) / own : 0.0;
    }
    double spread = 0.0, latent_spread = 0.0;
    const double mean = mean_of(m, capacity, &spread);
    const double mean_latent_k = mean_of(m, latent_k, &latent_spread);
    p->heat_capacity_mj_per_k =
        (uint16_t)fitted(m, "heat_capacity_j_per_k", mean, 1e-3, 1.0, 65535.0);
    p->latent_heat_mj = fitted_u16(m, "latent_heat_j", mean_latent_k * mean, 1e-3);
    for (int i = 0; i < m->springs; i++) {
        p->heat_capacity_scale_permille[i] =
            (uint16_t)fitted(m, "heat_capacity_scale", capacity[i] / mean, 1e-3, 1.0, 65535.0);
    }
    if (latent_spread > SAME && !m->failed) {
        say(m, "latent_heat_j differs between springs: the chip takes the mean");
    }
    if (latent && fabs(array_value(m, "latent_cooling_ratio") - 1.0) > SAME && !m->failed) {
        say(m, "latent_cooling_ratio is not on the chip: it gives back all");
    }
}

static void map_resistance(mapping_t *m, thermal_model_parameters_t *p)
{
    const bool phase = is_on(m, "resistance_phase"), mismatch = is_on(m, "spring_mismatch");
    const char *martensite_name = phase ? "resistance_martensite_ohm" : "resistance_ohm";
    const char *austenite_name = phase ? "resistance_austenite_ohm" : "resistance_ohm";
    double martensite[PLANT_MAX_SPRINGS], austenite[PLANT_MAX_SPRINGS];
    /* The chip's resistance does not depend on temperature: taken where it matters, between the
     * phases. */
    const double middle_c =
        0.5 * (array_value(m, "martensite_start_c") + array_value(m, "austenite_start_c"));
    const double above_k = is_on(m, "resistance_temperature") ? middle_c - 20.0 : 0.0;
    const double martensite_rise = array_value(m, "resistance_martensite_rise_per_k") * above_k;
    const double austenite_rise = array_value(m, "resistance_austenite_rise_per_k") * above_k;
    for (int i = 0; i < m->springs; i++) {
        const double scale = mismatch ? value_of(m, "resistance_scale", i) : 1.0;
        martensite[i] = scale * (1.0 + martensite_rise) * value_of(m, martensite_name, i);
        austenite[i] = scale * (1.0 + austenite_rise) * value_of(m, austenite_name, i);
    }
    double spread = 0.0, other_spread = 0.0;
    p->resistance_martensite_uohm = (uint32_t)fitted(
        m, martensite_name, mean_of(m, martensite, &spread), 1e-6, 1.0, RESISTANCE_HIGHEST);
    p->resistance_austenite_uohm = (uint32_t)fitted(
        m, austenite_name, mean_of(m, austenite, &other_spread), 1e-6, 1.0, RESISTANCE_HIGHEST);
    if (fmax(spread, other_spread) > SAME && !m->failed) {
        say(m, "resistance differs between springs: the chip takes the mean, and measures v x i");
    }
}

static void map_effects(mapping_t *m, thermal_model_parameters_t *p)
{
    p->radiating_area_cmm2 =
        is_on(m, "radiation")
            ? fitted_u16(m, "emissivity x surface_mm2",
                         array_value(m, "emissivity") * array_value(m, "surface_mm2"), 0.01)
            : 0;
    p->air_exchange_uw_per_k = 0;
    if (is_on(m, "shared_air")) {
        p->air_heat_capacity_mj_per_k = (uint32_t)fitted(
            m, "air_heat_capacity_j_per_k", array_value(m, "air_heat_capacity_j_per_k"), 1e-3, 0.0,
            CAPACITY_LONGEST);
        p->air_exchange_uw_per_k = (uint32_t)fitted(
            m, "air_exchange_w_per_k", array_value(m, "air_exchange_w_per_k"), 1e-6, 1.0, 16e6);
    }
    p->plate_coupling_uw_per_k = 0;
    if (is_on(m, "plate_conduction")) {
        double coupling[PLANT_MAX_SPRINGS];
        for (int i = 0; i < m->springs; i++) {
            coupling[i] = value_of(m, "plate_coupling_w_per_k", i);
        }
        double spread = 0.0;
        p->plate_coupling_uw_per_k =
            fitted_u16(m, "plate_coupling_w_per_k", mean_of(m, coupling, &spread), 1e-6);
        p->plate_heat_capacity_mj_per_k = (uint32_t)fitted(
            m, "plate_heat_capacity_j_per_k", array_value(m, "plate_heat_capacity_j_per_k"), 1e-3,
            1.0, CAPACITY_LONGEST);
        p->plate_loss_uw_per_k =
            fitted_u16(m, "plate_loss_w_per_k", array_value(m, "plate_loss_w_per_k"), 1e-6);
        if (spread > SAME && !m->failed) {
            say(m, "plate_coupling_w_per_k differs between springs: the chip takes the mean");
        }
    }
    p->wake_uw_per_k = is_on(m, "fan_wake")
                           ? fitted_u16(m, "wake_w_per_k", array_value(m, "wake_w_per_k"), 1e-6)
                           : 0;
    p->wake_direction =
        is_on(m, "fan_wake") ? (uint8_t)array_value(m, "wake_direction") : (uint8_t)0;
}

static const char *reason_of(thermal_model_status_t status)
{
    switch (status) {
    case THERMAL_MODEL_ERROR_RANGE:
        return "outside its limits";
    case THERMAL_MODEL_ERROR_OVERFLOW:
        return "too large: heat flows would overflow";
    case THERMAL_MODEL_ERROR_UNSTABLE:
        return "too fast for the model's step of 0.1 s";
    case THERMAL_MODEL_ERROR_ORDER:
        return "out of order (M_f < M_s <= A_s < A_f)";
    case THERMAL_MODEL_OK:
        break;
    }
    return "refused";
}

/* The chip's parameter as the plant calls it: they differ in the unit. */
static void plant_name(thermal_model_parameter_t parameter, char *name, size_t size)
{
    static const char *const units[][2] = {
        {"_uw_per_k", "_w_per_k"}, {"_mj", "_j"}, {"_cc", "_c"}, {"_permille", ""}};
    const char *own = thermal_model_parameter_name(parameter);
    for (size_t k = 0; k < sizeof units / sizeof units[0]; k++) {
        const char *unit = strstr(own, units[k][0]);
        if (unit != NULL) {
            (void)snprintf(name, size, "%.*s%s%s", (int)(unit - own), own, units[k][1],
                           unit + strlen(units[k][0]));
            return;
        }
    }
    (void)snprintf(name, size, "%s", own);
}

chip_mapping_status_t chip_mapping_from_plant(const plant_t *plant,
                                              thermal_model_parameters_t *parameters, char *message,
                                              size_t message_size)
{
    const int rows = plant_rows(plant), columns = plant_columns(plant);
    mapping_t m = {plant, rows * columns, message, message_size, false};
    message[0] = '\0';
    if (m.springs > THERMAL_MODEL_MAX_SPRINGS) {
        say(&m, "%d x %d springs are more than the chip's model holds", rows, columns);
        return CHIP_MAPPING_ERROR_RANGE;
    }
    thermal_model_parameters_t p;
    thermal_model_parameters_default(&p);
    p.rows = (uint8_t)rows;
    p.columns = (uint8_t)columns;
    p.step_ms = STEP_MS;
    map_capacity(&m, &p);
    map_loss(&m, &p);
    p.orthogonal_uw_per_k =
        fitted_u16(&m, "orthogonal_w_per_k", array_value(&m, "orthogonal_w_per_k"), 1e-6);
    p.orthogonal_fan_uw_per_k =
        fitted_u16(&m, "orthogonal_fan_w_per_k", array_value(&m, "orthogonal_fan_w_per_k"), 1e-6);
    p.diagonal_uw_per_k =
        fitted_u16(&m, "diagonal_w_per_k", array_value(&m, "diagonal_w_per_k"), 1e-6);
    p.diagonal_fan_uw_per_k =
        fitted_u16(&m, "diagonal_fan_w_per_k", array_value(&m, "diagonal_fan_w_per_k"), 1e-6);
    p.martensite_finish_cc = temperature_cc(&m, "martensite_finish_c");
    p.martensite_start_cc = temperature_cc(&m, "martensite_start_c");
    p.austenite_start_cc = temperature_cc(&m, "austenite_start_c");
    p.austenite_finish_cc = temperature_cc(&m, "austenite_finish_c");
    map_resistance(&m, &p);
    map_effects(&m, &p);
    if (m.failed) {
        return CHIP_MAPPING_ERROR_RANGE;
    }
    thermal_model_t model;
    thermal_model_parameter_t bad = THERMAL_MODEL_PARAMETER_COUNT;
    const thermal_model_status_t status = thermal_model_init(&model, &p, &bad);
    if (status != THERMAL_MODEL_OK) {
        message[0] = '\0';
        char name[64];
        plant_name(bad, name, sizeof name);
        say(&m, "%s is %s", name, reason_of(status));
        return CHIP_MAPPING_ERROR_MODEL;
    }
    static const char *const measurement[] = {"sensor_lag", "sensor_gain", "optical_mixing",
                                              "ambient_drift"};
    for (size_t k = 0; k < sizeof measurement / sizeof measurement[0]; k++) {
        if (is_on(&m, measurement[k])) {
            say(&m, "%s belongs to the measurement and is not on the chip", measurement[k]);
        }
    }
    if (is_on(&m, "supply_sag")) {
        say(&m, "supply_sag is not on the chip: it measures v x i");
    }
    *parameters = p;
    return CHIP_MAPPING_OK;
}
