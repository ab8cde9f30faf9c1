/* What the two files of tests share: a policy with its model, driven tick by tick. */
#ifndef FIXTURE_H
#define FIXTURE_H

#include "drive_policy.h"

#define SPRINGS 9

extern thermal_model_t model;
extern drive_policy_t policy;
extern drive_policy_parameters_t parameters; /* what make takes; the defaults at a test's begin */
extern uint16_t level[SPRINGS];
extern bool valid[SPRINGS];
extern int16_t measured_ma[SPRINGS];
extern int16_t measured_mv[SPRINGS];
extern uint16_t target_ma[SPRINGS];
extern uint16_t supply_limit_ma;

/* A cold array of so many springs; nothing is wanted, nothing is read. */
void make(uint8_t rows, uint8_t columns);
/* Gives the targets' sum, mA. */
uint32_t tick(void);

/* The tests of hold_tests.c, between UNITY_BEGIN and UNITY_END. */
void run_hold_tests(void);

#endif
