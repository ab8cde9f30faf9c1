/* What it is for: a policy, and the belief and model it goes by, tick by tick.
 * What it owns: what a test says is believed of up to nine springs: none of them lives
 * (test/host_drive).
 * What it never does: read a current or a voltage. */
#ifndef SMALL_ARRAY_H
#define SMALL_ARRAY_H

#include "../fakes/belief_inside.h"
#include "drive_policy.h"

#define SPRINGS 9

extern thermal_model_t model;
extern spring_estimator_t belief;
extern drive_policy_t policy;
extern drive_policy_parameters_t parameters; /* what begin_cold takes; defaults at a test's begin */
extern uint16_t level[SPRINGS];
extern bool allowed[SPRINGS];
extern uint16_t target_ma[SPRINGS];
extern uint16_t supply_limit_ma, maximum_current_ma;

/* The policy anew, of the parameters. */
void restart(void);
/* So many springs, all of which are known to be at 20 degC. */
void begin_cold(uint8_t rows, uint8_t columns);
/* What the policy is told of a spring, whatever it is: for limits, which go by what is believed. */
void believe(uint8_t spring, int16_t temperature_c, bool austenite);

/* The policy and the belief take over other parameters. */
void apply(const drive_policy_parameters_t *other);

/* One tick of belief and policy. Gives the targets' sum, mA. */
uint32_t decide(void);
void decisions(unsigned count);

/* And without the belief, either: what is believed is what a test says. */
void policy_tick(void);

#endif
