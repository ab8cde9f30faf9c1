#include "hil_frame.h"

#include "crc16.h"

#define HEAD_SENSORS 4u /* tick, ambient */
#define EACH_SENSOR  5u
#define HEAD_DUTIES  3u /* tick, fan */
#define EACH_DUTY    2u
#define CRC_BYTES    2u

typedef struct {
    char *line;
    uint8_t length;
    uint16_t crc;
} writer_t;

static char hex_digit(uint8_t value)
{
    return (char)(value < 10 ? '0' + value : 'A' + value - 10);
}

static void write_byte(writer_t *writer, uint8_t byte)
{
    writer->line[writer->length++] = hex_digit((uint8_t)(byte >> 4));
    writer->line[writer->length++] = hex_digit((uint8_t)(byte & 0x0Fu));
    writer->crc = crc16_add(writer->crc, byte);
}

static void write_word(writer_t *writer, uint16_t word)
{
    write_byte(writer, (uint8_t)(word >> 8));
    write_byte(writer, (uint8_t)(word & 0xFFu));
}

static void write_head(writer_t *writer, char *line, char kind)
{
    writer->line = line;
    writer->line[0] = '~';
    writer->line[1] = kind;
    writer->length = 2;
    writer->crc = crc16_add(CRC16_START, (uint8_t)kind);
}

static uint8_t write_end(writer_t *writer)
{
    write_word(writer, writer->crc);
    writer->line[writer->length++] = '\n';
    return writer->length;
}

uint8_t hil_frame_encode_sensors(const hil_frame_sensors_t *sensors, char *line)
{
    if (sensors->springs == 0 || sensors->springs > HIL_FRAME_MAX_SPRINGS) {
        return 0;
    }
    writer_t writer;
    write_head(&writer, line, 'S');
    write_word(&writer, sensors->tick);
    write_word(&writer, (uint16_t)sensors->ambient_c7);
    for (uint8_t k = 0; k < sensors->springs; k++) {
        write_byte(&writer, sensors->sensor[k].status);
        write_word(&writer, (uint16_t)sensors->sensor[k].current_ma);
        write_word(&writer, (uint16_t)sensors->sensor[k].voltage_mv);
    }
    return write_end(&writer);
}

uint8_t hil_frame_encode_duties(const hil_frame_duties_t *duties, char *line)
{
    if (duties->springs == 0 || duties->springs > HIL_FRAME_MAX_SPRINGS) {
        return 0;
    }
    writer_t writer;
    write_head(&writer, line, 'D');
    write_word(&writer, duties->tick);
    write_byte(&writer, duties->fan_percent);
    for (uint8_t k = 0; k < duties->springs; k++) {
        write_word(&writer, duties->duty[k]);
    }
    return write_end(&writer);
}

void hil_frame_decoder_init(hil_frame_decoder_t *decoder)
{
    decoder->digits = 0;
    decoder->kind = 0;
    decoder->inside = false;
    decoder->broken = false;
    decoder->at_line_start = true;
}

/* 0..15, or -1 where the byte is no digit that the encoder writes. */
static int8_t digit_value(uint8_t byte)
{
    if (byte >= '0' && byte <= '9') {
        return (int8_t)(byte - '0');
    }
    if (byte >= 'A' && byte <= 'F') {
        return (int8_t)(byte - 'A' + 10);
    }
    return -1;
}

static uint16_t word_at(const hil_frame_decoder_t *decoder, uint8_t index)
{
    return (uint16_t)((uint16_t)((uint16_t)decoder->payload[index] << 8) |
                      decoder->payload[index + 1u]);
}

/* Springs in the payload; 0 where its length fits no whole number of springs from 1 to 9. */
static uint8_t spring_count(const hil_frame_decoder_t *decoder)
{
    const uint8_t head = decoder->kind == 'S' ? HEAD_SENSORS : HEAD_DUTIES;
    const uint8_t each = decoder->kind == 'S' ? EACH_SENSOR : EACH_DUTY;
    uint8_t length = (uint8_t)(head + CRC_BYTES);
    for (uint8_t springs = 1; springs <= HIL_FRAME_MAX_SPRINGS; springs++) {
        length = (uint8_t)(length + each);
        if (decoder->digits == 2u * length) {
            return springs;
        }
    }
    return 0;
}

static hil_frame_event_t finish(const hil_frame_decoder_t *decoder)
{
    if (decoder->broken || decoder->kind == 0 || spring_count(decoder) == 0) {
        return HIL_FRAME_BAD;
    }
    const uint8_t crc_at = (uint8_t)(decoder->digits / 2u - CRC_BYTES);
    uint16_t crc = crc16_add(CRC16_START, (uint8_t)decoder->kind);
    crc = crc16_add_bytes(crc, decoder->payload, crc_at);
    if (crc != word_at(decoder, crc_at)) {
        return HIL_FRAME_BAD;
    }
    return decoder->kind == 'S' ? HIL_FRAME_SENSORS : HIL_FRAME_DUTIES;
}

hil_frame_event_t hil_frame_decode(hil_frame_decoder_t *decoder, uint8_t byte)
{
    if (!decoder->inside) {
        if (byte == '~' && decoder->at_line_start) {
            decoder->inside = true;
            decoder->broken = false;
            decoder->digits = 0;
            decoder->kind = 0;
            return HIL_FRAME_PART;
        }
        decoder->at_line_start = byte == '\n' || (decoder->at_line_start && byte == '\r');
        return HIL_FRAME_OUTSIDE;
    }
    if (byte == '\r') {
        return HIL_FRAME_PART;
    }
    if (byte == '\n') {
        decoder->inside = false;
        decoder->at_line_start = true;
        return finish(decoder);
    }
    if (decoder->kind == 0 && !decoder->broken) {
        if (byte == 'S' || byte == 'D') {
            decoder->kind = (char)byte;
        } else {
            decoder->broken = true;
        }
        return HIL_FRAME_PART;
    }
    const int8_t value = digit_value(byte);
    if (value < 0 || decoder->digits >= 2u * HIL_FRAME_MAX_PAYLOAD) {
        decoder->broken = true;
        return HIL_FRAME_PART;
    }
    uint8_t *const target = &decoder->payload[decoder->digits >> 1];
    const unsigned digit = (unsigned)value;
    *target = (uint8_t)((decoder->digits & 1u) != 0 ? *target | digit : digit << 4);
    decoder->digits++;
    return HIL_FRAME_PART;
}

void hil_frame_get_sensors(const hil_frame_decoder_t *decoder, hil_frame_sensors_t *sensors)
{
    sensors->tick = word_at(decoder, 0);
    sensors->ambient_c7 = (int16_t)word_at(decoder, 2);
    sensors->springs = spring_count(decoder);
    uint8_t at = HEAD_SENSORS;
    for (uint8_t k = 0; k < sensors->springs; k++) {
        sensors->sensor[k].status = decoder->payload[at];
        sensors->sensor[k].current_ma = (int16_t)word_at(decoder, (uint8_t)(at + 1u));
        sensors->sensor[k].voltage_mv = (int16_t)word_at(decoder, (uint8_t)(at + 3u));
        at = (uint8_t)(at + EACH_SENSOR);
    }
}

void hil_frame_get_duties(const hil_frame_decoder_t *decoder, hil_frame_duties_t *duties)
{
    duties->tick = word_at(decoder, 0);
    duties->fan_percent = decoder->payload[2];
    duties->springs = spring_count(decoder);
    uint8_t at = HEAD_DUTIES;
    for (uint8_t k = 0; k < duties->springs; k++) {
        duties->duty[k] = word_at(decoder, at);
        at = (uint8_t)(at + EACH_DUTY);
    }
}
