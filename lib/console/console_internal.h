/* What it is for: what the console's two files share: lines out.
 * What it owns: the shape of a line under construction.
 * What it never does: serve anyone outside this folder: users include console.h. */
#ifndef CONSOLE_INTERNAL_H
#define CONSOLE_INTERNAL_H

#include "console.h"

typedef struct {
    text_line_t line;
    char bytes[CONSOLE_ROOM_BYTES];
} console_out_t;

void console_out_start(console_out_t *out);
void console_out_end(const console_t *console, console_out_t *out);

/* One line of an answer that has several, by console->step; false after the last one. */
bool console_version_line(const console_t *console, console_out_t *out);
bool console_model_line(const console_t *console, console_out_t *out);
bool console_faults_line(const console_t *console, console_out_t *out);

/* As `$$` has it. */
void console_print_setting(const console_t *console, uint16_t index, uint8_t element);
void console_selftest_line(const console_t *console, const selftest_result_t *result);

#endif
