#include "console_codes.h"

#define CONSOLE_ERROR_TEXTS(NAME, number, name, text)                                              \
    static const char name_##NAME[] FLASH_MEMORY = name;                                           \
    static const char text_##NAME[] FLASH_MEMORY = text;
CONSOLE_ERRORS(CONSOLE_ERROR_TEXTS)
static const char nothing[] FLASH_MEMORY = "";

const char *console_error_name(console_error_t error)
{
    switch (error) {
#define CONSOLE_ERROR_NAME(NAME, number, name, text)                                               \
    case CONSOLE_ERROR_##NAME:                                                                     \
        return name_##NAME;
        CONSOLE_ERRORS(CONSOLE_ERROR_NAME)
    default:
        return nothing;
    }
}

const char *console_error_text(console_error_t error)
{
    switch (error) {
#define CONSOLE_ERROR_TEXT(NAME, number, name, text)                                               \
    case CONSOLE_ERROR_##NAME:                                                                     \
        return text_##NAME;
        CONSOLE_ERRORS(CONSOLE_ERROR_TEXT)
    default:
        return nothing;
    }
}
