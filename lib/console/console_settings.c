#include "console_internal.h"

#include <string.h>

/* Activates the settings as they are set. Where they do not fit together the active ones stay, and
 * the console says which value is in the way: `$$` of another board can only be pasted line by
 * line. */
static void apply_settings(console_t *console)
{
    uint16_t bad = PARAMETER_COUNT;
    console->conflict =
        !controller_apply_settings(console->controller, &console->settings->controller, &bad);
    if (!console->conflict) {
        return;
    }
    console_out_t out;
    console_out_start(&out);
    text_add_flash(&out.line, FLASH_TEXT("[not active yet: "));
    text_add(&out.line, parameter_row(bad).name);
    text_add_flash(&out.line, FLASH_TEXT(" does not fit the others]"));
    console_out_end(console, &out);
}

console_error_t console_error_of(settings_result_t result)
{
    switch (result) {
    case SETTINGS_OK:
        return CONSOLE_OK;
    case SETTINGS_UNKNOWN_NAME:
        return CONSOLE_ERROR_UNKNOWN_SETTING;
    case SETTINGS_OUT_OF_RANGE:
        return CONSOLE_ERROR_OUT_OF_RANGE;
    default:
        return CONSOLE_ERROR_BAD_ARGUMENT;
    }
}

/* Telemetry and policy can be set by word or as a setting: one truth, the setting. */
static void follow_board_settings(console_t *console)
{
    const board_settings_t *const board = &console->settings->board;
    if (console->telemetry->format != board->telemetry_format ||
        console->telemetry->hz != board->telemetry_hz) {
        telemetry_set(console->telemetry, board->telemetry_format, board->telemetry_hz);
    }
}

static console_error_t assign(console_t *console, const char *name, const char *value)
{
    const settings_t before = *console->settings;
    const console_error_t error = console_error_of(settings_assign(console->settings, name, value));
    if (error != CONSOLE_OK) {
        return error;
    }
    if (memcmp(&before.controller, &console->settings->controller, sizeof before.controller) != 0 ||
        console->conflict) {
        apply_settings(console);
    }
    follow_board_settings(console);
    return CONSOLE_OK;
}

void console_start_job(console_t *console, console_job_t job)
{
    console->job = (uint8_t)job;
    console->step = 0;
    console->element = 0;
}

/* A line that starts with '$'. */
console_error_t console_settings_line(console_t *console, char *line)
{
    uint16_t index;
    uint8_t element;
    char *const equals = strchr(line, '=');
    if (equals != NULL) {
        *equals = '\0';
        return assign(console, line + 1, equals + 1);
    }
    if (flash_equal(line, FLASH_TEXT("$$"))) {
        console_start_job(console, CONSOLE_JOB_SETTINGS);
        return CONSOLE_OK;
    }
    if (flash_equal(line, FLASH_TEXT("$save"))) {
        if (console->conflict) {
            return CONSOLE_ERROR_SETTINGS_CONFLICT;
        }
        settings_save_start(console->store, console->settings);
        console_start_job(console, CONSOLE_JOB_SAVE);
        return CONSOLE_OK;
    }
    if (flash_equal(line, FLASH_TEXT("$defaults"))) {
        settings_default(console->settings);
        apply_settings(console);
        follow_board_settings(console);
        return CONSOLE_OK;
    }
    if (!settings_find(line + 1, &index, &element)) {
        return CONSOLE_ERROR_UNKNOWN_SETTING;
    }
    console_print_setting(console, index, element);
    return CONSOLE_OK;
}
