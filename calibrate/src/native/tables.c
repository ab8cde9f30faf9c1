/* What it is for: the tables of parameters and effects (lib/parameters), row by row, for Python.
 * What it owns: the shape of a row that both sides know.
 * What it never does: hold a name or a number of its own. */
#include <stdbool.h>
#include <stdio.h>

#include "descriptions.h"

#define EXPORT __attribute__((visibility("default")))

typedef struct {
    char name[PARAMETER_NAME_SIZE];
    char unit[sizeof(((parameter_row_t *)0)->unit)];
    const char *effect; /* NULL: the declared network */
    const char *sentence;
    double minimum; /* of the chip's integer, in the unit, as are the others */
    double maximum;
    double standard;
    double resolution;
    int part; /* parameter_part_t */
    int decimals;
    int id;
    bool per_spring;
} table_parameter_t;

typedef struct {
    const char *name;
    const char *sentence;
    const char *not_on_chip; /* why; NULL: the chip carries it */
    int acts;                /* effect_acts_t */
} table_effect_t;

/* False if and only if there is no such row. */
EXPORT bool table_parameter(size_t k, table_parameter_t *out);
EXPORT bool table_effect(size_t k, table_effect_t *out);

bool table_parameter(size_t k, table_parameter_t *out)
{
    if (k >= PARAMETER_COUNT) {
        return false;
    }
    const parameter_row_t row = parameter_row((uint16_t)k);
    const parameter_description_t *const about = parameter_description(k);
    const effect_row_t *const effect = effect_row(about->effect);
    double per_unit = 1.0;
    for (int i = 0; i < row.decimals; i++) {
        per_unit *= 10.0;
    }
    *out = (table_parameter_t){.effect = effect == NULL ? NULL : effect->name,
                               .sentence = about->sentence,
                               .minimum = row.minimum / per_unit,
                               .maximum = row.maximum / per_unit,
                               .standard = row.standard / per_unit,
                               .resolution = 1.0 / per_unit,
                               .part = row.part,
                               .decimals = row.decimals,
                               .id = row.id,
                               .per_spring = row.count > 1};
    (void)snprintf(out->name, sizeof out->name, "%s", row.name);
    (void)snprintf(out->unit, sizeof out->unit, "%s", row.unit);
    return true;
}

bool table_effect(size_t k, table_effect_t *out)
{
    const effect_row_t *const row = effect_row(k);
    if (row == NULL) {
        return false;
    }
    *out = (table_effect_t){row->name, row->sentence, row->not_on_chip, (int)row->acts};
    return true;
}
