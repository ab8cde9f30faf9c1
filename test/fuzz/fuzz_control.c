/* The control loop: any settings, any readings, any commands in any order. */
#include "fuzz.h"

static controller_t controller;
static settings_t settings;

static void command(uint8_t what, fuzz_t *fuzz)
{
    const uint8_t k = fuzz_byte(fuzz) % (CONTROLLER_MAX_SPRINGS + 1u);
    thermal_model_state_t state;
    temperature_ceiling_t delivered;
    bool on[CONTROLLER_MAX_SPRINGS];
    switch (what % 16u) {
    case 0:
        (void)controller_set_target(&controller, k, fuzz_word(fuzz));
        break;
    case 1:
        for (unsigned n = 0; n < CONTROLLER_MAX_SPRINGS; n++) {
            on[n] = ((k >> (n % 8u)) & 1u) != 0;
        }
        controller_set_pattern(&controller, on);
        break;
    case 2:
        (void)controller_set_policy(&controller, (drive_policy_kind_t)(k % 3u));
        break;
    case 3:
        (void)controller_set_fan(&controller, fuzz_byte(fuzz));
        break;
    case 4:
        controller_clear_faults(&controller);
        break;
    case 5:
        (void)controller_set_supply(&controller, (k & 1u) != 0);
        break;
    case 6:
        controller_lock(&controller);
        break;
    case 7:
        controller_unlock(&controller);
        break;
    case 8:
        controller_set_temperature(&controller, (int16_t)fuzz_word(fuzz));
        break;
    case 9: /* a warm reset */
        controller_get_delivered(&controller, &delivered);
        controller_get_model_state(&controller, &state);
        HOLDS(controller_init(&controller, &settings.controller, 20 * 128, NULL));
        (void)controller_resume(&controller, &delivered, (k & 1u) != 0 ? &state : NULL);
        break;
    case 10: /* other settings, refused or not */
        for (unsigned n = 0; n < 3u; n++) {
            const settings_t before = settings;
            const uint16_t row = (uint16_t)(fuzz_byte(fuzz) % PARAMETER_COUNT);
            const parameter_row_t known = parameter_row(row);
            const uint32_t span = (uint32_t)known.maximum - (uint32_t)known.minimum;
            const uint32_t drawn = fuzz_word(fuzz) | (uint32_t)fuzz_word(fuzz) << 16;
            const uint32_t above = span == UINT32_MAX ? drawn : drawn % (span + 1u);
            HOLDS(settings_set(&settings, row, (uint8_t)(k % known.count),
                               (int32_t)((uint32_t)known.minimum + above)) == SETTINGS_OK);
            if (!controller_apply_settings(&controller, &settings.controller, NULL)) {
                settings = before;
            }
        }
        break;
    case 11:
        controller_emergency_cut(&controller);
        break;
    case 12:
        if (k < controller_springs(&controller)) {
            controller_forget_learnt(&controller, k);
        }
        break;
    default:
        controller_host_heard(&controller);
        break;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    fuzz_t fuzz = {bytes, size};
    static controller_inputs_t inputs;
    static controller_outputs_t outputs;
    settings_default(&settings);
    HOLDS(controller_init(&controller, &settings.controller, (int16_t)fuzz_word(&fuzz), NULL));
    memset(&inputs, 0, sizeof inputs);
    memset(&outputs, 0, sizeof outputs);
    inputs.ambient_c7 = 20 * 128;
    while (fuzz.left > 0) {
        const uint8_t what = fuzz_byte(&fuzz);
        if (what < 128u) {
            command(what, &fuzz);
        }
        const uint8_t change = fuzz_byte(&fuzz);
        controller_sensor_t *const sensor = &inputs.sensor[change % 9u];
        const bool circuit = (change & 0x40u) != 0;
        sensor->status = (change & 0x80u) != 0 ? change % 5u : (uint8_t)CONTROLLER_SENSOR_OK;
        sensor->current_ma = (int16_t)fuzz_word(&fuzz);
        sensor->voltage_mv = (int16_t)fuzz_word(&fuzz);
        inputs.ambient_c7 = (change & 0x20u) != 0 ? (int16_t)fuzz_word(&fuzz) : inputs.ambient_c7;
        inputs.fan_percent = outputs.fan_percent;
        for (unsigned n = 0; n <= what % 32u; n++) {
            for (uint8_t k = 0; circuit && k < CONTROLLER_MAX_SPRINGS; k++) {
                inputs.sensor[k].current_ma = (int16_t)(outputs.duty[k] * 625u / 36u);
                inputs.sensor[k].voltage_mv = (int16_t)(inputs.sensor[k].current_ma * 18 / 100);
            }
            controller_tick(&controller, &inputs, &outputs);
            HOLDS(controller_is_sound(&controller));
            fuzz_hold_outputs(&controller, &outputs);
        }
    }
    return 0;
}
