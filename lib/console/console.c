#include "console.h"

#include <stddef.h>
#include <string.h>

#define MAX_ARGUMENTS 2u

typedef enum {
    JOB_NONE = 0,
    JOB_HELP,
    JOB_VERSION,
    JOB_MODEL,
    JOB_FAULTS,
    JOB_SETTINGS,
    JOB_SAVE,
    JOB_TELEMETRY,
    JOB_SELFTEST
} job_t;

/* --- lines out ------------------------------------------------------------------------------ */

typedef struct {
    text_line_t line;
    char bytes[CONSOLE_ROOM_BYTES];
} out_t;

static void out_start(out_t *out)
{
    text_line_start(&out->line, out->bytes, CONSOLE_ROOM_BYTES - 2u);
}

static void out_end(const console_t *console, out_t *out)
{
    out->line.size = CONSOLE_ROOM_BYTES;
    text_add_flash(&out->line, FLASH_TEXT("\r\n"));
    console->output.write(console->output.context, out->line.bytes, out->line.length);
}

static void answer(const console_t *console, console_error_t error)
{
    out_t out;
    out_start(&out);
    if (error == CONSOLE_OK) {
        text_add_flash(&out.line, FLASH_TEXT("ok"));
    } else {
        const int32_t number = (int32_t)error;
        text_add_values(&out.line, FLASH_TEXT("error:#0 "), &number);
        text_add_flash(&out.line, console_error_text(error));
    }
    out_end(console, &out);
}

static bool room_for(const console_t *console, uint16_t bytes)
{
    return console->output.room(console->output.context) >= bytes;
}

static void add_spring(text_line_t *line, uint8_t spring)
{
    const int32_t number = spring + 1;
    text_add_values(line, FLASH_TEXT("spring #0: "), &number);
}

/* --- settings ------------------------------------------------------------------------------- */

/* Activates the settings as they are set. Where they do not fit together the active ones stay, and
 * the console says which value is in the way: `$$` of another board can only be pasted line by
 * line. */
static void apply_settings(console_t *console)
{
    uint16_t bad = PARAMETER_COUNT;
    console->conflict =
        !controller_apply_settings(console->controller, &console->settings->controller, &bad);
    if (!console->conflict) {
        return;
    }
    out_t out;
    out_start(&out);
    text_add_flash(&out.line, FLASH_TEXT("[not active yet: "));
    text_add(&out.line, parameter_row(bad).name);
    text_add_flash(&out.line, FLASH_TEXT(" does not fit the others]"));
    out_end(console, &out);
}

static void print_setting(const console_t *console, uint16_t index, uint8_t element)
{
    out_t out;
    char name[SETTINGS_NAME_SIZE];
    settings_name(index, element, name);
    out_start(&out);
    text_add_char(&out.line, '$');
    text_add(&out.line, name);
    text_add_char(&out.line, '=');
    text_add_decimal(&out.line, settings_get(console->settings, index, element),
                     parameter_row(index).decimals);
    out_end(console, &out);
}

static console_error_t error_of(settings_result_t result)
{
    switch (result) {
    case SETTINGS_OK:
        return CONSOLE_OK;
    case SETTINGS_UNKNOWN_NAME:
        return CONSOLE_ERROR_UNKNOWN_SETTING;
    case SETTINGS_OUT_OF_RANGE:
        return CONSOLE_ERROR_OUT_OF_RANGE;
    default:
        return CONSOLE_ERROR_BAD_ARGUMENT;
    }
}

/* Telemetry and policy can be set by word or as a setting: one truth, the setting. */
static void follow_board_settings(console_t *console)
{
    const board_settings_t *const board = &console->settings->board;
    if (console->telemetry->format != board->telemetry_format ||
        console->telemetry->hz != board->telemetry_hz) {
        telemetry_set(console->telemetry, board->telemetry_format, board->telemetry_hz);
    }
}

static console_error_t assign(console_t *console, const char *name, const char *value)
{
    const settings_t before = *console->settings;
    const console_error_t error = error_of(settings_assign(console->settings, name, value));
    if (error != CONSOLE_OK) {
        return error;
    }
    if (memcmp(&before.controller, &console->settings->controller, sizeof before.controller) != 0 ||
        console->conflict) {
        apply_settings(console);
    }
    follow_board_settings(console);
    return CONSOLE_OK;
}

static void start_job(console_t *console, job_t job)
{
    console->job = (uint8_t)job;
    console->step = 0;
    console->element = 0;
}

/* A line that starts with '$'. */
static console_error_t settings_line(console_t *console, char *line)
{
    uint16_t index;
    uint8_t element;
    char *const equals = strchr(line, '=');
    if (equals != NULL) {
        *equals = '\0';
        return assign(console, line + 1, equals + 1);
    }
    if (flash_equal(line, FLASH_TEXT("$$"))) {
        start_job(console, JOB_SETTINGS);
        return CONSOLE_OK;
    }
    if (flash_equal(line, FLASH_TEXT("$save"))) {
        if (console->conflict) {
            return CONSOLE_ERROR_SETTINGS_CONFLICT;
        }
        settings_save_start(console->store, console->settings);
        start_job(console, JOB_SAVE);
        return CONSOLE_OK;
    }
    if (flash_equal(line, FLASH_TEXT("$defaults"))) {
        settings_default(console->settings);
        apply_settings(console);
        follow_board_settings(console);
        return CONSOLE_OK;
    }
    if (!settings_find(line + 1, &index, &element)) {
        return CONSOLE_ERROR_UNKNOWN_SETTING;
    }
    print_setting(console, index, element);
    return CONSOLE_OK;
}

/* --- words ---------------------------------------------------------------------------------- */

typedef struct {
    uint8_t count;
    const char *argument[MAX_ARGUMENTS];
} arguments_t;

static console_error_t parse_number(const char *text, uint8_t decimals, int32_t lowest,
                                    int32_t highest, int32_t *value)
{
    int32_t number;
    switch (text_parse_decimal(text, decimals, &number)) {
    case TEXT_OK:
        break;
    case TEXT_TOO_LARGE:
        return CONSOLE_ERROR_OUT_OF_RANGE;
    default:
        return CONSOLE_ERROR_BAD_ARGUMENT;
    }
    if (number < lowest || number > highest) {
        return CONSOLE_ERROR_OUT_OF_RANGE;
    }
    *value = number;
    return CONSOLE_OK;
}

/* "all" or a spring's number; first..last count from 0. */
static console_error_t parse_springs(const console_t *console, const char *text, uint8_t *first,
                                     uint8_t *last)
{
    const uint8_t springs = controller_springs(console->controller);
    int32_t number;
    *first = 0;
    *last = (uint8_t)(springs - 1u);
    if (flash_equal(text, FLASH_TEXT("all"))) {
        return CONSOLE_OK;
    }
    const console_error_t error = parse_number(text, 0, 1, springs, &number);
    if (error == CONSOLE_OK) {
        *first = *last = (uint8_t)(number - 1);
    }
    return error;
}

/* Whether anything may be switched on at all. */
static console_error_t may_drive(const console_t *console)
{
    if (controller_is_locked(console->controller)) {
        return CONSOLE_ERROR_LOCKED;
    }
    return controller_board_fault(console->controller) == SAFETY_FAULT_NONE ? CONSOLE_OK
                                                                            : CONSOLE_ERROR_FAULT;
}

/* Springs off, or on at a level: what keeps one from being switched on does not keep it from being
 * switched off. */
static console_error_t switch_springs(console_t *console, const arguments_t *arguments, bool on)
{
    uint8_t first;
    uint8_t last;
    int32_t percent = on ? 100 : 0;
    console_error_t error = parse_springs(console, arguments->argument[0], &first, &last);
    if (error == CONSOLE_OK && arguments->count > 1) {
        error = parse_number(arguments->argument[1], 0, 0, 100, &percent);
    }
    if (error == CONSOLE_OK && on) {
        error = may_drive(console);
        if (error == CONSOLE_OK && first == last &&
            controller_fault(console->controller, first) != SAFETY_FAULT_NONE) {
            error = CONSOLE_ERROR_FAULT;
        }
    }
    if (error != CONSOLE_OK) {
        return error;
    }
    for (uint8_t k = first; k <= last; k++) {
        controller_set_target(console->controller, k, (uint16_t)percent * 10u);
    }
    return CONSOLE_OK;
}

static console_error_t word_on(console_t *console, const arguments_t *arguments)
{
    return switch_springs(console, arguments, true);
}

static console_error_t word_off(console_t *console, const arguments_t *arguments)
{
    return switch_springs(console, arguments, false);
}

static console_error_t word_pattern(console_t *console, const arguments_t *arguments)
{
    bool on[CONTROLLER_MAX_SPRINGS] = {false};
    bool any = false;
    const char *const bits = arguments->argument[0];
    const uint8_t springs = controller_springs(console->controller);
    for (uint8_t k = 0; k < springs; k++) {
        if (bits[k] != '0' && bits[k] != '1') { /* the end, too */
            return CONSOLE_ERROR_BAD_ARGUMENT;
        }
        on[k] = bits[k] == '1';
        any = any || on[k];
    }
    if (bits[springs] != '\0') {
        return CONSOLE_ERROR_BAD_ARGUMENT;
    }
    const console_error_t error = any ? may_drive(console) : CONSOLE_OK;
    if (error == CONSOLE_OK) {
        controller_set_pattern(console->controller, on);
    }
    return error;
}

static console_error_t word_policy(console_t *console, const arguments_t *arguments)
{
    drive_policy_kind_t kind;
    if (flash_equal(arguments->argument[0], FLASH_TEXT("open"))) {
        kind = DRIVE_POLICY_OPEN;
    } else if (flash_equal(arguments->argument[0], FLASH_TEXT("precompensate"))) {
        kind = DRIVE_POLICY_PRECOMPENSATE;
    } else {
        return CONSOLE_ERROR_BAD_ARGUMENT;
    }
    if (!controller_set_policy(console->controller, kind)) {
        return CONSOLE_ERROR_NOT_AVAILABLE;
    }
    console->settings->controller.policy.policy = (uint8_t)kind;
    return CONSOLE_OK;
}

static console_error_t word_fan(console_t *console, const arguments_t *arguments)
{
    int32_t percent = 0;
    const console_error_t error = parse_number(arguments->argument[0], 0, 0, 100, &percent);
    if (error == CONSOLE_OK) {
        controller_set_fan(console->controller, (uint8_t)percent);
    }
    return error;
}

static console_error_t word_ambient(console_t *console, const arguments_t *arguments)
{
    return error_of(settings_assign(console->settings, "ambient_c", arguments->argument[0]));
}

static console_error_t word_telemetry(console_t *console, const arguments_t *arguments)
{
    static const char names[TELEMETRY_FORMAT_COUNT][9] FLASH_MEMORY = {"off", "csv", "teleplot"};
    int32_t hz = console->settings->board.telemetry_hz;
    uint8_t format = 0;
    while (format < TELEMETRY_FORMAT_COUNT && !flash_equal(arguments->argument[0], names[format])) {
        format++;
    }
    if (format == TELEMETRY_FORMAT_COUNT) {
        return CONSOLE_ERROR_BAD_ARGUMENT;
    }
    if (arguments->count > 1) {
        const console_error_t error =
            parse_number(arguments->argument[1], 0, 1, TELEMETRY_TICKS_PER_S, &hz);
        if (error != CONSOLE_OK) {
            return error;
        }
    }
    console->next_format = format;
    console->next_hz = (uint8_t)hz;
    telemetry_set(console->telemetry, TELEMETRY_OFF, (uint8_t)hz);
    start_job(console, JOB_TELEMETRY);
    return CONSOLE_OK;
}

static console_error_t word_clear(console_t *console, const arguments_t *arguments)
{
    (void)arguments;
    controller_clear_faults(console->controller);
    return CONSOLE_OK;
}

static console_error_t word_unlock(console_t *console, const arguments_t *arguments)
{
    (void)arguments;
    controller_unlock(console->controller);
    return CONSOLE_OK;
}

static bool any_spring_on(const console_t *console)
{
    for (uint8_t k = 0; k < controller_springs(console->controller); k++) {
        if (controller_level_permille(console->controller, k) != 0) {
            return true;
        }
    }
    return false;
}

static console_error_t word_selftest(console_t *console, const arguments_t *arguments)
{
    (void)arguments;
    if (any_spring_on(console)) {
        return CONSOLE_ERROR_SPRINGS_ON;
    }
    const console_error_t error = may_drive(console);
    if (error == CONSOLE_OK) {
        selftest_start(&console->selftest, console->controller,
                       console->settings->controller.policy.open_current_ma);
        start_job(console, JOB_SELFTEST);
    }
    return error;
}

static console_error_t word_model(console_t *console, const arguments_t *arguments)
{
    if (arguments->count == 0) {
        start_job(console, JOB_MODEL);
        return CONSOLE_OK;
    }
    if (!flash_equal(arguments->argument[0], FLASH_TEXT("cold"))) {
        return CONSOLE_ERROR_BAD_ARGUMENT;
    }
    if (any_spring_on(console)) {
        return CONSOLE_ERROR_SPRINGS_ON;
    }
    controller_set_temperature(console->controller, console->status->ambient_c7);
    return CONSOLE_OK;
}

/* X(word, least arguments, most arguments, job or NONE, function or NULL, usage after the word) */
#define WORDS(X)                                                                                   \
    X(help, 0, 0, HELP, NULL, "  this list")                                                       \
    X(version, 0, 0, VERSION, NULL, "  what runs here, why it started, how it is doing")           \
    X(on, 1, 2, NONE, word_on, " K|all [0..100]  drive a spring or all, at a level in percent")    \
    X(off, 1, 1, NONE, word_off, " K|all")                                                         \
    X(pattern, 1, 1, NONE, word_pattern, " 111101111  all springs at once, row by row")            \
    X(policy, 1, 1, NONE, word_policy, " open|precompensate")                                      \
    X(fan, 1, 1, NONE, word_fan, " 0..100  in percent")                                            \
    X(ambient, 1, 1, NONE, word_ambient, " C  air temperature, where no sensor measures it")       \
    X(model, 0, 1, NONE, word_model,                                                               \
      " [cold]  temperatures as the model has them; cold: at ambient")                             \
    X(faults, 0, 0, FAULTS, NULL, "  what is latched")                                             \
    X(clear, 0, 0, NONE, word_clear, "  forget faults; all springs off")                           \
    X(unlock, 0, 0, NONE, word_unlock, "  after a watchdog or brown-out reset")                    \
    X(selftest, 0, 0, NONE, word_selftest, "  each sensor, and each spring with 0.3 A")            \
    X(telemetry, 1, 2, NONE, word_telemetry, " off|csv|teleplot [1..50]  lines per second")

#define WORD_TEXT(word, least, most, job, function, usage) #word usage "\0"
static const char word_texts[] FLASH_MEMORY = WORDS(WORD_TEXT);

typedef struct {
    uint8_t least; /* arguments */
    uint8_t most;
    uint8_t job; /* job_t that it starts, or JOB_NONE and a function */
    console_error_t (*function)(console_t *console, const arguments_t *arguments);
} word_t;

#define WORD_ROW(word, least, most, job, function, usage) {least, most, JOB_##job, function},
static const word_t words[] FLASH_MEMORY = {WORDS(WORD_ROW)};
#define WORD_COUNT ((uint8_t)(sizeof words / sizeof words[0]))

/* text, in flash, begins with this word and a blank. */
static bool begins_with(const char *text, const char *word)
{
    for (; *word != '\0'; text++, word++) {
        if (*word != (char)flash_byte(text)) {
            return false;
        }
    }
    return flash_byte(text) == ' ';
}

/* The next word of a line, which then ends with it; NULL where none is left. */
static char *next_word(char **rest)
{
    char *word = *rest;
    while (*word == ' ') {
        word++;
    }
    char *end = word;
    while (*end != ' ' && *end != '\0') {
        end++;
    }
    *rest = end;
    if (*end == ' ') {
        *end = '\0';
        (*rest)++;
    }
    return end == word ? NULL : word;
}

static console_error_t execute(console_t *console)
{
    if (console->line[0] == '$') {
        return settings_line(console, console->line);
    }
    word_t word;
    arguments_t arguments = {0, {NULL, NULL}};
    uint8_t given = 0;
    char *rest = console->line;
    const char *const name = next_word(&rest);
    if (name == NULL) {
        return CONSOLE_OK; /* blanks only */
    }
    for (const char *next = next_word(&rest); next != NULL; next = next_word(&rest)) {
        if (given < MAX_ARGUMENTS) {
            arguments.argument[given] = next;
        }
        given++;
    }
    const char *text = word_texts;
    for (uint8_t i = 0; i < WORD_COUNT; i++, text = text_item(text, 1)) {
        if (!begins_with(text, name)) {
            continue;
        }
        flash_copy(&word, &words[i], sizeof word);
        if (given < word.least) {
            return CONSOLE_ERROR_MISSING_ARGUMENT;
        }
        if (given > word.most) {
            return CONSOLE_ERROR_SURPLUS_ARGUMENT;
        }
        arguments.count = given;
        if (word.job != JOB_NONE) {
            start_job(console, (job_t)word.job);
            return CONSOLE_OK;
        }
        return word.function(console, &arguments);
    }
    return CONSOLE_ERROR_UNKNOWN_WORD;
}

/* --- answers of several lines --------------------------------------------------------------- */

static bool help_line(const console_t *console, out_t *out)
{
    static const char more[] FLASH_MEMORY = "$$  all settings   $NAME  one   $NAME=VALUE  set it\0"
                                            "$save  keep them   $defaults  the built-in ones\0"
                                            "!  all springs off at once, at any moment\0"
                                            "?  one line of status, at any moment";
    if (console->step < WORD_COUNT) {
        text_add_flash(&out->line, text_item(word_texts, console->step));
        return true;
    }
    const uint8_t rest = (uint8_t)(console->step - WORD_COUNT);
    if (rest < 4u) {
        text_add_flash(&out->line, text_item(more, rest));
        return true;
    }
    return false;
}

static void add_loaded(text_line_t *line, const console_status_t *status)
{
    /* as record_found_t has them */
    static const char texts[] FLASH_MEMORY = "loaded\0"
                                             "loaded; the other copy is damaged or was cut short\0"
                                             "none saved, defaults\0"
                                             "stored ones damaged, defaults\0"
                                             "stored by another version, defaults";
    const settings_loaded_t *const loaded = &status->loaded;
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

static bool version_line(const console_t *console, out_t *out)
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
        add_loaded(line, status);
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
    default:
        return false;
    }
}

/* ", limits supply temperature: 1.200 A less"; nothing where none acts. */
static void add_limits(text_line_t *line, const controller_t *controller, uint8_t spring)
{
    const uint8_t limits = controller_limits(controller, spring);
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

static bool model_line(const console_t *console, out_t *out)
{
    const controller_t *const controller = console->controller;
    text_line_t *const line = &out->line;
    const uint8_t k = console->step;
    if (k == controller_springs(controller)) {
        const int32_t ambient_cc = text_centi_from_c7(console->status->ambient_c7);
        text_add_values(line, FLASH_TEXT("ambient: #2 C"), &ambient_cc);
        return true;
    }
    if (k > controller_springs(controller)) {
        return false;
    }
    const int32_t values[] = {k + 1,
                              text_centi_from_c7(controller_temperature_c7(controller, k)),
                              controller_austenite_permille(controller, k),
                              controller_measured_ma(controller, k),
                              controller_measured_mv(controller, k),
                              (int32_t)controller_power_uw(controller, k),
                              controller_target_ma(controller, k)};
    text_add_values(
        line, FLASH_TEXT("spring #0: #2 C, austenite #1 %, #3 A, #3 V, #6 W, target #3 A"), values);
    add_limits(line, controller, k);
    return true;
}

static void add_fault(text_line_t *line, safety_fault_t fault)
{
    const int32_t number = (int32_t)fault;
    text_add_values(line, FLASH_TEXT("fault #0 "), &number);
    text_add_flash(line, safety_fault_name(fault));
}

/* Steps: the lock, the board, each spring; lines only where there is something. */
static bool faults_line(const console_t *console, out_t *out)
{
    const controller_t *const controller = console->controller;
    text_line_t *const line = &out->line;
    if (console->step == 0) {
        if (controller_is_locked(controller)) {
            text_add_flash(line, FLASH_TEXT("locked"));
        }
    } else if (console->step == 1) {
        const safety_fault_t fault = controller_board_fault(controller);
        if (fault != SAFETY_FAULT_NONE) {
            text_add_flash(line, FLASH_TEXT("board: "));
            add_fault(line, fault);
        }
    } else {
        const uint8_t k = (uint8_t)(console->step - 2u);
        if (k >= controller_springs(controller)) {
            return false;
        }
        const safety_fault_t fault = controller_fault(controller, k);
        if (fault != SAFETY_FAULT_NONE) {
            add_spring(line, k);
            add_fault(line, fault);
        }
    }
    return true;
}

/* --- jobs ----------------------------------------------------------------------------------- */

static void end_job(console_t *console, console_error_t error)
{
    console->job = JOB_NONE;
    answer(console, error);
}

static void list_settings(console_t *console)
{
    if (console->step == PARAMETER_COUNT) {
        end_job(console, CONSOLE_OK);
        return;
    }
    print_setting(console, console->step, console->element);
    if (++console->element >= parameter_row(console->step).count) {
        console->element = 0;
        console->step++;
    }
}

static void start_telemetry(console_t *console)
{
    const uint8_t springs = controller_springs(console->controller);
    uint8_t piece = 0;
    if (console->next_format == TELEMETRY_CSV) {
        if (!room_for(console, TELEMETRY_LINE_BYTES((uint16_t)springs))) {
            return;
        }
        out_t out;
        out_start(&out);
        while (telemetry_header(springs, piece++, &out.line)) {
            console->output.write(console->output.context, out.line.bytes, out.line.length);
            out.line.length = 0;
        }
    }
    console->settings->board.telemetry_format = console->next_format;
    console->settings->board.telemetry_hz = console->next_hz;
    telemetry_set(console->telemetry, console->next_format, console->next_hz);
    end_job(console, CONSOLE_OK);
}

/* As controller_sensor_status_t has them. */
static const char sensor_texts[] FLASH_MEMORY = "sensor ok\0"
                                                "sensor absent\0"
                                                "sensor bus stuck\0"
                                                "sensor stale\0"
                                                "sensor was reset";

static void selftest(console_t *console)
{
    selftest_result_t result;
    switch (selftest_step(&console->selftest, console->controller, console->status->ticks,
                          console->status->sensor_status, &result)) {
    case SELFTEST_WAITS:
        return;
    case SELFTEST_ENDED:
        end_job(console,
                console->selftest.failures == 0 ? CONSOLE_OK : CONSOLE_ERROR_SELFTEST_FAILED);
        return;
    default:
        break;
    }
    out_t out;
    out_start(&out);
    add_spring(&out.line, result.spring);
    text_add_flash(&out.line, text_item(sensor_texts, (uint8_t)result.sensor));
    if (result.fault != SAFETY_FAULT_NONE) {
        text_add_flash(&out.line, FLASH_TEXT(", "));
        add_fault(&out.line, result.fault);
    } else if (result.sound) {
        text_add_values(&out.line, FLASH_TEXT(", #3 ohm"), &result.resistance_mohm);
    } else if (result.sensor == CONTROLLER_SENSOR_OK) {
        text_add_flash(&out.line, FLASH_TEXT(", too little current"));
    }
    out_end(console, &out);
}

static void save(console_t *console)
{
    switch (record_store_step(&console->store->record)) {
    case RECORD_SAVE_BUSY:
        break;
    case RECORD_SAVE_DONE:
        end_job(console, CONSOLE_OK);
        break;
    default:
        end_job(console, CONSOLE_ERROR_SAVE_FAILED);
        break;
    }
}

static void print_job_line(console_t *console)
{
    out_t out;
    bool more;
    out_start(&out);
    switch (console->job) {
    case JOB_HELP:
        more = help_line(console, &out);
        break;
    case JOB_VERSION:
        more = version_line(console, &out);
        break;
    case JOB_MODEL:
        more = model_line(console, &out);
        break;
    default:
        more = faults_line(console, &out);
        break;
    }
    if (!more) {
        end_job(console, CONSOLE_OK);
        return;
    }
    if (out.line.length > 0) {
        out_end(console, &out);
    }
    console->step++;
}

void console_service(console_t *console)
{
    if (console->job == JOB_NONE || !room_for(console, CONSOLE_ROOM_BYTES)) {
        return;
    }
    switch (console->job) {
    case JOB_SETTINGS:
        list_settings(console);
        break;
    case JOB_SAVE:
        save(console);
        break;
    case JOB_TELEMETRY:
        start_telemetry(console);
        break;
    case JOB_SELFTEST:
        selftest(console);
        break;
    default:
        print_job_line(console);
        break;
    }
}

bool console_busy(const console_t *console)
{
    return console->job != JOB_NONE;
}

/* --- lines in ------------------------------------------------------------------------------- */

bool console_ready(const console_t *console)
{
    /* a refused setting says two lines */
    return console->job == JOB_NONE && room_for(console, 2u * CONSOLE_ROOM_BYTES);
}

void console_break_line(console_t *console, console_error_t error)
{
    console->broken = (uint8_t)error;
}

void console_stop(console_t *console)
{
    if (console->job == JOB_SELFTEST) {
        selftest_end(&console->selftest, console->controller);
    }
    if (console->job != JOB_NONE && console->job != JOB_SAVE) {
        end_job(console, CONSOLE_ERROR_STOPPED);
    }
    if (console->length > 0 || console->broken != CONSOLE_OK) {
        console->broken = CONSOLE_ERROR_STOPPED;
    }
}

void console_receive(console_t *console, uint8_t octet)
{
    if (octet == '\n' || octet == '\r') {
        const uint8_t length = console->length;
        console_error_t error = (console_error_t)console->broken;
        console->line[length] = '\0';
        console->length = 0;
        console->broken = CONSOLE_OK;
        if (length == 0 && error == CONSOLE_OK) {
            return;
        }
        if (error == CONSOLE_OK) {
            error = execute(console);
        }
        if (console->job == JOB_NONE) {
            answer(console, error);
        }
        return;
    }
    if (octet < ' ' || octet > '~') {
        if (console->broken == CONSOLE_OK) {
            console->broken = CONSOLE_ERROR_BAD_CHARACTER;
        }
        return;
    }
    if (console->length == CONSOLE_LINE_BYTES) {
        if (console->broken == CONSOLE_OK) {
            console->broken = CONSOLE_ERROR_LINE_TOO_LONG;
        }
        return;
    }
    console->line[console->length++] = (char)octet;
}

/* --- start and status ----------------------------------------------------------------------- */

void console_init(console_t *console, const text_output_t *output, controller_t *controller,
                  settings_t *settings, settings_store_t *store, telemetry_t *telemetry,
                  const console_status_t *status)
{
    memset(console, 0, sizeof *console);
    console->output = *output;
    console->controller = controller;
    console->settings = settings;
    console->store = store;
    console->telemetry = telemetry;
    console->status = status;
}

void console_greet(console_t *console)
{
    for (console->step = 0; console->step < 2u; console->step++) {
        out_t out;
        out_start(&out);
        (void)version_line(console, &out);
        out_end(console, &out);
    }
    if (controller_is_locked(console->controller)) {
        out_t out;
        out_start(&out);
        text_add_flash(&out.line, FLASH_TEXT("locked: outputs stay off until unlock"));
        out_end(console, &out);
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
    out_t out;
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
    out_start(&out);
    text_add_char(line, '<');
    text_add_flash(line, controller_is_locked(controller) ? FLASH_TEXT("locked")
                         : fault != 0                     ? FLASH_TEXT("fault")
                         : on                             ? FLASH_TEXT("on")
                                                          : FLASH_TEXT("off"));
    const int32_t values[] = {(int32_t)(console->status->time_ms & 0x7FFFFFFFul),
                              sum_ma,
                              text_centi_from_c7(hottest_c7),
                              hottest + 1,
                              controller_fan_percent(controller),
                              fault,
                              console->status->ticks_late,
                              console->status->load_percent};
    text_add_values(line,
                    FLASH_TEXT("|t:#3|sum_a:#3|hottest_c:#2@#0|fan:#0|fault:#0|late:#0|load:#0>"),
                    values);
    out_end(console, &out);
}
