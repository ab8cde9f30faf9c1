#include "ina219.h"

#include "arduino_headers.h"

void ina219_bus_begin(void)
{
    twi_init();
    twi_setFrequency(INA219_FAST_HZ); /* after every twi_init: it goes back to 100 kHz */
    twi_setTimeoutInMicros(INA219_TIMEOUT_US, true);
}

void ina219_bus_recover(void)
{
    twi_disable();
    pinMode(SCL, INPUT_PULLUP);
    pinMode(SDA, INPUT_PULLUP);
    for (uint8_t pulse = 0; pulse < 9u;
         pulse++) { /* at most eight bits and the acknowledge are left */
        digitalWrite(SCL, LOW);
        pinMode(SCL, OUTPUT);
        delayMicroseconds(5);
        pinMode(SCL, INPUT_PULLUP);
        delayMicroseconds(5);
    }
    ina219_bus_begin();
}

bool ina219_timed_out(void)
{
    return twi_manageTimeoutFlag(true);
}

/* What twi_writeTo's answer means. */
static controller_sensor_status_t write_bytes(uint8_t address, uint8_t *bytes, uint8_t length)
{
    switch (twi_writeTo(address, bytes, length, true, true)) {
    case 0:
        return CONTROLLER_SENSOR_OK;
    case 2: /* address not acknowledged */
    case 3: /* data not acknowledged */
        return CONTROLLER_SENSOR_ABSENT;
    default: /* lost arbitration, bus error, timeout */
        (void)ina219_timed_out();
        return CONTROLLER_SENSOR_BUS;
    }
}

controller_sensor_status_t ina219_write(uint8_t address, uint8_t reg, uint16_t value)
{
    uint8_t bytes[3] = {reg, (uint8_t)(value >> 8), (uint8_t)(value & 0xFFu)};
    return write_bytes(address, bytes, sizeof bytes);
}

controller_sensor_status_t ina219_read_again(uint8_t address, uint16_t *value)
{
    uint8_t bytes[2];
    if (twi_readFrom(address, bytes, sizeof bytes, true) != sizeof bytes) {
        return ina219_timed_out() ? CONTROLLER_SENSOR_BUS : CONTROLLER_SENSOR_ABSENT;
    }
    *value = (uint16_t)((uint16_t)(bytes[0] << 8) | bytes[1]);
    return CONTROLLER_SENSOR_OK;
}

controller_sensor_status_t ina219_read(uint8_t address, uint8_t reg, uint16_t *value)
{
    const controller_sensor_status_t status = write_bytes(address, &reg, 1);
    return status == CONTROLLER_SENSOR_OK ? ina219_read_again(address, value) : status;
}

uint16_t ina219_configuration(uint8_t averaging)
{
    return averaging == 8u ? 0x1DDFu  /* BADC = SADC = 1011: 8 samples, 4.26 ms each */
                           : 0x1E67u; /* 1100: 16 samples, 8.51 ms each */
}

controller_sensor_status_t ina219_configure(uint8_t address, uint8_t averaging)
{
    const controller_sensor_status_t status =
        ina219_write(address, INA219_CALIBRATION, INA219_CALIBRATION_100UA);
    if (status != CONTROLLER_SENSOR_OK) {
        return status;
    }
    return ina219_write(address, INA219_CONFIGURATION, ina219_configuration(averaging));
}

controller_sensor_status_t ina219_check(uint8_t address, uint8_t averaging, uint8_t reg)
{
    uint16_t value;
    const controller_sensor_status_t status = ina219_read(address, reg, &value);
    if (status != CONTROLLER_SENSOR_OK) {
        return status;
    }
    return value == (reg == INA219_CALIBRATION ? INA219_CALIBRATION_100UA
                                               : ina219_configuration(averaging))
               ? CONTROLLER_SENSOR_OK
               : CONTROLLER_SENSOR_RESET;
}
