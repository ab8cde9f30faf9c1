#include <stddef.h>

#include "crc16.h"
#include "spring_estimator_internal.h"

/* Numbers as they lie in memory: every machine that this runs on has the lowest byte first, and
 * floats of 32 bits. Field by field, as what lies between them is no number. */
#define ADD(crc, field) crc16_add_bytes((crc), &(field), sizeof(field))

uint16_t spring_estimator_mark(const spring_estimator_t *e, const thermal_model_t *model, uint8_t k)
{
    const spring_belief_t *const b = &e->spring[k];
    const int32_t temperature_c23 = model->state.spring[k].temperature_c23;
    uint16_t crc = ADD(CRC16_START, temperature_c23);
    /* up to the first that is no float */
    crc = crc16_add_bytes(crc, b, offsetof(spring_belief_t, extra_loss_uw));
    crc = ADD(crc, b->extra_loss_uw);
    crc = ADD(crc, b->gives_w);
    crc = ADD(crc, b->disturbance_k);
    crc = ADD(crc, b->hottest_c);
    crc = ADD(crc, b->kept_w_per_k);
    crc = ADD(crc, b->lost);
    crc = ADD(crc, b->possible);
    crc = ADD(crc, b->fresh);
    crc = ADD(crc, b->quiet);
    crc = ADD(crc, b->losing);
    crc = ADD(crc, b->unsteady);
    crc = ADD(crc, b->learnt);
    crc = ADD(crc, b->current_a);
    crc = ADD(crc, b->ohm);
    crc = ADD(crc, b->ohm_before);
    crc = ADD(crc, b->slow_ohm);
    crc = ADD(crc, b->slow_a);
    crc = ADD(crc, b->phase_ohm);
    crc = ADD(crc, b->offset_sd_v);
    crc = ADD(crc, b->noise);
    crc = ADD(crc, b->full_ohm);
    crc = ADD(crc, b->gone);
    crc = ADD(crc, b->gone_k);
    crc = ADD(crc, b->gone_w_per_k);
    return b->heating ? ADD(crc, b->run.heat)
                      : crc16_add_bytes(crc, &b->run.line, offsetof(spring_line_t, turns));
}
