/* What it is for: what an INA219 on a 0.1 ohm shunt says of a current and a voltage.
 * What it owns: its gain, offset, noise, quantisation; how it freezes and lies.
 * What it never does: fail on the bus: that is a status, and other tests provoke it. */
#ifndef WORLDS_INA219_H
#define WORLDS_INA219_H

#include <stdbool.h>
#include <stdint.h>

#include "random.h"

/* Registers, as docs/hardware.md has them: 10 uV over 0.1 ohm, and 4 mV. */
#define INA219_CURRENT_STEP_A 0.0001
#define INA219_VOLTAGE_STEP_V 0.004
#define INA219_CURRENT_MAX_A  3.2 /* gain /8 */
#define INA219_VOLTAGE_MAX_V  16.0
#define INA219_SLOW_S         1.0

typedef struct {
    double current_gain, voltage_gain; /* 1 is right */
    double current_offset_a, voltage_offset_v;
    double current_noise_a, voltage_noise_v; /* standard deviation of an averaged reading */
    double slow_voltage_noise_v;             /* the same, of one that lasts for INA219_SLOW_S */
    double slow_v;                           /* and what it is now */
    bool current_frozen, voltage_frozen;     /* its register stays as it is */
} ina219_t;

/* A reading, 20 ms after the one before, as the board hands it on: whole mA and mV. If frozen it is
 * left as it was. */
void ina219_read(ina219_t *sensor, random_t *random, double current_a, double voltage_v,
                 int16_t *current_ma, int16_t *voltage_mv);

#endif
