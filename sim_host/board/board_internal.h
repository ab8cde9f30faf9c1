/* What it is for: what the rooms of the simulated board (core, lockstep, program) know of each
 * other.
 * What it owns: the board's state.
 * What it never does: serve anyone outside this folder: users include board.h. */
#ifndef BOARD_INTERNAL_H
#define BOARD_INTERNAL_H

#include "board.h"

#include <simavr/sim_avr.h>

#include "board_eeprom.h"
#include "board_elf.h"
#include "board_pwm.h"
#include "board_twi.h"
#include "board_uart.h"
#include "electrics.h"
#include "ina219.h"

/* simavr looks at its timers after each instruction unless told that it may run on until the next
 * is due. */
#define BOARD_RUN_CYCLES_LIMIT 1000000u

struct board {
    avr_t *avr;
    board_elf_t *elf;
    board_options_t options;
    plant_t *plant;
    board_array_t array; /* without a context's functions: the plant */
    unsigned springs;
    board_bus_t bus;
    board_twi_t twi;
    board_uart_t uart;
    board_eeprom_t eeprom;
    board_pwm_t pwm;
    ina219_t sensor[BOARD_CHANNELS];
    /* electrical state, constant since synchronised_cycle */
    double current_a[BOARD_CHANNELS];
    double voltage_v[BOARD_CHANNELS];
    unsigned stage_of_sensor[BOARD_CHANNELS]; /* which channel it is wired to */
    double shunt_v_cycles[BOARD_CHANNELS];    /* of a sensor's inputs */
    double bus_v_cycles[BOARD_CHANNELS];
    uint64_t synchronised_cycle;
    uint64_t plant_cycle;
    uint64_t next_plant_cycle;
    unsigned pin_of_stage[BOARD_CHANNELS]; /* which output its gate is wired to */
    bool gate_open[BOARD_CHANNELS];
    bool switch_closed[BOARD_CHANNELS]; /* whatever the pin says */
    bool fan_stopped;
    electrics_cut_off_t cut_off;
    bool enable_high;            /* as its pump sees it */
    uint64_t enable_since_cycle; /* since when it is so */
    bool enable_low_fault, enable_high_fault;
    bool oscillator_stopped;
    bool plant_held;
    /* resets */
    bool reset_seen;
    uint8_t reset_flags; /* MCUSR as the program left it */
    unsigned resets;
    uint64_t idle_cycles;
    bool hanging;
    uint32_t hang_address;
    uint8_t hang_opcode[2]; /* what was there */
    bool stop_now;
    char complaint[160];
};

/* ---------------------------------------------------------------- lockstep */

/* Everything that is due at the sensors and the plant until now. */
void board_handle_events(board_t *board, uint64_t now);
/* The plant has had the old duties until now and gets the new ones. */
void board_move_plant(board_t *board, uint64_t cycle);
/* Tells the simulator when board_handle_events is due next. */
void board_schedule(board_t *board);
void board_sensors_power_on(board_t *board);
/* The pin that holds the cut-off, or what shorts it, may have changed. */
void board_enable_changed(board_t *board);
/* For board_twi and board_pwm; the context is the board. */
bool board_sensor_begin(void *context, uint8_t address, bool read);
void board_sensor_write(void *context, uint8_t address, uint8_t byte);
uint8_t board_sensor_read(void *context, uint8_t address);
void board_pwm_changed(void *context);

/* -------------------------------------------------------------------- core */

/* One run of the simulator's core, and what a reset from inside asks for. */
void board_step_core(board_t *board);
/* Whose core runs: the simulator's logger has no context. */
void board_take_complaints(board_t *board);

/* ----------------------------------------------------------------- program */

void board_fill_ram(board_t *board);

#endif
