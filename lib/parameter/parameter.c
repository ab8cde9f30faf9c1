#include "parameter.h"

#include <string.h>

#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "fields are read and written as their lower bytes"
#endif

uint8_t parameter_width(uint8_t type)
{
    return type == PARAMETER_U8 ? 1 : type == PARAMETER_U32 ? 4 : 2;
}

int32_t parameter_get(const void *field, uint8_t type)
{
    int32_t value = 0;
    memcpy(&value, field, parameter_width(type));
    if (type == PARAMETER_S16) {
        return (int16_t)value;
    }
    return value < 0 ? INT32_MAX : value;
}

void parameter_set(void *field, uint8_t type, int32_t value)
{
    memcpy(field, &value, parameter_width(type));
}

__attribute__((noinline)) int32_t parameter_maximum(const parameter_range_t *range)
{
    return range->type == PARAMETER_U32 ? range->maximum * (int32_t)1000 : range->maximum;
}

__attribute__((noinline)) bool parameter_is_within(const parameter_range_t *range, int32_t value)
{
    return value >= range->minimum && value <= parameter_maximum(range);
}

uint8_t parameter_first_outside(const void *parameters, const void *table, uint8_t count)
{
    const parameter_range_t *next = table;
    for (uint8_t i = 0; i < count; i++, next++) {
        const parameter_range_t range = parameter_range(next);
        const uint8_t *const field = (const uint8_t *)parameters + range.offset;
        if (!parameter_is_within(&range, parameter_get(field, range.type))) {
            return i;
        }
    }
    return count;
}

bool parameter_check(const void *parameters, const void *table, size_t table_bytes, uint16_t *bad)
{
    const uint8_t count = (uint8_t)(table_bytes / sizeof(parameter_range_t));
    const uint8_t outside = parameter_first_outside(parameters, table, count);
    if (outside == count) {
        return true;
    }
    if (bad != NULL) {
        *bad = parameter_range((const parameter_range_t *)table + outside).offset;
    }
    return false;
}
