#include "plant_internal.h"

#include <math.h>
#include <string.h>

/* First-order lag over h, exact for a parabola through the temperatures at start, middle and end.
 */
static double lag(double shown, double t0, double middle, double t1, double tau, double h)
{
    const double c = 2.0 * (t0 + t1 - 2.0 * middle) / (h * h);
    const double b = (t1 - t0) / h - c * h;
    const double end = t1 - tau * (b + 2.0 * c * h) + 2.0 * c * tau * tau;
    const double start = t0 - tau * b + 2.0 * c * tau * tau;
    return end + (shown - start) * exp(-h / tau);
}

double plant_sensors_follow(const plant_t *p, int i, double middle_c, double end_c, double h_s)
{
    return lag(p->sensor_c[i], p->temperature_c[i], middle_c, end_c, p->value[P_sensor_lag_s][i],
               h_s);
}

void plant_sensors_prepare(plant_t *p)
{
    if (!p->on[E_sensor_lag])
        memcpy(p->sensor_c, p->temperature_c, (size_t)p->n * sizeof(double));
}

/* Sides or corners of a spring at which the array has no neighbour. */
static double missing(const neighbours_t *neighbours, int i)
{
    return 4.0 - (double)(neighbours->start[i + 1] - neighbours->start[i]);
}

double plant_measured_c(const plant_t *p, int spring)
{
    double seen = p->sensor_c[spring];
    const double ambient = plant_network_ambient(p, p->time_s);
    if (p->on[E_optical_mixing]) {
        const neighbours_t *const sides = &p->neighbours[NEIGHBOUR_ORTHOGONAL];
        const neighbours_t *const corners = &p->neighbours[NEIGHBOUR_DIAGONAL];
        const double beyond = scalar(p, P_optical_beyond) * (ambient - seen);
        const double orthogonal =
            neighbour_difference(sides, p->sensor_c, spring) + missing(sides, spring) * beyond;
        const double diagonal =
            neighbour_difference(corners, p->sensor_c, spring) + missing(corners, spring) * beyond;
        const double background = ambient + scalar(p, P_optical_background_rise_k);
        seen +=
            scalar(p, P_optical_orthogonal) * orthogonal + scalar(p, P_optical_diagonal) * diagonal;
        seen += scalar(p, P_optical_background) * (background - seen);
    }
    if (p->on[E_sensor_gain])
        seen = ambient + p->value[P_sensor_gain][spring] * (seen - ambient) +
               p->value[P_sensor_offset_k][spring];
    return seen;
}
