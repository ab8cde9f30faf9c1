/* What it is for: how much current temperatures and the board's continuous rating leave.
 * What it owns: the rules of derating, as functions of what is believed.
 * What it never does: remember anything, share a supply, choose a current. */
#ifndef DERATING_H
#define DERATING_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Share of the current, 0..1: all below limit_c - band_k, none at limit_c and above; NaN: none. */
float derating_share(float temperature_c, float limit_c, float band_k);

/* An undriven spring, at most `highest_c` and rising by rise_k_per_s, must not pass limit_c: how
 * severe that is, 0 none .. 1 at the limit. It is predicted some seconds ahead: nothing cools it.
 */
float derating_severity(float highest_c, float rise_k_per_s, float limit_c);

/* The sum of currents that an overload leaves, mA: half of the time is free, then what is above the
 * continuous current is taken away linearly. Quarters of a second. */
uint16_t derating_overload_ma(uint16_t budget_ma, uint16_t continuous_ma,
                              uint16_t overload_quarters, uint16_t allowed_quarters);

#ifdef __cplusplus
}
#endif
#endif
