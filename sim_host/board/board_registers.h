/* What it is for: addresses of the ATmega2560's registers that the board models itself, and how to
 * take them over.
 * What it owns: nothing.
 * What it never does: go through avr_register_io_write, which adds to simavr's own handler instead
 * of replacing it. */
#ifndef BOARD_REGISTERS_H
#define BOARD_REGISTERS_H

#include <simavr/sim_avr.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
    REGISTER_GPIOR0 = 0x3E,
    REGISTER_EECR = 0x3F,
    REGISTER_EEDR = 0x40,
    REGISTER_EEARL = 0x41,
    REGISTER_EEARH = 0x42,
    REGISTER_GPIOR1 = 0x4A,
    REGISTER_GPIOR2 = 0x4B,
    REGISTER_MCUSR = 0x54,
    REGISTER_TWBR = 0xB8,
    REGISTER_TWSR = 0xB9,
    REGISTER_TWDR = 0xBB,
    REGISTER_TWCR = 0xBC,
    REGISTER_UCSR0A = 0xC0,
    REGISTER_UCSR0B = 0xC1,
    REGISTER_UCSR0C = 0xC2,
    REGISTER_UBRR0L = 0xC4,
    REGISTER_UBRR0H = 0xC5,
    REGISTER_UDR0 = 0xC6
};

enum {
    VECTOR_USART0_RX = 25,
    VECTOR_USART0_UDRE = 26,
    VECTOR_USART0_TX = 27,
    VECTOR_EE_READY = 30,
    VECTOR_TWI = 39
};

avr_int_vector_t *board_find_vector(avr_t *avr, uint8_t number);
void board_take_register(avr_t *avr, avr_io_addr_t address, avr_io_read_t read,
                         avr_io_write_t write, void *param);
/* A write that only stores. */
void board_plain_write(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param);

#ifdef __cplusplus
}
#endif
#endif
