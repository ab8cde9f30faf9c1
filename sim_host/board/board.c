#include "board.h"

#include <simavr/avr_adc.h>
#include <simavr/avr_extint.h>
#include <simavr/avr_ioport.h>
#include <simavr/sim_cycle_timers.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "board_internal.h"
#include "board_registers.h"

#define SUPPLY_MV     5000u
#define REGISTER_PIND 0x29u
#define I2C_PINS      0x03u /* PD0 SCL, PD1 SDA: pulled up */
#define RAM_BEGIN     0x200u
#define PORF          0x01u
#define EXTRF         0x02u
#define BORF          0x04u
#define WDRF          0x08u

#ifdef __SANITIZE_ADDRESS__
/* simavr 1.6 gives back neither its IRQs nor their names. */
const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void)
{
    return "leak:libsimavr";
}
#endif

/* --- the core --- */

static board_t *complaining; /* simavr's logger has no context: whose core is running */

void board_take_complaints(board_t *board)
{
    complaining = board;
}

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
    avr->run_cycle_limit = BOARD_RUN_CYCLES_LIMIT;
    for (uint8_t k = 0; k < EXTINT_COUNT; k++) {
        /* Else a low pin that could be an interrupt, as outputs 2 and 3 could, is looked at in
         * every cycle. */
        avr_extint_set_strict_lvl_trig(avr, k, 0);
    }
    board_twi_reset(&board->twi);
    board_uart_reset(&board->uart);
    board_eeprom_reset(&board->eeprom);
    board->oscillator_stopped = false;
    board_enable_changed(board);
    board_pwm_update(&board->pwm);
    board_schedule(board);
    if (board->twi.sda_stuck_low) {
        board_twi_hold_sda(&board->twi, true);
    }
}

static void port_b_changed(struct avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq;
    (void)value;
    board_enable_changed(param);
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

    const board_twi_devices_t devices = {board, board_sensor_begin, board_sensor_write,
                                         board_sensor_read};
    avr_ioport_external_t pull_up = {.name = 'D', .mask = I2C_PINS, .value = I2C_PINS};
    avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('D'), &pull_up);
    board_twi_attach(&board->twi, avr, &devices);
    board_uart_attach(&board->uart, avr, uart_byte, board);
    board_eeprom_attach(&board->eeprom, avr);
    board_pwm_attach(&board->pwm, avr, board_pwm_changed, board);
    avr_irq_t *port_b = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), 0);
    avr_irq_register_notify(port_b + IOPORT_IRQ_REG_PORT, port_b_changed, board);
    avr_irq_register_notify(port_b + IOPORT_IRQ_DIRECTION_ALL, port_b_changed, board);
    board_take_register(avr, REGISTER_GPIOR0, NULL, write_mark, board);
    board_take_register(avr, REGISTER_GPIOR1, NULL, write_mark, board);
    board_take_register(avr, REGISTER_GPIOR2, NULL, write_mark, board);
    board_take_register(avr, REGISTER_MCUSR, NULL, write_reset_flags, board);
    return true;
}

board_t *board_create(const board_options_t *options, char *error, size_t error_size)
{
    int springs = options->array != NULL   ? (int)options->array->springs
                  : options->plant != NULL ? plant_spring_count(options->plant)
                                           : 0;
    if (springs > BOARD_CHANNELS) {
        snprintf(error, error_size, "the board drives %d springs, the array has %d", BOARD_CHANNELS,
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
    if (options->array != NULL) {
        board->array = *options->array;
        board->springs = options->array->springs;
    }
    if (options->bus != NULL) {
        board->bus = *options->bus;
    }
    complaining = board;
    avr_global_logger_set(on_log);
    if (!make_core(board)) {
        snprintf(error, error_size, "libsimavr knows no atmega2560");
        board_destroy(board);
        return NULL;
    }
    for (unsigned k = 0; k < BOARD_CHANNELS; k++) {
        board->stage_of_sensor[k] = k;
        board->pin_of_stage[k] = k;
        board->sensor[k].shunt_noise_v = options->shunt_noise_v;
        board->sensor[k].bus_noise_v = options->bus_noise_v;
        electrics_noise_seed(&board->sensor[k].noise, options->seed + k);
    }
    board_fill_ram(board);
    board_move_plant(board, 0);
    board_sensors_power_on(board);
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

void board_step_core(board_t *board)
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
    if (board->oscillator_stopped) { /* the world goes on without the core */
        board_handle_events(board, cycle);
        avr->cycle = cycle;
    }
    while (avr->cycle < cycle && board_state(board) == BOARD_RUNNING) {
        board->stop_now = false;
        avr_cycle_timer_register(avr, cycle - avr->cycle, on_stop, board);
        while (!board->stop_now && avr->cycle < cycle && board_state(board) == BOARD_RUNNING) {
            unsigned resets = board->resets;
            board_step_core(board);
            if (board->resets != resets) {
                break; /* the stop timer went with the reset */
            }
        }
    }
    avr_cycle_timer_cancel(avr, on_stop, board);
    board_handle_events(board, avr->cycle);
    board_move_plant(board, avr->cycle);
    board_schedule(board);
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
    board_handle_events(board, board->avr->cycle);
    if (cause == BOARD_RESET_POWER_ON || cause == BOARD_RESET_BROWN_OUT) {
        board_eeprom_power_cut(&board->eeprom);
    }
    avr_reset(board->avr);
    if (cause == BOARD_RESET_POWER_ON) {
        board->reset_flags = 0;
        board_fill_ram(board);
        board_sensors_power_on(board);
    }
    after_reset(board, flag[cause]);
    board_move_plant(board, board->avr->cycle);
    board_schedule(board);
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

void board_stop_oscillator(board_t *board)
{
    board_handle_events(board, board->avr->cycle);
    board->oscillator_stopped = true;
    board_move_plant(board, board->avr->cycle);
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

bool board_raise_interrupt(board_t *board, unsigned vector)
{
    avr_t *avr = board->avr;
    for (unsigned k = 0; k < avr->interrupts.vector_count; k++) {
        avr_int_vector_t *one = avr->interrupts.vector[k];
        if (one->vector == vector) {
            (void)avr_regbit_set(avr, one->enable);
            (void)avr_raise_interrupt(avr, one);
            return true;
        }
    }
    return false;
}

uint8_t board_register(const board_t *board, unsigned address)
{
    return board->avr->data[address];
}

void board_flip(board_t *board, unsigned address, uint8_t bits)
{
    avr_t *avr = board->avr;
    const uint8_t value = avr->data[address] ^ bits;
    complaining = board;
    board_handle_events(board, avr->cycle);
    if (address >= RAM_BEGIN) {
        avr->data[address] = value;
        return;
    }
    const avr_io_addr_t io = (avr_io_addr_t)AVR_DATA_TO_IO(address);
    const bool is_known = io < sizeof avr->io / sizeof avr->io[0]; /* reserved ones lie beyond */
    if (!board_pwm_poke(&board->pwm, address, value) && is_known && avr->io[io].w.c != NULL) {
        avr->io[io].w.c(avr, (avr_io_addr_t)address, value, avr->io[io].w.param);
    } else {
        avr->data[address] = value;
    }
    board_pwm_update(&board->pwm);
    board_schedule(board);
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
