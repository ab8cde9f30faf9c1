/* What it is for: every value that can be set, by the rows of parameters.def.
 * What it owns: the structs of values, their defaults and limits, how a field is read and written.
 * What it never does: judge whether values fit together. */
#ifndef PARAMETERS_H
#define PARAMETERS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "flash_memory.h"

#ifdef __cplusplus
extern "C" {
#endif

#ifndef THERMAL_MODEL_MAX_SPRINGS
#ifdef __AVR__
#define THERMAL_MODEL_MAX_SPRINGS 9
#else
#define THERMAL_MODEL_MAX_SPRINGS 64
#endif
#endif

/* Counts springs: a byte on a board. */
#if THERMAL_MODEL_MAX_SPRINGS <= UINT8_MAX
typedef uint8_t spring_index_t;
#else
typedef uint16_t spring_index_t;
#endif

/* --- the values, a struct for each part ----------------------------------------------------- */

#define PARAMETER_C_U8    uint8_t
#define PARAMETER_C_U16   uint16_t
#define PARAMETER_C_S16   int16_t
#define PARAMETER_C_U32   uint32_t
#define PARAMETER_IS_ONE  /* a plain field */
#define PARAMETER_IS_EACH [THERMAL_MODEL_MAX_SPRINGS]
#define PARAMETER_FIELD(id, name, unit, decimals, type, count, field, ...)                         \
    PARAMETER_C_##type field PARAMETER_IS_##count;

/* In units of 10^-decimals; springs are row-major. */
typedef struct {
#define MODEL PARAMETER_FIELD
#include "parameters.def"
    uint16_t step_ms; /* length of one step, 1..1000: not a setting, the controller has 100 */
} thermal_model_parameters_t;

typedef struct {
#define CURRENT PARAMETER_FIELD
#include "parameters.def"
} current_control_parameters_t;

typedef struct {
#define SAFETY PARAMETER_FIELD
#include "parameters.def"
} safety_parameters_t;

typedef struct {
#define POLICY PARAMETER_FIELD
#include "parameters.def"
} drive_policy_parameters_t;

typedef struct {
#define BOARD PARAMETER_FIELD
#include "parameters.def"
} board_settings_t;

void thermal_model_parameters_default(thermal_model_parameters_t *parameters); /* step 100 ms */
void current_control_parameters_default(current_control_parameters_t *parameters);
void safety_parameters_default(safety_parameters_t *parameters);
void drive_policy_parameters_default(drive_policy_parameters_t *parameters);
void board_settings_default(board_settings_t *settings);

/* --- the rows ------------------------------------------------------------------------------- */

/* Which row: PARAMETER_loss_w_per_k, ... */
typedef enum {
#define PARAMETER(part, id, name, ...) PARAMETER_##name,
#include "parameters.def"
    PARAMETER_COUNT
} parameter_t;

typedef enum {
    PARAMETER_PART_MODEL = 0,
    PARAMETER_PART_CURRENT,
    PARAMETER_PART_SAFETY,
    PARAMETER_PART_POLICY,
    PARAMETER_PART_BOARD
} parameter_part_t;

typedef enum { PARAMETER_U8 = 0, PARAMETER_U16, PARAMETER_S16, PARAMETER_U32 } parameter_type_t;

#define PARAMETER_NAME_SIZE 40 /* with the terminating zero */

typedef struct {
    char name[PARAMETER_NAME_SIZE];
    char unit[5];         /* "" for a plain number */
    uint8_t id;           /* in stored records */
    uint8_t part;         /* parameter_part_t */
    uint8_t type;         /* parameter_type_t */
    spring_index_t count; /* 1, or THERMAL_MODEL_MAX_SPRINGS: an element for each spring */
    uint8_t decimals;
    uint16_t offset; /* of the first element in the part's struct */
    int32_t minimum; /* of one value alone, in units of 10^-decimals */
    int32_t maximum;
    int32_t standard; /* default */
} parameter_row_t;

/* A copy: the table is in flash. row must be below PARAMETER_COUNT. */
parameter_row_t parameter_row(uint16_t row);

uint8_t parameter_width(uint8_t type); /* bytes */
/* A value that lies as its bytes, low byte first. One above INT32_MAX reads as negative, which no
 * row of that type allows. */
int32_t parameter_decode(const void *bytes, uint8_t type);
/* Of one element; values: the part's struct. */
int32_t parameter_get(const void *values, const parameter_row_t *row, spring_index_t element);
void parameter_set(void *values, const parameter_row_t *row, spring_index_t element, int32_t value);

/* The row beside which a value of that row is judged, where both stand in the way of each other;
 * PARAMETER_COUNT: none. */
uint16_t parameter_partner(uint16_t row);

/* Two settings of which one must not be above the other. */
typedef struct {
    uint8_t smaller;     /* rows of as many decimals */
    uint8_t larger;      /* whose partner the other is */
    uint8_t least;       /* the larger is above by at least this, in units of 10^-decimals */
    uint8_t zero_is_off; /* of the larger: then it stands alone */
} parameter_pair_t;
#define PARAMETER_PAIRS 11
parameter_pair_t parameter_pair(uint8_t index);

/* True if and only if all values of a part keep the limits of their rows; else *bad (may be NULL)
 * is the first row that is not kept. O(rows). */
bool parameter_check(parameter_part_t part, const void *values, uint16_t *bad);

#ifdef __cplusplus
}
#endif
#endif
