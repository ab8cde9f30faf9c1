#include "spring_estimator_internal.h"

/* Odds are natural logarithms. */
#define R_PHASE_ODDS      (-2.2f) /* one alloy in ten */
#define R_PHASE_OTHER_WAY 2.9f    /* three sights of four, and one of twenty-five without it */
#define R_PHASE_STRAIGHT  (-1.4f) /* the others */
#define R_PHASE_MOST_ODDS 6.0f    /* three sights to the contrary turn it */

void spring_begin_alloy(spring_estimator_t *e)
{
    e->r_phase_odds = R_PHASE_ODDS;
}

void spring_alloy_sees(spring_estimator_t *e, bool other_way)
{
    const float more = other_way ? R_PHASE_OTHER_WAY : R_PHASE_STRAIGHT;
    e->r_phase_odds = spring_clamp(e->r_phase_odds + more, -R_PHASE_MOST_ODDS, R_PHASE_MOST_ODDS);
}

bool spring_alloy_has_r_phase(const spring_estimator_t *e)
{
    return e->r_phase_odds >= 0.0f;
}
