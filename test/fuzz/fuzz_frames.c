/* Frames of hardware in the loop among any bytes: the same bytes decode to the same whatever they
 * are cut into, what is decoded encodes to the same line, and no byte of it stops a board. */
#include "fuzz.h"

#include "hil_frame.h"

static void hold_line(const char *line, uint8_t length, hil_frame_event_t event)
{
    hil_frame_decoder_t decoder;
    HOLDS(length > 0 && length <= HIL_FRAME_MAX_LINE && line[length - 1u] == '\n');
    hil_frame_decoder_init(&decoder);
    for (uint8_t n = 0; n + 1u < length; n++) {
        HOLDS(line[n] != '!' && line[n] != '?');
        HOLDS(hil_frame_decode(&decoder, (uint8_t)line[n]) == HIL_FRAME_PART);
    }
    HOLDS(hil_frame_decode(&decoder, '\n') == event);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    hil_frame_decoder_t decoder;
    char line[HIL_FRAME_MAX_LINE];
    hil_frame_decoder_init(&decoder);
    for (size_t n = 0; n < size; n++) {
        const hil_frame_event_t event = hil_frame_decode(&decoder, bytes[n]);
        if (event == HIL_FRAME_SENSORS) {
            hil_frame_sensors_t sensors;
            hil_frame_get_sensors(&decoder, &sensors);
            HOLDS(sensors.springs >= 1 && sensors.springs <= HIL_FRAME_MAX_SPRINGS);
            hold_line(line, hil_frame_encode_sensors(&sensors, line), event);
        } else if (event == HIL_FRAME_DUTIES) {
            hil_frame_duties_t duties;
            hil_frame_get_duties(&decoder, &duties);
            HOLDS(duties.springs >= 1 && duties.springs <= HIL_FRAME_MAX_SPRINGS);
            hold_line(line, hil_frame_encode_duties(&duties, line), event);
        }
    }
    /* a frame of anything, whole: by chance none has its checksum */
    fuzz_t fuzz = {bytes, size};
    hil_frame_sensors_t sensors = {.tick = fuzz_word(&fuzz),
                                   .ambient_c7 = (int16_t)fuzz_word(&fuzz),
                                   .springs = fuzz_byte(&fuzz) % 12u};
    for (uint8_t k = 0; k < HIL_FRAME_MAX_SPRINGS; k++) {
        sensors.sensor[k].status = fuzz_byte(&fuzz);
        sensors.sensor[k].current_ma = (int16_t)fuzz_word(&fuzz);
        sensors.sensor[k].voltage_mv = (int16_t)fuzz_word(&fuzz);
    }
    const uint8_t length = hil_frame_encode_sensors(&sensors, line);
    HOLDS((length == 0) == (sensors.springs < 1 || sensors.springs > HIL_FRAME_MAX_SPRINGS));
    if (length > 0) {
        hold_line(line, length, HIL_FRAME_SENSORS);
    }
    return 0;
}
