/* What it is for: the serial console: lines in, lines out, then exactly one `ok` or `error:N text`
 * a line.
 * What it owns: the line under construction, the words, the order of answers.
 * What it never does: wait. A long answer or a save goes on in console_service, one line or byte
 * at a time. */
#ifndef CONSOLE_H
#define CONSOLE_H

#include <stdbool.h>
#include <stdint.h>

#include "console_codes.h"
#include "controller.h"
#include "learnt_store.h"
#include "scrub.h"
#include "selftest.h"
#include "settings.h"
#include "telemetry.h"
#include "text.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CONSOLE_LINE_BYTES 64u  /* longest line in, without its end */
#define CONSOLE_ROOM_BYTES 128u /* longest line out, with its end */
/* Room that a line in waits for: its own end where it is echoed, and a refused setting says two
 * lines. */
#define CONSOLE_ANSWER_BYTES (2u + 2u * CONSOLE_ROOM_BYTES)

/* What the console shows but does not find in the controller; kept by whoever runs the loop. */
typedef struct {
    text_time_t time;         /* since start */
    uint32_t ticks;           /* control ticks since start */
    uint16_t ticks_late;      /* that began after the next one was due; stays at 65535 */
    uint16_t tick_longest_us; /* sensors, controller and outputs */
    uint8_t load_percent;     /* time not asleep, over the last second */
    uint16_t stack_unused_bytes;
    int16_t ambient_c7;
    bool ambient_is_held;     /* the thermistor says what no room does: ambient_c7 is of before */
    const char *reset_cause;  /* words in flash, "power-on" ... */
    const char *version;      /* in flash */
    const char *sensors;      /* which driver, in flash */
    settings_loaded_t loaded; /* what the boot found in the EEPROM */
    bool settings_conflict_at_boot; /* the stored settings do not fit together: defaults are active
                                     */
    uint8_t sensor_status[CONTROLLER_MAX_SPRINGS]; /* controller_sensor_status_t of the last tick */
} console_status_t;

typedef struct {
    text_output_t output;
    controller_t *controller;
    settings_t *settings; /* as set; active once they fit together */
    settings_store_t *store;
    learnt_store_t *learnt;
    telemetry_t *telemetry;
    const console_status_t *status;
    /* internal */
    uint8_t job;     /* what console_service goes on with */
    uint8_t step;    /* of the job */
    uint8_t element; /* of a listed setting; the spring that is asked about */
    uint32_t sight;  /* number of the one that is printed */
    selftest_t selftest;
    bool conflict;       /* settings differ from what is active, since they do not fit together */
    uint8_t next_format; /* telemetry that starts after its header */
    uint8_t next_hz;
    bool echo;        /* what is typed is shown */
    uint8_t hint;     /* console_hint_t: what would have been right, of the line that is answered */
    uint16_t hint_of; /* a word, or a row of parameters.def */
    uint8_t hint_element;
    const char *hint_text;
    int32_t hint_values[2];
    scrub_t scrub;  /* of settings, which nobody but the console changes, and of all above job */
    uint8_t broken; /* console_error_t of the line under construction */
    uint8_t length;
    char line[CONSOLE_LINE_BYTES + 1u];
} console_t;

/* The pointers must stay valid. settings must be those the controller was initialised with. */
void console_init(console_t *console, const text_output_t *output, controller_t *controller,
                  settings_t *settings, settings_store_t *store, learnt_store_t *learnt,
                  telemetry_t *telemetry, const console_status_t *status);

/* Two lines after start: who it is, why it started, what became of the settings. */
void console_greet(console_t *console);

/* True when the next received byte may be given to console_receive: no answer is under way and
 * there is room for the next one. */
bool console_ready(const console_t *console);
/* One received byte; '\n' or '\r' ends a line, an empty line is not answered.
 * Backspace and delete take the last byte back. Letters are as good as small ones. Each end of a
 * line tells the controller that the host is there. */
void console_receive(console_t *console, uint8_t octet);

/* Goes on with an answer under way, at most one line or one EEPROM byte. Call it in each turn of
 * the loop. */
void console_service(console_t *console);
/* True while console_service has something to go on with. */
bool console_busy(const console_t *console);

/* Looks through the next 16 bytes of the settings. False if and only if one of them has changed by
 * itself, as RAM may, since console_init: then none of them is to be used or saved. Once a tick. */
bool console_hold_settings(console_t *console);

/* The line under construction will be answered with this error. For bytes that were lost. */
void console_break_line(console_t *console, console_error_t error);
/* '!' was received: what is under way is answered `error:12`, what had begun on the line is
 * dropped. The caller has already switched the outputs off. */
void console_stop(console_t *console);

/* The line that '?' asks for. Call it when there is room for CONSOLE_ROOM_BYTES. */
void console_print_status(const console_t *console);

#ifdef __cplusplus
}
#endif
#endif
