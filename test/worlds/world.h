/* What it is for: a second truth for campaigns: an array of springs written from the physics, which
 *                 shares no code and no equation with the chip's model nor with the simulator's.
 * What it owns: three nodes along each spring, their heat, phase and resistance, the circuit, the
 *               sensors, the room, and what happens to them in time.
 * What it never does: know of a controller's thoughts: duties in, readings out. */
#ifndef WORLDS_WORLD_H
#define WORLDS_WORLD_H

#include <stdbool.h>
#include <stdint.h>

#include "controller.h"
#include "ina219.h"
#include "kinetics.h"

#define WORLD_SPRINGS_MAX 16
#define WORLD_NODES       3 /* thirds of the wire: crimped end, middle, crimped end */
#define WORLD_EVENTS_MAX  1024
#define WORLD_TICK_S      0.02

/* Stress moves the transformation: Flexinol, measured (docs/worlds.md). */
#define WORLD_HEATING_MPA_PER_K 8.1
#define WORLD_COOLING_MPA_PER_K 7.5

#define WORLD_LOSS_RISE_K  85.0 /* above the air, at which loss_w_per_k is meant */
#define WORLD_RESISTANCE_C 20.0 /* at which resistances are meant */

typedef struct {
    double heat_capacity_j_per_k;
    double latent_heat_j;
    double loss_w_per_k;  /* to the air and through both crimps, WORLD_LOSS_RISE_K above the air */
    double crimp_w_per_k; /* of that, through each crimp */
    double radiating_m2;  /* emissivity times the surface that sees the room */
    alloy_t alloy;        /* unloaded */
    double stress_mpa;
    double martensite_ohm, austenite_ohm, r_phase_ohm;
    double martensite_per_k, austenite_per_k; /* temperature coefficients */
    double contact_ohm;                       /* both crimps, within what the sensor sees */
    double start_c;
    bool was_austenite; /* it came to start_c from above */
    ina219_t sensor;
} world_spring_t;

typedef enum {
    WORLD_STRESS_MPA,          /* value: stress from now on, MPa, taken up within 0.3 s */
    WORLD_CONTACT_OHM,         /* value: contact resistance from now on */
    WORLD_CONTACT_OHM_PER_S,   /* value: its drift from now on */
    WORLD_SENSOR_FREEZE,       /* the last registers from now on: value 0 both, 1 the current's, 2
                                  the voltage's; else it reads again */
    WORLD_SENSOR_CURRENT_GAIN, /* value: gain from now on: a lie */
    WORLD_SENSOR_VOLTAGE_GAIN, /* the same */
    WORLD_SENSOR_SWAP, /* value: spring whose sensor answers for this one, and the reverse */
    WORLD_LOSS_FACTOR, /* value: factor on the loss to the air by convection from now on: a door,
                          a draught, dust; gust and fan come on top */
    WORLD_SUPPLY_V,    /* value: supply from now on */
    WORLD_AMBIENT_C    /* value: true ambient from now on */
} world_event_kind_t;

typedef struct {
    world_event_kind_t kind;
    double time_s;
    int spring; /* ignored by supply and ambient */
    double value;
} world_event_t;

typedef enum {
    WORLD_CONVECTION_MORGAN = 0, /* conductance rises with the rise's power; moving air scales it */
    /* Churchill and Chu 1975 for what rises, with the film's conductivity; moving air by itself,
       the two blended by their cubes (Churchill 1977): a draught flattens the rise. */
    WORLD_CONVECTION_CHURCHILL,
    WORLD_CONVECTION_COUNT
} world_convection_t;

typedef struct {
    int rows, columns;
    world_convection_t convection;
    world_spring_t spring[WORLD_SPRINGS_MAX];
    double orthogonal_w_per_k, diagonal_w_per_k; /* between neighbouring springs */
    double fan_loss_factor;                      /* loss to the air with the fan full on */
    double supply_v;
    double freewheel_v;       /* drop of the freewheel diodes; 0: synchronous */
    double loop_ohm;          /* beyond spring and contacts: shunt, switch, inductor */
    double ambient_c;         /* true */
    double ambient_setting_c; /* what the board is told */
    /* The room. Without air or plate (conductance 0), loss and crimps go to ambient. */
    double air_w_per_k, air_j_per_k;
    double plate_w_per_k, plate_j_per_k;
    /* Gusts: 0 none. Between them the air is still for gust_every_s on average. */
    double gust_every_s, gust_lasts_s, gust_factor;
    double step_s; /* of integration: a tick is a whole number of steps */
    int events;
    world_event_t event[WORLD_EVENTS_MAX];
    uint64_t seed; /* of noise and gusts */
} world_parameters_t;

typedef struct world world_t;

/* The paper's spring and array on the reference board, as docs/physics.md declares them; pitch 4
 * mm. */
void world_parameters_default(world_parameters_t *parameters);

/* Moves everything that a specimen may have otherwise within +- tolerance of what it is, partly for
 * the whole array (one batch), partly for each spring; transformation temperatures by that share of
 * their band's width. Also draws the sensors' and contacts' imperfections, and the seed. */
void world_draw(world_parameters_t *parameters, uint64_t seed, double tolerance);

/* NULL if and only if memory or the parameters do not allow it: rows x columns outside
 * 1..WORLD_SPRINGS_MAX, a step that does not divide the tick, too many events, or a heat capacity,
 * resistance or width of a band that is not positive. */
world_t *world_create(const world_parameters_t *parameters);
void world_destroy(world_t *world);

/* One tick of 20 ms with these outputs. *inputs is what the board reads at its end: the mean of the
 * tick, so the controller's next call sees it one tick late, as on the board. */
void world_tick(world_t *world, const controller_outputs_t *outputs, controller_inputs_t *inputs);

/* What is true. Temperatures degC; spring below rows x columns. */
int world_springs(const world_t *world);
double world_time_s(const world_t *world);
double world_node_c(const world_t *world, int spring, int node);
double world_hottest_c(const world_t *world, int spring); /* of its nodes */
double world_mean_c(const world_t *world, int spring);
double world_austenite(const world_t *world, int spring);          /* 0..1, mean of its nodes */
double world_martensite_start_c(const world_t *world, int spring); /* under the present load */
double world_austenite_start_c(const world_t *world, int spring);
double world_resistance_ohm(const world_t *world, int spring);     /* with its contacts */
double world_current_a(const world_t *world, int spring);          /* mean of the last tick */
double world_voltage_v(const world_t *world, int spring);          /* the same, across the spring */
double world_loss_factor(const world_t *world);                    /* by gust and fan */
double world_spring_loss_factor(const world_t *world, int spring); /* by WORLD_LOSS_FACTOR alone */
double world_ambient_c(const world_t *world);                      /* true, now */
double world_supply_v(const world_t *world);                       /* the same */

/* Where the heat is, J: what the wires hold above 0 degC of martensite, what currents have put in
 * since the start, and what went out to air, crimps and room. stored - supplied + lost stays. */
typedef struct {
    double stored_j, supplied_j, lost_j;
} world_energy_t;
world_energy_t world_energy(const world_t *world);

#endif
