/* What it is for: the state of the array at a steady rate, as CSV or as Teleplot lines.
 * What it owns: the rate, the count of lines that found no room, what was told of the limits.
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
    TELEMETRY_INPUTS, /* telemetry_inputs instead of telemetry_tick */
    TELEMETRY_FORMAT_COUNT
} telemetry_format_t;

#define TELEMETRY_TICKS_PER_S                                                                      \
    50u /* rates are 1..50 Hz; those that do not divide 50 alternate two gaps */
/* One CSV line: time, per spring current, voltage, temperature and duty, and the end of the line.
 */
#define TELEMETRY_LINE_BYTES(springs) ((uint16_t)(39u + 29u * (springs)))
/* Teleplot leaves this much of the transmit buffer free: a line of an answer. A CSV line is so long
 * that its own room is more than that, and one line of status a tick does not fill the port. */
#define TELEMETRY_LEAVES_FREE_BYTES 128u

/* What was last said of a spring's limits. */
typedef struct {
    uint16_t limits; /* bits of drive_policy_limit_t */
    uint8_t cut;     /* 64 mA */
} telemetry_told_t;

typedef struct {
    uint8_t format; /* telemetry_format_t */
    uint8_t hz;
    uint8_t phase;    /* hz per tick, modulo TELEMETRY_TICKS_PER_S */
    uint16_t dropped; /* lines, stays at 65535 */
    uint8_t next;     /* spring whose turn it is; the array's springs: the first */
    uint8_t left;     /* springs that have not had theirs in this period */
    uint8_t rounds;   /* of Teleplot, since one with bounds */
    bool tells;       /* sights from this number on are still to be told; else from the first */
    uint32_t sight;
    telemetry_told_t told[CONTROLLER_MAX_SPRINGS];
} telemetry_t;

/* Off, hz 5, nothing dropped. */
void telemetry_init(telemetry_t *telemetry);
/* The next line is due one period from now; of no spring's limits anything has been told. Fails
 * (false, nothing changed) if and only if the format does not exist or hz is not 1..50. */
bool telemetry_set(telemetry_t *telemetry, uint8_t format, uint8_t hz);

/* Once per control tick; writes when a line is due. time is the tick's, ambient_c7 as the
 * controller got it.
 * CSV is the log of docs/files.md with the simulator's extra columns: per spring i{k}_a and v{k}_v
 * as measured, m{k}_c the model's temperature, d{k} the duty; then fan, ambient_c and state: "ok",
 * "locked" or "fault_N". Between those lines, as status, which limits act on a spring and by how
 * much: "<limits|spring:5|t:12.340|supply|temperature|cut_a:2.610>", "|none|" once they have ended.
 * Once a period each spring is looked at, and told where its limits are others than those last told
 * or the cut has changed by half an ampere: at most one such line a tick, later where there is no
 * room. So is each sight of a spring (spring_sights.h), half a second later, when it is known what
 * was done about it:
 * "<sight|spring:5|t:12.340|lost|read:-1.32|read_sd:0.05|believed_k:2.4|believed_sd:1.8|seen_k:-0.8|
 * seen_sd:1.2|now_k:0.1|now_sd:1.0|shift_k:0.4|loss:1.20|heated>": in the words of `why`, what does
 * not apply left out. Teleplot is a round a period: i{k} and m{k} of each spring, limits{k} and
 * cut{k} while limits act and once when they have ended, once a second low{k} and high{k}, the
 * bounds of its temperature, fan and fault with the last spring. A round takes as many ticks as it
 * needs; what is left of it when the next one is due is dropped, counted once a spring, and the
 * next one begins there. */
void telemetry_tick(telemetry_t *telemetry, const controller_t *controller, const text_time_t *time,
                    int16_t ambient_c7, const text_output_t *output);

/* Once per control tick, after it: in the format TELEMETRY_INPUTS all that the controller was
 * given, as a line of hil_frame.h ("~S..."), and the mark of one spring after the other:
 * "<belief|spring:5|tick:1234|mark:4A6C>". Together with the lines that were typed, in their
 * places, that is what a replay needs: sim_host/rerun. tick counts, modulo 65536. */
void telemetry_inputs(telemetry_t *telemetry, const controller_t *controller,
                      const controller_inputs_t *inputs, uint16_t tick,
                      const text_output_t *output);
/* " 3C0F": so many bytes from the lowest address on, as hexadecimal digits. */
void telemetry_add_hex(text_line_t *line, const void *bytes, uint8_t count);

/* The names of the limits (bits of drive_policy_limit_t), each after the separator. */
void telemetry_add_limits(text_line_t *line, uint16_t limits, char separator);

/* The CSV's first line in pieces: piece 0 .. springs + 1 into line. False after the last one. */
bool telemetry_header(uint8_t springs, uint8_t piece, text_line_t *line);

#ifdef __cplusplus
}
#endif
#endif
