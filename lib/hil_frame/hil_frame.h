/* What it is for: hardware in the loop: sensor readings to a real board, its duties back, as lines
 * of text.
 * What it owns: the format of those lines and the decoder that finds them between console lines.
 * What it never does: keep time or decide what a late frame means: the board and the host do. */
#ifndef HIL_FRAME_H
#define HIL_FRAME_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A frame is one line, in hexadecimal so that it can never hold '!' or '?', which act from the
 * receive interrupt, nor be taken for a console line:
 *
 *   ~S <tick:4> <ambient:4> n x (<status:2> <current:4> <voltage:4>) <crc:4> \n    host to board
 *   ~D <tick:4> <fan:2> n x <duty:4> <crc:4> \n                                   board to host
 *
 * (without the blanks; digits 0-9 A-F, highest first; signed numbers in two's complement; n <= 9).
 * crc is CRC-16/CCITT-FALSE over the letter and the bytes between it and the crc.
 *
 * Timing. After each control tick the board sends D with the tick's number. The host advances its
 * plant to that tick and answers S with the same number. A tick uses the newest S; S of the tick
 * before is the normal case, and S older than HIL_FRAME_MAX_LAG_TICKS is not used: the sensors then
 * count as stale. */
#define HIL_FRAME_MAX_SPRINGS   9
#define HIL_FRAME_MAX_LAG_TICKS 3 /* 60 ms at 50 Hz */
#define HIL_FRAME_MAX_PAYLOAD   (2 + 2 + HIL_FRAME_MAX_SPRINGS * 5 + 2)
#define HIL_FRAME_MAX_LINE      (2 + 2 * HIL_FRAME_MAX_PAYLOAD + 1)

typedef struct {
    uint16_t tick;      /* number of the control tick whose duties the plant has seen */
    int16_t ambient_c7; /* degC in Q9.7 */
    uint8_t springs;    /* 1..9 */
    struct {
        uint8_t status; /* controller_sensor_status_t */
        int16_t current_ma;
        int16_t voltage_mv;
    } sensor[HIL_FRAME_MAX_SPRINGS];
} hil_frame_sensors_t;

typedef struct {
    uint16_t tick;
    uint8_t fan_percent;
    uint8_t springs;                      /* 1..9 */
    uint16_t duty[HIL_FRAME_MAX_SPRINGS]; /* steps of the PWM, 0..800 */
} hil_frame_duties_t;

/* Writes one line, with '\n', without a terminating zero. Returns its length; 0 if and only if
 * springs is not 1..HIL_FRAME_MAX_SPRINGS. line holds HIL_FRAME_MAX_LINE bytes. */
uint8_t hil_frame_encode_sensors(const hil_frame_sensors_t *sensors, char *line);
uint8_t hil_frame_encode_duties(const hil_frame_duties_t *duties, char *line);

typedef enum {
    HIL_FRAME_OUTSIDE = 0, /* the byte belongs to no frame: pass it to the console */
    HIL_FRAME_PART,        /* taken; the frame is not complete */
    HIL_FRAME_SENSORS,     /* taken; hil_frame_get_sensors gives a new frame */
    HIL_FRAME_DUTIES,      /* taken; hil_frame_get_duties gives a new frame */
    HIL_FRAME_BAD /* taken; the line was broken (digit, length or checksum) and is dropped whole */
} hil_frame_event_t;

typedef struct {
    uint8_t payload[HIL_FRAME_MAX_PAYLOAD];
    uint8_t digits; /* hexadecimal digits received */
    char kind;      /* 'S', 'D'; 0 before it is known */
    bool inside;
    bool broken;
    bool at_line_start;
} hil_frame_decoder_t;

void hil_frame_decoder_init(hil_frame_decoder_t *decoder);

/* Takes one received byte. A frame starts with '~' at the start of a line and ends with '\n'; '\r'
 * is skipped. */
hil_frame_event_t hil_frame_decode(hil_frame_decoder_t *decoder, uint8_t byte);

/* Valid right after hil_frame_decode returned the matching event. */
void hil_frame_get_sensors(const hil_frame_decoder_t *decoder, hil_frame_sensors_t *sensors);
void hil_frame_get_duties(const hil_frame_decoder_t *decoder, hil_frame_duties_t *duties);

#ifdef __cplusplus
}
#endif
#endif
