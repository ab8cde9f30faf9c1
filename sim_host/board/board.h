/* What it is for: a simulated Arduino Mega with nine INA219s that runs the firmware's ELF around a
 * plant.
 * What it owns: the simavr core, the peripherals simavr 1.6 lacks or gets wrong, the faults, the
 * lockstep.
 * What it never does: look at the wall clock. Two runs with the same calls are the same, byte for
 * byte. Time is counted in CPU cycles (16 per microsecond) since the board was made; a reset does
 * not set it back. */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "plant.h"

#ifdef __cplusplus
extern "C" {
#endif

#define BOARD_CHANNELS          9
#define BOARD_FREQUENCY_HZ      16000000u
#define BOARD_CYCLES_PER_MS     16000u
#define BOARD_EEPROM_BYTES      4096u
#define BOARD_PWM_PERIOD_CYCLES 800u

typedef struct board board_t;

typedef enum {
    BOARD_RUNNING = 0,
    BOARD_CRASHED, /* the program left its memory: see board_complaint */
    BOARD_ASLEEP   /* it sleeps with interrupts off and will never wake */
} board_state_t;

typedef enum {
    BOARD_RESET_POWER_ON = 0, /* RAM is garbage, sensors restart */
    BOARD_RESET_EXTERNAL,     /* the reset button: RAM stays */
    BOARD_RESET_BROWN_OUT,    /* RAM stays; an EEPROM byte under way is lost */
    BOARD_RESET_WATCHDOG      /* comes from the program; board_reset takes it too */
} board_reset_t;

typedef enum {
    BOARD_FAULT_OPEN = 0, /* spring broken */
    BOARD_FAULT_SHORT,    /* spring's ends connected */
    BOARD_FAULT_RESISTOR, /* a resistor in the spring's place (ELECTRICS_DUMMY_OHM) */
    BOARD_FAULT_GATE,     /* its switch's gate is not connected: never on */
    BOARD_FAULT_CLOSED,   /* its switch has failed closed: full duty whatever the pin says */
    BOARD_FAULT_NACK,     /* its INA219 does not answer */
    BOARD_FAULT_STALE,    /* its INA219 converts no more, and says so: CNVR stays clear */
    BOARD_FAULT_FREEZE,   /* its INA219 acknowledges and converts, with the same result for ever */
    BOARD_FAULT_FREEZE_CURRENT, /* the same of the shunt's voltage alone */
    BOARD_FAULT_FREEZE_VOLTAGE, /* and of the bus's */
    BOARD_FAULT_SDA_LOW,        /* the bus's data line is held low (channel ignored) */
    BOARD_FAULT_EEPROM,         /* the EEPROM keeps nothing that is written (channel ignored) */
    BOARD_FAULT_ENABLE_LOW,     /* the pin that holds the cut-off is shorted to ground (channel
                                   ignored) */
    BOARD_FAULT_ENABLE_HIGH,    /* and to 5 V */
    BOARD_FAULT_FAN             /* the fan stands still whatever it is told (channel ignored) */
} board_fault_t;

typedef void (*board_byte_t)(void *context, uint64_t cycle, uint8_t byte);
typedef void (*board_mark_t)(void *context, uint64_t cycle, unsigned which, uint8_t value);

/* An array of springs that is no plant: another truth, for the swarm. Its time is moved by `step`;
 * a duty holds until the next. */
typedef struct {
    void *context;
    unsigned springs; /* at most BOARD_CHANNELS */
    void (*step)(void *context, double seconds);
    void (*drive)(void *context, unsigned channel, double duty); /* 0 where the supply is off */
    void (*fan)(void *context, double fraction);
    void (*feed)(void *context, bool fed); /* whether the stages have their supply; may be NULL */
    void (*fault)(void *context, unsigned channel, plant_fault_t fault);
    double (*current_a)(void *context, unsigned channel); /* now, with that duty */
    double (*voltage_v)(void *context, unsigned channel); /* across the spring */
} board_array_t;

/* What a bus makes of a sensor that is sound. Either may be NULL. */
typedef struct {
    void *context;
    bool (*acknowledges)(void *context, unsigned channel); /* where the sensor does */
    /* The register (0..5) as the program gets it. */
    uint16_t (*reads)(void *context, unsigned channel, unsigned number, uint16_t value);
} board_bus_t;

typedef struct {
    const char *elf; /* path of the program */
    plant_t *plant;  /* nine springs at most, not owned; its parameters may be set between
                        runs; NULL: nothing is connected */
    const board_array_t *array; /* in the plant's place, copied; NULL: the plant */
    uint64_t seed;              /* of what RAM holds at power-on, and of the sensors' noise */
    double shunt_noise_v;       /* standard deviation of one conversion of an INA219 */
    double bus_noise_v;
    bool without_cut_off;   /* the stages have their supply whatever the program does */
    void *context;          /* of the two functions below, both optional */
    board_byte_t on_uart;   /* a byte has left USART0 */
    board_mark_t on_mark;   /* the program wrote general purpose register 0, 1 or 2 */
    const board_bus_t *bus; /* what else happens on it, copied; NULL: nothing */
} board_options_t;

/* Powers the board on, with an erased EEPROM. Fails (NULL, one line in `error`) if and only if the
 * ELF is refused, the plant has more than nine springs, or memory is out. */
board_t *board_create(const board_options_t *options, char *error, size_t error_size);
void board_destroy(board_t *board);

/* Runs until that cycle, to the instruction; the plant is then advanced to it. */
board_state_t board_run_until(board_t *board, uint64_t cycle);
board_state_t board_run_ms(board_t *board, double ms);
uint64_t board_cycle(const board_t *board);
double board_time_s(const board_t *board);
board_state_t board_state(const board_t *board);
/* What the simulator complained about last, "" if nothing. */
const char *board_complaint(const board_t *board);

void board_reset(board_t *board, board_reset_t cause);
/* The program stays for ever at the instruction it has reached (interrupts go on) until the next
 * reset: a real watchdog bites. */
void board_hang(board_t *board);
/* Resets since the board was made, its power-on not counted. */
unsigned board_reset_count(const board_t *board);
/* The crystal stands still until the next board_reset, and with it the program, its timers and its
 * pins: an output that was driven is left high, the worst that can be. The watchdog has a clock of
 * its own, and its reset would make the pins float; that is left out. Time is still counted in
 * cycles. */
void board_stop_oscillator(board_t *board);

/* While the plant is held its time stands still and no current flows: for the time before an
 * experiment. */
void board_hold_plant(board_t *board, bool held);

/* Bytes from the partner, sent one after another at 115200 baud. */
void board_send(board_t *board, const void *bytes, size_t count);
size_t board_send_backlog(const board_t *board);
/* Bytes that arrived while the receive buffer was full, and are lost. */
uint64_t board_uart_overruns(const board_t *board);

/* Outputs. Fraction of the time that the switch of channel 0..8 is on, as the pin has it now. */
double board_duty(const board_t *board, unsigned channel);
/* Whether every switch is off: no pulse at all. */
bool board_all_off(const board_t *board);
/* Cycle at which the last of them went off; 0 if none was ever on. */
uint64_t board_all_off_since(const board_t *board);
/* Whether the cut-off feeds the stages (electrics_cut_off_t). */
bool board_is_fed(const board_t *board);
double board_fan(const board_t *board); /* what the pin says, 0..1 */

/* What flows at this moment, from the plant and the faults. */
double board_current_a(const board_t *board, unsigned channel);

void board_set_fault(board_t *board, board_fault_t fault, unsigned channel, bool on);
/* The INA219 shows so many times its current and its voltage (1, 1: the truth). */
void board_scale_sensor(board_t *board, unsigned channel, double current_scale,
                        double voltage_scale);
/* The two INA219s change their places in the stages; done twice, they are back. */
void board_swap_sensors(board_t *board, unsigned a, unsigned b);
/* The pins' wires to the gates of two channels change places; done twice, they are back. */
void board_swap_gates(board_t *board, unsigned a, unsigned b);
/* Each bit on the I2C bus takes so many times as long: its clock is stretched. 1: as it is set. */
void board_stretch_bus(board_t *board, double factor);
/* The INA219 loses its configuration. */
void board_reset_sensor(board_t *board, unsigned channel);
/* A register (0..5) of an INA219, without side effects. */
uint16_t board_sensor_register(const board_t *board, unsigned channel, unsigned number);
/* A bit or more of a register (0x20..0x1FF, as the program sees it) or of RAM (0x200..0x21FF) turns
 * over by itself. */
void board_flip(board_t *board, unsigned address, uint8_t bits);
/* What it holds now; address as above. */
uint8_t board_register(const board_t *board, unsigned address);
/* An interrupt that nothing asked for: its enable bit is set and it is raised. False if and only if
 * the simulated chip has no such vector (its number by the data sheet, less one: the program's). */
bool board_raise_interrupt(board_t *board, unsigned vector);
void board_set_analog_v(board_t *board, unsigned input, double volt);

/* BOARD_EEPROM_BYTES bytes; may be written between runs. */
uint8_t *board_eeprom(board_t *board);
uint64_t board_eeprom_writes(const board_t *board);
bool board_eeprom_busy(const board_t *board);

/* The program's memory, by symbol of the ELF. Fails (NULL) if and only if there is no such
 * symbol. */
const uint8_t *board_variable(const board_t *board, const char *symbol, uint32_t *size);
uint32_t board_flash_bytes(const board_t *board);
uint32_t board_static_ram_bytes(const board_t *board);
/* Most bytes of stack in use since power-on, from what the stack has overwritten. */
uint32_t board_stack_high_water(const board_t *board);
/* Cycles since power-on in which the core slept. */
uint64_t board_idle_cycles(const board_t *board);

typedef struct {
    unsigned calls;
    uint64_t minimum_cycles, maximum_cycles, total_cycles; /* without interrupt routines */
} board_measurement_t;
/* Single-steps until a function has been called `calls` times or `limit_ms` have passed. False if
 * and only if the ELF has no such symbol. */
bool board_measure(board_t *board, const char *function, unsigned calls, double limit_ms,
                   board_measurement_t *result);

#ifdef __cplusplus
}
#endif
#endif
