#include "supply_share.h"

#include "invariant.h"

#define LEAST_BOOST_MA 200u /* less is not worth waiting for */
#define CAP_PASSES     12u  /* halves what is left of the budget, to 1 mA a spring */

static bool holds_each_once(const supply_queue_t *queue)
{
    for (uint8_t a = 0; a < queue->count; a++) {
        for (uint8_t b = 0; b < a; b++) {
            if (queue->spring[a] == queue->spring[b]) {
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
    if (queue->count < THERMAL_MODEL_MAX_SPRINGS) {
        queue->spring[queue->count++] = spring;
    }
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

static uint32_t sum_below(const supply_claim_t claim[], uint8_t springs, uint16_t cap_ma)
{
    uint32_t sum_ma = 0;
    for (uint8_t k = 0; k < springs; k++) {
        sum_ma += claim[k].secured_ma < cap_ma ? claim[k].secured_ma : cap_ma;
    }
    return sum_ma;
}

/* The highest cap, to 1 mA, under which what is secured fits the budget. */
static uint16_t cap_of(const supply_claim_t claim[], uint8_t springs, uint16_t budget_ma)
{
    if (sum_below(claim, springs, UINT16_MAX) <= budget_ma) {
        return UINT16_MAX;
    }
    uint16_t cap_ma = 0;
    for (uint16_t step_ma = 1u << CAP_PASSES; step_ma != 0; step_ma >>= 1) {
        if (sum_below(claim, springs, (uint16_t)(cap_ma + step_ma)) <= budget_ma) {
            cap_ma = (uint16_t)(cap_ma + step_ma);
        }
    }
    return cap_ma;
}

void supply_share(const supply_queue_t *queue, const supply_claim_t claim[], uint8_t springs,
                  uint16_t budget_ma, uint16_t granted_ma[])
{
    const uint16_t cap_ma = cap_of(claim, springs, budget_ma);
    uint16_t left_ma = (uint16_t)(budget_ma - sum_below(claim, springs, cap_ma));
    for (uint8_t k = 0; k < springs; k++) {
        granted_ma[k] = claim[k].secured_ma < cap_ma ? claim[k].secured_ma : cap_ma;
    }
    for (uint8_t n = 0; n < queue->count; n++) {
        const uint8_t k = queue->spring[n];
        uint16_t more_ma = (uint16_t)(claim[k].asked_ma - granted_ma[k]);
        if (more_ma > left_ma) {
            more_ma = left_ma >= LEAST_BOOST_MA ? left_ma : 0;
        }
        granted_ma[k] = (uint16_t)(granted_ma[k] + more_ma);
        left_ma = (uint16_t)(left_ma - more_ma);
    }
}
