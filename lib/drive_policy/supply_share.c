#include "supply_share.h"

void supply_queue_add(supply_queue_t *queue, uint8_t spring)
{
    for (uint8_t k = 0; k < queue->count; k++) {
        if (queue->spring[k] == spring) {
            return;
        }
    }
    if (queue->count < THERMAL_MODEL_MAX_SPRINGS) {
        queue->spring[queue->count++] = spring;
    }
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

static uint32_t sum_capped(const uint16_t target_ma[], uint8_t springs, uint16_t cap_ma)
{
    uint32_t sum_ma = 0;
    for (uint8_t k = 0; k < springs; k++) {
        sum_ma += target_ma[k] < cap_ma ? target_ma[k] : cap_ma;
    }
    return sum_ma;
}

uint16_t supply_share_cap_ma(const uint16_t target_ma[], uint8_t springs, uint16_t budget_ma)
{
    uint16_t cap_ma = 0;
    for (uint16_t bit = 2048; bit != 0; bit = (uint16_t)(bit >> 1)) {
        uint16_t trial_ma = (uint16_t)(cap_ma | bit);
        if (sum_capped(target_ma, springs, trial_ma) <= budget_ma) {
            cap_ma = trial_ma;
        }
    }
    return cap_ma;
}
