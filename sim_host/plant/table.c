#include "plant_internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char *const effects[EFFECT_COUNT] = {
#define EFFECT(name, ...) #name,
#include "effects.def"
};

#define ONE    false
#define EACH   true
#define E_none EFFECT_COUNT

static const plant_parameter_t parameters[PARAMETER_COUNT] = {
#define PLANT(name, unit, count, minimum, maximum, standard, effect, sentence)                     \
    {#name,                                                                                        \
     sizeof(unit) > 1 ? (unit) : "1",                                                              \
     E_##effect == E_none ? NULL : #effect,                                                        \
     sentence,                                                                                     \
     standard,                                                                                     \
     minimum,                                                                                      \
     maximum,                                                                                      \
     count},
#include "plant.def"
};

size_t plant_parameter_count(void)
{
    return PARAMETER_COUNT;
}

const plant_parameter_t *plant_parameter(size_t k)
{
    return k < PARAMETER_COUNT ? &parameters[k] : NULL;
}

static int find_parameter(const char *name, size_t length)
{
    for (int k = 0; k < PARAMETER_COUNT; k++)
        if (strncmp(parameters[k].name, name, length) == 0 && parameters[k].name[length] == '\0')
            return k;
    return -1;
}

int plant_parameter_index(const char *name)
{
    return find_parameter(name, strlen(name));
}

size_t plant_effect_count(void)
{
    return EFFECT_COUNT;
}

const char *plant_effect_name(size_t k)
{
    return k < EFFECT_COUNT ? effects[k] : NULL;
}

int plant_effect_index(const char *name)
{
    for (int k = 0; k < EFFECT_COUNT; k++)
        if (strcmp(effects[k], name) == 0)
            return k;
    return -1;
}

const char *plant_status_text(plant_status_t status)
{
    switch (status) {
    case PLANT_OK:
        return "ok";
    case PLANT_ERROR_NAME:
        return "no parameter or effect of that name";
    case PLANT_ERROR_RANGE:
        return "value outside its limits, or not a number, or a spring that runs away";
    case PLANT_ERROR_INDEX:
        return "no such spring";
    case PLANT_ERROR_SIZE:
        return "rows x columns x layers not in 1..1024";
    case PLANT_ERROR_MEMORY:
        return "out of memory";
    case PLANT_ERROR_TIME:
        return "time step not positive, not finite or too long, or no steady state in time";
    }
    return "unknown status";
}

plant_status_t plant_set_index(plant_t *p, size_t k, int spring, double value)
{
    if (k >= PARAMETER_COUNT)
        return PLANT_ERROR_NAME;
    const plant_parameter_t *parameter = &parameters[k];
    if (spring < -1 || spring >= p->n || (spring > 0 && !parameter->per_spring))
        return PLANT_ERROR_INDEX;
    if (!within(value, parameter->minimum, parameter->maximum))
        return PLANT_ERROR_RANGE;
    if ((k == P_wake_direction || k == P_convection_correlation || k == P_supply_chopped) &&
        value != floor(value))
        return PLANT_ERROR_RANGE;
    if (spring < 0)
        for (int i = 0; i < (parameter->per_spring ? p->n : 1); i++)
            p->value[k][i] = value;
    else
        p->value[k][spring] = value;
    if (k == P_ambient_c) {
        p->inputs_changed = true; /* need not rebuild the network at each row of a log */
        plant_network_rest(p);
    } else {
        p->parameters_changed = true;
    }
    if (k == P_optical_share || k == P_optical_width || k == P_optical_shape)
        plant_sensors_spread(p); /* now: a picture may be taken before anything moves */
    return PLANT_OK;
}

plant_status_t plant_get_index(const plant_t *p, size_t k, int spring, double *value)
{
    if (k >= PARAMETER_COUNT)
        return PLANT_ERROR_NAME;
    if (spring < -1 || spring >= p->n || (spring > 0 && !parameters[k].per_spring))
        return PLANT_ERROR_INDEX;
    *value = p->value[k][spring < 0 ? 0 : spring];
    return PLANT_OK;
}

/* "name" or "name[3]": *spring is -1 or 0-based. */
static plant_status_t parse_name(const plant_t *p, const char *name, size_t *k, int *spring)
{
    const char *bracket = strchr(name, '[');
    const int found = find_parameter(name, bracket ? (size_t)(bracket - name) : strlen(name));
    if (found < 0)
        return PLANT_ERROR_NAME;
    *k = (size_t)found;
    *spring = -1;
    if (!bracket)
        return PLANT_OK;
    if (bracket[1] < '1' || bracket[1] > '9')
        return PLANT_ERROR_INDEX;
    char *end;
    const long number = strtol(bracket + 1, &end, 10);
    if (end[0] != ']' || end[1] != '\0' || number > p->n || !parameters[found].per_spring)
        return PLANT_ERROR_INDEX;
    *spring = (int)number - 1;
    return PLANT_OK;
}

plant_status_t plant_set(plant_t *p, const char *name, double value)
{
    size_t k;
    int spring;
    const plant_status_t status = parse_name(p, name, &k, &spring);
    return status == PLANT_OK ? plant_set_index(p, k, spring, value) : status;
}

plant_status_t plant_get(const plant_t *p, const char *name, double *value)
{
    size_t k;
    int spring;
    const plant_status_t status = parse_name(p, name, &k, &spring);
    return status == PLANT_OK ? plant_get_index(p, k, spring, value) : status;
}

plant_status_t plant_set_effect_index(plant_t *p, size_t effect, bool on)
{
    if (effect >= EFFECT_COUNT)
        return PLANT_ERROR_NAME;
    p->on[effect] = on;
    p->parameters_changed = true;
    return PLANT_OK;
}

plant_status_t plant_set_effect(plant_t *p, const char *effect, bool on)
{
    const int k = plant_effect_index(effect);
    return k < 0 ? PLANT_ERROR_NAME : plant_set_effect_index(p, (size_t)k, on);
}

bool plant_effect_is_on(const plant_t *p, size_t effect)
{
    return effect < EFFECT_COUNT && p->on[effect];
}
