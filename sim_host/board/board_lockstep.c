#include "board_internal.h"

#include <simavr/sim_cycle_timers.h>

#include "electrics.h"

#define SENSOR_ADDRESS 0x40u
/* The plant moves at most this often: springs need seconds to warm, so what it takes is little
 * (bench/board). */
#define PLANT_PERIOD_CYCLES BOARD_CYCLES_PER_MS

static void integrate_until(board_t *board, uint64_t cycle)
{
    if (cycle <= board->synchronised_cycle) {
        return;
    }
    double cycles = (double)(cycle - board->synchronised_cycle);
    for (unsigned k = 0; k < BOARD_CHANNELS; k++) {
        unsigned stage = board->stage_of_sensor[k];
        board->shunt_v_cycles[k] += board->current_a[stage] * ELECTRICS_INA219_SHUNT_OHM * cycles;
        board->bus_v_cycles[k] += board->voltage_v[stage] * cycles;
    }
    board->synchronised_cycle = cycle;
}

static ina219_inputs_t sensor_inputs(const board_t *board, unsigned k)
{
    return (ina219_inputs_t){board->synchronised_cycle, board->shunt_v_cycles[k],
                             board->bus_v_cycles[k]};
}

#define DDRB           0x24u
#define PORTB          0x25u
#define ENABLE_BIT     6u
#define ENABLE_LEAST_S 50e-6 /* a pulse that is shorter moves too little charge */

void board_enable_changed(board_t *board)
{
    const uint8_t *data = board->avr->data;
    const uint64_t now = board->avr->cycle;
    bool high = (data[DDRB] & data[PORTB]) >> ENABLE_BIT & 1u;
    high = (high || board->enable_high_fault) && !board->enable_low_fault;
    if (high == board->enable_high) {
        return;
    }
    if (!high && (double)(now - board->enable_since_cycle) >= ENABLE_LEAST_S * BOARD_FREQUENCY_HZ) {
        electrics_cut_off_pulse(&board->cut_off, (double)now / BOARD_FREQUENCY_HZ);
    }
    board->cut_off.high = high;
    board->cut_off.rose_s = (double)now / BOARD_FREQUENCY_HZ;
    board->enable_high = high;
    board->enable_since_cycle = now;
}

static bool is_fed(const board_t *board, uint64_t cycle)
{
    return board->options.without_cut_off ||
           electrics_cut_off_is_closed(&board->cut_off, (double)cycle / BOARD_FREQUENCY_HZ);
}

bool board_is_fed(const board_t *board)
{
    return is_fed(board, board->avr->cycle);
}

static double switched_on(const board_t *board, unsigned k)
{
    const double duty = board->gate_open[k] ? 0.0 : board->pwm.duty[board->pin_of_stage[k]];
    if (board->switch_closed[k] || (board->oscillator_stopped && duty > 0.0)) {
        return 1.0;
    }
    return duty;
}

static double fan_of(const board_t *board)
{
    return board->fan_stopped ? 0.0 : board_pwm_fan(&board->pwm);
}

static void move_array(board_t *board, double seconds, bool fed)
{
    const board_array_t *array = &board->array;
    if (seconds > 0.0) {
        array->step(array->context, seconds);
    }
    array->fan(array->context, fan_of(board));
    if (array->feed != NULL) {
        array->feed(array->context, fed);
    }
    for (unsigned k = 0; k < board->springs; k++) {
        array->drive(array->context, k, fed ? switched_on(board, k) : 0.0);
        board->current_a[k] = array->current_a(array->context, k);
        board->voltage_v[k] = array->voltage_v(array->context, k);
    }
}

static void move_plant(board_t *board, double seconds, bool fed)
{
    if (seconds > 0.0) {
        (void)plant_step(board->plant, seconds);
    }
    for (unsigned k = 0; k < board->springs; k++) {
        (void)plant_drive(board->plant, (int)k, PLANT_DRIVE_DUTY,
                          fed ? switched_on(board, k) : 0.0);
    }
    (void)plant_set_fan(board->plant, fan_of(board));
    for (unsigned k = 0; k < board->springs; k++) {
        board->current_a[k] = plant_current_a(board->plant, (int)k);
        board->voltage_v[k] = plant_voltage_v(board->plant, (int)k);
    }
}

void board_move_plant(board_t *board, uint64_t cycle)
{
    integrate_until(board, cycle);
    board->next_plant_cycle = cycle + PLANT_PERIOD_CYCLES;
    const bool is_array = board->array.step != NULL;
    if ((board->plant == NULL && !is_array) || board->plant_held) {
        return;
    }
    double seconds = 0.0;
    if (cycle > board->plant_cycle) {
        seconds = (double)(cycle - board->plant_cycle) / BOARD_FREQUENCY_HZ;
        board->plant_cycle = cycle;
    }
    if (is_array) {
        move_array(board, seconds, is_fed(board, cycle));
    } else {
        move_plant(board, seconds, is_fed(board, cycle));
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

void board_handle_events(board_t *board, uint64_t now)
{
    uint64_t event = next_event(board);
    while (event <= now) {
        if (event == board->next_plant_cycle) {
            board_move_plant(board, event);
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
    board_handle_events(board, when);
    return next_event(board);
}

void board_schedule(board_t *board)
{
    uint64_t next = next_event(board);
    uint64_t now = board->avr->cycle;
    avr_cycle_timer_register(board->avr, next > now ? next - now : 1, on_event, board);
}

/* A compare register takes effect at the next PWM period: one move of the plant serves all nine. */
void board_pwm_changed(void *context)
{
    board_t *board = context;
    uint64_t period = BOARD_PWM_PERIOD_CYCLES;
    uint64_t next = (board->avr->cycle / period + 1u) * period;
    if (next < board->next_plant_cycle) {
        board->next_plant_cycle = next;
        board_schedule(board);
    }
}

/* --- the sensors on the bus --- */

static ina219_t *sensor_at(board_t *board, uint8_t address)
{
    unsigned k = (unsigned)address - SENSOR_ADDRESS;
    return address >= SENSOR_ADDRESS && k < BOARD_CHANNELS ? &board->sensor[k] : NULL;
}

bool board_sensor_begin(void *context, uint8_t address, bool read)
{
    const board_t *board = context;
    ina219_t *sensor = sensor_at(context, address);
    if (sensor == NULL || !ina219_begin(sensor, read)) {
        return false;
    }
    return board->bus.acknowledges == NULL ||
           board->bus.acknowledges(board->bus.context, address - SENSOR_ADDRESS);
}

void board_sensor_write(void *context, uint8_t address, uint8_t byte)
{
    board_t *board = context;
    ina219_t *sensor = sensor_at(board, address);
    board_handle_events(board, board->avr->cycle);
    integrate_until(board, board->avr->cycle);
    ina219_inputs_t inputs = sensor_inputs(board, (unsigned)(sensor - board->sensor));
    uint64_t before = sensor->conversion_end_cycle;
    ina219_write(sensor, byte, &inputs);
    if (sensor->conversion_end_cycle != before) {
        board_schedule(board);
    }
}

uint8_t board_sensor_read(void *context, uint8_t address)
{
    board_t *board = context;
    board_handle_events(board, board->avr->cycle);
    ina219_t *const sensor = sensor_at(board, address);
    const bool first = sensor->byte_count == 0;
    const uint8_t byte = ina219_read(sensor);
    if (!first || board->bus.reads == NULL) {
        return byte;
    }
    sensor->shift = board->bus.reads(board->bus.context, address - SENSOR_ADDRESS, sensor->pointer,
                                     sensor->shift); /* both bytes come of it */
    return (uint8_t)(sensor->shift >> 8);
}

void board_sensors_power_on(board_t *board)
{
    integrate_until(board, board->avr->cycle);
    for (unsigned k = 0; k < BOARD_CHANNELS; k++) {
        ina219_inputs_t inputs = sensor_inputs(board, k);
        ina219_power_on(&board->sensor[k], &inputs);
    }
}

void board_hold_plant(board_t *board, bool held)
{
    board_handle_events(board, board->avr->cycle);
    board_move_plant(board, board->avr->cycle);
    board->plant_held = held;
    for (unsigned k = 0; k < BOARD_CHANNELS && held; k++) {
        board->current_a[k] = 0.0;
        board->voltage_v[k] = 0.0;
    }
    board->plant_cycle = board->avr->cycle;
    board_move_plant(board, board->avr->cycle);
    board_schedule(board);
}

double board_current_a(const board_t *board, unsigned channel)
{
    return board->current_a[channel];
}

static plant_fault_t fault_of_spring(board_fault_t fault, bool on)
{
    if (!on) {
        return PLANT_FAULT_NONE;
    }
    switch (fault) {
    case BOARD_FAULT_OPEN:
        return PLANT_FAULT_OPEN;
    case BOARD_FAULT_RESISTOR:
        return PLANT_FAULT_RESISTOR;
    default:
        return PLANT_FAULT_SHORT;
    }
}

void board_set_fault(board_t *board, board_fault_t fault, unsigned channel, bool on)
{
    const plant_fault_t wanted = fault_of_spring(fault, on);
    board_handle_events(board, board->avr->cycle);
    switch (fault) {
    case BOARD_FAULT_OPEN:
    case BOARD_FAULT_SHORT:
    case BOARD_FAULT_RESISTOR:
        if (board->array.step != NULL && channel < board->springs) {
            board->array.fault(board->array.context, channel, wanted);
        } else if (board->plant != NULL && channel < board->springs) {
            (void)plant_set_fault(board->plant, (int)channel, wanted);
        }
        break;
    case BOARD_FAULT_GATE:
        board->gate_open[channel] = on;
        break;
    case BOARD_FAULT_CLOSED:
        board->switch_closed[channel] = on;
        break;
    case BOARD_FAULT_NACK:
        board->sensor[channel].absent = on;
        break;
    case BOARD_FAULT_STALE:
        board->sensor[channel].stale = on;
        break;
    case BOARD_FAULT_FREEZE:
        board->sensor[channel].shunt_frozen = board->sensor[channel].bus_frozen = on;
        break;
    case BOARD_FAULT_FREEZE_CURRENT:
        board->sensor[channel].shunt_frozen = on;
        break;
    case BOARD_FAULT_FREEZE_VOLTAGE:
        board->sensor[channel].bus_frozen = on;
        break;
    case BOARD_FAULT_SDA_LOW:
        board_twi_hold_sda(&board->twi, on);
        break;
    case BOARD_FAULT_EEPROM:
        board->eeprom.worn = on;
        break;
    case BOARD_FAULT_ENABLE_LOW:
        board->enable_low_fault = on;
        board_enable_changed(board);
        break;
    case BOARD_FAULT_ENABLE_HIGH:
        board->enable_high_fault = on;
        board_enable_changed(board);
        break;
    case BOARD_FAULT_FAN:
        board->fan_stopped = on;
        break;
    }
    board_move_plant(board, board->avr->cycle);
    board_schedule(board);
}

void board_scale_sensor(board_t *board, unsigned channel, double current_scale,
                        double voltage_scale)
{
    board_handle_events(board, board->avr->cycle);
    board->sensor[channel].shunt_gain_error = current_scale - 1.0;
    board->sensor[channel].bus_gain_error = voltage_scale - 1.0;
}

void board_swap_sensors(board_t *board, unsigned a, unsigned b)
{
    board_handle_events(board, board->avr->cycle);
    integrate_until(board, board->avr->cycle);
    unsigned stage = board->stage_of_sensor[a];
    board->stage_of_sensor[a] = board->stage_of_sensor[b];
    board->stage_of_sensor[b] = stage;
}

void board_swap_gates(board_t *board, unsigned a, unsigned b)
{
    board_handle_events(board, board->avr->cycle);
    const unsigned pin = board->pin_of_stage[a];
    board->pin_of_stage[a] = board->pin_of_stage[b];
    board->pin_of_stage[b] = pin;
    board_move_plant(board, board->avr->cycle);
    board_schedule(board);
}

void board_stretch_bus(board_t *board, double factor)
{
    board->twi.stretch = factor;
}

void board_reset_sensor(board_t *board, unsigned channel)
{
    board_handle_events(board, board->avr->cycle);
    integrate_until(board, board->avr->cycle);
    ina219_inputs_t inputs = sensor_inputs(board, channel);
    ina219_power_on(&board->sensor[channel], &inputs);
    board_schedule(board);
}

uint16_t board_sensor_register(const board_t *board, unsigned channel, unsigned number)
{
    ina219_t copy = board->sensor[channel];
    copy.pointer = (uint8_t)number;
    copy.byte_count = 0;
    unsigned high = ina219_read(&copy);
    return (uint16_t)(high << 8 | ina219_read(&copy));
}
