#include "console_internal.h"

#include <stddef.h>
#include <string.h>

/* --- lines out ------------------------------------------------------------------------------ */

void console_hint_text(console_t *console, const char *text, int32_t first, int32_t second)
{
    console->hint = CONSOLE_HINT_TEXT;
    console->hint_text = text;
    console->hint_values[0] = first;
    console->hint_values[1] = second;
}

void console_hint_setting(console_t *console, console_hint_t hint, uint16_t row, uint8_t element)
{
    console->hint = (uint8_t)hint;
    console->hint_of = row;
    console->hint_element = element;
}

/* What the line's form was at fault for, or what the board lacks. */
static void add_hint(const console_t *console, console_error_t error, text_line_t *line)
{
    if (console->hint == CONSOLE_HINT_NONE ||
        (error > CONSOLE_ERROR_OUT_OF_RANGE && error != CONSOLE_ERROR_UNKNOWN_SETTING &&
         error != CONSOLE_ERROR_NOT_AVAILABLE)) {
        return;
    }
    text_add_flash(line, FLASH_TEXT(": "));
    if (console->hint == CONSOLE_HINT_TEXT) {
        text_add_values(line, console->hint_text, console->hint_values);
    } else if (console->hint == CONSOLE_HINT_WORD) {
        console_add_usage(line, console->hint_of);
    } else {
        console_add_setting_hint(console, line);
    }
}

static void answer(const console_t *console, console_error_t error)
{
    console_out_t out;
    console_out_start(&out);
    if (error == CONSOLE_OK) {
        text_add_flash(&out.line, FLASH_TEXT("ok"));
    } else {
        const int32_t number = (int32_t)error;
        text_add_values(&out.line, FLASH_TEXT("error:#0 "), &number);
        text_add_flash(&out.line, console_error_text(error));
        add_hint(console, error, &out.line);
    }
    console_out_end(console, &out);
}

static bool room_for(const console_t *console, uint16_t bytes)
{
    return console->output.room(console->output.context) >= bytes;
}

/* --- jobs ----------------------------------------------------------------------------------- */

static void end_job(console_t *console, console_error_t error)
{
    console->job = CONSOLE_JOB_NONE;
    answer(console, error);
}

static void list_settings(console_t *console)
{
    if (console->step == PARAMETER_COUNT) {
        end_job(console, CONSOLE_OK);
        return;
    }
    console_print_setting(console, console->step, console->element);
    if (++console->element >= parameter_row(console->step).count) {
        console->element = 0;
        console->step++;
    }
}

static void start_telemetry(console_t *console)
{
    const uint8_t springs = controller_springs(console->controller);
    uint8_t piece = 0;
    if (console->next_format == TELEMETRY_CSV) {
        if (!room_for(console, TELEMETRY_LINE_BYTES((uint16_t)springs))) {
            return;
        }
        console_out_t out;
        console_out_start(&out);
        while (telemetry_header(springs, piece++, &out.line)) {
            console->output.write(console->output.context, out.line.bytes, out.line.length);
            out.line.length = 0;
        }
    }
    console_open_settings(console);
    console->settings->board.telemetry_format = console->next_format;
    console->settings->board.telemetry_hz = console->next_hz;
    console_seal_settings(console);
    telemetry_set(console->telemetry, console->next_format, console->next_hz);
    end_job(console, CONSOLE_OK);
}

static void selftest(console_t *console)
{
    selftest_result_t result;
    controller_host_heard(console->controller); /* it waits for the answer, which always ends */
    switch (selftest_step(&console->selftest, console->controller, console->status->ticks,
                          console->status->sensor_status, &result)) {
    case SELFTEST_WAITS:
        return;
    case SELFTEST_ENDED:
        end_job(console,
                console->selftest.failures == 0 ? CONSOLE_OK : CONSOLE_ERROR_SELFTEST_FAILED);
        return;
    default:
        break;
    }
    console_selftest_line(console, &result);
}

static void save(console_t *console, record_store_t *record)
{
    switch (record_store_step(record)) {
    case RECORD_SAVE_BUSY:
        break;
    case RECORD_SAVE_DONE:
        end_job(console, CONSOLE_OK);
        break;
    default:
        end_job(console, CONSOLE_ERROR_SAVE_FAILED);
        break;
    }
}

static void print_job_line(console_t *console)
{
    console_out_t out;
    bool more;
    console_out_start(&out);
    switch (console->job) {
    case CONSOLE_JOB_HELP:
        more = console_help_line(console, &out);
        break;
    case CONSOLE_JOB_VERSION:
        more = console_version_line(console, &out);
        break;
    case CONSOLE_JOB_MODEL:
        more = console_model_line(console, &out);
        break;
    case CONSOLE_JOB_COLD:
        more = console_warm_line(console, &out);
        break;
    case CONSOLE_JOB_INPUTS:
        more = console_inputs_line(console, &out);
        break;
    case CONSOLE_JOB_WHY:
        more = console_why_line(console, &out);
        break;
    case CONSOLE_JOB_LEARNT:
        more = console_learnt_line(console, &out);
        break;
    default:
        more = console_faults_line(console, &out);
        break;
    }
    if (!more) {
        end_job(console, CONSOLE_OK);
        return;
    }
    if (out.line.length > 0) {
        console_out_end(console, &out);
    }
    console->step++;
}

void console_service(console_t *console)
{
    if (console->job == CONSOLE_JOB_NONE || !room_for(console, CONSOLE_ROOM_BYTES)) {
        return;
    }
    switch (console->job) {
    case CONSOLE_JOB_SETTINGS:
        list_settings(console);
        break;
    case CONSOLE_JOB_SAVE:
        save(console, &console->store->record);
        break;
    case CONSOLE_JOB_FORGET:
        save(console, &console->learnt->record);
        break;
    case CONSOLE_JOB_TELEMETRY:
        start_telemetry(console);
        break;
    case CONSOLE_JOB_SELFTEST:
        selftest(console);
        break;
    default:
        print_job_line(console);
        break;
    }
}

bool console_busy(const console_t *console)
{
    return console->job != CONSOLE_JOB_NONE;
}

/* --- lines in ------------------------------------------------------------------------------- */

bool console_ready(const console_t *console)
{
    return console->job == CONSOLE_JOB_NONE && room_for(console, CONSOLE_ANSWER_BYTES);
}

void console_break_line(console_t *console, console_error_t error)
{
    console->broken = (uint8_t)error;
}

void console_stop(console_t *console)
{
    console_mark_typed(console, "!");
    if (console->job == CONSOLE_JOB_SELFTEST) {
        selftest_end(&console->selftest, console->controller);
    }
    if (console->job == CONSOLE_JOB_TELEMETRY || console->job == CONSOLE_JOB_INPUTS) {
        console_follow_board_settings(console); /* not off for ever */
    }
    if (console->job != CONSOLE_JOB_NONE && console->job != CONSOLE_JOB_SAVE &&
        console->job != CONSOLE_JOB_FORGET) {
        end_job(console, CONSOLE_ERROR_STOPPED);
    }
    if (console->length > 0 || console->broken != CONSOLE_OK) {
        console->broken = CONSOLE_ERROR_STOPPED;
    }
}

#define BACKSPACE 0x08u
#define DELETE    0x7Fu

/* What is typed is worth less than the answer that needs the room; but where some of it is shown,
 * the answer begins a line of its own: for the end of the line there is room (console_ready()). */
static void echo(const console_t *console, const char *bytes, uint8_t length)
{
    if (console->echo && (bytes[0] == '\r' || room_for(console, CONSOLE_ANSWER_BYTES + length))) {
        console->output.write(console->output.context, bytes, length);
    }
}

void console_receive(console_t *console, uint8_t octet)
{
    if (octet == '\n' || octet == '\r') {
        const uint8_t length = console->length;
        if (length > 0 || console->broken != CONSOLE_OK) {
            echo(console, "\r\n", 2);
        }
        console->hint = CONSOLE_HINT_NONE;
        controller_host_heard(console->controller);
        console_error_t error = (console_error_t)console->broken;
        console->line[length] = '\0';
        console->length = 0;
        console->broken = CONSOLE_OK;
        if (length == 0 && error == CONSOLE_OK) {
            return;
        }
        if (error == CONSOLE_OK) {
            console_mark_typed(console, console->line);
            error = console_execute(console);
        }
        if (console->job == CONSOLE_JOB_NONE) {
            answer(console, error);
        }
        return;
    }
    if (octet == BACKSPACE || octet == DELETE) {
        if (console->length > 0) {
            console->length--;
            echo(console, "\b \b", 3);
        }
        return;
    }
    if (octet < ' ' || octet > '~') {
        if (console->broken == CONSOLE_OK) {
            console->broken = CONSOLE_ERROR_BAD_CHARACTER;
        }
        return;
    }
    if (console->length == CONSOLE_LINE_BYTES) {
        if (console->broken == CONSOLE_OK) {
            console->broken = CONSOLE_ERROR_LINE_TOO_LONG;
        }
        return;
    }
    console->line[console->length++] = (char)octet;
    echo(console, &console->line[console->length - 1u], 1);
}

/* --- start and status ----------------------------------------------------------------------- */

void console_init(console_t *console, const text_output_t *output, controller_t *controller,
                  settings_t *settings, settings_store_t *store, learnt_store_t *learnt,
                  telemetry_t *telemetry, const console_status_t *status)
{
    memset(console, 0, sizeof *console);
    console->output = *output;
    console->controller = controller;
    console->settings = settings;
    console->store = store;
    console->learnt = learnt;
    console->telemetry = telemetry;
    console->status = status;
    console_seal_settings(console);
}
