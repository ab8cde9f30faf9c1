/* What it is for: a share or a mean of many runs, with the interval that it is known to.
 * What it owns: Wilson's interval, and what springs of one run count for.
 * What it never does: know what is counted. */
#ifndef WORLDS_SHARES_H
#define WORLDS_SHARES_H

typedef struct {
    double value, low, high; /* of 95 %; low and high NaN where the runs are too few to say */
} shares_t;

/* What of a run: hits of so many (springs, or seconds; degC s of s). */
typedef struct {
    double hits, of;
} shares_run_t;

/* Wilson's interval of a share of 'of' independent ones; of > 0, not necessarily whole. */
shares_t shares_wilson(double share, double of);
/* The share of all, hits <= of. Springs of one run are not independent, nor are its seconds:
 * Wilson's interval is that of as many as would scatter as the runs do, at most 'of'. Where all or
 * none are hit nothing scatters, and each run counts as one. NaN: nothing is counted. */
shares_t shares_share(const shares_run_t run[], int runs);
/* The mean of all, +- 1.96 standard errors by the runs' scatter. */
shares_t shares_mean(const shares_run_t run[], int runs);
/* Two-sided sign test: how likely a + b fair coins fall at least so unevenly. */
double shares_sign_test(int a, int b);

#endif
