#include "reference_network.h"

#include <math.h>
#include <string.h>

static const double pi = 3.14159265358979323846;
static const double stefan_boltzmann = 5.670374419e-8;

static double shape(double x)
{
    if (x <= 0.0) {
        return 1.0;
    }
    return x >= 1.0 ? 0.0 : 0.5 * (1.0 + cos(pi * x));
}

static double martensite_finish(const reference_network_t *r)
{
    return r->p.martensite_finish_cc / 100.0;
}
static double martensite_start(const reference_network_t *r)
{
    return r->p.martensite_start_cc / 100.0;
}
static double austenite_start(const reference_network_t *r)
{
    return r->p.austenite_start_cc / 100.0;
}
static double austenite_finish(const reference_network_t *r)
{
    return r->p.austenite_finish_cc / 100.0;
}

static double latent_k(const reference_network_t *r)
{
    return (double)r->p.latent_heat_mj / r->p.heat_capacity_mj_per_k;
}

static double on_branch(const reference_network_t *r, int heating, double amplitude, double t)
{
    if (heating) {
        return 1.0 - amplitude * shape((t - austenite_start(r)) /
                                       (austenite_finish(r) - austenite_start(r)));
    }
    return amplitude *
           shape((martensite_start(r) - t) / (martensite_start(r) - martensite_finish(r)));
}

double reference_austenite(const reference_network_t *r, int i)
{
    const reference_spring_t *s = &r->spring[i];
    return on_branch(r, s->heating, s->amplitude, s->turn_c - s->shift_c);
}

/* Temperature at an enthalpy; the memory follows. */
static double settle(const reference_network_t *r, reference_spring_t *s, double enthalpy)
{
    double latent = latent_k(r);
    double austenite = on_branch(r, s->heating, s->amplitude, s->turn_c - s->shift_c);
    double t = enthalpy - latent * austenite; /* with the phase held */
    double above = s->heating ? s->turn_c : austenite_start(r) + s->shift_c;
    double below = s->heating ? martensite_start(r) + s->shift_c : s->turn_c;
    int heating;
    if (t > above && austenite < 1.0) {
        heating = 1;
    } else if (t < below && austenite > 0.0) {
        heating = 0;
    } else {
        return t;
    }
    if (heating != s->heating) {
        s->amplitude = heating ? 1.0 - austenite : austenite;
        s->heating = heating;
    }
    /* t + latent x(t) rises with t: bisection keeps it safe, Newton makes it quick */
    double low = heating ? above : t;
    double high = heating ? t : below;
    double guess = s->temperature_c;
    for (int k = 0; k < 60; k++) {
        if (!(guess > low && guess < high)) {
            guess = 0.5 * (low + high);
        }
        double excess =
            guess + latent * on_branch(r, heating, s->amplitude, guess - s->shift_c) - enthalpy;
        if (fabs(excess) < 1e-9) {
            break;
        }
        if (excess > 0.0) {
            high = guess;
        } else {
            low = guess;
        }
        double slope = (on_branch(r, heating, s->amplitude, guess - s->shift_c + 1e-4) -
                        on_branch(r, heating, s->amplitude, guess - s->shift_c - 1e-4)) /
                       2e-4;
        guess -= excess / (1.0 + latent * slope);
    }
    s->turn_c = guess;
    return guess;
}

void reference_reset(reference_network_t *r, const thermal_model_parameters_t *parameters,
                     double temperature_c)
{
    memset(r, 0, sizeof *r);
    r->p = *parameters;
    r->n = parameters->rows * parameters->columns;
    r->ambient_c = 20.0;
    r->air_c = temperature_c;
    r->plate_c = temperature_c;
    for (int i = 0; i < r->n; i++) {
        r->spring[i].enthalpy_k = temperature_c;
        r->spring[i].temperature_c = temperature_c;
        r->spring[i].shift_c = parameters->transformation_shift_cc[i] / 100.0;
        r->spring[i].turn_c = martensite_finish(r) + r->spring[i].shift_c - 1.0;
        r->spring[i].amplitude = 1.0;
    }
}

static double mixed(double natural, double forced, double fan)
{
    return natural + (forced - natural) * fan;
}

/* Of all that the fan adds at full: the curve through 0, the part at half, and 1. */
static double blown(const reference_network_t *r)
{
    const double half = 1e-3 * r->p.fan_half_share_permille;
    return r->fan * half / (half * r->fan + (1.0 - half) * (1.0 - r->fan));
}

/* Rates: K/s of each enthalpy, of air and of plate. */
static void rates(const reference_network_t *r, const double t[], double air, double plate,
                  const double power[], double rate[], double *air_rate, double *plate_rate)
{
    const thermal_model_parameters_t *p = &r->p;
    const double fan = blown(r);
    int rows = p->rows, columns = p->columns;
    double orthogonal = 1e-6 * mixed(p->orthogonal_uw_per_k, p->orthogonal_fan_uw_per_k, fan);
    double diagonal = 1e-6 * mixed(p->diagonal_uw_per_k, p->diagonal_fan_uw_per_k, fan);
    double to_air = 0.0, to_plate = 0.0;
    if (p->air_exchange_uw_per_k == 0) {
        air = r->ambient_c;
    }
    static const int down[4] = {0, 1, 0, -1}; /* east, south, west, north */
    static const int right[4] = {1, 0, -1, 0};
    for (int i = 0; i < r->n; i++) {
        int row = i / columns, column = i % columns;
        double flow = power[i];
        for (int dr = -1; dr <= 1; dr++) {
            for (int dc = -1; dc <= 1; dc++) {
                int rr = row + dr, cc = column + dc;
                if ((dr || dc) && rr >= 0 && rr < rows && cc >= 0 && cc < columns) {
                    flow += (dr && dc ? diagonal : orthogonal) * (t[rr * columns + cc] - t[i]);
                }
            }
        }
        double above = t[i] - air;
        double natural = 1e-6 * p->loss_uw_per_k *
                         (1.0 + 1e-6 * p->loss_rise_ppm_per_k * (above > 0.0 ? above : 0.0));
        double loss = 1e-3 * p->loss_scale_permille[i] *
                      mixed(natural, 1e-6 * p->loss_fan_uw_per_k, fan) * above;
        flow -= loss;
        to_air += loss;
        int ur = row - down[p->wake_direction], uc = column - right[p->wake_direction];
        if (ur >= 0 && ur < rows && uc >= 0 && uc < columns) {
            double brought = 1e-6 * p->wake_uw_per_k * fan * (t[ur * columns + uc] - air);
            flow += brought;
            to_air -= brought;
        }
        double radiated = 1e-8 * p->radiating_area_cmm2 * stefan_boltzmann *
                          (pow(t[i] + 273.15, 4) - pow(r->ambient_c + 273.15, 4));
        double down_w = 1e-6 * p->plate_coupling_uw_per_k * (t[i] - plate);
        flow -= radiated + down_w;
        to_plate += down_w;
        rate[i] = flow / (1e-6 * p->heat_capacity_mj_per_k * p->heat_capacity_scale_permille[i]);
    }
    *air_rate = p->air_exchange_uw_per_k == 0
                    ? 0.0
                    : (to_air - 1e-6 * p->air_exchange_uw_per_k * (air - r->ambient_c)) /
                          (1e-3 * p->air_heat_capacity_mj_per_k);
    *plate_rate = p->plate_coupling_uw_per_k == 0
                      ? 0.0
                      : (to_plate - 1e-6 * p->plate_loss_uw_per_k * (plate - r->ambient_c)) /
                            (1e-3 * p->plate_heat_capacity_mj_per_k);
}

void reference_advance(reference_network_t *r, const double power_w[], double seconds, int substeps)
{
    double dt = seconds / substeps;
    double t[REFERENCE_MAX], rate[REFERENCE_MAX], air_rate, plate_rate;
    while (substeps-- > 0) {
        for (int i = 0; i < r->n; i++) {
            t[i] = r->spring[i].temperature_c;
        }
        rates(r, t, r->air_c, r->plate_c, power_w, rate, &air_rate, &plate_rate);
        for (int i = 0; i < r->n; i++) {
            reference_spring_t trial = r->spring[i]; /* half a step ahead; its memory is dropped */
            t[i] = settle(r, &trial, trial.enthalpy_k + 0.5 * dt * rate[i]);
        }
        rates(r, t, r->air_c + 0.5 * dt * air_rate, r->plate_c + 0.5 * dt * plate_rate, power_w,
              rate, &air_rate, &plate_rate);
        r->air_c += dt * air_rate;
        r->plate_c += dt * plate_rate;
        for (int i = 0; i < r->n; i++) {
            reference_spring_t *s = &r->spring[i];
            s->enthalpy_k += dt * rate[i];
            s->temperature_c = settle(r, s, s->enthalpy_k);
        }
    }
}
