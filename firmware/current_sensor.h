/* What it is for: mean current and spring voltage of the nine springs, from one INA219 each.
 * What it owns: the sensors' configuration, and the I2C bus.
 * What it never does: turn a failed read into a number, or wait longer than one timed-out transfer
 * a tick. */
#ifndef CURRENT_SENSOR_H
#define CURRENT_SENSOR_H

#include <stdint.h>

#include "controller.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The formulas below hold for a shunt of 0.1 ohm. */
#define CURRENT_SENSOR_FIRST_ADDRESS 0x40u /* spring 1; spring 9 is 0x48 */

/* Which driver this firmware was built with: "adafruit", "integer" or "hil", as a text in flash. */
const char *current_sensor_name(void);

/* Starts the bus and configures every sensor that answers: 16 V, gain /8, `averaging` samples (8 or
 * 16) of current and of voltage, continuous. Sensors that do not answer are tried again in each
 * read. */
void current_sensor_begin(uint8_t averaging);

/* Once per tick. sensor[k] becomes, for spring k:
 *   OK      current_ma (shunt, 10 uV in 0.1 ohm = 0.1 mA, rounded) and voltage_mv (4 mV steps)
 *   ABSENT  its address was not acknowledged
 *   BUS     the bus is stuck or a transfer timed out; the sensors after it are not tried in this
 *           tick
 *   STALE   it has finished no conversion since its conversion-ready bit was last cleared
 *   RESET   it had lost its configuration; it has been configured again
 * In each tick one sensor in turn has its conversion-ready bit cleared and one register read back:
 * a sensor that converts no more gives its last result for up to nine ticks (0.18 s), and is STALE
 * in every tick from then on; a reset shows within nine ticks. What it measures meanwhile is right:
 * after a reset it has the same units. */
void current_sensor_read(controller_sensor_t sensor[], uint8_t count);

#ifdef __cplusplus
}
#endif
#endif
