#include "hil_frame.h"
#include "telemetry_internal.h"

#define MARK_TICKS 5u /* a mark in so many ticks: nine springs in a second */
#define MARK_BYTES 48u

void telemetry_add_hex(text_line_t *line, const void *bytes, uint8_t count)
{
    const uint8_t *const octets = bytes;
    for (uint8_t i = 0; i < count; i++) {
        for (uint8_t shift = 8; shift != 0;) {
            shift = (uint8_t)(shift - 4u);
            const uint8_t digit = (uint8_t)((unsigned)octets[i] >> shift & 15u);
            text_add_char(line, (char)(digit < 10u ? '0' + digit : 'A' + digit - 10));
        }
    }
}

static void write_mark(const controller_t *controller, uint16_t tick, const text_output_t *output)
{
    char bytes[MARK_BYTES];
    text_line_t line;
    const uint8_t k = (uint8_t)(tick / MARK_TICKS % controller_springs(controller));
    const int32_t values[] = {k + 1, tick};
    const uint16_t mark = controller_belief_mark(controller, k);
    text_line_start(&line, bytes, sizeof bytes);
    text_add_values(&line, FLASH_TEXT("<belief|spring:#0|tick:#0|mark:"), values);
    telemetry_add_hex(&line, &mark, sizeof mark);
    text_add_flash(&line, FLASH_TEXT(">\r\n"));
    if (output->room(output->context) >= line.length) { /* the next one checks as much */
        output->write(output->context, line.bytes, line.length);
    }
}

void telemetry_inputs(telemetry_t *telemetry, const controller_t *controller,
                      const controller_inputs_t *inputs, uint16_t tick, const text_output_t *output)
{
    if (telemetry->format != TELEMETRY_INPUTS) {
        return;
    }
    char line[HIL_FRAME_MAX_LINE];
    hil_frame_sensors_t frame = {.tick = tick, .ambient_c7 = inputs->ambient_c7};
    frame.springs = controller_springs(controller);
    for (uint8_t k = 0; k < frame.springs && k < HIL_FRAME_MAX_SPRINGS; k++) {
        frame.sensor[k].status = inputs->sensor[k].status;
        frame.sensor[k].current_ma = inputs->sensor[k].current_ma;
        frame.sensor[k].voltage_mv = inputs->sensor[k].voltage_mv;
    }
    const uint8_t length = hil_frame_encode_sensors(&frame, line);
    if (length == 0 || output->room(output->context) < length) {
        telemetry_count_dropped(telemetry, 1);
        return;
    }
    output->write(output->context, line, length);
    if (tick % MARK_TICKS == 0) {
        write_mark(controller, tick, output);
    }
}
