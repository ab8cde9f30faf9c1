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

/* What one spring asks for, mA. */
typedef struct {
    uint16_t asked_ma;   /* in all */
    uint16_t secured_ma; /* of that, what comes before all boosts: the hold of a spring that holds,
                            of one in the queue what keeps what it has reached */
} supply_claim_t;

/* granted_ma[k], 0..asked_ma: secured first, cut to a common cap if they alone are too much
 * (max-min fair); then those in the queue, one after the other, each all that it asks for or what
 * is left of the budget: heat grows with the square of current. Springs must be below `springs`.
 * O(n). */
void supply_share(const supply_queue_t *queue, const supply_claim_t claim[], uint8_t springs,
                  uint16_t budget_ma, uint16_t granted_ma[]);

#ifdef __cplusplus
}
#endif
#endif
