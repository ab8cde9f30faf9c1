/* sources: lib/current_control/current_control.c test/prove/stand_ins/parameter_check.c
 * options: -eva-domains octagon
 * defines: -DCURRENT_CONTROL_MAX_CHANNELS=3
 * Three channels: one of each turn, and one more; with nine it takes four times as long. */
#include "current_control.h"

#include "prove.h"

void main(void)
{
    current_control_t control;
    current_control_parameters_t settings;
    uint16_t target_ma[CURRENT_CONTROL_MAX_CHANNELS], duty[CURRENT_CONTROL_MAX_CHANNELS];
    int16_t measured_ma[CURRENT_CONTROL_MAX_CHANNELS];
    bool valid[CURRENT_CONTROL_MAX_CHANNELS];
    any_circuit(&settings);
    if (!current_control_init(&control, &settings, NULL)) {
        return;
    }
    while (any_bool()) {
        const uint8_t channel = (uint8_t)any_between(0, CURRENT_CONTROL_MAX_CHANNELS - 1);
        switch (any_u8()) {
        case 0:
            any_circuit(&settings);
            (void)current_control_apply(&control, &settings, NULL);
            break;
        case 1:
            current_control_reset(&control, channel);
            break;
        case 2:
            current_control_set_drop(&control, (uint16_t)any_between(0, 1150));
            break;
        case 3:
            current_control_set_resistance(&control, channel, any_u16());
            break;
        default:
            for (uint8_t k = 0; k < CURRENT_CONTROL_MAX_CHANNELS; k++) {
                target_ma[k] = any_u16();
                measured_ma[k] = any_s16();
                valid[k] = any_bool();
            }
            current_control_tick(&control, CURRENT_CONTROL_MAX_CHANNELS, target_ma, measured_ma,
                                 valid, any_bool(), duty);
            break;
        }
        (void)current_control_duty(&control, channel);
        (void)current_control_reference_ma(&control, channel);
    }
}
