#include "world.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PAIRS_MAX          (4 * WORLD_SPRINGS_MAX)
#define LOSS_EVERY_TICKS   5     /* the convection's law varies slowly: rise^0.148 */
#define CONVECTION_POWER   0.148 /* Morgan 1975: horizontal wires, Rayleigh number 0.01 to 100 */
#define RADIATION_W_PER_K4 5.670e-8
#define ZERO_C             273.15
#define STRESS_TIME_S      0.1 /* a finger's: 95 % within 0.3 s */
/* Along the wire between the middles of two thirds: 18 W/mK (NiTi), 0.503 mm2, 36.7 mm. */
#define AXIAL_W_PER_K 0.000247
#define SHARE         (1.0 / WORLD_NODES)
#define SOLVER_ROUNDS 40   /* as a rule three */
#define SOLVER_J      1e-8 /* 1e-7 K of a node */

typedef struct {
    double temperature_c;
    double enthalpy_j; /* above 0 degC of martensite: sensible and latent heat */
    grain_t grain;
    double convection_w_per_k;
    double power_w, flow_w; /* made in it; gone from it to other nodes and out */
} node_t;

typedef struct {
    node_t node[WORLD_NODES];
    double stress_mpa, stress_aim_mpa;
    double contact_ohm, contact_ohm_per_s;
    double convection_full_w_per_k; /* of a third, WORLD_LOSS_RISE_K above the air */
    double loss_factor;             /* on it, from outside */
    double current_a, voltage_v;
    ina219_t sensor;
    int sensor_of; /* whose current and voltage this sensor sees */
} spring_t;

struct world {
    world_parameters_t parameters;
    int springs, pairs, steps;
    struct {
        int a, b;
        double w_per_k; /* of a third */
    } pair[PAIRS_MAX];
    spring_t spring[WORLD_SPRINGS_MAX];
    controller_inputs_t inputs;
    uint64_t ticks;
    double air_c, plate_c;
    double supply_v, ambient_c;
    double loss_factor, gust_until_s;
    bool gust;
    double next_event_s;
    double supplied_j, lost_j;
    random_t random;
};

void world_parameters_default(world_parameters_t *parameters)
{
    memset(parameters, 0, sizeof *parameters);
    world_spring_t spring = {
        .heat_capacity_j_per_k = 0.300,
        .latent_heat_j = 8.65,
        .loss_w_per_k = 0.0058,
        /* A bare wire 13 mm long by its fin law takes 0.69 mW/K from an end that is at ambient. A
         * crimp is not: its lead is warm. This keeps the end thirds some 4 K below the middle. */
        .crimp_w_per_k = 0.0002,
        .radiating_m2 = 0.4 * 277e-6 * 0.5, /* half of a coil sees itself */
        .alloy = {KINETICS_COSINE, 68.0, 78.0, 88.0, 98.0},
        .martensite_ohm = 0.175,
        .austenite_ohm = 0.219,
        .r_phase_ohm = 0.245, /* 12 % above austenite: the peak seen on cooling */
        .start_c = 20.0,
        /* 12 bit, 8 averaged: about a third of a step, and the buck's ripple in the current. */
        .sensor = {1.0, 1.0, 0.0, 0.0, 0.001, 0.0014, 0.0, 0.0, false},
    };
    parameters->rows = parameters->columns = 3;
    for (int k = 0; k < WORLD_SPRINGS_MAX; k++) {
        parameters->spring[k] = spring;
    }
    parameters->orthogonal_w_per_k = 0.000586;
    parameters->diagonal_w_per_k = 0.000293;
    parameters->fan_loss_factor = 11.3 / 5.8;
    parameters->supply_v = 5.0;
    parameters->loop_ohm = 0.18;
    parameters->ambient_c = parameters->ambient_setting_c = 20.0;
    parameters->step_s = WORLD_TICK_S;
    parameters->seed = 1;
}

/* Below 1: between a batch's spread and a spring's own the whole stays within the tolerance. */
#define BATCH 0.6

typedef struct {
    random_t random;
    double tolerance;
} draw_t;

static double near_one(draw_t *draw, double share)
{
    return 1.0 + share * draw->tolerance * random_uniform(&draw->random, -1.0, 1.0);
}

static void draw_spring(draw_t *draw, const world_spring_t *batch, world_spring_t *spring)
{
    const double own = 1.0 - BATCH;
    spring->heat_capacity_j_per_k *= batch->heat_capacity_j_per_k + near_one(draw, own) - 1.0;
    spring->latent_heat_j *= batch->latent_heat_j + near_one(draw, own) - 1.0;
    spring->loss_w_per_k *= batch->loss_w_per_k + near_one(draw, own) - 1.0;
    spring->crimp_w_per_k *= batch->crimp_w_per_k + near_one(draw, own) - 1.0;
    spring->radiating_m2 *= batch->radiating_m2 + near_one(draw, own) - 1.0;
    /* The alloy has a change of resistance; wire and length scale both phases alike. */
    double size = batch->martensite_ohm + near_one(draw, own) - 1.0;
    double change = batch->austenite_ohm + near_one(draw, own) - 1.0;
    double austenite_ohm = spring->austenite_ohm - spring->martensite_ohm;
    double r_phase_ohm = spring->r_phase_ohm - spring->martensite_ohm;
    spring->martensite_ohm *= size;
    spring->austenite_ohm = spring->martensite_ohm + size * change * austenite_ohm;
    spring->r_phase_ohm = spring->martensite_ohm + size * change * r_phase_ohm;
    alloy_t *alloy = &spring->alloy;
    double down_k = alloy->martensite_start_c - alloy->martensite_finish_c;
    double up_k = alloy->austenite_finish_c - alloy->austenite_start_c;
    alloy->martensite_start_c +=
        down_k * (batch->alloy.martensite_start_c + near_one(draw, own) - 2.0);
    alloy->austenite_start_c += up_k * (batch->alloy.austenite_start_c + near_one(draw, own) - 2.0);
    alloy->martensite_finish_c = alloy->martensite_start_c - down_k * near_one(draw, 1.0);
    alloy->austenite_finish_c = alloy->austenite_start_c + up_k * near_one(draw, 1.0);
    /* A sound INA219 (data sheet: 0.2 % typical, 1 % shunt; 0.1 mV over 0.1 ohm), sound crimps. */
    spring->sensor.current_gain = random_uniform(&draw->random, 0.99, 1.01);
    spring->sensor.voltage_gain = random_uniform(&draw->random, 0.998, 1.002);
    spring->sensor.current_offset_a = random_uniform(&draw->random, -0.001, 0.001);
    spring->sensor.voltage_offset_v = random_uniform(&draw->random, -0.002, 0.002);
    spring->contact_ohm = random_uniform(&draw->random, 0.0, 0.004);
    spring->start_c = 20.0;
}

void world_draw(world_parameters_t *parameters, uint64_t seed, double tolerance)
{
    draw_t draw = {random_seeded(seed, 0), tolerance};
    world_spring_t batch = {
        .heat_capacity_j_per_k = near_one(&draw, BATCH),
        .latent_heat_j = near_one(&draw, BATCH),
        .loss_w_per_k = near_one(&draw, BATCH),
        .crimp_w_per_k = near_one(&draw, BATCH),
        .radiating_m2 = near_one(&draw, BATCH),
        .martensite_ohm = near_one(&draw, BATCH),
        .austenite_ohm = near_one(&draw, BATCH),
        .alloy = {.martensite_start_c = near_one(&draw, BATCH),
                  .austenite_start_c = near_one(&draw, BATCH)},
    };
    for (int k = 0; k < parameters->rows * parameters->columns; k++) {
        draw_spring(&draw, &batch, &parameters->spring[k]);
        parameters->spring[k].start_c = parameters->ambient_c;
    }
    parameters->orthogonal_w_per_k *= near_one(&draw, 1.0);
    parameters->diagonal_w_per_k *= near_one(&draw, 1.0);
    parameters->loop_ohm *= near_one(&draw, 1.0);
    parameters->supply_v *= random_uniform(&draw.random, 0.97, 1.03); /* a good 5 V supply */
    parameters->seed = random_bits(&draw.random);
}

static bool parameters_hold(const world_parameters_t *p)
{
    int springs = p->rows * p->columns;
    double steps = WORLD_TICK_S / p->step_s;
    if (p->rows < 1 || p->columns < 1 || springs > WORLD_SPRINGS_MAX || p->events < 0 ||
        p->events > WORLD_EVENTS_MAX || !(steps >= 1.0) || fabs(steps - round(steps)) > 1e-6) {
        return false;
    }
    for (int k = 0; k < springs; k++) {
        const world_spring_t *s = &p->spring[k];
        if (!(s->heat_capacity_j_per_k > 0.0) || !(s->martensite_ohm > 0.0) ||
            !(s->austenite_ohm > 0.0) || !(s->r_phase_ohm > 0.0) ||
            !(s->alloy.martensite_start_c > s->alloy.martensite_finish_c) ||
            !(s->alloy.austenite_finish_c > s->alloy.austenite_start_c)) {
            return false;
        }
    }
    return true;
}

static void find_pairs(world_t *world)
{
    const world_parameters_t *p = &world->parameters;
    for (int a = 0; a < world->springs; a++) {
        for (int b = a + 1; b < world->springs; b++) {
            int rows = b / p->columns - a / p->columns;
            int columns = abs(b % p->columns - a % p->columns);
            if (rows <= 1 && columns <= 1) {
                bool diagonal = rows == 1 && columns == 1;
                world->pair[world->pairs].a = a;
                world->pair[world->pairs].b = b;
                world->pair[world->pairs].w_per_k =
                    SHARE * (diagonal ? p->diagonal_w_per_k : p->orthogonal_w_per_k);
                world->pairs++;
            }
        }
    }
}

static double radiation_w(const world_spring_t *spring, double from_c, double to_c)
{
    double from_k = from_c + ZERO_C, to_k = to_c + ZERO_C;
    double from_k2 = from_k * from_k, to_k2 = to_k * to_k;
    return SHARE * spring->radiating_m2 * RADIATION_W_PER_K4 * (from_k2 * from_k2 - to_k2 * to_k2);
}

static double node_enthalpy_j(const world_spring_t *spring, const node_t *node)
{
    return SHARE * (spring->heat_capacity_j_per_k * node->temperature_c +
                    spring->latent_heat_j * node->grain.latent);
}

static void start_spring(world_t *world, int k)
{
    const world_spring_t *parameters = &world->parameters.spring[k];
    spring_t *spring = &world->spring[k];
    spring->stress_mpa = spring->stress_aim_mpa = parameters->stress_mpa;
    spring->contact_ohm = parameters->contact_ohm;
    spring->sensor = parameters->sensor;
    spring->sensor_of = k;
    spring->loss_factor = 1.0;
    double ambient_c = world->parameters.ambient_c;
    double radiated_w = radiation_w(parameters, ambient_c + WORLD_LOSS_RISE_K, ambient_c);
    double third_w_per_k = SHARE * (parameters->loss_w_per_k - 2.0 * parameters->crimp_w_per_k);
    spring->convection_full_w_per_k = fmax(third_w_per_k - radiated_w / WORLD_LOSS_RISE_K, 0.0);
    for (int n = 0; n < WORLD_NODES; n++) {
        node_t *node = &spring->node[n];
        node->temperature_c = parameters->start_c;
        grain_start(&node->grain, &parameters->alloy,
                    parameters->start_c - parameters->stress_mpa / WORLD_COOLING_MPA_PER_K,
                    parameters->was_austenite);
        node->enthalpy_j = node_enthalpy_j(parameters, node);
    }
}

static void find_next_event(world_t *world)
{
    world->next_event_s = INFINITY;
    for (int e = 0; e < world->parameters.events; e++) {
        world->next_event_s = fmin(world->next_event_s, world->parameters.event[e].time_s);
    }
}

world_t *world_create(const world_parameters_t *parameters)
{
    world_t *world = parameters_hold(parameters) ? calloc(1, sizeof *world) : NULL;
    if (world == NULL) {
        return NULL;
    }
    world->parameters = *parameters;
    world->springs = parameters->rows * parameters->columns;
    world->steps = (int)lround(WORLD_TICK_S / parameters->step_s);
    world->ambient_c = world->air_c = world->plate_c = parameters->ambient_c;
    world->supply_v = parameters->supply_v;
    world->loss_factor = 1.0;
    world->random = random_seeded(parameters->seed, 1);
    find_pairs(world);
    find_next_event(world);
    for (int k = 0; k < world->springs; k++) {
        start_spring(world, k);
    }
    return world;
}

void world_destroy(world_t *world)
{
    free(world);
}

static void happen(world_t *world, const world_event_t *event)
{
    spring_t *spring = &world->spring[event->spring];
    switch (event->kind) {
    case WORLD_STRESS_MPA:
        spring->stress_aim_mpa = event->value;
        break;
    case WORLD_CONTACT_OHM:
        spring->contact_ohm = event->value;
        break;
    case WORLD_CONTACT_OHM_PER_S:
        spring->contact_ohm_per_s = event->value;
        break;
    case WORLD_SENSOR_FREEZE:
        spring->sensor.current_frozen = event->value == 0.0 || event->value == 1.0;
        spring->sensor.voltage_frozen = event->value == 0.0 || event->value == 2.0;
        break;
    case WORLD_SENSOR_CURRENT_GAIN:
        spring->sensor.current_gain = event->value;
        break;
    case WORLD_SENSOR_VOLTAGE_GAIN:
        spring->sensor.voltage_gain = event->value;
        break;
    case WORLD_SENSOR_SWAP: {
        spring_t *other = &world->spring[(int)event->value];
        int seen = spring->sensor_of;
        spring->sensor_of = other->sensor_of;
        other->sensor_of = seen;
        break;
    }
    case WORLD_LOSS_FACTOR:
        spring->loss_factor = event->value;
        break;
    case WORLD_SUPPLY_V:
        world->supply_v = event->value;
        break;
    case WORLD_AMBIENT_C:
        world->ambient_c = event->value;
        break;
    }
}

static void let_events_happen(world_t *world, double now_s)
{
    for (int e = 0; e < world->parameters.events; e++) {
        world_event_t *event = &world->parameters.event[e];
        if (event->time_s <= now_s) {
            happen(world, event);
            event->time_s = INFINITY;
        }
    }
    find_next_event(world);
}

static void blow(world_t *world, double now_s, uint8_t fan_percent)
{
    const world_parameters_t *p = &world->parameters;
    if (p->gust_every_s > 0.0 && now_s >= world->gust_until_s) {
        world->gust = !world->gust && now_s > 0.0; /* it begins still */
        world->gust_until_s =
            now_s +
            random_interval_s(&world->random, world->gust ? p->gust_lasts_s : p->gust_every_s);
    }
    world->loss_factor = (world->gust ? p->gust_factor : 1.0) *
                         (1.0 + (p->fan_loss_factor - 1.0) * fan_percent / 100.0);
}

/* Churchill and Chu 1975, (0.60 + 0.321 Ra^(1/6))^2 in air, for a wire whose Rayleigh number is 2.5
 * at the rise that loss is meant at, and the film's conductivity; 1 there. */
static double free_convection(double rise_k, double sink_c)
{
    static const double of_rise = 0.374; /* 0.321 * 2.5^(1/6) */
    double root = (0.60 + of_rise * cbrt(sqrt(rise_k / WORLD_LOSS_RISE_K))) / (0.60 + of_rise);
    double film_k = sink_c + ZERO_C + 0.5 * rise_k;
    double film_meant_k = sink_c + ZERO_C + 0.5 * WORLD_LOSS_RISE_K;
    return root * root * (1.0 + 0.8 * (film_k - film_meant_k) / film_meant_k);
}

static double convection(world_convection_t law, double rise_k, double sink_c, double moved)
{
    if (law == WORLD_CONVECTION_MORGAN) {
        return moved * pow(rise_k / WORLD_LOSS_RISE_K, CONVECTION_POWER);
    }
    double free = free_convection(rise_k, sink_c);
    return moved <= 1.0 ? moved * free : cbrt(free * free * free + moved * moved * moved - 1.0);
}

/* Still air carries heat off a thin wire a little better the hotter it is; moving air does not. */
static void weigh_convection(world_t *world)
{
    double sink_c = world->parameters.air_w_per_k > 0.0 ? world->air_c : world->ambient_c;
    for (int k = 0; k < world->springs; k++) {
        spring_t *spring = &world->spring[k];
        for (int n = 0; n < WORLD_NODES; n++) {
            spring->node[n].convection_w_per_k =
                spring->convection_full_w_per_k *
                convection(world->parameters.convection,
                           fabs(spring->node[n].temperature_c - sink_c), sink_c,
                           world->loss_factor * spring->loss_factor);
        }
    }
}

static double node_ohm(const world_spring_t *parameters, const node_t *node)
{
    const grain_t *grain = &node->grain;
    double rise_k = node->temperature_c - WORLD_RESISTANCE_C;
    double martensite = 1.0 - grain->austenite - grain->r_phase;
    double austenite_ohm_per = 1.0 + parameters->austenite_per_k * rise_k;
    return SHARE * (martensite * parameters->martensite_ohm *
                        (1.0 + parameters->martensite_per_k * rise_k) +
                    (grain->austenite * parameters->austenite_ohm +
                     grain->r_phase * parameters->r_phase_ohm) *
                        austenite_ohm_per);
}

double world_resistance_ohm(const world_t *world, int spring)
{
    double ohm = world->spring[spring].contact_ohm;
    for (int n = 0; n < WORLD_NODES; n++) {
        ohm += node_ohm(&world->parameters.spring[spring], &world->spring[spring].node[n]);
    }
    return ohm;
}

/* Joule heat of a step. Half of what the crimps' contacts make goes into the wire's ends. */
static void heat(world_t *world, int k, uint16_t duty)
{
    spring_t *spring = &world->spring[k];
    double part[WORLD_NODES], ohm = spring->contact_ohm;
    for (int n = 0; n < WORLD_NODES; n++) {
        part[n] = node_ohm(&world->parameters.spring[k], &spring->node[n]);
        ohm += part[n];
    }
    const double share = (double)duty / CONTROLLER_DUTY_MAX;
    const double dropped_v = duty > 0 ? (1.0 - share) * world->parameters.freewheel_v : 0.0;
    double current_a =
        fmax(world->supply_v * share - dropped_v, 0.0) / (ohm + world->parameters.loop_ohm);
    for (int n = 0; n < WORLD_NODES; n++) {
        double contact_ohm = n == 1 ? 0.0 : 0.25 * spring->contact_ohm;
        spring->node[n].power_w = current_a * current_a * (part[n] + contact_ohm);
    }
    spring->current_a += current_a / world->steps;
    spring->voltage_v += current_a * ohm / world->steps;
}

static void exchange(world_t *world, double *to_air_w, double *to_plate_w)
{
    const world_parameters_t *p = &world->parameters;
    double air_c = p->air_w_per_k > 0.0 ? world->air_c : world->ambient_c;
    double crimp_c = p->plate_w_per_k > 0.0 ? world->plate_c : world->ambient_c;
    for (int k = 0; k < world->springs; k++) {
        const world_spring_t *parameters = &p->spring[k];
        node_t *node = world->spring[k].node;
        for (int n = 0; n < WORLD_NODES; n++) {
            double air_w = node[n].convection_w_per_k * (node[n].temperature_c - air_c) +
                           radiation_w(parameters, node[n].temperature_c, world->ambient_c);
            node[n].flow_w = air_w;
            *to_air_w += air_w;
        }
        for (int n = 0; n < WORLD_NODES; n += 2) {
            double crimp_w = parameters->crimp_w_per_k * (node[n].temperature_c - crimp_c);
            double axial_w = AXIAL_W_PER_K * (node[n].temperature_c - node[1].temperature_c);
            node[n].flow_w += crimp_w + axial_w;
            node[1].flow_w -= axial_w;
            *to_plate_w += crimp_w;
        }
    }
    for (int i = 0; i < world->pairs; i++) {
        node_t *a = world->spring[world->pair[i].a].node, *b = world->spring[world->pair[i].b].node;
        for (int n = 0; n < WORLD_NODES; n++) {
            double w = world->pair[i].w_per_k * (a[n].temperature_c - b[n].temperature_c);
            a[n].flow_w += w;
            b[n].flow_w -= w;
        }
    }
}

/* The temperature at which the node holds its enthalpy, along the branch that leads there: heat
 * grows with temperature on each, so what was too cold and what was too hot enclose it. Latent heat
 * is many times the sensible heat of a kelvin, so Newton's steps follow the branch; where a law
 * begins steeply they leave what is enclosed, and halve it instead. */
static void settle(const world_spring_t *parameters, node_t *node, double stress_mpa)
{
    double capacity_j_per_k = SHARE * parameters->heat_capacity_j_per_k;
    double latent_j = SHARE * parameters->latent_heat_j;
    double heating_k = stress_mpa / WORLD_HEATING_MPA_PER_K;
    double cooling_k = stress_mpa / WORLD_COOLING_MPA_PER_K;
    double c = node->temperature_c, cold_c = -INFINITY, hot_c = INFINITY;
    grain_t grain = node->grain;
    double missing_j = node->enthalpy_j - capacity_j_per_k * c - latent_j * grain.latent;
    for (int round = 0; round == 0 || (round < SOLVER_ROUNDS && fabs(missing_j) >= SOLVER_J);
         round++) {
        c += missing_j / (capacity_j_per_k + latent_j * grain.latent_per_k);
        if (c <= cold_c || c >= hot_c) {
            c = 0.5 * (cold_c + hot_c);
        }
        grain = node->grain;
        grain_move(&grain, &parameters->alloy, c - heating_k, c - cooling_k);
        missing_j = node->enthalpy_j - capacity_j_per_k * c - latent_j * grain.latent;
        cold_c = missing_j > 0.0 ? c : cold_c;
        hot_c = missing_j < 0.0 ? c : hot_c;
    }
    node->temperature_c = c;
    node->grain = grain;
}

static void step(world_t *world, const uint16_t duty[])
{
    const world_parameters_t *p = &world->parameters;
    double to_air_w = 0.0, to_plate_w = 0.0;
    for (int k = 0; k < world->springs; k++) {
        spring_t *spring = &world->spring[k];
        spring->stress_mpa +=
            (spring->stress_aim_mpa - spring->stress_mpa) * p->step_s / STRESS_TIME_S;
        spring->contact_ohm =
            fmax(spring->contact_ohm + spring->contact_ohm_per_s * p->step_s, 0.0);
        heat(world, k, duty[k]);
    }
    exchange(world, &to_air_w, &to_plate_w);
    for (int k = 0; k < world->springs; k++) {
        spring_t *spring = &world->spring[k];
        for (int n = 0; n < WORLD_NODES; n++) {
            node_t *node = &spring->node[n];
            node->enthalpy_j += (node->power_w - node->flow_w) * p->step_s;
            world->supplied_j += node->power_w * p->step_s;
            settle(&p->spring[k], node, spring->stress_mpa);
        }
    }
    world->lost_j += (to_air_w + to_plate_w) * p->step_s;
    if (p->air_w_per_k > 0.0) {
        world->air_c += (to_air_w - p->air_w_per_k * (world->air_c - world->ambient_c)) /
                        p->air_j_per_k * p->step_s;
    }
    if (p->plate_w_per_k > 0.0) {
        world->plate_c += (to_plate_w - p->plate_w_per_k * (world->plate_c - world->ambient_c)) /
                          p->plate_j_per_k * p->step_s;
    }
}

static void read_sensors(world_t *world)
{
    for (int k = 0; k < world->springs; k++) {
        const spring_t *seen = &world->spring[world->spring[k].sensor_of];
        controller_sensor_t *reading = &world->inputs.sensor[k];
        reading->status = CONTROLLER_SENSOR_OK;
        ina219_read(&world->spring[k].sensor, &world->random, seen->current_a, seen->voltage_v,
                    &reading->current_ma, &reading->voltage_mv);
    }
}

void world_tick(world_t *world, const controller_outputs_t *outputs, controller_inputs_t *inputs)
{
    double now_s = world_time_s(world);
    if (now_s >= world->next_event_s) {
        let_events_happen(world, now_s);
    }
    if (world->ticks % LOSS_EVERY_TICKS == 0) {
        blow(world, now_s, outputs->fan_percent);
        weigh_convection(world);
    }
    for (int k = 0; k < world->springs; k++) {
        world->spring[k].current_a = world->spring[k].voltage_v = 0.0;
    }
    for (int s = 0; s < world->steps; s++) {
        step(world, outputs->duty);
    }
    world->ticks++;
    read_sensors(world);
    world->inputs.fan_percent = outputs->fan_percent;
    world->inputs.ambient_c7 = (int16_t)lround(world->parameters.ambient_setting_c * 128.0);
    *inputs = world->inputs;
}

int world_springs(const world_t *world)
{
    return world->springs;
}

double world_time_s(const world_t *world)
{
    return (double)world->ticks * WORLD_TICK_S;
}

double world_node_c(const world_t *world, int spring, int node)
{
    return world->spring[spring].node[node].temperature_c;
}

double world_hottest_c(const world_t *world, int spring)
{
    const node_t *node = world->spring[spring].node;
    return fmax(node[1].temperature_c, fmax(node[0].temperature_c, node[2].temperature_c));
}

double world_mean_c(const world_t *world, int spring)
{
    const node_t *node = world->spring[spring].node;
    return SHARE * (node[0].temperature_c + node[1].temperature_c + node[2].temperature_c);
}

double world_austenite(const world_t *world, int spring)
{
    const node_t *node = world->spring[spring].node;
    return SHARE * (node[0].grain.austenite + node[1].grain.austenite + node[2].grain.austenite);
}

double world_martensite_start_c(const world_t *world, int spring)
{
    return world->parameters.spring[spring].alloy.martensite_start_c +
           world->spring[spring].stress_mpa / WORLD_COOLING_MPA_PER_K;
}

double world_austenite_start_c(const world_t *world, int spring)
{
    return world->parameters.spring[spring].alloy.austenite_start_c +
           world->spring[spring].stress_mpa / WORLD_HEATING_MPA_PER_K;
}

double world_current_a(const world_t *world, int spring)
{
    return world->spring[spring].current_a;
}

double world_voltage_v(const world_t *world, int spring)
{
    return world->spring[spring].voltage_v;
}

double world_loss_factor(const world_t *world)
{
    return world->loss_factor;
}

double world_spring_loss_factor(const world_t *world, int spring)
{
    return world->spring[spring].loss_factor;
}

double world_supply_v(const world_t *world)
{
    return world->supply_v;
}

double world_ambient_c(const world_t *world)
{
    return world->ambient_c;
}

world_energy_t world_energy(const world_t *world)
{
    world_energy_t energy = {0.0, world->supplied_j, world->lost_j};
    for (int k = 0; k < world->springs; k++) {
        for (int n = 0; n < WORLD_NODES; n++) {
            energy.stored_j +=
                node_enthalpy_j(&world->parameters.spring[k], &world->spring[k].node[n]);
        }
    }
    return energy;
}
