/* What it is for: decides whether each output may be on: limits, faults that latch, the lock.
 * What it owns: the fault numbers (docs/codes.csv holds the same), counters, latches, lock.
 * What it never does: switch an output, clamp or derate (drive_policy does), clear by itself. */
#ifndef SAFETY_H
#define SAFETY_H

#include <stdbool.h>
#include <stdint.h>

#include "parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

#ifndef SAFETY_MAX_SPRINGS
#ifdef __AVR__
#define SAFETY_MAX_SPRINGS 9
#else
#define SAFETY_MAX_SPRINGS 64
#endif
#endif

/* The numbers are part of the console's contract: never renumber, only add. */
typedef enum {
    SAFETY_FAULT_NONE = 0,
    /* of one spring: that spring is off until cleared */
    SAFETY_FAULT_OVER_CURRENT = 1,
    SAFETY_FAULT_OPEN_SPRING = 2,     /* driven, no current */
    SAFETY_FAULT_SHORT_SPRING = 3,    /* resistance below resistance_minimum_mohm */
    SAFETY_FAULT_HIGH_RESISTANCE = 4, /* resistance above resistance_maximum_mohm */
    SAFETY_FAULT_SENSOR_ABSENT = 5,   /* no acknowledge */
    SAFETY_FAULT_SENSOR_BUS = 6,      /* I2C bus stuck or timed out */
    SAFETY_FAULT_SENSOR_STALE = 7,    /* no new conversions */
    SAFETY_FAULT_SENSOR_RESET = 8, /* the sensor lost its configuration and did not take it again */
    SAFETY_FAULT_OVER_TEMPERATURE = 9, /* the model says so */
    SAFETY_FAULT_ON_TIME = 10,         /* on for longer than maximum_on_s */
    /* of the board: every spring is off until cleared */
    SAFETY_FAULT_STUCK_ON = 11,       /* current flows in a spring that is off: cut the supply */
    SAFETY_FAULT_SUPPLY_CURRENT = 12, /* sum of currents above supply_limit_ma */
    SAFETY_FAULT_EMERGENCY_STOP = 13, /* '!' or safety_emergency_stop */
    /* of one spring */
    SAFETY_FAULT_LIMIT_TRIP = 14, /* the policy gave up: safety_trip_limit */
    SAFETY_FAULT_COUNT
} safety_fault_t;

/* What is remembered of one spring: internal. Bad ticks in a row are counted up to bad_samples. */
typedef struct {
    uint8_t fault;       /* safety_fault_t, first one since the last clear */
    uint8_t suspects;    /* electrical conditions, bits: found in every tick that is counted */
    uint8_t electrical;  /* ticks */
    uint8_t sensor;      /* ticks */
    uint8_t temperature; /* ticks */
    uint16_t on_s;
} safety_spring_t;

typedef struct {
    safety_parameters_t parameters;
    int16_t temperature_trip_c7;
    uint16_t quick_ma; /* derived: above, a sample is looked at closely */
    uint8_t quick_low; /* resistance limits, 1/256 ohm */
    uint8_t quick_high;
    uint8_t springs;
    uint8_t board_fault; /* safety_fault_t, first one since the last clear */
    uint8_t supply_count;
    uint8_t second_ticks; /* ticks in the running second of the on-times */
    bool locked;
    safety_spring_t spring[SAFETY_MAX_SPRINGS];
} safety_t;

/* What is known about one spring in this tick. */
typedef struct {
    uint8_t sensor_status;  /* 0 valid, else 1 absent, 2 bus, 3 stale, 4 reset
                               (controller_sensor_status_t) */
    int16_t current_ma;     /* any value; ignored unless valid */
    int16_t voltage_mv;     /* any value; ignored unless valid */
    uint16_t expected_ma;   /* reference of the current loop in the measured tick; 0: it was off */
    int16_t temperature_c7; /* of the model, degC in Q9.7 */
} safety_sample_t;

/* Fails if and only if a parameter is outside the range above; then *bad is its
 * byte offset in *parameters (bad may be NULL). */
bool safety_check(const safety_parameters_t *parameters, uint16_t *bad);

/* No faults, unlocked. Fails (false, nothing changed) if and only if springs is 0 or above
 * SAFETY_MAX_SPRINGS or a parameter is outside the range above; then *bad is its
 * byte offset in *parameters (bad may be NULL). */
bool safety_init(safety_t *safety, const safety_parameters_t *parameters, uint8_t springs,
                 uint16_t *bad);

/* Replaces the parameters, keeps faults and counters. Fails as safety_init does. */
bool safety_apply(safety_t *safety, const safety_parameters_t *parameters, uint16_t *bad);

/* One tick (20 ms): every spring once, then the board once with the sum of the valid currents.
 * Conditions of the sensor, of the temperature and of current and voltage are counted apart. Where
 * one of the last passes into another without a good tick, the second is counted from where the
 * first ends.
 */
void safety_tick_spring(safety_t *safety, uint8_t spring, const safety_sample_t *sample);
void safety_tick_board(safety_t *safety, uint32_t sum_ma);

/* True if and only if the output may be on: not locked, no board fault, no fault of this spring. */
bool safety_allows(const safety_t *safety, uint8_t spring);

safety_fault_t safety_fault(const safety_t *safety, uint8_t spring);
safety_fault_t safety_board_fault(const safety_t *safety);
/* A fault's name, in flash, as in docs/codes.csv ("open_spring"); "none" and, out of range,
 * "unknown". */
const char *safety_fault_name(safety_fault_t fault);

/* Forgets all faults and counters. A condition that persists trips again after bad_samples ticks.
 * Not the lock. */
void safety_clear(safety_t *safety);
/* Latches SAFETY_FAULT_LIMIT_TRIP: the policy held this spring at nothing for too long. */
void safety_trip_limit(safety_t *safety, uint8_t spring);
/* Latches SAFETY_FAULT_EMERGENCY_STOP. */
void safety_emergency_stop(safety_t *safety);
/* After a watchdog or brown-out reset: nothing is driven until unlocked. */
void safety_lock(safety_t *safety);
void safety_unlock(safety_t *safety);
bool safety_is_locked(const safety_t *safety);

/* ---- the short way ---- */

/* safety_tick_spring for a sample that is good after others that were: a few compares in 16 bits
 * that only such a sample passes. False: nothing is done, safety_tick_spring has to. In the header,
 * because it stands in the tick's loop over the springs. */
static inline
#ifdef __AVR__
    __attribute__((always_inline))
#endif
    bool
    safety_tick_good(const safety_t *safety, safety_spring_t *spring, uint8_t sensor_status,
                     int16_t current_ma, int16_t voltage_mv, uint16_t expected_ma,
                     int16_t temperature_c7)
{
    const safety_parameters_t *p = &safety->parameters;
    if ((uint8_t)(sensor_status | spring->electrical | spring->sensor | spring->temperature) != 0 ||
        temperature_c7 > safety->temperature_trip_c7) {
        return false;
    }
    uint16_t amount_ma = current_ma > 0 ? (uint16_t)current_ma : 0u;
    if (amount_ma > safety->quick_ma) {
        return false;
    }
    if (amount_ma >= p->check_current_ma) {
        if ((uint16_t)voltage_mv > 4095u) {
            return false;
        }
        /* quick_ma is below 4096: in 16 mA, 8 bits; times 1/256 ohm is 1/16 mV */
        uint8_t amount_16ma = (uint8_t)(amount_ma >> 4);
        uint16_t voltage_16th = (uint16_t)((uint16_t)voltage_mv << 4);
        if (voltage_16th < (uint16_t)((amount_16ma + 1u) * safety->quick_low) ||
            voltage_16th > (uint16_t)(amount_16ma * safety->quick_high)) {
            return false;
        }
    }
    if (expected_ma == 0) {
        if (amount_ma > p->stuck_on_ma) {
            return false;
        }
        spring->on_s = 0;
        return true;
    }
    if (expected_ma >= p->check_current_ma && current_ma < (int16_t)(expected_ma >> 2)) {
        return false;
    }
    if (safety->second_ticks == 0) {
        if (spring->on_s >= (p->maximum_on_s != 0 ? p->maximum_on_s : UINT16_MAX)) {
            return false;
        }
        spring->on_s++;
    }
    return true;
}

#ifdef __cplusplus
}
#endif
#endif
