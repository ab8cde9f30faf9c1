/* What it is for: the console's error numbers, their names and texts, in one table.
 * What it owns: the numbers; docs/codes.csv and docs/console.md are held to them by a test.
 * What it never does: renumber. Fault numbers are safety's (safety_fault_t). */
#ifndef CONSOLE_CODES_H
#define CONSOLE_CODES_H

#include <stdint.h>

#include "flash_memory.h"

#ifdef __cplusplus
extern "C" {
#endif

/* X(NAME, number, name, text) */
#define CONSOLE_ERRORS(X)                                                                          \
    X(UNKNOWN_WORD, 1, "unknown_word", "unknown word; help lists them")                            \
    X(MISSING_ARGUMENT, 2, "missing_argument", "an argument is missing")                           \
    X(SURPLUS_ARGUMENT, 3, "surplus_argument", "too many arguments")                               \
    X(BAD_ARGUMENT, 4, "bad_argument", "an argument is not of the right form")                     \
    X(OUT_OF_RANGE, 5, "out_of_range", "a number is out of range")                                 \
    X(LINE_TOO_LONG, 6, "line_too_long", "line of more than 64 characters: nothing done")          \
    X(BAD_CHARACTER, 7, "bad_character",                                                           \
      "a byte that is no printable ASCII: nothing done; send the line again")                      \
    X(UNKNOWN_SETTING, 8, "unknown_setting", "no such setting; $$ lists them")                     \
    X(SETTINGS_CONFLICT, 9, "settings_conflict", "settings do not fit together; see $$")           \
    X(LOCKED, 10, "locked", "locked after a reset; type unlock")                                   \
    X(FAULT, 11, "fault", "a fault is latched; see faults and type clear")                         \
    X(STOPPED, 12, "stopped", "dropped by the stop; clear and send it again")                      \
    X(INPUT_LOST, 13, "input_lost", "bytes were lost: nothing done; wait for ok between lines")    \
    X(SAVE_FAILED, 14, "save_failed",                                                              \
      "EEPROM does not keep what was written: it holds until power-off")                           \
    X(NOT_AVAILABLE, 15, "not_available", "not available on this board")                           \
    X(SPRINGS_ON, 16, "springs_on", "switch all springs off first")                                \
    X(SELFTEST_FAILED, 17, "selftest_failed", "selftest found the faults above")                   \
    X(SUPPLY_OFF, 18, "supply_off", "the supply is off; type clear and supply on")

typedef enum {
    CONSOLE_OK = 0,
#define CONSOLE_ERROR_ENUM(NAME, number, name, text) CONSOLE_ERROR_##NAME = number,
    CONSOLE_ERRORS(CONSOLE_ERROR_ENUM)
#undef CONSOLE_ERROR_ENUM
        CONSOLE_ERROR_END
} console_error_t;

/* Both in flash on the AVR; "" where there is no such error. */
const char *console_error_name(console_error_t error);
const char *console_error_text(console_error_t error);

#ifdef __cplusplus
}
#endif
#endif
