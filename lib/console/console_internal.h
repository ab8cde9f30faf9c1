/* What it is for: what the console's files share: lines out, and what goes on over several turns.
 * What it owns: the shape of a line under construction, the jobs.
 * What it never does: serve anyone outside this folder: users include console.h. */
#ifndef CONSOLE_INTERNAL_H
#define CONSOLE_INTERNAL_H

#include "console.h"

typedef enum {
    CONSOLE_JOB_NONE = 0,
    CONSOLE_JOB_HELP,
    CONSOLE_JOB_VERSION,
    CONSOLE_JOB_MODEL,
    CONSOLE_JOB_COLD,
    CONSOLE_JOB_LEARNT,
    CONSOLE_JOB_WHY,
    CONSOLE_JOB_FAULTS,
    CONSOLE_JOB_SETTINGS,
    CONSOLE_JOB_SAVE,
    CONSOLE_JOB_FORGET,
    CONSOLE_JOB_TELEMETRY,
    CONSOLE_JOB_INPUTS,
    CONSOLE_JOB_SELFTEST
} console_job_t;

typedef struct {
    text_line_t line;
    char bytes[CONSOLE_ROOM_BYTES];
} console_out_t;

void console_out_start(console_out_t *out);
void console_out_end(const console_t *console, console_out_t *out);

/* One line of an answer that has several, by console->step; false after the last one. */
bool console_help_line(const console_t *console, console_out_t *out);
bool console_version_line(const console_t *console, console_out_t *out);
bool console_model_line(const console_t *console, console_out_t *out);
bool console_warm_line(const console_t *console, console_out_t *out);
bool console_learnt_line(const console_t *console, console_out_t *out);
bool console_inputs_line(console_t *console, console_out_t *out);
/* Where inputs are streamed: a line takes effect here. In RAM. */
void console_mark_typed(const console_t *console, const char *line);
/* One is asked for. */
bool console_any_spring_on(const console_t *console);
bool console_why_line(console_t *console, console_out_t *out);
bool console_faults_line(const console_t *console, console_out_t *out);

void console_start_job(console_t *console, console_job_t job);

/* What follows the text of an error. */
typedef enum {
    CONSOLE_HINT_NONE = 0,
    CONSOLE_HINT_TEXT,   /* hint_text with hint_values */
    CONSOLE_HINT_WORD,   /* how word number hint_of is written */
    CONSOLE_HINT_RANGE,  /* of setting hint_of, hint_element */
    CONSOLE_HINT_SETTING /* its name */
} console_hint_t;

/* text in flash; values as text_add_values takes them. */
void console_hint_text(console_t *console, const char *text, int32_t first, int32_t second);
void console_hint_setting(console_t *console, console_hint_t hint, uint16_t row, uint8_t element);
void console_add_setting_hint(const console_t *console, text_line_t *line);

/* The line that was typed: a word with its arguments, or a setting. */
console_error_t console_execute(console_t *console);
/* "write on K|all [0..100]": how a word, by its number, is written. */
void console_add_usage(text_line_t *line, uint16_t word);
/* A line that starts with '$'. */
console_error_t console_settings_line(console_t *console, char *line);
/* Around each change of the settings. */
void console_open_settings(console_t *console);
void console_seal_settings(console_t *console);
/* Activates the settings as they are set, or says which two of them do not fit together. */
void console_apply_settings(console_t *console);
/* Telemetry can be set by word or as a setting: one truth, the setting. */
void console_follow_board_settings(console_t *console);
/* Sets one, without activating it. */
console_error_t console_assign(console_t *console, const char *name, const char *value);
/* As `$$` has it. */
void console_print_setting(const console_t *console, uint16_t index, uint8_t element);
void console_selftest_line(const console_t *console, const selftest_result_t *result);

#endif
