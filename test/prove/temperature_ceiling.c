/* sources: lib/temperature_ceiling/temperature_ceiling.c lib/crc16/sum16.c
 * sources: test/prove/stand_ins/thermal_model.c
 * options: -eva-domains octagon */
#include "temperature_ceiling.h"

#include "prove.h"

static void any_model(thermal_model_t *model)
{
    thermal_model_parameters_t *const values = &model->parameters;
#define MODEL PROVE_ANY
#include "parameters.def"
    model->fan_percent = any_u8();
    model->springs = (spring_index_t)any_between(1, THERMAL_MODEL_MAX_SPRINGS);
    model->latent_full_c8 = (uint16_t)any_between(0, 80 * 256);
    for (uint8_t k = 0; k < THERMAL_MODEL_MAX_SPRINGS; k++) {
        values->heat_capacity_scale_permille[k] = (uint16_t)any_between(1, 8000);
        model->spring[k].loss_uw_per_k = any_u16();
        model->spring[k].loss_natural_uw_per_k = any_u16();
        model->spring[k].loss_fan_uw_per_k = any_u16();
    }
}

void main(void)
{
    thermal_model_t model;
    temperature_ceiling_t ceiling;
    temperature_ceiling_drive_t drive;
    current_control_parameters_t circuit;
    any_model(&model);
    temperature_ceiling_begin(&ceiling, thermal_model_ambient_c7(&model));
    while (any_bool()) {
        const uint8_t spring = any_u8();
        if (spring >= model.springs) {
            continue;
        }
        switch (any_u8()) {
        case 0:
            temperature_ceiling_raise(&ceiling, &model);
            break;
        case 1: {
            const temperature_ceiling_declared_t before =
                temperature_ceiling_declared(&model, spring);
            any_model(&model);
            if (spring < model.springs) {
                temperature_ceiling_declare(&ceiling, &model, spring, &before);
            }
            break;
        }
        case 2:
            temperature_ceiling_give(&ceiling, &model, spring);
            break;
        default:
            any_circuit(&circuit);
            temperature_ceiling_prepare(&drive, &model, &circuit);
            temperature_ceiling_step(
                &ceiling, &model, spring,
                temperature_ceiling_power_w(&drive, Frama_C_float_interval(0.0f, 800.0f),
                                            Frama_C_float_interval(0.0f, 0.5f)));
            break;
        }
        (void)temperature_ceiling_c(&ceiling, spring);
        (void)temperature_ceiling_is_warm(&ceiling, spring);
        (void)temperature_ceiling_rest_s(&ceiling, spring);
        (void)temperature_ceiling_contradicts(&ceiling, &model, spring);
        (void)temperature_ceiling_trips(&ceiling, spring, any_s16());
    }
}
