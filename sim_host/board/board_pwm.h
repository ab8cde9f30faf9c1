/* What it is for: what timers 1, 3, 4 and 5 put on the pins, read from their registers.
 * What it owns: the registers of timers 3 to 5: simavr's own timers there never run (they cost 80
 * % of the speed).
 * What it never does: count: the outputs are known by their duty, not edge by edge. Source:
 * ATmega2560 data sheet, sections 13 and 17. */
#ifndef BOARD_PWM_H
#define BOARD_PWM_H

#include <stdbool.h>
#include <stdint.h>

#include <simavr/sim_avr.h>

#ifdef __cplusplus
extern "C" {
#endif

#define BOARD_PWM_OUTPUTS 9

typedef void (*board_pwm_changed_t)(void *context);

typedef struct board_pwm board_pwm_t;

typedef struct {
    board_pwm_t *pwm;
    uint16_t base; /* address of TCCRnA */
    uint8_t high;  /* TEMP: the high byte waits for the low one */
} board_pwm_timer_t;

struct board_pwm {
    avr_t *avr;
    board_pwm_timer_t timer[3];
    double duty[BOARD_PWM_OUTPUTS];
    uint64_t off_cycle; /* when the last output went off */
    bool any_on;
    board_pwm_changed_t changed;
    void *context;
};

void board_pwm_attach(board_pwm_t *pwm, avr_t *avr, board_pwm_changed_t changed, void *context);
void board_pwm_update(board_pwm_t *pwm);
/* A register of timers 3 to 5 as it lies in memory; false: it is none of them. */
bool board_pwm_poke(board_pwm_t *pwm, unsigned address, uint8_t value);
/* OC1A, or its pin as a plain output. */
double board_pwm_fan(const board_pwm_t *pwm);

#ifdef __cplusplus
}
#endif
#endif
