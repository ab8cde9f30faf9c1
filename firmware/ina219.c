#include "ina219.h"

#include "two_wire.h"

controller_sensor_status_t ina219_write(uint8_t address, uint8_t reg, uint16_t value)
{
    uint8_t bytes[3] = {reg, (uint8_t)(value >> 8), (uint8_t)(value & 0xFFu)};
    return two_wire_transfer(address, TWO_WIRE_WRITE, bytes, sizeof bytes);
}

controller_sensor_status_t ina219_read_again(uint8_t address, uint16_t *value)
{
    uint8_t bytes[2] = {0, 0};
    const controller_sensor_status_t status =
        two_wire_transfer(address, TWO_WIRE_READ, bytes, sizeof bytes);
    *value = (uint16_t)((uint16_t)((uint16_t)bytes[0] << 8) | bytes[1]);
    return status;
}

controller_sensor_status_t ina219_read(uint8_t address, uint8_t reg, uint16_t *value)
{
    const controller_sensor_status_t status = two_wire_transfer(address, TWO_WIRE_WRITE, &reg, 1);
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
