#include "board_pwm.h"

#include <simavr/avr_ioport.h>
#include <string.h>

#include "board_registers.h"
#include "electrics.h"

/* Offsets from TCCRnA, alike for timers 1, 3, 4 and 5. */
#define TCCRB     1u
#define TCNT      4u
#define ICR       6u
#define OCRA      8u
#define REGISTERS 14u
#define TIMER1    0x80u

typedef struct {
    uint8_t timer;  /* 0..2 for timers 3..5 */
    uint8_t output; /* 0..2 for A..C */
    uint16_t ddr;
    uint8_t bit;
} pin_t;

#define DDRE 0x2Du
#define DDRH 0x101u
#define DDRL 0x10Au
#define DDRB 0x24u

static const uint16_t timer_base[3] = {0x90, 0xA0, 0x120};
/* Channels 1..9 are OC3A, OC3B, OC3C, OC4A ... OC5C. */
static const pin_t pins[BOARD_PWM_OUTPUTS] = {
    {0, 0, DDRE, 3}, {0, 1, DDRE, 4}, {0, 2, DDRE, 5}, {1, 0, DDRH, 3}, {1, 1, DDRH, 4},
    {1, 2, DDRH, 5}, {2, 0, DDRL, 3}, {2, 1, DDRL, 4}, {2, 2, DDRL, 5},
};
static const pin_t fan_pin = {0, 0, DDRB, 5};

static unsigned word(const uint8_t *data, unsigned address)
{
    return data[address] | (unsigned)data[address + 1u] << 8;
}

/* Data sheet, table 17-2: the modes that make PWM, their top, and whether they count up and down.
 */
static unsigned top_of(const uint8_t *data, unsigned base, bool *both_ways)
{
    unsigned mode = (data[base] & 3u) | (data[base + TCCRB] >> 1 & 0xCu);
    *both_ways = mode < 4 || (mode >= 8 && mode < 12);
    switch (mode) {
    case 1:
    case 5:
        return 0xFF;
    case 2:
    case 6:
        return 0x1FF;
    case 3:
    case 7:
        return 0x3FF;
    case 8:
    case 10:
    case 14:
        return word(data, base + ICR);
    case 9:
    case 11:
    case 15:
        return word(data, base + OCRA);
    default:
        return 0; /* no PWM mode */
    }
}

static double fraction(const uint8_t *data, unsigned base, pin_t pin, double before)
{
    unsigned port = pin.ddr + 1u;
    if ((data[pin.ddr] >> pin.bit & 1u) == 0) {
        return 0.0; /* an input: the gate's pull-down decides */
    }
    unsigned com = data[base] >> (6u - 2u * pin.output) & 3u;
    bool both_ways = false;
    unsigned top = top_of(data, base, &both_ways);
    if (com < 2) {
        return (double)(data[port] >> pin.bit & 1u);
    }
    if ((data[base + TCCRB] & 7u) == 0) {
        return before > 0.0 ? 1.0 : 0.0; /* a timer that stops may leave its pin high */
    }
    if (top == 0) {
        return 0.0;
    }
    unsigned compare = word(data, base + OCRA + 2u * pin.output);
    double high = both_ways ? (double)(compare > top ? top : compare) / (double)top
                            : electrics_pwm_fraction(true, compare, top);
    return com == 3 ? 1.0 - high : high;
}

void board_pwm_update(board_pwm_t *pwm)
{
    bool any_on = false;
    bool changed = false;
    for (unsigned k = 0; k < BOARD_PWM_OUTPUTS; k++) {
        double duty = fraction(pwm->avr->data, timer_base[pins[k].timer], pins[k], pwm->duty[k]);
        changed = changed || duty < pwm->duty[k] || duty > pwm->duty[k];
        pwm->duty[k] = duty;
        any_on = any_on || duty > 0.0;
    }
    if (pwm->any_on && !any_on) {
        pwm->off_cycle = pwm->avr->cycle;
    }
    pwm->any_on = any_on;
    if (changed) {
        pwm->changed(pwm->context);
    }
}

double board_pwm_fan(const board_pwm_t *pwm)
{
    return fraction(pwm->avr->data, TIMER1, fan_pin, 0.0);
}

static void write_timer(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param)
{
    board_pwm_timer_t *timer = param;
    unsigned offset = address - timer->base;
    if (offset < TCNT) {
        avr->data[address] = value;
    } else if ((offset & 1u) != 0) {
        timer->high = value;
        return;
    } else {
        avr->data[address + 1u] = timer->high;
        avr->data[address] = value;
    }
    board_pwm_update(timer->pwm);
}

bool board_pwm_poke(board_pwm_t *pwm, unsigned address, uint8_t value)
{
    for (unsigned t = 0; t < 3; t++) {
        if (address >= timer_base[t] && address < timer_base[t] + REGISTERS) {
            pwm->avr->data[address] = value;
            board_pwm_update(pwm);
            return true;
        }
    }
    return false;
}

/* The counters are not stepped, but a program that looks sees them run. */
static uint8_t read_counter(avr_t *avr, avr_io_addr_t address, void *param)
{
    const board_pwm_timer_t *timer = param;
    bool both_ways = false;
    unsigned top = top_of(avr->data, timer->base, &both_ways);
    unsigned count = top > 0 ? (unsigned)(avr->cycle % (top + 1u)) : 0;
    (void)both_ways;
    if (((address - timer->base) & 1u) == 0) {
        avr->data[address + 1u] = (uint8_t)(count >> 8);
        return (uint8_t)count;
    }
    return avr->data[address];
}

static void port_changed(struct avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq;
    (void)value;
    board_pwm_update(param);
}

void board_pwm_attach(board_pwm_t *pwm, avr_t *avr, board_pwm_changed_t changed, void *context)
{
    *pwm = (board_pwm_t){.avr = avr, .changed = changed, .context = context};
    for (unsigned t = 0; t < 3; t++) {
        pwm->timer[t] = (board_pwm_timer_t){.pwm = pwm, .base = timer_base[t]};
        for (unsigned offset = 0; offset < REGISTERS; offset++) {
            bool counter = offset == TCNT || offset == TCNT + 1u;
            board_take_register(avr, (avr_io_addr_t)(timer_base[t] + offset),
                                counter ? read_counter : NULL, write_timer, &pwm->timer[t]);
        }
    }
    for (const char *port = "EHL"; *port != '\0'; port++) {
        avr_irq_t *irqs = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ((unsigned)*port), 0);
        avr_irq_register_notify(irqs + IOPORT_IRQ_REG_PORT, port_changed, pwm);
        avr_irq_register_notify(irqs + IOPORT_IRQ_DIRECTION_ALL, port_changed, pwm);
    }
}
