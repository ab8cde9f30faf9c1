#include "descriptions.h"

static const effect_row_t effects[EFFECT_COUNT] = {
#define EFFECT(name, acts, sentence, why)                                                          \
    {#name, sentence, sizeof(why) > 1 ? (why) : NULL, EFFECT_ACTS_##acts},
#include "effects.def"
};

static const parameter_description_t descriptions[PARAMETER_COUNT] = {
#define PARAMETER(part, id, name, unit, decimals, type, count, field, low, high, usual, effect,    \
                  sentence)                                                                        \
    {sentence, EFFECT_##effect},
#include "parameters.def"
};

const effect_row_t *effect_row(size_t effect)
{
    return effect < EFFECT_COUNT ? &effects[effect] : NULL;
}

const parameter_description_t *parameter_description(size_t row)
{
    return row < PARAMETER_COUNT ? &descriptions[row] : NULL;
}
