/* What it is for: windows as circuit_check makes them, for the tests of those that judge them.
 * What it owns: nothing.
 * What it never does: take readings. */
#ifndef CIRCUIT_WINDOW_H
#define CIRCUIT_WINDOW_H

#include "circuit_check.h"

/* One that tells, at one duty. */
static inline circuit_window_t window_of(float found_mv, float expected_mv, float current_ma)
{
    return (circuit_window_t){.found_mv = found_mv,
                              .expected_mv = expected_mv,
                              .share = circuit_window_share(found_mv, expected_mv),
                              .current_ma = current_ma,
                              .tells = true,
                              .steady = true,
                              .balances = true};
}

#endif
