/* What it is for: what people and host tools read of parameters.def and effects.def beyond the
 * numbers.
 * What it owns: the list of effects, and a sentence for each parameter and effect.
 * What it never does: end up in the firmware: nothing there calls it. */
#ifndef DESCRIPTIONS_H
#define DESCRIPTIONS_H

#include "parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

/* EFFECT_radiation, ... */
typedef enum {
#define EFFECT(name, ...) EFFECT_##name,
#include "effects.def"
    EFFECT_COUNT,
    EFFECT_none = EFFECT_COUNT /* the declared network */
} effect_t;

typedef enum {
    EFFECT_ACTS_ARRAY = 0,  /* on heat and resistance */
    EFFECT_ACTS_SUPPLY,     /* on what reaches the springs of what was commanded */
    EFFECT_ACTS_MEASUREMENT /* only on what is shown */
} effect_acts_t;

typedef struct {
    const char *name;
    const char *sentence;
    const char *not_on_chip; /* why; NULL: the chip carries it */
    effect_acts_t acts;
} effect_row_t;

/* NULL if and only if effect >= EFFECT_COUNT. */
const effect_row_t *effect_row(size_t effect);

typedef struct {
    const char *sentence;
    effect_t effect; /* that it belongs to, or EFFECT_none */
} parameter_description_t;

/* NULL if and only if row >= PARAMETER_COUNT. */
const parameter_description_t *parameter_description(size_t row);

#ifdef __cplusplus
}
#endif
#endif
