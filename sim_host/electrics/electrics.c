#include "electrics.h"

#include <math.h>

static const double two_pi = 6.283185307179586;

double electrics_pwm_fraction(bool enabled, unsigned compare, unsigned top)
{
    if (!enabled)
        return 0.0;
    if (compare > top)
        compare = top;
    return ((double)compare + 1.0) / ((double)top + 1.0);
}

double electrics_buck_current_a(double duty, double bus_v, double freewheel_drop_v,
                                double spring_ohm, double loop_ohm)
{
    const double mean_v = duty * bus_v - (1.0 - duty) * freewheel_drop_v;
    return mean_v > 0.0 ? mean_v / (spring_ohm + loop_ohm) : 0.0;
}

double electrics_supply_v(double open_circuit_v, double source_ohm, double conductance_s,
                          double constant_power_w)
{
    const double load = 1.0 + source_ohm * conductance_s;
    const double square =
        open_circuit_v * open_circuit_v - 4.0 * load * source_ohm * constant_power_w;
    return (open_circuit_v + (square > 0.0 ? sqrt(square) : 0.0)) / (2.0 * load);
}

/* splitmix64 (Steele, Lea, Flood 2014) */
void electrics_cut_off_pulse(electrics_cut_off_t *cut_off, double time_s)
{
    if (time_s - cut_off->last_s > ELECTRICS_CUT_OFF_GATE_S) {
        cut_off->pulses = 0;
    }
    cut_off->last_s = time_s;
    if (cut_off->pulses < 2 && ++cut_off->pulses == 2) {
        cut_off->closes_s = time_s + ELECTRICS_CUT_OFF_RELAY_S;
    }
}

bool electrics_cut_off_is_closed(const electrics_cut_off_t *cut_off, double time_s)
{
    const double gate_s = cut_off->high ? cut_off->rose_s + ELECTRICS_CUT_OFF_HIGH_S
                                        : cut_off->last_s + ELECTRICS_CUT_OFF_GATE_S;
    return cut_off->pulses == 2 && time_s >= cut_off->closes_s &&
           time_s < gate_s + ELECTRICS_CUT_OFF_RELAY_S;
}

void electrics_noise_seed(electrics_noise_t *noise, uint64_t seed)
{
    noise->state = seed;
}

double electrics_noise_uniform(electrics_noise_t *noise)
{
    uint64_t z = (noise->state += UINT64_C(0x9E3779B97F4A7C15));
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    z ^= z >> 31;
    return ((double)(z >> 11) + 0.5) / 9007199254740992.0;
}

double electrics_noise_normal(electrics_noise_t *noise)
{
    const double radius = sqrt(-2.0 * log(electrics_noise_uniform(noise)));
    return radius * cos(two_pi * electrics_noise_uniform(noise));
}

static double saturate(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

int16_t electrics_ina219_shunt_register(double current_a)
{
    const double lsb = current_a * ELECTRICS_INA219_SHUNT_OHM / ELECTRICS_INA219_SHUNT_LSB_V;
    return (int16_t)lround(saturate(lsb, -ELECTRICS_INA219_SHUNT_MAX, ELECTRICS_INA219_SHUNT_MAX));
}

uint16_t electrics_ina219_bus_register(double bus_v)
{
    return (uint16_t)lround(
        saturate(bus_v / ELECTRICS_INA219_BUS_LSB_V, 0.0, ELECTRICS_INA219_BUS_MAX));
}

bool electrics_ina219_init(electrics_ina219_t *sensor, unsigned samples, double shunt_noise_v,
                           double bus_noise_v, uint64_t seed)
{
    if (samples == 0 || samples > 128 || (samples & (samples - 1u)) != 0)
        return false;
    if (!(shunt_noise_v >= 0.0) || !(bus_noise_v >= 0.0) || isinf(shunt_noise_v) ||
        isinf(bus_noise_v))
        return false;
    *sensor = (electrics_ina219_t){
        .samples = samples, .shunt_noise_v = shunt_noise_v, .bus_noise_v = bus_noise_v};
    electrics_noise_seed(&sensor->noise, seed);
    return true;
}

double electrics_ina219_period_s(const electrics_ina219_t *sensor)
{
    return 2.0 * sensor->samples * ELECTRICS_INA219_CONVERSION_S;
}

void electrics_ina219_advance(electrics_ina219_t *sensor, double dt_s, double current_a,
                              double bus_v)
{
    const double window_s = sensor->samples * ELECTRICS_INA219_CONVERSION_S;
    while (dt_s > 0.0) {
        const bool shunt = sensor->phase_s < window_s;
        const double left_s = (shunt ? window_s : 2.0 * window_s) - sensor->phase_s;
        const double part_s = dt_s < left_s ? dt_s : left_s;
        if (shunt)
            sensor->shunt_sum_as += current_a * part_s;
        else
            sensor->bus_sum_vs += bus_v * part_s;
        dt_s -= part_s;
        if (part_s < left_s) {
            sensor->phase_s += part_s;
        } else if (shunt) {
            sensor->phase_s = window_s;
        } else { /* a pair is complete */
            const double root = sqrt((double)sensor->samples);
            double current = (1.0 + sensor->current_gain_error) * sensor->shunt_sum_as / window_s;
            double voltage = (1.0 + sensor->bus_gain_error) * sensor->bus_sum_vs / window_s;
            if (sensor->shunt_noise_v > 0.0)
                current += electrics_noise_normal(&sensor->noise) * sensor->shunt_noise_v /
                           (root * ELECTRICS_INA219_SHUNT_OHM);
            if (sensor->bus_noise_v > 0.0)
                voltage += electrics_noise_normal(&sensor->noise) * sensor->bus_noise_v / root;
            if (!sensor->frozen) {
                sensor->shunt_register = electrics_ina219_shunt_register(current);
                sensor->bus_register = electrics_ina219_bus_register(voltage);
            }
            sensor->ready = true;
            sensor->phase_s = sensor->shunt_sum_as = sensor->bus_sum_vs = 0.0;
        }
    }
}

bool electrics_ina219_take(electrics_ina219_t *sensor, double *current_a, double *bus_v)
{
    const bool fresh = sensor->ready;
    *current_a = sensor->shunt_register * ELECTRICS_INA219_SHUNT_LSB_V / ELECTRICS_INA219_SHUNT_OHM;
    *bus_v = sensor->bus_register * ELECTRICS_INA219_BUS_LSB_V;
    sensor->ready = false;
    return fresh;
}
