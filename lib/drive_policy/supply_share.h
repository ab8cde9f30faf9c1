/* What it is for: shares one supply among springs: holds first, then boosts in turn.
 * What it owns: the queue of those that heat.
 * What it never does: know temperatures or why a current is wanted, divide, give more than the
 * budget. */
#ifndef SUPPLY_SHARE_H
#define SUPPLY_SHARE_H

#include <stdbool.h>
#include <stdint.h>

#include "thermal_model.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    uint8_t count;
    uint8_t spring[THERMAL_MODEL_MAX_SPRINGS]; /* longest waiting first */
} supply_queue_t;

/* To the end; nothing if it is in already. */
void supply_queue_add(supply_queue_t *queue, uint8_t spring);
/* Nothing if it is not in. */
void supply_queue_remove(supply_queue_t *queue, uint8_t spring);

/* A cap under which the targets fit the budget (max-min fair): cap_ma (0, or what the last call
 * gave) raised towards the largest one. What is left of the budget at least halves with each of
 * SUPPLY_SHARE_PASSES, until it is below 1 mA for each capped spring. O(passes n). */
#define SUPPLY_SHARE_PASSES 4u
uint16_t supply_share_cap_ma(const uint16_t target_ma[], uint8_t springs, uint16_t budget_ma,
                             uint16_t cap_ma);

#ifdef __cplusplus
}
#endif
#endif
