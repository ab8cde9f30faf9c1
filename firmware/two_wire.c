#include "two_wire.h"

#include <avr/io.h>
#include <stdbool.h>
#include <util/delay.h>

#define SCL_PIN _BV(0) /* of port D */
#define SDA_PIN _BV(1)

#ifdef NINESPRING_SENSOR_ADAFRUIT

/* That library uses Wire, which has the unit and its interrupt to itself. */
#include "arduino_headers.h"

void two_wire_begin(void)
{
    twi_init();
    twi_setFrequency(TWO_WIRE_HZ); /* after every twi_init: it goes back to 100 kHz */
    twi_setTimeoutInMicros(TWO_WIRE_TIMEOUT_US, true);
}

static void release_pins(void)
{
    twi_disable();
}

controller_sensor_status_t two_wire_transfer(uint8_t address, two_wire_direction_t direction,
                                             uint8_t bytes[], uint8_t length)
{
    uint8_t error;
    if (direction == TWO_WIRE_READ) {
        error = twi_readFrom(address, bytes, length, true) == length ? 0 : 2;
    } else {
        error = twi_writeTo(address, bytes, length, true, true);
    }
    if (error == 0) {
        return CONTROLLER_SENSOR_OK;
    }
    const bool timed_out = twi_manageTimeoutFlag(true);
    /* 2 and 3: address or data not acknowledged; else lost arbitration, bus error, timeout */
    return !timed_out && (error == 2 || error == 3) ? CONTROLLER_SENSOR_ABSENT
                                                    : CONTROLLER_SENSOR_BUS;
}

#else

#include <util/twi.h>

/* A turn of the loops that wait takes 8 cycles or more. */
#define TIMEOUT_TURNS (TWO_WIRE_STEP_US * (F_CPU / 1000000ul) / 8u)

void two_wire_begin(void)
{
    PORTD |= SCL_PIN | SDA_PIN; /* pull-ups */
}

static void release_pins(void)
{
    TWCR = 0;
}

/* The unit's next step; its status, TW_NO_INFO if it takes too long. */
static uint8_t step(uint8_t control)
{
    TWCR = (uint8_t)(_BV(TWINT) | _BV(TWEN) | control);
    for (uint16_t left = TIMEOUT_TURNS; left != 0; left--) {
        if ((TWCR & _BV(TWINT)) != 0) {
            return TW_STATUS;
        }
    }
    return TW_NO_INFO;
}

static bool stop(void)
{
    TWCR = _BV(TWINT) | _BV(TWEN) | _BV(TWSTO);
    for (uint16_t left = TIMEOUT_TURNS; left != 0; left--) {
        if ((TWCR & _BV(TWSTO)) == 0) {
            return true;
        }
    }
    return false;
}

/* The unit's status says what comes next: a byte out, a byte in, or the end. */
controller_sensor_status_t two_wire_transfer(uint8_t address, two_wire_direction_t direction,
                                             uint8_t bytes[], uint8_t length)
{
    TWSR = 0; /* each time: a lost bit would slow all reads and nothing would fail */
    TWBR = (uint8_t)((F_CPU / TWO_WIRE_HZ - 16u) / 2u);
    uint8_t status = step(_BV(TWSTA));
    if (status == TW_START) {
        TWDR = (uint8_t)(address << 1 | (uint8_t)direction);
        status = step(0);
    }
    for (; length > 0; length--, bytes++) {
        if (status == TW_MT_SLA_ACK || status == TW_MT_DATA_ACK) {
            TWDR = *bytes;
            status = step(0);
        } else if (status == TW_MR_SLA_ACK || status == TW_MR_DATA_ACK) {
            status = step(length > 1 ? _BV(TWEA) : 0u); /* the last one is not acknowledged */
            *bytes = TWDR;
        } else {
            break;
        }
    }
    if (status == TW_NO_INFO || !stop()) {
        return CONTROLLER_SENSOR_BUS;
    }
    switch (status) {
    case TW_MT_DATA_ACK:
    case TW_MR_DATA_NACK:
        return CONTROLLER_SENSOR_OK;
    case TW_MT_SLA_NACK:
    case TW_MT_DATA_NACK:
    case TW_MR_SLA_NACK:
        return CONTROLLER_SENSOR_ABSENT;
    default: /* timeout, lost arbitration, bus error */
        return CONTROLLER_SENSOR_BUS;
    }
}

#endif

void two_wire_recover(void)
{
    release_pins();
    DDRD &= (uint8_t) ~(SCL_PIN | SDA_PIN);
    PORTD |= SCL_PIN | SDA_PIN;
    for (uint8_t pulse = 0; pulse < 9u; pulse++) { /* eight bits and the acknowledge at most */
        PORTD &= (uint8_t)~SCL_PIN;
        DDRD |= SCL_PIN;
        _delay_us(5);
        DDRD &= (uint8_t)~SCL_PIN;
        PORTD |= SCL_PIN;
        _delay_us(5);
    }
    two_wire_begin();
}
