/* What it is for: drives one spring after the other with a small current and judges what comes.
 * What it owns: whose turn it is, since when, how many were not sound.
 * What it never does: print, or start while a spring is driven. */
#ifndef SELFTEST_H
#define SELFTEST_H

#include <stdbool.h>
#include <stdint.h>

#include "controller.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SELFTEST_CURRENT_MA 300u /* or what its limits leave of that */
/* Less tells nothing: offsets of the readings are 10 mA and 25 mV. */
#define SELFTEST_LEAST_MA 50u
#define SELFTEST_TICKS    30u /* 0.6 s: the current has settled, the spring warmed by 0.1 K */

typedef struct {
    uint32_t since_tick;
    uint16_t open_current_ma; /* to go back to */
    uint8_t spring;
    uint8_t failures;
    uint8_t policy; /* drive_policy_kind_t, also */
    bool driven;    /* the spring whose turn it is */
} selftest_t;

typedef enum {
    SELFTEST_WAITS = 0,
    SELFTEST_JUDGED, /* a spring: *result is of it */
    SELFTEST_ENDED   /* all are done, all are off */
} selftest_step_t;

typedef struct {
    uint8_t spring;
    controller_sensor_status_t sensor;
    safety_fault_t fault;
    int32_t resistance_mohm; /* 0 unless sound */
    bool sound; /* sensor valid, no fault, at least half of the current that is asked for */
} selftest_result_t;

/* Nothing may be driven. Until the end the policy is DRIVE_POLICY_OPEN, with that current. */
void selftest_start(selftest_t *selftest, controller_t *controller);
/* Call it once a tick or more often. tick counts control ticks; sensor_status of each spring is
 * controller_sensor_status_t of the last one. Divides where it judges. */
selftest_step_t selftest_step(selftest_t *selftest, controller_t *controller, uint32_t tick,
                              const uint8_t sensor_status[], selftest_result_t *result);
/* All springs off, the policy as before: also in the middle. */
void selftest_end(selftest_t *selftest, controller_t *controller);

#ifdef __cplusplus
}
#endif
#endif
