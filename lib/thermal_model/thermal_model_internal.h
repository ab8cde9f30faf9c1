/* What it is for: what start-up (thermal_model_setup.c) and run (thermal_model.c) share.
 * What it owns: the internal unit of temperature and the sizes that both rely on.
 * What it never does: serve anybody outside this folder. */
#ifndef THERMAL_MODEL_INTERNAL_H
#define THERMAL_MODEL_INTERNAL_H

#include "fixed_point.h"
#include "thermal_model.h"

/* Heat flows are counted in 1/64 uW: a conductance in uW/K times a `lead`, a temperature in 1/64 K
 * above -40.016 degC. The range of temperatures is just under 256 K, so that four leads still add
 * up in 16 bits. */
#define LEAD_ORIGIN_C7     (THERMAL_MODEL_LOWEST_C7 - 2)
#define LEAD_HIGHEST       16383u
#define LEAD_SPAN_K        255
#define LEAD_ORIGIN_KELVIN 29841u /* 1/128 K */
#define POWER_SHIFT        6
/* A spring's own place in the block of 3 x 3 that begins at its frame index. */
#define BLOCK_CENTRE (THERMAL_MODEL_FRAME_STRIDE + 1)
#define LATENT_MAX_K 80

static inline uint16_t lead_from_c7(int16_t temperature_c7)
{
    uint16_t above = (uint16_t)((uint16_t)temperature_c7 - (uint16_t)LEAD_ORIGIN_C7);
    if ((above & 0x8000u) != 0) {
        return temperature_c7 < 0 ? 0 : LEAD_HIGHEST;
    }
    return (uint16_t)(above >> 1);
}

/* The lead half a step ahead of a temperature that has changed by less than 256 K since. */
static inline uint16_t lead_ahead(int16_t temperature_c7, int16_t before_c7)
{
    int16_t rise = (int16_t)((uint16_t)temperature_c7 - (uint16_t)before_c7);
    uint16_t above =
        (uint16_t)((uint16_t)temperature_c7 + (uint16_t)(rise >> 1) - (uint16_t)LEAD_ORIGIN_C7);
    if ((above & 0x8000u) != 0) {
        return temperature_c7 < before_c7 ? 0 : LEAD_HIGHEST;
    }
    return (uint16_t)(above >> 1);
}

/* flow plus what comes from the neighbours, less what goes to them and to the plate. */
static inline uint32_t thermal_model_conducted(uint32_t flow, const uint16_t *block,
                                               const thermal_model_spring_t *spring, uint16_t lead)
{
    uint16_t sides = (uint16_t)(block[1] + block[THERMAL_MODEL_FRAME_STRIDE] +
                                block[THERMAL_MODEL_FRAME_STRIDE + 2] +
                                block[2 * THERMAL_MODEL_FRAME_STRIDE + 1]);
    uint16_t corners = (uint16_t)(block[0] + block[2] + block[2 * THERMAL_MODEL_FRAME_STRIDE] +
                                  block[2 * THERMAL_MODEL_FRAME_STRIDE + 2]);
    flow = fixed_point_mac_u16(flow, sides, spring->orthogonal);
    flow = fixed_point_mac_u16(flow, corners, spring->diagonal);
    return fixed_point_subtract_u16(flow, lead, spring->conduction);
}

/* What a spring gives the air around it. */
static inline uint32_t thermal_model_lost(int16_t above_air, const thermal_model_spring_t *spring)
{
    uint16_t conductance = spring->loss;
    if (above_air > 0) {
        conductance =
            (uint16_t)(conductance + fixed_point_high_u16(spring->loss_rise, (uint16_t)above_air));
    }
    return fixed_point_mac_s16_u16(0, above_air, conductance);
}

/* thermal_model_slow_node_t.units */
#define SLOW_NODE_COARSE 1u
#define SLOW_NODE_MANY   2u
/* thermal_model_pass_t.flags */
#define PASS_EXTRA 1u
#define PASS_RISES 2u

/* All springs one step on: flows from the leads, gains, enthalpies; then temperatures and new
 * leads; those that would pass a threshold stay as they were, but for gain_c23, and are marked
 * pending. On the AVR the second is assembly, held to the first. */
void thermal_model_pass_in_c(thermal_model_t *model);
/* Every conductance that depends on the fan; model->fan_percent says how fast it is. */
void thermal_model_apply_fan(thermal_model_t *model);
void thermal_model_refresh_ambient(thermal_model_t *model);

#endif
