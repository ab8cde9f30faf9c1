/* sources: lib/hil_frame/hil_frame.c lib/crc16/crc16.c
 * options: -eva-split-return-function hil_frame_decode:full */
#include "hil_frame.h"

#include "prove.h"

static void decode(void)
{
    hil_frame_decoder_t decoder;
    hil_frame_sensors_t sensors;
    hil_frame_duties_t duties;
    memset(&decoder, 0, sizeof decoder);
    hil_frame_decoder_init(&decoder);
    for (;;) {
        const hil_frame_event_t event = hil_frame_decode(&decoder, any_u8());
        if (event == HIL_FRAME_SENSORS) {
            hil_frame_get_sensors(&decoder, &sensors);
        } else if (event == HIL_FRAME_DUTIES) {
            hil_frame_get_duties(&decoder, &duties);
        }
        if (any_bool()) {
            return;
        }
    }
}

static void encode(void)
{
    char line[HIL_FRAME_MAX_LINE];
    hil_frame_sensors_t sensors = {any_u16(), any_s16(), any_u8(), {{0}}};
    hil_frame_duties_t duties = {any_u16(), any_u8(), any_u8(), {0}};
    for (uint8_t k = 0; k < HIL_FRAME_MAX_SPRINGS; k++) {
        sensors.sensor[k].status = any_u8();
        sensors.sensor[k].current_ma = any_s16();
        sensors.sensor[k].voltage_mv = any_s16();
        duties.duty[k] = any_u16();
    }
    (void)hil_frame_encode_sensors(&sensors, line);
    (void)hil_frame_encode_duties(&duties, line);
}

void main(void)
{
    decode();
    encode();
}
