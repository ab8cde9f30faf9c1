#include <string.h>

#include "../run_tests.h"
#include "crc16.h"
#include "hil_frame.h"

static hil_frame_decoder_t decoder;
static hil_frame_sensors_t sent; /* and as a line: */
static char line[HIL_FRAME_MAX_LINE];
static uint8_t length;

void setUp(void)
{
    static int was = 0; /* what was in memory must not matter */
    memset(&decoder, was, sizeof decoder);
    was = 1 - was;
    hil_frame_decoder_init(&decoder);
    memset(&sent, 0, sizeof sent);
    sent.tick = 0xBEEF;
    sent.ambient_c7 = -640;
    sent.springs = 9;
    for (uint8_t k = 0; k < 9; k++) {
        sent.sensor[k].status = (uint8_t)(k % 5);
        sent.sensor[k].current_ma = (int16_t)(1500 - 333 * k);
        sent.sensor[k].voltage_mv = (int16_t)(-7 + 40 * k);
    }
    length = hil_frame_encode_sensors(&sent, line);
}

static hil_frame_event_t feed(const char *bytes, uint8_t count)
{
    hil_frame_event_t event = HIL_FRAME_OUTSIDE;
    for (uint8_t i = 0; i < count; i++) {
        event = hil_frame_decode(&decoder, (uint8_t)bytes[i]);
    }
    return event;
}

TEST(checksum_is_the_published_one)
{
    TEST_ASSERT_EQUAL_HEX16(0x29B1, crc16_add_bytes(CRC16_START, "123456789", 9));
}

TEST(sensors_survive_the_line)
{
    TEST_ASSERT_EQUAL_UINT8(HIL_FRAME_MAX_LINE, length);
    TEST_ASSERT_EQUAL(HIL_FRAME_SENSORS, feed(line, length));
    hil_frame_sensors_t got;
    memset(&got, 0, sizeof got);
    hil_frame_get_sensors(&decoder, &got);
    TEST_ASSERT_EQUAL_MEMORY(&sent, &got, sizeof sent);
}

TEST(duties_survive_the_line)
{
    for (uint8_t springs = 1; springs <= 9; springs++) {
        hil_frame_duties_t duties = {.tick = 513, .fan_percent = 100, .springs = springs};
        for (uint8_t k = 0; k < springs; k++) {
            duties.duty[k] = (uint16_t)(800 - k);
        }
        length = hil_frame_encode_duties(&duties, line);
        TEST_ASSERT_EQUAL(HIL_FRAME_DUTIES, feed(line, length));
        hil_frame_duties_t got;
        memset(&got, 0, sizeof got);
        hil_frame_get_duties(&decoder, &got);
        TEST_ASSERT_EQUAL_MEMORY(&duties, &got, sizeof duties);
    }
}

/* Written by hand from the description, so that another program can be held to it. */
TEST(frame_is_as_described)
{
    hil_frame_duties_t duties = {
        .tick = 0x0102, .fan_percent = 0x32, .springs = 1, .duty = {0x0320}};
    length = hil_frame_encode_duties(&duties, line);
    TEST_ASSERT_EQUAL_UINT8(17, length);
    TEST_ASSERT_EQUAL_MEMORY("~D0102320320", line, 12);
    TEST_ASSERT_EQUAL('\n', line[16]);
}

TEST(every_flipped_bit_is_detected)
{
    for (uint16_t bit = 0; bit < 8u * length; bit++) {
        char broken[HIL_FRAME_MAX_LINE + 1];
        memcpy(broken, line, length);
        broken[bit / 8u] = (char)(broken[bit / 8u] ^ (1 << (bit % 8u)));
        broken[length] = '\n'; /* whatever happened, the next line end closes it */
        setUp();
        for (uint8_t i = 0; i <= length; i++) {
            const hil_frame_event_t event = hil_frame_decode(&decoder, (uint8_t)broken[i]);
            TEST_ASSERT_NOT_EQUAL(HIL_FRAME_SENSORS, event);
            TEST_ASSERT_NOT_EQUAL(HIL_FRAME_DUTIES, event);
        }
        /* and the next good frame is understood */
        TEST_ASSERT_EQUAL(HIL_FRAME_SENSORS, feed(line, length));
    }
}

TEST(every_cut_is_detected)
{
    for (uint8_t cut = 1; cut < length - 1; cut++) {
        setUp();
        TEST_ASSERT_EQUAL(HIL_FRAME_PART, feed(line, cut));
        TEST_ASSERT_EQUAL(HIL_FRAME_BAD, hil_frame_decode(&decoder, '\n'));
        TEST_ASSERT_EQUAL(HIL_FRAME_SENSORS, feed(line, length));
    }
}

TEST(endless_frame_is_dropped_and_does_not_overflow)
{
    hil_frame_decode(&decoder, '~');
    hil_frame_decode(&decoder, 'S');
    for (uint16_t i = 0; i < 1000; i++) {
        TEST_ASSERT_EQUAL(HIL_FRAME_PART, hil_frame_decode(&decoder, 'A'));
    }
    /* they lie behind the payload */
    TEST_ASSERT_EQUAL_UINT8(2u * HIL_FRAME_MAX_PAYLOAD, decoder.digits);
    TEST_ASSERT_EQUAL(HIL_FRAME_BAD, hil_frame_decode(&decoder, '\n'));
}

TEST(console_lines_pass_by)
{
    TEST_ASSERT_EQUAL(HIL_FRAME_OUTSIDE, feed("on 1 ~S 1\r\n", 11));
    TEST_ASSERT_EQUAL(HIL_FRAME_OUTSIDE, feed("\r\nS00\n", 6));
    TEST_ASSERT_EQUAL(HIL_FRAME_BAD, feed("~X00\n", 5));
}

TEST(wrong_number_of_springs_is_refused)
{
    for (uint8_t springs = 0; springs <= 10; springs = (uint8_t)(springs + 10u)) {
        const hil_frame_duties_t duties = {.springs = springs};
        sent.springs = springs;
        TEST_ASSERT_EQUAL_UINT8(0, hil_frame_encode_sensors(&sent, line));
        TEST_ASSERT_EQUAL_UINT8(0, hil_frame_encode_duties(&duties, line));
    }
}
