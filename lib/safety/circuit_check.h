/* What it is for: tells whether duty, supply, current and voltage of one spring can be one circuit.
 * What it owns: sums over a window of readings, and how many windows on end could not be.
 * What it never does: latch a fault, correct a reading. It uses floating point, once in a window.
 */
#ifndef CIRCUIT_CHECK_H
#define CIRCUIT_CHECK_H

#include <stdbool.h>
#include <stdint.h>

#include "circuit_source.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CIRCUIT_CHECK_TICKS   30u   /* of a window: three of them fit in 2 s */
#define CIRCUIT_CHECK_MOST    4095u /* mA and mV: the sums fit 32 bits */
#define CIRCUIT_CHECK_JUMP    2u    /* steps: after more, a reading may be of the duty before */
#define CIRCUIT_CHECK_WINDOWS 2u    /* on end in which the voltage did not follow the duty */
/* On end whose voltages did not add up, or moved without the duty. */
#define CIRCUIT_CHECK_BALANCE_WINDOWS 3u

/* Of one spring. The voltage is that behind the switch: the spring's, and what its current drops
 * over shunt and wiring. It is duty times supply, whatever the spring's resistance does. */
typedef struct {
    uint32_t duty_square;
    uint32_t duty_voltage;
    uint32_t voltage_mv; /* behind the switch */
    uint32_t voltage_square;
    uint16_t current_2ma; /* in 2 mA: CIRCUIT_CHECK_TICKS of them fit */
    uint16_t duty;
    uint16_t last_duty;
    int16_t last_ma, last_mv;
    uint8_t readings : 6;
    bool current_moved : 1; /* in this window */
    bool voltage_moved : 1;
    uint8_t astray : 4;     /* windows on end in which the voltage did not follow the duty */
    uint8_t unbalanced : 4; /* windows on end in which it was not what the duty should bring */
    uint8_t restless : 4;   /* windows on end in which it moved without the duty */
    bool hurried : 1;       /* a tick of this window was not 20 ms after the one before */
    bool late : 1;          /* and it is the next one of which a reading comes */
} circuit_check_t;

/* The last window was one of a circuit. */
static inline bool circuit_check_is_sound(const circuit_check_t *check)
{
    return check->astray == 0 && check->unbalanced == 0 && check->restless == 0;
}

/* Below it, offsets are most of what differs. */
#define CIRCUIT_WINDOW_LEAST_MV 100.0f

/* What a window's voltages were, in the mean. */
typedef struct {
    float found_mv;    /* behind the switch */
    float expected_mv; /* by duty, supply and drop */
    float share;       /* circuit_window_share of them */
    float beside;      /* its share of what another one showed; 0: none tells */
    bool outvoted;     /* by that and others, and all at about the same volts */
    bool acquitted;    /* it shows beside them what it always did, at whatever volts */
    float current_ma;
    bool tells;    /* there were readings enough */
    bool steady;   /* all at about the same duty */
    float duty;    /* steps of 800 */
    bool balances; /* its duty brings what was found, with no help of a drop that is not known */
} circuit_window_t;

/* What was found of a voltage that should be there; 0: that is too little to tell. */
static inline float circuit_window_share(float found_mv, float expected_mv)
{
    return expected_mv >= CIRCUIT_WINDOW_LEAST_MV ? found_mv / expected_mv : 0.0f;
}

/* It tells what a spring's circuit shows of the voltage that its duty should bring. */
static inline bool circuit_window_compares(const circuit_window_t *window)
{
    return window->tells && window->expected_mv >= CIRCUIT_WINDOW_LEAST_MV;
}

/* A tick that came late, or soon after a late one: what is read at its end is of another duty, and
 * is left out. */
static inline void circuit_check_hurry(circuit_check_t *check)
{
    check->hurried = check->late = true;
}

/* Ends a window of which nothing is to be judged, as hurried ticks left few readings: neither sound
 * nor odd, it ends no row. False, nothing changed, if it had enough, or none was hurried. */
bool circuit_check_drop(circuit_check_t *check);

/* One tick: the duty (steps of 800) that was applied in it and, if valid, what was read at its end.
 * Above CIRCUIT_CHECK_MOST counts as that, below 0 as 0. fixed_mohm: shunt and wiring. dead_steps:
 * of duty, that only overcome the drop. Where there are any, a duty that is not more tells nothing;
 * none at all tells something where none is given in all of the window. */
void circuit_check_take(circuit_check_t *check, uint16_t fixed_mohm, uint8_t dead_steps,
                        uint16_t duty, bool valid, int16_t current_ma, int16_t voltage_mv);

/* Ends the window, begins the next one: at most CIRCUIT_CHECK_TICKS ticks after the last. True if
 * and only if what was read has not been a circuit for CIRCUIT_CHECK_WINDOWS windows on end, or
 * CIRCUIT_CHECK_BALANCE_WINDOWS: its voltage is not what the duty should bring, or moves beside it
 * as no supply does. A window that can tell nothing (few readings; for the first, a duty that
 * hardly moves) ends such a row. supply_mv: the declared one; its tolerance counts once, not again
 * around what was found of it. window may be NULL. */
bool circuit_check_judge(circuit_check_t *check, const circuit_source_t *source, uint16_t supply_mv,
                         circuit_window_t *window);

#ifdef __cplusplus
}
#endif
#endif
