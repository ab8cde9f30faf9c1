/* What it is for: one INA219 current sensor as its registers show it: I2C bytes in, I2C bytes out.
 * What it owns: the six registers, the conversion sequence, and the mean over each conversion's
 * true window.
 * What it never does: know the plant or the simulator. Time comes in CPU cycles, voltages as their
 * integrals. Source: Texas Instruments SBOS448G, sections 8.5 and 8.6 (register map, ADC settings,
 * CNVR, OVF). */
#ifndef INA219_H
#define INA219_H

#include <stdbool.h>
#include <stdint.h>

#include "electrics.h"

#ifdef __cplusplus
extern "C" {
#endif

#define INA219_CYCLES_PER_US 16u
#define INA219_NEVER         UINT64_MAX

typedef enum {
    INA219_REGISTER_CONFIG = 0,
    INA219_REGISTER_SHUNT = 1,
    INA219_REGISTER_BUS = 2,
    INA219_REGISTER_POWER = 3,
    INA219_REGISTER_CURRENT = 4,
    INA219_REGISTER_CALIBRATION = 5
} ina219_register_t;

typedef enum { INA219_IDLE = 0, INA219_CONVERTS_SHUNT, INA219_CONVERTS_BUS } ina219_phase_t;

/* What the sensor's two inputs integrate to since the beginning of time, in volt times cycles. */
typedef struct {
    uint64_t cycle;
    double shunt_v_cycles;
    double bus_v_cycles;
} ina219_inputs_t;

typedef struct {
    uint16_t config;
    uint16_t calibration;
    int16_t shunt_10uv;
    uint16_t bus_4mv;
    int16_t current;
    uint16_t power;
    bool ready;    /* CNVR */
    bool overflow; /* OVF */
    ina219_phase_t phase;
    uint64_t conversion_end_cycle; /* INA219_NEVER while idle */
    ina219_inputs_t window_start;
    uint32_t conversions; /* completed since power-on: for tests */
    /* I2C */
    uint8_t pointer;
    uint8_t byte_count;
    uint16_t shift;
    /* noise: standard deviation of one conversion, V; it falls with the square root of the samples
     */
    double shunt_noise_v, bus_noise_v;
    electrics_noise_t noise;
    /* faults */
    bool absent; /* answers no address */
    bool stale;  /* converts no more: registers stay as they are and CNVR stays clear */
    bool shunt_frozen, bus_frozen;           /* converts, with the result that it has */
    double shunt_gain_error, bus_gain_error; /* it shows 1 + error times what is there */
} ina219_t;

/* Registers to their reset values (config 0x399F, calibration 0) and the first conversion begun.
 * Faults and noise stay. */
void ina219_power_on(ina219_t *sensor, const ina219_inputs_t *now);

/* Advances to the present: call at conversion_end_cycle, with the integrals of that very cycle. */
void ina219_conversion_ended(ina219_t *sensor, const ina219_inputs_t *now);

/* I2C, as a slave sees it. `begin` returns whether the address was acknowledged. */
bool ina219_begin(ina219_t *sensor, bool read);
void ina219_write(ina219_t *sensor, uint8_t byte, const ina219_inputs_t *now);
uint8_t ina219_read(ina219_t *sensor);

/* Microseconds that one conversion takes at the 4-bit ADC setting of the config register (SADC,
 * BADC). */
uint32_t ina219_conversion_us(uint8_t adc_setting);

#ifdef __cplusplus
}
#endif
#endif
