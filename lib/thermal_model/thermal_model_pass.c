#include "thermal_model_internal.h"

#include <stddef.h>

void thermal_model_pass_in_c(thermal_model_t *model)
{
    thermal_model_pass_t *pass = &model->pass;
    const uint32_t *power_uw = pass->power_uw;
    for (uint8_t i = 0; i < pass->count; i++) {
        thermal_model_spring_t *spring = &model->spring[i];
        uint32_t flow = power_uw[i];
        if (flow > THERMAL_MODEL_HIGHEST_POWER_UW) {
            flow = THERMAL_MODEL_HIGHEST_POWER_UW;
        }
        flow = (flow << POWER_SHIFT) + pass->common;
        if ((pass->flags & PASS_EXTRA) != 0) {
            flow += (uint32_t)spring->gain_c23;
        }
        const uint16_t *block =
            (const uint16_t *)(const void *)((const char *)spring + spring->block_offset);
        uint16_t lead = block[BLOCK_CENTRE];
        flow = thermal_model_conducted(flow, block, spring, lead);
        uint32_t loss = thermal_model_lost((int16_t)(lead - pass->air_lead), spring);
        flow -= loss;
        pass->air_flow += (int32_t)loss >> 8;
        spring->gain_c23 = fixed_point_scale_s24((int32_t)flow >> 8, spring->step_gain);
    }
    pass->pending = 0;
    pass->lead_sum = 0;
    for (uint8_t i = 0; i < pass->count; i++) {
        thermal_model_spring_t *spring = &model->spring[i];
        thermal_model_spring_state_t *state = &model->state.spring[i];
        uint16_t *block = (uint16_t *)(void *)((char *)spring + spring->block_offset);
        int16_t before = (int16_t)(state->temperature_c23 >> 16);
        int32_t temperature_c23 =
            fixed_point_add_saturated(state->temperature_c23, spring->gain_c23);
        int16_t temperature_c7 = (int16_t)(temperature_c23 >> 16);
        if (temperature_c7 > state->heating_c7 || temperature_c7 < state->cooling_c7) {
            spring->pending = 1;
            pass->pending = 1;
        } else {
            state->temperature_c23 = temperature_c23;
            block[BLOCK_CENTRE] = lead_ahead(temperature_c7, before);
        }
        pass->lead_sum += block[BLOCK_CENTRE];
    }
}
