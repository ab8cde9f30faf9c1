#include "supply_share.h"

#include "invariant.h"

static bool holds_each_once(const supply_queue_t *queue)
{
    for (uint8_t k = 0; k < queue->count; k++) {
        for (uint8_t n = 0; n < k; n++) {
            if (queue->spring[n] == queue->spring[k]) {
                return false;
            }
        }
    }
    return queue->count <= THERMAL_MODEL_MAX_SPRINGS;
}

void supply_queue_add(supply_queue_t *queue, uint8_t spring)
{
    for (uint8_t k = 0; k < queue->count; k++) {
        if (queue->spring[k] == spring) {
            return;
        }
    }
    queue->spring[queue->count++] = spring; /* there is room: it was not in */
    INVARIANT(holds_each_once(queue));
}

void supply_queue_remove(supply_queue_t *queue, uint8_t spring)
{
    uint8_t kept = 0;
    for (uint8_t k = 0; k < queue->count; k++) {
        if (queue->spring[k] != spring) {
            queue->spring[kept++] = queue->spring[k];
        }
    }
    queue->count = kept;
}

uint16_t supply_share_cap_ma(const uint16_t target_ma[], uint8_t springs, uint16_t budget_ma,
                             uint16_t cap_ma)
{
    for (uint8_t pass = 0; pass < SUPPLY_SHARE_PASSES; pass++) {
        uint16_t left_ma = budget_ma;
        uint8_t capped = 0;
        const uint16_t *target = target_ma;
        for (uint8_t n = springs; n != 0; n--) {
            uint16_t given_ma = *target++;
            if (given_ma > cap_ma) {
                given_ma = cap_ma;
                capped++;
            }
            if (given_ma > left_ma) { /* the budget has fallen */
                cap_ma = 0;
                left_ma = budget_ma;
                capped = springs;
                break;
            }
            left_ma = (uint16_t)(left_ma - given_ma);
        }
        /* as much more for each that it cannot be too much for all */
        for (; capped != 0 && left_ma != 0; capped = capped >> 1) {
            left_ma = left_ma >> 1;
        }
        if (left_ma == 0) {
            break;
        }
        cap_ma = (uint16_t)(cap_ma + left_ma);
    }
    return cap_ma;
}
