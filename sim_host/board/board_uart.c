#include "board_uart.h"

#include <stdlib.h>
#include <string.h>

#include "board_registers.h"

#define RXC           0x80u
#define TXC           0x40u
#define UDRE          0x20u
#define DOR           0x08u
#define U2X           0x02u
#define MPCM          0x01u
#define RXCIE         0x80u
#define UDRIE         0x20u
#define RXEN          0x10u
#define TXEN          0x08u
#define BITS_PER_BYTE 10u

static uint8_t *status(const board_uart_t *uart)
{
    return &uart->avr->data[REGISTER_UCSR0A];
}
static uint8_t control(const board_uart_t *uart)
{
    return uart->avr->data[REGISTER_UCSR0B];
}

static avr_cycle_count_t transmit_cycles(const board_uart_t *uart)
{
    const uint8_t *data = uart->avr->data;
    avr_cycle_count_t divider =
        1u + data[REGISTER_UBRR0L] + ((avr_cycle_count_t)(data[REGISTER_UBRR0H] & 0xFu) << 8);
    return BITS_PER_BYTE * divider * ((*status(uart) & U2X) != 0 ? 8u : 16u);
}

static avr_cycle_count_t receive_cycles(const board_uart_t *uart)
{
    return (avr_cycle_count_t)uart->avr->frequency * BITS_PER_BYTE / BOARD_UART_BAUD;
}

/* RXC and UDRE are levels: while they last their interrupts come again. */
static void raise_levels(board_uart_t *uart)
{
    if ((*status(uart) & RXC) != 0 && (control(uart) & RXCIE) != 0) {
        avr_raise_interrupt(uart->avr, uart->receive_vector);
    }
    if ((*status(uart) & UDRE) != 0 && (control(uart) & UDRIE) != 0) {
        avr_raise_interrupt(uart->avr, uart->empty_vector);
    }
}

static avr_cycle_count_t received(avr_t *avr, avr_cycle_count_t when, void *param)
{
    board_uart_t *uart = param;
    uint8_t byte = uart->queue[uart->queue_begin++];
    (void)avr;
    if ((control(uart) & RXEN) != 0) {
        if (uart->buffered < BOARD_UART_BUFFER) {
            uart->buffer[uart->buffered++] = byte;
            *status(uart) |= RXC;
        } else {
            uart->overruns++;
            *status(uart) |= DOR;
        }
        raise_levels(uart);
    }
    uart->receiving = uart->queue_begin != uart->queue_end;
    return uart->receiving ? when + receive_cycles(uart) : 0;
}

static uint8_t read_data(avr_t *avr, avr_io_addr_t address, void *param)
{
    board_uart_t *uart = param;
    uint8_t byte = 0;
    (void)address;
    if (uart->buffered > 0) {
        byte = uart->buffer[0];
        uart->buffered--;
        memmove(uart->buffer, uart->buffer + 1, uart->buffered);
    }
    *status(uart) &= (uint8_t)~DOR;
    avr_clear_interrupt(avr, uart->receive_vector);
    if (uart->buffered == 0) {
        *status(uart) &= (uint8_t)~RXC;
    }
    raise_levels(uart);
    return byte;
}

static avr_cycle_count_t transmitted(avr_t *avr, avr_cycle_count_t when, void *param)
{
    board_uart_t *uart = param;
    if (uart->sink != NULL) {
        uart->sink(uart->sink_context, avr->cycle, uart->shift);
    }
    if (uart->waiting) {
        uart->shift = uart->next;
        uart->waiting = false;
        *status(uart) |= UDRE;
        raise_levels(uart);
        return when + transmit_cycles(uart);
    }
    uart->transmitting = false;
    avr_raise_interrupt(avr, uart->transmit_vector);
    return 0;
}

static void write_data(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    board_uart_t *uart = param;
    (void)address;
    if ((control(uart) & TXEN) == 0 || uart->waiting) {
        return; /* the transmitter is off, or its buffer is full: the byte is lost */
    }
    avr_clear_interrupt(avr, uart->empty_vector);
    if (!uart->transmitting) {
        uart->transmitting = true;
        uart->shift = value;
        avr_cycle_timer_register(avr, transmit_cycles(uart), transmitted, uart);
        raise_levels(uart);
    } else {
        uart->waiting = true;
        uart->next = value;
        *status(uart) &= (uint8_t)~UDRE;
    }
}

static void write_status(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    board_uart_t *uart = param;
    uint8_t kept = (uint8_t)(avr->data[address] & ~(U2X | MPCM));
    if ((value & TXC) != 0) {
        avr_clear_interrupt(avr, uart->transmit_vector);
        kept &= (uint8_t)~TXC;
    }
    avr->data[address] = (uint8_t)(kept | (value & (U2X | MPCM)));
}

static void write_control(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    board_uart_t *uart = param;
    avr->data[address] = value;
    if ((value & RXEN) == 0) {
        uart->buffered = 0;
        *status(uart) &= (uint8_t) ~(RXC | DOR);
        avr_clear_interrupt(avr, uart->receive_vector);
    }
    raise_levels(uart);
}

void board_uart_attach(board_uart_t *uart, avr_t *avr, board_uart_sink_t sink, void *context)
{
    *uart = (board_uart_t){.avr = avr, .sink = sink, .sink_context = context};
    uart->receive_vector = board_find_vector(avr, VECTOR_USART0_RX);
    uart->empty_vector = board_find_vector(avr, VECTOR_USART0_UDRE);
    uart->transmit_vector = board_find_vector(avr, VECTOR_USART0_TX);
    board_take_register(avr, REGISTER_UDR0, read_data, write_data, uart);
    board_take_register(avr, REGISTER_UCSR0A, NULL, write_status, uart);
    board_take_register(avr, REGISTER_UCSR0B, NULL, write_control, uart);
    board_take_register(avr, REGISTER_UCSR0C, NULL, board_plain_write, NULL);
    board_take_register(avr, REGISTER_UBRR0L, NULL, board_plain_write, NULL);
    board_take_register(avr, REGISTER_UBRR0H, NULL, board_plain_write, NULL);
    board_uart_reset(uart);
}

void board_uart_detach(board_uart_t *uart)
{
    free(uart->queue);
    uart->queue = NULL;
}

void board_uart_reset(board_uart_t *uart)
{
    uart->buffered = 0;
    uart->transmitting = false;
    uart->waiting = false;
    uart->avr->data[REGISTER_UCSR0A] = UDRE;
    uart->avr->data[REGISTER_UCSR0B] = 0;
    uart->avr->data[REGISTER_UCSR0C] = 0x06;
    uart->receiving = uart->queue_begin != uart->queue_end; /* the partner goes on sending */
    if (uart->receiving) {
        avr_cycle_timer_register(uart->avr, receive_cycles(uart), received, uart);
    }
}

bool board_uart_send(board_uart_t *uart, const uint8_t *bytes, size_t count)
{
    if (uart->queue_begin == uart->queue_end) {
        uart->queue_begin = 0;
        uart->queue_end = 0;
    }
    if (count == 0) {
        return true;
    }
    if (uart->queue_end + count > uart->queue_size) {
        size_t size = 2 * (uart->queue_end + count);
        uint8_t *queue = realloc(uart->queue, size);
        if (queue == NULL) {
            return false;
        }
        uart->queue = queue;
        uart->queue_size = size;
    }
    memcpy(uart->queue + uart->queue_end, bytes, count);
    uart->queue_end += count;
    if (!uart->receiving) {
        uart->receiving = true;
        avr_cycle_timer_register(uart->avr, receive_cycles(uart), received, uart);
    }
    return true;
}

size_t board_uart_backlog(const board_uart_t *uart)
{
    return uart->queue_end - uart->queue_begin;
}
