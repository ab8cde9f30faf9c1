#include "current_sensor_hil.h"

#ifdef NINESPRING_HIL

#include <string.h>

#include "board.h"
#include "current_sensor.h"
#include "flash_memory.h"
#include "hil_frame.h"

static hil_frame_decoder_t decoder = {.at_line_start = true};
static hil_frame_sensors_t newest;
static bool any;
static uint16_t tick_now;

const char *current_sensor_name(void)
{
    return FLASH_TEXT("hil");
}

void current_sensor_begin(uint8_t averaging)
{
    (void)averaging; /* the host's readings are none: a frame under way goes on */
}

bool current_sensor_hil_receive(uint8_t octet)
{
    const hil_frame_event_t event = hil_frame_decode(&decoder, octet);
    if (event == HIL_FRAME_SENSORS) {
        hil_frame_get_sensors(&decoder, &newest);
        any = true;
    }
    return event != HIL_FRAME_OUTSIDE;
}

void current_sensor_hil_tick(uint16_t tick)
{
    tick_now = tick;
}

void current_sensor_hil_ambient(int16_t *ambient_c7)
{
    if (any) {
        *ambient_c7 = newest.ambient_c7;
    }
}

void current_sensor_read(controller_sensor_t sensor[], uint8_t count)
{
    const bool fresh = any && (uint16_t)(tick_now - newest.tick) <= HIL_FRAME_MAX_LAG_TICKS;
    for (uint8_t k = 0; k < count; k++) {
        if (!fresh || k >= newest.springs ||
            newest.sensor[k].status > (uint8_t)CONTROLLER_SENSOR_RESET) {
            sensor[k].status = CONTROLLER_SENSOR_STALE;
            continue;
        }
        sensor[k].status = newest.sensor[k].status;
        sensor[k].current_ma = newest.sensor[k].current_ma;
        sensor[k].voltage_mv = newest.sensor[k].voltage_mv;
    }
}

void current_sensor_hil_send(uint16_t tick, const controller_outputs_t *outputs)
{
    hil_frame_duties_t duties;
    char line[HIL_FRAME_MAX_LINE];
    duties.tick = tick;
    duties.fan_percent = outputs->fan_percent;
    duties.springs = HIL_FRAME_MAX_SPRINGS;
    memcpy(duties.duty, outputs->duty, sizeof duties.duty);
    const uint8_t length = hil_frame_encode_duties(&duties, line);
    if (board_serial_room() >= length) { /* else dropped: its tick number shows it */
        board_serial_write(line, length);
    }
}

#endif
