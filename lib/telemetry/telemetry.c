#include "telemetry_internal.h"

#include <stddef.h>
#include <string.h>

#define PIECE_BYTES 240u /* the last spring's Teleplot lines, with the array's */
#define CUT_SHIFT   6u   /* cuts are remembered in 64 mA */
#define CUT_STEPS   8u   /* and told again when they differ by more */
#define TOLD_AFTER_TURNS                                                                           \
    2u /* of a sight: a drive acts on it in the next turn; one that goes on is over */

void telemetry_init(telemetry_t *telemetry)
{
    telemetry->dropped = 0;
    (void)telemetry_set(telemetry, TELEMETRY_OFF, 5);
}

bool telemetry_set(telemetry_t *telemetry, uint8_t format, uint8_t hz)
{
    if (format >= TELEMETRY_FORMAT_COUNT || hz == 0 || hz > TELEMETRY_TICKS_PER_S) {
        return false;
    }
    telemetry->format = format;
    telemetry->hz = hz;
    telemetry->phase = 0;
    telemetry->next = 0;
    telemetry->left = 0;
    telemetry->rounds = 0;
    telemetry->tells = false;
    memset(telemetry->told, 0, sizeof telemetry->told);
    return true;
}

void telemetry_count_dropped(telemetry_t *telemetry, uint8_t lines)
{
    const uint16_t dropped = (uint16_t)(telemetry->dropped + lines);
    telemetry->dropped = dropped < lines ? UINT16_MAX : dropped;
}

/* Output under construction, and the numbers that go into it. */
typedef struct {
    text_line_t line;
    int32_t values[4];
    char bytes[PIECE_BYTES];
} piece_t;

static void start_piece(piece_t *piece)
{
    text_line_start(&piece->line, piece->bytes, PIECE_BYTES);
}

static void add(piece_t *piece, const char *flash_text)
{
    text_add_values(&piece->line, flash_text, piece->values);
}

static void flush(text_line_t *line, const text_output_t *output)
{
    output->write(output->context, line->bytes, line->length);
    line->length = 0;
}

/* 0..800 steps of the duty as 1/1000, rounded. */
static int32_t duty_permille(uint16_t steps)
{
    return (int32_t)((steps * 5u + 2u) >> 2);
}

/* The first fault there is: the board's, else the lowest spring's. */
static uint8_t first_fault(const controller_t *controller)
{
    uint8_t fault = (uint8_t)controller_board_fault(controller);
    const uint8_t springs = controller_springs(controller);
    for (uint8_t k = 0; k < springs && fault == 0; k++) {
        fault = (uint8_t)controller_fault(controller, k);
    }
    return fault;
}

static void add_state(piece_t *piece, const controller_t *controller)
{
    piece->values[0] = first_fault(controller);
    if (piece->values[0] != 0) {
        add(piece, FLASH_TEXT("fault_#0"));
    } else {
        text_add_flash(&piece->line,
                       controller_is_locked(controller) ? FLASH_TEXT("locked") : FLASH_TEXT("ok"));
    }
}

static void write_csv(telemetry_t *telemetry, const controller_t *controller,
                      const text_time_t *time, int16_t ambient_c7, const text_output_t *output)
{
    piece_t piece;
    text_line_t *const line = &piece.line;
    const uint8_t springs = controller_springs(controller);
    if (output->room(output->context) < TELEMETRY_LINE_BYTES((uint16_t)springs)) {
        telemetry_count_dropped(telemetry, 1);
        return;
    }
    start_piece(&piece);
    text_add_time_s(line, time);
    for (uint8_t k = 0; k < springs; k++) {
        piece.values[0] = controller_measured_ma(controller, k);
        piece.values[1] = controller_measured_mv(controller, k);
        piece.values[2] = text_centi_from_c7(controller_temperature_c7(controller, k));
        piece.values[3] = duty_permille(controller_duty(controller, k));
        add(&piece, FLASH_TEXT(",#3,#3,#2,#3"));
        flush(line, output);
    }
    piece.values[0] = controller_fan_percent(controller);
    piece.values[1] = text_centi_from_c7(ambient_c7);
    add(&piece, FLASH_TEXT(",#2,#2,"));
    add_state(&piece, controller);
    text_add_flash(line, FLASH_TEXT("\r\n"));
    flush(line, output);
}

void telemetry_add_limits(text_line_t *line, uint16_t limits, char separator)
{
    static const char names[] FLASH_MEMORY =
        "none\0safety\0current\0supply\0temperature\0undriven\0overload\0trip\0blind\0"
        "cooling\0away";
    uint16_t named = (uint16_t)(limits == 0 ? 1u : (unsigned)limits << 1);
    for (const char *name = names; named != 0; named >>= 1, name = text_item(name, 1)) {
        if ((named & 1u) != 0) {
            text_add_char(line, separator);
            text_add_flash(line, name);
        }
    }
}

/* "name:ms:value": name with the first of the values, value with the second. */
static void add_point(piece_t *piece, const char *name, const text_time_t *time, const char *value,
                      int32_t number)
{
    add(piece, name);
    text_add_time_ms(&piece->line, time);
    text_add_values(&piece->line, value, &number);
}

static void add_bounds(piece_t *piece, const controller_t *controller, const text_time_t *time,
                       uint8_t k)
{
    const spring_bounds_t bounds_c = controller_temperature_bounds_c(controller, k);
    add_point(piece, FLASH_TEXT(">low#0:"), time, FLASH_TEXT(":#2\r\n"),
              (int32_t)(100.0f * bounds_c.low));
    add_point(piece, FLASH_TEXT(">high#0:"), time, FLASH_TEXT(":#2\r\n"),
              (int32_t)(100.0f * bounds_c.high));
}

/* What is due of the next spring: its round of Teleplot, or what is new of its limits. Gives
 * whether the one after it may have its turn in this tick, too. */
static bool write_spring(telemetry_t *telemetry, const controller_t *controller,
                         const text_time_t *time, const text_output_t *output)
{
    piece_t piece;
    text_line_t *const line = &piece.line;
    const uint8_t springs = controller_springs(controller);
    const uint8_t k = telemetry->next < springs ? telemetry->next : 0;
    const uint8_t number = (uint8_t)(k + 1u);
    const bool csv = telemetry->format == TELEMETRY_CSV;
    const uint16_t limits = controller_limits(controller, k);
    const uint16_t cut_ma = controller_cut_ma(controller, k);
    const uint8_t cut = (uint8_t)(cut_ma >> CUT_SHIFT);
    telemetry_told_t *const told = &telemetry->told[k];
    const uint8_t change = (uint8_t)(cut - told->cut);

    start_piece(&piece);
    piece.values[0] = number;
    if (csv) {
        if (limits != told->limits || (uint8_t)(change + CUT_STEPS) > 2u * CUT_STEPS) {
            const int32_t cut_value = cut_ma;
            add(&piece, FLASH_TEXT("<limits|spring:#0|t:"));
            text_add_time_s(line, time);
            telemetry_add_limits(line, limits, '|');
            text_add_values(line, FLASH_TEXT("|cut_a:#3>\r\n"), &cut_value);
        }
    } else {
        if ((limits | told->limits) != 0) {
            add_point(&piece, FLASH_TEXT(">cut#0:"), time, FLASH_TEXT(":#3\r\n"), cut_ma);
            add_point(&piece, FLASH_TEXT(">limits#0:"), time, FLASH_TEXT(":#0\r\n"), limits);
        }
        add_point(&piece, FLASH_TEXT(">i#0:"), time, FLASH_TEXT(":#3\r\n"),
                  controller_measured_ma(controller, k));
        add_point(&piece, FLASH_TEXT(">m#0:"), time, FLASH_TEXT(":#2\r\n"),
                  text_centi_from_c7(controller_temperature_c7(controller, k)));
        if (telemetry->rounds == 0) {
            add_bounds(&piece, controller, time, k);
        }
        if (number == springs) {
            add_point(&piece, FLASH_TEXT(">fan:"), time, FLASH_TEXT(":#2\r\n"),
                      controller_fan_percent(controller));
            add_point(&piece, FLASH_TEXT(">fault:"), time, FLASH_TEXT(":#0\r\n"),
                      first_fault(controller));
        }
    }
    const bool says = line->length != 0;
    if (says) {
        const uint16_t free = csv ? 0u : TELEMETRY_LEAVES_FREE_BYTES;
        if (output->room(output->context) < (uint16_t)(line->length + free)) {
            return false;
        }
        told->limits = limits;
        told->cut = cut;
        flush(line, output);
    }
    telemetry->next = number;
    telemetry->left--;
    return !csv || !says; /* of status at most one line a tick */
}

/* Some milliseconds before. */
static text_time_t earlier(const text_time_t *time, uint32_t by_ms)
{
    text_time_t then = {time->s - by_ms / 1000u, (uint16_t)(time->ms + 1000u - by_ms % 1000u)};
    if (then.ms >= 1000u) {
        then.ms = (uint16_t)(then.ms - 1000u);
    } else {
        then.s--;
    }
    return then;
}

static void add_sight(piece_t *piece, const spring_sight_t *sight, const text_time_t *time)
{
    /* as spring_sight_kind_t and SPRING_DID_ have them */
    static const char kinds[] FLASH_MEMORY =
        "onset\0finish\0unseen\0lost\0kept\0transforms\0jumped\0looked\0told\0"
        "cooled\0anew";
    static const char deeds[] FLASH_MEMORY = "heated\0held\0blind\0opened";
    text_line_t *const line = &piece->line;
    piece->values[0] = sight->spring + 1;
    add(piece, FLASH_TEXT("<sight|spring:#0|t:"));
    text_add_time_s(line, time);
    text_add_char(line, '|');
    text_add_flash(line, text_item(kinds, sight->kind));
    if (sight->read_sd != 0) {
        piece->values[0] = sight->read;
        piece->values[1] = sight->read_sd;
        add(piece, FLASH_TEXT("|read:#2|read_sd:#2"));
    }
    if (sight->believed_sd != 0) {
        piece->values[0] = sight->believed;
        piece->values[1] = sight->believed_sd;
        add(piece, FLASH_TEXT("|believed_k:#1|believed_sd:#1"));
    }
    if (sight->seen_sd != 0) {
        piece->values[0] = sight->seen;
        piece->values[1] = sight->seen_sd;
        add(piece, FLASH_TEXT("|seen_k:#1|seen_sd:#1"));
    }
    piece->values[0] = sight->now;
    piece->values[1] = sight->now_sd;
    piece->values[2] = sight->shift;
    piece->values[3] = sight->loss;
    add(piece, FLASH_TEXT("|now_k:#1|now_sd:#1|shift_k:#1|loss:#2"));
    for (uint8_t i = 0; (unsigned)sight->did >> i != 0; i++) {
        if (((unsigned)sight->did >> i & 1u) != 0) {
            text_add_char(line, '|');
            text_add_flash(line, text_item(deeds, i));
        }
    }
    text_add_flash(line, FLASH_TEXT(">\r\n"));
}

/* The next sight that is not told yet, where it is old enough and finds room. */
static void write_sight(telemetry_t *telemetry, const controller_t *controller,
                        const text_time_t *time, const text_output_t *output)
{
    const spring_sights_t *const sights = controller_sights(controller);
    const spring_sight_t *const sight =
        spring_sights_from(sights, SPRING_SIGHTS_ANY,
                           telemetry->tells ? telemetry->sight : spring_sights_first(sights));
    if (sight == NULL) {
        return;
    }
    const uint16_t age_turns = spring_sights_age_turns(sights, sight);
    if (age_turns < TOLD_AFTER_TURNS) {
        return;
    }
    const text_time_t then = earlier(time, age_turns * (1000ul / SPRING_SIGHTS_TURNS_PER_S));
    piece_t piece;
    start_piece(&piece);
    add_sight(&piece, sight, &then);
    if (output->room(output->context) >= piece.line.length) {
        telemetry->tells = true;
        telemetry->sight = sight->number + 1u;
        flush(&piece.line, output);
    }
}

void telemetry_tick(telemetry_t *telemetry, const controller_t *controller, const text_time_t *time,
                    int16_t ambient_c7, const text_output_t *output)
{
    if (telemetry->format == TELEMETRY_OFF || telemetry->format == TELEMETRY_INPUTS) {
        return;
    }
    telemetry->phase = (uint8_t)(telemetry->phase + telemetry->hz);
    if (telemetry->phase >= TELEMETRY_TICKS_PER_S) {
        telemetry->phase = (uint8_t)(telemetry->phase - TELEMETRY_TICKS_PER_S);
        if (telemetry->format == TELEMETRY_CSV) {
            write_csv(telemetry, controller, time, ambient_c7, output);
        } else {
            telemetry_count_dropped(telemetry, telemetry->left);
            telemetry->rounds = (uint8_t)((telemetry->rounds + 1u) % telemetry->hz);
        }
        telemetry->left = controller_springs(controller);
    }
    while (telemetry->left != 0 && write_spring(telemetry, controller, time, output)) {
    }
    /* after the first row: who asked for it has had its answer by then */
    if (telemetry->format == TELEMETRY_CSV && telemetry->left == 0 && telemetry->next != 0) {
        write_sight(telemetry, controller, time, output);
    }
}

bool telemetry_header(uint8_t springs, uint8_t piece, text_line_t *line)
{
    if (piece == 0) {
        text_add_flash(line, FLASH_TEXT("time_s"));
    } else if (piece <= springs) {
        const int32_t number[] = {piece, piece, piece, piece};
        text_add_values(line, FLASH_TEXT(",i#0_a,v#0_v,m#0_c,d#0"), number);
    } else if (piece == springs + 1u) {
        text_add_flash(line, FLASH_TEXT(",fan,ambient_c,state\r\n"));
    } else {
        return false;
    }
    return true;
}
