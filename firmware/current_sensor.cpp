#include "current_sensor.h"

#ifndef NINESPRING_HIL

#include <avr/pgmspace.h>

#include "ina219.h"
#include "two_wire.h"

#ifdef NINESPRING_SENSOR_ADAFRUIT
#include "arduino_headers.h"

/* The library serves the shunt's reading. It has no way to the conversion-ready bit, to averaging
 * or to a readback of the configuration, so those go through ina219.h on the same bus. */
static Adafruit_INA219 library[CONTROLLER_MAX_SPRINGS] = {
    Adafruit_INA219(0x40), Adafruit_INA219(0x41), Adafruit_INA219(0x42),
    Adafruit_INA219(0x43), Adafruit_INA219(0x44), Adafruit_INA219(0x45),
    Adafruit_INA219(0x46), Adafruit_INA219(0x47), Adafruit_INA219(0x48)};
#endif

/* Register that the sensor's pointer is at; POINTER_UNKNOWN after anything else was read. */
#define POINTER_UNKNOWN 0xFFu
/* Where it is when the sensor's power comes on; no result is read there. */
#define NOT_CONFIGURED 0u
static uint8_t pointer[CONTROLLER_MAX_SPRINGS];
static uint8_t samples;
/* One sensor in turn is looked at more closely: in rounds over all of them. */
static uint8_t checked;
static uint8_t check_register = INA219_CONFIGURATION; /* alternates from round to round */

const char *current_sensor_name(void)
{
#ifdef NINESPRING_SENSOR_ADAFRUIT
    return PSTR("adafruit");
#else
    return PSTR("integer");
#endif
}

static uint8_t address_of(uint8_t spring)
{
    return (uint8_t)(CURRENT_SENSOR_FIRST_ADDRESS + spring);
}

static controller_sensor_status_t configure(uint8_t spring)
{
    pointer[spring] = NOT_CONFIGURED;
#ifdef NINESPRING_SENSOR_ADAFRUIT
    const bool found = library[spring].begin(&Wire); /* goes back to 100 kHz */
    twi_setFrequency(TWO_WIRE_HZ);
    if (!found && !twi_manageTimeoutFlag(true)) {
        return CONTROLLER_SENSOR_ABSENT;
    }
#endif
    const controller_sensor_status_t status = ina219_configure(address_of(spring), samples);
    if (status == CONTROLLER_SENSOR_OK) {
        pointer[spring] = POINTER_UNKNOWN;
    }
    return status;
}

void current_sensor_begin(uint8_t averaging)
{
    samples = averaging;
    two_wire_begin();
    for (uint8_t k = 0; k < CONTROLLER_MAX_SPRINGS; k++) {
        if (configure(k) == CONTROLLER_SENSOR_BUS) {
            two_wire_recover();
            return; /* the rest is tried in the ticks */
        }
    }
}

static controller_sensor_status_t read_register(uint8_t spring, uint8_t reg, uint16_t *raw)
{
    const uint8_t address = address_of(spring);
    controller_sensor_status_t status;
    if (pointer[spring] == reg) {
        status = ina219_read_again(address, raw);
        if (status != CONTROLLER_SENSOR_OK || *raw != INA219_CONFIGURATION_AT_POWER_ON) {
            return status;
        }
        /* a result by chance, or a sensor that has reset itself: not to be mistaken for one */
    }
    status = ina219_read(address, reg, raw);
    pointer[spring] = status == CONTROLLER_SENSOR_OK ? reg : POINTER_UNKNOWN;
    return status;
}

/* Shunt voltage in 10 uV, which in 0.1 ohm is 0.1 mA. */
static controller_sensor_status_t read_shunt(uint8_t spring, int16_t *tenth_ma)
{
#ifdef NINESPRING_SENSOR_ADAFRUIT
    const float shunt_mv = library[spring].getShuntVoltage_mV();
    if (!library[spring].success()) { /* then the number is whatever was on the stack */
        return twi_manageTimeoutFlag(true) ? CONTROLLER_SENSOR_BUS : CONTROLLER_SENSOR_ABSENT;
    }
    pointer[spring] = INA219_SHUNT;
    *tenth_ma = (int16_t)(shunt_mv * 100.0f + (shunt_mv < 0.0f ? -0.5f : 0.5f));
    return CONTROLLER_SENSOR_OK;
#else
    uint16_t raw;
    const controller_sensor_status_t status = read_register(spring, INA219_SHUNT, &raw);
    if (status == CONTROLLER_SENSOR_OK) {
        *tenth_ma = (int16_t)raw;
    }
    return status;
#endif
}

/* First the one that the pointer is at from the last tick. */
static controller_sensor_status_t read_results(uint8_t spring, int16_t *tenth_ma, uint16_t *bus)
{
    controller_sensor_status_t status;
    if (pointer[spring] == INA219_BUS) {
        status = read_register(spring, INA219_BUS, bus);
        return status == CONTROLLER_SENSOR_OK ? read_shunt(spring, tenth_ma) : status;
    }
    status = read_shunt(spring, tenth_ma);
    return status == CONTROLLER_SENSOR_OK ? read_register(spring, INA219_BUS, bus) : status;
}

/* A tenth, rounded: exact for every int16_t, without a division. */
static int16_t tenth(int16_t value)
{
    const uint16_t size = value < 0 ? (uint16_t)(-(int32_t)value) : (uint16_t)value;
    const uint16_t rounded = (uint16_t)(((uint32_t)(size + 5u) * 52429ul) >> 19);
    return value < 0 ? (int16_t)-rounded : (int16_t)rounded;
}

static controller_sensor_status_t read_one(uint8_t spring, controller_sensor_t *sensor)
{
    const uint8_t address = address_of(spring);
    controller_sensor_status_t status;
    uint16_t bus = 0;
    uint16_t power;
    int16_t tenth_ma = 0;

    if (pointer[spring] == NOT_CONFIGURED) {
        status = configure(spring);
        return status == CONTROLLER_SENSOR_OK ? CONTROLLER_SENSOR_STALE : status;
    }
    status = read_results(spring, &tenth_ma, &bus);
    if (status == CONTROLLER_SENSOR_OK && spring == checked) {
        pointer[spring] = POINTER_UNKNOWN;
        status = ina219_read(address, INA219_POWER, &power); /* clears the conversion-ready bit */
        if (status == CONTROLLER_SENSOR_OK) {
            status = ina219_check(address, samples, check_register);
        }
    }
    if (status != CONTROLLER_SENSOR_OK) {
        pointer[spring] = status == CONTROLLER_SENSOR_ABSENT ? NOT_CONFIGURED : POINTER_UNKNOWN;
        return status;
    }
    if (!(bus & INA219_BUS_READY)) {
        return CONTROLLER_SENSOR_STALE;
    }
    sensor->current_ma = tenth(tenth_ma);
    sensor->voltage_mv = (int16_t)((bus >> 3) << 2);
    return CONTROLLER_SENSOR_OK;
}

void current_sensor_read(controller_sensor_t sensor[], uint8_t count)
{
    bool stuck = false;
    for (uint8_t k = 0; k < count; k++) {
        sensor[k].status = (uint8_t)(stuck ? CONTROLLER_SENSOR_BUS : read_one(k, &sensor[k]));
        if (sensor[k].status == CONTROLLER_SENSOR_RESET) {
            configure(k);
        } else if (sensor[k].status == CONTROLLER_SENSOR_BUS && !stuck) {
            stuck = true;
            two_wire_recover();
        }
    }
    if (++checked >= count) {
        checked = 0;
        check_register =
            check_register == INA219_CONFIGURATION ? INA219_CALIBRATION : INA219_CONFIGURATION;
    }
}

#endif /* NINESPRING_HIL */
