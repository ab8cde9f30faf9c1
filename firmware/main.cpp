// The firmware: sensors, one call of controller_tick, outputs, 50 times a second; in between the
// console.
#include <avr/pgmspace.h>
#include <stddef.h>
#include <string.h>

#include "ambient.h"
#include "board.h"
#include "console.h"
#include "controller.h"
#include "crc16.h"
#include "current_sensor.h"
#include "fixed_point.h"
#include "learnt_store.h"
#include "ntc.h"
#include "settings.h"
#include "telemetry.h"
#include "warm_mark.h"
#ifdef NINESPRING_HIL
#include "current_sensor_hil.h"
#endif
#ifdef NINESPRING_SENSOR_ADAFRUIT
#include "arduino_headers.h"
#endif

#ifndef NINESPRING_VERSION
#define NINESPRING_VERSION "unknown"
#endif

// What it needs is on the stack only as long as it runs: the linker's optimiser puts what is called
// once into its caller, here main, whose frame lies below all others for ever.
#define OWN_FRAME __attribute__((noinline))

// Ticks that are due: a loop that cannot keep up takes its own time for the world's, and what heats
// in it is hotter than it believes.
#define BEHIND_MOST (500u / BOARD_TICK_MS)

// Not static: debugger and simulator look at it by name.
controller_t controller;
settings_t settings;

static settings_store_t store;
static learnt_store_t learnt;
static telemetry_t telemetry;
static console_t console;
static console_status_t status;
static ambient_t ambient;
static controller_inputs_t inputs;
static controller_outputs_t outputs;

// Over a warm reset: the heat that was given, and the model's state. Not static, either.
typedef struct {
    temperature_ceiling_t delivered;
    thermal_model_state_t state;
    bool known; // else the state is a guess: after the reset the board waits anew
    uint16_t crc;
} kept_t;
kept_t kept __attribute__((section(".noinit")));

// And whose sensor lies: it is found by what it showed before, which is lost, and whoever opens a
// Mega's port resets it. Twice, each with its complement: at whatever write the reset comes, one is
// whole. A bit a spring, which is never taken back.
typedef struct {
    uint16_t springs;
    uint16_t not_springs;
} liars_t;
static volatile liars_t liars[2] __attribute__((section(".noinit")));

static uint32_t last_tick_ms;
static uint8_t tick_of_step;
static bool status_wanted;

static uint16_t serial_room(void *)
{
    return board_serial_room();
}
static void serial_write(void *, const char *bytes, uint8_t length)
{
    board_serial_write(bytes, length);
}
static const text_output_t serial_output = {nullptr, serial_room, serial_write};

// What is typed comes before Teleplot's points, which would fill the port for ever where ticks take
// long; a CSV row is longer than what an answer needs.
static uint16_t telemetry_room(void *)
{
    const uint16_t room = board_serial_room();
    const bool typed = telemetry.format == TELEMETRY_TELEPLOT && board_serial_waits();
    const uint16_t needed = typed && !console_busy(&console) ? CONSOLE_ANSWER_BYTES : 0u;
    return room > needed ? (uint16_t)(room - needed) : 0u;
}

static uint8_t eeprom_read(void *, uint16_t address)
{
    return board_eeprom_read(address);
}
static bool eeprom_ready(void *)
{
    return board_eeprom_ready();
}
static void eeprom_write(void *, uint16_t address, uint8_t value)
{
    board_eeprom_write(address, value);
}
static const record_storage_t eeprom = {nullptr, eeprom_read, eeprom_ready, eeprom_write};

static const char *reset_text(uint8_t cause)
{
    if (const char *const ended_by = board_ended_take()) {
        return ended_by;
    }
    if (cause & BOARD_RESET_WATCHDOG) {
        return PSTR("watchdog");
    }
    if (cause & BOARD_RESET_BROWN_OUT) {
        return PSTR("brown-out");
    }
    if (cause & BOARD_RESET_POWER_ON) {
        return PSTR("power-on");
    }
    if (cause & BOARD_RESET_EXTERNAL) {
        return PSTR("external");
    }
    return PSTR("unknown while driving");
}

static int16_t ambient_c7(void)
{
    const int16_t set_c7 = fixed_point_c7_from_cc(settings.board.ambient_cc);
    if (settings.board.ambient_source != SETTINGS_AMBIENT_NTC) {
        ambient = ambient_t();
        return set_c7;
    }
    int16_t measured_c7 = 0;
    const bool reads = ntc_temperature_c7(board_ambient_adc(), &measured_c7);
    return ambient_take(&ambient, reads, measured_c7, set_c7);
}

static uint16_t crc_of_kept(void)
{
    return crc16_add_bytes(CRC16_START, &kept, offsetof(kept_t, crc));
}

static void keep_liars(void)
{
    uint16_t springs = 0;
    for (uint8_t k = 0; k < controller_springs(&controller); k++) {
        if (controller_fault(&controller, k) == SAFETY_FAULT_SENSOR_MISMATCH ||
            controller_is_mistrusted(&controller, k)) {
            springs |= (uint16_t)(1u << k);
        }
    }
    for (volatile liars_t &copy : liars) {
        copy.springs = springs;
        copy.not_springs = (uint16_t)~springs;
    }
}

static void mistrust_liars(void)
{
    uint16_t springs = 0;
    for (const volatile liars_t &copy : liars) {
        if (copy.not_springs == (uint16_t)~copy.springs) {
            springs |= copy.springs;
        }
    }
    for (uint8_t k = 0; k < controller_springs(&controller); k++) {
        if ((springs & (uint16_t)(1u << k)) != 0) {
            controller_mistrust(&controller, k);
        }
    }
}

static void keep_model(void)
{
    controller_get_delivered(&controller, &kept.delivered);
    controller_get_model_state(&controller, &kept.state);
    kept.known = controller_knows_cold(&controller);
    kept.crc = crc_of_kept();
}

// Without a record that survived nothing is known of the springs, as controller_init leaves them.
static void start_model(uint8_t cause)
{
    if (!(cause & BOARD_RESET_WARM) || kept.crc != crc_of_kept()) {
        if (warm_mark_is_set(&eeprom, SETTINGS_WARM_BASE)) {
            controller_doubt_cold(&controller);
        }
        return;
    }
    (void)controller_resume(&controller, &kept.delivered, kept.known ? &kept.state : nullptr);
}

// Settings, limits, or what is derived of them, are not what they were: a bit of RAM has turned
// over. All of it is made anew from what is saved, and of the springs nothing counts as known: what
// is kept of them was made with those numbers. Ahead of whatever uses or saves them.
static void hold_settings()
{
    if (!console_hold_settings(&console) || !controller_is_sound(&controller)) {
        kept.crc = static_cast<uint16_t>(~crc_of_kept());
        board_end(PSTR("memory: a setting had changed by itself"));
    }
}

// Configures the sensors at the start and when the setting has changed: they then convert anew, and
// a reading or two is missing.
static void follow_averaging()
{
    static uint8_t averaging;
    if (averaging != settings.board.sensor_averaging) {
        averaging = settings.board.sensor_averaging;
        current_sensor_begin(averaging);
    }
}

OWN_FRAME static void run_tick(uint8_t behind)
{
    const uint32_t begin_us = board_time_us();
    if (behind >= BEHIND_MOST) {
        board_end(PSTR("overload: the control loop was half a second late"));
    }
    if (behind > 0 && status.ticks_late < UINT16_MAX) {
        status.ticks_late++;
    }
    status.ticks++;
    const uint32_t now_ms = board_time_ms(); // comes round after 50 days
    text_time_add(&status.time, now_ms - last_tick_ms);
    last_tick_ms = now_ms;
#ifdef NINESPRING_HIL
    current_sensor_hil_tick((uint16_t)status.ticks);
#endif
    hold_settings();
    follow_averaging();
    current_sensor_read(inputs.sensor, CONTROLLER_MAX_SPRINGS);
    for (uint8_t k = 0; k < CONTROLLER_MAX_SPRINGS; k++) {
        status.sensor_status[k] = inputs.sensor[k].status;
    }
    inputs.ambient_c7 = ambient_c7();
#ifdef NINESPRING_HIL
    current_sensor_hil_ambient(&inputs.ambient_c7);
#endif
    status.ambient_c7 = inputs.ambient_c7;
    status.ambient_is_held = ambient_is_held(&ambient);
    inputs.fan_percent = outputs.fan_percent;

    // what it reads is of duties that were not there for 20 ms, and so is what the next one reads
    if (behind > 0) {
        controller_hurry(&controller);
    }
    controller_tick(&controller, &inputs, &outputs);
    if (behind > 0) {
        controller_hurry(&controller);
    }

#ifdef NINESPRING_HIL
    current_sensor_hil_send((uint16_t)status.ticks, &outputs);
#endif
    board_set_duties(outputs.duty);
    board_set_fan(outputs.fan_percent);
    board_hold();
    if (++tick_of_step == 5u) {
        tick_of_step = 0;
        keep_model();
        keep_liars();
    }
    board_watchdog_kick();
    board_hold_supply(outputs.supply); // last: a tick that does not end holds nothing
    const uint32_t tick_us = board_time_us() - begin_us;
    if (tick_us > status.tick_longest_us) {
        status.tick_longest_us = tick_us > UINT16_MAX ? UINT16_MAX : (uint16_t)tick_us;
    }
    text_output_t rest = serial_output; // on the stack: constants would take RAM
    rest.room = telemetry_room;
    telemetry_tick(&telemetry, &controller, &status.time, inputs.ambient_c7, &rest);
    telemetry_inputs(&telemetry, &controller, &inputs, (uint16_t)status.ticks, &serial_output);
}

#ifdef NINESPRING_HIL
static int16_t held = -1; // a console octet that was met while looking for frames

// Readings fill the receive buffer in 11 ms, so they are taken in while the console is busy, too.
static void take_frames(void)
{
    while (held < 0) {
        const int16_t octet = board_serial_read();
        if (octet < 0) {
            return;
        }
        if (!current_sensor_hil_receive((uint8_t)octet)) {
            held = octet;
        }
    }
}
#endif

static int16_t next_console_octet(void)
{
#ifdef NINESPRING_HIL
    take_frames();
    const int16_t octet = held;
    held = -1;
    return octet;
#else
    return board_serial_read();
#endif
}

static void take_stop(void)
{
    const uint8_t stops = board_stop_take();
    if (stops != 0) {
        if (stops > 1) {
            controller_emergency_cut(&controller);
        } else {
            controller_emergency_stop(&controller);
        }
        memset(outputs.duty, 0, sizeof outputs.duty);
        console_stop(&console);
    }
}

OWN_FRAME static void take_input(void)
{
    if (board_serial_lost_take()) {
        console_break_line(&console, CONSOLE_ERROR_INPUT_LOST);
    }
#ifdef NINESPRING_HIL
    take_frames();
#endif
    while (console_ready(&console)) {
        take_stop(); // before what came behind it
        const bool obsolete = board_serial_before_stop();
        const int16_t octet = next_console_octet();
        if (octet < 0) {
            return;
        }
        const bool ends = octet == '\n' || octet == '\r';
        if (obsolete && !ends) { // behind no octet it ends an empty line, which has no answer
            console_break_line(&console, CONSOLE_ERROR_STOPPED);
        }
        console_receive(&console, (uint8_t)octet);
        if (ends) {
            return; // a tick may be due
        }
    }
}

OWN_FRAME static void each_second(void)
{
    static uint32_t second_ms;
    const uint32_t now_ms = board_time_ms();
    if (now_ms - second_ms < 1000u) {
        return;
    }
    second_ms = now_ms;
    const uint32_t idle_us = board_idle_us_take();
    status.load_percent = idle_us >= 1000000ul ? 0u : (uint8_t)(100u - idle_us / 10000u);
    status.stack_unused_bytes = board_stack_unused();
    learnt_store_second(&learnt, &controller);
    warm_mark_second(&eeprom, SETTINGS_WARM_BASE, controller_may_be_warm(&controller),
                     now_ms / 1000u);
}

OWN_FRAME static void start(void)
{
#ifdef NINESPRING_SENSOR_ADAFRUIT
    init(); // Arduino's clock, which that library's timeouts need
#endif
    board_init();
    const uint8_t cause = board_reset_cause();
    status.reset_cause = reset_text(cause);
    static const char version[] PROGMEM = NINESPRING_VERSION;
    status.version = version;
    status.sensors = current_sensor_name();
    status.loaded = settings_load(&store, &eeprom, &settings);
    status.stack_unused_bytes = board_stack_unused();

    if (!controller_init(&controller, &settings.controller, ambient_c7(), nullptr)) {
        status.settings_conflict_at_boot = true;
        settings_default(&settings);
        controller_init(&controller, &settings.controller, ambient_c7(), nullptr);
    }
    static_assert(LEARNT_STORE_BYTES(THERMAL_MODEL_MAX_SPRINGS) + RECORD_OVERHEAD_BYTES <=
                      SETTINGS_LEARNT_SLOT_BYTES,
                  "what is learnt of all springs must fit its slot");
    learnt_store_open(&learnt, &eeprom, SETTINGS_LEARNT_BASE, SETTINGS_LEARNT_SLOT_BYTES,
                      &controller);
    start_model(cause);
    if (cause & BOARD_RESET_WARM) {
        mistrust_liars();
    }
    if (cause & (BOARD_RESET_WATCHDOG | BOARD_RESET_BROWN_OUT | BOARD_RESET_UNKNOWN)) {
        controller_lock(&controller);
    }
    telemetry_init(&telemetry);
    telemetry_set(&telemetry, settings.board.telemetry_format, settings.board.telemetry_hz);
    console_init(&console, &serial_output, &controller, &settings, &store, &learnt, &telemetry,
                 &status);
    console_greet(&console);
    board_watchdog_start();
    follow_averaging();
    uint8_t behind;
    while (board_tick_take(&behind)) { // what became due meanwhile is not late
    }
}

OWN_FRAME static void serve(void)
{
    console_service(&console);
    if (!console_busy(&console)) { // a save of the settings comes first
        (void)learnt_store_step(&learnt);
    }
}

OWN_FRAME static void tell_status(void)
{
    if (board_serial_status_take()) {
        controller_host_heard(&controller);
        status_wanted = true;
    }
    if (status_wanted && board_serial_room() >= CONSOLE_ROOM_BYTES) {
        status_wanted = false;
        console_print_status(&console);
    }
}

static void turn(void)
{
    uint8_t behind;
    take_stop();
    if (board_tick_take(&behind)) {
        run_tick(behind);
    }
    serve();
    take_input();
    tell_status();
    each_second();
    board_idle(console_busy(&console) || status_wanted);
}

// In place of Arduino's own, whose start of every timer and clock would be undone at once.
int main()
{
    start();
    for (;;) {
        turn();
    }
}
