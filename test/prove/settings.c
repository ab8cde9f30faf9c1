/* sources: lib/settings/settings.c lib/text/text.c lib/parameters/parameters.c */
#include "settings.h"

#include "prove.h"

#define WORD 12

/* Defaults of the controller are another driver's; here any values do. */
void controller_settings_default(controller_settings_t *settings)
{
    Frama_C_make_unknown((char *)settings, sizeof *settings);
}

static void any_word(char *word)
{
    for (uint8_t k = 0; k + 1 < WORD; k++) {
        word[k] = (char)any_u8();
    }
    word[WORD - 1] = '\0';
}

void main(void)
{
    settings_t settings;
    char name[WORD], value[WORD], written[SETTINGS_NAME_SIZE];
    uint16_t row;
    uint8_t element;
    settings_default(&settings);
    any_word(name);
    any_word(value);
    (void)settings_assign(&settings, name, value);
    if (settings_find(name, &row, &element)) {
        (void)settings_set(&settings, row, element, any_s32());
    }
    /*@ loop unroll PARAMETER_COUNT; */
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        const uint8_t one = (uint8_t)any_between(0, (uint8_t)(parameter_row(k).count - 1u));
        settings_name(k, one, written);
        (void)settings_set(&settings, k, one, any_s32());
        (void)settings_get(&settings, k, one);
    }
}
