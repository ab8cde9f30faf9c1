#include "console_codes.h"

#include "text.h"

/* Numbers run from 1 without a gap: each text is found by counting. */
#define CONSOLE_ERROR_NAME(NAME, number, name, text) name "\0"
#define CONSOLE_ERROR_TEXT(NAME, number, name, text) text "\0"
static const char names[] FLASH_MEMORY = CONSOLE_ERRORS(CONSOLE_ERROR_NAME);
static const char texts[] FLASH_MEMORY = CONSOLE_ERRORS(CONSOLE_ERROR_TEXT);

/* That behind the last is empty. */
static uint8_t item_of(console_error_t error)
{
    return (
        uint8_t)((error < CONSOLE_ERROR_END && error != CONSOLE_OK ? error : CONSOLE_ERROR_END) -
                 1);
}

const char *console_error_name(console_error_t error)
{
    return text_item(names, item_of(error));
}

const char *console_error_text(console_error_t error)
{
    return text_item(texts, item_of(error));
}
