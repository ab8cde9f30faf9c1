#include "plant_internal.h"

#include <math.h>

#include "electrics.h"

/* A straight line through 20 degC, stopped before a steep one crosses zero. */
static double warmed(double rise_per_k, double t)
{
    return fmax(1.0 + rise_per_k * (t - 20.0), 0.05);
}

static double resistance_at(const plant_t *p, int i, double t, double austenite)
{
    const bool phase = p->on[E_resistance_phase];
    double martensite_ohm = p->value[phase ? P_resistance_martensite_ohm : P_resistance_ohm][i];
    double austenite_ohm = p->value[phase ? P_resistance_austenite_ohm : P_resistance_ohm][i];
    if (p->on[E_resistance_temperature]) {
        martensite_ohm *= warmed(scalar(p, P_resistance_martensite_rise_per_k), t);
        austenite_ohm *= warmed(scalar(p, P_resistance_austenite_rise_per_k), t);
    }
    return (martensite_ohm + (austenite_ohm - martensite_ohm) * austenite) * p->resistance_scale[i];
}

/* Between the terminals, contact and faults included; an open spring is left to its callers. */
static double terminal_ohm(const plant_t *p, int i, double t, double austenite)
{
    switch (p->fault[i]) {
    case PLANT_FAULT_SHORT:
        return ELECTRICS_SHORT_OHM;
    case PLANT_FAULT_RESISTOR:
        return ELECTRICS_DUMMY_OHM;
    default:
        return resistance_at(p, i, t, austenite) + p->contact_ohm[i];
    }
}

/* Of the power at its terminals, what heats spring i: the rest heats its contact, which is at the
 * mount and warms no node. */
static double own_share(const plant_t *p, int i, double t, double austenite)
{
    if (p->contact_ohm[i] == 0.0)
        return 1.0;
    const double own_ohm = resistance_at(p, i, t, austenite);
    return own_ohm / (own_ohm + p->contact_ohm[i]);
}

static double command_w(const plant_t *p, int i)
{
    return p->quantity[i] * p->value[P_command_power_w][i] * p->resistance_scale[i];
}

/* Mean voltage of the supply under all that is drawn. Stages in duty and command mode load it like
 * conductances (chopped commands like current sinks), power and current mode draw their power
 * whatever the voltage is. */
static double supply_voltage(const plant_t *p, const double *t, const double *austenite)
{
    const double open_v = scalar(p, P_supply_v);
    const double source_ohm = scalar(p, P_supply_resistance_ohm);
    if (!p->on[E_supply_sag] || source_ohm == 0.0)
        return open_v;
    const bool chopped = scalar(p, P_supply_chopped) != 0.0;
    double conductance = 0.0, power = 0.0, sunk_a = 0.0;
    for (int i = 0; i < p->n; i++) {
        if (p->fault[i] == PLANT_FAULT_OPEN)
            continue;
        const double loop_ohm = p->value[P_loop_resistance_ohm][i];
        const double spring_ohm = terminal_ohm(p, i, t[i], austenite[i]);
        switch (p->mode[i]) {
        case PLANT_DRIVE_POWER:
            power += fmax(p->quantity[i], 0.0);
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
    return electrics_buck_current_a(p->quantity[i], supply_v, scalar(p, P_freewheel_drop_v),
                                    terminal_ohm(p, i, t, austenite),
                                    p->value[P_loop_resistance_ohm][i]);
}

/* Heat set free in spring i, W; a held spring's is found from its losses elsewhere. */
static double heating(const plant_t *p, int i, double supply_v, double t, double austenite)
{
    if (p->fault[i] != PLANT_FAULT_NONE)
        return 0.0;
    switch (p->mode[i]) {
    case PLANT_DRIVE_POWER:
        return p->quantity[i] * own_share(p, i, t, austenite);
    case PLANT_DRIVE_CURRENT:
        return p->quantity[i] * p->quantity[i] * resistance_at(p, i, t, austenite);
    case PLANT_DRIVE_DUTY: {
        const double current = stage_current(p, i, supply_v, t, austenite);
        return current * current * resistance_at(p, i, t, austenite);
    }
    case PLANT_DRIVE_COMMAND: {
        const double open_v = scalar(p, P_supply_v), wanted_w = command_w(p, i);
        if (p->on[E_supply_sag] && scalar(p, P_supply_chopped) != 0.0) {
            /* While it is on it draws all of its current, whatever its command: only the others'
             * mean counts. The power is at constant current. */
            const double own_v = scalar(p, P_supply_resistance_ohm) * wanted_w / open_v;
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

void plant_electric_find(plant_t *p, const double *t, const double *austenite)
{
    p->supply_v = supply_voltage(p, t, austenite);
    for (int i = 0; i < p->n; i++)
        p->power_w[i] = heating(p, i, p->supply_v, t[i], austenite[i]);
}

void plant_electric_prepare(plant_t *p)
{
    for (int i = 0; i < p->n; i++) {
        p->resistance_scale[i] = p->on[E_spring_mismatch] ? p->value[P_resistance_scale][i] : 1.0;
        p->contact_ohm[i] = p->on[E_contact_resistance] ? p->value[P_contact_ohm][i] : 0.0;
    }
}

void plant_electric_prepare_inputs(plant_t *p)
{
    p->power_varies = false;
    for (int i = 0; i < p->n; i++)
        if (p->mode[i] == PLANT_DRIVE_CURRENT || p->mode[i] == PLANT_DRIVE_DUTY ||
            (p->mode[i] == PLANT_DRIVE_POWER && p->contact_ohm[i] > 0.0))
            p->power_varies = p->on[E_resistance_phase] || p->on[E_resistance_temperature];
    plant_electric_find(p, p->temperature_c, p->austenite);
}

double plant_supply_v(const plant_t *p)
{
    return supply_voltage(p, p->temperature_c, p->austenite);
}

double plant_resistance_ohm(const plant_t *p, int spring)
{
    return resistance_at(p, spring, p->temperature_c[spring], p->austenite[spring]);
}

double plant_terminal_ohm(const plant_t *p, int spring)
{
    return terminal_ohm(p, spring, p->temperature_c[spring], p->austenite[spring]);
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
    return plant_current_a(p, spring) * plant_terminal_ohm(p, spring);
}
