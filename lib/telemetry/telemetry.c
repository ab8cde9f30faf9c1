#include "telemetry.h"

#define PIECE_BYTES 40u

void telemetry_init(telemetry_t *telemetry)
{
    telemetry->format = TELEMETRY_OFF;
    telemetry->hz = 5;
    telemetry->phase = 0;
    telemetry->dropped = 0;
}

bool telemetry_set(telemetry_t *telemetry, uint8_t format, uint8_t hz)
{
    if (format >= TELEMETRY_FORMAT_COUNT || hz == 0 || hz > TELEMETRY_TICKS_PER_S) {
        return false;
    }
    telemetry->format = format;
    telemetry->hz = hz;
    telemetry->phase = 0;
    return true;
}

static void count_dropped(telemetry_t *telemetry)
{
    if (telemetry->dropped < UINT16_MAX) {
        telemetry->dropped++;
    }
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

static void add_state(text_line_t *line, const controller_t *controller)
{
    const uint8_t fault = first_fault(controller);
    if (fault != 0) {
        const int32_t value = fault;
        text_add_values(line, FLASH_TEXT("fault_#0"), &value);
    } else {
        text_add_flash(line,
                       controller_is_locked(controller) ? FLASH_TEXT("locked") : FLASH_TEXT("ok"));
    }
}

static void write_csv(telemetry_t *telemetry, const controller_t *controller, uint32_t time_ms,
                      int16_t ambient_c7, const text_output_t *output)
{
    char bytes[PIECE_BYTES];
    text_line_t line;
    const uint8_t springs = controller_springs(controller);
    if (output->room(output->context) < TELEMETRY_LINE_BYTES((uint16_t)springs)) {
        count_dropped(telemetry);
        return;
    }
    text_line_start(&line, bytes, sizeof bytes);
    text_add_decimal(&line, (int32_t)(time_ms & 0x7FFFFFFFul), 3);
    for (uint8_t k = 0; k < springs; k++) {
        const int32_t values[] = {controller_measured_ma(controller, k),
                                  controller_measured_mv(controller, k),
                                  text_centi_from_c7(controller_temperature_c7(controller, k)),
                                  duty_permille(controller_duty(controller, k))};
        text_add_values(&line, FLASH_TEXT(",#3,#3,#2,#3"), values);
        flush(&line, output);
    }
    const int32_t values[] = {controller_fan_percent(controller), text_centi_from_c7(ambient_c7)};
    text_add_values(&line, FLASH_TEXT(",#2,#2,"), values);
    add_state(&line, controller);
    text_add_flash(&line, FLASH_TEXT("\r\n"));
    flush(&line, output);
}

typedef struct {
    telemetry_t *telemetry;
    const text_output_t *output;
    uint32_t time_ms;
} teleplot_t;

/* number 0: a name without one. */
static void write_teleplot_line(const teleplot_t *teleplot, const char *flash_name, uint8_t number,
                                int32_t value, uint8_t decimals)
{
    char bytes[PIECE_BYTES];
    text_line_t line;
    text_line_start(&line, bytes, sizeof bytes);
    text_add_char(&line, '>');
    text_add_flash(&line, flash_name);
    if (number != 0) {
        text_add_decimal(&line, number, 0);
    }
    text_add_char(&line, ':');
    text_add_decimal(&line, (int32_t)(teleplot->time_ms & 0x7FFFFFFFul), 0);
    text_add_char(&line, ':');
    text_add_decimal(&line, value, decimals);
    text_add_flash(&line, FLASH_TEXT("\r\n"));
    if (teleplot->output->room(teleplot->output->context) <
        line.length + TELEMETRY_LEAVES_FREE_BYTES) {
        count_dropped(teleplot->telemetry);
        return;
    }
    flush(&line, teleplot->output);
}

static void write_teleplot(telemetry_t *telemetry, const controller_t *controller, uint32_t time_ms,
                           const text_output_t *output)
{
    const teleplot_t teleplot = {telemetry, output, time_ms};
    const uint8_t springs = controller_springs(controller);
    for (uint8_t k = 0; k < springs; k++) {
        const uint8_t number = (uint8_t)(k + 1u);
        write_teleplot_line(&teleplot, FLASH_TEXT("i"), number,
                            controller_measured_ma(controller, k), 3);
        write_teleplot_line(&teleplot, FLASH_TEXT("m"), number,
                            text_centi_from_c7(controller_temperature_c7(controller, k)), 2);
    }
    write_teleplot_line(&teleplot, FLASH_TEXT("fan"), 0, controller_fan_percent(controller), 2);
    write_teleplot_line(&teleplot, FLASH_TEXT("fault"), 0, first_fault(controller), 0);
}

void telemetry_tick(telemetry_t *telemetry, const controller_t *controller, uint32_t time_ms,
                    int16_t ambient_c7, const text_output_t *output)
{
    if (telemetry->format == TELEMETRY_OFF) {
        return;
    }
    telemetry->phase = (uint8_t)(telemetry->phase + telemetry->hz);
    if (telemetry->phase < TELEMETRY_TICKS_PER_S) {
        return;
    }
    telemetry->phase = (uint8_t)(telemetry->phase - TELEMETRY_TICKS_PER_S);
    if (telemetry->format == TELEMETRY_CSV) {
        write_csv(telemetry, controller, time_ms, ambient_c7, output);
    } else {
        write_teleplot(telemetry, controller, time_ms, output);
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
