/* What it is for: learns what the circuits of all springs share: supply, and drop of the freewheel
 * diodes.
 * What it owns: of the windows of all springs, mean duty and voltage, how both moved together, and
 * what follows.
 * What it never does: judge a spring, believe more than the tolerances of what is declared. It uses
 * floating point, once in a round of windows. */
#ifndef CIRCUIT_SOURCE_H
#define CIRCUIT_SOURCE_H

#include <stdbool.h>
#include <stdint.h>

#include "parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Of what is declared: supply_v may be 16 % less or 10 % more (4.2 to 5.5 V for 5). */
#define CIRCUIT_SOURCE_LEAST_PERCENT 84u
#define CIRCUIT_SOURCE_MOST_PERCENT  110u
/* freewheel_v: by so much more or less; 0: a drop up to that, as nobody may have said. */
#define CIRCUIT_SOURCE_DROP_MV       150u
#define CIRCUIT_SOURCE_UNDECLARED_MV 500u

typedef struct {
    /* what is believed */
    float drop_mv;
    float step_mv;   /* of voltage behind a switch, for a step of duty: supply and drop are 800 */
    float unsure_mv; /* the drop may be so far from that: two deviations */
    float less_mv;   /* and within its tolerance: so much less, so much more */
    float more_mv;
    /* what is driven by */
    float more_drop_v;       /* than is declared, which there is at least */
    uint16_t driven_drop_mv; /* the declared one, as long as it may be that */
    uint16_t dead_steps;     /* of duty: so few may only overcome the drop, and nothing flows */
    uint8_t windows;         /* of the running round */
    float duty;              /* their sums; steps of 800 */
    float voltage_mv;
    float before; /* windows of the rounds before, up to a limit: so it forgets */
    float mean_duty;
    float mean_mv;
    /* sums, of how duty and voltage moved within rounds and between them; of the running round
     * squares and products, of which fit takes the means off */
    float duty_square;
    float duty_mv;
} circuit_source_t;

/* mV. */
float circuit_source_supply_mv(const circuit_source_t *source);

/* What is declared is believed. */
void circuit_source_begin(circuit_source_t *source, const current_control_parameters_t *circuit);

/* A window of a spring that was driven: the means of duty (steps of 800) and of voltage behind its
 * switch.
 */
void circuit_source_take(circuit_source_t *source, float duty, float voltage_mv);

/* Ends the round: what is believed is what fits best to mean duties and voltages of this round and
 * of those before, supply and drop as they are declared, each by its tolerance. A voltage that
 * moves with the duty tells both; one at about the same duty only what they make together. Duties
 * that differ within a round tell most, as it has one supply, which may move by a fiftieth from
 * round to round, as others load and leave it. True if and only if another belief is taken: small
 * changes are not worth it. */
bool circuit_source_fit(circuit_source_t *source, const current_control_parameters_t *circuit);

#ifdef __cplusplus
}
#endif
#endif
