/* What it is for: everything that the firmware needs of an Arduino Mega 2560, behind a few
 * functions.
 * What it owns: timers, pins, serial port, EEPROM, watchdog, ADC. The only place that names a
 * register, with two_wire.c.
 * What it never does: decide. It switches outputs off by itself in one case: '!' in the receive
 * interrupt. */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define BOARD_SPRINGS      9
#define BOARD_DUTY_MAX     800u /* timer counts of one 20 kHz period */
#define BOARD_TICK_MS      20u
#define BOARD_EEPROM_BYTES 4096u

/* Why the chip started. Bits; more than one may be set. */
typedef enum {
    BOARD_RESET_POWER_ON = 1,
    BOARD_RESET_EXTERNAL = 2, /* reset button, or a serial port that was opened (DTR) */
    BOARD_RESET_BROWN_OUT = 4,
    BOARD_RESET_WATCHDOG = 8,
    BOARD_RESET_UNKNOWN = 16, /* a boot loader cleared the flags: see docs/hardware.md */
    BOARD_RESET_WARM = 32     /* the RAM kept its content */
} board_reset_t;

/* Outputs off, timers and serial port running, interrupts on, watchdog not yet started. What
 * follows is called with interrupts on, and leaves them on. */
void board_init(void);
uint8_t board_reset_cause(void);
/* The program cannot go on as it is: outputs off, and a reset by the watchdog. why: a text in
 * flash, which board_ended_take tells once after that reset; NULL where the program ended
 * otherwise. */
void board_end(const char *why) __attribute__((noreturn));
const char *board_ended_take(void);

/* --- outputs ------------------------------------------------------------------------------ */

/* Timer counts of the nine outputs, 0..800; 0 is off: pin low, no pulse. More than 800 counts as 0.
 * Ignored from '!' until board_stop_take() has reported it. */
void board_set_duties(const uint16_t duty[BOARD_SPRINGS]); /* once a tick, as the next */
void board_set_fan(uint8_t percent);                       /* 0..100, above counts as 100 */

/* 1 once after '!' was received, 2 after a second one in a row, else 0: the outputs have been off
 * since, and stay so until this call. */
uint8_t board_stop_take(void);

/* The line that holds the supply of the stages: a pulse of 100 us where hold is true, else low, as
 * from the start and after '!'. The cut-off counts pulses, so nothing but the end of each control
 * tick calls this. */
void board_hold_supply(bool hold);

/* --- time --------------------------------------------------------------------------------- */

uint32_t board_time_ms(void); /* since start, from timer 2: never adjusted */
uint32_t board_time_us(void); /* in steps of 4 us; wraps */
/* True once per 20 ms; *behind is the number of further ticks that are already due. */
bool board_tick_take(uint8_t *behind);

/* --- serial, 115200 8N1 ------------------------------------------------------------------- */

/* Next received byte or -1. '!' and '?' are taken out by the receive interrupt. */
int16_t board_serial_read(void);
/* Whether there is one. */
bool board_serial_waits(void);
/* True once after '?'. */
bool board_serial_status_take(void);
/* True while bytes are queued that arrived before the last '!'; they must not be obeyed. */
bool board_serial_before_stop(void);
/* True once after bytes were lost, in the receive buffer or on the line. */
bool board_serial_lost_take(void);

/* Queues bytes. What does not fit is lost: ask board_serial_room() first. */
uint16_t board_serial_room(void);
void board_serial_write(const char *bytes, uint8_t length);

/* --- EEPROM ------------------------------------------------------------------------------- */

bool board_eeprom_ready(void); /* no write in progress */
uint8_t board_eeprom_read(uint16_t address);
/* Starts one write (3.4 ms) and returns. Only when ready. A byte that is already right is not
 * written. */
void board_eeprom_write(uint16_t address, uint8_t octet);

/* --- the rest ----------------------------------------------------------------------------- */

/* Writes anew what the clock, the serial port and the ADC rest on, as a register may have lost a
 * bit. Once a tick. board_set_duties and board_set_fan do so for the outputs. */
void board_hold(void);

void board_watchdog_start(void); /* 250 ms */
void board_watchdog_kick(void);

/* Voltage at A0 in 1/1024 of the supply, mean of the last 16 conversions; starts the next one. */
uint16_t board_ambient_adc(void);

/* Sleeps until a tick, a received byte, '!' or '?' is waiting; while busy only until the next
 * interrupt. */
void board_idle(bool busy);
/* Time slept since the last call, with the interrupts that ended it. */
uint32_t board_idle_us_take(void);

/* Bytes of RAM that the stack has never reached. */
uint16_t board_stack_unused(void);

#ifdef __cplusplus
}
#endif
#endif
