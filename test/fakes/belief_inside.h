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

#endif
