#include "shares.h"

#include <math.h>

#define Z 1.959964

typedef struct {
    double value, variance, of;
    int runs;
} ratio_t;

/* Of the sums, with its variance by the runs' residuals. */
static ratio_t ratio_of(const shares_run_t run[], int runs)
{
    ratio_t ratio = {NAN, NAN, 0.0, 0};
    double hits = 0.0, squares = 0.0;
    for (int i = 0; i < runs; i++) {
        hits += run[i].hits;
        ratio.of += run[i].of;
        ratio.runs += run[i].of > 0.0;
    }
    if (ratio.runs == 0) {
        return ratio;
    }
    ratio.value = hits / ratio.of;
    for (int i = 0; i < runs; i++) {
        double residual = run[i].hits - ratio.value * run[i].of;
        squares += residual * residual;
    }
    if (ratio.runs > 1) {
        ratio.variance = squares / (ratio.of * ratio.of) * ratio.runs / (ratio.runs - 1);
    }
    return ratio;
}

shares_t shares_wilson(double share, double of)
{
    const double z2 = Z * Z, scale = 1.0 / (1.0 + z2 / of);
    double middle = scale * (share + 0.5 * z2 / of);
    double half = scale * Z * sqrt(share * (1.0 - share) / of + 0.25 * z2 / (of * of));
    return (shares_t){share, fmax(middle - half, 0.0), fmin(middle + half, 1.0)};
}

shares_t shares_share(const shares_run_t run[], int runs)
{
    ratio_t ratio = ratio_of(run, runs);
    if (ratio.runs == 0) {
        return (shares_t){NAN, NAN, NAN};
    }
    double share = fmin(fmax(ratio.value, 0.0), 1.0); /* seconds add up to more by rounding */
    double scatter = share * (1.0 - share);
    double of = ratio.variance > 0.0 ? fmin(scatter / ratio.variance, ratio.of) : ratio.runs;
    return shares_wilson(share, of);
}

shares_t shares_mean(const shares_run_t run[], int runs)
{
    ratio_t ratio = ratio_of(run, runs);
    double half = Z * sqrt(ratio.variance);
    return (shares_t){ratio.value, ratio.value - half, ratio.value + half};
}

double shares_sign_test(int a, int b)
{
    int n = a + b;
    double sum = 0.0;
    for (int k = 0; k <= (a < b ? a : b); k++) {
        sum += exp(lgamma(n + 1.0) - lgamma(k + 1.0) - lgamma(n - k + 1.0) - n * log(2.0));
    }
    return fmin(2.0 * sum, 1.0);
}
