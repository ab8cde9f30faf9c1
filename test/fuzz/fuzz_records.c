/* Records of settings and of what was learnt, with right checksums and anything in them: what is
 * loaded is within its limits, drives or is refused, and is the same after it is saved again. */
#include "fuzz.h"

#include "learnt_store.h"

static uint8_t payload[SETTINGS_SLOT_BYTES];

static uint8_t payload_byte(void *context, uint16_t position)
{
    (void)context;
    return payload[position];
}

static void put(uint16_t base, uint16_t slot_bytes, uint8_t kind, uint16_t length)
{
    record_store_t record;
    (void)record_store_open(&record, &fuzz_storage, base, slot_bytes, kind);
    record_store_save(&record, payload_byte, NULL, length);
    while (record_store_step(&record) == RECORD_SAVE_BUSY) {
    }
    HOLDS(record_store_open(&record, &fuzz_storage, base, slot_bytes, kind) <= RECORD_LOADED_OTHER);
    HOLDS(record_store_length(&record) == length);
}

static void hold_limits(const settings_t *settings)
{
    for (uint16_t row = 0; row < PARAMETER_COUNT; row++) {
        const parameter_row_t known = parameter_row(row);
        for (uint8_t n = 0; n < known.count; n++) {
            const int32_t value = settings_get(settings, row, n);
            HOLDS(value >= known.minimum && value <= known.maximum);
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    static settings_t settings, again;
    static settings_store_t store;
    static controller_t controller;
    static learnt_store_t learnt;
    fuzz_t fuzz = {bytes, size};
    memset(fuzz_eeprom, 0xFF, sizeof fuzz_eeprom);

    const uint16_t length = fuzz_word(&fuzz) % (SETTINGS_SLOT_BYTES - RECORD_OVERHEAD_BYTES + 1u);
    for (uint16_t n = 0; n < length; n++) {
        payload[n] = fuzz_byte(&fuzz);
    }
    put(SETTINGS_BASE, SETTINGS_SLOT_BYTES, SETTINGS_RECORD_KIND, length);
    (void)settings_load(&store, &fuzz_storage, &settings);
    hold_limits(&settings);
    settings_save_start(&store, &settings);
    while (record_store_step(&store.record) == RECORD_SAVE_BUSY) {
    }
    const settings_loaded_t loaded = settings_load(&store, &fuzz_storage, &again);
    HOLDS(loaded.found <= RECORD_LOADED_OTHER && loaded.missing == 0 && loaded.dropped == 0);
    HOLDS(memcmp(&settings, &again, sizeof settings) == 0);

    if (!controller_init(&controller, &settings.controller, (int16_t)fuzz_word(&fuzz), NULL)) {
        settings_default(&settings);
        HOLDS(controller_init(&controller, &settings.controller, 20 * 128, NULL));
    }
    const uint16_t springs = controller_springs(&controller);
    const uint16_t mark = controller_model_mark(&controller);
    payload[0] = (uint8_t)mark;
    payload[1] = (uint8_t)(mark >> 8);
    for (uint16_t n = 2; n < LEARNT_STORE_BYTES(springs); n++) {
        payload[n] = fuzz_byte(&fuzz);
    }
    put(SETTINGS_LEARNT_BASE, SETTINGS_LEARNT_SLOT_BYTES, LEARNT_STORE_KIND,
        LEARNT_STORE_BYTES(springs));
    (void)learnt_store_open(&learnt, &fuzz_storage, SETTINGS_LEARNT_BASE,
                            SETTINGS_LEARNT_SLOT_BYTES, &controller);
    controller_inputs_t inputs = {.ambient_c7 = 20 * 128};
    controller_outputs_t outputs = {.duty = {0}};
    controller_set_temperature(&controller, 20 * 128);
    for (uint8_t k = 0; k < springs; k++) {
        HOLDS(controller_set_target(&controller, k, 1000));
    }
    for (unsigned n = 0; n < 60; n++) {
        for (uint8_t k = 0; k < springs; k++) {
            inputs.sensor[k].current_ma = (int16_t)(outputs.duty[k] * 4u);
            inputs.sensor[k].voltage_mv = (int16_t)outputs.duty[k];
        }
        controller_tick(&controller, &inputs, &outputs);
        fuzz_hold_outputs(&controller, &outputs);
    }
    learnt_store_second(&learnt, &controller);
    while (learnt_store_step(&learnt) == RECORD_SAVE_BUSY) {
    }
    return 0;
}
