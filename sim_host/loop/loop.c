#include "loop.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "electrics.h"

typedef struct {
    electrics_ina219_t sensor;
    electrics_fault_t fault;
    bool switch_closed;                /* whatever the duty */
    controller_sensor_status_t status; /* lasting failure of the sensor */
    bool lost_configuration;           /* told once, then written again */
    int stage;                         /* whose current the sensor measures */
    double loop_ohm;                   /* of the stage beyond the spring */
    double terminal_ohm; /* of the spring and its contact, since the plant's last step */
    double current_a;
    double energy_j; /* at the spring's terminals since the plant's last step */
} channel_t;

struct loop {
    controller_t controller;
    controller_settings_t settings;
    controller_inputs_t inputs;
    controller_outputs_t outputs;
    plant_t *plant;
    bool shares_plant; /* with other boards: it is theirs to destroy and to advance */
    int place[CONTROLLER_MAX_SPRINGS]; /* of each spring in the plant */
    loop_options_t options;
    int springs;
    uint64_t ticks;
    unsigned plant_tick;
    bool bus_stuck;
    bool fan_stopped;
    uint8_t fan_percent;
    double ambient_c;      /* since the plant's last step */
    double told_ambient_c; /* NaN: the truth, but for its error */
    double supply_v;
    double source_ohm;
    double freewheel_drop_v;
    struct {
        size_t supply_v, source_ohm, freewheel_drop_v, loop_ohm; /* of the plant's parameters */
    } at;
    bool sags;
    double highest_sum_a;
    electrics_cut_off_t cut_off;
    channel_t channel[CONTROLLER_MAX_SPRINGS];
};

static bool is_of_one_spring(loop_action_t action)
{
    return action != LOOP_ACTION_SENSOR_BUS && (unsigned)action <= LOOP_ACTION_SENSOR_GOOD;
}

void loop_options_default(loop_options_t *options)
{
    *options = (loop_options_t){
        .sensor_samples = 8, .shunt_noise_v = 10e-6, .bus_noise_v = 1e-3, .plant_ticks = 5};
}

static bool options_are_good(const loop_options_t *options)
{
    return options->plant_ticks >= 1 && options->plant_ticks <= 5 &&
           fabs(options->ambient_error_c) <= 100.0;
}

static double parameter(const plant_t *plant, size_t index, int spring)
{
    double value = 0.0;
    (void)plant_get_index(plant, index, spring, &value);
    return value;
}

static void find_circuit(loop_t *loop)
{
    const int sag = plant_effect_index("supply_sag");
    loop->sags = sag >= 0 && plant_effect_is_on(loop->plant, (size_t)sag);
    loop->at.supply_v = (size_t)plant_parameter_index("supply_v");
    loop->at.source_ohm = (size_t)plant_parameter_index("supply_resistance_ohm");
    loop->at.freewheel_drop_v = (size_t)plant_parameter_index("freewheel_drop_v");
    loop->at.loop_ohm = (size_t)plant_parameter_index("loop_resistance_ohm");
}

static int16_t to_c7(double temperature_c)
{
    double scaled = temperature_c * 128.0;
    return (int16_t)lround(scaled < -32768.0 ? -32768.0 : scaled > 32767.0 ? 32767.0 : scaled);
}

static int16_t told_ambient_c7(const loop_t *loop)
{
    return to_c7(isnan(loop->told_ambient_c) ? loop->ambient_c + loop->options.ambient_error_c
                                             : loop->told_ambient_c);
}

void loop_read_plant(loop_t *loop)
{
    for (int k = 0; k < loop->springs; k++) {
        loop->channel[k].terminal_ohm = plant_terminal_ohm(loop->plant, loop->place[k]);
        loop->channel[k].loop_ohm = parameter(loop->plant, loop->at.loop_ohm, loop->place[k]);
    }
    loop->supply_v = parameter(loop->plant, loop->at.supply_v, -1);
    loop->source_ohm = loop->sags ? parameter(loop->plant, loop->at.source_ohm, -1) : 0.0;
    loop->freewheel_drop_v = parameter(loop->plant, loop->at.freewheel_drop_v, -1);
    loop->ambient_c = plant_ambient_c(loop->plant);
}

loop_t *loop_create_part(const controller_settings_t *settings, plant_t *plant, int first_row,
                         int first_column, const loop_options_t *options, uint64_t seed,
                         uint16_t *bad)
{
    loop_options_t chosen;
    loop_options_default(&chosen);
    if (options != NULL) {
        chosen = *options;
    }
    uint16_t refused = UINT16_MAX;
    loop_t *loop = calloc(1, sizeof *loop);
    if (loop == NULL || !options_are_good(&chosen)) {
        goto fail;
    }
    loop->settings = *settings;
    loop->options = chosen;
    loop->told_ambient_c = (double)NAN;
    if (!controller_init(&loop->controller, settings,
                         to_c7(plant_ambient_c(plant) + chosen.ambient_error_c), &refused)) {
        goto fail;
    }
    const int rows = plant_rows(plant);
    if (first_row < 0 || first_row >= plant_layers(plant) * rows ||
        first_row % rows + settings->model.rows > rows || first_column < 0 ||
        first_column + settings->model.columns > plant_columns(plant)) {
        refused = PARAMETER_rows;
        goto fail;
    }
    loop->plant = plant;
    loop->shares_plant = true;
    loop->springs = controller_springs(&loop->controller);
    for (int k = 0; k < loop->springs; k++) {
        if (!electrics_ina219_init(&loop->channel[k].sensor, chosen.sensor_samples,
                                   chosen.shunt_noise_v, chosen.bus_noise_v,
                                   seed + (uint64_t)k * UINT64_C(0x100000001))) {
            goto fail;
        }
    }
    find_circuit(loop);
    for (int k = 0; k < loop->springs; k++) {
        loop->place[k] = (first_row + k / settings->model.columns) * plant_columns(plant) +
                         first_column + k % settings->model.columns;
        loop->channel[k].stage = k;
        (void)plant_drive(plant, loop->place[k], PLANT_DRIVE_POWER, 0.0);
    }
    (void)plant_set_fan(loop->plant, 0.0);
    loop_read_plant(loop);
    loop->inputs.ambient_c7 = told_ambient_c7(loop); /* what is known before the first tick */
    return loop;
fail:
    free(loop);
    if (bad != NULL) {
        *bad = refused;
    }
    return NULL;
}

loop_t *loop_create(const controller_settings_t *settings, const plant_t *plant,
                    const loop_options_t *options, uint64_t seed, uint16_t *bad)
{
    plant_t *copy = plant_copy(plant);
    uint16_t refused = copy == NULL ? UINT16_MAX : PARAMETER_rows;
    loop_t *loop = NULL;
    if (copy != NULL && plant_layers(plant) * plant_rows(plant) == settings->model.rows &&
        plant_columns(plant) == settings->model.columns) {
        loop = loop_create_part(settings, copy, 0, 0, options, seed, &refused);
    }
    if (loop == NULL) {
        plant_destroy(copy);
        if (bad != NULL) {
            *bad = refused;
        }
        return NULL;
    }
    loop->shares_plant = false;
    return loop;
}

void loop_destroy(loop_t *loop)
{
    if (loop != NULL) {
        if (!loop->shares_plant) {
            plant_destroy(loop->plant);
        }
        free(loop);
    }
}

/* Registers to mA and mV as the firmware does. */
static void read_sensor(loop_t *loop, int k)
{
    channel_t *c = &loop->channel[k];
    controller_sensor_t *seen = &loop->inputs.sensor[k];
    double current_a;
    double bus_v;
    *seen = (controller_sensor_t){.status = CONTROLLER_SENSOR_OK};
    if (loop->bus_stuck) {
        seen->status = CONTROLLER_SENSOR_BUS;
    } else if (c->status != CONTROLLER_SENSOR_OK) {
        seen->status = c->status;
    } else if (c->lost_configuration) {
        c->lost_configuration = false;
        seen->status = CONTROLLER_SENSOR_RESET;
    } else if (!electrics_ina219_take(&c->sensor, &current_a, &bus_v)) {
        seen->status = CONTROLLER_SENSOR_STALE;
    } else {
        int reading = c->sensor.shunt_register; /* 0.1 mA */
        seen->current_ma = (int16_t)((reading + (reading < 0 ? -5 : 5)) / 10);
        seen->voltage_mv = (int16_t)(c->sensor.bus_register * 4);
    }
}

/* Currents of the tick that starts, from the duties. */
static void flow(loop_t *loop)
{
    double duty[CONTROLLER_MAX_SPRINGS];
    double spring_ohm[CONTROLLER_MAX_SPRINGS];
    double load_s = 0.0;
    const bool fed = !controller_supply_is_fitted(&loop->controller) ||
                     electrics_cut_off_is_closed(&loop->cut_off, loop_time_s(loop));
    for (int k = 0; k < loop->springs; k++) {
        const channel_t *c = &loop->channel[k];
        duty[k] = !fed || c->fault == ELECTRICS_FAULT_OPEN ? 0.0
                  : c->switch_closed                       ? 1.0
                                     : (double)loop->outputs.duty[k] / CONTROLLER_DUTY_MAX;
        spring_ohm[k] = c->fault == ELECTRICS_FAULT_SHORT ? ELECTRICS_SHORT_OHM : c->terminal_ohm;
        load_s += duty[k] * duty[k] / (spring_ohm[k] + c->loop_ohm);
    }
    double bus_v = loop->source_ohm > 0.0
                       ? electrics_supply_v(loop->supply_v, loop->source_ohm, load_s, 0.0)
                       : loop->supply_v;
    double sum_a = 0.0;
    for (int k = 0; k < loop->springs; k++) {
        channel_t *c = &loop->channel[k];
        c->current_a = 0.0;
        if (duty[k] > 0.0) {
            c->current_a = electrics_buck_current_a(duty[k], bus_v, loop->freewheel_drop_v,
                                                    spring_ohm[k], c->loop_ohm);
        }
        if (c->fault == ELECTRICS_FAULT_NONE) {
            c->energy_j += c->current_a * c->current_a * spring_ohm[k] * LOOP_TICK_S;
        }
        sum_a += c->current_a;
    }
    for (int k = 0; k < loop->springs; k++) {
        const int stage = loop->channel[k].stage;
        const double current_a = loop->channel[stage].current_a;
        electrics_ina219_advance(&loop->channel[k].sensor, LOOP_TICK_S, current_a,
                                 current_a * spring_ohm[stage]);
    }
    if (sum_a > loop->highest_sum_a) {
        loop->highest_sum_a = sum_a;
    }
}

/* What flowed since the plant's last step heats it during its next, of dt_s. 0: not yet. */
static double heat(loop_t *loop)
{
    if (++loop->plant_tick < loop->options.plant_ticks) {
        return 0.0;
    }
    double dt_s = loop->plant_tick * LOOP_TICK_S;
    loop->plant_tick = 0;
    for (int k = 0; k < loop->springs; k++) {
        channel_t *c = &loop->channel[k];
        (void)plant_drive(loop->plant, loop->place[k], PLANT_DRIVE_POWER, c->energy_j / dt_s);
        c->energy_j = 0.0;
    }
    return dt_s;
}

double loop_tick_part(loop_t *loop)
{
    for (int k = 0; k < loop->springs; k++) {
        if (loop->ticks != 0) { /* at power-up the sensors have not converted yet: nothing flows */
            read_sensor(loop, k);
        }
    }
    loop->inputs.ambient_c7 = told_ambient_c7(loop);
    loop->inputs.fan_percent = loop->outputs.fan_percent;
    controller_tick(&loop->controller, &loop->inputs, &loop->outputs);
    if (loop->outputs.supply) {
        electrics_cut_off_pulse(&loop->cut_off, loop_time_s(loop));
    }
    uint8_t fan_percent = loop->fan_stopped ? 0 : loop->outputs.fan_percent;
    if (fan_percent != loop->fan_percent) {
        loop->fan_percent = fan_percent;
        (void)plant_set_fan(loop->plant, fan_percent / 100.0);
    }
    flow(loop);
    loop->ticks++;
    return heat(loop);
}

void loop_tick(loop_t *loop)
{
    const double dt_s = loop_tick_part(loop);
    if (dt_s > 0.0) {
        (void)plant_step(loop->plant, dt_s);
        loop_read_plant(loop);
    }
}

void loop_advance(loop_t *loop, double seconds)
{
    double ticks = floor(seconds / LOOP_TICK_S + 0.5);
    for (double n = 0.0; n < ticks; n += 1.0) {
        loop_tick(loop);
    }
}

/* The board boots: locked, all off, what it was told to do forgotten, settings from its EEPROM. */
static void boot(loop_t *loop, bool keeps_memory)
{
    thermal_model_state_t state;
    const bool known = controller_knows_cold(&loop->controller);
    controller_get_model_state(&loop->controller, &state);
    temperature_ceiling_t delivered;
    controller_get_delivered(&loop->controller, &delivered);
    (void)controller_init(&loop->controller, &loop->settings, told_ambient_c7(loop), NULL);
    if (keeps_memory) {
        (void)controller_resume(&loop->controller, &delivered, known ? &state : NULL);
    }
    controller_lock(&loop->controller);
}

static bool is_spring(const loop_t *loop, int spring)
{
    return spring >= 0 && spring < loop->springs;
}

bool loop_scale_sensor(loop_t *loop, int spring, double current_scale, double voltage_scale)
{
    if (!is_spring(loop, spring) || !(current_scale >= 0.0 && current_scale <= 100.0) ||
        !(voltage_scale >= 0.0 && voltage_scale <= 100.0)) {
        return false;
    }
    loop->channel[spring].sensor.current_gain_error = current_scale - 1.0;
    loop->channel[spring].sensor.bus_gain_error = voltage_scale - 1.0;
    return true;
}

bool loop_swap_sensors(loop_t *loop, int a, int b)
{
    if (!is_spring(loop, a) || !is_spring(loop, b)) {
        return false;
    }
    const int stage = loop->channel[a].stage;
    loop->channel[a].stage = loop->channel[b].stage;
    loop->channel[b].stage = stage;
    return true;
}

/* The sensor back to its own stage; the one that is there takes the other. */
static void unswap(loop_t *loop, int spring)
{
    int there = 0;
    while (loop->channel[there].stage != spring) {
        there++;
    }
    (void)loop_swap_sensors(loop, spring, there);
}

bool loop_act(loop_t *loop, loop_action_t action, int spring)
{
    if ((unsigned)action >= LOOP_ACTION_COUNT ||
        (is_of_one_spring(action) && !is_spring(loop, spring))) {
        return false;
    }
    channel_t *c = is_of_one_spring(action) ? &loop->channel[spring] : NULL;
    switch (action) {
    case LOOP_ACTION_OPEN_SPRING:
        c->fault = ELECTRICS_FAULT_OPEN;
        break;
    case LOOP_ACTION_SHORT_SPRING:
        c->fault = ELECTRICS_FAULT_SHORT;
        break;
    case LOOP_ACTION_SPRING_GOOD:
        c->fault = ELECTRICS_FAULT_NONE;
        break;
    case LOOP_ACTION_SWITCH_CLOSED:
    case LOOP_ACTION_SWITCH_GOOD:
        c->switch_closed = action == LOOP_ACTION_SWITCH_CLOSED;
        break;
    case LOOP_ACTION_SENSOR_NACK:
        c->status = CONTROLLER_SENSOR_ABSENT;
        break;
    case LOOP_ACTION_SENSOR_BUS:
        loop->bus_stuck = true;
        break;
    case LOOP_ACTION_SENSOR_STALE:
        c->status = CONTROLLER_SENSOR_STALE;
        break;
    case LOOP_ACTION_SENSOR_FREEZE:
        c->sensor.frozen = true;
        break;
    case LOOP_ACTION_SENSOR_RESET:
        c->lost_configuration = true;
        break;
    case LOOP_ACTION_SENSOR_GOOD:
        c->status = CONTROLLER_SENSOR_OK;
        c->sensor.frozen = false;
        (void)loop_scale_sensor(loop, spring, 1.0, 1.0);
        unswap(loop, spring);
        break;
    case LOOP_ACTION_BUS_GOOD:
        loop->bus_stuck = false;
        break;
    case LOOP_ACTION_FAN_STOP:
        loop->fan_stopped = true;
        break;
    case LOOP_ACTION_FAN_GOOD:
        loop->fan_stopped = false;
        break;
    case LOOP_ACTION_WATCHDOG:
        boot(loop, true);
        break;
    case LOOP_ACTION_BROWN_OUT:
        boot(loop, false);
        break;
    case LOOP_ACTION_COUNT:
        break;
    }
    return true;
}

bool loop_tell_ambient(loop_t *loop, double ambient_c)
{
    if (!isnan(ambient_c) && !(ambient_c >= -100.0 && ambient_c <= 200.0)) {
        return false;
    }
    loop->told_ambient_c = ambient_c;
    return true;
}

bool loop_set_ambient(loop_t *loop, double ambient_c)
{
    if (plant_set_ambient(loop->plant, ambient_c) != PLANT_OK) {
        return false;
    }
    loop->ambient_c = plant_ambient_c(loop->plant);
    return true;
}

controller_t *loop_controller(loop_t *loop)
{
    return &loop->controller;
}

plant_t *loop_plant(loop_t *loop)
{
    return loop->plant;
}

double loop_time_s(const loop_t *loop)
{
    return (double)loop->ticks * LOOP_TICK_S;
}

static const channel_t *channel(const loop_t *loop, int spring)
{
    static const channel_t none;
    return is_spring(loop, spring) ? &loop->channel[spring] : &none;
}

double loop_current_a(const loop_t *loop, int spring)
{
    return channel(loop, spring)->current_a;
}

double loop_sum_current_a(const loop_t *loop)
{
    double sum_a = 0.0;
    for (int k = 0; k < loop->springs; k++) {
        sum_a += loop->channel[k].current_a;
    }
    return sum_a;
}

double loop_highest_sum_current_a(const loop_t *loop)
{
    return loop->highest_sum_a;
}

const controller_inputs_t *loop_inputs(const loop_t *loop)
{
    return &loop->inputs;
}

const controller_outputs_t *loop_outputs(const loop_t *loop)
{
    return &loop->outputs;
}
