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

/* Readings: by the fourth the supply has gone, and the current with it. One is forgotten for each 2
 * s without any: a switch that closes for a tick gives 2.4 K, and a spring at 100 degC loses 1.5
 * K/s.
 */
#define SAFETY_STUCK_TICKS  3u
#define SAFETY_FORGET_TICKS 100u

/* Ticks on end in which no sensor answers. A welded switch gives 120 K/s, which then nothing shows:
 * 12 K, and 9 K more until the relay has opened. */
#define SAFETY_BLIND_TICKS 5u

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
    SAFETY_FAULT_OVER_TEMPERATURE = 9, /* of the model, or of the ceiling on it */
    SAFETY_FAULT_ON_TIME = 10,         /* on for longer than maximum_on_s */
    /* of the board: every spring is off until cleared */
    SAFETY_FAULT_STUCK_ON = 11, /* current flows in a spring that is off: cut the supply. Takes the
                                   place of whatever was latched before */
    SAFETY_FAULT_SUPPLY_CURRENT = 12, /* sum of currents above supply_limit_ma */
    SAFETY_FAULT_EMERGENCY_STOP = 13, /* '!' or safety_emergency_stop */
    /* of one spring */
    SAFETY_FAULT_LIMIT_TRIP = 14,      /* the policy gave up */
    SAFETY_FAULT_SENSOR_MISMATCH = 15, /* what is read cannot be this output's circuit */
    /* of the board */
    SAFETY_FAULT_HOST_SILENT = 16, /* safety_host_silent */
    SAFETY_FAULT_NO_SENSOR = 17,   /* none answers: nothing shows that current is off */
    SAFETY_FAULT_COUNT
} safety_fault_t;

/* What is remembered of one spring: internal. Bad ticks in a row are counted up to bad_samples. */
typedef struct {
    uint8_t fault;       /* safety_fault_t, first one since the last clear, or STUCK_ON */
    uint8_t suspects;    /* electrical conditions, bits: found in every tick that is counted */
    uint8_t electrical;  /* ticks */
    uint8_t stuck;       /* ticks with current that no duty gives */
    uint8_t unstuck;     /* readings without it since, to SAFETY_FORGET_TICKS */
    uint8_t frozen;      /* ticks without duty that showed what was shown with it */
    uint8_t sensor;      /* ticks */
    uint8_t temperature; /* ticks */
    uint16_t on_s;
    int16_t
        frozen_ma; /* last reading while driven without a fault, as long as nothing else is shown
                    */
} safety_spring_t;

typedef struct {
    safety_parameters_t parameters;
    int16_t temperature_trip_c7;
    uint8_t springs;
    uint8_t board_fault; /* as of a spring */
    uint8_t supply_count;
    uint8_t blind;        /* ticks on end in which no sensor answered, up to SAFETY_BLIND_TICKS */
    bool answered;        /* one has in this tick */
    uint8_t second_ticks; /* ticks in the running second of the on-times */
    bool locked;
    safety_spring_t spring[SAFETY_MAX_SPRINGS];
} safety_t;

/* What is known about one spring in this tick. */
typedef struct {
    uint8_t sensor_status; /* 0 valid, else 1 absent, 2 bus, 3 stale, 4 reset
                              (controller_sensor_status_t) */
    int16_t current_ma;    /* any value; ignored unless valid */
    int16_t voltage_mv;    /* any value; ignored unless valid */
    bool off;             /* no duty in the measured tick, nor in the one before, of which a reading
                             may still have a part */
    bool may_be_dead;     /* so little duty that a diode's drop may take all of it */
    uint16_t expected_ma; /* reference of the current loop in the measured tick; 0: it was off */
    uint16_t most_mv;     /* the most that these duties can bring to the spring */
    int16_t temperature_c7; /* of the model, degC in Q9.7 */
} safety_sample_t;

/* Fails if and only if a parameter is outside its row's range, or resistance_maximum_ohm is neither
 * 0 nor above resistance_minimum_ohm; then *bad (may be NULL) is the row of parameters.def. */
bool safety_check(const safety_parameters_t *parameters, uint16_t *bad);

/* No faults, unlocked. Fails (false, nothing changed) if and only if springs is 0 or above
 * SAFETY_MAX_SPRINGS (*bad stays) or as safety_check does. */
bool safety_init(safety_t *safety, const safety_parameters_t *parameters, uint8_t springs,
                 uint16_t *bad);

/* Replaces the parameters, keeps faults and counters. Fails (false, nothing changed) as
 * safety_check does. */
bool safety_apply(safety_t *safety, const safety_parameters_t *parameters, uint16_t *bad);

/* One tick (20 ms): every spring once, then the board once with the sum of the valid currents.
 * Conditions of the sensor, of the temperature, of current without duty, and of current and voltage
 * are counted apart. Where one of the last passes into another without a good tick, the second is
 * counted from where the first ends. True if and only if the sample is a reading: valid, and not of
 * a sensor that shows to the mA what it showed before its output went off or before it had
 * SAFETY_FAULT_SENSOR_MISMATCH: that is no current in a spring that is off, but that fault. Above
 * over_current_ma nobody is driven: there it is a current. */
bool safety_tick_spring(safety_t *safety, uint8_t spring, const safety_sample_t *sample);
void safety_tick_board(safety_t *safety, uint32_t sum_ma);

/* True if and only if a spring's last reading was current that no duty gives: one that is off, or
 * above over_current_ma at more than most_mv. Whoever holds the supply lets go at the first such
 * reading; SAFETY_STUCK_TICKS of them, one forgotten for each 2 s without, or bad_samples if that
 * is less, are SAFETY_FAULT_STUCK_ON.
 */
bool safety_doubts_supply(const safety_t *safety);

/* What a resistance is against its limits: SAFETY_FAULT_SHORT_SPRING, _HIGH_RESISTANCE or _NONE. A
 * voltage below 0 counts as 0. */
safety_fault_t safety_resistance_fault(const safety_parameters_t *parameters, uint16_t current_ma,
                                       int16_t voltage_mv);

/* True if and only if the output may be on: not locked, no board fault, no fault of this spring. */
bool safety_allows(const safety_t *safety, uint8_t spring);

/* True if and only if a fault stands that no switch of an output can be trusted to end: current in
 * a spring that is off (STUCK_ON), or one that became hotter than temperature_trip_c
 * (OVER_TEMPERATURE); or no sensor has answered for SAFETY_BLIND_TICKS, whatever fault stands. */
bool safety_cuts_supply(const safety_t *safety);

safety_fault_t safety_fault(const safety_t *safety, uint8_t spring);
safety_fault_t safety_board_fault(const safety_t *safety);
/* A fault's name, in flash, as in docs/codes.csv ("open_spring"); "none" and, out of range,
 * "unknown". */
const char *safety_fault_name(safety_fault_t fault);

/* Forgets all faults and counters. A condition that persists trips again after bad_samples ticks.
 * Not the lock, nor what a frozen sensor shows. */
void safety_clear(safety_t *safety);
/* Latches a fault of one spring that others have found, at once: SAFETY_FAULT_OVER_TEMPERATURE,
 * _LIMIT_TRIP or _SENSOR_MISMATCH; or _STUCK_ON, that of the board with it. */
void safety_trip(safety_t *safety, uint8_t spring, safety_fault_t fault);
/* Latches SAFETY_FAULT_HOST_SILENT: whoever asked for the springs has not been heard for too long.
 */
void safety_host_silent(safety_t *safety);
/* Latches SAFETY_FAULT_EMERGENCY_STOP. */
void safety_emergency_stop(safety_t *safety);
/* After a watchdog or brown-out reset: nothing is driven until unlocked. */
void safety_lock(safety_t *safety);
void safety_unlock(safety_t *safety);
bool safety_is_locked(const safety_t *safety);

#ifdef __cplusplus
}
#endif
#endif
