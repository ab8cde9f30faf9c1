/* What it is for: the INA219's registers, for both drivers.
 * What it owns: the rules that tell a stale, a reset, an absent sensor and a stuck bus apart.
 * What it never does: use floating point. */
#ifndef INA219_H
#define INA219_H

#include <stdint.h>

#include "controller.h"

/* Registers and bits: Texas Instruments SBOS448, "INA219", tables 2 to 7. */
#define INA219_CONFIGURATION 0x00u
#define INA219_SHUNT         0x01u
#define INA219_BUS           0x02u
#define INA219_POWER         0x03u
#define INA219_CALIBRATION   0x05u

#define INA219_CONFIGURATION_AT_POWER_ON 0x399Fu
#define INA219_CALIBRATION_100UA         4096u   /* 0.04096 / (100 uA x 0.1 ohm) */
#define INA219_BUS_READY                 0x0002u /* CNVR */

#ifdef __cplusplus
extern "C" {
#endif

controller_sensor_status_t ina219_read(uint8_t address, uint8_t reg, uint16_t *value);
/* Reads the register that was read last: half the bytes. A sensor that has reset itself meanwhile
 * gives its configuration, INA219_CONFIGURATION_AT_POWER_ON, instead. */
controller_sensor_status_t ina219_read_again(uint8_t address, uint16_t *value);
controller_sensor_status_t ina219_write(uint8_t address, uint8_t reg, uint16_t value);
/* 16 V range, gain /8 (320 mV = 3.2 A), averaging of 8 (any other value: 16), continuous. */
uint16_t ina219_configuration(uint8_t averaging);
/* Calibration, then configuration, which also starts a new conversion. */
controller_sensor_status_t ina219_configure(uint8_t address, uint8_t averaging);
/* OK, or RESET where reg, INA219_CALIBRATION or INA219_CONFIGURATION, is not what ina219_configure
 * wrote. */
controller_sensor_status_t ina219_check(uint8_t address, uint8_t averaging, uint8_t reg);

#ifdef __cplusplus
}
#endif
#endif
