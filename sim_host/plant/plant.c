#include "plant.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "convection.h"
#include "electrics.h"

#define MAX_SPRINGS      PLANT_MAX_SPRINGS
#define STEFAN_BOLTZMANN 5.670374419e-8 /* W/m2K4 */
#define KELVIN           273.15
#define PI               3.141592653589793
#define COLDEST_C        (-60.0)
#define HOTTEST_C        500.0
#define LONGEST_STEP_S   1e7

/* ------------------------------------------------------------------ tables */

/* id, name, unit, effect, default, minimum, maximum, per spring, description */
#define PARAMETERS(X)                                                                              \
    X(HEAT_CAPACITY, "heat_capacity_j_per_k", "J/K", NULL, 0.300, 1e-3, 1e4, true,                 \
      "heat capacity of a spring")                                                                 \
    X(LOSS, "loss_w_per_k", "W/K", NULL, 0.0058, 0, 10, true, "spring to air, fan off")            \
    X(LOSS_FAN, "loss_fan_w_per_k", "W/K", NULL, 0.0113, 0, 10, true,                              \
      "spring to air, fan at 1; between, in proportion")                                           \
    X(ORTHOGONAL, "orthogonal_w_per_k", "W/K", NULL, 0.000408, 0, 10, false,                       \
      "between neighbours in a row or column, fan off")                                            \
    X(ORTHOGONAL_FAN, "orthogonal_fan_w_per_k", "W/K", NULL, 0.000403, 0, 10, false,               \
      "the same, fan at 1")                                                                        \
    X(DIAGONAL, "diagonal_w_per_k", "W/K", NULL, 0.000204, 0, 10, false,                           \
      "between diagonal neighbours, fan off")                                                      \
    X(DIAGONAL_FAN, "diagonal_fan_w_per_k", "W/K", NULL, 0.0002015, 0, 10, false,                  \
      "the same, fan at 1")                                                                        \
    X(AMBIENT, "ambient_c", "degC", NULL, 20, -40, 80, false, "air far away")                      \
    X(RESISTANCE, "resistance_ohm", "ohm", NULL, 0.219, 1e-3, 1e3, true,                           \
      "of a spring, where resistance_phase is off (austenite)")                                    \
    X(COMMAND_POWER, "command_power_w", "W", NULL, 0.5, 0, 100, true,                              \
      "into a spring at command 1")                                                                \
    X(SUPPLY_V, "supply_v", "V", NULL, 5, 0.1, 100, false, "of the stages, unloaded")              \
    X(LOOP_OHM, "loop_resistance_ohm", "ohm", NULL, 0.18, 0, 100, true,                            \
      "in a stage beyond the spring: 0.10 shunt + 0.08")                                           \
    X(FREEWHEEL_V, "freewheel_drop_v", "V", NULL, 0, 0, 2, false,                                  \
      "of the freewheel diode; 0: synchronous")                                                    \
    X(SURFACE, "surface_mm2", "mm2", NULL, 277, 1, 1e5, false, "of a spring's wire")               \
    X(WIRE_DIAMETER, "wire_diameter_mm", "mm", NULL, 0.8, 0.01, 10, false, "of a spring's wire")   \
    X(MARTENSITE_FINISH, "martensite_finish_c", "degC", NULL, 68, -50, 200, false,                 \
      "cooling, transformation complete")                                                          \
    X(MARTENSITE_START, "martensite_start_c", "degC", NULL, 78, -50, 200, false,                   \
      "cooling, transformation begins")                                                            \
    X(AUSTENITE_START, "austenite_start_c", "degC", NULL, 88, -50, 200, false,                     \
      "heating, transformation begins")                                                            \
    X(AUSTENITE_FINISH, "austenite_finish_c", "degC", NULL, 98, -50, 200, false,                   \
      "heating, transformation complete")                                                          \
    X(TOLERANCE, "integration_tolerance_c", "K", NULL, 1e-3, 1e-9, 1, false,                       \
      "estimated error of one integration step")                                                   \
    X(EMISSIVITY, "emissivity", "1", "radiation", 0.4, 0, 1, false,                                \
      "eps sigma surface (T^4 - ambient^4), in addition to the loss")                              \
    X(CONVECTION, "convection_correlation", "1", "natural_convection", 0, 0, 1, false,             \
      "0: loss_w_per_k ((T - air) / reference)^exponent; 1: correlations for a wire")              \
    X(CONVECTION_EXPONENT, "convection_exponent", "1", "natural_convection", 0.25, 0, 1, false,    \
      "0.25 laminar, 1/3 turbulent, about 0.1 for a thin wire")                                    \
    X(CONVECTION_REFERENCE, "convection_reference_k", "K", "natural_convection", 85, 1, 500,       \
      false, "T - air at which loss_w_per_k holds")                                                \
    X(CONVECTION_SCALE, "convection_scale", "1", "natural_convection", 0.613, 0.01, 10, false,     \
      "correlation: natural, times this (coils shield each other)")                                \
    X(FORCED_SCALE, "forced_scale", "1", "natural_convection", 0.4, 0.01, 10, false,               \
      "correlation: forced, times this")                                                           \
    X(FAN_VELOCITY, "fan_velocity_m_per_s", "m/s", "natural_convection", 0.63, 0, 20, false,       \
      "correlation: air speed with the fan at 1 (2 cfm over 50 x 30 mm)")                          \
    X(LATENT_HEAT, "latent_heat_j", "J", "latent_heat", 8.65, 0, 1e4, true,                        \
      "of a spring's full transformation, taken up on heating")                                    \
    X(LATENT_COOLING, "latent_cooling_ratio", "1", "latent_heat", 1, 0, 1, false,                  \
      "latent heat given back on cooling, of that taken up")                                       \
    X(RESISTANCE_MARTENSITE, "resistance_martensite_ohm", "ohm", "resistance_phase", 0.175, 1e-3,  \
      1e3, true, "of a spring, all martensite, at 20 degC")                                        \
    X(RESISTANCE_AUSTENITE, "resistance_austenite_ohm", "ohm", "resistance_phase", 0.219, 1e-3,    \
      1e3, true, "all austenite, at 20 degC; above or below the martensite's")                     \
    X(RESISTANCE_COEFFICIENT, "resistance_coefficient_per_k", "1/K", "resistance_phase", 0, -1e-3, \
      1e-2, false, "of both phases, about 20 degC")                                                \
    X(AIR_HEAT_CAPACITY, "air_heat_capacity_j_per_k", "J/K", "shared_air", 2, 1e-3, 1e4, false,    \
      "air between the springs and what it keeps warm")                                            \
    X(AIR_EXCHANGE, "air_exchange_w_per_k", "W/K", "shared_air", 0.25, 1e-4, 100, false,           \
      "that air to ambient")                                                                       \
    X(PLATE_COUPLING, "plate_coupling_w_per_k", "W/K", "plate_conduction", 0.0015, 0, 10, true,    \
      "spring to plate")                                                                           \
    X(PLATE_HEAT_CAPACITY, "plate_heat_capacity_j_per_k", "J/K", "plate_conduction", 13, 1e-2,     \
      1e5, false, "50 x 50 x 3 mm of Perspex")                                                     \
    X(PLATE_LOSS, "plate_loss_w_per_k", "W/K", "plate_conduction", 0.05, 0, 100, false,            \
      "plate to ambient")                                                                          \
    X(WAKE, "wake_w_per_k", "W/K", "fan_wake", 0.001, 0, 10, false,                                \
      "heat a spring receives per K of its upstream neighbour above the air, fan at 1")            \
    X(WAKE_DIRECTION, "wake_direction", "1", "fan_wake", 0, 0, 3, false,                           \
      "the air goes 0 east (next column), 1 south (next row), 2 west, 3 north")                    \
    X(EDGE_LOSS, "edge_loss_fraction", "1", "edge_loss", 0.1, -0.24, 2, false,                     \
      "more loss to the air per free side: edge 1 side, corner 2")                                 \
    X(LOSS_SCALE, "loss_scale", "1", "spring_mismatch", 1, 0.01, 100, true,                        \
      "of a spring's loss to the air")                                                             \
    X(HEAT_CAPACITY_SCALE, "heat_capacity_scale", "1", "spring_mismatch", 1, 0.01, 100, true,      \
      "of a spring's heat capacity and latent heat")                                               \
    X(RESISTANCE_SCALE, "resistance_scale", "1", "spring_mismatch", 1, 0.01, 100, true,            \
      "of a spring's resistance; of its power where it is commanded")                              \
    X(SUPPLY_OHM, "supply_resistance_ohm", "ohm", "supply_sag", 0.2, 0, 100, false,                \
      "source resistance of the supply")                                                           \
    X(SUPPLY_CHOPPED, "supply_chopped", "1", "supply_sag", 0, 0, 1, false,                         \
      "commands: 0 loads draw their mean; 1 they are chopped, at a constant current")              \
    X(AMBIENT_RAMP, "ambient_ramp_k_per_h", "K/h", "ambient_drift", 2, -100, 100, false,           \
      "steady rise of the ambient")                                                                \
    X(AMBIENT_AMPLITUDE, "ambient_amplitude_k", "K", "ambient_drift", 1, 0, 50, false,             \
      "of the ambient's sinusoid")                                                                 \
    X(AMBIENT_PERIOD, "ambient_period_s", "s", "ambient_drift", 1800, 1, 1e7, false,               \
      "of the ambient's sinusoid")                                                                 \
    X(AMBIENT_PHASE, "ambient_phase_rad", "rad", "ambient_drift", 0, -6.3, 6.3, false,             \
      "of the ambient's sinusoid at time 0")                                                       \
    X(SENSOR_LAG, "sensor_lag_s", "s", "sensor_lag", 5, 1e-3, 1e4, true,                           \
      "time constant of a sensor")                                                                 \
    X(SENSOR_GAIN, "sensor_gain", "1", "sensor_gain", 1.05, 0.1, 10, true,                         \
      "shown = ambient + gain (T - ambient) + offset")                                             \
    X(SENSOR_OFFSET, "sensor_offset_k", "K", "sensor_gain", 0, -50, 50, true, "see sensor_gain")   \
    X(OPTICAL_ORTHOGONAL, "optical_orthogonal", "1", "optical_mixing", 0.05, 0, 0.2, false,        \
      "share of each neighbour in a row or column in what a pixel sees")                           \
    X(OPTICAL_DIAGONAL, "optical_diagonal", "1", "optical_mixing", 0.0125, 0, 0.05, false,         \
      "share of each diagonal neighbour")                                                          \
    X(OPTICAL_BACKGROUND, "optical_background", "1", "optical_mixing", 0, 0, 0.95, false,          \
      "share of a reflected or transmitted background in all that is seen")                        \
    X(OPTICAL_BACKGROUND_RISE, "optical_background_rise_k", "K", "optical_mixing", 0, -50, 200,    \
      false, "that background above ambient")

enum parameter_id {
#define X(id, ...) P_##id,
    PARAMETERS(X)
#undef X
        PARAMETER_COUNT
};

static const plant_parameter_t parameters[PARAMETER_COUNT] = {
#define X(id, name, unit, effect, standard, low, high, each, text)                                 \
    {name, unit, effect, text, standard, low, high, each},
    PARAMETERS(X)
#undef X
};

enum effect_id {
    E_RADIATION,
    E_NATURAL_CONVECTION,
    E_LATENT_HEAT,
    E_RESISTANCE_PHASE,
    E_SHARED_AIR,
    E_PLATE_CONDUCTION,
    E_FAN_WAKE,
    E_EDGE_LOSS,
    E_SPRING_MISMATCH,
    E_SUPPLY_SAG,
    E_AMBIENT_DRIFT,
    E_SENSOR_LAG,
    E_SENSOR_GAIN,
    E_OPTICAL_MIXING,
    EFFECT_COUNT
};

static const char *const effects[EFFECT_COUNT] = {
    "radiation",        "natural_convection", "latent_heat", "resistance_phase", "shared_air",
    "plate_conduction", "fan_wake",           "edge_loss",   "spring_mismatch",  "supply_sag",
    "ambient_drift",    "sensor_lag",         "sensor_gain", "optical_mixing"};

/* ------------------------------------------------------------------- state */

/* What happens at one instant. q_w: net heat into each spring, then the air, then the plate. */
typedef struct {
    double q_w[MAX_SPRINGS + 2];
    double in_w, out_w;
} flows_t;

struct plant {
    int rows, columns, n;
    double value[PARAMETER_COUNT][MAX_SPRINGS];
    bool on[EFFECT_COUNT];
    plant_drive_mode_t mode[MAX_SPRINGS];
    double quantity[MAX_SPRINGS];
    plant_fault_t fault[MAX_SPRINGS];
    double fan;

    /* the state */
    double time_s;
    double temperature_c[MAX_SPRINGS + 2]; /* springs, air, plate */
    double austenite[MAX_SPRINGS];
    double sensor_c[MAX_SPRINGS];
    /* Turning points. Heating follows heat_start + (1 - heat_start) rising(T) once that exceeds the
     * present fraction, from heat_from_c on; cooling follows cool_start falling(T) below
     * cool_from_c. */
    double heat_start[MAX_SPRINGS], heat_from_c[MAX_SPRINGS];
    double cool_start[MAX_SPRINGS], cool_from_c[MAX_SPRINGS];
    double input_j, output_j, stored_j;
    double step_s; /* the last good step: where the next one starts */

    /* derived from parameters, effects, fan and drives by prepare() */
    bool parameters_changed, inputs_changed, flows_known;
    int orthogonal_start[MAX_SPRINGS + 1], diagonal_start[MAX_SPRINGS + 1];
    unsigned char orthogonal[4 * MAX_SPRINGS], diagonal[4 * MAX_SPRINGS];
    double capacity[MAX_SPRINGS + 2], inverse_capacity[MAX_SPRINGS + 2];
    double latent_j[MAX_SPRINGS], latent_cooling_j[MAX_SPRINGS];
    double loss_scale[MAX_SPRINGS]; /* edge and mismatch */
    double loss_natural[MAX_SPRINGS], loss_forced[MAX_SPRINGS];
    double loss_sum[MAX_SPRINGS]; /* natural + forced */
    double resistance_scale[MAX_SPRINGS];
    double coupling_orthogonal, coupling_diagonal;
    double wake;
    int upstream[MAX_SPRINGS]; /* -1: none */
    double radiation_w_per_k4;
    double step_limit_s;
    double power_w[MAX_SPRINGS];
    double supply_v;
    bool power_varies; /* with the state: must be found anew at each stage */
    bool any_held;

    /* scratch of one step, so that nothing is allocated */
    flows_t k[4];
    double stage_c[MAX_SPRINGS + 2], stage_austenite[MAX_SPRINGS];
    double increment_j[MAX_SPRINGS + 2];
};

size_t plant_parameter_count(void)
{
    return PARAMETER_COUNT;
}

const plant_parameter_t *plant_parameter(size_t k)
{
    return k < PARAMETER_COUNT ? &parameters[k] : NULL;
}

static int find_parameter(const char *name, size_t length)
{
    for (int k = 0; k < PARAMETER_COUNT; k++)
        if (strncmp(parameters[k].name, name, length) == 0 && parameters[k].name[length] == '\0')
            return k;
    return -1;
}

int plant_parameter_index(const char *name)
{
    return find_parameter(name, strlen(name));
}

size_t plant_effect_count(void)
{
    return EFFECT_COUNT;
}

const char *plant_effect_name(size_t k)
{
    return k < EFFECT_COUNT ? effects[k] : NULL;
}

int plant_effect_index(const char *name)
{
    for (int k = 0; k < EFFECT_COUNT; k++)
        if (strcmp(effects[k], name) == 0)
            return k;
    return -1;
}

const char *plant_status_text(plant_status_t status)
{
    switch (status) {
    case PLANT_OK:
        return "ok";
    case PLANT_ERROR_NAME:
        return "no parameter or effect of that name";
    case PLANT_ERROR_RANGE:
        return "value outside its limits, or not a number";
    case PLANT_ERROR_INDEX:
        return "no such spring";
    case PLANT_ERROR_SIZE:
        return "rows x columns not in 1..64";
    case PLANT_ERROR_MEMORY:
        return "out of memory";
    case PLANT_ERROR_TIME:
        return "time step not positive, not finite or too long, or no steady state in time";
    }
    return "unknown status";
}

static double scalar(const plant_t *p, enum parameter_id id)
{
    return p->value[id][0];
}

static bool within(double value, double low, double high)
{
    return value >= low && value <= high;
}

/* ---------------------------------------------------------------- kinetics */
/* Liang and Rogers, J. Intell. Mater. Syst. Struct. 1 (1990) 207, with the turning point as memory:
 * a branch starts where the opposite transformation last ended, so that a loop that transforms
 * nothing leaves no trace. */

/* Cosine from 0 at low to 1 at high; *slope is its derivative. */
static double smooth_rise(double t, double low, double high, double *slope)
{
    *slope = 0.0;
    if (t <= low)
        return 0.0;
    if (t >= high)
        return 1.0;
    const double rate = PI / (high - low);
    const double angle = (t - low) * rate;
    *slope = 0.5 * rate * sin(angle);
    return 0.5 - 0.5 * cos(angle);
}

static double rising(const plant_t *p, double t, double *slope)
{
    return smooth_rise(t, p->value[P_AUSTENITE_START][0], p->value[P_AUSTENITE_FINISH][0], slope);
}

static double falling(const plant_t *p, double t, double *slope)
{
    return smooth_rise(t, p->value[P_MARTENSITE_FINISH][0], p->value[P_MARTENSITE_START][0], slope);
}

/* Fraction of spring i at t, coming monotonously from the last accepted state. */
static double fraction_at(const plant_t *p, int i, double t, double *slope)
{
    *slope = 0.0;
    if (t > p->heat_from_c[i]) {
        const double rise = rising(p, t, slope);
        *slope *= 1.0 - p->heat_start[i];
        const double fraction = p->heat_start[i] + (1.0 - p->heat_start[i]) * rise;
        if (fraction >= p->austenite[i])
            return fraction;
        *slope = 0.0; /* rounding at the turning point */
    } else if (t < p->cool_from_c[i]) {
        const double fall = falling(p, t, slope);
        *slope *= p->cool_start[i];
        const double fraction = p->cool_start[i] * fall;
        if (fraction <= p->austenite[i])
            return fraction;
        *slope = 0.0;
    }
    return p->austenite[i];
}

/* Where heating and cooling transform next, seen from t. */
static void set_thresholds(plant_t *p, int i, double t)
{
    p->heat_from_c[i] = p->austenite[i] < 1.0 ? fmax(t, p->value[P_AUSTENITE_START][0]) : HUGE_VAL;
    p->cool_from_c[i] =
        p->austenite[i] > 0.0 ? fmin(t, p->value[P_MARTENSITE_START][0]) : -HUGE_VAL;
}

/* Both branches are laid through (t, present fraction). The outer loop bounds what is possible at
 * t. */
static void anchor(plant_t *p, int i)
{
    double slope;
    const double t = p->temperature_c[i];
    const double rise = rising(p, t, &slope), fall = falling(p, t, &slope);
    p->austenite[i] = fmin(fmax(p->austenite[i], rise), fall);
    p->heat_start[i] = rise < 1.0 ? (p->austenite[i] - rise) / (1.0 - rise) : 0.0;
    p->cool_start[i] = fall > 0.0 ? p->austenite[i] / fall : 0.0;
    set_thresholds(p, i, t);
}

/* Moves spring i to t on its branches. Only a transformation moves the memory, and only the
 * opposite branch's. */
static void move_phase(plant_t *p, int i, double t)
{
    double slope;
    const double before = p->austenite[i];
    const double after = fraction_at(p, i, t, &slope);
    p->temperature_c[i] = t;
    if (after == before)
        return;
    p->austenite[i] = after;
    set_thresholds(p, i, t);
    if (after > before) {
        const double fall = falling(p, t, &slope);
        p->cool_start[i] = fall > 0.0 ? after / fall : 0.0;
    } else {
        const double rise = rising(p, t, &slope);
        p->heat_start[i] = rise < 1.0 ? (after - rise) / (1.0 - rise) : 0.0;
    }
}

/* Latent heat of a change of fraction, J. */
static double latent_heat(const plant_t *p, int i, double change)
{
    return change * (change > 0.0 ? p->latent_j[i] : p->latent_cooling_j[i]);
}

/* Temperature of spring i that has taken up heat_j since the last accepted state while it
 * transforms. capacity (T - T0) + latent (fraction(T) - fraction0) = heat, monotone in T: Newton
 * inside a bracket. */
static double invert_enthalpy(const plant_t *p, int i, double heat_j, double guess_c)
{
    const double t0 = p->temperature_c[i], c = p->capacity[i], x0 = p->austenite[i];
    const double straight = t0 + heat_j * p->inverse_capacity[i];
    double low = fmin(t0, straight), high = fmax(t0, straight);
    double t = guess_c > low && guess_c < high ? guess_c : straight;
    for (int iteration = 0; iteration < 60; iteration++) {
        double slope;
        const double change = fraction_at(p, i, t, &slope) - x0;
        const double excess = c * (t - t0) + latent_heat(p, i, change) - heat_j;
        if (fabs(excess) <= 1e-10 * c) /* 1e-10 K */
            break;
        if (excess > 0.0)
            high = t;
        else
            low = t;
        const double latent = straight > t0 ? p->latent_j[i] : p->latent_cooling_j[i];
        double next = t - excess / (c + latent * slope);
        if (!(next >= low && next <= high))
            next = 0.5 * (low + high);
        if (next == t)
            break;
        t = next;
    }
    return t;
}

/* -------------------------------------------------------------- electrical */

static double resistance_at(const plant_t *p, int i, double t, double austenite)
{
    if (!p->on[E_RESISTANCE_PHASE])
        return p->value[P_RESISTANCE][i] * p->resistance_scale[i];
    const double martensite_ohm = p->value[P_RESISTANCE_MARTENSITE][i];
    const double austenite_ohm = p->value[P_RESISTANCE_AUSTENITE][i];
    const double warm = 1.0 + p->value[P_RESISTANCE_COEFFICIENT][0] * (t - 20.0);
    return (martensite_ohm + (austenite_ohm - martensite_ohm) * austenite) * fmax(warm, 0.05) *
           p->resistance_scale[i];
}

/* Between the terminals, faults included; an open spring is left to its callers. */
static double terminal_ohm(const plant_t *p, int i, double t, double austenite)
{
    return p->fault[i] == PLANT_FAULT_SHORT ? ELECTRICS_SHORT_OHM
                                            : resistance_at(p, i, t, austenite);
}

static double command_w(const plant_t *p, int i)
{
    return p->quantity[i] * p->value[P_COMMAND_POWER][i] * p->resistance_scale[i];
}

/* Mean voltage of the supply under all that is drawn. Stages in duty and command mode load it like
 * conductances (chopped commands like current sinks), power and current mode draw their power
 * whatever the voltage is. */
static double supply_voltage(const plant_t *p, const double *t, const double *austenite)
{
    const double open_v = scalar(p, P_SUPPLY_V);
    const double source_ohm = scalar(p, P_SUPPLY_OHM);
    if (!p->on[E_SUPPLY_SAG] || source_ohm == 0.0)
        return open_v;
    const bool chopped = scalar(p, P_SUPPLY_CHOPPED) != 0.0;
    double conductance = 0.0, power = 0.0, sunk_a = 0.0;
    for (int i = 0; i < p->n; i++) {
        if (p->fault[i] == PLANT_FAULT_OPEN)
            continue;
        const double loop_ohm = p->value[P_LOOP_OHM][i];
        const double spring_ohm = terminal_ohm(p, i, t[i], austenite[i]);
        switch (p->mode[i]) {
        case PLANT_DRIVE_POWER:
            power += p->quantity[i];
            break;
        case PLANT_DRIVE_CURRENT:
            power += p->quantity[i] * p->quantity[i] * (spring_ohm + loop_ohm);
            break;
        case PLANT_DRIVE_DUTY: /* the supply gives duty times the spring's current */
            conductance += p->quantity[i] * p->quantity[i] / (spring_ohm + loop_ohm);
            break;
        case PLANT_DRIVE_COMMAND:
            if (chopped)
                sunk_a += command_w(p, i) / open_v;
            else
                conductance += command_w(p, i) / (open_v * open_v);
            break;
        case PLANT_DRIVE_TEMPERATURE:
            break; /* held by whatever holds it */
        }
    }
    return electrics_supply_v(fmax(open_v - source_ohm * sunk_a, 0.0), source_ohm, conductance,
                              power);
}

static double stage_current(const plant_t *p, int i, double supply_v, double t, double austenite)
{
    return electrics_buck_current_a(p->quantity[i], supply_v, scalar(p, P_FREEWHEEL_V),
                                    terminal_ohm(p, i, t, austenite), p->value[P_LOOP_OHM][i]);
}

/* Heat set free in spring i, W; a held spring's is found from its losses elsewhere. */
static double heating(const plant_t *p, int i, double supply_v, double t, double austenite)
{
    if (p->fault[i] != PLANT_FAULT_NONE)
        return 0.0;
    switch (p->mode[i]) {
    case PLANT_DRIVE_POWER:
        return p->quantity[i];
    case PLANT_DRIVE_CURRENT:
        return p->quantity[i] * p->quantity[i] * resistance_at(p, i, t, austenite);
    case PLANT_DRIVE_DUTY: {
        const double current = stage_current(p, i, supply_v, t, austenite);
        return current * current * resistance_at(p, i, t, austenite);
    }
    case PLANT_DRIVE_COMMAND: {
        const double open_v = scalar(p, P_SUPPLY_V), wanted_w = command_w(p, i);
        if (p->on[E_SUPPLY_SAG] && scalar(p, P_SUPPLY_CHOPPED) != 0.0) {
            /* While it is on it draws all of its current, whatever its command: only the others'
             * mean counts. The power is at constant current. */
            const double own_v = scalar(p, P_SUPPLY_OHM) * wanted_w / open_v;
            return wanted_w * fmin((supply_v + own_v) / open_v, 1.0);
        }
        const double ratio = supply_v / open_v;
        return wanted_w * ratio * ratio;
    }
    case PLANT_DRIVE_TEMPERATURE:
        break;
    }
    return 0.0;
}

/* ----------------------------------------------------------------- network */

static double ambient_at(const plant_t *p, double time_s)
{
    double ambient = p->value[P_AMBIENT][0];
    if (p->on[E_AMBIENT_DRIFT])
        ambient +=
            scalar(p, P_AMBIENT_RAMP) * time_s / 3600.0 +
            scalar(p, P_AMBIENT_AMPLITUDE) *
                sin(2.0 * PI * time_s / scalar(p, P_AMBIENT_PERIOD) + scalar(p, P_AMBIENT_PHASE));
    return ambient;
}

static double loss_at(const plant_t *p, int i, double t, double air)
{
    if (!p->on[E_NATURAL_CONVECTION])
        return p->loss_sum[i];
    if (scalar(p, P_CONVECTION) < 0.5)
        return p->loss_natural[i] * pow(fabs(t - air) / scalar(p, P_CONVECTION_REFERENCE),
                                        scalar(p, P_CONVECTION_EXPONENT)) +
               p->loss_forced[i];
    const double diameter_m = 1e-3 * scalar(p, P_WIRE_DIAMETER);
    const double natural =
        scalar(p, P_CONVECTION_SCALE) * convection_natural_w_per_m2k(diameter_m, t, air);
    const double forced =
        scalar(p, P_FORCED_SCALE) *
        convection_forced_w_per_m2k(diameter_m, p->fan * scalar(p, P_FAN_VELOCITY), t, air);
    return convection_mixed(natural, forced) * 1e-6 * scalar(p, P_SURFACE) * p->loss_scale[i];
}

static void find_flows(plant_t *p, double time_s, const double *t, const double *austenite,
                       flows_t *flows)
{
    const int n = p->n;
    const double ambient = ambient_at(p, time_s);
    const bool shared_air = p->on[E_SHARED_AIR], plate = p->on[E_PLATE_CONDUCTION];
    const bool natural = p->on[E_NATURAL_CONVECTION];
    const double air = shared_air ? t[n] : ambient;
    const double ambient_k2 = (ambient + KELVIN) * (ambient + KELVIN);
    double in_w = 0.0, to_air = 0.0, radiated = 0.0, to_plate = 0.0;

    if (p->power_varies) {
        p->supply_v = supply_voltage(p, t, austenite);
        for (int i = 0; i < n; i++)
            p->power_w[i] = heating(p, i, p->supply_v, t[i], austenite[i]);
    }
    for (int i = 0; i < n; i++) {
        const double ti = t[i];
        double orthogonal = 0.0, diagonal = 0.0;
        for (int k = p->orthogonal_start[i]; k < p->orthogonal_start[i + 1]; k++)
            orthogonal += t[p->orthogonal[k]] - ti;
        for (int k = p->diagonal_start[i]; k < p->diagonal_start[i + 1]; k++)
            diagonal += t[p->diagonal[k]] - ti;
        double q = p->coupling_orthogonal * orthogonal + p->coupling_diagonal * diagonal;

        double lost = (natural ? loss_at(p, i, ti, air) : p->loss_sum[i]) * (ti - air);
        if (p->wake != 0.0 && p->upstream[i] >= 0)
            lost -= p->wake * (t[p->upstream[i]] - air);
        to_air += lost;
        q -= lost;
        if (p->radiation_w_per_k4 != 0.0) {
            const double k2 = (ti + KELVIN) * (ti + KELVIN);
            const double w = p->radiation_w_per_k4 * (k2 * k2 - ambient_k2 * ambient_k2);
            radiated += w;
            q -= w;
        }
        if (plate) {
            const double w = p->value[P_PLATE_COUPLING][i] * (ti - t[n + 1]);
            to_plate += w;
            q -= w;
        }
        if (p->any_held && p->mode[i] == PLANT_DRIVE_TEMPERATURE) {
            p->power_w[i] = -q;
            q = -q;
            in_w += q;
            flows->q_w[i] = 0.0;
        } else {
            in_w += p->power_w[i];
            flows->q_w[i] = q + p->power_w[i];
        }
    }
    double out_w = radiated;
    flows->q_w[n] = flows->q_w[n + 1] = 0.0;
    if (shared_air) {
        const double w = scalar(p, P_AIR_EXCHANGE) * (air - ambient);
        flows->q_w[n] = to_air - w;
        out_w += w;
    } else {
        out_w += to_air;
    }
    if (plate) {
        const double w = scalar(p, P_PLATE_LOSS) * (t[n + 1] - ambient);
        flows->q_w[n + 1] = to_plate - w;
        out_w += w;
    }
    flows->in_w = in_w;
    flows->out_w = out_w;
}

/* --------------------------------------------------- parameters to network */

static void prepare_parameters(plant_t *p)
{
    const int n = p->n;
    const bool mismatch = p->on[E_SPRING_MISMATCH];
    for (int i = 0; i < n; i++) {
        const double heavier = mismatch ? p->value[P_HEAT_CAPACITY_SCALE][i] : 1.0;
        const int free_sides = 4 - (p->orthogonal_start[i + 1] - p->orthogonal_start[i]);
        p->capacity[i] = p->value[P_HEAT_CAPACITY][i] * heavier;
        p->latent_j[i] = p->on[E_LATENT_HEAT] ? p->value[P_LATENT_HEAT][i] * heavier : 0.0;
        p->latent_cooling_j[i] = p->latent_j[i] * scalar(p, P_LATENT_COOLING);
        p->loss_scale[i] = mismatch ? p->value[P_LOSS_SCALE][i] : 1.0;
        if (p->on[E_EDGE_LOSS])
            p->loss_scale[i] *= 1.0 + scalar(p, P_EDGE_LOSS) * free_sides;
        p->resistance_scale[i] = mismatch ? p->value[P_RESISTANCE_SCALE][i] : 1.0;

        static const int row_of[4] = {0, -1, 0, 1}, column_of[4] = {-1, 0, 1, 0};
        const int direction = (int)scalar(p, P_WAKE_DIRECTION);
        const int row = i / p->columns + row_of[direction];
        const int column = i % p->columns + column_of[direction];
        p->upstream[i] = row >= 0 && row < p->rows && column >= 0 && column < p->columns
                             ? row * p->columns + column
                             : -1;
    }
    p->capacity[n] = scalar(p, P_AIR_HEAT_CAPACITY);
    p->capacity[n + 1] = scalar(p, P_PLATE_HEAT_CAPACITY);
    for (int i = 0; i < n + 2; i++)
        p->inverse_capacity[i] = 1.0 / p->capacity[i];
    p->radiation_w_per_k4 = p->on[E_RADIATION] ? scalar(p, P_EMISSIVITY) * STEFAN_BOLTZMANN * 1e-6 *
                                                     scalar(p, P_SURFACE)
                                               : 0.0;
    /* Nodes that are off stand at ambient, so that switching one on starts it there. */
    if (!p->on[E_SHARED_AIR])
        p->temperature_c[n] = ambient_at(p, p->time_s);
    if (!p->on[E_PLATE_CONDUCTION])
        p->temperature_c[n + 1] = ambient_at(p, p->time_s);
    if (!p->on[E_SENSOR_LAG])
        memcpy(p->sensor_c, p->temperature_c, (size_t)n * sizeof(double));
    for (int i = 0; i < n; i++)
        anchor(p, i);
}

static void prepare_inputs(plant_t *p)
{
    const int n = p->n;
    const double fan = p->fan;
    p->coupling_orthogonal =
        scalar(p, P_ORTHOGONAL) + fan * (scalar(p, P_ORTHOGONAL_FAN) - scalar(p, P_ORTHOGONAL));
    p->coupling_diagonal =
        scalar(p, P_DIAGONAL) + fan * (scalar(p, P_DIAGONAL_FAN) - scalar(p, P_DIAGONAL));
    p->wake = p->on[E_FAN_WAKE] ? scalar(p, P_WAKE) * fan : 0.0;
    p->any_held = p->power_varies = false;
    const bool shared_air = p->on[E_SHARED_AIR], plate = p->on[E_PLATE_CONDUCTION];
    double fastest = 0.0, air_sum = scalar(p, P_AIR_EXCHANGE), plate_sum = scalar(p, P_PLATE_LOSS);
    for (int i = 0; i < n; i++) {
        p->loss_natural[i] = p->value[P_LOSS][i] * (1.0 - fan) * p->loss_scale[i];
        p->loss_forced[i] = p->value[P_LOSS_FAN][i] * fan * p->loss_scale[i];
        p->loss_sum[i] = p->loss_natural[i] + p->loss_forced[i];
        if (p->mode[i] == PLANT_DRIVE_TEMPERATURE)
            p->any_held = true;
        if (p->on[E_RESISTANCE_PHASE] &&
            (p->mode[i] == PLANT_DRIVE_CURRENT || p->mode[i] == PLANT_DRIVE_DUTY))
            p->power_varies = true;
        /* Gershgorin: no eigenvalue beyond (own conductances + couplings) / capacity */
        const double own = p->loss_sum[i] + p->wake + 4.0 * 1.1e8 * p->radiation_w_per_k4 +
                           (plate ? p->value[P_PLATE_COUPLING][i] : 0.0);
        const double coupled =
            p->coupling_orthogonal * (p->orthogonal_start[i + 1] - p->orthogonal_start[i]) +
            p->coupling_diagonal * (p->diagonal_start[i + 1] - p->diagonal_start[i]);
        fastest = fmax(fastest, (own + 2.0 * coupled) * p->inverse_capacity[i]);
        air_sum += 2.0 * p->loss_sum[i];
        plate_sum += 2.0 * p->value[P_PLATE_COUPLING][i];
    }
    if (shared_air)
        fastest = fmax(fastest, air_sum * p->inverse_capacity[n]);
    if (plate)
        fastest = fmax(fastest, plate_sum * p->inverse_capacity[n + 1]);
    /* The method is stable to 2.5 / eigenvalue; 1.5 damps well. */
    p->step_limit_s = fastest > 0.0 ? 1.5 / fastest : LONGEST_STEP_S;
    if (p->on[E_AMBIENT_DRIFT])
        p->step_limit_s = fmin(p->step_limit_s, scalar(p, P_AMBIENT_PERIOD) / 32.0);
    if (p->on[E_SENSOR_LAG] && p->on[E_LATENT_HEAT])
        p->step_limit_s = fmin(p->step_limit_s, 1.0); /* lag() sees no kink within a step */
    p->supply_v = supply_voltage(p, p->temperature_c, p->austenite);
    for (int i = 0; i < n; i++)
        p->power_w[i] = heating(p, i, p->supply_v, p->temperature_c[i], p->austenite[i]);
}

/* Held springs go where they are held; what that takes counts as input. */
static void apply_holds(plant_t *p)
{
    for (int i = 0; i < p->n; i++) {
        if (p->mode[i] != PLANT_DRIVE_TEMPERATURE || p->temperature_c[i] == p->quantity[i])
            continue;
        const double warmer = p->quantity[i] - p->temperature_c[i];
        const double before = p->austenite[i];
        move_phase(p, i, p->quantity[i]);
        const double heat_j = p->capacity[i] * warmer + latent_heat(p, i, p->austenite[i] - before);
        p->input_j += heat_j;
        p->stored_j += heat_j;
        p->flows_known = false;
        if (!p->on[E_SENSOR_LAG])
            p->sensor_c[i] = p->temperature_c[i];
    }
}

plant_status_t plant_check(const plant_t *p, const char **message)
{
    const double mf = scalar(p, P_MARTENSITE_FINISH), ms = scalar(p, P_MARTENSITE_START);
    const double as = scalar(p, P_AUSTENITE_START), af = scalar(p, P_AUSTENITE_FINISH);
    const char *text = NULL;
    if (!(mf < ms))
        text = "martensite_finish_c must be below martensite_start_c";
    else if (!(as < af))
        text = "austenite_start_c must be below austenite_finish_c";
    else if (!(mf < as))
        text = "martensite_finish_c must be below austenite_start_c";
    else if (!(ms < af))
        text = "martensite_start_c must be below austenite_finish_c";
    if (message)
        *message = text;
    return text ? PLANT_ERROR_RANGE : PLANT_OK;
}

static plant_status_t prepare(plant_t *p)
{
    if (p->parameters_changed) {
        const plant_status_t status = plant_check(p, NULL);
        if (status != PLANT_OK)
            return status;
        prepare_parameters(p);
        p->parameters_changed = false;
        p->inputs_changed = true;
    }
    if (p->inputs_changed) {
        prepare_inputs(p);
        p->inputs_changed = false;
        p->flows_known = false;
        apply_holds(p);
    }
    return PLANT_OK;
}

/* ------------------------------------------------------------- integration */

/* Temperature of spring i after heat_j on top of the accepted state. */
static double stage_temperature(const plant_t *p, int i, double heat_j, double guess_c)
{
    const double t = p->temperature_c[i] + heat_j * p->inverse_capacity[i];
    if (p->latent_j[i] > 0.0 && (t > p->heat_from_c[i] || t < p->cool_from_c[i]))
        return invert_enthalpy(p, i, heat_j, guess_c);
    return t;
}

/* Temperatures and phases after increment_j on top of the accepted state. */
static void find_stage(plant_t *p)
{
    for (int i = 0; i < p->n; i++) {
        double slope;
        const double t = stage_temperature(p, i, p->increment_j[i], p->stage_c[i]);
        p->stage_c[i] = t;
        if (p->power_varies)
            p->stage_austenite[i] = fraction_at(p, i, t, &slope);
    }
    for (int i = p->n; i < p->n + 2; i++)
        p->stage_c[i] = p->temperature_c[i] + p->increment_j[i] * p->inverse_capacity[i];
}

/* First-order lag over h, exact for a parabola through the temperatures at start, middle and end.
 */
static double lag(double shown, double t0, double middle, double t1, double tau, double h)
{
    const double c = 2.0 * (t0 + t1 - 2.0 * middle) / (h * h);
    const double b = (t1 - t0) / h - c * h;
    const double end = t1 - tau * (b + 2.0 * c * h) + 2.0 * c * tau * tau;
    const double start = t0 - tau * b + 2.0 * c * tau * tau;
    return end + (shown - start) * exp(-h / tau);
}

static void accept(plant_t *p, double h)
{
    const flows_t *first = &p->k[0], *last = &p->k[3];
    for (int i = 0; i < p->n; i++) {
        const double t0 = p->temperature_c[i], t1 = p->stage_c[i];
        if (p->on[E_SENSOR_LAG]) { /* heat at half of the step: Hermite, from the flows at both ends
                                    */
            const double heat_j =
                0.5 * p->increment_j[i] + 0.125 * h * (first->q_w[i] - last->q_w[i]);
            p->sensor_c[i] =
                lag(p->sensor_c[i], t0, stage_temperature(p, i, heat_j, 0.5 * (t0 + t1)), t1,
                    p->value[P_SENSOR_LAG][i], h);
        } else {
            p->sensor_c[i] = t1;
        }
        double change = 0.0;
        if (t1 > p->heat_from_c[i] || t1 < p->cool_from_c[i]) {
            const double before = p->austenite[i];
            move_phase(p, i, t1);
            change = p->austenite[i] - before;
        } else {
            p->temperature_c[i] = t1;
        }
        p->stored_j += p->capacity[i] * (t1 - t0) + latent_heat(p, i, change);
    }
    for (int i = p->n; i < p->n + 2; i++) {
        p->stored_j += p->capacity[i] * (p->stage_c[i] - p->temperature_c[i]);
        p->temperature_c[i] = p->stage_c[i];
    }
    p->input_j +=
        h * (2.0 / 9.0 * p->k[0].in_w + 1.0 / 3.0 * p->k[1].in_w + 4.0 / 9.0 * p->k[2].in_w);
    p->output_j +=
        h * (2.0 / 9.0 * p->k[0].out_w + 1.0 / 3.0 * p->k[1].out_w + 4.0 / 9.0 * p->k[2].out_w);
}

/* Bogacki and Shampine, Appl. Math. Lett. 2 (1989) 321: third order with an embedded second, the
 * last stage serving as the next step's first. Works on the heat each node takes up: energy closes
 * by construction, and latent heat needs no special case. */
static plant_status_t advance(plant_t *p, double dt_s)
{
    const plant_status_t status = prepare(p);
    if (status != PLANT_OK)
        return status;
    const int nodes = p->n + 2;
    const double tolerance = scalar(p, P_TOLERANCE);
    const double start_s = p->time_s, end_s = start_s + dt_s;
    double done_s = 0.0;
    double *e = p->increment_j;
    const double *k0 = p->k[0].q_w, *k1 = p->k[1].q_w, *k2 = p->k[2].q_w, *k3 = p->k[3].q_w;
    const double *austenite = p->power_varies ? p->stage_austenite : p->austenite;

    if (!p->flows_known || p->on[E_AMBIENT_DRIFT])
        find_flows(p, p->time_s, p->temperature_c, p->austenite, &p->k[0]);
    p->flows_known = true;
    while (done_s < dt_s) {
        const double left = dt_s - done_s;
        double h = fmin(p->step_s, p->step_limit_s);
        const bool to_end = h >= left * (1.0 - 1e-12);
        if (to_end)
            h = left;
        else if (2.0 * h > left)
            h = 0.5 * left;
        memcpy(p->stage_c, p->temperature_c, (size_t)nodes * sizeof(double));

        for (int i = 0; i < nodes; i++)
            e[i] = 0.5 * h * k0[i];
        find_stage(p);
        find_flows(p, start_s + done_s + 0.5 * h, p->stage_c, austenite, &p->k[1]);
        for (int i = 0; i < nodes; i++)
            e[i] = 0.75 * h * k1[i];
        find_stage(p);
        find_flows(p, start_s + done_s + 0.75 * h, p->stage_c, austenite, &p->k[2]);
        for (int i = 0; i < nodes; i++)
            e[i] = h * (2.0 / 9.0 * k0[i] + 1.0 / 3.0 * k1[i] + 4.0 / 9.0 * k2[i]);
        find_stage(p);
        find_flows(p, start_s + done_s + h, p->stage_c, austenite, &p->k[3]);

        double error = 0.0;
        for (int i = 0; i < nodes; i++) {
            const double difference =
                5.0 / 72.0 * k0[i] - 1.0 / 12.0 * k1[i] - 1.0 / 9.0 * k2[i] + 1.0 / 8.0 * k3[i];
            error = fmax(error, fabs(difference) * p->inverse_capacity[i]);
        }
        error *= h;
        double factor = 4.0;
        if (error * 256.0 > tolerance)
            factor = fmax(0.85 * cbrt(tolerance / error), 0.2);
        if (error > tolerance && h > 1e-6) {
            p->step_s = factor * h;
            continue; /* k[0] still holds */
        }
        accept(p, h);
        p->k[0] = p->k[3];
        /* a step cut short by the end says nothing against the longer one */
        if (!to_end || factor * h > p->step_s || error > 0.5 * tolerance)
            p->step_s = fmin(factor * h, 1e6);
        done_s = to_end ? dt_s : done_s + h;
        p->time_s = start_s + done_s;
    }
    p->time_s = end_s;
    return PLANT_OK;
}

plant_status_t plant_step(plant_t *p, double dt_s)
{
    if (!(dt_s > 0.0) || dt_s > LONGEST_STEP_S)
        return PLANT_ERROR_TIME;
    return advance(p, dt_s);
}

plant_status_t plant_settle(plant_t *p, double limit_s)
{
    if (!(limit_s > 0.0) || limit_s > LONGEST_STEP_S)
        return PLANT_ERROR_TIME;
    const double end_s = p->time_s + limit_s;
    while (p->time_s < end_s) {
        plant_status_t status = prepare(p);
        if (status == PLANT_OK)
            status = advance(p, fmin(p->step_limit_s, fmax(end_s - p->time_s, 1e-6)));
        if (status != PLANT_OK)
            return status;
        double fastest = 0.0;
        for (int i = 0; i < p->n + 2; i++)
            fastest = fmax(fastest, fabs(p->k[0].q_w[i]) * p->inverse_capacity[i]);
        for (int i = 0; i < p->n; i++)
            fastest = fmax(fastest, fabs(p->sensor_c[i] - p->temperature_c[i]) * 1e-4);
        if (fastest < 1e-9 && !p->on[E_AMBIENT_DRIFT])
            return PLANT_OK;
    }
    return PLANT_ERROR_TIME;
}

/* ------------------------------------------------------- making and setting */

static void find_neighbours(plant_t *p)
{
    int orthogonal = 0, diagonal = 0;
    for (int i = 0; i < p->n; i++) {
        p->orthogonal_start[i] = orthogonal;
        p->diagonal_start[i] = diagonal;
        for (int dr = -1; dr <= 1; dr++)
            for (int dc = -1; dc <= 1; dc++) {
                const int row = i / p->columns + dr, column = i % p->columns + dc;
                if ((dr == 0 && dc == 0) || row < 0 || row >= p->rows || column < 0 ||
                    column >= p->columns)
                    continue;
                const unsigned char j = (unsigned char)(row * p->columns + column);
                if (dr == 0 || dc == 0)
                    p->orthogonal[orthogonal++] = j;
                else
                    p->diagonal[diagonal++] = j;
            }
    }
    p->orthogonal_start[p->n] = orthogonal;
    p->diagonal_start[p->n] = diagonal;
}

plant_t *plant_create(int rows, int columns)
{
    if (rows < 1 || columns < 1 || rows > MAX_SPRINGS || columns > MAX_SPRINGS ||
        rows * columns > MAX_SPRINGS)
        return NULL;
    plant_t *p = calloc(1, sizeof *p);
    if (!p)
        return NULL;
    p->rows = rows;
    p->columns = columns;
    p->n = rows * columns;
    for (int k = 0; k < PARAMETER_COUNT; k++)
        for (int i = 0; i < MAX_SPRINGS; i++)
            p->value[k][i] = parameters[k].default_value;
    find_neighbours(p);
    plant_reset(p);
    return p;
}

void plant_destroy(plant_t *p)
{
    free(p);
}

plant_t *plant_copy(const plant_t *p)
{
    plant_t *copy = malloc(sizeof *copy);
    if (copy)
        *copy = *p;
    return copy;
}

int plant_spring_count(const plant_t *p)
{
    return p->n;
}

int plant_rows(const plant_t *p)
{
    return p->rows;
}

int plant_columns(const plant_t *p)
{
    return p->columns;
}

plant_status_t plant_set_index(plant_t *p, size_t k, int spring, double value)
{
    if (k >= PARAMETER_COUNT)
        return PLANT_ERROR_NAME;
    const plant_parameter_t *parameter = &parameters[k];
    if (spring < -1 || spring >= p->n || (spring > 0 && !parameter->per_spring))
        return PLANT_ERROR_INDEX;
    if (!within(value, parameter->minimum, parameter->maximum))
        return PLANT_ERROR_RANGE;
    if ((k == P_WAKE_DIRECTION || k == P_CONVECTION || k == P_SUPPLY_CHOPPED) &&
        value != floor(value))
        return PLANT_ERROR_RANGE;
    if (spring < 0)
        for (int i = 0; i < MAX_SPRINGS; i++)
            p->value[k][i] = value;
    else
        p->value[k][spring] = value;
    if (k == P_AMBIENT) {
        p->inputs_changed = true; /* need not rebuild the network at each row of a log */
        const double ambient = ambient_at(p, p->time_s);
        if (!p->on[E_SHARED_AIR])
            p->temperature_c[p->n] = ambient;
        if (!p->on[E_PLATE_CONDUCTION])
            p->temperature_c[p->n + 1] = ambient;
    } else {
        p->parameters_changed = true;
    }
    return PLANT_OK;
}

plant_status_t plant_get_index(const plant_t *p, size_t k, int spring, double *value)
{
    if (k >= PARAMETER_COUNT)
        return PLANT_ERROR_NAME;
    if (spring < -1 || spring >= p->n || (spring > 0 && !parameters[k].per_spring))
        return PLANT_ERROR_INDEX;
    *value = p->value[k][spring < 0 ? 0 : spring];
    return PLANT_OK;
}

/* "name" or "name[3]": *spring is -1 or 0-based. */
static plant_status_t parse_name(const plant_t *p, const char *name, size_t *k, int *spring)
{
    const char *bracket = strchr(name, '[');
    const int found = find_parameter(name, bracket ? (size_t)(bracket - name) : strlen(name));
    if (found < 0)
        return PLANT_ERROR_NAME;
    *k = (size_t)found;
    *spring = -1;
    if (!bracket)
        return PLANT_OK;
    if (bracket[1] < '1' || bracket[1] > '9')
        return PLANT_ERROR_INDEX;
    char *end;
    const long number = strtol(bracket + 1, &end, 10);
    if (end[0] != ']' || end[1] != '\0' || number > p->n || !parameters[found].per_spring)
        return PLANT_ERROR_INDEX;
    *spring = (int)number - 1;
    return PLANT_OK;
}

plant_status_t plant_set(plant_t *p, const char *name, double value)
{
    size_t k;
    int spring;
    const plant_status_t status = parse_name(p, name, &k, &spring);
    return status == PLANT_OK ? plant_set_index(p, k, spring, value) : status;
}

plant_status_t plant_get(const plant_t *p, const char *name, double *value)
{
    size_t k;
    int spring;
    const plant_status_t status = parse_name(p, name, &k, &spring);
    return status == PLANT_OK ? plant_get_index(p, k, spring, value) : status;
}

plant_status_t plant_set_effect_index(plant_t *p, size_t effect, bool on)
{
    if (effect >= EFFECT_COUNT)
        return PLANT_ERROR_NAME;
    p->on[effect] = on;
    p->parameters_changed = true;
    return PLANT_OK;
}

plant_status_t plant_set_effect(plant_t *p, const char *effect, bool on)
{
    const int k = plant_effect_index(effect);
    return k < 0 ? PLANT_ERROR_NAME : plant_set_effect_index(p, (size_t)k, on);
}

bool plant_effect_is_on(const plant_t *p, size_t effect)
{
    return effect < EFFECT_COUNT && p->on[effect];
}

void plant_reset(plant_t *p)
{
    p->time_s = 0.0;
    p->input_j = p->output_j = p->stored_j = 0.0;
    p->step_s = 1.0;
    const double ambient = ambient_at(p, 0.0);
    for (int i = 0; i < p->n + 2; i++)
        p->temperature_c[i] = ambient;
    for (int i = 0; i < p->n; i++) {
        p->sensor_c[i] = ambient;
        p->austenite[i] = 0.0;
    }
    p->parameters_changed = true; /* lays the branches anew */
    if (prepare(p) == PLANT_OK) {
        apply_holds(p);
        p->input_j = p->output_j = p->stored_j = 0.0;
    }
}

plant_status_t plant_set_temperature(plant_t *p, int spring, double temperature_c)
{
    if (spring < 0 || spring >= p->n)
        return PLANT_ERROR_INDEX;
    if (!within(temperature_c, COLDEST_C, HOTTEST_C))
        return PLANT_ERROR_RANGE;
    const plant_status_t status = prepare(p);
    if (status != PLANT_OK)
        return status;
    move_phase(p, spring, temperature_c);
    p->sensor_c[spring] = temperature_c;
    p->inputs_changed = true;
    return PLANT_OK;
}

plant_status_t plant_set_austenite(plant_t *p, int spring, double fraction)
{
    if (spring < 0 || spring >= p->n)
        return PLANT_ERROR_INDEX;
    if (!within(fraction, 0.0, 1.0))
        return PLANT_ERROR_RANGE;
    const plant_status_t status = prepare(p);
    if (status != PLANT_OK)
        return status;
    p->austenite[spring] = fraction;
    anchor(p, spring);
    p->inputs_changed = true;
    return PLANT_OK;
}

static bool drive_is_valid(plant_drive_mode_t mode, double quantity)
{
    switch (mode) {
    case PLANT_DRIVE_POWER:
        return within(quantity, 0.0, 100.0);
    case PLANT_DRIVE_CURRENT:
        return within(quantity, 0.0, 20.0);
    case PLANT_DRIVE_DUTY:
    case PLANT_DRIVE_COMMAND:
        return within(quantity, 0.0, 1.0);
    case PLANT_DRIVE_TEMPERATURE:
        return within(quantity, COLDEST_C, 300.0);
    }
    return false;
}

/* Values known to be valid. */
static void set_drive(plant_t *p, int i, plant_drive_mode_t mode, double quantity)
{
    if (p->mode[i] == mode && p->quantity[i] == quantity)
        return;
    p->mode[i] = mode;
    p->quantity[i] = quantity;
    p->inputs_changed = true;
}

plant_status_t plant_drive(plant_t *p, int spring, plant_drive_mode_t mode, double quantity)
{
    if (spring < 0 || spring >= p->n)
        return PLANT_ERROR_INDEX;
    if (!drive_is_valid(mode, quantity))
        return PLANT_ERROR_RANGE;
    set_drive(p, spring, mode, quantity);
    return prepare(p);
}

plant_status_t plant_set_fault(plant_t *p, int spring, plant_fault_t fault)
{
    if (spring < 0 || spring >= p->n)
        return PLANT_ERROR_INDEX;
    if (fault != PLANT_FAULT_NONE && fault != PLANT_FAULT_OPEN && fault != PLANT_FAULT_SHORT)
        return PLANT_ERROR_RANGE;
    p->fault[spring] = fault;
    p->inputs_changed = true;
    return PLANT_OK;
}

static void set_fan(plant_t *p, double fraction)
{
    if (p->fan == fraction)
        return;
    p->fan = fraction;
    p->inputs_changed = true;
}

plant_status_t plant_set_fan(plant_t *p, double fraction)
{
    if (!within(fraction, 0.0, 1.0))
        return PLANT_ERROR_RANGE;
    set_fan(p, fraction);
    return PLANT_OK;
}

plant_status_t plant_set_ambient(plant_t *p, double ambient_c)
{
    if (ambient_c == p->value[P_AMBIENT][0])
        return PLANT_OK;
    return plant_set_index(p, P_AMBIENT, -1, ambient_c);
}

/* ------------------------------------------------------------- a whole log */

static void write_row(const plant_t *p, double *measured_c, double *temperature_c)
{
    for (int i = 0; i < p->n; i++) {
        if (measured_c)
            measured_c[i] = plant_measured_c(p, i);
        if (temperature_c)
            temperature_c[i] = p->temperature_c[i];
    }
}

plant_status_t plant_simulate(plant_t *p, size_t rows, const double *time_s,
                              const plant_drive_mode_t *mode, const double *drive,
                              const double *fan, const double *ambient_c, double *measured_c,
                              double *temperature_c)
{
    const size_t n = (size_t)p->n;
    const plant_parameter_t *ambient = &parameters[P_AMBIENT];
    for (size_t r = 0; r < rows; r++) {
        const double dt_s = r + 1 < rows ? time_s[r + 1] - time_s[r] : 1.0;
        if (!(dt_s > 0.0) || dt_s > LONGEST_STEP_S)
            return PLANT_ERROR_TIME;
        for (size_t i = 0; i < n; i++)
            if (!isnan(drive[r * n + i]) && !drive_is_valid(mode[i], drive[r * n + i]))
                return PLANT_ERROR_RANGE;
        if (fan && !isnan(fan[r]) && !within(fan[r], 0.0, 1.0))
            return PLANT_ERROR_RANGE;
        if (ambient_c && !isnan(ambient_c[r]) &&
            !within(ambient_c[r], ambient->minimum, ambient->maximum))
            return PLANT_ERROR_RANGE;
    }
    plant_status_t status = prepare(p);
    for (size_t r = 0; r < rows && status == PLANT_OK; r++) {
        write_row(p, measured_c ? measured_c + r * n : NULL,
                  temperature_c ? temperature_c + r * n : NULL);
        for (int i = 0; i < p->n; i++)
            if (!isnan(drive[r * n + (size_t)i]))
                set_drive(p, i, mode[i], drive[r * n + (size_t)i]);
        if (fan && !isnan(fan[r]))
            set_fan(p, fan[r]);
        if (ambient_c && !isnan(ambient_c[r]))
            plant_set_ambient(p, ambient_c[r]);
        if (r + 1 < rows)
            status = advance(p, time_s[r + 1] - time_s[r]);
    }
    return status;
}

/* ----------------------------------------------------------------- reading */

double plant_time_s(const plant_t *p)
{
    return p->time_s;
}
double plant_ambient_c(const plant_t *p)
{
    return ambient_at(p, p->time_s);
}
double plant_temperature_c(const plant_t *p, int spring)
{
    return p->temperature_c[spring];
}
double plant_austenite(const plant_t *p, int spring)
{
    return p->austenite[spring];
}

double plant_supply_v(const plant_t *p)
{
    return supply_voltage(p, p->temperature_c, p->austenite);
}

double plant_air_c(const plant_t *p)
{
    return p->on[E_SHARED_AIR] ? p->temperature_c[p->n] : plant_ambient_c(p);
}

double plant_plate_c(const plant_t *p)
{
    return p->on[E_PLATE_CONDUCTION] ? p->temperature_c[p->n + 1] : plant_ambient_c(p);
}

double plant_resistance_ohm(const plant_t *p, int spring)
{
    return resistance_at(p, spring, p->temperature_c[spring], p->austenite[spring]);
}

double plant_power_w(const plant_t *p, int spring)
{
    if (p->mode[spring] == PLANT_DRIVE_TEMPERATURE)
        return p->power_w[spring];
    return heating(p, spring, plant_supply_v(p), p->temperature_c[spring], p->austenite[spring]);
}

double plant_current_a(const plant_t *p, int spring)
{
    if (p->fault[spring] == PLANT_FAULT_OPEN)
        return 0.0;
    switch (p->mode[spring]) {
    case PLANT_DRIVE_CURRENT:
        return p->quantity[spring];
    case PLANT_DRIVE_DUTY:
        return stage_current(p, spring, plant_supply_v(p), p->temperature_c[spring],
                             p->austenite[spring]);
    default:
        return sqrt(fmax(plant_power_w(p, spring), 0.0) / plant_resistance_ohm(p, spring));
    }
}

double plant_voltage_v(const plant_t *p, int spring)
{
    return plant_current_a(p, spring) *
           terminal_ohm(p, spring, p->temperature_c[spring], p->austenite[spring]);
}

double plant_measured_c(const plant_t *p, int spring)
{
    double seen = p->sensor_c[spring];
    const double ambient = ambient_at(p, p->time_s);
    if (p->on[E_OPTICAL_MIXING]) {
        double orthogonal = 0.0, diagonal = 0.0;
        for (int k = p->orthogonal_start[spring]; k < p->orthogonal_start[spring + 1]; k++)
            orthogonal += p->sensor_c[p->orthogonal[k]] - seen;
        for (int k = p->diagonal_start[spring]; k < p->diagonal_start[spring + 1]; k++)
            diagonal += p->sensor_c[p->diagonal[k]] - seen;
        const double background = ambient + scalar(p, P_OPTICAL_BACKGROUND_RISE);
        seen +=
            scalar(p, P_OPTICAL_ORTHOGONAL) * orthogonal + scalar(p, P_OPTICAL_DIAGONAL) * diagonal;
        seen += scalar(p, P_OPTICAL_BACKGROUND) * (background - seen);
    }
    if (p->on[E_SENSOR_GAIN])
        seen = ambient + p->value[P_SENSOR_GAIN][spring] * (seen - ambient) +
               p->value[P_SENSOR_OFFSET][spring];
    return seen;
}

double plant_energy_input_j(const plant_t *p)
{
    return p->input_j;
}

double plant_energy_balance_j(const plant_t *p)
{
    return p->input_j - p->output_j - p->stored_j;
}
