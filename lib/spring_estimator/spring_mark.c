#include <stddef.h>

#include "crc16.h"
#include "spring_estimator_internal.h"

/* Numbers as they lie in memory: every machine that this runs on has the lowest byte first, and
 * floats of 32 bits. Without bits and what lies between numbers, which is none. */
#define ADD(crc, field) crc16_add_bytes((crc), &(field), sizeof(field))
/* Fields that lie one behind the other with nothing between, up to the first that does not count.
 */
#define ADD_UP_TO(crc, field, end)                                                                 \
    crc16_add_bytes((crc), &b->field,                                                              \
                    offsetof(spring_belief_t, end) - offsetof(spring_belief_t, field))

uint16_t spring_estimator_mark(const spring_estimator_t *e, const thermal_model_t *model, uint8_t k)
{
    const spring_belief_t *const b = &e->spring[k];
    const int32_t temperature_c23 = model->state.spring[k].temperature_c23;
    uint16_t crc = ADD(CRC16_START, temperature_c23);
    crc = ADD_UP_TO(crc, variance_k2, averaged);
    crc = ADD(crc, b->unsteady);
    crc = ADD(crc, b->learnt);
    crc = ADD_UP_TO(crc, current_a, last_c7);
    crc = ADD_UP_TO(crc, gone_k, run);
    crc = ADD(crc, e->r_phase_odds);
    return b->heating ? crc16_add_bytes(crc, &b->run.heat, offsetof(spring_heat_t, turns) + 1u)
                      : crc16_add_bytes(crc, &b->run.line, offsetof(spring_line_t, turns));
}
