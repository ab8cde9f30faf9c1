#include "truth.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "world.h"

#define SHORT_OHM 0.005
/* Without its diode an inductor of 47 uH loses its current at once: 5 V for a share d of 50 us give
 * a mean of 2.66 d^2 A, in triangles. */
#define PULSES_A     2.66
#define SENSOR_END_A 3.2 /* of what is above, within a pulse, a sensor shows none */
#define TURN         6.283185307179586

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
    double sags; /* 1, or less where the supply is too weak */
    bool fed;
    double upset[TRUTH_CLOCK + 1][TRUTH_SPRINGS];
    bool welded[TRUTH_SPRINGS];
};

/* Of one spring: what its sensor sees, and what flows through its wire. */
typedef struct {
    double sensed_a, sensed_v, heating_a;
} flow_t;

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
    truth->sags = 1.0;
    for (unsigned k = 0; k < TRUTH_SPRINGS; k++) {
        truth->upset[TRUTH_BRIDGE][k] = -1.0;
        truth->upset[TRUTH_GATES_JOINED][k] = -1.0;
    }
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

static double of(const truth_t *truth, truth_upset_t what, unsigned k)
{
    return truth->upset[what][k];
}

static double now_s(const truth_t *truth)
{
    return world_time_s(truth->world) + truth->ticked_s;
}

static double supply_v(const truth_t *truth)
{
    const double share = of(truth, TRUTH_RIPPLE_SHARE, 0);
    return truth->supply_v * truth->sags *
           (1.0 + share * sin(TURN * of(truth, TRUTH_RIPPLE_HZ, 0) * now_s(truth)));
}

/* Pulses of one timer begin together: joined gates are on as long as the longer one. */
static double duty_of(const truth_t *truth, unsigned k)
{
    const double other = of(truth, TRUTH_GATES_JOINED, k);
    return other >= 0.0 ? fmax(truth->duty[k], truth->duty[(unsigned)other]) : truth->duty[k];
}

static double spring_ohm(const truth_t *truth, unsigned k)
{
    const double rise_k = fmax(world_hottest_c(truth->world, (int)k) - 20.0, 0.0);
    return truth->fault[k] == PLANT_FAULT_SHORT
               ? SHORT_OHM
               : world_resistance_ohm(truth->world, (int)k) +
                     of(truth, TRUTH_CONTACT_OHM, k) * rise_k / 100.0;
}

static bool is_open(const truth_t *truth, unsigned k)
{
    const double hz = of(truth, TRUTH_CHATTER_HZ, k);
    return truth->fault[k] == PLANT_FAULT_OPEN || (hz > 0.0 && fmod(hz * now_s(truth), 1.0) < 0.5);
}

/* Mean voltage behind the switch; where current flows, its diode drops its part of that. */
static double driven_v(const truth_t *truth, unsigned k, bool flows)
{
    double duty = duty_of(truth, k);
    if (duty > 0.0 && duty < 1.0) {
        duty = fmin(fmax(duty + of(truth, TRUTH_SLOW_SHARE, k), 0.0), 1.0);
    }
    double dropped_v = 0.0;
    if (flows && duty > 0.0 && of(truth, TRUTH_DIODE_OPEN, k) <= 0.0) {
        dropped_v = (1.0 - duty) * of(truth, TRUTH_FREEWHEEL_V, 0);
    }
    if (truth->fed) {
        const double leak_v = of(truth, TRUTH_LEAK_A, k) * (spring_ohm(truth, k) + truth->loop_ohm);
        dropped_v = truth->welded[k] ? 0.0 : dropped_v;
        duty = truth->welded[k] ? 1.0 : duty + (1.0 - duty) * leak_v / truth->supply_v;
    }
    return fmax(supply_v(truth) * duty - dropped_v, 0.0);
}

/* Two springs whose hot ends touch: a stage that would have to take current lets none flow. */
static double joined_v(const truth_t *truth, unsigned a, unsigned b)
{
    const double g = 1.0 / truth->loop_ohm;
    const double springs_g = 1.0 / spring_ohm(truth, a) + 1.0 / spring_ohm(truth, b);
    const double a_v = driven_v(truth, a, true), b_v = driven_v(truth, b, true);
    const double both_v = g * (a_v + b_v) / (2.0 * g + springs_g);
    return both_v <= fmin(a_v, b_v) ? both_v : g * fmax(a_v, b_v) / (g + springs_g);
}

static flow_t flow_of(const truth_t *truth, unsigned k)
{
    const double driving_v = driven_v(truth, k, !is_open(truth, k));
    const double ohm = spring_ohm(truth, k);
    const double other = of(truth, TRUTH_BRIDGE, k);
    if (other >= 0.0) {
        const double v = joined_v(truth, k, (unsigned)other);
        return (flow_t){fmax(driving_v - v, 0.0) / truth->loop_ohm, v, v / ohm};
    }
    if (is_open(truth, k)) {
        return (flow_t){0.0, driving_v, 0.0};
    }
    double current_a = driving_v / (ohm + truth->loop_ohm);
    double heating_a = current_a;
    const double duty = driving_v / truth->supply_v;
    if (of(truth, TRUTH_DIODE_OPEN, k) > 0.0 && duty < 0.95) {
        current_a = fmin(current_a, PULSES_A * duty * duty);
        heating_a = current_a * sqrt(4.0 / (3.0 * fmax(duty, 0.01)));
    }
    if (of(truth, TRUTH_NO_INDUCTOR, k) > 0.0 && duty > 0.0) {
        const double pulse_a = current_a / duty;
        current_a *= fmin(SENSOR_END_A / pulse_a, 1.0);
        heating_a = pulse_a * sqrt(duty);
        return (flow_t){current_a, duty * pulse_a * ohm, heating_a};
    }
    return (flow_t){current_a, current_a * ohm,
                    truth->fault[k] == PLANT_FAULT_SHORT ? 0.0 : heating_a};
}

/* The world's own circuit is one spring to a stage: the duty that heats it as much. */
static double heating_duty(const truth_t *truth, unsigned k)
{
    return flow_of(truth, k).heating_a *
           (world_resistance_ohm(truth->world, (int)k) + truth->loop_ohm) / truth->supply_v;
}

static void look_at_welds(truth_t *truth)
{
    for (unsigned k = 0; k < TRUTH_SPRINGS; k++) {
        const double at_c = of(truth, TRUTH_WELDS_AT_C, k);
        truth->welded[k] =
            at_c > 0.0 && (truth->welded[k] || world_hottest_c(truth->world, (int)k) > at_c);
    }
}

/* What it gives to all stages, each by its duty; the voltage follows within some ticks. */
static void look_at_supply(truth_t *truth)
{
    const double most_a = of(truth, TRUTH_WEAK_A, 0);
    double sum_a = 0.0;
    for (unsigned k = 0; k < TRUTH_SPRINGS; k++) {
        sum_a += flow_of(truth, k).sensed_a * duty_of(truth, k);
    }
    const double fits = most_a > 0.0 ? truth->sags * sqrt(most_a / fmax(sum_a, 0.01)) : 1.0;
    truth->sags = fmin(fits, 1.0);
}

void truth_upset(truth_t *truth, truth_upset_t what, unsigned spring, double value)
{
    if (what == TRUTH_BRIDGE || what == TRUTH_GATES_JOINED) { /* of both */
        const int other = (int)(value >= 0.0 ? value : of(truth, what, spring));
        if (other >= 0) {
            truth->upset[what][other] = value >= 0.0 ? (double)spring : -1.0;
        }
    }
    truth->upset[what][what < TRUTH_GROUND_OHM ? spring : 0] = value;
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
    look_at_welds(truth);
    look_at_supply(truth);
    for (unsigned n = 0; n < truth->supplies; n++) {
        if (truth->supply[n].time_s <= world_time_s(truth->world)) {
            truth->supply_v = truth->supply[n].value;
        }
    }
}

static void step(void *context, double seconds)
{
    truth_t *truth = context;
    const double clock = of(truth, TRUTH_CLOCK, 0);
    seconds *= clock > 0.0 ? clock : 1.0;
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

static void feed(void *context, bool fed)
{
    ((truth_t *)context)->fed = fed;
}

static double current_a(void *context, unsigned channel)
{
    return flow_of(context, channel).sensed_a;
}

static double voltage_v(void *context, unsigned channel)
{
    const truth_t *truth = context;
    const double ground_ohm = of(truth, TRUTH_GROUND_OHM, 0);
    double sum_a = 0.0;
    for (unsigned k = 0; ground_ohm != 0.0 && k < TRUTH_SPRINGS; k++) {
        sum_a += flow_of(truth, k).sensed_a;
    }
    return flow_of(truth, channel).sensed_v + ground_ohm * sum_a;
}

board_array_t truth_array(truth_t *truth)
{
    return (board_array_t){.context = truth,
                           .springs = TRUTH_SPRINGS,
                           .step = step,
                           .drive = drive,
                           .fan = fan,
                           .feed = feed,
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
