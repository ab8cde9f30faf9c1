/* What it is for: what the plant's rooms (table, phase, electric, network, sensors, solver) know of
 * each other.
 * What it owns: the plant's state and what is derived from its parameters; which room derives what.
 * What it never does: serve anyone outside this folder: users include plant.h. */
#ifndef PLANT_INTERNAL_H
#define PLANT_INTERNAL_H

#include "plant.h"

#define PI             3.141592653589793
#define COLDEST_C      (-60.0)
#define HOTTEST_C      500.0
#define LONGEST_STEP_S 1e7
#define HOTTEST_NODE_C 1e6 /* far beyond all that stays a spring */

/* ------------------------------------------------------------------- table */

enum parameter_id {
#define PLANT(name, ...) P_##name,
#include "plant.def"
    PARAMETER_COUNT
};

enum effect_id {
#define EFFECT(name, ...) E_##name,
#include "effects.def"
    EFFECT_COUNT
};

/* ------------------------------------------------------------------- state */

/* What happens at one instant. q_w: net heat into each node. */
typedef struct {
    double *q_w;
    double in_w, out_w;
} flows_t;

/* Transformation temperatures of one spring, degC. */
typedef struct {
    double martensite_finish_c, martensite_start_c, austenite_start_c, austenite_finish_c;
} points_t;

/* Springs that exchange heat directly. */
enum neighbour_kind {
    NEIGHBOUR_ORTHOGONAL, /* beside each other in a row or column */
    NEIGHBOUR_DIAGONAL,
    NEIGHBOUR_SECOND, /* two apart in a row or column */
    NEIGHBOUR_SERIES, /* of the other layer, end to end */
    NEIGHBOUR_KINDS
};
#define NEIGHBOURS_MOST 4 /* of one kind */

/* Those of one kind, sparse: spring i's are of[start[i]] .. of[start[i + 1] - 1]. */
typedef struct {
    int *start; /* n + 1 */
    int *of;
} neighbours_t;

/* One value for each spring, row by row, but for those that say how many they are. The values lie
 * behind the struct in its one piece of memory, as plant.c lays them out. */
struct plant {
    int rows, columns, layers, n; /* rows of a layer; n of all layers */
    int nodes;    /* springs, air, a plate for each layer; while that effect is on, their holders */
    size_t bytes; /* of the whole piece */
    double *value[PARAMETER_COUNT]; /* one where the parameter is not per_spring */
    bool on[EFFECT_COUNT];
    plant_drive_mode_t *mode;
    double *quantity;
    plant_fault_t *fault;
    double fan;
    /* What the setters leave for plant_solver_prepare. */
    bool parameters_changed, inputs_changed;
    bool restarted; /* the branches are to be laid anew, whatever was */

    double time_s;
    double *temperature_c; /* nodes */
    double *austenite;
    double *sensor_c;
    /* Turning points. Heating follows heat_start + (1 - heat_start) rising(T) once that exceeds the
     * present fraction, from heat_from_c on; cooling follows cool_start falling(T) below
     * cool_from_c. */
    double *heat_start, *heat_from_c;
    double *cool_start, *cool_from_c;
    double input_j, output_j, stored_j;
    double step_s; /* the last good step: where the next one starts */

    /* derived by phase */
    points_t *points;
    double *latent_j, *latent_cooling_j;

    /* derived by electric */
    double *resistance_scale;
    double *contact_ohm; /* 0 without the effect */
    double *power_w;
    double supply_v;
    bool power_varies; /* with the state: must be found anew at each stage */

    /* derived by network */
    neighbours_t neighbours[NEIGHBOUR_KINDS];
    int *upstream;                       /* -1: none */
    double *capacity, *inverse_capacity; /* nodes */
    double *loss_scale, *loss_scale_fan; /* edge and mismatch */
    double *loss_natural, *loss_forced;
    double *loss_sum; /* natural + forced */
    double coupling[NEIGHBOUR_KINDS][PLANT_MAX_LAYERS];
    double wake_scale[PLANT_MAX_LAYERS];
    double wake;
    double radiation_w_per_k4;
    bool any_held;

    /* derived by sensors: what a camera sees of a spring so many rows and columns away, in a layer
     */
    double *optical_weight;

    /* of the solver */
    double step_limit_s;
    bool flows_known; /* k[0] is of the present state */
    flows_t k[4];
    double *stage_c, *increment_j; /* nodes */
    double *stage_austenite;
};

static inline double scalar(const plant_t *p, enum parameter_id id)
{
    return p->value[id][0];
}

static inline int layer_of(const plant_t *p, int i)
{
    return i < p->rows * p->columns ? 0 : 1;
}

/* Of the plate at the outer end of a layer's springs. */
static inline int plate_node(const plant_t *p, int layer)
{
    return p->n + 1 + layer;
}

/* Of the holder behind spring i. The last ones: what has none need not step them. */
static inline int holder_node(const plant_t *p, int i)
{
    return p->n + 1 + p->layers + i;
}

/* Row of the array, in whichever layer. */
static inline int row_of(const plant_t *p, int i)
{
    return i / p->columns % p->rows;
}

static inline int neighbour_count(const plant_t *p, enum neighbour_kind kind, int i)
{
    return p->neighbours[kind].start[i + 1] - p->neighbours[kind].start[i];
}

/* Sum over those neighbours of t less spring i's. */
static inline double neighbour_difference(const neighbours_t *neighbours, const double *t, int i)
{
    double sum = 0.0;
    for (int k = neighbours->start[i]; k < neighbours->start[i + 1]; k++)
        sum += t[neighbours->of[k]] - t[i];
    return sum;
}

static inline bool within(double value, double low, double high)
{
    return value >= low && value <= high;
}

/* ------------------------------------------------------------------- phase */

/* After a change of parameters or effects, once the capacities are known. Where a spring's
 * transformation temperatures moved during a run (a load), its phase follows them at constant
 * enthalpy: what it transforms warms or cools it. */
void plant_phase_prepare(plant_t *p);
/* Fraction of spring i at t, coming monotonously from the last accepted state; *slope is its
 * derivative. */
double plant_phase_fraction(const plant_t *p, int i, double t, double *slope);
/* Both branches are laid through (t, present fraction). The outer loop bounds what is possible at
 * t. */
void plant_phase_anchor(plant_t *p, int i);
/* Moves spring i to t on its branches. Only a transformation moves the memory, and only the
 * opposite branch's. */
void plant_phase_move(plant_t *p, int i, double t);
/* Latent heat of a change of fraction, J. */
double plant_phase_latent_j(const plant_t *p, int i, double change);
/* Temperature of spring i after heat_j on top of the accepted state. */
double plant_phase_temperature_after(const plant_t *p, int i, double heat_j, double guess_c);

static inline bool plant_phase_moves(const plant_t *p, int i, double t)
{
    return t > p->heat_from_c[i] || t < p->cool_from_c[i];
}

/* ---------------------------------------------------------------- electric */

/* After a change of parameters or effects; and of drives, faults or the ambient. */
void plant_electric_prepare(plant_t *p);
void plant_electric_prepare_inputs(plant_t *p);
/* Supply and heating of each spring for these temperatures and fractions: into p->supply_v and
 * p->power_w. */
void plant_electric_find(plant_t *p, const double *t, const double *austenite);

/* ----------------------------------------------------------------- network */

void plant_network_lay(plant_t *p); /* who is whose neighbour: once */
void plant_network_prepare(plant_t *p);
/* Nodes that are off stand at ambient, so that switching one on starts it there. */
void plant_network_rest(plant_t *p);
/* Finds the longest stable step_limit_s too. */
void plant_network_prepare_inputs(plant_t *p);
double plant_network_ambient(const plant_t *p, double time_s);
/* Calls plant_electric_find where heating depends on the state. */
void plant_network_flows(plant_t *p, double time_s, const double *t, const double *austenite,
                         flows_t *flows);

/* ----------------------------------------------------------------- sensors */

void plant_sensors_prepare(plant_t *p);
/* After a change of optical_share, optical_width or optical_shape: a point-spread over the lattice
 * of places, those beyond the array too, exp(-(distance / width)^shape), of which all but the
 * spring's own place make up the share. */
void plant_sensors_spread(plant_t *p);
/* What the sensor of spring i shows h_s later, when its spring went from the accepted temperature
 * through middle_c to end_c. */
double plant_sensors_follow(const plant_t *p, int i, double middle_c, double end_c, double h_s);

/* ------------------------------------------------------------------ solver */

/* Derives what the setters have left to derive. Fails if and only if plant_check does. */
plant_status_t plant_solver_prepare(plant_t *p);
/* Held springs go where they are held; what that takes counts as input. */
void plant_solver_hold(plant_t *p);
/* As plant_step, dt_s known to be valid. */
plant_status_t plant_solver_advance(plant_t *p, double dt_s);

#endif
