/* What it is for: tests that must set or see what no caller of spring_estimator may.
 * What it owns: the only way in: test_repository holds that there is no other.
 * What it never does: serve anything but a test. */
#ifndef BELIEF_INSIDE_H
#define BELIEF_INSIDE_H

#include "spring_estimator.h"
#include "spring_estimator_internal.h"

static inline spring_belief_t *belief_inside(spring_estimator_t *estimator, uint8_t spring)
{
    return &estimator->spring[spring];
}

/* What was set is as it was left. */
static inline void seal_inside(spring_estimator_t *estimator, uint8_t spring)
{
    spring_seal(estimator, spring);
}

/* As if this turn had just been had, or none. */
static inline void turn_inside(spring_estimator_t *estimator, uint8_t turn)
{
    estimator->last_turn = turn;
}

/* Whether what springs read is taken to be of springs that may be hot. */
static inline bool doubts_inside(const spring_estimator_t *estimator)
{
    return estimator->doubtful;
}

static inline spring_sights_t *sights_inside(spring_estimator_t *estimator)
{
    return &estimator->sights;
}

/* Another number in each place: it must be told where it belongs. */
static inline spring_sight_t sight_with_numbers(uint8_t spring)
{
    return (spring_sight_t){.spring = spring,
                            .kind = SPRING_SIGHT_LOST,
                            .read = -132,
                            .read_sd = 5,
                            .believed = 24,
                            .believed_sd = 18,
                            .seen = -8,
                            .seen_sd = 12,
                            .now = 1,
                            .now_sd = 10,
                            .shift = 4,
                            .loss = 120};
}

/* No other takes more room. */
static inline spring_sight_t sight_of_most_digits(uint8_t spring)
{
    return (spring_sight_t){.spring = spring,
                            .read = INT16_MIN,
                            .read_sd = 255,
                            .believed = -2550,
                            .believed_sd = 255,
                            .seen = -2550,
                            .seen_sd = 255,
                            .now = -2550,
                            .now_sd = 255,
                            .shift = -600,
                            .loss = -9000,
                            .did = 31};
}

#endif
