#include "console_internal.h"

#include <stddef.h>
#include <string.h>

#define MAX_ARGUMENTS 2u

/* --- words ---------------------------------------------------------------------------------- */

typedef struct {
    uint8_t count;
    const char *argument[MAX_ARGUMENTS];
} arguments_t;

/* A whole number; range says, with the two limits, what it may be. */
static console_error_t parse_number(console_t *console, const char *text, const char *range,
                                    int32_t lowest, int32_t highest, int32_t *value)
{
    int32_t number;
    const text_result_t result = text_parse_decimal(text, 0, &number);
    if (result == TEXT_OK && number >= lowest && number <= highest) {
        *value = number;
        return CONSOLE_OK;
    }
    console_hint_text(console, range, lowest, highest);
    return result == TEXT_NOT_A_NUMBER ? CONSOLE_ERROR_BAD_ARGUMENT : CONSOLE_ERROR_OUT_OF_RANGE;
}

/* As it is written: "50" or "50%". */
static console_error_t parse_percent(console_t *console, const char *text, const char *range,
                                     int32_t *value)
{
    char digits[8];
    const size_t length = strlen(text);
    if (length > 0 && length < sizeof digits && text[length - 1u] == '%') {
        memcpy(digits, text, length);
        digits[length - 1u] = '\0';
        text = digits;
    }
    return parse_number(console, text, range, 0, 100, value);
}

static bool parse_on_off(const char *text, bool *on)
{
    *on = flash_equal(text, FLASH_TEXT("on"));
    return *on || flash_equal(text, FLASH_TEXT("off"));
}

/* "all" or a spring's number; first..last count from 0. */
static console_error_t parse_springs(console_t *console, const char *text, uint8_t *first,
                                     uint8_t *last)
{
    const uint8_t springs = controller_springs(console->controller);
    int32_t number;
    *first = 0;
    *last = (uint8_t)(springs - 1u);
    if (flash_equal(text, FLASH_TEXT("all"))) {
        return CONSOLE_OK;
    }
    const console_error_t error = parse_number(
        console, text, FLASH_TEXT("springs are #0 to #0, or all"), 1, springs, &number);
    if (error == CONSOLE_OK) {
        *first = *last = (uint8_t)(number - 1);
    }
    return error;
}

/* Whether anything may be switched on at all. */
static console_error_t may_drive(console_t *console)
{
    if (console->conflict) {
        console_apply_settings(console); /* says which */
        return CONSOLE_ERROR_SETTINGS_CONFLICT;
    }
    if (controller_is_locked(console->controller)) {
        return CONSOLE_ERROR_LOCKED;
    }
    if (controller_board_fault(console->controller) != SAFETY_FAULT_NONE) {
        return CONSOLE_ERROR_FAULT;
    }
    return controller_supply_is_off(console->controller) ? CONSOLE_ERROR_SUPPLY_OFF : CONSOLE_OK;
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
        error = parse_percent(console, arguments->argument[1],
                              FLASH_TEXT("the level is #0 to #0 percent, whole"), &percent);
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
    for (uint8_t k = 0; k < springs && bits[k] != '\0'; k++) {
        if (bits[k] != '0' && bits[k] != '1') {
            console_hint_text(
                console, FLASH_TEXT("a pattern has #0 digits, 0 or 1; character #0 is neither"),
                springs, k + 1);
            return CONSOLE_ERROR_BAD_ARGUMENT;
        }
        on[k] = bits[k] == '1';
        any = any || on[k];
    }
    const size_t characters = strlen(bits);
    if (characters != springs) {
        console_hint_text(console,
                          FLASH_TEXT("a pattern has #0 digits, 0 or 1; this has #0 characters"),
                          springs, (int32_t)characters);
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
    console_open_settings(console);
    console->settings->controller.policy.policy = (uint8_t)kind;
    console_seal_settings(console);
    return CONSOLE_OK;
}

static console_error_t word_fan(console_t *console, const arguments_t *arguments)
{
    int32_t percent = 0;
    const console_error_t error =
        parse_percent(console, arguments->argument[0],
                      FLASH_TEXT("the fan is #0 to #0 percent, whole"), &percent);
    if (error == CONSOLE_OK) {
        controller_set_fan(console->controller, (uint8_t)percent);
    }
    return error;
}

static console_error_t word_ambient(console_t *console, const arguments_t *arguments)
{
    char name[SETTINGS_NAME_SIZE]; /* written out it would lie in RAM */
    settings_name(PARAMETER_ambient_c, 0, name);
    const console_error_t error = console_assign(console, name, arguments->argument[0]);
    if (error == CONSOLE_OK && console->settings->board.ambient_source == SETTINGS_AMBIENT_NTC) {
        console_out_t out;
        console_out_start(&out);
        text_add_flash(&out.line,
                       FLASH_TEXT("[not now: the thermistor tells it, ambient_source=1]"));
        console_out_end(console, &out);
    }
    return error;
}

bool console_any_spring_on(const console_t *console)
{
    for (uint8_t k = 0; k < controller_springs(console->controller); k++) {
        if (controller_level_permille(console->controller, k) != 0) {
            return true;
        }
    }
    return false;
}

static console_error_t begin_inputs(console_t *console, const arguments_t *arguments)
{
    if (arguments->count > 1) {
        return CONSOLE_ERROR_SURPLUS_ARGUMENT; /* each tick has its line */
    }
    if (console_any_spring_on(console)) {
        return CONSOLE_ERROR_SPRINGS_ON;
    }
    console_error_t error = may_drive(console);
    for (uint8_t k = 0; k < controller_springs(console->controller); k++) {
        if (controller_fault(console->controller, k) != SAFETY_FAULT_NONE) {
            error = CONSOLE_ERROR_FAULT; /* to begin anew would forget it, and what tells of it */
        }
    }
    if (error == CONSOLE_OK) {
        telemetry_set(console->telemetry, TELEMETRY_OFF, console->telemetry->hz);
        console_start_job(console, CONSOLE_JOB_INPUTS);
    }
    return error;
}

static console_error_t word_telemetry(console_t *console, const arguments_t *arguments)
{
    static const char names[TELEMETRY_FORMAT_COUNT][9] FLASH_MEMORY = {"off", "csv", "teleplot",
                                                                       "inputs"};
    int32_t hz = console->settings->board.telemetry_hz;
    uint8_t format = 0;
    while (format < TELEMETRY_FORMAT_COUNT && !flash_equal(arguments->argument[0], names[format])) {
        format++;
    }
    if (format == TELEMETRY_FORMAT_COUNT) {
        return CONSOLE_ERROR_BAD_ARGUMENT;
    }
    if (format == TELEMETRY_INPUTS) {
        return begin_inputs(console, arguments);
    }
    if (arguments->count > 1) {
        const console_error_t error =
            parse_number(console, arguments->argument[1], FLASH_TEXT("#0 to #0 lines a second"), 1,
                         TELEMETRY_TICKS_PER_S, &hz);
        if (error != CONSOLE_OK) {
            return error;
        }
    }
    console->next_format = format;
    console->next_hz = (uint8_t)hz;
    telemetry_set(console->telemetry, TELEMETRY_OFF, (uint8_t)hz);
    console_start_job(console, CONSOLE_JOB_TELEMETRY);
    return CONSOLE_OK;
}

static console_error_t word_clear(console_t *console, const arguments_t *arguments)
{
    (void)arguments;
    controller_clear_faults(console->controller);
    console_start_job(console, CONSOLE_JOB_FAULTS); /* that stay */
    return CONSOLE_OK;
}

static console_error_t word_unlock(console_t *console, const arguments_t *arguments)
{
    (void)arguments;
    controller_unlock(console->controller);
    return CONSOLE_OK;
}

static console_error_t word_supply(console_t *console, const arguments_t *arguments)
{
    bool on;
    if (!parse_on_off(arguments->argument[0], &on)) {
        return CONSOLE_ERROR_BAD_ARGUMENT;
    }
    if (!controller_supply_is_fitted(console->controller)) {
        console_hint_text(console, FLASH_TEXT("by cut_off=0 no relay is fitted"), 0, 0);
        return CONSOLE_ERROR_NOT_AVAILABLE;
    }
    return controller_set_supply(console->controller, on) ? CONSOLE_OK : CONSOLE_ERROR_FAULT;
}

static console_error_t word_selftest(console_t *console, const arguments_t *arguments)
{
    (void)arguments;
    if (console_any_spring_on(console)) {
        return CONSOLE_ERROR_SPRINGS_ON;
    }
    const console_error_t error = may_drive(console);
    if (error == CONSOLE_OK) {
        selftest_start(&console->selftest, console->controller);
        console_start_job(console, CONSOLE_JOB_SELFTEST);
    }
    return error;
}

static console_error_t word_model(console_t *console, const arguments_t *arguments)
{
    if (arguments->count == 0) {
        console_start_job(console, CONSOLE_JOB_MODEL);
        return CONSOLE_OK;
    }
    if (!flash_equal(arguments->argument[0], FLASH_TEXT("cold"))) {
        return CONSOLE_ERROR_BAD_ARGUMENT;
    }
    if (console_any_spring_on(console)) {
        return CONSOLE_ERROR_SPRINGS_ON;
    }
    controller_set_temperature(console->controller, console->status->ambient_c7);
    console_start_job(console, CONSOLE_JOB_COLD);
    return CONSOLE_OK;
}

static console_error_t word_learnt(console_t *console, const arguments_t *arguments)
{
    if (arguments->count == 0) {
        console_start_job(console, CONSOLE_JOB_LEARNT);
        return CONSOLE_OK;
    }
    if (!flash_equal(arguments->argument[0], FLASH_TEXT("clear"))) {
        return CONSOLE_ERROR_BAD_ARGUMENT;
    }
    if (console_any_spring_on(console)) {
        return CONSOLE_ERROR_SPRINGS_ON;
    }
    learnt_store_clear(console->learnt, console->controller);
    console_start_job(console, CONSOLE_JOB_FORGET);
    return CONSOLE_OK;
}

static console_error_t word_why(console_t *console, const arguments_t *arguments)
{
    int32_t number = 0;
    const console_error_t error =
        parse_number(console, arguments->argument[0], FLASH_TEXT("springs are #0 to #0"), 1,
                     controller_springs(console->controller), &number);
    if (error == CONSOLE_OK) {
        console_start_job(console, CONSOLE_JOB_WHY);
        console->element = (uint8_t)(number - 1);
        console->sight = spring_sights_first(controller_sights(console->controller));
    }
    return error;
}

static console_error_t word_echo(console_t *console, const arguments_t *arguments)
{
    bool on;
    if (!parse_on_off(arguments->argument[0], &on)) {
        return CONSOLE_ERROR_BAD_ARGUMENT;
    }
    console->echo = on;
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
      " [cold]  what is believed of each spring, with bounds; cold: what was off for long is at "  \
      "ambient")                                                                                   \
    X(learnt, 0, 1, NONE, word_learnt, " [clear]  each spring's own numbers; clear: forget them")  \
    X(why, 1, 1, NONE, word_why, " K  the last sights of a spring: read, believed, what was done") \
    X(faults, 0, 0, FAULTS, NULL, "  what is latched")                                             \
    X(clear, 0, 0, NONE, word_clear, "  forget faults, say what stays; all springs off")           \
    X(unlock, 0, 0, NONE, word_unlock, "  after a watchdog or brown-out reset")                    \
    X(supply, 1, 1, NONE, word_supply, " on|off  of all stages, where a cut-off is fitted")        \
    X(selftest, 0, 0, NONE, word_selftest, "  each sensor, and each spring with 0.3 A")            \
    X(telemetry, 1, 2, NONE, word_telemetry,                                                       \
      " off|csv|teleplot|inputs [1..50]  lines per second; inputs: for a replay")                  \
    X(echo, 1, 1, NONE, word_echo, " on|off  show what is typed; backspace works either way")

#define WORD_TEXT(word, least, most, job, function, usage) #word usage "\0"
static const char word_texts[] FLASH_MEMORY = WORDS(WORD_TEXT);

typedef struct {
    uint8_t least; /* arguments */
    uint8_t most;
    uint8_t job; /* console_job_t that it starts, or CONSOLE_JOB_NONE and a function */
    console_error_t (*function)(console_t *console, const arguments_t *arguments);
} word_t;

#define WORD_ROW(word, least, most, job, function, usage)                                          \
    {least, most, CONSOLE_JOB_##job, function},
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

/* "write on K|all [0..100]": a word's text as far as its explanation. */
void console_add_usage(text_line_t *line, uint16_t word)
{
    const char *text = text_item(word_texts, (uint8_t)word);
    text_add_flash(line, FLASH_TEXT("write "));
    for (;; text++) {
        const char character = (char)flash_byte(text);
        if (character == '\0' || (character == ' ' && flash_byte(text + 1) == ' ')) {
            return;
        }
        text_add_char(line, character);
    }
}

/* The word that has most of its first letters, two at least. */
static void hint_nearest_word(console_t *console, const char *name)
{
    uint8_t longest = 1;
    const char *text = word_texts;
    for (uint8_t i = 0; i < WORD_COUNT; i++, text = text_item(text, 1)) {
        uint8_t same = 0;
        while (name[same] != '\0' && name[same] == (char)flash_byte(text + same)) {
            same++;
        }
        if (same > longest) {
            longest = same;
            console->hint = CONSOLE_HINT_WORD;
            console->hint_of = i;
        }
    }
}

static void make_small(char *text)
{
    for (; *text != '\0'; text++) {
        if (*text >= 'A' && *text <= 'Z') {
            *text = (char)(*text - 'A' + 'a');
        }
    }
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

console_error_t console_execute(console_t *console)
{
    make_small(console->line);
    if (console->line[0] == '$') {
        return console_settings_line(console, console->line);
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
        console->hint = CONSOLE_HINT_WORD;
        console->hint_of = i;
        if (given < word.least) {
            return CONSOLE_ERROR_MISSING_ARGUMENT;
        }
        if (given > word.most) {
            return CONSOLE_ERROR_SURPLUS_ARGUMENT;
        }
        arguments.count = given;
        if (word.job != CONSOLE_JOB_NONE) {
            console_start_job(console, (console_job_t)word.job);
            return CONSOLE_OK;
        }
        return word.function(console, &arguments);
    }
    hint_nearest_word(console, name);
    return CONSOLE_ERROR_UNKNOWN_WORD;
}

/* --- answers of several lines --------------------------------------------------------------- */

bool console_help_line(const console_t *console, console_out_t *out)
{
    static const char more[] FLASH_MEMORY =
        "$$  all settings   $NAME  one   $NAME=VALUE  set it\0"
        "$save  keep them   $defaults  the built-in ones\0"
        "!  all springs off at once, at any moment; !! their supply, too\0"
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
