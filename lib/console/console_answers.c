#include "console_internal.h"

void console_out_start(console_out_t *out)
{
    text_line_start(&out->line, out->bytes, CONSOLE_ROOM_BYTES - 2u);
}

void console_out_end(const console_t *console, console_out_t *out)
{
    out->line.size = CONSOLE_ROOM_BYTES;
    text_add_flash(&out->line, FLASH_TEXT("\r\n"));
    console->output.write(console->output.context, out->line.bytes, out->line.length);
}

static void add_spring(text_line_t *line, uint8_t spring)
{
    const int32_t number = spring + 1;
    text_add_values(line, FLASH_TEXT("spring #0: "), &number);
}

void console_print_setting(const console_t *console, uint16_t index, uint8_t element)
{
    console_out_t out;
    char name[SETTINGS_NAME_SIZE];
    settings_name(index, element, name);
    console_out_start(&out);
    text_add_char(&out.line, '$');
    text_add(&out.line, name);
    text_add_char(&out.line, '=');
    text_add_decimal(&out.line, settings_get(console->settings, index, element),
                     parameter_row(index).decimals);
    console_out_end(console, &out);
}

static void add_loaded(text_line_t *line, const console_t *console)
{
    const console_status_t *const status = console->status;
    /* as record_found_t has them */
    static const char texts[] FLASH_MEMORY = "loaded\0"
                                             "loaded; the other copy is damaged or was cut short\0"
                                             "none saved, defaults\0"
                                             "stored ones damaged, defaults\0"
                                             "stored by another version, defaults";
    const settings_loaded_t *const loaded = &status->loaded;
    if (record_store_step(&console->store->record) == RECORD_SAVE_DONE) {
        text_add_flash(line, FLASH_TEXT("saved")); /* since, whatever the boot found */
        return;
    }
    if (status->settings_conflict_at_boot) {
        text_add_flash(line, FLASH_TEXT("stored ones do not fit together, defaults are active"));
        return;
    }
    text_add_flash(line, text_item(texts, (uint8_t)loaded->found));
    if (loaded->found > RECORD_LOADED_OTHER) {
        return;
    }
    const int32_t counts[] = {loaded->missing};
    if (loaded->missing != 0) {
        text_add_values(line, FLASH_TEXT("; #0 not stored, at defaults"), counts);
    }
    const int32_t dropped[] = {loaded->dropped, loaded->dropped_id};
    if (loaded->dropped != 0) {
        text_add_values(line, FLASH_TEXT("; #0 dropped, first id #0"), dropped);
    }
}

bool console_version_line(const console_t *console, console_out_t *out)
{
    const console_status_t *const status = console->status;
    text_line_t *const line = &out->line;
    switch (console->step) {
    case 0:
        text_add_flash(line, FLASH_TEXT("ninespring "));
        text_add_flash(line, status->version);
        text_add_flash(line, FLASH_TEXT(" mega2560, sensors "));
        text_add_flash(line, status->sensors);
        return true;
    case 1:
        text_add_flash(line, FLASH_TEXT("reset "));
        text_add_flash(line, status->reset_cause);
        text_add_flash(line, FLASH_TEXT("; settings "));
        add_loaded(line, console);
        return true;
    case 2: {
        const int32_t values[] = {status->ticks_late, status->tick_longest_us, status->load_percent,
                                  console->telemetry->dropped, status->stack_unused_bytes};
        text_add_values(line,
                        FLASH_TEXT("ticks late #0, longest tick #0 us, load #0 %, "
                                   "telemetry dropped #0, stack unused #0"),
                        values);
        return true;
    }
    case 3: {
        const int32_t broken = controller_broken_seals(console->controller);
        if (broken != 0) {
            text_add_values(
                line, FLASH_TEXT("memory changed by itself in what was believed: #0, begun anew"),
                &broken);
        }
        return broken != 0;
    }
    default:
        return false;
    }
}

/* ", limits supply temperature: 1.200 A less"; nothing where none acts. */
static void add_limits(text_line_t *line, const controller_t *controller, uint8_t spring)
{
    const uint16_t limits = controller_limits(controller, spring);
    if (limits == 0) {
        return;
    }
    text_add_flash(line, FLASH_TEXT(", limits"));
    telemetry_add_limits(line, limits, ' ');
    const int32_t cut_ma = controller_cut_ma(controller, spring);
    if (cut_ma != 0) {
        text_add_values(line, FLASH_TEXT(": #3 A less"), &cut_ma);
    }
}

static int32_t rounded(float value)
{
    return (int32_t)(value + (value < 0.0f ? -0.5f : 0.5f));
}

/* "spring 1: 80.2 degC, 78.9 to 82.0, 2.4 K above martensite start (+-2.1), austenite 99.6 %, 97.0
 * to 100.0, hold": what is believed, with the bounds of 99 %. */
static void add_belief(text_line_t *line, const controller_t *controller, uint8_t k)
{
    /* as drive_policy_stage_t has them */
    static const char stages[] FLASH_MEMORY = "\0, heat\0, hold\0, lower";
    const spring_bounds_t c = controller_temperature_bounds_c(controller, k);
    const spring_bounds_t distance_k = controller_distance_bounds_k(controller, k);
    const spring_bounds_t austenite = controller_austenite_bounds(controller, k);
    const bool below = distance_k.value < 0.0f;
    const int32_t values[] = {k + 1, rounded(10.0f * c.value), rounded(10.0f * c.low),
                              rounded(10.0f * c.high),
                              rounded(10.0f * (below ? -distance_k.value : distance_k.value))};
    text_add_values(line, FLASH_TEXT("spring #0: #1 degC, #1 to #1, #1 K "), values);
    text_add_flash(line, below ? FLASH_TEXT("below") : FLASH_TEXT("above"));
    const int32_t rest[] = {rounded(10.0f * (distance_k.high - distance_k.value)),
                            rounded(1000.0f * austenite.value), rounded(1000.0f * austenite.low),
                            rounded(1000.0f * austenite.high)};
    text_add_values(line, FLASH_TEXT(" martensite start (+-#1), austenite #1 %, #1 to #1"), rest);
    text_add_flash(line, text_item(stages, (uint8_t)controller_stage(controller, k)));
}

/* What the spring waits for, or would wait for, or why it is not where it was asked to be. */
static void add_reason(text_line_t *line, const controller_t *controller, uint8_t k)
{
    const uint16_t limits = controller_limits(controller, k);
    const bool waits = (limits & DRIVE_POLICY_LIMIT_COOLING) != 0;
    const float cooling_s = controller_cooling_s(controller, k);
    if (!waits && (limits & DRIVE_POLICY_LIMIT_AWAY) != 0) {
        text_add_flash(line, FLASH_TEXT("  away: not where it was asked to be, "
                                        "or that cannot be seen"));
    } else if (waits || cooling_s > 0.0f) {
        const int32_t seconds = rounded(cooling_s + 0.5f);
        text_add_flash(line, waits ? FLASH_TEXT("  waits") : FLASH_TEXT("  not known for"));
        text_add_values(line, FLASH_TEXT(" #0 s: it may still be hot from before power-on"),
                        &seconds);
    }
}

/* "[spring 2 was heated 12 s ago: 88 degC or more]", "[spring 2 may still be hot from before
 * power-on: wait 71 s]": what the hint `model cold` does not take away. */
bool console_warm_line(const console_t *console, console_out_t *out)
{
    const controller_t *const controller = console->controller;
    const uint8_t k = console->step;
    if (k >= controller_springs(controller)) {
        return false;
    }
    if (controller_is_warm(controller, k)) {
        const int32_t rest_s = controller_rest_s(controller, k);
        const int32_t values[] = {k + 1, rest_s};
        const int32_t warm_c = rounded(controller_delivered_c(controller, k) - 0.5f);
        text_add_values(&out->line,
                        rest_s == TEMPERATURE_CEILING_NEVER
                            ? FLASH_TEXT("[spring #0 was heated by others")
                            : FLASH_TEXT("[spring #0 was heated #0 s ago"),
                        values);
        text_add_values(&out->line, FLASH_TEXT(": #0 degC or more]"), &warm_c);
    } else if (controller_is_doubtful(controller, k)) {
        const int32_t values[] = {k + 1, rounded(controller_cooling_s(controller, k) + 0.5f)};
        text_add_values(&out->line,
                        FLASH_TEXT("[spring #0 may still be hot from before power-on: wait #0 s]"),
                        values);
    }
    return true;
}

/* "surroundings: losses 1.31 +-0.06 of what is declared": what the held springs have in common. */
static void add_surroundings(text_line_t *line, const controller_t *controller)
{
    float factor, sd;
    if (controller_losses(controller, &factor, &sd)) {
        const int32_t values[] = {rounded(100.0f * factor), rounded(100.0f * sd)};
        text_add_values(line, FLASH_TEXT("surroundings: losses #2 +-#2 of what is declared"),
                        values);
    }
}

/* "found: supply 4.93 V, diodes 0.38 V +-0.03; declared: 5.00 V, 0.00 V": what all circuits share.
 */
static void add_source(text_line_t *line, const controller_t *controller)
{
    const circuit_source_t *const source = controller_source(controller);
    const current_control_parameters_t *const declared = &controller->current.parameters;
    const int32_t values[] = {rounded(0.1f * circuit_source_supply_mv(source)),
                              rounded(0.1f * source->drop_mv), rounded(0.05f * source->unsure_mv),
                              rounded(0.1f * (float)declared->supply_mv),
                              rounded(0.1f * (float)declared->freewheel_mv)};
    text_add_values(line, FLASH_TEXT("found: supply #2 V, diodes #2 V +-#2; declared: #2 V, #2 V"),
                    values);
}

/* Steps: three for each spring, the ambient, what all lose, what feeds them; lines only where there
 * is something. */
bool console_model_line(const console_t *console, console_out_t *out)
{
    const controller_t *const controller = console->controller;
    text_line_t *const line = &out->line;
    const uint8_t k = console->step / 3u;
    if (k >= controller_springs(controller)) {
        const uint8_t last = (uint8_t)(console->step - 3u * controller_springs(controller));
        if (last == 0) {
            const int32_t ambient_cc = text_centi_from_c7(console->status->ambient_c7);
            text_add_values(line, FLASH_TEXT("ambient: #2 degC"), &ambient_cc);
        } else if (last == 1u) {
            add_surroundings(line, controller);
        } else {
            add_source(line, controller);
        }
        return last < 3u;
    }
    if (console->step % 3u == 0) {
        add_belief(line, controller, k);
    } else if (console->step % 3u == 1) {
        const int32_t values[] = {
            controller_measured_ma(controller, k), controller_measured_mv(controller, k),
            (int32_t)controller_power_uw(controller, k), controller_target_ma(controller, k)};
        text_add_values(line, FLASH_TEXT("  #3 A, #3 V, #6 W, target #3 A"), values);
        add_limits(line, controller, k);
    } else {
        add_reason(line, controller, k);
    }
    return true;
}

/* "spring 1: 0.1748 ohm at 20 degC, 0.040 % per K, austenite 0.2190 ohm, 25.1 % more, loss 3.2 %
 * (+-1.4), shift 0.4 K": the martensite's resistance and its rise, that of austenite when it had
 * just transformed, the loss beyond the declared one, by how much it transforms higher. */
static void add_learnt(text_line_t *line, const console_t *console, uint8_t k)
{
    const spring_learnt_t learnt = controller_learnt(console->controller, k);
    const float declared_w_per_k = 1e-6f * (float)console->settings->controller.model.loss_uw_per_k;
    add_spring(line, k);
    if (!(learnt.austenite_ohm > 0.0f) && !(learnt.martensite_ohm > 0.0f) &&
        learnt.loss_w_per_k == 0.0f) {
        text_add_flash(line, FLASH_TEXT("nothing yet"));
        return;
    }
    if (learnt.martensite_ohm > 0.0f) {
        const int32_t cold[] = {rounded(1e4f * learnt.martensite_ohm),
                                rounded(1e5f * learnt.martensite_rise_per_k)};
        text_add_values(line, FLASH_TEXT("#4 ohm at 20 degC, #3 % per K, "), cold);
    } else {
        text_add_flash(line, FLASH_TEXT("not seen cold, "));
    }
    if (learnt.austenite_ohm > 0.0f) {
        const int32_t hot[] = {rounded(1e4f * learnt.austenite_ohm),
                               rounded(1e3f * learnt.change / (1.0f - learnt.change))};
        text_add_values(line, FLASH_TEXT("austenite #4 ohm, #1 % more"), hot);
    } else {
        text_add_flash(line, FLASH_TEXT("not seen to transform"));
    }
    if (declared_w_per_k > 0.0f) {
        const int32_t loss[] = {rounded(1e3f * learnt.loss_w_per_k / declared_w_per_k),
                                rounded(1e3f * learnt.loss_sd_w_per_k / declared_w_per_k)};
        text_add_values(line, FLASH_TEXT(", loss #1 % (+-#1)"), loss);
    }
    const int32_t shift = rounded(10.0f * controller_shift_k(console->controller, k));
    text_add_values(line, FLASH_TEXT(", shift #1 K"), &shift);
}

bool console_learnt_line(const console_t *console, console_out_t *out)
{
    const uint8_t springs = controller_springs(console->controller);
    if (console->step < springs) {
        add_learnt(&out->line, console, console->step);
    } else if (console->step == springs) {
        text_add_flash(&out->line, FLASH_TEXT("loss and shift are beyond the declared ones; "));
        text_add_flash(&out->line, learnt_store_keeps(console->learnt)
                                       ? FLASH_TEXT("kept over power-off")
                                       : FLASH_TEXT("nothing is kept over power-off yet"));
    }
    return console->step <= springs;
}

static void add_fault(text_line_t *line, safety_fault_t fault)
{
    const int32_t number = (int32_t)fault;
    text_add_values(line, FLASH_TEXT("fault #0 "), &number);
    text_add_flash(line, safety_fault_name(fault));
    if (fault == SAFETY_FAULT_STUCK_ON || fault == SAFETY_FAULT_NO_SENSOR) {
        text_add_flash(line, FLASH_TEXT(": cut the supply"));
    }
}

static bool any_is_no_circuit(const controller_t *controller)
{
    bool any = false;
    for (uint8_t k = 0; k < controller_springs(controller); k++) {
        any = any || controller_fault(controller, k) == SAFETY_FAULT_SENSOR_MISMATCH;
    }
    return any;
}

/* Steps: the lock and the supply, the board, each spring, the thermistor, what readings were held
 * against; lines only where there is something. */
bool console_faults_line(const console_t *console, console_out_t *out)
{
    const controller_t *const controller = console->controller;
    text_line_t *const line = &out->line;
    if (console->step == 0) {
        if (controller_is_locked(controller)) {
            text_add_flash(line, FLASH_TEXT("locked"));
        } else if (controller_supply_is_off(controller)) {
            text_add_flash(line, FLASH_TEXT("supply: off"));
        }
    } else if (console->step == 1) {
        const safety_fault_t fault = controller_board_fault(controller);
        if (fault != SAFETY_FAULT_NONE) {
            text_add_flash(line, FLASH_TEXT("board: "));
            add_fault(line, fault);
        }
    } else {
        const uint8_t k = (uint8_t)(console->step - 2u), springs = controller_springs(controller);
        if (k == springs && console->status->ambient_is_held) {
            const int32_t ambient_cc = text_centi_from_c7(console->status->ambient_c7);
            text_add_values(line, FLASH_TEXT("thermistor: no room is as it says, #2 degC holds"),
                            &ambient_cc);
        } else if (k > springs && any_is_no_circuit(controller)) {
            add_source(line, controller);
        }
        if (k >= springs) {
            return k <= springs + 1u;
        }
        const safety_fault_t fault = controller_fault(controller, k);
        if (fault != SAFETY_FAULT_NONE) {
            add_spring(line, k);
            add_fault(line, fault);
            const int32_t wait_s = controller_clear_wait_s(controller, k);
            if (wait_s != 0) {
                text_add_values(line, FLASH_TEXT(": clear again in #0 s"), &wait_s);
            }
        }
    }
    return true;
}

/* As controller_sensor_status_t has them. */
static const char sensor_texts[] FLASH_MEMORY = "sensor ok\0"
                                                "sensor absent\0"
                                                "sensor bus stuck\0"
                                                "sensor stale\0"
                                                "sensor was reset";

void console_selftest_line(const console_t *console, const selftest_result_t *result)
{
    console_out_t out;
    console_out_start(&out);
    add_spring(&out.line, result->spring);
    text_add_flash(&out.line, text_item(sensor_texts, (uint8_t)result->sensor));
    if (result->fault != SAFETY_FAULT_NONE) {
        text_add_flash(&out.line, FLASH_TEXT(", "));
        add_fault(&out.line, result->fault);
    } else if (result->sound) {
        text_add_values(&out.line, FLASH_TEXT(", #3 ohm"), &result->resistance_mohm);
    } else if (result->sensor == CONTROLLER_SENSOR_OK) {
        text_add_flash(&out.line, FLASH_TEXT(", too little current"));
    }
    console_out_end(console, &out);
}

/* --- start and status ----------------------------------------------------------------------- */

void console_greet(console_t *console)
{
    for (console->step = 0; console->step < 2u; console->step++) {
        console_out_t out;
        console_out_start(&out);
        (void)console_version_line(console, &out);
        console_out_end(console, &out);
    }
    if (controller_is_locked(console->controller)) {
        console_out_t out;
        console_out_start(&out);
        text_add_flash(&out.line, FLASH_TEXT("locked: outputs stay off until unlock"));
        console_out_end(console, &out);
    }
}

void console_print_status(const console_t *console)
{
    const controller_t *const controller = console->controller;
    int32_t sum_ma = 0;
    int16_t hottest_c7 = INT16_MIN;
    uint8_t hottest = 0;
    uint8_t fault = (uint8_t)controller_board_fault(controller);
    bool on = false;
    console_out_t out;
    text_line_t *const line = &out.line;
    const uint8_t springs = controller_springs(controller);
    for (uint8_t k = 0; k < springs; k++) {
        sum_ma += controller_measured_ma(controller, k);
        on = on || controller_level_permille(controller, k) != 0;
        if (fault == 0) {
            fault = (uint8_t)controller_fault(controller, k);
        }
        if (controller_temperature_c7(controller, k) > hottest_c7) {
            hottest_c7 = controller_temperature_c7(controller, k);
            hottest = k;
        }
    }
    console_out_start(&out);
    text_add_char(line, '<');
    text_add_flash(line, controller_is_locked(controller) ? FLASH_TEXT("locked")
                         : fault != 0                     ? FLASH_TEXT("fault")
                         : on                             ? FLASH_TEXT("on")
                                                          : FLASH_TEXT("off"));
    const int32_t values[] = {sum_ma,
                              text_centi_from_c7(hottest_c7),
                              hottest + 1,
                              controller_fan_percent(controller),
                              fault,
                              console->status->ticks_late,
                              console->status->load_percent};
    text_add_flash(line, FLASH_TEXT("|t:"));
    text_add_time_s(line, &console->status->time);
    text_add_values(line,
                    FLASH_TEXT("|sum_a:#3|hottest_c:#2@#0|fan:#0|fault:#0|late:#0|load:#0|supply:"),
                    values);
    text_add_flash(line, !controller_supply_is_fitted(controller) ? FLASH_TEXT("none")
                         : !controller_supply_is_held(controller) ? FLASH_TEXT("off")
                                                                  : FLASH_TEXT("on"));
    if (console->status->ambient_is_held) {
        text_add_flash(line, FLASH_TEXT("|ambient:held"));
    }
    text_add_char(line, '>');
    console_out_end(console, &out);
}
