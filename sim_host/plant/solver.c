#include "plant_internal.h"

#include <math.h>
#include <string.h>

void plant_solver_hold(plant_t *p)
{
    for (int i = 0; i < p->n; i++) {
        if (p->mode[i] != PLANT_DRIVE_TEMPERATURE || p->temperature_c[i] == p->quantity[i])
            continue;
        const double warmer = p->quantity[i] - p->temperature_c[i];
        const double before = p->austenite[i];
        plant_phase_move(p, i, p->quantity[i]);
        const double heat_j =
            p->capacity[i] * warmer + plant_phase_latent_j(p, i, p->austenite[i] - before);
        p->input_j += heat_j;
        p->stored_j += heat_j;
        p->flows_known = false;
        if (!p->on[E_sensor_lag])
            p->sensor_c[i] = p->temperature_c[i];
    }
}

plant_status_t plant_solver_prepare(plant_t *p)
{
    if (p->parameters_changed) {
        const plant_status_t status = plant_check(p, NULL);
        if (status != PLANT_OK)
            return status;
        plant_electric_prepare(p);
        plant_network_prepare(p);
        plant_phase_prepare(p);
        plant_sensors_prepare(p);
        p->parameters_changed = false;
        p->inputs_changed = true;
    }
    if (p->inputs_changed) {
        plant_network_prepare_inputs(p);
        plant_electric_prepare_inputs(p);
        p->inputs_changed = false;
        p->flows_known = false;
        plant_solver_hold(p);
    }
    return PLANT_OK;
}

/* Temperatures and phases after increment_j on top of the accepted state. */
static void find_stage(plant_t *p)
{
    for (int i = 0; i < p->n; i++) {
        double slope;
        const double t = plant_phase_temperature_after(p, i, p->increment_j[i], p->stage_c[i]);
        p->stage_c[i] = t;
        if (p->power_varies)
            p->stage_austenite[i] = plant_phase_fraction(p, i, t, &slope);
    }
    for (int i = p->n; i < p->nodes; i++)
        p->stage_c[i] = p->temperature_c[i] + p->increment_j[i] * p->inverse_capacity[i];
}

static void accept(plant_t *p, double h)
{
    const flows_t *first = &p->k[0], *last = &p->k[3];
    for (int i = 0; i < p->n; i++) {
        const double t0 = p->temperature_c[i], t1 = p->stage_c[i];
        if (p->on[E_sensor_lag]) { /* heat at half of the step: Hermite, from the flows at both ends
                                    */
            const double heat_j =
                0.5 * p->increment_j[i] + 0.125 * h * (first->q_w[i] - last->q_w[i]);
            const double middle = plant_phase_temperature_after(p, i, heat_j, 0.5 * (t0 + t1));
            p->sensor_c[i] = plant_sensors_follow(p, i, middle, t1, h);
        } else {
            p->sensor_c[i] = t1;
        }
        double change = 0.0;
        if (plant_phase_moves(p, i, t1)) {
            const double before = p->austenite[i];
            plant_phase_move(p, i, t1);
            change = p->austenite[i] - before;
        } else {
            p->temperature_c[i] = t1;
        }
        p->stored_j += p->capacity[i] * (t1 - t0) + plant_phase_latent_j(p, i, change);
    }
    for (int i = p->n; i < p->nodes; i++) {
        p->stored_j += p->capacity[i] * (p->stage_c[i] - p->temperature_c[i]);
        p->temperature_c[i] = p->stage_c[i];
    }
    p->input_j +=
        h * (2.0 / 9.0 * p->k[0].in_w + 1.0 / 3.0 * p->k[1].in_w + 4.0 / 9.0 * p->k[2].in_w);
    p->output_j +=
        h * (2.0 / 9.0 * p->k[0].out_w + 1.0 / 3.0 * p->k[1].out_w + 4.0 / 9.0 * p->k[2].out_w);
}

/* Resistance that rises with temperature heats a spring the more the hotter it is. Steps would get
 * ever shorter on the way to infinity. */
static bool ran_away(const plant_t *p)
{
    for (int i = 0; i < p->n; i++)
        if (!(fabs(p->temperature_c[i]) <= HOTTEST_NODE_C))
            return true;
    return false;
}

/* The last stage is the next step's first. */
static void keep_last_flows(plant_t *p)
{
    memcpy(p->k[0].q_w, p->k[3].q_w, (size_t)p->nodes * sizeof(double));
    p->k[0].in_w = p->k[3].in_w;
    p->k[0].out_w = p->k[3].out_w;
}

/* Bogacki and Shampine, Appl. Math. Lett. 2 (1989) 321: third order with an embedded second, the
 * last stage serving as the next step's first. Works on the heat each node takes up: energy closes
 * by construction, and latent heat needs no special case. */
plant_status_t plant_solver_advance(plant_t *p, double dt_s)
{
    const plant_status_t status = plant_solver_prepare(p);
    if (status != PLANT_OK)
        return status;
    const int nodes = p->nodes;
    const double tolerance = scalar(p, P_integration_tolerance_c);
    const double start_s = p->time_s, end_s = start_s + dt_s;
    double done_s = 0.0;
    double *e = p->increment_j;
    const double *k0 = p->k[0].q_w, *k1 = p->k[1].q_w, *k2 = p->k[2].q_w, *k3 = p->k[3].q_w;
    const double *austenite = p->power_varies ? p->stage_austenite : p->austenite;

    if (!p->flows_known || p->on[E_ambient_drift])
        plant_network_flows(p, p->time_s, p->temperature_c, p->austenite, &p->k[0]);
    p->flows_known = true;
    while (done_s < dt_s) {
        const double left = dt_s - done_s;
        double h = fmin(p->step_s, p->step_limit_s);
        const bool to_end = h >= left * (1.0 - 1e-12);
        if (to_end)
            h = left;
        else if (2.0 * h > left)
            h = 0.5 * left;
        memcpy(p->stage_c, p->temperature_c, (size_t)nodes * sizeof(double));

        for (int i = 0; i < nodes; i++)
            e[i] = 0.5 * h * k0[i];
        find_stage(p);
        plant_network_flows(p, start_s + done_s + 0.5 * h, p->stage_c, austenite, &p->k[1]);
        for (int i = 0; i < nodes; i++)
            e[i] = 0.75 * h * k1[i];
        find_stage(p);
        plant_network_flows(p, start_s + done_s + 0.75 * h, p->stage_c, austenite, &p->k[2]);
        for (int i = 0; i < nodes; i++)
            e[i] = h * (2.0 / 9.0 * k0[i] + 1.0 / 3.0 * k1[i] + 4.0 / 9.0 * k2[i]);
        find_stage(p);
        plant_network_flows(p, start_s + done_s + h, p->stage_c, austenite, &p->k[3]);

        double error = 0.0;
        for (int i = 0; i < nodes; i++) {
            const double difference =
                5.0 / 72.0 * k0[i] - 1.0 / 12.0 * k1[i] - 1.0 / 9.0 * k2[i] + 1.0 / 8.0 * k3[i];
            error = fmax(error, fabs(difference) * p->inverse_capacity[i]);
        }
        error *= h;
        double factor = 4.0;
        if (error * 256.0 > tolerance)
            factor = fmax(0.85 * cbrt(tolerance / error), 0.2);
        if (error > tolerance && h > 1e-6) {
            p->step_s = factor * h;
            continue; /* k[0] still holds */
        }
        accept(p, h);
        if (ran_away(p))
            return PLANT_ERROR_RANGE;
        keep_last_flows(p);
        /* a step cut short by the end says nothing against the longer one */
        if (!to_end || factor * h > p->step_s || error > 0.5 * tolerance)
            p->step_s = fmin(factor * h, 1e6);
        done_s = to_end ? dt_s : done_s + h;
        p->time_s = start_s + done_s;
    }
    p->time_s = end_s;
    return PLANT_OK;
}

plant_status_t plant_step(plant_t *p, double dt_s)
{
    if (!(dt_s > 0.0) || dt_s > LONGEST_STEP_S)
        return PLANT_ERROR_TIME;
    return plant_solver_advance(p, dt_s);
}

plant_status_t plant_settle(plant_t *p, double limit_s)
{
    if (!(limit_s > 0.0) || limit_s > LONGEST_STEP_S)
        return PLANT_ERROR_TIME;
    const double end_s = p->time_s + limit_s;
    while (p->time_s < end_s) {
        plant_status_t status = plant_solver_prepare(p);
        if (status == PLANT_OK)
            status = plant_solver_advance(p, fmin(p->step_limit_s, fmax(end_s - p->time_s, 1e-6)));
        if (status != PLANT_OK)
            return status;
        double fastest = 0.0;
        for (int i = 0; i < p->nodes; i++)
            fastest = fmax(fastest, fabs(p->k[0].q_w[i]) * p->inverse_capacity[i]);
        for (int i = 0; i < p->n; i++)
            fastest = fmax(fastest, fabs(p->sensor_c[i] - p->temperature_c[i]) * 1e-4);
        if (fastest < 1e-9 && !p->on[E_ambient_drift])
            return PLANT_OK;
    }
    return PLANT_ERROR_TIME;
}
