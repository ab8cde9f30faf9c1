/* Console with controller: each line that is not empty is answered once, in printable bytes; the
 * settings change by lines alone; what drives is asked for. Bytes above 127 are what happens. */
#include "fuzz.h"

#include "console.h"

static controller_t controller;
static controller_inputs_t inputs;
static controller_outputs_t outputs;
static settings_t settings;
static settings_store_t store;
static learnt_store_t learnt;
static telemetry_t telemetry;
static console_t console;
static console_status_t status;
static char line[256];
static unsigned length, answers;

static uint16_t room(void *context)
{
    (void)context;
    return 4000;
}

static void write_out(void *context, const char *bytes, uint8_t count)
{
    (void)context;
    for (unsigned n = 0; n < count; n++) {
        if (bytes[n] == '\r' || bytes[n] == '\b') {
            continue;
        }
        if (bytes[n] != '\n') {
            HOLDS(bytes[n] >= ' ' && bytes[n] <= '~');
            line[length] = bytes[n];
            length += length + 1u < sizeof line;
            continue;
        }
        line[length] = '\0';
        length = 0;
        HOLDS(strstr(line, "nan") == NULL && strstr(line, "inf ") == NULL);
        answers += strcmp(line, "ok") == 0 || strncmp(line, "error:", 6) == 0;
    }
}

static const text_output_t output = {NULL, room, write_out};

static void tick(void)
{
    for (uint8_t k = 0; k < CONTROLLER_MAX_SPRINGS; k++) {
        if (inputs.sensor[k].status == CONTROLLER_SENSOR_OK) {
            inputs.sensor[k].current_ma = (int16_t)(outputs.duty[k] * 625u / 36u);
            inputs.sensor[k].voltage_mv = (int16_t)(inputs.sensor[k].current_ma * 18 / 100);
        }
        status.sensor_status[k] = inputs.sensor[k].status;
    }
    inputs.fan_percent = outputs.fan_percent;
    controller_tick(&controller, &inputs, &outputs);
    status.ticks++;
    HOLDS(console_hold_settings(&console) && controller_is_sound(&controller));
    fuzz_hold_outputs(&controller, &outputs);
}

static void finish(void)
{
    for (unsigned turn = 0; !console_ready(&console); turn++) {
        HOLDS(turn < 20000);
        console_service(&console);
        if (turn % 8 == 0) {
            tick();
        }
        (void)learnt_store_step(&learnt);
    }
}

static void happen(uint8_t what, fuzz_t *fuzz)
{
    const uint8_t k = fuzz_byte(fuzz) % 9u;
    switch (what % 8u) {
    case 0:
        console_stop(&console);
        controller_emergency_stop(&controller);
        break;
    case 1:
        inputs.sensor[k].status = fuzz_byte(fuzz) % 5u;
        break;
    case 2:
        inputs.ambient_c7 = (int16_t)fuzz_word(fuzz);
        status.ambient_c7 = inputs.ambient_c7;
        break;
    case 3:
        console_print_status(&console);
        break;
    case 4:
        learnt_store_second(&learnt, &controller);
        break;
    case 5:
        console_break_line(&console, CONSOLE_ERROR_INPUT_LOST);
        break;
    default:
        for (unsigned n = 0; n <= what % 32u; n++) {
            tick();
            telemetry_tick(&telemetry, &controller, &status.time, inputs.ambient_c7, &output);
            telemetry_inputs(&telemetry, &controller, &inputs, (uint16_t)status.ticks, &output);
        }
        break;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    fuzz_t fuzz = {bytes, size};
    memset(fuzz_eeprom, 0xFF, sizeof fuzz_eeprom);
    memset(&status, 0, sizeof status);
    memset(&inputs, 0, sizeof inputs);
    memset(&outputs, 0, sizeof outputs);
    status.reset_cause = status.version = status.sensors = "fuzz";
    status.ambient_c7 = inputs.ambient_c7 = 20 * 128;
    status.loaded = settings_load(&store, &fuzz_storage, &settings);
    HOLDS(controller_init(&controller, &settings.controller, 20 * 128, NULL));
    learnt_store_open(&learnt, &fuzz_storage, SETTINGS_LEARNT_BASE, SETTINGS_LEARNT_SLOT_BYTES,
                      &controller);
    telemetry_init(&telemetry);
    length = 0;
    console_init(&console, &output, &controller, &settings, &store, &learnt, &telemetry, &status);
    console_greet(&console);
    while (fuzz.left > 0) {
        const uint8_t octet = fuzz_byte(&fuzz);
        if (octet > 127u) {
            happen(octet, &fuzz);
            continue;
        }
        finish();
        const bool ends = octet == '\n' || octet == '\r';
        const bool asked = ends && (console.length > 0 || console.broken != CONSOLE_OK);
        const unsigned before = answers;
        console_receive(&console, octet);
        finish();
        HOLDS(answers - before == (asked ? 1u : 0u));
    }
    return 0;
}
