#include "plant_internal.h"

#include <math.h>
#include <stdlib.h>
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

/* Beyond so many widths there is nothing: less than 1e-5 of all, a shape of 0.5 apart. */
#define OPTICAL_REACH 12.0

/* Of the weight at a distance of 1: so a narrow spread ends at the nearest neighbours, not at 0 /
 * 0. */
static double optical_profile(double distance, double width, double shape)
{
    return exp((1.0 - pow(distance, shape)) / pow(width, shape));
}

void plant_sensors_spread(plant_t *p)
{
    const double share = scalar(p, P_optical_share), width = scalar(p, P_optical_width);
    const double shape = scalar(p, P_optical_shape);
    if (width <= 0.0) /* a plant that is being made */
        return;
    const int reach = (int)ceil(OPTICAL_REACH * width);
    double all = 0.0;
    for (int down = 0; down <= reach; down++)
        for (int along = 1; along <= reach; along++) /* a quarter of the plane, turned four times */
            all += 4.0 * optical_profile(hypot(down, along), width, shape);
    p->optical_weight[0] = 0.0;
    for (int k = 1; k < p->rows * p->columns; k++)
        p->optical_weight[k] =
            share / all * optical_profile(hypot(k / p->columns, k % p->columns), width, shape);
}

void plant_sensors_prepare(plant_t *p)
{
    if (!p->on[E_sensor_lag])
        memcpy(p->sensor_c, p->temperature_c, (size_t)p->n * sizeof(double));
}

/* Of spring i by a camera: all others by their weight, the rest of optical_share beyond the array.
 */
static double blurred(const plant_t *p, int i, double ambient)
{
    const double own = p->sensor_c[i];
    const int row = row_of(p, i), column = i % p->columns;
    const double *const layer = p->sensor_c + (i - (row * p->columns + column));
    double seen = 0.0, within = 0.0;
    for (int r = 0; r < p->rows; r++)
        for (int c = 0; c < p->columns; c++) {
            const double weight = p->optical_weight[abs(r - row) * p->columns + abs(c - column)];
            within += weight;
            seen += weight * (layer[r * p->columns + c] - own);
        }
    return own + seen +
           scalar(p, P_optical_beyond) * (scalar(p, P_optical_share) - within) * (ambient - own);
}

double plant_measured_c(const plant_t *p, int spring)
{
    double seen = p->sensor_c[spring];
    const double ambient = plant_network_ambient(p, p->time_s);
    if (p->on[E_optical_mixing]) {
        const double background = ambient + scalar(p, P_optical_background_rise_k);
        seen = blurred(p, spring, ambient);
        seen += scalar(p, P_optical_background) * (background - seen);
    }
    if (p->on[E_sensor_gain])
        seen = ambient + p->value[P_sensor_gain][spring] * (seen - ambient) +
               p->value[P_sensor_offset_k][spring];
    return seen;
}
