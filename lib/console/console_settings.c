#include "console_internal.h"

#include <stddef.h>
#include <string.h>

#define SCRUB_BYTES 16u

/* The settings, and what the console works on: with a pointer that has turned over its words would
 * land beside the controller. */
static scrub_stretch_t stretch_of(const void *owner, uint8_t index)
{
    const console_t *const console = owner;
    switch (index) {
    case 0:
        return (scrub_stretch_t){console, offsetof(console_t, job)};
    case 1:
        return (scrub_stretch_t){console->settings, sizeof(settings_t)};
    default:
        return (scrub_stretch_t){0};
    }
}

void console_open_settings(console_t *console)
{
    scrub_open(&console->scrub, stretch_of, console);
}

void console_seal_settings(console_t *console)
{
    scrub_seal(&console->scrub, stretch_of, console);
}

bool console_hold_settings(console_t *console)
{
    (void)scrub_step(&console->scrub, stretch_of, console, SCRUB_BYTES);
    return scrub_is_sound(&console->scrub);
}

static void add_value(const console_t *console, text_line_t *line, uint16_t row)
{
    const parameter_row_t known = parameter_row(row);
    text_add(line, known.name);
    if (known.count == 1) { /* of those with one for each spring, who knows which */
        text_add_char(line, '=');
        text_add_decimal(line, settings_get(console->settings, row, 0), known.decimals);
    }
}

static void print_conflict(const console_t *console, uint16_t bad)
{
    console_out_t out;
    const uint16_t partner = parameter_partner(bad);
    uint16_t pair[2] = {bad, partner};
    (void)controller_settings_pair(&console->settings->controller, pair);
    console_out_start(&out);
    text_add_flash(&out.line, FLASH_TEXT("[not active yet: "));
    add_value(console, &out.line, pair[0]);
    text_add_flash(&out.line, FLASH_TEXT(" does not fit "));
    if (pair[1] < PARAMETER_COUNT) {
        add_value(console, &out.line, pair[1]);
    } else {
        text_add_flash(&out.line, FLASH_TEXT("the others"));
    }
    text_add_char(&out.line, ']');
    console_out_end(console, &out);
}

/* Activates the settings as they are set. Where they do not fit together the active ones stay, the
 * console says which two stand in each other's way, and nothing is driven or saved until they fit:
 * `$$` of another board can only be pasted line by line, in any order. */
void console_apply_settings(console_t *console)
{
    uint16_t bad = PARAMETER_COUNT;
    console->conflict =
        !controller_apply_settings(console->controller, &console->settings->controller, &bad);
    if (console->conflict) {
        print_conflict(console, bad);
    }
}

static console_error_t error_of(settings_result_t result)
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

void console_follow_board_settings(console_t *console)
{
    const board_settings_t *const board = &console->settings->board;
    if (console->telemetry->format != TELEMETRY_INPUTS && /* else a replay would end here */
        (console->telemetry->format != board->telemetry_format ||
         console->telemetry->hz != board->telemetry_hz)) {
        telemetry_set(console->telemetry, board->telemetry_format, board->telemetry_hz);
    }
}

/* "supply_v is 1.000 to 16.000 V", or "did you mean $supply_v?" */
void console_add_setting_hint(const console_t *console, text_line_t *line)
{
    const parameter_row_t row = parameter_row(console->hint_of);
    char name[SETTINGS_NAME_SIZE];
    settings_name(console->hint_of, console->hint_element, name);
    if (console->hint == CONSOLE_HINT_SETTING) {
        text_add_flash(line, FLASH_TEXT("did you mean $"));
        text_add(line, name);
        text_add_char(line, '?');
        return;
    }
    text_add(line, name);
    text_add_flash(line, FLASH_TEXT(" is "));
    text_add_decimal(line, row.minimum, row.decimals);
    text_add_flash(line, FLASH_TEXT(" to "));
    text_add_decimal(line, row.maximum, row.decimals);
    if (row.unit[0] != '\0') {
        text_add_char(line, ' ');
        text_add(line, row.unit);
    }
    if (row.part == PARAMETER_PART_SAFETY) {
        text_add_flash(line, FLASH_TEXT(", for what docs/safety.md promises"));
    }
}

#define ALIKE 3u /* so many first letters are no chance */

static void hint_nearest(console_t *console, const char *name)
{
    uint8_t longest = ALIKE - 1u;
    if (strchr(name, ' ') != NULL) {
        console_hint_text(console, FLASH_TEXT("write $NAME=VALUE, without blanks"), 0, 0);
        return;
    }
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        const parameter_row_t row = parameter_row(k);
        uint8_t same = 0;
        while (name[same] != '\0' && name[same] == row.name[same]) {
            same++;
        }
        if (same > longest) {
            longest = same;
            console_hint_setting(console, CONSOLE_HINT_SETTING, k, 0);
        }
    }
}

static console_error_t refuse(console_t *console, const char *name, console_error_t error)
{
    uint16_t row;
    uint8_t element;
    if (error == CONSOLE_ERROR_UNKNOWN_SETTING) {
        hint_nearest(console, name);
    } else if (settings_find(name, &row, &element)) {
        console_hint_setting(console, CONSOLE_HINT_RANGE, row, element);
    }
    return error;
}

console_error_t console_assign(console_t *console, const char *name, const char *value)
{
    console_open_settings(console);
    const settings_result_t result = settings_assign(console->settings, name, value);
    console_seal_settings(console);
    if (result == SETTINGS_NOT_A_NUMBER && strchr(value, ',') != NULL) {
        console_hint_text(console, FLASH_TEXT("a decimal point, no comma"), 0, 0);
        return CONSOLE_ERROR_BAD_ARGUMENT;
    }
    uint16_t row;
    uint8_t element;
    if (result == SETTINGS_NOT_A_NUMBER && strchr(value, '.') != NULL &&
        settings_find(name, &row, &element)) {
        console_hint_text(console, FLASH_TEXT("a number with at most #0 decimals"),
                          parameter_row(row).decimals, 0);
        return CONSOLE_ERROR_BAD_ARGUMENT;
    }
    const console_error_t error = error_of(result);
    return error == CONSOLE_OK ? error : refuse(console, name, error);
}

/* Another size begins everything anew, what is driven as well; and a relay that is no more declared
 * opens, by which what is driven gets nothing: as it was, then. */
static bool may_take(console_t *console, const settings_t *before)
{
    const controller_settings_t *const was = &before->controller;
    const controller_settings_t *const is = &console->settings->controller;
    if ((was->model.rows == is->model.rows && was->model.columns == is->model.columns &&
         was->safety.cut_off == is->safety.cut_off) ||
        !console_any_spring_on(console)) {
        return true;
    }
    console_open_settings(console);
    *console->settings = *before;
    console_seal_settings(console);
    return false;
}

static console_error_t assign(console_t *console, const char *name, const char *value)
{
    const settings_t before = *console->settings;
    const console_error_t error = console_assign(console, name, value);
    if (error != CONSOLE_OK) {
        return error;
    }
    if (!may_take(console, &before)) {
        return CONSOLE_ERROR_SPRINGS_ON;
    }
    if (memcmp(&before.controller, &console->settings->controller, sizeof before.controller) != 0 ||
        console->conflict) {
        console_apply_settings(console);
    }
    console_follow_board_settings(console);
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
            console_apply_settings(console); /* says which */
            return CONSOLE_ERROR_SETTINGS_CONFLICT;
        }
        console_open_settings(console); /* nothing is saved that nobody set */
        if (!scrub_is_sound(&console->scrub)) {
            return CONSOLE_ERROR_SAVE_FAILED;
        }
        settings_save_start(console->store, console->settings);
        console_start_job(console, CONSOLE_JOB_SAVE);
        return CONSOLE_OK;
    }
    if (flash_equal(line, FLASH_TEXT("$defaults"))) {
        const settings_t before = *console->settings;
        console_open_settings(console);
        settings_default(console->settings);
        console_seal_settings(console);
        if (!may_take(console, &before)) {
            return CONSOLE_ERROR_SPRINGS_ON;
        }
        console_apply_settings(console);
        console_follow_board_settings(console);
        return CONSOLE_OK;
    }
    if (!settings_find(line + 1, &index, &element)) {
        return refuse(console, line + 1, CONSOLE_ERROR_UNKNOWN_SETTING);
    }
    console_print_setting(console, index, element);
    return CONSOLE_OK;
}
