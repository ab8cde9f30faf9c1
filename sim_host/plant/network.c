#include "plant_internal.h"

#include <math.h>

#include "convection.h"

#define STEFAN_BOLTZMANN 5.670374419e-8 /* W/m2K4 */
#define KELVIN           273.15

/* The spring so many rows and columns on, in the same layer; -1: none. */
static int beside(const plant_t *p, int i, int down, int along)
{
    const int row = row_of(p, i) + down, column = i % p->columns + along;
    return row >= 0 && row < p->rows && column >= 0 && column < p->columns
               ? i + down * p->columns + along
               : -1;
}

void plant_network_lay(plant_t *p)
{
    static const struct {
        int row, column;
    } away[NEIGHBOUR_KINDS][NEIGHBOURS_MOST] = {
        [NEIGHBOUR_ORTHOGONAL] = {{-1, 0}, {0, -1}, {0, 1}, {1, 0}},
        [NEIGHBOUR_DIAGONAL] = {{-1, -1}, {-1, 1}, {1, -1}, {1, 1}},
        [NEIGHBOUR_SECOND] = {{-2, 0}, {0, -2}, {0, 2}, {2, 0}},
    };
    for (int kind = 0; kind < NEIGHBOUR_KINDS; kind++) {
        neighbours_t *neighbours = &p->neighbours[kind];
        int count = 0;
        for (int i = 0; i < p->n; i++) {
            neighbours->start[i] = count;
            for (int k = 0; k < NEIGHBOURS_MOST && kind != NEIGHBOUR_SERIES; k++) {
                const int other = beside(p, i, away[kind][k].row, away[kind][k].column);
                if (other >= 0)
                    neighbours->of[count++] = other;
            }
            if (kind == NEIGHBOUR_SERIES && p->layers == 2)
                neighbours->of[count++] = (i + p->n / 2) % p->n;
        }
        neighbours->start[p->n] = count;
    }
}

double plant_network_ambient(const plant_t *p, double time_s)
{
    double ambient = p->value[P_ambient_c][0];
    if (!p->on[E_ambient_drift])
        return ambient;
    ambient += scalar(p, P_ambient_ramp_k_per_h) * time_s / 3600.0;
    const double amplitude = scalar(p, P_ambient_amplitude_k);
    if (amplitude != 0.0) /* a fit has none, and would take the sine of each stage for nothing */
        ambient += amplitude * sin(2.0 * PI * time_s / scalar(p, P_ambient_period_s) +
                                   scalar(p, P_ambient_phase_rad));
    return ambient;
}

static double loss_at(const plant_t *p, int i, double t, double air)
{
    if (!p->on[E_natural_convection])
        return p->loss_sum[i];
    if (scalar(p, P_convection_correlation) < 0.5)
        return p->loss_natural[i] * pow(fabs(t - air) / scalar(p, P_convection_reference_k),
                                        scalar(p, P_convection_exponent)) +
               p->loss_forced[i];
    const double diameter_m = 1e-3 * scalar(p, P_wire_diameter_mm);
    const double natural =
        scalar(p, P_convection_scale) * convection_natural_w_per_m2k(diameter_m, t, air);
    const double forced =
        scalar(p, P_forced_scale) *
        convection_forced_w_per_m2k(diameter_m, p->fan * scalar(p, P_fan_velocity_m_per_s), t, air);
    return convection_mixed(natural, forced) * 1e-6 * scalar(p, P_surface_mm2) * p->loss_scale[i];
}

void plant_network_flows(plant_t *p, double time_s, const double *t, const double *austenite,
                         flows_t *flows)
{
    const int n = p->n;
    const double ambient = plant_network_ambient(p, time_s);
    const bool shared_air = p->on[E_shared_air], plate = p->on[E_plate_conduction];
    const bool natural = p->on[E_natural_convection], holders = p->on[E_holder_mass];
    const double air = shared_air ? t[n] : ambient;
    const double ambient_k2 = (ambient + KELVIN) * (ambient + KELVIN);
    double in_w = 0.0, to_air = 0.0, radiated = 0.0, to_plate[PLANT_MAX_LAYERS] = {0.0};

    if (p->power_varies)
        plant_electric_find(p, t, austenite);
    for (int i = 0; i < n; i++) {
        const int layer = layer_of(p, i);
        const double ti = t[i];
        double q = 0.0;
        for (int kind = 0; kind < NEIGHBOUR_KINDS; kind++)
            if (p->coupling[kind][layer] != 0.0)
                q += p->coupling[kind][layer] * neighbour_difference(&p->neighbours[kind], t, i);

        double lost = (natural ? loss_at(p, i, ti, air) : p->loss_sum[i]) * (ti - air);
        if (p->wake != 0.0 && p->upstream[i] >= 0)
            lost -= p->wake * p->wake_scale[layer] * (t[p->upstream[i]] - air);
        to_air += lost;
        q -= lost;
        if (p->radiation_w_per_k4 != 0.0) {
            const double k2 = (ti + KELVIN) * (ti + KELVIN);
            const double w = p->radiation_w_per_k4 * (k2 * k2 - ambient_k2 * ambient_k2);
            radiated += w;
            q -= w;
        }
        if (plate) {
            const double w = p->value[P_plate_coupling_w_per_k][i] * (ti - t[plate_node(p, layer)]);
            to_plate[layer] += w;
            q -= w;
        }
        if (holders) { /* the only way out of a holder is back */
            const double w = scalar(p, P_holder_coupling_w_per_k) * (ti - t[holder_node(p, i)]);
            flows->q_w[holder_node(p, i)] = w;
            q -= w;
        }
        if (p->any_held && p->mode[i] == PLANT_DRIVE_TEMPERATURE) {
            p->power_w[i] = -q;
            q = -q;
            in_w += q;
            flows->q_w[i] = 0.0;
        } else {
            in_w += p->power_w[i];
            flows->q_w[i] = q + p->power_w[i];
        }
    }
    double out_w = radiated;
    for (int node = n; node < holder_node(p, 0); node++)
        flows->q_w[node] = 0.0;
    if (shared_air) {
        const double w = scalar(p, P_air_exchange_w_per_k) * (air - ambient);
        flows->q_w[n] = to_air - w;
        out_w += w;
    } else {
        out_w += to_air;
    }
    for (int layer = 0; layer < p->layers && plate; layer++) {
        const int node = plate_node(p, layer);
        const double w = scalar(p, P_plate_loss_w_per_k) * (t[node] - ambient);
        flows->q_w[node] = to_plate[layer] - w;
        out_w += w;
    }
    flows->in_w = in_w;
    flows->out_w = out_w;
}

void plant_network_rest(plant_t *p)
{
    const double ambient = plant_network_ambient(p, p->time_s);
    if (!p->on[E_shared_air])
        p->temperature_c[p->n] = ambient;
    for (int layer = 0; layer < p->layers && !p->on[E_plate_conduction]; layer++)
        p->temperature_c[plate_node(p, layer)] = ambient;
    for (int i = 0; i < p->n && !p->on[E_holder_mass]; i++)
        p->temperature_c[holder_node(p, i)] = ambient;
}

void plant_network_prepare(plant_t *p)
{
    const int n = p->n;
    p->nodes = holder_node(p, p->on[E_holder_mass] ? n : 0);
    const bool mismatch = p->on[E_spring_mismatch];
    for (int i = 0; i < n; i++) {
        const double heavier = mismatch ? p->value[P_heat_capacity_scale][i] : 1.0;
        const int free_sides = 4 - neighbour_count(p, NEIGHBOUR_ORTHOGONAL, i);
        p->capacity[i] = p->value[P_heat_capacity_j_per_k][i] * heavier;
        p->loss_scale[i] = mismatch ? p->value[P_loss_scale][i] : 1.0;
        p->loss_scale_fan[i] = p->loss_scale[i];
        if (p->on[E_edge_loss]) {
            const double more = scalar(p, P_edge_loss_fraction) * free_sides;
            p->loss_scale[i] *= 1.0 + more;
            p->loss_scale_fan[i] *= 1.0 + scalar(p, P_edge_loss_fan_share) * more;
        }

        static const int down[4] = {0, -1, 0, 1}, along[4] = {-1, 0, 1, 0};
        const int direction = (int)scalar(p, P_wake_direction);
        p->upstream[i] = beside(p, i, down[direction], along[direction]);
    }
    p->capacity[n] = scalar(p, P_air_heat_capacity_j_per_k);
    for (int layer = 0; layer < p->layers; layer++)
        p->capacity[plate_node(p, layer)] = scalar(p, P_plate_heat_capacity_j_per_k);
    for (int i = 0; i < n; i++)
        p->capacity[holder_node(p, i)] = scalar(p, P_holder_heat_capacity_j_per_k);
    for (int i = 0; i < p->nodes; i++)
        p->inverse_capacity[i] = 1.0 / p->capacity[i];
    p->radiation_w_per_k4 = p->on[E_radiation] ? scalar(p, P_emissivity) * STEFAN_BOLTZMANN * 1e-6 *
                                                     scalar(p, P_surface_mm2)
                                               : 0.0;
    plant_network_rest(p);
}

/* Of all that the fan adds, the part that it adds at its present command: the odds f / (1 - f)
 * times h / (1 - h), h (fan_half_share) what they are at half. */
static double fan_part(const plant_t *p)
{
    if (!p->on[E_fan_curve] || p->fan <= 0.0)
        return p->fan;
    const double half = scalar(p, P_fan_half_share);
    return 1.0 / (1.0 + (1.0 - half) / half * (1.0 - p->fan) / p->fan);
}

void plant_network_prepare_inputs(plant_t *p)
{
    const int n = p->n;
    const double fan = fan_part(p);
    static const enum parameter_id natural[NEIGHBOUR_KINDS] = {
        P_orthogonal_w_per_k, P_diagonal_w_per_k, P_second_w_per_k, P_series_w_per_k};
    static const enum parameter_id forced[NEIGHBOUR_KINDS] = {
        P_orthogonal_fan_w_per_k, P_diagonal_fan_w_per_k, P_second_fan_w_per_k,
        P_series_fan_w_per_k};
    const double stiffness = scalar(p, P_stiffness_coupling_scale);
    for (int kind = 0; kind < NEIGHBOUR_KINDS; kind++) {
        const double still = scalar(p, natural[kind]);
        const double coupling = still + fan * (scalar(p, forced[kind]) - still);
        p->coupling[kind][0] = coupling;
        p->coupling[kind][1] = kind == NEIGHBOUR_SERIES ? coupling : stiffness * coupling;
    }
    p->wake_scale[0] = 1.0;
    p->wake_scale[1] = stiffness;
    p->wake = p->on[E_fan_wake] ? scalar(p, P_wake_w_per_k) * fan : 0.0;
    p->any_held = false;
    const bool shared_air = p->on[E_shared_air], plate = p->on[E_plate_conduction];
    const double to_holder = p->on[E_holder_mass] ? scalar(p, P_holder_coupling_w_per_k) : 0.0;
    double fastest = 0.0, air_sum = scalar(p, P_air_exchange_w_per_k);
    double plate_sum = scalar(p, P_plate_loss_w_per_k); /* of all: no less than one's own */
    for (int i = 0; i < n; i++) {
        p->loss_natural[i] = p->value[P_loss_w_per_k][i] * (1.0 - fan) * p->loss_scale[i];
        p->loss_forced[i] = p->value[P_loss_fan_w_per_k][i] * fan * p->loss_scale_fan[i];
        p->loss_sum[i] = p->loss_natural[i] + p->loss_forced[i];
        if (p->mode[i] == PLANT_DRIVE_TEMPERATURE)
            p->any_held = true;
        /* Gershgorin: no eigenvalue beyond (own conductances + couplings) / capacity */
        const int layer = layer_of(p, i);
        const double own = p->loss_sum[i] + p->wake * p->wake_scale[layer] +
                           4.0 * 1.1e8 * p->radiation_w_per_k4 +
                           (plate ? p->value[P_plate_coupling_w_per_k][i] : 0.0) + to_holder;
        double coupled = 0.0;
        for (int kind = 0; kind < NEIGHBOUR_KINDS; kind++)
            coupled += p->coupling[kind][layer] * neighbour_count(p, (enum neighbour_kind)kind, i);
        fastest = fmax(fastest, (own + 2.0 * coupled) * p->inverse_capacity[i]);
        air_sum += 2.0 * p->loss_sum[i];
        plate_sum += 2.0 * p->value[P_plate_coupling_w_per_k][i];
    }
    if (shared_air)
        fastest = fmax(fastest, air_sum * p->inverse_capacity[n]);
    if (plate)
        fastest = fmax(fastest, plate_sum * p->inverse_capacity[n + 1]);
    if (to_holder > 0.0)
        fastest = fmax(fastest, 2.0 * to_holder * p->inverse_capacity[holder_node(p, 0)]);
    /* The method is stable to 2.5 / eigenvalue; 1.5 damps well. */
    p->step_limit_s = fastest > 0.0 ? 1.5 / fastest : LONGEST_STEP_S;
    if (p->on[E_ambient_drift])
        p->step_limit_s = fmin(p->step_limit_s, scalar(p, P_ambient_period_s) / 32.0);
    if (p->on[E_sensor_lag] && p->on[E_latent_heat])
        p->step_limit_s = fmin(p->step_limit_s, 1.0); /* lag() sees no kink within a step */
}

double plant_ambient_c(const plant_t *p)
{
    return plant_network_ambient(p, p->time_s);
}

double plant_air_c(const plant_t *p)
{
    return p->on[E_shared_air] ? p->temperature_c[p->n] : plant_ambient_c(p);
}

double plant_plate_c(const plant_t *p)
{
    return p->on[E_plate_conduction] ? p->temperature_c[plate_node(p, 0)] : plant_ambient_c(p);
}
