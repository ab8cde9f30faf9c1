#include "knowing.h"

#include <math.h>

#define MOST_C   119.5 /* a tick of the boost adds 0.2 K */
#define BOOST_A  3.0   /* as the controller's */
#define SUPPLY_A 14.5
#define HEATS    0.955 /* austenite: below it what is fully on is heated */
#define HEATED   0.99  /* until then, or as hot as it may be */
#define BAND     0.03  /* of a level */
#define ABOVE_K  1.5   /* its coldest part, of martensite start */

static double coldest_c(const world_t *world, int k)
{
    return fmin(world_node_c(world, k, 0),
                fmin(world_node_c(world, k, 1), world_node_c(world, k, 2)));
}

/* Whether it needs current in the next tick. */
static bool needs(knowing_t *knowing, const world_t *world, int k, uint16_t level_permille)
{
    const double austenite = world_austenite(world, k);
    const bool full = level_permille >= 1000;
    const double level = 0.001 * level_permille;
    if (level_permille == 0) {
        knowing->heats[k] = false;
        return false;
    }
    if (austenite < (full ? HEATS : level - BAND)) {
        knowing->heats[k] = true;
    } else if (austenite >= (full ? HEATED : level)) {
        knowing->heats[k] = false;
    }
    const bool keeps = coldest_c(world, k) < world_martensite_start_c(world, k) + ABOVE_K;
    return (knowing->heats[k] || keeps) && world_hottest_c(world, k) < MOST_C;
}

/* Up to most_a as a duty; what it takes. */
static double give(const world_parameters_t *parameters, const world_t *world, int k, double most_a,
                   uint16_t *duty)
{
    const double ohm = world_resistance_ohm(world, k) + parameters->loop_ohm;
    const double supply_v = world_supply_v(world), diode_v = parameters->freewheel_v;
    const double share = fmin((most_a * ohm + diode_v) / (supply_v + diode_v), 1.0);
    *duty = (uint16_t)(share * CONTROLLER_DUTY_MAX);
    return (share * supply_v - (1.0 - share) * diode_v) / ohm;
}

/* Of those that want something and have got nothing yet: first what is held, then what has most of
 * its phase. Below 0: none is left. */
static int next_of(const knowing_t *knowing, const world_t *world, const bool wants[])
{
    int next = -1;
    double most = -1.0;
    for (int k = 0; k < world_springs(world); k++) {
        const double urgent = (knowing->heats[k] ? 0.0 : 1.0) + world_austenite(world, k);
        if (wants[k] && urgent > most) {
            most = urgent;
            next = k;
        }
    }
    return next;
}

void knowing_drive(knowing_t *knowing, const world_parameters_t *parameters, const world_t *world,
                   const uint16_t level_permille[], uint16_t duty[])
{
    double left_a = SUPPLY_A;
    bool wants[WORLD_SPRINGS_MAX];
    for (int k = 0; k < world_springs(world); k++) {
        wants[k] = needs(knowing, world, k, level_permille[k]);
        duty[k] = 0;
    }
    for (int k = next_of(knowing, world, wants); k >= 0; k = next_of(knowing, world, wants)) {
        left_a -= give(parameters, world, k, fmin(BOOST_A, left_a), &duty[k]);
        wants[k] = false;
    }
}
