#include "chip_mapping.h"

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "convection.h"
#include "descriptions.h"

/* Rise above the air over which the chip's straight line replaces the law of natural convection. */
#define CONVECTION_SPAN_K 90
#define SAME              1e-3 /* relative: springs nearer than this to each other count as equal */
#define FAN_FULL          1.0

typedef struct {
    const plant_t *plant;
    int row, column; /* in the plant, of the first spring */
    int rows, columns;
    int springs;
    char *message;
    size_t size;
    bool failed;
    thermal_model_parameters_t chip;
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

static bool is_on(const mapping_t *m, effect_t effect)
{
    const int index = effect < EFFECT_COUNT ? plant_effect_index(effect_row(effect)->name) : -1;
    return index >= 0 && plant_effect_is_on(m->plant, (size_t)index);
}

/* Spring i of the chip in the plant. */
static int place_of(const mapping_t *m, int i)
{
    return (m->row + i / m->columns) * plant_columns(m->plant) + m->column + i % m->columns;
}

static double value_of(const mapping_t *m, const char *name, int i)
{
    double value = 0.0;
    const int index = plant_parameter_index(name);
    if (index >= 0) {
        const bool each = plant_parameter((size_t)index)->per_spring;
        (void)plant_get_index(m->plant, (size_t)index, each ? place_of(m, i) : 0, &value);
    }
    return value;
}

static double array_value(const mapping_t *m, const char *name)
{
    return value_of(m, name, 0);
}

/* A physical value as the whole number of the row that is nearest. The first one that does not fit
 * is told, by the plant's name for it. */
static void put_from(mapping_t *m, const char *name, parameter_t parameter, int element,
                     double value)
{
    const parameter_row_t row = parameter_row((uint16_t)parameter);
    const double unit = pow(10.0, -row.decimals);
    const double whole = round(value / unit);
    if (whole >= row.minimum && whole <= row.maximum) {
        parameter_set(&m->chip, &row, (uint8_t)element, (int32_t)whole);
        return;
    }
    if (!m->failed) {
        m->message[0] = '\0';
        say(m, "%s is %.6g, the chip holds %.6g to %.6g", name, value, row.minimum * unit,
            row.maximum * unit);
        m->failed = true;
    }
}

static void put(mapping_t *m, parameter_t parameter, int element, double value)
{
    const parameter_row_t row = parameter_row((uint16_t)parameter);
    put_from(m, row.name, parameter, element, value);
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

/* Of spring i: sides without a neighbour in the whole array. */
static int free_sides_of(const mapping_t *m, int i)
{
    const int row = (m->row + i / m->columns) % plant_rows(m->plant);
    const int column = m->column + i % m->columns;
    return (row == 0) + (row == plant_rows(m->plant) - 1) + (column == 0) +
           (column == plant_columns(m->plant) - 1);
}

/* Loss of each spring, with edge, mismatch and natural convection in it: a mean and a scale each.
 */
static void map_loss(mapping_t *m)
{
    const bool edge = is_on(m, EFFECT_edge_loss), mismatch = is_on(m, EFFECT_spring_mismatch);
    const double per_side = array_value(m, "edge_loss_fraction");
    const double fan_per_side = per_side * array_value(m, "edge_loss_fan_share");
    double natural[PLANT_MAX_SPRINGS] = {0.0}, forced[PLANT_MAX_SPRINGS] = {0.0};
    double factor = 1.0, rise = 0.0, fan_loss = 0.0;
    const bool convection = is_on(m, EFFECT_natural_convection);
    const bool correlation = convection && array_value(m, "convection_correlation") >= 0.5;
    if (convection) {
        straighten(m, &factor, &rise, &fan_loss);
    }
    for (int i = 0; i < m->springs; i++) {
        const int free_sides = free_sides_of(m, i);
        const double own = mismatch ? value_of(m, "loss_scale", i) : 1.0;
        const double scale = own * (edge ? 1.0 + per_side * free_sides : 1.0);
        const double fan_scale = own * (edge ? 1.0 + fan_per_side * free_sides : 1.0);
        natural[i] = scale * (correlation ? factor : factor * value_of(m, "loss_w_per_k", i));
        forced[i] = fan_scale * (correlation ? fan_loss : value_of(m, "loss_fan_w_per_k", i));
    }
    double spread = 0.0, fan_spread = 0.0;
    const double mean = mean_of(m, natural, &spread);
    const double fan_mean = mean_of(m, forced, &fan_spread);
    put(m, PARAMETER_loss_w_per_k, 0, mean);
    put(m, PARAMETER_loss_fan_w_per_k, 0, fan_mean);
    put_from(m, "loss rise with temperature (1/K)", PARAMETER_loss_rise_per_k, 0, rise);
    double worst = 0.0;
    for (int i = 0; i < m->springs; i++) {
        const double own = mean > 0.0       ? natural[i] / mean
                           : fan_mean > 0.0 ? forced[i] / fan_mean
                                            : 1.0;
        const double fan_own = fan_mean > 0.0 ? forced[i] / fan_mean : own;
        worst = fmax(worst, fabs(fan_own - own));
        put(m, PARAMETER_loss_scale, i, own);
    }
    if (worst > SAME && !m->failed) {
        say(m, "springs that differ in loss with the fan otherwise than without: the chip takes "
               "the ratio without");
    }
}

static void map_capacity(mapping_t *m)
{
    const bool latent = is_on(m, EFFECT_latent_heat), mismatch = is_on(m, EFFECT_spring_mismatch);
    double capacity[PLANT_MAX_SPRINGS] = {0.0}, latent_k[PLANT_MAX_SPRINGS] = {0.0};
    for (int i = 0; i < m->springs; i++) {
        const double own = value_of(m, "heat_capacity_j_per_k", i);
        capacity[i] = own * (mismatch ? value_of(m, "heat_capacity_scale", i) : 1.0);
        latent_k[i] = latent ? value_of(m, "latent_heat_j", i) / own : 0.0;
    }
    double spread = 0.0, latent_spread = 0.0;
    const double mean = mean_of(m, capacity, &spread);
    put(m, PARAMETER_heat_capacity_j_per_k, 0, mean);
    put(m, PARAMETER_latent_heat_j, 0, mean_of(m, latent_k, &latent_spread) * mean);
    for (int i = 0; i < m->springs; i++) {
        put(m, PARAMETER_heat_capacity_scale, i, capacity[i] / mean);
    }
    if (latent_spread > SAME && !m->failed) {
        say(m, "latent_heat_j differs between springs: the chip takes the mean");
    }
    if (latent && fabs(array_value(m, "latent_cooling_ratio") - 1.0) > SAME && !m->failed) {
        say(m, "latent_cooling_ratio is not on the chip: it gives back all");
    }
}

/* Without resistance_phase both phases have the plant's one resistance. */
static void map_resistance(mapping_t *m)
{
    const bool phase = is_on(m, EFFECT_resistance_phase);
    const bool mismatch = is_on(m, EFFECT_spring_mismatch);
    const parameter_t phases[] = {PARAMETER_resistance_martensite_ohm,
                                  PARAMETER_resistance_austenite_ohm};
    double worst = 0.0;
    for (size_t k = 0; k < 2; k++) {
        const parameter_row_t row = parameter_row((uint16_t)phases[k]);
        const char *const name = phase ? row.name : "resistance_ohm";
        double ohm[PLANT_MAX_SPRINGS], spread = 0.0;
        for (int i = 0; i < m->springs; i++) {
            ohm[i] = (mismatch ? value_of(m, "resistance_scale", i) : 1.0) * value_of(m, name, i);
        }
        put_from(m, name, phases[k], 0, mean_of(m, ohm, &spread));
        worst = fmax(worst, spread);
    }
    if (worst > SAME && !m->failed) {
        say(m, "resistance differs between springs: the chip takes the mean, and measures v x i");
    }
}

/* Rows that more than the plant's parameter of their name goes into. */
static bool is_composed(uint16_t row)
{
    switch (row) {
    case PARAMETER_loss_w_per_k:
    case PARAMETER_loss_fan_w_per_k:
    case PARAMETER_loss_scale:
    case PARAMETER_heat_capacity_j_per_k:
    case PARAMETER_heat_capacity_scale:
    case PARAMETER_latent_heat_j:
    case PARAMETER_resistance_martensite_ohm:
    case PARAMETER_resistance_austenite_ohm:
    case PARAMETER_air_heat_capacity_j_per_k:
    case PARAMETER_air_exchange_w_per_k:
    case PARAMETER_plate_heat_capacity_j_per_k:
    case PARAMETER_plate_loss_w_per_k:
        return true;
    default:
        return false;
    }
}

/* All others, by their name; the default, which for an effect is off, where theirs is not on. */
static void map_rows_of_the_same_name(mapping_t *m)
{
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        const parameter_row_t row = parameter_row(k);
        const effect_t effect = parameter_description(k)->effect;
        if (row.part != PARAMETER_PART_MODEL || is_composed(k) ||
            plant_parameter_index(row.name) < 0 || (effect != EFFECT_none && !is_on(m, effect))) {
            continue;
        }
        double value[PLANT_MAX_SPRINGS], spread = 0.0;
        for (int i = 0; i < m->springs; i++) {
            value[i] = value_of(m, row.name, i);
            if (row.count > 1) {
                put(m, (parameter_t)k, i, value[i]);
            }
        }
        if (row.count == 1) {
            put(m, (parameter_t)k, 0, mean_of(m, value, &spread));
        }
        if (spread > SAME && !m->failed) {
            say(m, "%s differs between springs: the chip takes the mean", row.name);
        }
    }
}

/* Bands whose starts overlap, narrowed about their middles until they touch: the chip's M_s lies
 * not above its A_s, and where each transformation is half done matters most. */
static void map_overlap(mapping_t *m)
{
    const double finish_m = array_value(m, "martensite_finish_c");
    const double start_m = array_value(m, "martensite_start_c");
    const double start_a = array_value(m, "austenite_start_c");
    const double finish_a = array_value(m, "austenite_finish_c");
    if (start_m <= start_a) {
        return;
    }
    const double martensite = 0.5 * (finish_m + start_m), austenite = 0.5 * (start_a + finish_a);
    const double share = 2.0 * (austenite - martensite) / (start_m - finish_m + finish_a - start_a);
    const double start_c = martensite + 0.5 * share * (start_m - finish_m);
    put(m, PARAMETER_martensite_finish_c, 0, 2.0 * martensite - start_c);
    put(m, PARAMETER_martensite_start_c, 0, start_c);
    put(m, PARAMETER_austenite_start_c, 0, start_c);
    put(m, PARAMETER_austenite_finish_c, 0, 2.0 * austenite - start_c);
    if (!m->failed) {
        say(m, "heating and cooling overlap by %.1f K: the chip takes both narrower, to %.0f %%",
            start_m - start_a, 100.0 * share);
    }
}

/* The board of a layer has that layer's couplings, and takes the other's springs to be as warm as
 * its own: nothing flows there. */
static void map_layer(mapping_t *m)
{
    static const parameter_t rows[] = {PARAMETER_orthogonal_w_per_k,
                                       PARAMETER_orthogonal_fan_w_per_k, PARAMETER_diagonal_w_per_k,
                                       PARAMETER_diagonal_fan_w_per_k, PARAMETER_wake_w_per_k};
    if (plant_layers(m->plant) == 1) {
        return;
    }
    if (array_value(m, "series_w_per_k") > 0.0 && !m->failed) {
        say(m, "series_w_per_k is not on the chip: a board knows its own layer");
    }
    for (size_t k = 0; k < sizeof rows / sizeof rows[0] && m->row >= plant_rows(m->plant); k++) {
        const parameter_row_t row = parameter_row((uint16_t)rows[k]);
        const double unit = pow(10.0, -row.decimals);
        put_from(m, "stiffness_coupling_scale times a coupling", rows[k], 0,
                 array_value(m, "stiffness_coupling_scale") * unit *
                     parameter_get(&m->chip, &row, 0));
    }
}

/* The chip's network ends at the first neighbours: what reaches the second ones goes to those, so
 * that all springs together exchange as much. */
static void map_second_neighbours(mapping_t *m)
{
    static const struct {
        const char *second, *orthogonal;
        parameter_t row;
    } ways[] = {{"second_w_per_k", "orthogonal_w_per_k", PARAMETER_orthogonal_w_per_k},
                {"second_fan_w_per_k", "orthogonal_fan_w_per_k", PARAMETER_orthogonal_fan_w_per_k}};
    const int rows = m->chip.rows, columns = m->chip.columns;
    const int beside = rows * (columns - 1) + columns * (rows - 1);
    const int apart =
        (columns > 2 ? rows * (columns - 2) : 0) + (rows > 2 ? columns * (rows - 2) : 0);
    bool moved = false;
    for (size_t k = 0; apart > 0 && k < sizeof ways / sizeof ways[0]; k++) {
        const double second = array_value(m, ways[k].second);
        moved = moved || second > 0.0;
        put_from(m, "orthogonal_w_per_k with second_w_per_k", ways[k].row, 0,
                 array_value(m, ways[k].orthogonal) + second * apart / beside);
    }
    if (moved && !m->failed) {
        say(m, "second_w_per_k is not on the chip: counted into orthogonal_w_per_k");
    }
}

/* Of the air that all of the array's springs share, and of the plate that those of a layer do, this
 * board's springs' part. */
static void map_shares(mapping_t *m)
{
    static const parameter_t rows[] = {
        PARAMETER_air_heat_capacity_j_per_k, PARAMETER_air_exchange_w_per_k,
        PARAMETER_plate_heat_capacity_j_per_k, PARAMETER_plate_loss_w_per_k};
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        const effect_t effect = parameter_description((uint16_t)rows[k])->effect;
        const int sharers = plant_rows(m->plant) * plant_columns(m->plant) *
                            (effect == EFFECT_shared_air ? plant_layers(m->plant) : 1);
        const double share = (double)m->springs / sharers;
        if (is_on(m, effect)) {
            put(m, rows[k], 0, share * array_value(m, parameter_row((uint16_t)rows[k]).name));
        }
    }
}

/* Of a number that is within its own limits, and not within those that follow from others. */
static const char *range_of(uint16_t bad)
{
    switch (bad) {
    case PARAMETER_heat_capacity_j_per_k:
        return "too small: a spring, its scale included, has 0.0132 J/K at least";
    case PARAMETER_martensite_start_c:
    case PARAMETER_austenite_finish_c:
        return "too near or too far: a transformation is 2 to 100 K wide";
    case PARAMETER_latent_heat_j:
        return "too large: over the heat capacity it is at most 80 K, 20 widths of the "
               "transformation, and what is left from austenite_finish_c to 200 degC";
    case PARAMETER_transformation_shift_k:
        return "too large: the transformation lies within -30 to 200 degC, latent heat included";
    case PARAMETER_wake_w_per_k:
        return "too large: it is at most loss_fan_w_per_k";
    default:
        return "outside its limits";
    }
}

static const char *reason_of(thermal_model_status_t status, uint16_t bad)
{
    switch (status) {
    case THERMAL_MODEL_ERROR_RANGE:
        return range_of(bad);
    case THERMAL_MODEL_ERROR_OVERFLOW:
        return "too large: a spring's loss, and its couplings with the plate, are at most 0.0655 "
               "W/K each, both with wake and radiation 0.098";
    case THERMAL_MODEL_ERROR_UNSTABLE:
        return "too small for the model's step of 0.1 s: that times all conductances is at most "
               "half of it";
    case THERMAL_MODEL_ERROR_ORDER:
        return "out of order (M_f < M_s <= A_s < A_f)";
    case THERMAL_MODEL_OK:
        break;
    }
    return "refused";
}

chip_mapping_status_t chip_mapping_from_plant(const plant_t *plant,
                                              thermal_model_parameters_t *parameters, char *message,
                                              size_t message_size)
{
    return chip_mapping_from_part(plant, 0, 0, plant_layers(plant) * plant_rows(plant),
                                  plant_columns(plant), parameters, message, message_size);
}

chip_mapping_status_t chip_mapping_from_part(const plant_t *plant, int row, int column, int rows,
                                             int columns, thermal_model_parameters_t *parameters,
                                             char *message, size_t message_size)
{
    mapping_t m = {.plant = plant,
                   .row = row,
                   .column = column,
                   .rows = rows,
                   .columns = columns,
                   .springs = rows * columns,
                   .message = message,
                   .size = message_size};
    message[0] = '\0';
    if (row % plant_rows(plant) + rows > plant_rows(plant)) {
        say(&m, "a board has springs of one layer");
        return CHIP_MAPPING_ERROR_RANGE;
    }
    if (m.springs > THERMAL_MODEL_MAX_SPRINGS) {
        say(&m, "%d x %d springs are more than the chip's model holds", rows, columns);
        return CHIP_MAPPING_ERROR_RANGE;
    }
    thermal_model_parameters_default(&m.chip);
    m.chip.rows = (uint8_t)rows;
    m.chip.columns = (uint8_t)columns;
    map_capacity(&m);
    map_loss(&m);
    map_resistance(&m);
    map_rows_of_the_same_name(&m);
    map_overlap(&m);
    map_second_neighbours(&m);
    map_layer(&m);
    map_shares(&m);
    if (is_on(&m, EFFECT_radiation)) {
        put_from(&m, "emissivity x surface_mm2", PARAMETER_radiating_area_mm2, 0,
                 array_value(&m, "emissivity") * array_value(&m, "surface_mm2"));
    }
    if (m.failed) {
        return CHIP_MAPPING_ERROR_RANGE;
    }
    thermal_model_t model;
    uint16_t bad = PARAMETER_COUNT;
    const thermal_model_status_t status = thermal_model_init(&model, &m.chip, &bad);
    if (status != THERMAL_MODEL_OK) {
        message[0] = '\0';
        say(&m, "%s is %s", parameter_row(bad).name, reason_of(status, bad));
        return CHIP_MAPPING_ERROR_MODEL;
    }
    for (size_t k = 0; k < EFFECT_COUNT; k++) {
        const effect_row_t *const effect = effect_row(k);
        if (effect->not_on_chip != NULL && is_on(&m, (effect_t)k)) {
            say(&m, "%s is not on the chip: %s", effect->name, effect->not_on_chip);
        }
    }
    *parameters = m.chip;
    return CHIP_MAPPING_OK;
}
