#include "board.h"

#include <simavr/avr_adc.h>
#include <simavr/avr_extint.h>
#include <simavr/avr_ioport.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_cycle_timers.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "board_eeprom.h"
#include "board_elf.h"
#include "board_pwm.h"
#include "board_registers.h"
#include "board_twi.h"
#include "board_uart.h"
#include "ina219.h"

#define SENSOR_ADDRESS 0x40u
#define SHUNT_OHM      0.1
#define SUPPLY_MV      5000u
#define RAM_BEGIN      0x200u
#define FIRMWARE_PAINT 0xC5u /* what firmware/board_mega.c paints its free RAM with */
#define REGISTER_PIND  0x29u
#define I2C_PINS       0x03u /* PD0 SCL, PD1 SDA: pulled up */
#define PORF           0x01u
#define EXTRF          0x02u
#define BORF           0x04u
#define WDRF           0x08u
/* The plant moves at most this often: springs need seconds to warm, so what it takes is little
 * (bench/board). */
#define PLANT_PERIOD_CYCLES BOARD_CYCLES_PER_MS
/* simavr looks at its timers after each instruction unless told that it may run on until the next
 * is due. */
#define RUN_CYCLES_LIMIT 1000000u

#ifdef __SANITIZE_ADDRESS__
/* simavr 1.6 gives back neither its IRQs nor their names. */
const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void)
{
    return "leak:libsimavr";
}
#endif

struct board {
    avr_t *avr;
    board_elf_t *elf;
    board_options_t options;
    plant_t *plant;
    unsigned springs;
    board_twi_t twi;
    board_uart_t uart;
    board_eeprom_t eeprom;
    board_pwm_t pwm;
    ina219_t sensor[BOARD_CHANNELS];
    /* electrical state, constant since synchronised_cycle */
    double current_a[BOARD_CHANNELS];
    double voltage_v[BOARD_CHANNELS];
    double shunt_v_cycles[BOARD_CHANNELS];
    double bus_v_cycles[BOARD_CHANNELS];
    uint64_t synchronised_cycle;
    uint64_t plant_cycle;
    uint64_t next_plant_cycle;
    bool fan_stopped;
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

/* --- RAM at power-on: garbage that can be told from what a stack leaves --- */

static uint8_t garbage(uint64_t seed, unsigned address)
{
    uint64_t mixed = (seed + address + 1u) * 0x9E3779B97F4A7C15u;
    return (uint8_t)(mixed >> 56);
}

static void fill_ram(board_t *board)
{
    for (unsigned address = RAM_BEGIN; address <= board->avr->ramend; address++) {
        board->avr->data[address] = garbage(board->options.seed, address);
    }
}

/* --- lockstep with the plant --- */

static void integrate_until(board_t *board, uint64_t cycle)
{
    if (cycle <= board->synchronised_cycle) {
        return;
    }
    double cycles = (double)(cycle - board->synchronised_cycle);
    for (unsigned k = 0; k < BOARD_CHANNELS; k++) {
        board->shunt_v_cycles[k] += board->current_a[k] * SHUNT_OHM * cycles;
        board->bus_v_cycles[k] += board->voltage_v[k] * cycles;
    }
    board->synchronised_cycle = cycle;
}

static ina219_inputs_t sensor_inputs(const board_t *board, unsigned k)
{
    return (ina219_inputs_t){board->synchronised_cycle, board->shunt_v_cycles[k],
                             board->bus_v_cycles[k]};
}

static double fan_of(const board_t *board)
{
    return board->fan_stopped ? 0.0 : board_pwm_fan(&board->pwm);
}

/* The plant has had the old duties until now and gets the new ones. */
static void move_plant(board_t *board, uint64_t cycle)
{
    integrate_until(board, cycle);
    board->next_plant_cycle = cycle + PLANT_PERIOD_CYCLES;
    if (board->plant == NULL || board->plant_held) {
        return;
    }
    if (cycle > board->plant_cycle) {
        (void)plant_step(board->plant, (double)(cycle - board->plant_cycle) / BOARD_FREQUENCY_HZ);
        board->plant_cycle = cycle;
    }
    for (unsigned k = 0; k < board->springs; k++) {
        (void)plant_drive(board->plant, (int)k, PLANT_DRIVE_DUTY, board->pwm.duty[k]);
    }
    (void)plant_set_fan(board->plant, fan_of(board));
    for (unsigned k = 0; k < board->springs; k++) {
        board->current_a[k] = plant_current_a(board->plant, (int)k);
        board->voltage_v[k] = plant_voltage_v(board->plant, (int)k);
    }
}

static uint64_t next_event(const board_t *board)
{
    uint64_t next = board->next_plant_cycle;
    for (unsigned k = 0; k < BOARD_CHANNELS; k++) {
        if (board->sensor[k].conversion_end_cycle < next) {
            next = board->sensor[k].conversion_end_cycle;
        }
    }
    return next;
}

static void handle_events(board_t *board, uint64_t now)
{
    uint64_t event = next_event(board);
    while (event <= now) {
        if (event == board->next_plant_cycle) {
            move_plant(board, event);
        }
        integrate_until(board, event);
        for (unsigned k = 0; k < BOARD_CHANNELS; k++) {
            if (board->sensor[k].conversion_end_cycle <= event) {
                ina219_inputs_t inputs = sensor_inputs(board, k);
                ina219_conversion_ended(&board->sensor[k], &inputs);
            }
        }
        event = next_event(board);
    }
}

static avr_cycle_count_t on_event(avr_t *avr, avr_cycle_count_t when, void *param)
{
    board_t *board = param;
    (void)avr;
    handle_events(board, when);
    return next_event(board);
}

static void schedule(board_t *board)
{
    uint64_t next = next_event(board);
    uint64_t now = board->avr->cycle;
    avr_cycle_timer_register(board->avr, next > now ? next - now : 1, on_event, board);
}

/* A compare register takes effect at the next PWM period: one move of the plant serves all nine. */
static void pwm_changed(void *context)
{
    board_t *board = context;
    uint64_t period = BOARD_PWM_PERIOD_CYCLES;
    uint64_t next = (board->avr->cycle / period + 1u) * period;
    if (next < board->next_plant_cycle) {
        board->next_plant_cycle = next;
        schedule(board);
    }
}

/* --- the sensors on the bus --- */

static ina219_t *sensor_at(board_t *board, uint8_t address)
{
    unsigned k = (unsigned)address - SENSOR_ADDRESS;
    return address >= SENSOR_ADDRESS && k < BOARD_CHANNELS ? &board->sensor[k] : NULL;
}

static bool sensor_begin(void *context, uint8_t address, bool read)
{
    ina219_t *sensor = sensor_at(context, address);
    return sensor != NULL && ina219_begin(sensor, read);
}

static void sensor_write(void *context, uint8_t address, uint8_t byte)
{
    board_t *board = context;
    ina219_t *sensor = sensor_at(board, address);
    handle_events(board, board->avr->cycle);
    integrate_until(board, board->avr->cycle);
    ina219_inputs_t inputs = sensor_inputs(board, (unsigned)(sensor - board->sensor));
    uint64_t before = sensor->conversion_end_cycle;
    ina219_write(sensor, byte, &inputs);
    if (sensor->conversion_end_cycle != before) {
        schedule(board);
    }
}

static uint8_t sensor_read(void *context, uint8_t address)
{
    board_t *board = context;
    handle_events(board, board->avr->cycle);
    return ina219_read(sensor_at(board, address));
}

/* --- the core --- */

static board_t *complaining; /* simavr's logger has no context: whose core is running */

static void on_log(struct avr_t *avr, const int level, const char *format, va_list arguments)
{
    (void)avr;
    if (level == LOG_ERROR && complaining != NULL) {
        vsnprintf(complaining->complaint, sizeof complaining->complaint, format, arguments);
    }
}

static void on_sleep(avr_t *avr, avr_cycle_count_t cycles)
{
    (void)avr;
    complaining->idle_cycles += cycles + 1u;
}

static void on_reset(avr_t *avr)
{
    (void)avr;
    complaining->reset_seen = true;
}

static void write_mark(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    board_t *board = param;
    avr->data[address] = value;
    if (board->options.on_mark != NULL) {
        unsigned which = address == REGISTER_GPIOR0 ? 0u : 1u + address - REGISTER_GPIOR1;
        board->options.on_mark(board->options.context, avr->cycle, which, value);
    }
}

static void write_reset_flags(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    board_t *board = param;
    board->reset_flags &= value; /* flags can only be cleared */
    avr->data[address] = board->reset_flags;
}

static void uart_byte(void *context, uint64_t cycle, uint8_t byte)
{
    board_t *board = context;
    if (board->options.on_uart != NULL) {
        board->options.on_uart(board->options.context, cycle, byte);
    }
}

/* avr_reset has wiped the registers and every timer of the simulator. */
static void after_reset(board_t *board, uint8_t flag)
{
    avr_t *avr = board->avr;
    board->reset_seen = false;
    board->resets++;
    if (board->hanging) {
        memcpy(avr->flash + board->hang_address, board->hang_opcode, sizeof board->hang_opcode);
        board->hanging = false;
    }
    board->reset_flags |= flag;
    avr->data[REGISTER_MCUSR] = board->reset_flags;
    avr->data[REGISTER_PIND] = I2C_PINS;
    avr->run_cycle_limit = RUN_CYCLES_LIMIT;
    for (uint8_t k = 0; k < EXTINT_COUNT; k++) {
        /* Else a low pin that could be an interrupt, as outputs 2 and 3 could, is looked at in
         * every cycle. */
        avr_extint_set_strict_lvl_trig(avr, k, 0);
    }
    board_twi_reset(&board->twi);
    board_uart_reset(&board->uart);
    board_eeprom_reset(&board->eeprom);
    board_pwm_update(&board->pwm);
    schedule(board);
    if (board->twi.sda_stuck_low) {
        board_twi_hold_sda(&board->twi, true);
    }
}

static void sensors_power_on(board_t *board)
{
    integrate_until(board, board->avr->cycle);
    for (unsigned k = 0; k < BOARD_CHANNELS; k++) {
        ina219_inputs_t inputs = sensor_inputs(board, k);
        ina219_power_on(&board->sensor[k], &inputs);
    }
}

static bool make_core(board_t *board)
{
    board->avr = avr_make_mcu_by_name("atmega2560");
    if (board->avr == NULL) {
        return false;
    }
    avr_t *avr = board->avr;
    avr_init(avr);
    avr->log = LOG_ERROR;
    avr->frequency = BOARD_FREQUENCY_HZ;
    avr->vcc = SUPPLY_MV;
    avr->avcc = SUPPLY_MV;
    avr->aref = SUPPLY_MV;
    avr->sleep = on_sleep;
    avr->reset = on_reset;
    memcpy(avr->flash, board->elf->flash, BOARD_FLASH_SIZE);
    avr->codeend = board->elf->flash_used;

    const board_twi_devices_t devices = {board, sensor_begin, sensor_write, sensor_read};
    avr_ioport_external_t pull_up = {.name = 'D', .mask = I2C_PINS, .value = I2C_PINS};
    avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('D'), &pull_up);
    board_twi_attach(&board->twi, avr, &devices);
    board_uart_attach(&board->uart, avr, uart_byte, board);
    board_eeprom_attach(&board->eeprom, avr);
    board_pwm_attach(&board->pwm, avr, pwm_changed, board);
    board_take_register(avr, REGISTER_GPIOR0, NULL, write_mark, board);
    board_take_register(avr, REGISTER_GPIOR1, NULL, write_mark, board);
    board_take_register(avr, REGISTER_GPIOR2, NULL, write_mark, board);
    board_take_register(avr, REGISTER_MCUSR, NULL, write_reset_flags, board);
    return true;
}

board_t *board_create(const board_options_t *options, char *error, size_t error_size)
{
    int springs = options->plant != NULL ? plant_spring_count(options->plant) : 0;
    if (springs > BOARD_CHANNELS) {
        snprintf(error, error_size, "the board drives %d springs, the plant has %d", BOARD_CHANNELS,
                 springs);
        return NULL;
    }
    board_elf_t *elf = board_elf_read(options->elf, error, error_size);
    if (elf == NULL) {
        return NULL;
    }
    board_t *board = calloc(1, sizeof *board);
    if (board == NULL) {
        snprintf(error, error_size, "out of memory");
        board_elf_free(elf);
        return NULL;
    }
    board->options = *options;
    board->options.elf = NULL; /* not ours to keep */
    board->elf = elf;
    board->plant = options->plant;
    board->springs = (unsigned)springs;
    complaining = board;
    avr_global_logger_set(on_log);
    if (!make_core(board)) {
        snprintf(error, error_size, "libsimavr knows no atmega2560");
        board_destroy(board);
        return NULL;
    }
    for (unsigned k = 0; k < BOARD_CHANNELS; k++) {
        board->sensor[k].shunt_noise_v = options->shunt_noise_v;
        board->sensor[k].bus_noise_v = options->bus_noise_v;
        electrics_noise_seed(&board->sensor[k].noise, options->seed + k);
    }
    fill_ram(board);
    move_plant(board, 0);
    sensors_power_on(board);
    after_reset(board, PORF);
    board->resets = 0;
    return board;
}

void board_destroy(board_t *board)
{
    if (board == NULL) {
        return;
    }
    if (board->avr != NULL) {
        avr_terminate(board->avr);
        free(board->avr);
        board_uart_detach(&board->uart);
    }
    if (complaining == board) {
        complaining = NULL;
    }
    board_elf_free(board->elf);
    free(board);
}

static avr_cycle_count_t on_stop(avr_t *avr, avr_cycle_count_t when, void *param)
{
    board_t *board = param;
    (void)avr;
    (void)when;
    board->stop_now = true;
    return 0;
}

board_state_t board_state(const board_t *board)
{
    switch (board->avr->state) {
    case cpu_Crashed:
    case cpu_Stopped:
        return BOARD_CRASHED;
    case cpu_Done:
        return BOARD_ASLEEP;
    default:
        return BOARD_RUNNING;
    }
}

static void step_core(board_t *board)
{
    board->avr->run(board->avr);
    if (board->reset_seen) {
        after_reset(board, WDRF); /* only the watchdog resets from inside */
    }
}

board_state_t board_run_until(board_t *board, uint64_t cycle)
{
    avr_t *avr = board->avr;
    complaining = board;
    while (avr->cycle < cycle && board_state(board) == BOARD_RUNNING) {
        board->stop_now = false;
        avr_cycle_timer_register(avr, cycle - avr->cycle, on_stop, board);
        while (!board->stop_now && avr->cycle < cycle && board_state(board) == BOARD_RUNNING) {
            unsigned resets = board->resets;
            step_core(board);
            if (board->resets != resets) {
                break; /* the stop timer went with the reset */
            }
        }
    }
    avr_cycle_timer_cancel(avr, on_stop, board);
    handle_events(board, avr->cycle);
    move_plant(board, avr->cycle);
    schedule(board);
    return board_state(board);
}

board_state_t board_run_ms(board_t *board, double ms)
{
    return board_run_until(board, board->avr->cycle + (uint64_t)(ms * BOARD_CYCLES_PER_MS));
}

uint64_t board_cycle(const board_t *board)
{
    return board->avr->cycle;
}

double board_time_s(const board_t *board)
{
    return (double)board->avr->cycle / BOARD_FREQUENCY_HZ;
}

const char *board_complaint(const board_t *board)
{
    return board->complaint;
}

void board_reset(board_t *board, board_reset_t cause)
{
    static const uint8_t flag[] = {[BOARD_RESET_POWER_ON] = PORF,
                                   [BOARD_RESET_EXTERNAL] = EXTRF,
                                   [BOARD_RESET_BROWN_OUT] = BORF,
                                   [BOARD_RESET_WATCHDOG] = WDRF};
    complaining = board;
    handle_events(board, board->avr->cycle);
    if (cause == BOARD_RESET_POWER_ON || cause == BOARD_RESET_BROWN_OUT) {
        board_eeprom_power_cut(&board->eeprom);
    }
    avr_reset(board->avr);
    if (cause == BOARD_RESET_POWER_ON) {
        board->reset_flags = 0;
        fill_ram(board);
        sensors_power_on(board);
    }
    after_reset(board, flag[cause]);
    move_plant(board, board->avr->cycle);
    schedule(board);
}

void board_hold_plant(board_t *board, bool held)
{
    handle_events(board, board->avr->cycle);
    move_plant(board, board->avr->cycle);
    board->plant_held = held;
    for (unsigned k = 0; k < BOARD_CHANNELS && held; k++) {
        board->current_a[k] = 0.0;
        board->voltage_v[k] = 0.0;
    }
    board->plant_cycle = board->avr->cycle;
    move_plant(board, board->avr->cycle);
    schedule(board);
}

void board_hang(board_t *board)
{
    static const uint8_t jump_to_itself[2] = {0xFF, 0xCF};
    avr_t *avr = board->avr;
    if (!board->hanging) {
        board->hanging = true;
        board->hang_address = avr->pc;
        memcpy(board->hang_opcode, avr->flash + avr->pc, sizeof board->hang_opcode);
        memcpy(avr->flash + avr->pc, jump_to_itself, sizeof jump_to_itself);
    }
}

unsigned board_reset_count(const board_t *board)
{
    return board->resets;
}

/* --- what the world does to the board and sees of it --- */

void board_send(board_t *board, const void *bytes, size_t count)
{
    (void)board_uart_send(&board->uart, bytes, count);
}

size_t board_send_backlog(const board_t *board)
{
    return board_uart_backlog(&board->uart);
}

uint64_t board_uart_overruns(const board_t *board)
{
    return board->uart.overruns;
}

double board_duty(const board_t *board, unsigned channel)
{
    return board->pwm.duty[channel];
}

bool board_all_off(const board_t *board)
{
    return !board->pwm.any_on;
}

uint64_t board_all_off_since(const board_t *board)
{
    return board->pwm.off_cycle;
}

double board_fan(const board_t *board)
{
    return board_pwm_fan(&board->pwm);
}

double board_current_a(const board_t *board, unsigned channel)
{
    return board->current_a[channel];
}

void board_set_fault(board_t *board, board_fault_t fault, unsigned channel, bool on)
{
    plant_fault_t wanted = fault == BOARD_FAULT_OPEN ? PLANT_FAULT_OPEN : PLANT_FAULT_SHORT;
    handle_events(board, board->avr->cycle);
    switch (fault) {
    case BOARD_FAULT_OPEN:
    case BOARD_FAULT_SHORT:
        if (board->plant != NULL && channel < board->springs) {
            (void)plant_set_fault(board->plant, (int)channel, on ? wanted : PLANT_FAULT_NONE);
        }
        break;
    case BOARD_FAULT_NACK:
        board->sensor[channel].absent = on;
        break;
    case BOARD_FAULT_STALE:
        board->sensor[channel].frozen = on;
        break;
    case BOARD_FAULT_SDA_LOW:
        board_twi_hold_sda(&board->twi, on);
        break;
    case BOARD_FAULT_EEPROM:
        board->eeprom.worn = on;
        break;
    case BOARD_FAULT_FAN:
        board->fan_stopped = on;
        break;
    }
    move_plant(board, board->avr->cycle);
    schedule(board);
}

void board_reset_sensor(board_t *board, unsigned channel)
{
    handle_events(board, board->avr->cycle);
    integrate_until(board, board->avr->cycle);
    ina219_inputs_t inputs = sensor_inputs(board, channel);
    ina219_power_on(&board->sensor[channel], &inputs);
    schedule(board);
}

uint16_t board_sensor_register(const board_t *board, unsigned channel, unsigned number)
{
    ina219_t copy = board->sensor[channel];
    copy.pointer = (uint8_t)number;
    copy.byte_count = 0;
    unsigned high = ina219_read(&copy);
    return (uint16_t)(high << 8 | ina219_read(&copy));
}

void board_set_analog_v(board_t *board, unsigned input, double volt)
{
    avr_irq_t *irq = avr_io_getirq(board->avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC0 + (int)input);
    avr_raise_irq(irq, (uint32_t)(volt * 1000.0 + 0.5));
}

uint8_t *board_eeprom(board_t *board)
{
    return board->eeprom.cell;
}

uint64_t board_eeprom_writes(const board_t *board)
{
    return board->eeprom.writes;
}

bool board_eeprom_busy(const board_t *board)
{
    return board->eeprom.writing;
}

const uint8_t *board_variable(const board_t *board, const char *symbol, uint32_t *size)
{
    const board_symbol_t *entry = board_elf_symbol(board->elf, symbol);
    if (entry == NULL || entry->address < BOARD_RAM_OFFSET ||
        entry->address + entry->size > BOARD_RAM_OFFSET + board->avr->ramend + 1u) {
        return NULL;
    }
    if (size != NULL) {
        *size = entry->size;
    }
    return board->avr->data + (entry->address - BOARD_RAM_OFFSET);
}

uint32_t board_flash_bytes(const board_t *board)
{
    return board->elf->flash_used;
}

uint32_t board_static_ram_bytes(const board_t *board)
{
    return board->elf->ram_static;
}

/* One past the heap, which an Arduino library may have used; avr-libc keeps it in __brkval, 0
 * before the first use. */
static unsigned heap_end(const board_t *board)
{
    unsigned statics_end = RAM_BEGIN + board->elf->ram_static;
    const uint8_t *variable = board_variable(board, "__brkval", NULL);
    unsigned end = variable != NULL ? variable[0] | (unsigned)variable[1] << 8 : 0;
    return end > statics_end ? end : statics_end;
}

uint32_t board_stack_high_water(const board_t *board)
{
    unsigned address = heap_end(board);
    while (address <= board->avr->ramend &&
           (board->avr->data[address] == garbage(board->options.seed, address) ||
            board->avr->data[address] == FIRMWARE_PAINT)) {
        address++;
    }
    return board->avr->ramend + 1u - address;
}

uint64_t board_idle_cycles(const board_t *board)
{
    return board->idle_cycles;
}

/* --- counting cycles of a function --- */

typedef struct {
    bool inside;
    unsigned stack_pointer;
    unsigned nesting;        /* interrupt routines running when it began */
    uint64_t begun, foreign; /* cycles; those of interrupt routines */
} probe_t;

static unsigned stack_pointer(const avr_t *avr)
{
    return avr->data[R_SPL] | (unsigned)avr->data[R_SPH] << 8;
}

static void probe_left(const probe_t *probe, uint64_t now, board_measurement_t *result)
{
    uint64_t cycles = now - probe->begun - probe->foreign;
    result->calls++;
    result->total_cycles += cycles;
    if (result->calls == 1 || cycles < result->minimum_cycles) {
        result->minimum_cycles = cycles;
    }
    if (cycles > result->maximum_cycles) {
        result->maximum_cycles = cycles;
    }
}

bool board_measure(board_t *board, const char *function, unsigned calls, double limit_ms,
                   board_measurement_t *result)
{
    const board_symbol_t *symbol = board_elf_symbol(board->elf, function);
    avr_t *avr = board->avr;
    uint64_t limit = avr->cycle + (uint64_t)(limit_ms * BOARD_CYCLES_PER_MS);
    probe_t probe = {0};
    *result = (board_measurement_t){0};
    if (symbol == NULL) {
        return false;
    }
    complaining = board;
    while (result->calls < calls && avr->cycle < limit && board_state(board) == BOARD_RUNNING) {
        avr->run_cycle_limit = 1;
        avr->run_cycle_count = 1;
        if (probe.inside && stack_pointer(avr) > probe.stack_pointer) {
            probe_left(&probe, avr->cycle, result);
            probe.inside = false;
        }
        if (!probe.inside && avr->pc == symbol->address) {
            probe = (probe_t){.inside = true,
                              .stack_pointer = stack_pointer(avr),
                              .nesting = avr->interrupts.running_ptr,
                              .begun = avr->cycle};
        }
        uint64_t before = avr->cycle;
        bool foreign = probe.inside && avr->interrupts.running_ptr > probe.nesting;
        step_core(board);
        if (foreign) {
            probe.foreign += avr->cycle - before;
        }
    }
    avr->run_cycle_limit = RUN_CYCLES_LIMIT;
    return true;
}
