/* What it is for: programs that run on the simulated Mega: they say what they found over the
 * serial port.
 * What it owns: USART0, GPIOR0 as the mark from which the runner counts cycles, GPIOR1 as that at
 * which it keeps the variables.
 * What it never does: decide whether a figure is good; that is the runner's. */
#ifndef REPORT_H
#define REPORT_H

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <stdint.h>

static void report_text(const char *text)
{
    UCSR0B = 1 << TXEN0;
    while (*text != 0) {
        while ((UCSR0A & (1 << UDRE0)) == 0) {
        }
        UDR0 = (uint8_t)*text++;
    }
}

static inline void report_number(uint32_t value)
{
    char digits[11];
    uint8_t k = 10;
    digits[10] = 0;
    do {
        digits[--k] = (char)('0' + value % 10u);
        value /= 10u;
    } while (value != 0);
    report_text(&digits[k]);
}

/* Cycles of what stands between COUNT(name) and COUNTED(), call included. */
#define COUNT(name)                                                                                \
    report_text("@" name "\n");                                                                    \
    __asm__ volatile("" ::: "memory");                                                             \
    GPIOR0 = 1
#define COUNTED()                                                                                  \
    GPIOR0 = 0;                                                                                    \
    __asm__ volatile("" ::: "memory")

/* All variables with a static place are afterwards what they were: the runner keeps them. */
#define KEEP_VARIABLES()                                                                           \
    __asm__ volatile("" ::: "memory");                                                             \
    GPIOR1 = 1
#define PUT_BACK_VARIABLES()                                                                       \
    GPIOR1 = 2;                                                                                    \
    __asm__ volatile("" ::: "memory")

/* Ends the program: the runner sees a sleep with interrupts off. */
static inline void report_end(uint8_t failures)
{
    report_text(failures == 0 ? "PASS\n" : "FAIL\n");
    while ((UCSR0A & (1 << UDRE0)) == 0) {
    }
    cli();
    sleep_enable();
    sleep_cpu();
}

#endif
