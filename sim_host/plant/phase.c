#include "plant_internal.h"

#include <math.h>
#include <string.h>

/* Liang and Rogers, J. Intell. Mater. Syst. Struct. 1 (1990) 207, with the turning point as memory:
 * a branch starts where the opposite transformation last ended, so that a loop that transforms
 * nothing leaves no trace. */

/* Cosine from 0 at low to 1 at high; *slope is its derivative. */
static double smooth_rise(double t, double low, double high, double *slope)
{
    *slope = 0.0;
    if (t <= low)
        return 0.0;
    if (t >= high)
        return 1.0;
    const double rate = PI / (high - low);
    const double angle = (t - low) * rate;
    *slope = 0.5 * rate * sin(angle);
    return 0.5 - 0.5 * cos(angle);
}

static double rising(const plant_t *p, int i, double t, double *slope)
{
    return smooth_rise(t, p->points[i].austenite_start_c, p->points[i].austenite_finish_c, slope);
}

static double falling(const plant_t *p, int i, double t, double *slope)
{
    return smooth_rise(t, p->points[i].martensite_finish_c, p->points[i].martensite_start_c, slope);
}

double plant_phase_fraction(const plant_t *p, int i, double t, double *slope)
{
    *slope = 0.0;
    if (t > p->heat_from_c[i]) {
        const double rise = rising(p, i, t, slope);
        *slope *= 1.0 - p->heat_start[i];
        const double fraction = p->heat_start[i] + (1.0 - p->heat_start[i]) * rise;
        if (fraction >= p->austenite[i])
            return fraction;
        *slope = 0.0; /* rounding at the turning point */
    } else if (t < p->cool_from_c[i]) {
        const double fall = falling(p, i, t, slope);
        *slope *= p->cool_start[i];
        const double fraction = p->cool_start[i] * fall;
        if (fraction <= p->austenite[i])
            return fraction;
        *slope = 0.0;
    }
    return p->austenite[i];
}

/* Where heating and cooling transform next, seen from t. */
static void set_thresholds(plant_t *p, int i, double t)
{
    p->heat_from_c[i] = p->austenite[i] < 1.0 ? fmax(t, p->points[i].austenite_start_c) : HUGE_VAL;
    p->cool_from_c[i] =
        p->austenite[i] > 0.0 ? fmin(t, p->points[i].martensite_start_c) : -HUGE_VAL;
}

/* The present fraction, as far as the outer loop allows it at t. */
static double allowed(const plant_t *p, int i, double t)
{
    double slope;
    return fmin(fmax(p->austenite[i], rising(p, i, t, &slope)), falling(p, i, t, &slope));
}

void plant_phase_anchor(plant_t *p, int i)
{
    double slope;
    const double t = p->temperature_c[i];
    const double rise = rising(p, i, t, &slope), fall = falling(p, i, t, &slope);
    p->austenite[i] = fmin(fmax(p->austenite[i], rise), fall);
    p->heat_start[i] = rise < 1.0 ? (p->austenite[i] - rise) / (1.0 - rise) : 0.0;
    p->cool_start[i] = fall > 0.0 ? p->austenite[i] / fall : 0.0;
    set_thresholds(p, i, t);
}

void plant_phase_move(plant_t *p, int i, double t)
{
    double slope;
    const double before = p->austenite[i];
    const double after = plant_phase_fraction(p, i, t, &slope);
    p->temperature_c[i] = t;
    if (after == before)
        return;
    p->austenite[i] = after;
    set_thresholds(p, i, t);
    if (after > before) {
        const double fall = falling(p, i, t, &slope);
        p->cool_start[i] = fall > 0.0 ? after / fall : 0.0;
    } else {
        const double rise = rising(p, i, t, &slope);
        p->heat_start[i] = rise < 1.0 ? (after - rise) / (1.0 - rise) : 0.0;
    }
}

double plant_phase_latent_j(const plant_t *p, int i, double change)
{
    return change * (change > 0.0 ? p->latent_j[i] : p->latent_cooling_j[i]);
}

/* Temperature of spring i that has taken up heat_j since the last accepted state while it
 * transforms. capacity (T - T0) + latent (fraction(T) - fraction0) = heat, monotone in T: Newton
 * inside a bracket. */
static double invert_enthalpy(const plant_t *p, int i, double heat_j, double guess_c)
{
    const double t0 = p->temperature_c[i], c = p->capacity[i], x0 = p->austenite[i];
    const double straight = t0 + heat_j * p->inverse_capacity[i];
    double low = fmin(t0, straight), high = fmax(t0, straight);
    double t = guess_c > low && guess_c < high ? guess_c : straight;
    for (int iteration = 0; iteration < 60; iteration++) {
        double slope;
        const double change = plant_phase_fraction(p, i, t, &slope) - x0;
        const double excess = c * (t - t0) + plant_phase_latent_j(p, i, change) - heat_j;
        if (fabs(excess) <= 1e-10 * c) /* 1e-10 K */
            break;
        if (excess > 0.0)
            high = t;
        else
            low = t;
        const double latent = straight > t0 ? p->latent_j[i] : p->latent_cooling_j[i];
        double next = t - excess / (c + latent * slope);
        if (!(next >= low && next <= high))
            next = 0.5 * (low + high);
        if (next == t)
            break;
        t = next;
    }
    return t;
}

double plant_phase_temperature_after(const plant_t *p, int i, double heat_j, double guess_c)
{
    const double t = p->temperature_c[i] + heat_j * p->inverse_capacity[i];
    if (p->latent_j[i] > 0.0 && plant_phase_moves(p, i, t))
        return invert_enthalpy(p, i, heat_j, guess_c);
    return t;
}

plant_status_t plant_check(const plant_t *p, const char **message)
{
    const double mf = scalar(p, P_martensite_finish_c), ms = scalar(p, P_martensite_start_c);
    const double as = scalar(p, P_austenite_start_c), af = scalar(p, P_austenite_finish_c);
    const char *text = NULL;
    if (!(mf < ms))
        text = "martensite_finish_c must be below martensite_start_c";
    else if (!(as < af))
        text = "austenite_start_c must be below austenite_finish_c";
    else if (!(mf < as))
        text = "martensite_finish_c must be below austenite_start_c";
    else if (!(ms < af))
        text = "martensite_start_c must be below austenite_finish_c";
    if (message)
        *message = text;
    return text ? PLANT_ERROR_RANGE : PLANT_OK;
}

static points_t points_of(const plant_t *p, int i)
{
    const double loaded = scalar(p, P_transformation_shift_k_per_n) * p->value[P_load_n][i];
    const double shift =
        p->on[E_transformation_shift] ? p->value[P_transformation_shift_k][i] + loaded : 0.0;
    return (points_t){
        scalar(p, P_martensite_finish_c) + shift, scalar(p, P_martensite_start_c) + shift,
        scalar(p, P_austenite_start_c) + shift, scalar(p, P_austenite_finish_c) + shift};
}

/* The points have moved: where the outer loop no longer allows the fraction at this temperature,
 * the spring transforms until temperature and fraction agree, and takes up no heat in all. */
static void follow_points(plant_t *p, int i)
{
    const double t0 = p->temperature_c[i], x0 = p->austenite[i], c = p->capacity[i];
    if (allowed(p, i, t0) != x0) {
        double low = t0 - p->latent_j[i] / c, high = t0 + p->latent_cooling_j[i] / c;
        for (int k = 0; k < 60; k++) { /* to the last bit */
            const double t = 0.5 * (low + high);
            const double heat_j = c * (t - t0) + plant_phase_latent_j(p, i, allowed(p, i, t) - x0);
            *(heat_j > 0.0 ? &high : &low) = t;
        }
        p->temperature_c[i] = 0.5 * (low + high);
    }
    plant_phase_anchor(p, i);
    p->stored_j +=
        c * (p->temperature_c[i] - t0) + plant_phase_latent_j(p, i, p->austenite[i] - x0);
}

void plant_phase_prepare(plant_t *p)
{
    for (int i = 0; i < p->n; i++) {
        p->latent_j[i] = p->on[E_latent_heat] ? p->value[P_latent_heat_j][i] : 0.0;
        if (p->on[E_spring_mismatch])
            p->latent_j[i] *= p->value[P_heat_capacity_scale][i];
        p->latent_cooling_j[i] = p->latent_j[i] * scalar(p, P_latent_cooling_ratio);
        const points_t points = points_of(p, i);
        const bool moved = memcmp(&points, &p->points[i], sizeof points) != 0;
        p->points[i] = points;
        if (p->restarted || p->time_s == 0.0) /* a starting state */
            plant_phase_anchor(p, i);
        else if (moved)
            follow_points(p, i);
    }
    p->restarted = false;
}
