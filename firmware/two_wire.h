/* What it is for: I2C transfers of a few bytes, as the only master on the bus, at 400 kHz.
 * What it owns: the two-wire unit and its pins, D21 (SCL) and D20 (SDA).
 * What it never does: wait longer than TWO_WIRE_STEP_US for one step, use an interrupt. */
#ifndef TWO_WIRE_H
#define TWO_WIRE_H

#include <stdint.h>

#include "controller.h"

#ifdef __cplusplus
extern "C" {
#endif

#define TWO_WIRE_HZ         400000ul
#define TWO_WIRE_TIMEOUT_US 400ul /* a transfer of ours takes 0.1 ms */
#define TWO_WIRE_STEP_US    100ul /* a byte of it 23 us: four times as slow is stuck */

void two_wire_begin(void);
/* After BUS: clocks a device that holds SDA low until it lets go, and starts the bus again. */
void two_wire_recover(void);
typedef enum { TWO_WIRE_WRITE = 0, TWO_WIRE_READ = 1 } two_wire_direction_t;

/* A whole transfer of at least one byte, start to stop. Fails if and only if the device does not
 * acknowledge (ABSENT), or the bus is stuck or was taken by another master (BUS). */
controller_sensor_status_t two_wire_transfer(uint8_t address, two_wire_direction_t direction,
                                             uint8_t bytes[], uint8_t length);

#ifdef __cplusplus
}
#endif
#endif
