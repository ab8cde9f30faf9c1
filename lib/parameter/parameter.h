/* What it is for: what each parameter of a module may be: stated once, in a table in flash.
 * What it owns: how a field of a struct of parameters is read, written and held to its limits.
 * What it never does: judge whether parameters fit together. */
#ifndef PARAMETER_H
#define PARAMETER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "flash_memory.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum { PARAMETER_U8 = 0, PARAMETER_U16, PARAMETER_S16, PARAMETER_U32 } parameter_type_t;

/* Limits of one field. A module has a struct of these, named as the fields of its parameters, in
 * flash: its table. */
typedef struct {
    uint8_t offset; /* of the field in its struct; of an array: of the first element */
    uint8_t type;   /* parameter_type_t */
    int16_t minimum;
    uint16_t maximum; /* of a PARAMETER_U32: in thousands */
} parameter_range_t;

#define PARAMETER_RANGE(parameters, field, type_, minimum_, maximum_)                              \
    .field = {.offset = offsetof(parameters, field),                                               \
              .type = PARAMETER_##type_,                                                           \
              .minimum = (minimum_),                                                               \
              .maximum = (maximum_)}

/* From flash. */
static inline parameter_range_t parameter_range(const parameter_range_t *range)
{
    parameter_range_t copy;
    flash_copy(&copy, range, sizeof copy);
    return copy;
}

uint8_t parameter_width(uint8_t type); /* bytes */
/* field points at the value, which may be unaligned. A value above INT32_MAX reads as that. */
int32_t parameter_get(const void *field, uint8_t type);
void parameter_set(void *field, uint8_t type, int32_t value);

/* *range is a copy, not in flash. */
int32_t parameter_maximum(const parameter_range_t *range);
bool parameter_is_within(const parameter_range_t *range, int32_t value);

/* table, in flash: parameter_range_t one after the other. Index of the first of `count` that
 * *parameters does not keep; count if it keeps all. Of an array the first element is looked at. */
uint8_t parameter_first_outside(const void *parameters, const void *table, uint8_t count);
/* Fails (false) if and only if there is one; then *bad (may be NULL) is its offset. */
bool parameter_check(const void *parameters, const void *table, size_t table_bytes, uint16_t *bad);

#ifdef __cplusplus
}
#endif
#endif
