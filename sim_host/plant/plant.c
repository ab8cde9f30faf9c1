#include "plant.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "plant_internal.h"

/* So many bytes behind what is taken; NULL while only counting. */
static void *take(unsigned char *memory, size_t *taken, size_t bytes)
{
    void *at = memory ? memory + *taken : NULL;
    *taken += (bytes + sizeof(double) - 1) / sizeof(double) * sizeof(double);
    return at;
}

/* Points every array of the plant to its place in that memory, whose beginning is the plant itself.
 * Returns how many bytes that is. */
static size_t lay_out(plant_t *p, unsigned char *memory)
{
    const size_t n = (size_t)p->n, nodes = (size_t)holder_node(p, p->n); /* all, on or off */
    double **const of_springs[] = {
        &p->quantity,    &p->austenite,        &p->sensor_c,      &p->heat_start,
        &p->heat_from_c, &p->cool_start,       &p->cool_from_c,   &p->latent_j,
        &p->power_w,     &p->latent_cooling_j, &p->contact_ohm,   &p->resistance_scale,
        &p->loss_scale,  &p->loss_scale_fan,   &p->loss_natural,  &p->loss_forced,
        &p->loss_sum,    &p->stage_austenite,  &p->optical_weight};
    double **const of_nodes[] = {&p->temperature_c, &p->capacity, &p->inverse_capacity, &p->stage_c,
                                 &p->increment_j};
    size_t taken = 0;
    (void)take(memory, &taken, sizeof *p);
    for (size_t k = 0; k < PARAMETER_COUNT; k++)
        p->value[k] =
            take(memory, &taken, (plant_parameter(k)->per_spring ? n : 1) * sizeof(double));
    for (size_t k = 0; k < sizeof of_springs / sizeof of_springs[0]; k++)
        *of_springs[k] = take(memory, &taken, n * sizeof(double));
    for (size_t k = 0; k < sizeof of_nodes / sizeof of_nodes[0]; k++)
        *of_nodes[k] = take(memory, &taken, nodes * sizeof(double));
    for (size_t k = 0; k < sizeof p->k / sizeof p->k[0]; k++)
        p->k[k].q_w = take(memory, &taken, nodes * sizeof(double));
    for (int kind = 0; kind < NEIGHBOUR_KINDS; kind++) {
        p->neighbours[kind].start = take(memory, &taken, (n + 1) * sizeof(int));
        p->neighbours[kind].of = take(memory, &taken, NEIGHBOURS_MOST * n * sizeof(int));
    }
    p->upstream = take(memory, &taken, n * sizeof(int));
    p->mode = take(memory, &taken, n * sizeof *p->mode);
    p->fault = take(memory, &taken, n * sizeof *p->fault);
    p->points = take(memory, &taken, n * sizeof *p->points);
    return taken;
}

plant_t *plant_create(int rows, int columns)
{
    return plant_create_layers(rows, columns, 1);
}

plant_t *plant_create_layers(int rows, int columns, int layers)
{
    if (rows < 1 || columns < 1 || rows > PLANT_MAX_SPRINGS || columns > PLANT_MAX_SPRINGS ||
        layers < 1 || layers > PLANT_MAX_LAYERS || rows * columns > PLANT_MAX_SPRINGS / layers)
        return NULL;
    const int n = layers * rows * columns;
    plant_t shape = {.rows = rows, .columns = columns, .layers = layers, .n = n};
    shape.bytes = lay_out(&shape, NULL);
    plant_t *p = calloc(1, shape.bytes);
    if (!p)
        return NULL;
    *p = shape;
    lay_out(p, (unsigned char *)p);
    for (int k = 0; k < PARAMETER_COUNT; k++)
        (void)plant_set_index(p, (size_t)k, -1, plant_parameter((size_t)k)->default_value);
    plant_network_lay(p);
    plant_reset(p);
    return p;
}

void plant_destroy(plant_t *p)
{
    free(p);
}

plant_t *plant_copy(const plant_t *p)
{
    plant_t *copy = malloc(p->bytes);
    if (!copy)
        return NULL;
    memcpy(copy, p, p->bytes);
    lay_out(copy, (unsigned char *)copy);
    return copy;
}

int plant_spring_count(const plant_t *p)
{
    return p->n;
}

int plant_rows(const plant_t *p)
{
    return p->rows;
}

int plant_columns(const plant_t *p)
{
    return p->columns;
}

int plant_layers(const plant_t *p)
{
    return p->layers;
}

void plant_reset(plant_t *p)
{
    p->time_s = 0.0;
    p->input_j = p->output_j = p->stored_j = 0.0;
    p->step_s = 1.0;
    const double ambient = plant_network_ambient(p, 0.0);
    for (int i = 0; i < holder_node(p, p->n); i++)
        p->temperature_c[i] = ambient;
    for (int i = 0; i < p->n; i++) {
        p->sensor_c[i] = ambient;
        p->austenite[i] = 0.0;
    }
    p->parameters_changed = p->restarted = true;
    if (plant_solver_prepare(p) == PLANT_OK) {
        plant_solver_hold(p);
        p->input_j = p->output_j = p->stored_j = 0.0;
    }
}

plant_status_t plant_set_temperature(plant_t *p, int spring, double temperature_c)
{
    if (spring < 0 || spring >= p->n)
        return PLANT_ERROR_INDEX;
    if (!within(temperature_c, COLDEST_C, HOTTEST_C))
        return PLANT_ERROR_RANGE;
    const plant_status_t status = plant_solver_prepare(p);
    if (status != PLANT_OK)
        return status;
    plant_phase_move(p, spring, temperature_c);
    p->sensor_c[spring] = temperature_c;
    p->inputs_changed = true;
    return PLANT_OK;
}

static bool drive_is_valid(plant_drive_mode_t mode, double quantity)
{
    switch (mode) {
    case PLANT_DRIVE_POWER:
        return within(quantity, -100.0, 100.0);
    case PLANT_DRIVE_CURRENT:
        return within(quantity, 0.0, 20.0);
    case PLANT_DRIVE_DUTY:
    case PLANT_DRIVE_COMMAND:
        return within(quantity, 0.0, 1.0);
    case PLANT_DRIVE_TEMPERATURE:
        return within(quantity, COLDEST_C, 300.0);
    }
    return false;
}

/* Values known to be valid. */
static void set_drive(plant_t *p, int i, plant_drive_mode_t mode, double quantity)
{
    if (p->mode[i] == mode && p->quantity[i] == quantity)
        return;
    p->mode[i] = mode;
    p->quantity[i] = quantity;
    p->inputs_changed = true;
}

plant_status_t plant_drive(plant_t *p, int spring, plant_drive_mode_t mode, double quantity)
{
    if (spring < 0 || spring >= p->n)
        return PLANT_ERROR_INDEX;
    if (!drive_is_valid(mode, quantity))
        return PLANT_ERROR_RANGE;
    set_drive(p, spring, mode, quantity);
    return plant_solver_prepare(p);
}

plant_status_t plant_set_fault(plant_t *p, int spring, plant_fault_t fault)
{
    if (spring < 0 || spring >= p->n)
        return PLANT_ERROR_INDEX;
    if ((unsigned)fault > PLANT_FAULT_RESISTOR)
        return PLANT_ERROR_RANGE;
    p->fault[spring] = fault;
    p->inputs_changed = true;
    return PLANT_OK;
}

static void set_fan(plant_t *p, double fraction)
{
    if (p->fan == fraction)
        return;
    p->fan = fraction;
    p->inputs_changed = true;
}

plant_status_t plant_set_fan(plant_t *p, double fraction)
{
    if (!within(fraction, 0.0, 1.0))
        return PLANT_ERROR_RANGE;
    set_fan(p, fraction);
    return PLANT_OK;
}

plant_status_t plant_set_ambient(plant_t *p, double ambient_c)
{
    if (ambient_c == p->value[P_ambient_c][0])
        return PLANT_OK;
    return plant_set_index(p, P_ambient_c, -1, ambient_c);
}

static void write_row(const plant_t *p, double *measured_c, double *temperature_c)
{
    for (int i = 0; i < p->n; i++) {
        if (measured_c)
            measured_c[i] = plant_measured_c(p, i);
        if (temperature_c)
            temperature_c[i] = p->temperature_c[i];
    }
}

plant_status_t plant_simulate(plant_t *p, size_t rows, const double *time_s,
                              const plant_drive_mode_t *mode, const double *drive,
                              const double *fan, const double *ambient_c, double *measured_c,
                              double *temperature_c)
{
    const size_t n = (size_t)p->n;
    const plant_parameter_t *ambient = plant_parameter(P_ambient_c);
    for (size_t r = 0; r < rows; r++) {
        const double dt_s = r + 1 < rows ? time_s[r + 1] - time_s[r] : 1.0;
        if (!(dt_s > 0.0) || dt_s > LONGEST_STEP_S)
            return PLANT_ERROR_TIME;
        for (size_t i = 0; i < n; i++)
            if (!isnan(drive[r * n + i]) && !drive_is_valid(mode[i], drive[r * n + i]))
                return PLANT_ERROR_RANGE;
        if (fan && !isnan(fan[r]) && !within(fan[r], 0.0, 1.0))
            return PLANT_ERROR_RANGE;
        if (ambient_c && !isnan(ambient_c[r]) &&
            !within(ambient_c[r], ambient->minimum, ambient->maximum))
            return PLANT_ERROR_RANGE;
    }
    plant_status_t status = plant_solver_prepare(p);
    for (size_t r = 0; r < rows && status == PLANT_OK; r++) {
        write_row(p, measured_c ? measured_c + r * n : NULL,
                  temperature_c ? temperature_c + r * n : NULL);
        for (int i = 0; i < p->n; i++)
            if (!isnan(drive[r * n + (size_t)i]))
                set_drive(p, i, mode[i], drive[r * n + (size_t)i]);
        if (fan && !isnan(fan[r]))
            set_fan(p, fan[r]);
        if (ambient_c && !isnan(ambient_c[r]))
            plant_set_ambient(p, ambient_c[r]);
        if (r + 1 < rows)
            status = plant_solver_advance(p, time_s[r + 1] - time_s[r]);
    }
    return status;
}

double plant_time_s(const plant_t *p)
{
    return p->time_s;
}

double plant_temperature_c(const plant_t *p, int spring)
{
    return p->temperature_c[spring];
}

double plant_austenite(const plant_t *p, int spring)
{
    return p->austenite[spring];
}

double plant_energy_input_j(const plant_t *p)
{
    return p->input_j;
}

double plant_energy_balance_j(const plant_t *p)
{
    return p->input_j - p->output_j - p->stored_j;
}
