#include "console_internal.h"

/* All that a replay begins with, beside the settings: what was learnt, to the bit, and that all
 * else begins anew in this moment. Steps: each spring, the start. */
bool console_inputs_line(console_t *console, console_out_t *out)
{
    controller_t *const controller = console->controller;
    text_line_t *const line = &out->line;
    const uint8_t k = console->step;
    if (k > controller_springs(controller)) {
        return false;
    }
    if (k < controller_springs(controller)) {
        const spring_learnt_t learnt = controller_to_keep(controller, k);
        const int32_t number = k + 1;
        controller_restore_learnt(controller, k, &learnt); /* to begin with this, and no later */
        text_add_values(line, FLASH_TEXT("<learnt|spring:#0|"), &number);
        telemetry_add_hex(line, &learnt, sizeof learnt);
    } else {
        const int32_t values[] = {controller->ambient_c7, controller_fan_percent(controller),
                                  controller_may_be_warm(controller)};
        text_add_values(line, FLASH_TEXT("<start|ambient_c7:#0|fan:#0|warm:#0"), values);
        (void)controller_restart(controller, &console->settings->controller);
        (void)telemetry_set(console->telemetry, TELEMETRY_INPUTS, TELEMETRY_TICKS_PER_S);
    }
    text_add_char(line, '>');
    return true;
}

void console_mark_typed(const console_t *console, const char *typed)
{
    console_out_t out;
    if (console->telemetry->format != TELEMETRY_INPUTS ||
        console->output.room(console->output.context) < CONSOLE_ROOM_BYTES) {
        return;
    }
    console_out_start(&out);
    text_add_flash(&out.line, FLASH_TEXT("<typed|"));
    text_add(&out.line, typed);
    text_add_char(&out.line, '>');
    console_out_end(console, &out);
}
