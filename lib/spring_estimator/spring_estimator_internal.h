/* What it is for: what the files of spring_estimator share.
 * What it owns: nothing.
 * What it never does: serve anyone else. */
#ifndef SPRING_ESTIMATOR_INTERNAL_H
#define SPRING_ESTIMATOR_INTERNAL_H

#include "spring_estimator.h"

/* Reasons for every number: docs/believing.md. */

/* Largest temperature coefficient in print, over a heat capacity that is 15 % too low. */
#define COEFFICIENT_MOST_PER_K (0.0015f / 0.85f)

float spring_now_c(const thermal_model_t *model, uint8_t spring);

/* The spring was seen at a place of its transformation, give or take sd_k: the one update of
 * distance, shift and loss. The model's temperature is set, its phase reached from `from`
 * (SPRING_PHASE_MARTENSITE or _AUSTENITE). Returns the error found, K. */
float spring_see(const spring_estimator_t *estimator, spring_belief_t *belief,
                 thermal_model_t *model, uint8_t spring, float seen_c, float sd_k, uint8_t from);
/* The same without new knowledge of how far off it may be: it cannot be on that side of it. */
void spring_keep(const spring_estimator_t *estimator, spring_belief_t *belief,
                 thermal_model_t *model, uint8_t spring, float limit_c, uint8_t from);

/* While it heats: what a turn's heat did to its resistance. */
void spring_heating_watch(const spring_estimator_t *estimator, spring_belief_t *belief,
                          thermal_model_t *model, uint8_t spring);
/* While its temperature rests: whether it loses phase. */
void spring_holding_watch(const spring_estimator_t *estimator, spring_belief_t *belief,
                          thermal_model_t *model, uint8_t spring, float moved_k);

#endif
