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

static plant_status_t put(plant_t *plant, const double *first_c, const double *guess_c)
{
    for (int k = 0; k < plant_spring_count(plant); k++) {
        const plant_status_t status =
            isfinite(first_c[k]) ? plant_set_temperature(plant, k, guess_c[k]) : PLANT_OK;
        if (status != PLANT_OK) {
            return status;
        }
    }
    return PLANT_OK;
}

/* Where the springs must be for that: guess_c[n]. Leaves the plant there. */
static plant_status_t search(plant_t *plant, const double *first_c, double *guess_c)
{
    const int springs = plant_spring_count(plant);
    double off_k[PLANT_MAX_SPRINGS], least_k = INFINITY;
    for (int k = 0; k < springs; k++) {
        guess_c[k] = fmin(fmax(first_c[k], COLDEST_C), HOTTEST_C);
    }
    for (int turn = 0; turn < TURNS; turn++) {
        double most_k = 0.0;
        const plant_status_t status = put(plant, first_c, guess_c);
        if (status != PLANT_OK) {
            return status;
        }
        for (int k = 0; k < springs; k++) {
            const double wanted_c = fmin(fmax(first_c[k], COLDEST_C), HOTTEST_C);
            off_k[k] = isfinite(first_c[k]) ? wanted_c - plant_measured_c(plant, k) : 0.0;
            most_k = fmax(most_k, fabs(off_k[k]));
        }
        if (most_k < NEAR_C || most_k > NO_NEARER * least_k || turn == TURNS - 1) {
            break;
        }
        least_k = most_k;
        for (int k = 0; k < springs; k++) {
            guess_c[k] = fmin(fmax(guess_c[k] + off_k[k], COLDEST_C), HOTTEST_C);
        }
    }
    return PLANT_OK;
}

/* Puts the springs where the sensors show first_c[n], as near as they can; one that is not
 * finite stays where it is. Their phases follow as if each had been led there straight: a twin is
 * led about meanwhile, or what was tried too hot would leave austenite behind.
 * 0 done, else the plant's status. */
int plant_start_from_measured(plant_t *plant, const double *first_c)
{
    plant_t *twin = plant_copy(plant);
    if (twin == NULL) {
        return (int)PLANT_ERROR_MEMORY;
    }
    double guess_c[PLANT_MAX_SPRINGS];
    plant_status_t status = search(twin, first_c, guess_c);
    plant_destroy(twin);
    if (status == PLANT_OK) {
        status = put(plant, first_c, guess_c);
    }
    return (int)status;
}
