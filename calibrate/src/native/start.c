/* What it is for: a plant that begins where its thermometers were read. What it owns: the way
 * there. What it never does: say which readings. */
#include <math.h>

#include "plant.h"

#define EXPORT __attribute__((visibility("default")))
#define TURNS  40
#define NEAR_C 1e-3
#define NO_NEARER                                                                                  \
    0.98 /* of how far off it was: what a blur takes away altogether never comes back */
#define COLDEST_C (-60.0)
#define HOTTEST_C 500.0

EXPORT int plant_start_from_measured(plant_t *plant, const double *first_c);

/* Puts the springs where the sensors show first_c[n], as near as they can; one that is not
 * finite stays where it is.
 * 0 done, else the plant's status. */
int plant_start_from_measured(plant_t *plant, const double *first_c)
{
    const int springs = plant_spring_count(plant);
    double guess_c[PLANT_MAX_SPRINGS], off_k[PLANT_MAX_SPRINGS], least_k = INFINITY;
    for (int k = 0; k < springs; k++) {
        guess_c[k] = fmin(fmax(first_c[k], COLDEST_C), HOTTEST_C);
    }
    for (int turn = 0; turn < TURNS; turn++) {
        double most_k = 0.0;
        for (int k = 0; k < springs; k++) {
            const plant_status_t status =
                isfinite(first_c[k]) ? plant_set_temperature(plant, k, guess_c[k]) : PLANT_OK;
            if (status != PLANT_OK) {
                return (int)status;
            }
        }
        for (int k = 0; k < springs; k++) {
            const double wanted_c = fmin(fmax(first_c[k], COLDEST_C), HOTTEST_C);
            off_k[k] = isfinite(first_c[k]) ? wanted_c - plant_measured_c(plant, k) : 0.0;
            most_k = fmax(most_k, fabs(off_k[k]));
        }
        if (most_k < NEAR_C || most_k > NO_NEARER * least_k) {
            break;
        }
        least_k = most_k;
        for (int k = 0; k < springs; k++) {
            guess_c[k] = fmin(fmax(guess_c[k] + off_k[k], COLDEST_C), HOTTEST_C);
        }
    }
    return 0;
}
