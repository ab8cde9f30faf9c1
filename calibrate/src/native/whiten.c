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
EXPORT double weigh(size_t rows, const double *step_s, const unsigned char *there,
                    const double *variance, const double *time_constant_s, size_t columns,
                    double *states, const double *fields, double *out);

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

#define SLOPES 4 /* by the logarithms of two variances and of two time constants */

/* What is known of the two errors at a row, and its slopes. */
typedef struct {
    double aa, ab, bb;
    double d_aa[SLOPES], d_ab[SLOPES], d_bb[SLOPES];
} known_t;

static void known_goes_on(known_t *known, const double *variance, const double *keep,
                          const double *fade)
{
    const double va = variance[0], vb = variance[1], ka = keep[0], kb = keep[1];
    for (size_t s = 0; s < SLOPES; s++) {
        const double d_ka = s == 2 ? fade[0] : 0.0, d_kb = s == 3 ? fade[1] : 0.0;
        const double d_va = s == 0 ? va : 0.0, d_vb = s == 1 ? vb : 0.0;
        known->d_aa[s] =
            d_va + ka * ka * (known->d_aa[s] - d_va) + 2.0 * ka * d_ka * (known->aa - va);
        known->d_bb[s] =
            d_vb + kb * kb * (known->d_bb[s] - d_vb) + 2.0 * kb * d_kb * (known->bb - vb);
        known->d_ab[s] = ka * kb * known->d_ab[s] + (d_ka * kb + ka * d_kb) * known->ab;
    }
    known->aa = va + ka * ka * (known->aa - va);
    known->bb = vb + kb * kb * (known->bb - vb);
    known->ab *= ka * kb;
}

/* What fields (rows * columns) weigh with two errors that last: out[0] is the sum of the squares of
 * what `whiten` would make of them, out[1] the sum of its logarithms, of one column; after each its
 * slopes, by the logarithms of both variances and of both time constants: out[2..5], out[6..9].
 * step_s[row] leads to a row from the one before; over one in which all is forgotten another log
 * may begin. states: room for 10 * columns. Nothing else is written. Returns out[1]. */
double weigh(size_t rows, const double *step_s, const unsigned char *there, const double *variance,
             const double *time_constant_s, size_t columns, double *states, const double *fields,
             double *out)
{
    known_t known = {.aa = 0.0};                 /* at the first row all is forgotten */
    double k[2] = {0.0, 0.0}, f[2] = {0.0, 0.0}; /* what is left of each, and its slope */
    double *quick = states, *slow = quick + columns, *d_quick = slow + columns;
    double *d_slow = d_quick + SLOPES * columns;
    double product = 1.0;
    for (size_t c = 0; c < (2 + 2 * SLOPES) * columns; c++) {
        states[c] = 0.0;
    }
    for (size_t k = 0; k < 2 + 2 * SLOPES; k++) {
        out[k] = 0.0;
    }
    for (size_t row = 0; row < rows; row++) {
        for (size_t e = 0; row > 0 && step_s[row] != step_s[row - 1] && e < 2; e++) {
            const double pace = step_s[row] / time_constant_s[e];
            k[e] = exp(-pace);
            f[e] = pace * k[e];
        }
        known_goes_on(&known, variance, k, f);
        double gain_a = 0.0, gain_b = 0.0, inverse = 0.0;
        double d_gain_a[SLOPES] = {0.0}, d_gain_b[SLOPES] = {0.0}, d_spread[SLOPES] = {0.0};
        if (there[row]) {
            const double seen_a = known.aa + known.ab, seen_b = known.ab + known.bb;
            const double spread = 1.0 + seen_a + seen_b;
            inverse = 1.0 / spread;
            gain_a = seen_a * inverse;
            gain_b = seen_b * inverse;
            for (size_t s = 0; s < SLOPES; s++) {
                const double d_a = known.d_aa[s] + known.d_ab[s];
                const double d_b = known.d_ab[s] + known.d_bb[s];
                d_spread[s] = d_a + d_b;
                d_gain_a[s] = (d_a - gain_a * d_spread[s]) * inverse;
                d_gain_b[s] = (d_b - gain_b * d_spread[s]) * inverse;
                known.d_aa[s] -= d_gain_a[s] * seen_a + gain_a * d_a;
                known.d_ab[s] -= d_gain_a[s] * seen_b + gain_a * d_b;
                known.d_bb[s] -= d_gain_b[s] * seen_b + gain_b * d_b;
                out[6 + s] += 0.5 * d_spread[s] * inverse;
            }
            known.aa -= gain_a * seen_a;
            known.ab -= gain_a * seen_b;
            known.bb -= gain_b * seen_b;
            product *= spread;
            if (product > 1e200) { /* a logarithm a row would be most of the time */
                out[1] += 0.5 * log(product);
                product = 1.0;
            }
        }
        const double *now = fields + row * columns;
        for (size_t c = 0; c < columns; c++) {
            const double a = k[0] * quick[c], b = k[1] * slow[c];
            const double left = there[row] ? now[c] - a - b : 0.0, part = left * inverse;
            for (size_t s = 0; s < SLOPES; s++) {
                double *d_a = d_quick + SLOPES * c + s, *d_b = d_slow + SLOPES * c + s;
                const double moved_a = k[0] * *d_a + (s == 2 ? f[0] * quick[c] : 0.0);
                const double moved_b = k[1] * *d_b + (s == 3 ? f[1] * slow[c] : 0.0);
                const double d_left = -moved_a - moved_b;
                *d_a = moved_a + d_gain_a[s] * left + gain_a * d_left;
                *d_b = moved_b + d_gain_b[s] * left + gain_b * d_left;
                out[2 + s] += part * (2.0 * d_left - part * d_spread[s]);
            }
            quick[c] = a + gain_a * left;
            slow[c] = b + gain_b * left;
            out[0] += left * part;
        }
    }
    return out[1] += 0.5 * log(product);
}
