/* What it is for: inputs of the drivers that script/prove has Frama-C's Eva run.
 * What it owns: any value of a type or range, settings as lib/parameters declares them.
 * What it never does: run. */
#ifndef PROVE_H
#define PROVE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <__fc_builtin.h>

#include "parameters.h"

/* Whole numbers of 10^-decimals, as lib/parameters rounds them. */
#define PROVE_WHOLE(value, decimals) ((int32_t)((value)*1e##decimals + ((value) < 0 ? -0.5 : 0.5)))
#define PROVE_EACH_ONE               1
#define PROVE_EACH_EACH              THERMAL_MODEL_MAX_SPRINGS

static inline int32_t any_between(int32_t low, int32_t high)
{
    return Frama_C_long_interval(low, high);
}

static inline bool any_bool(void)
{
    return Frama_C_nondet(0, 1) != 0;
}

static inline uint8_t any_u8(void)
{
    return Frama_C_unsigned_char_interval(0, UINT8_MAX);
}

static inline uint16_t any_u16(void)
{
    return Frama_C_unsigned_int_interval(0, UINT16_MAX);
}

static inline int16_t any_s16(void)
{
    return Frama_C_interval(INT16_MIN, INT16_MAX);
}

static inline uint32_t any_u32(void)
{
    return Frama_C_unsigned_long_interval(0, UINT32_MAX);
}

static inline int32_t any_s32(void)
{
    return Frama_C_long_interval(INT32_MIN, INT32_MAX);
}

/* Any settings that keep the limits of their rows: `#define SAFETY PROVE_ANY`, then the rows. */
#define PROVE_ANY(id, name, unit, decimals, type, count, field, low, high, ...)                    \
    for (uint8_t k = 0; k < PROVE_EACH_##count; k++) {                                             \
        ((PARAMETER_C_##type *)&values->field)[k] = (PARAMETER_C_##type)any_between(               \
            PROVE_WHOLE(low, decimals), PROVE_WHOLE(high, decimals));                              \
    }

/* Those of the circuit: shunt, wiring, supply, diode. */
static inline void any_circuit(current_control_parameters_t *values)
{
#define CURRENT PROVE_ANY
#include "parameters.def"
}

#ifdef CIRCUIT_SOURCE_H
/* What may be believed of any circuit (circuit_source). */
static inline circuit_source_t any_source(void)
{
    const circuit_source_t source = {.drop_mv = Frama_C_float_interval(0.0f, 1150.0f),
                                     .step_mv = Frama_C_float_interval(1.0f, 24.0f),
                                     .unsure_mv = Frama_C_float_interval(0.0f, 600.0f),
                                     .less_mv = Frama_C_float_interval(0.0f, 300.0f),
                                     .more_mv = Frama_C_float_interval(0.0f, 600.0f)};
    return source;
}
#endif

#endif
