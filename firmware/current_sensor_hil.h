/* What it is for: hardware in the loop: the readings of current_sensor_read come over the serial
 * port.
 * What it owns: the newest frame of readings and its age.
 * What it never does: touch the I2C bus. */
#ifndef CURRENT_SENSOR_HIL_H
#define CURRENT_SENSOR_HIL_H

#include <stdbool.h>
#include <stdint.h>

#include "controller.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Takes one received byte; true where it belongs to a frame, so that the console must not see it.
 */
bool current_sensor_hil_receive(uint8_t octet);
/* The tick that begins; readings older than HIL_FRAME_MAX_LAG_TICKS then count as stale. */
void current_sensor_hil_tick(uint16_t tick);
/* The plant's ambient temperature, once a frame has come. */
void current_sensor_hil_ambient(int16_t *ambient_c7);
/* Sends the tick's duties. */
void current_sensor_hil_send(uint16_t tick, const controller_outputs_t *outputs);

#ifdef __cplusplus
}
#endif
#endif
