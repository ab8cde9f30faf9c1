#include "kinetics.h"

#include <math.h>
#include <string.h>

static const double PI = 3.14159265358979323846;
static const double LEFT_AT_FINISH = 0.01;

/* What is left of the transforming phase at progress u of the way from start to finish, and the
 * derivative by u: the three laws that differ in nothing else. */
static double left(kinetics_law_t law, double u, double *slope)
{
    *slope = 0.0;
    if (u <= 0.0) {
        return 1.0;
    }
    if (law == KINETICS_EXPONENTIAL) {
        double rate = log(LEFT_AT_FINISH), value = exp(rate * u);
        *slope = rate * value;
        return value;
    }
    if (u >= 1.0) {
        return 0.0;
    }
    if (law == KINETICS_LINEAR) {
        *slope = -1.0;
        return 1.0 - u;
    }
    *slope = -0.5 * PI * sin(PI * u);
    return 0.5 * (1.0 + cos(PI * u));
}

/* Either branch converts what it found when it began, by the major curve; moving back without
 * transforming and forth again goes on where it was. */
static void move_restarting(grain_t *grain, const alloy_t *alloy, double heating_c,
                            double cooling_c)
{
    double slope;
    if (heating_c > fmax(grain->hottest_c, alloy->austenite_start_c)) {
        double width_k = alloy->austenite_finish_c - alloy->austenite_start_c;
        if (isinf(grain->hottest_c)) {
            grain->martensite_from = 1.0 - grain->austenite;
        }
        grain->hottest_c = heating_c;
        grain->coldest_c = INFINITY;
        double rest = left(alloy->law, (heating_c - alloy->austenite_start_c) / width_k, &slope);
        grain->austenite = 1.0 - grain->martensite_from * rest;
        grain->latent_per_k = -grain->martensite_from * slope / width_k;
    } else if (cooling_c < fmin(grain->coldest_c, alloy->martensite_start_c)) {
        double width_k = alloy->martensite_start_c - alloy->martensite_finish_c;
        if (isinf(grain->coldest_c)) {
            grain->austenite_from = grain->austenite;
        }
        grain->coldest_c = cooling_c;
        grain->hottest_c = -INFINITY;
        double rest = left(alloy->law, (alloy->martensite_start_c - cooling_c) / width_k, &slope);
        grain->austenite = grain->austenite_from * rest;
        grain->latent_per_k = -grain->austenite_from * slope / width_k;
    }
    grain->latent = grain->austenite;
}

/* Share of relays whose threshold has been passed at progress u, and its derivative. */
static double passed(double u, double *slope)
{
    u = fmin(fmax(u, 0.0), 1.0);
    *slope = 6.0 * u * (1.0 - u);
    return u * u * (3.0 - 2.0 * u);
}

/* Preisach with relays whose upper and lower thresholds are independent. Each loop of the staircase
 * holds: 'risen' of the relays were switched on by its maximum, then 'fallen' of them switched off
 * by the minimum that followed. A larger swing wipes out the smaller ones within it. Returns the
 * share that is on. */
static double move_relays(grain_t *grain, double risen, double risen_per_k, double fallen,
                          double fallen_per_k, double *per_k)
{
    int n = grain->loops;
    if (risen > 0.0) {
        while (n > 0 && grain->loop[n - 1].risen <= risen) {
            n--;
        }
        double fallen_before = n > 0 ? grain->loop[n - 1].fallen : 1.0;
        if (fallen_before > 0.0) { /* else this rise is within the one that is under way */
            n += n < KINETICS_LOOPS;
            grain->loop[n - 1].risen = risen;
            grain->loop[n - 1].fallen = 0.0;
            *per_k = risen_per_k * fallen_before;
        }
    }
    if (fallen > 0.0) {
        while (n > 0 && fallen >= (n > 1 ? grain->loop[n - 2].fallen : 1.0)) {
            n--;
        }
        if (n > 0 && fallen > grain->loop[n - 1].fallen) {
            grain->loop[n - 1].fallen = fallen;
            *per_k = fallen_per_k * grain->loop[n - 1].risen;
        }
    }
    grain->loops = n;
    double on = 0.0, fallen_before = 1.0;
    for (int k = 0; k < n; k++) {
        on += grain->loop[k].risen * (fallen_before - grain->loop[k].fallen);
        fallen_before = grain->loop[k].fallen;
    }
    return on;
}

static void move_preisach(grain_t *grain, const alloy_t *alloy, double heating_c, double cooling_c)
{
    double up_k = alloy->austenite_finish_c - alloy->austenite_start_c;
    double down_k = alloy->martensite_start_c - alloy->martensite_finish_c;
    bool has_r = alloy->law == KINETICS_R_PHASE;
    double start_c = alloy->martensite_start_c - (has_r ? KINETICS_R_RANGE_K : 0.0);
    double risen_slope, fallen_slope, per_k = 0.0;
    double risen = passed((heating_c - alloy->austenite_start_c) / up_k, &risen_slope);
    double fallen = passed((start_c - cooling_c) / down_k, &fallen_slope);
    double on =
        move_relays(grain, risen, risen_slope / up_k, fallen, fallen_slope / down_k, &per_k);
    if (!has_r) {
        grain->austenite = grain->latent = on;
        grain->latent_per_k = per_k;
        return;
    }
    /* What is not martensite is austenite or R-phase: a narrow loop, all relays of one width. */
    double play_c = fmin(fmax(grain->play_c, heating_c - KINETICS_R_HYSTERESIS_K), cooling_c);
    double slope, split = passed((play_c - alloy->martensite_finish_c) / down_k, &slope);
    slope = play_c != grain->play_c ? slope / down_k : 0.0;
    grain->play_c = play_c;
    grain->austenite = on * split;
    grain->r_phase = on - grain->austenite;
    grain->latent = on * (1.0 - KINETICS_R_LATENT) + grain->austenite * KINETICS_R_LATENT;
    grain->latent_per_k = per_k * (1.0 - KINETICS_R_LATENT + KINETICS_R_LATENT * split) +
                          KINETICS_R_LATENT * on * slope;
}

/* What a branch has of austenite that goes from 1 % at one of these temperatures to 99 % at the
 * other, as a hyperbolic tangent; and its slope. */
static double smooth_branch(double c, double low_c, double high_c, double *slope)
{
    static const double ends = 2.2976; /* artanh 0.98 */
    double rate = 2.0 * ends / (high_c - low_c);
    double way = tanh(rate * (c - 0.5 * (low_c + high_c)));
    *slope = 0.5 * rate * (1.0 - way * way);
    return 0.5 * (1.0 + way);
}

/* A play operator: what is austenite stays as it is between the branch of heating and that of
 * cooling, and goes along either. */
static void move_play(grain_t *grain, const alloy_t *alloy, double heating_c, double cooling_c)
{
    double rising, falling;
    double least =
        smooth_branch(heating_c, alloy->austenite_start_c, alloy->austenite_finish_c, &rising);
    double most =
        smooth_branch(cooling_c, alloy->martensite_finish_c, alloy->martensite_start_c, &falling);
    if (grain->austenite < least) {
        grain->austenite = least;
        grain->latent_per_k = rising;
    } else if (grain->austenite > fmax(least, most)) { /* wide tails may cross */
        grain->austenite = fmax(least, most);
        grain->latent_per_k = least > most ? rising : falling;
    }
    grain->latent = grain->austenite;
}

void grain_move(grain_t *grain, const alloy_t *alloy, double heating_c, double cooling_c)
{
    grain->latent_per_k = 0.0;
    if (alloy->law == KINETICS_PREISACH || alloy->law == KINETICS_R_PHASE) {
        move_preisach(grain, alloy, heating_c, cooling_c);
    } else if (alloy->law == KINETICS_PLAY) {
        move_play(grain, alloy, heating_c, cooling_c);
    } else {
        move_restarting(grain, alloy, heating_c, cooling_c);
    }
}

void grain_start(grain_t *grain, const alloy_t *alloy, double temperature_c, bool was_austenite)
{
    memset(grain, 0, sizeof *grain);
    grain->hottest_c = -INFINITY;
    grain->coldest_c = INFINITY;
    grain->play_c = -200.0;
    if (was_austenite) {
        grain_move(grain, alloy, 400.0, 400.0);
    }
    grain_move(grain, alloy, temperature_c, temperature_c);
}
