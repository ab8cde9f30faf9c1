#include "truth.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "world.h"

#define SHORT_OHM 0.005

struct truth {
    world_t *world;
    double loop_ohm;
    double duty[TRUTH_SPRINGS];   /* now */
    double duty_s[TRUTH_SPRINGS]; /* of this tick so far, times seconds */
    plant_fault_t fault[TRUTH_SPRINGS];
    double fan;
    double ticked_s; /* of this tick */
    truth_event_t supply[WORLD_EVENTS_MAX];
    unsigned supplies;
    double supply_v;
};

truth_t *truth_create(uint64_t seed, double tolerance, double ambient_c,
                      const truth_event_t *events, unsigned count)
{
    static const world_event_kind_t kind[] = {[TRUTH_STRESS] = WORLD_STRESS_MPA,
                                              [TRUTH_SUPPLY] = WORLD_SUPPLY_V,
                                              [TRUTH_AMBIENT] = WORLD_AMBIENT_C};
    truth_t *truth = calloc(1, sizeof *truth);
    world_parameters_t *parameters = malloc(sizeof *parameters);
    if (truth == NULL || parameters == NULL || count > WORLD_EVENTS_MAX) {
        free(truth);
        free(parameters);
        return NULL;
    }
    world_parameters_default(parameters);
    parameters->ambient_c = ambient_c;
    world_draw(parameters, seed, tolerance);
    for (unsigned n = 0; n < count; n++) {
        parameters->event[n] = (world_event_t){kind[events[n].kind], events[n].time_s,
                                               events[n].spring, events[n].value};
        if (events[n].kind == TRUTH_SUPPLY) {
            truth->supply[truth->supplies++] = events[n];
        }
    }
    parameters->events = (int)count;
    truth->loop_ohm = parameters->loop_ohm;
    truth->supply_v = parameters->supply_v;
    truth->world = world_create(parameters);
    free(parameters);
    if (truth->world == NULL) {
        free(truth);
        return NULL;
    }
    return truth;
}

void truth_destroy(truth_t *truth)
{
    if (truth != NULL) {
        world_destroy(truth->world);
        free(truth);
    }
}

/* What heats the spring: a break has no current, a short has it beside the spring. */
static double heating_duty(const truth_t *truth, unsigned k)
{
    return truth->fault[k] == PLANT_FAULT_NONE ? truth->duty[k] : 0.0;
}

static void end_tick(truth_t *truth)
{
    controller_outputs_t outputs = {.fan_percent = (uint8_t)lround(100.0 * truth->fan)};
    controller_inputs_t inputs;
    for (unsigned k = 0; k < TRUTH_SPRINGS; k++) {
        outputs.duty[k] = (uint16_t)lround(CONTROLLER_DUTY_MAX * truth->duty_s[k] / WORLD_TICK_S);
        truth->duty_s[k] = 0.0;
    }
    world_tick(truth->world, &outputs, &inputs);
    for (unsigned n = 0; n < truth->supplies; n++) {
        if (truth->supply[n].time_s <= world_time_s(truth->world)) {
            truth->supply_v = truth->supply[n].value;
        }
    }
}

static void step(void *context, double seconds)
{
    truth_t *truth = context;
    while (seconds > 0.0) {
        const double left_s = WORLD_TICK_S - truth->ticked_s;
        const double part_s = seconds < left_s ? seconds : left_s;
        for (unsigned k = 0; k < TRUTH_SPRINGS; k++) {
            truth->duty_s[k] += heating_duty(truth, k) * part_s;
        }
        truth->ticked_s += part_s;
        seconds -= part_s;
        if (truth->ticked_s >= WORLD_TICK_S - 1e-9) {
            truth->ticked_s = 0.0;
            end_tick(truth);
        }
    }
}

static void drive(void *context, unsigned channel, double duty)
{
    ((truth_t *)context)->duty[channel] = duty;
}

static void fan(void *context, double fraction)
{
    ((truth_t *)context)->fan = fraction;
}

static void set_fault(void *context, unsigned channel, plant_fault_t fault)
{
    ((truth_t *)context)->fault[channel] = fault;
}

static double spring_ohm(const truth_t *truth, unsigned k)
{
    return truth->fault[k] == PLANT_FAULT_SHORT ? SHORT_OHM
                                                : world_resistance_ohm(truth->world, (int)k);
}

static double current_a(void *context, unsigned channel)
{
    const truth_t *truth = context;
    return truth->fault[channel] == PLANT_FAULT_OPEN
               ? 0.0
               : truth->supply_v * truth->duty[channel] /
                     (spring_ohm(truth, channel) + truth->loop_ohm);
}

static double voltage_v(void *context, unsigned channel)
{
    const truth_t *truth = context;
    return truth->fault[channel] == PLANT_FAULT_OPEN
               ? truth->supply_v * truth->duty[channel]
               : current_a(context, channel) * spring_ohm(truth, channel);
}

board_array_t truth_array(truth_t *truth)
{
    return (board_array_t){.context = truth,
                           .springs = TRUTH_SPRINGS,
                           .step = step,
                           .drive = drive,
                           .fan = fan,
                           .fault = set_fault,
                           .current_a = current_a,
                           .voltage_v = voltage_v};
}

double truth_hottest_c(const truth_t *truth, unsigned spring)
{
    return world_hottest_c(truth->world, (int)spring);
}

double truth_austenite(const truth_t *truth, unsigned spring)
{
    return world_austenite(truth->world, (int)spring);
}

double truth_time_s(const truth_t *truth)
{
    return world_time_s(truth->world);
}
