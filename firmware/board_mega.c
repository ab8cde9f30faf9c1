#include "board.h"

#include <avr/eeprom.h>
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <stddef.h>
#include <util/delay.h>

#define SERIAL_RECEIVE_BYTES 128u /* 11 ms of input: more than the longest time away, a tick */
#define SERIAL_TRANSMIT_BYTES                                                                      \
    330u /* one telemetry line of nine springs (297), or an answer's line and room for another     \
            (256) */
#define PWM_TOP       (BOARD_DUTY_MAX - 1u)
#define COUNTS_PER_MS 250u /* of timer 2: 16 MHz / 64 */
#define US_PER_COUNT  4u
#define FAN_TOP       499u /* 16 MHz / 1024 / 500 = 31 Hz: right for a fan with two wires */

/* Fast PWM mode 14: WGMn1 in TCCRnA, WGMn3 and WGMn2 in TCCRnB; prescaler 1. */
#define PWM_A_OFF _BV(WGM31)
#define PWM_B     (_BV(WGM33) | _BV(WGM32) | _BV(CS30))
#define PWM_COM_A _BV(COM3A1)
#define PWM_COM_C _BV(COM3C1)
/* Of ports E (OC3A D5 PE3, OC3B D2 PE4, OC3C D3 PE5), H (OC4A D6 PH3, OC4B D7, OC4C D8) and L (OC5A
 * D46 PL3, OC5B D45, OC5C D44); fan OC1A D11 PB5. */
#define PWM_PINS (_BV(3) | _BV(4) | _BV(5))
#define FAN_PIN  _BV(5)
/* D12 PB6: to the cut-off's charge pump (hardware/circuit.py) */
#define SUPPLY_PIN      _BV(6)
#define SUPPLY_PULSE_US 100

#define SERIAL_RATE 16u /* 117647 baud with U2X, +2.1 %: the Mega's usual way to 115200 */
#define SERIAL_ON   (_BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0))
#define SERIAL_8N1  (_BV(UCSZ01) | _BV(UCSZ00))
#define ADC_ON      (_BV(ADEN) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0)) /* 125 kHz */

/* What survives a reset. start_check tells RAM that kept its content from RAM that woke up random.
 */
#define START_CHECK 0x9A5B1E27ul
#define BITTEN_MS   200u /* since the last kick: only the watchdog ended that */
static volatile uint32_t start_check __attribute__((section(".noinit")));
static volatile uint16_t ms_since_kick __attribute__((section(".noinit")));
static volatile uint8_t driving __attribute__((section(".noinit")));

static uint8_t reset_flags __attribute__((section(".noinit"))); /* MCUSR, read before main */
static uint8_t reset_cause;

static volatile uint32_t time_ms;
static volatile uint8_t ms_of_tick;
static volatile uint8_t ticks_due;

static volatile bool stop_pending;     /* outputs stay off while true */
static volatile uint8_t stop_received; /* '!' in a row, up to 2 */
static volatile uint8_t stop_head;     /* receive position of the last '!' */
static volatile bool stop_queued;      /* bytes before stop_head may still be queued */
static volatile bool status_requested;
static volatile bool receive_lost;

static volatile uint8_t receive_buffer[SERIAL_RECEIVE_BYTES];
static volatile uint8_t receive_head;
static volatile uint8_t receive_tail;
static volatile char transmit_buffer[SERIAL_TRANSMIT_BYTES];
static volatile uint16_t transmit_head;
static volatile uint16_t transmit_tail;

/* Before main and before RAM is initialised: the watchdog stays on through its own reset and would
 * bite again within 16 ms. */
static void read_reset_flags(void) __attribute__((naked, used, section(".init3")));
static void read_reset_flags(void)
{
    reset_flags = MCUSR;
    MCUSR = 0;
    wdt_disable();
}

/* Stack high-water mark: the free RAM is painted before main. In assembly, as nothing else is sure
 * to work in a function without a frame that paints where frames lie. */
#define STACK_PAINT 0xC5u
extern uint8_t __heap_start;
static void paint_stack(void) __attribute__((naked, used, section(".init3")));
static void paint_stack(void)
{
    __asm__ volatile("ldi r30, lo8(__heap_start)\n\t"
                     "ldi r31, hi8(__heap_start)\n\t"
                     "ldi r24, %0\n\t"
                     "ldi r25, hi8(%1)\n"
                     "1: st Z+, r24\n\t"
                     "cpi r30, lo8(%1)\n\t"
                     "cpc r31, r25\n\t"
                     "brlo 1b\n\t" ::"M"(STACK_PAINT),
                     "i"(RAMEND - 15)
                     : "r24", "r25", "r30", "r31", "memory");
}

uint16_t board_stack_unused(void)
{
    /* The longest run of painted bytes below the stack: locals that were never set stay painted
     * above it, and a library's heap grows over the paint from below. */
    uint16_t run = 0;
    uint16_t longest = 0;
    for (const uint8_t *at = &__heap_start; at < (const uint8_t *)SP; at++) {
        run = *at == STACK_PAINT ? run + 1u : 0u;
        if (run > longest) {
            longest = run;
        }
    }
    return longest;
}

/* --- reset -------------------------------------------------------------------------------- */

static uint8_t find_reset_cause(void)
{
    uint8_t cause = 0;
    const bool warm = start_check == START_CHECK && !(reset_flags & _BV(PORF));
    if (reset_flags & _BV(PORF)) {
        cause |= BOARD_RESET_POWER_ON;
    }
    if (reset_flags & _BV(EXTRF)) {
        cause |= BOARD_RESET_EXTERNAL;
    }
    if ((reset_flags & _BV(BORF)) && !(reset_flags & _BV(PORF))) {
        cause |= BOARD_RESET_BROWN_OUT; /* at power-on this flag is set too, and means nothing */
    }
    if (reset_flags & _BV(WDRF)) {
        cause |= BOARD_RESET_WATCHDOG;
    }
    if (cause == 0) {
        /* The Mega's boot loader reads MCUSR, clears it and passes nothing on. What is left: a RAM
         * that kept its content, how long ago the watchdog was last kicked, and whether an output
         * was on. */
        if (!warm) {
            cause = BOARD_RESET_POWER_ON;
        } else if (ms_since_kick >= BITTEN_MS) {
            cause = BOARD_RESET_WATCHDOG;
        } else {
            cause = driving ? BOARD_RESET_UNKNOWN : BOARD_RESET_EXTERNAL;
        }
    }
    if (warm) {
        cause |= BOARD_RESET_WARM;
    }
    return cause;
}

uint8_t board_reset_cause(void)
{
    return reset_cause;
}

/* --- outputs ------------------------------------------------------------------------------ */

/* What off and a duty rest on, beside the compare outputs. Set at the start, and again in each tick
 * and wherever everything goes off, as a register may have lost a bit: an output that is
 * disconnected shows its PORT. Called with interrupts off: they write ICR, too, by the same
 * temporary register. */
static void hold_pwm(void)
{
    PORTE &= (uint8_t)~PWM_PINS; /* low before it becomes an output */
    PORTH &= (uint8_t)~PWM_PINS;
    PORTL &= (uint8_t)~PWM_PINS;
    DDRE |= PWM_PINS;
    DDRH |= PWM_PINS;
    DDRL |= PWM_PINS;
    ICR3 = PWM_TOP;
    ICR4 = PWM_TOP;
    ICR5 = PWM_TOP;
    TCCR3B = PWM_B;
    TCCR4B = PWM_B;
    TCCR5B = PWM_B;
}

/* Single instructions: no interrupt can come between. */
static void supply_pin_low(void)
{
    PORTB &= (uint8_t)~SUPPLY_PIN;
    DDRB |= SUPPLY_PIN;
}

/* Called with interrupts off. */
static void outputs_off(void)
{
    hold_pwm();
    supply_pin_low();
    TCCR3A = PWM_A_OFF;
    TCCR4A = PWM_A_OFF;
    TCCR5A = PWM_A_OFF;
    driving = 0;
}

/* The outputs stay off, and the watchdog does what it does for a program that hangs. Called with
 * interrupts off. */
static void end_as_a_hang_does(void)
{
    outputs_off();
    ms_since_kick = BITTEN_MS; /* for a boot loader that passes no reset flags on */
    wdt_enable(WDTO_15MS);
    for (;;) {
    }
}

/* A vector that nobody has: an interrupt that nothing here enables. */
ISR(BADISR_vect)
{
    end_as_a_hang_does();
}

static const char *ended_by __attribute__((section(".noinit"))); /* in flash */
static uint16_t ended_check __attribute__((section(".noinit")));

void board_end(const char *why)
{
    cli();
    ended_by = why;
    ended_check = (uint16_t) ~(uint16_t)why;
    end_as_a_hang_does();
    for (;;) {
    }
}

const char *board_ended_take(void)
{
    const bool is_one = (uint16_t)ended_by == (uint16_t)~ended_check;
    ended_check = (uint16_t)ended_by;
    return is_one ? ended_by : NULL;
}

#ifdef NINESPRING_CHECKED
#include "invariant.h"

void invariant_broken(const char *condition)
{
    board_end(condition);
}
#endif

static void outputs_init(void)
{
    GTCCR = _BV(TSM) | _BV(PSRSYNC); /* the three timers start on the same clock */
    outputs_off();
    TCNT3 = 0;
    TCNT4 = 0;
    TCNT5 = 0;
    GTCCR = 0;
    board_set_fan(0);
}

/* Compare values of one timer's three outputs; returns its mode with the COM bits of those that are
 * on. A fast PWM output is high for OCR + 1 counts, so 0 cannot be had from the timer: there the
 * COM bit is cleared and the pin is low. The registers A, B, C follow one another, as do their
 * bits. */
static uint8_t set_timer(volatile uint16_t *compare, const uint16_t duty[3])
{
    uint8_t mode = PWM_A_OFF;
    for (uint8_t com = PWM_COM_A; com >= PWM_COM_C; com >>= 2, compare++, duty++) {
        if (*duty != 0 && *duty <= BOARD_DUTY_MAX) {
            *compare = *duty - 1u; /* takes effect at the next period */
            mode |= com;
        }
    }
    return mode;
}

void board_set_duties(const uint16_t duty[BOARD_SPRINGS])
{
    cli();
    const uint8_t three = set_timer(&OCR3A, &duty[0]);
    const uint8_t four = set_timer(&OCR4A, &duty[3]);
    const uint8_t five = set_timer(&OCR5A, &duty[6]);
    hold_pwm();
    if (!stop_pending) {
        TCCR3A = three;
        TCCR4A = four;
        TCCR5A = five;
        driving = (three | four | five) != PWM_A_OFF;
    }
    sei();
}

void board_set_fan(uint8_t percent)
{
    PORTB &= (uint8_t)~FAN_PIN;
    DDRB |= FAN_PIN;
    TCCR1B = _BV(WGM13) | _BV(WGM12) | _BV(CS12) | _BV(CS10);
    ICR1 = FAN_TOP;
    if (percent == 0) {
        TCCR1A = _BV(WGM11);
        return;
    }
    OCR1A = percent >= 100u ? FAN_TOP : (uint16_t)(percent * 5u - 1u);
    TCCR1A = _BV(WGM11) | _BV(COM1A1);
}

/* The fan's timer, which could drive the pin, is written in each tick, too. */
void board_hold_supply(bool hold)
{
    supply_pin_low();
    if (hold) {
        PORTB |= SUPPLY_PIN;
        _delay_us(SUPPLY_PULSE_US);
        supply_pin_low();
    }
}

uint8_t board_stop_take(void)
{
    uint8_t received;
    cli();
    received = stop_received;
    stop_received = 0;
    stop_pending = false;
    sei();
    return received;
}

/* --- time --------------------------------------------------------------------------------- */

ISR(TIMER2_COMPA_vect)
{
    time_ms++;
    ms_since_kick++;
    if (++ms_of_tick >= BOARD_TICK_MS) {
        ms_of_tick = 0;
        if (ticks_due < 255u) {
            ticks_due++;
        }
    }
}

uint32_t board_time_ms(void)
{
    uint32_t copy;
    cli();
    copy = time_ms;
    sei();
    return copy;
}

uint32_t board_time_us(void)
{
    uint32_t ms;
    uint8_t count;
    cli();
    ms = time_ms;
    count = TCNT2;
    if ((TIFR2 & _BV(OCF2A)) != 0 && count < COUNTS_PER_MS / 2u) {
        ms++; /* the interrupt is still to come */
    }
    sei();
    return ms * 1000u + (uint16_t)(count * US_PER_COUNT);
}

bool board_tick_take(uint8_t *behind)
{
    bool due = false;
    *behind = 0;
    cli();
    if (ticks_due > 0) {
        ticks_due--;
        *behind = ticks_due;
        due = true;
    }
    sei();
    return due;
}

/* --- serial ------------------------------------------------------------------------------- */

ISR(USART0_RX_vect)
{
    static uint8_t last_octet;
    const uint8_t errors = UCSR0A & (_BV(FE0) | _BV(DOR0));
    const uint8_t octet = UDR0;
    if (errors) {
        receive_lost = true;
        if (errors & _BV(FE0)) {
            return; /* not a byte anyone sent */
        }
    }
    if (octet == '!') {
        outputs_off();
        stop_pending = true;
        stop_received = last_octet == '!' || stop_received > 1u ? 2u : 1u; /* two stay two */
        last_octet = octet;
        stop_head = receive_head;
        stop_queued = true;
        return;
    }
    if (octet == '?') {
        status_requested = true;
        return;
    }
    last_octet = octet;
    const uint8_t next = (uint8_t)((receive_head + 1u) % SERIAL_RECEIVE_BYTES);
    if (next == receive_tail) {
        receive_lost = true;
        return;
    }
    receive_buffer[receive_head] = octet;
    receive_head = next;
}

/* Nothing but what is wrong is written: a rate that is written anew ends the byte under way. */
static void hold_serial(void)
{
    if (UBRR0 != SERIAL_RATE) {
        UBRR0 = SERIAL_RATE;
    }
    if ((UCSR0A & (_BV(U2X0) | _BV(MPCM0))) != _BV(U2X0)) {
        UCSR0A = _BV(U2X0);
    }
    if (UCSR0C != SERIAL_8N1) {
        UCSR0C = SERIAL_8N1;
    }
    const uint8_t on =
        transmit_head != transmit_tail ? (uint8_t)(SERIAL_ON | _BV(UDRIE0)) : SERIAL_ON;
    if ((UCSR0B & (uint8_t) ~(_BV(RXB80) | _BV(TXB80))) != on) {
        UCSR0B = on;
    }
}

static inline uint16_t transmit_next(uint16_t position)
{
    return position + 1u == SERIAL_TRANSMIT_BYTES ? 0u : position + 1u;
}

ISR(USART0_UDRE_vect)
{
    if (transmit_head == transmit_tail) {
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
        return;
    }
    UDR0 = (uint8_t)transmit_buffer[transmit_tail];
    transmit_tail = transmit_next(transmit_tail);
}

static bool take_flag(volatile bool *flag)
{
    bool was;
    cli();
    was = *flag;
    *flag = false;
    sei();
    return was;
}

int16_t board_serial_read(void)
{
    int16_t octet = -1;
    cli();
    if (receive_tail != receive_head) {
        if (receive_tail == stop_head) {
            stop_queued = false;
        }
        octet = receive_buffer[receive_tail];
        receive_tail = (uint8_t)((receive_tail + 1u) % SERIAL_RECEIVE_BYTES);
    }
    sei();
    return octet;
}

bool board_serial_waits(void)
{
    return receive_tail != receive_head; /* one octet each: nothing tears */
}

bool board_serial_before_stop(void)
{
    bool before;
    cli();
    before = stop_queued && receive_tail != stop_head;
    sei();
    return before;
}

bool board_serial_status_take(void)
{
    return take_flag(&status_requested);
}

bool board_serial_lost_take(void)
{
    return take_flag(&receive_lost);
}

uint16_t board_serial_room(void)
{
    uint16_t tail;
    cli();
    tail = transmit_tail;
    sei();
    const uint16_t head = transmit_head; /* no interrupt changes it */
    return (uint16_t)((tail > head ? 0u : SERIAL_TRANSMIT_BYTES) + tail - head - 1u);
}

void board_serial_write(const char *bytes, uint8_t length)
{
    if (length > board_serial_room()) {
        return;
    }
    uint16_t head = transmit_head;
    for (uint8_t i = 0; i < length; i++) {
        transmit_buffer[head] = bytes[i];
        head = transmit_next(head);
    }
    cli();
    transmit_head = head;
    UCSR0B |= _BV(UDRIE0);
    sei();
}

/* --- EEPROM ------------------------------------------------------------------------------- */

bool board_eeprom_ready(void)
{
    return eeprom_is_ready();
}

uint8_t board_eeprom_read(uint16_t address)
{
    return eeprom_read_byte((const uint8_t *)address);
}

void board_eeprom_write(uint16_t address, uint8_t octet)
{
    if (board_eeprom_read(address) == octet) {
        return;
    }
    EEAR = address;
    EEDR = octet;
    cli();
    EECR = _BV(EEMPE); /* erase and write in one; the second write within four clocks */
    EECR |= _BV(EEPE);
    sei();
}

/* --- the rest ----------------------------------------------------------------------------- */

void board_watchdog_start(void)
{
    ms_since_kick = 0;
    wdt_enable(WDTO_250MS);
}

void board_watchdog_kick(void)
{
    wdt_enable(WDTO_250MS); /* it may have been lost, too */
    cli();
    ms_since_kick = 0;
    sei();
}

static void hold_clock(void)
{
    GTCCR = 0;
    ASSR = 0;
    TCCR2A = _BV(WGM21); /* compare match 1000 times a second */
    TCCR2B = _BV(CS22);  /* 16 MHz / 64 / 250 */
    OCR2A = COUNTS_PER_MS - 1u;
    TIMSK2 = _BV(OCIE2A);
}

/* Where a bit of these is lost, nothing else may notice: the board is deaf, or its second another
 * one. What is enabled beyond them ends in BADISR_vect. */
void board_hold(void)
{
    cli();
    PRR0 = 0; /* everything has its clock */
    PRR1 = 0;
    hold_clock();
    hold_serial();
    ADCSRA |= ADC_ON;
    sei();
}

static uint32_t idle_us;

void board_idle(bool busy)
{
    for (;;) {
        cli();
        if (ticks_due != 0 || receive_tail != receive_head || stop_received || status_requested) {
            break;
        }
        const uint8_t begin = TCNT2; /* runs through in 1 ms, and its interrupt wakes */
        SMCR = _BV(SE);              /* idle mode: timers and serial port go on */
        sei(); /* the instruction after sei still runs before any interrupt: no wake-up is lost */
        sleep_cpu();
        SMCR = 0;
        const uint8_t end = TCNT2;
        const uint8_t wrapped = end < begin ? COUNTS_PER_MS : 0;
        idle_us += (uint16_t)((uint8_t)(end - begin + wrapped) * US_PER_COUNT);
        if (busy) {
            break;
        }
    }
    sei();
}

uint32_t board_idle_us_take(void)
{
    const uint32_t slept_us = idle_us;
    idle_us = 0;
    return slept_us;
}

uint16_t board_ambient_adc(void)
{
    static uint16_t mean_q4;
    static bool running;
    if (running && !(ADCSRA & _BV(ADSC))) {
        const uint16_t now = ADC;
        mean_q4 = mean_q4 == 0 ? (uint16_t)(now << 4) : (uint16_t)(mean_q4 + now - (mean_q4 >> 4));
        running = false;
    }
    if (!running) {
        ADMUX = _BV(REFS0); /* reference AVCC, channel 0 */
        ADCSRA |= _BV(ADSC);
        running = true;
    }
    return (uint16_t)(mean_q4 >> 4);
}

void board_init(void)
{
    cli();
    reset_cause = find_reset_cause();
    start_check = START_CHECK;
    ms_since_kick = 0;
    outputs_init();

    TCNT2 = 0;
    board_hold();
}
