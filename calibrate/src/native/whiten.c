/* What it is for: what a model leaves of readings as the innovations of a filter that knows how
 * errors last. What it owns: the walk over rows. What it never does: fit, or know what a spring is.
 *
 * A reading's error is white noise of unit variance and up to WHITEN_ERRORS errors that fade, each
 * with its own time constant (Ornstein-Uhlenbeck processes: what heat that nobody logged leaves in
 * a node that loses it). The filter is Kalman's (Anderson and Moore, Optimal Filtering, 1979,
 * chapter 6), its gains those of each row: rows may be missing and uneven. */
#include <math.h>
#include <stddef.h>

#define EXPORT        __attribute__((visibility("default")))
#define WHITEN_ERRORS 4

typedef struct {
    size_t count;
    double variance[WHITEN_ERRORS];
    double time_constant_s[WHITEN_ERRORS];
} errors_t;

EXPORT double whiten(size_t rows, size_t errors, const double *step_s, const unsigned char *there,
                     const double *variance, const double *time_constant_s, size_t columns,
                     double *states, double *fields);

/* The covariance of the errors before a row is read, from that after the row before. */
static void go_on(const errors_t *errors, const double *keep,
                  double covariance[WHITEN_ERRORS][WHITEN_ERRORS])
{
    for (size_t a = 0; a < errors->count; a++) {
        for (size_t b = 0; b < errors->count; b++) {
            covariance[a][b] *= keep[a] * keep[b];
        }
        covariance[a][a] += errors->variance[a] * (1.0 - keep[a] * keep[a]);
    }
}

/* Turns fields (rows * columns) into innovations over their standard deviations, in place, 0 in
 * rows where there[row] is 0. step_s[row] leads to a row from the one before. variance,
 * time_constant_s: of each of `errors` (at most WHITEN_ERRORS) errors; their variance in units of
 * the white noise's. Returns the sum over rows of the logarithm of the innovations' deviations, the
 * same for each column; NaN where there are too many errors. states: room for errors * columns. */
double whiten(size_t rows, size_t errors, const double *step_s, const unsigned char *there,
              const double *variance, const double *time_constant_s, size_t columns, double *states,
              double *fields)
{
    if (errors > WHITEN_ERRORS) {
        return NAN;
    }
    errors_t known = {.count = errors};
    double covariance[WHITEN_ERRORS][WHITEN_ERRORS] = {{0.0}};
    double gain[WHITEN_ERRORS] = {0.0};
    double keep[WHITEN_ERRORS] = {0.0};
    for (size_t a = 0; a < errors; a++) {
        known.variance[a] = variance[a];
        known.time_constant_s[a] = time_constant_s[a];
        covariance[a][a] = variance[a];
    }
    double logarithms = 0.0;
    double step_before = -1.0;
    for (size_t at = 0; at < errors * columns; at++) {
        states[at] = 0.0;
    }
    for (size_t row = 0; row < rows; row++) {
        double *now = fields + row * columns;
        if (row > 0) {
            if (step_s[row] != step_before) {
                step_before = step_s[row];
                for (size_t a = 0; a < errors; a++) {
                    keep[a] = exp(-step_before / known.time_constant_s[a]);
                }
            }
            go_on(&known, keep, covariance);
            for (size_t a = 0; a < errors; a++) {
                for (size_t c = 0; c < columns; c++) {
                    states[a * columns + c] *= keep[a];
                }
            }
        }
        if (!there[row]) {
            for (size_t c = 0; c < columns; c++) {
                now[c] = 0.0;
            }
            continue;
        }
        double spread = 1.0;
        double seen[WHITEN_ERRORS] = {0.0};
        for (size_t a = 0; a < errors; a++) {
            for (size_t b = 0; b < errors; b++) {
                seen[a] += covariance[a][b];
            }
            spread += seen[a];
        }
        for (size_t a = 0; a < errors; a++) {
            gain[a] = seen[a] / spread;
        }
        for (size_t a = 0; a < errors; a++) {
            for (size_t b = 0; b < errors; b++) {
                covariance[a][b] -= gain[a] * seen[b];
            }
        }
        const double scale = 1.0 / sqrt(spread);
        logarithms += 0.5 * log(spread);
        for (size_t a = 0; a < errors; a++) {
            const double *own = states + a * columns;
            for (size_t c = 0; c < columns; c++) {
                now[c] -= own[c];
            }
        }
        for (size_t a = 0; a < errors; a++) {
            double *own = states + a * columns;
            for (size_t c = 0; c < columns; c++) {
                own[c] += gain[a] * now[c];
            }
        }
        for (size_t c = 0; c < columns; c++) {
            now[c] *= scale;
        }
    }
    return logarithms;
}
