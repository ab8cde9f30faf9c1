/* What it is for: a policy, the belief and model it goes by, and nine springs, tick by tick.
 * What it owns: the truth: temperatures, phases (straight lines over temperature) and resistances.
 * What it never does: know what the chip believes. */
#ifndef SMALL_ARRAY_H
#define SMALL_ARRAY_H

#include "../fakes/belief_inside.h"
#include "drive_policy.h"

#define SPRINGS 9
#define TICK_S  0.02

typedef struct {
    double temperature_c, austenite;
    double shift_k; /* of its transformation */
    double ratio;   /* of resistances, austenite over martensite */
} small_spring_t;

extern small_spring_t truth[SPRINGS];
extern double loss_w_per_k, coupling_w_per_k;
extern thermal_model_t model;
extern spring_estimator_t belief;
extern drive_policy_t policy;
extern drive_policy_parameters_t parameters; /* what make takes; defaults at a test's begin */
extern uint16_t level[SPRINGS];
extern bool allowed[SPRINGS];
extern uint16_t target_ma[SPRINGS];
extern uint16_t supply_limit_ma, maximum_current_ma;

uint32_t random_below(uint32_t limit);

void set_defaults(void);
/* So many springs at 20 degC; the power has come on, and nothing is known. */
void power_on(uint8_t rows, uint8_t columns);
/* The same, and the policy is told that all is cold: where a test is not about the beginning. */
void begin_cold(uint8_t rows, uint8_t columns);
/* What the policy is told of a spring, whatever it is: for limits, which go by what is believed. */
void believe(uint8_t spring, int16_t temperature_c, bool austenite);

/* The policy and the belief take over other parameters. */
void apply(const drive_policy_parameters_t *other);

/* One tick of policy, springs, readings and model. Gives the targets' sum, mA. */
uint32_t tick(void);
/* Gives the highest true temperature, degC. */
double run(double seconds);
/* Ticks in which springs and model stand still: only the policy goes on. */
uint32_t decide(void);
void decisions(unsigned count);

/* And without the belief, either: what is believed is what a test says. */
void policy_tick(void);

#endif
