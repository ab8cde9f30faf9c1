/* What it is for: the state of the array at a steady rate, as CSV or as Teleplot lines.
 * What it owns: the rate, and the count of lines that found no room.
 * What it never does: wait. A line that does not fit the output is dropped whole and counted. */
#ifndef TELEMETRY_H
#define TELEMETRY_H

#include <stdbool.h>
#include <stdint.h>

#include "controller.h"
#include "text.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    TELEMETRY_OFF = 0,
    TELEMETRY_CSV,
    TELEMETRY_TELEPLOT,
    TELEMETRY_FORMAT_COUNT
} telemetry_format_t;

#define TELEMETRY_TICKS_PER_S                                                                      \
    50u /* rates are 1..50 Hz; those that do not divide 50 alternate two gaps */
/* One CSV line: time, per spring current, voltage, temperature and duty, and the end of the line.
 */
/* Teleplot's short lines leave this much of the transmit buffer free, or a rate above the line's
 * capacity would keep it full and the console, which waits for room, would never answer again. A
 * CSV line is so long that its own room is more than that. */
#define TELEMETRY_LEAVES_FREE_BYTES   256u
#define TELEMETRY_LINE_BYTES(springs) ((uint16_t)(36u + 29u * (springs)))

typedef struct {
    uint8_t format; /* telemetry_format_t */
    uint8_t hz;
    uint8_t phase;    /* hz per tick, modulo TELEMETRY_TICKS_PER_S */
    uint16_t dropped; /* lines, stays at 65535 */
} telemetry_t;

/* Off, hz 5, nothing dropped. */
void telemetry_init(telemetry_t *telemetry);
/* The next line is due one period from now. Fails (false, nothing changed) if and only if the
 * format does not exist or hz is not 1..50. */
bool telemetry_set(telemetry_t *telemetry, uint8_t format, uint8_t hz);

/* Once per control tick; writes when a line is due. time_ms is the tick's, ambient_c7 as the
 * controller got it. CSV is design section 4's log with the simulator's extra columns: per spring
 * i{k}_a and v{k}_v as measured, m{k}_c the model's temperature, d{k} the duty; then fan, ambient_c
 * and state: "ok", "locked" or "fault_N". */
void telemetry_tick(telemetry_t *telemetry, const controller_t *controller, uint32_t time_ms,
                    int16_t ambient_c7, const text_output_t *output);

/* The CSV's first line in pieces: piece 0 .. springs + 1 into line. False after the last one. */
bool telemetry_header(uint8_t springs, uint8_t piece, text_line_t *line);

#ifdef __cplusplus
}
#endif
#endif
