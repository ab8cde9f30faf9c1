#include "board_twi.h"

#include <simavr/avr_ioport.h>
#include <stddef.h>

#include "board_registers.h"

#define TWINT 0x80u
#define TWEA  0x40u
#define TWSTA 0x20u
#define TWSTO 0x10u
#define TWEN  0x04u

#define STATUS_START              0x08u
#define STATUS_REPEATED_START     0x10u
#define STATUS_WRITE_ADDRESS_ACK  0x18u
#define STATUS_WRITE_ADDRESS_NACK 0x20u
#define STATUS_WRITE_DATA_ACK     0x28u
#define STATUS_WRITE_DATA_NACK    0x30u
#define STATUS_ARBITRATION_LOST   0x38u
#define STATUS_READ_ADDRESS_ACK   0x40u
#define STATUS_READ_ADDRESS_NACK  0x48u
#define STATUS_READ_DATA_ACK      0x50u
#define STATUS_READ_DATA_NACK     0x58u
#define STATUS_NONE               0xF8u

static avr_cycle_count_t operation_done(avr_t *avr, avr_cycle_count_t when, void *param);

/* Data sheet, section 24.5.2: SCL = CPU clock / (16 + 2 TWBR 4^TWPS). */
static avr_cycle_count_t bit_cycles(const board_twi_t *twi)
{
    const uint8_t *data = twi->avr->data;
    const avr_cycle_count_t set = 16u + 2u * (avr_cycle_count_t)data[REGISTER_TWBR] *
                                            (1u << (2u * (data[REGISTER_TWSR] & 3u)));
    return twi->stretch > 1.0 ? (avr_cycle_count_t)((double)set * twi->stretch) : set;
}

static void begin(board_twi_t *twi, board_twi_operation_t operation, unsigned bits)
{
    twi->operation = operation;
    if (twi->sda_stuck_low && (operation == BOARD_TWI_START || operation == BOARD_TWI_STOP)) {
        avr_cycle_timer_cancel(twi->avr, operation_done, twi); /* goes on when SDA is released */
        return;
    }
    avr_cycle_timer_register(twi->avr, bits * bit_cycles(twi), operation_done, twi);
}

static void report(board_twi_t *twi, uint8_t status)
{
    uint8_t *data = twi->avr->data;
    data[REGISTER_TWSR] = (uint8_t)((data[REGISTER_TWSR] & 3u) | status);
    avr_raise_interrupt(twi->avr, twi->vector);
}

static void lose_arbitration(board_twi_t *twi)
{
    twi->owns_bus = false;
    twi->addressed = false;
    report(twi, STATUS_ARBITRATION_LOST);
}

static void address_done(board_twi_t *twi)
{
    uint8_t byte = twi->avr->data[REGISTER_TWDR];
    twi->fresh = false;
    if (twi->sda_stuck_low && byte != 0) {
        lose_arbitration(twi); /* sent a one, saw a zero */
        return;
    }
    twi->address = (uint8_t)(byte >> 1);
    twi->reading = (byte & 1u) != 0;
    twi->addressed = twi->devices.begin(twi->devices.context, twi->address, twi->reading);
    if (twi->reading) {
        report(twi, twi->addressed ? STATUS_READ_ADDRESS_ACK : STATUS_READ_ADDRESS_NACK);
    } else {
        report(twi, twi->addressed ? STATUS_WRITE_ADDRESS_ACK : STATUS_WRITE_ADDRESS_NACK);
    }
}

static void transmit_done(board_twi_t *twi)
{
    uint8_t byte = twi->avr->data[REGISTER_TWDR];
    if (twi->sda_stuck_low && byte != 0) {
        lose_arbitration(twi);
        return;
    }
    if (twi->addressed) {
        twi->devices.write(twi->devices.context, twi->address, byte);
    }
    report(twi, twi->addressed ? STATUS_WRITE_DATA_ACK : STATUS_WRITE_DATA_NACK);
}

static void receive_done(board_twi_t *twi)
{
    uint8_t byte = twi->addressed ? twi->devices.read(twi->devices.context, twi->address) : 0xFFu;
    twi->avr->data[REGISTER_TWDR] = twi->sda_stuck_low ? 0 : byte;
    report(twi, twi->acknowledge ? STATUS_READ_DATA_ACK : STATUS_READ_DATA_NACK);
}

static avr_cycle_count_t operation_done(avr_t *avr, avr_cycle_count_t when, void *param)
{
    board_twi_t *twi = param;
    board_twi_operation_t operation = twi->operation;
    (void)when;
    twi->operation = BOARD_TWI_NOTHING;
    switch (operation) {
    case BOARD_TWI_START:
        report(twi, twi->owns_bus ? STATUS_REPEATED_START : STATUS_START);
        twi->owns_bus = true;
        twi->fresh = true;
        break;
    case BOARD_TWI_STOP:
        twi->owns_bus = false;
        twi->addressed = false;
        avr->data[REGISTER_TWCR] &= (uint8_t)~TWSTO;
        if (twi->start_follows_stop) {
            begin(twi, BOARD_TWI_START, 1);
        }
        break;
    case BOARD_TWI_ADDRESS:
        address_done(twi);
        break;
    case BOARD_TWI_TRANSMIT:
        transmit_done(twi);
        break;
    case BOARD_TWI_RECEIVE:
        receive_done(twi);
        break;
    case BOARD_TWI_NOTHING:
        break;
    }
    return 0;
}

static void go_on(board_twi_t *twi, uint8_t control)
{
    bool start = (control & TWSTA) != 0;
    if ((control & TWSTO) != 0) {
        twi->start_follows_stop = start;
        begin(twi, BOARD_TWI_STOP, 2);
    } else if (start) {
        begin(twi, BOARD_TWI_START, 1);
    } else if (twi->owns_bus && twi->fresh) {
        begin(twi, BOARD_TWI_ADDRESS, 9);
    } else if (twi->owns_bus && twi->reading) {
        twi->acknowledge = (control & TWEA) != 0;
        begin(twi, BOARD_TWI_RECEIVE, 9);
    } else if (twi->owns_bus) {
        begin(twi, BOARD_TWI_TRANSMIT, 9);
    }
}

static void switch_off(board_twi_t *twi)
{
    avr_cycle_timer_cancel(twi->avr, operation_done, twi);
    avr_clear_interrupt(twi->avr, twi->vector);
    twi->operation = BOARD_TWI_NOTHING;
    twi->owns_bus = false;
    twi->addressed = false;
    twi->fresh = false;
    twi->start_follows_stop = false;
    twi->avr->data[REGISTER_TWSR] = (uint8_t)((twi->avr->data[REGISTER_TWSR] & 3u) | STATUS_NONE);
}

static void write_control(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    board_twi_t *twi = param;
    uint8_t flag = avr->data[address] & TWINT;
    bool clears = (value & TWINT) != 0;
    if ((value & TWEN) == 0) {
        avr->data[address] = (uint8_t)(value & ~(TWINT | TWSTO));
        switch_off(twi);
        return;
    }
    if (clears) {
        avr_clear_interrupt(avr, twi->vector);
        flag = 0;
    }
    avr->data[address] = (uint8_t)((value & ~TWINT) | flag);
    if (clears && twi->operation == BOARD_TWI_NOTHING) {
        go_on(twi, value);
    } else if (!clears && flag != 0) {
        avr_raise_interrupt(avr, twi->vector); /* TWIE may have been switched on just now */
    }
}

static void write_status(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    (void)param;
    avr->data[address] = (uint8_t)((avr->data[address] & 0xF8u) | (value & 3u));
}

void board_twi_attach(board_twi_t *twi, avr_t *avr, const board_twi_devices_t *devices)
{
    *twi = (board_twi_t){.avr = avr, .devices = *devices, .stretch = 1.0};
    twi->vector = board_find_vector(avr, VECTOR_TWI);
    board_take_register(avr, REGISTER_TWCR, NULL, write_control, twi);
    board_take_register(avr, REGISTER_TWDR, NULL, board_plain_write, NULL);
    board_take_register(avr, REGISTER_TWSR, NULL, write_status, twi);
    board_twi_reset(twi);
}

void board_twi_reset(board_twi_t *twi)
{
    switch_off(twi);
    twi->avr->data[REGISTER_TWSR] = STATUS_NONE;
    twi->avr->data[REGISTER_TWDR] = 0xFF;
}

void board_twi_hold_sda(board_twi_t *twi, bool low)
{
    avr_irq_t *sda = avr_io_getirq(twi->avr, AVR_IOCTL_IOPORT_GETIRQ('D'), IOPORT_IRQ_PIN1);
    twi->sda_stuck_low = low;
    avr_raise_irq(sda, low ? 0 : 1);
    if (!low && (twi->operation == BOARD_TWI_START || twi->operation == BOARD_TWI_STOP)) {
        begin(twi, twi->operation, 2);
    }
}
