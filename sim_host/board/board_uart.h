/* What it is for: the Mega's USART0 with a real one's timing: 2-byte receive buffer, overrun,
 * double-buffered transmitter.
 * What it owns: UCSR0A, UCSR0B, UDR0 of the simulated chip, and the bytes on their way to it.
 * What it never does: open a terminal; simavr 1.6's model buffers 64 bytes, loses none, and counts
 * 11 bits a byte. Source: ATmega2560 data sheet, section 22. */
#ifndef BOARD_UART_H
#define BOARD_UART_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <simavr/sim_avr.h>

#ifdef __cplusplus
extern "C" {
#endif

#define BOARD_UART_BAUD   115200u /* of the partner: fixed */
#define BOARD_UART_BUFFER 3       /* the receive buffer's two bytes and the shift register */

typedef void (*board_uart_sink_t)(void *context, uint64_t cycle, uint8_t byte);

typedef struct {
    avr_t *avr;
    avr_int_vector_t *receive_vector;
    avr_int_vector_t *empty_vector;
    avr_int_vector_t *transmit_vector;
    board_uart_sink_t sink;
    void *sink_context;
    /* towards the chip */
    uint8_t *queue; /* bytes the partner has yet to send */
    size_t queue_size, queue_begin, queue_end;
    bool receiving;
    uint8_t buffer[BOARD_UART_BUFFER];
    uint8_t buffered;
    uint64_t overruns; /* bytes lost because the firmware did not read in time */
    /* from the chip */
    bool transmitting;
    bool waiting;
    uint8_t shift, next;
} board_uart_t;

void board_uart_attach(board_uart_t *uart, avr_t *avr, board_uart_sink_t sink, void *context);
void board_uart_detach(board_uart_t *uart);
void board_uart_reset(board_uart_t *uart);
/* The partner sends these bytes, one after another, at its baud rate. Fails (false) if and only if
 * memory is out. */
bool board_uart_send(board_uart_t *uart, const uint8_t *bytes, size_t count);
/* Bytes the partner has yet to send. */
size_t board_uart_backlog(const board_uart_t *uart);

#ifdef __cplusplus
}
#endif
#endif
