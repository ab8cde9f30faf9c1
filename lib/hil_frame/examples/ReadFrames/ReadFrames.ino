// Takes frames of simulated sensors out of what comes from the serial port, and answers each with
// duties of its tick. Everything that is no frame is echoed. Try it by pasting
// ~S00010A000103E800C8 and a line end: its checksum is missing, so it is called broken.
#include <hil_frame.h>

static hil_frame_decoder_t decoder;

void setup()
{
    Serial.begin(115200);
    hil_frame_decoder_init(&decoder);
}

void loop()
{
    if (Serial.available() == 0) {
        return;
    }
    const uint8_t byte = (uint8_t)Serial.read();
    switch (hil_frame_decode(&decoder, byte)) {
    case HIL_FRAME_OUTSIDE:
        Serial.write(byte);
        break;
    case HIL_FRAME_SENSORS: {
        hil_frame_sensors_t sensors;
        hil_frame_get_sensors(&decoder, &sensors);
        hil_frame_duties_t duties = {};
        duties.tick = sensors.tick;
        duties.springs = sensors.springs;
        for (uint8_t k = 0; k < sensors.springs; k++) {
            duties.duty[k] = sensors.sensor[k].current_ma < 1000 ? 200 : 100;
        }
        char line[HIL_FRAME_MAX_LINE];
        Serial.write((const uint8_t *)line, hil_frame_encode_duties(&duties, line));
        break;
    }
    case HIL_FRAME_BAD:
        Serial.println(F("a broken frame"));
        break;
    default:
        break;
    }
}
