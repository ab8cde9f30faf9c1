/* What it is for: what lies between the chip's pins and a spring: buck stage, supply, INA219,
 * averaged over the PWM.
 * What it owns: the arithmetic from duty to mean current, and from current to the INA219's
 * registers.
 * What it never does: simulate heat, decide a duty, speak I2C. */
#ifndef ELECTRICS_H
#define ELECTRICS_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A spring's end of the circuit can fail in two ways; both are seen by the current sensor. */
typedef enum {
    ELECTRICS_FAULT_NONE = 0,
    ELECTRICS_FAULT_OPEN, /* no current */
    ELECTRICS_FAULT_SHORT /* ELECTRICS_SHORT_OHM between the spring's ends */
} electrics_fault_t;
#define ELECTRICS_SHORT_OHM 0.005

/* Share of the period for which a fast-PWM output (mode 14, ICR = top) is high: (compare + 1) /
 * (top + 1), so compare = 0 is a pulse of one clock, not off. Off (0) only with the output
 * disconnected. ATmega2560 data sheet, 17.9.3. compare above top counts as top. */
double electrics_pwm_fraction(bool enabled, unsigned compare, unsigned top);

/* Mean current (A, >= 0) of one buck stage in continuous conduction:
 *     duty bus - (1 - duty) freewheel_drop = current (spring + loop)
 * The inductor's own voltage has no mean. Zero where the drop takes all (the stage then conducts in
 * short bursts whose mean this model leaves out). spring + loop must be > 0. */
double electrics_buck_current_a(double duty, double bus_v, double freewheel_drop_v,
                                double spring_ohm, double loop_ohm);

/* Supply voltage behind source_ohm, in V, when the stages load it with a conductance (S: current =
 * conductance x voltage) and with a constant power (W). Where no operating point exists the
 * supply's current is limited: half of the loaded open-circuit voltage, where the power drawn is
 * greatest. */
double electrics_supply_v(double open_circuit_v, double source_ohm, double conductance_s,
                          double constant_power_w);

/* The cut-off of the stages' supply (hardware/circuit.py; figures: docs/hardware-figures.md): a
 * charge pump whose gate falls ELECTRICS_CUT_OFF_GATE_S after the last pulse, or
 * ELECTRICS_CUT_OFF_HIGH_S after its pin rose and stayed high, and a relay that takes
 * ELECTRICS_CUT_OFF_RELAY_S both ways. It closes after the second pulse. All zero: open. */
#define ELECTRICS_CUT_OFF_GATE_S  0.061
#define ELECTRICS_CUT_OFF_HIGH_S  0.061
#define ELECTRICS_CUT_OFF_RELAY_S 0.010
typedef struct {
    unsigned pulses; /* in a row, up to 2 */
    double last_s;   /* time of the last one */
    double closes_s; /* meaningless before the second */
    bool high;       /* the pin, since */
    double rose_s;
} electrics_cut_off_t;
void electrics_cut_off_pulse(electrics_cut_off_t *cut_off, double time_s);
/* Whether the stages have their supply; time_s never before the last pulse. */
bool electrics_cut_off_is_closed(const electrics_cut_off_t *cut_off, double time_s);

/* Seeded normal noise; the same seed gives the same numbers on every machine. */
typedef struct {
    uint64_t state;
} electrics_noise_t;
void electrics_noise_seed(electrics_noise_t *noise, uint64_t seed);
double electrics_noise_uniform(electrics_noise_t *noise); /* in (0, 1) */
double electrics_noise_normal(electrics_noise_t *noise);  /* mean 0, standard deviation 1 */

/* INA219 with a 0.1 ohm shunt, gain /8, 16 V range, continuous shunt and bus conversions with
 * averaging. Data sheet SBOS448: shunt LSB 10 uV, +-320 mV; bus LSB 4 mV; 532 us a 12-bit
 * conversion. */
#define ELECTRICS_INA219_SHUNT_OHM    0.1
#define ELECTRICS_INA219_SHUNT_LSB_V  10e-6
#define ELECTRICS_INA219_BUS_LSB_V    4e-3
#define ELECTRICS_INA219_CONVERSION_S 532e-6
#define ELECTRICS_INA219_SHUNT_MAX    32000 /* +-320 mV: 3.2 A */
#define ELECTRICS_INA219_BUS_MAX      4000  /* 16 V */

/* Registers for a current through the shunt and a voltage at the load side; rounded, saturated. */
int16_t electrics_ina219_shunt_register(double current_a);
uint16_t electrics_ina219_bus_register(double bus_v);

typedef struct {
    unsigned samples;     /* averaged conversions: 1, 2, 4, ... 128 */
    double shunt_noise_v; /* standard deviation of ONE conversion, referred to the input */
    double bus_noise_v;
    electrics_noise_t noise;
    int16_t shunt_register; /* last finished pair */
    uint16_t bus_register;
    bool ready; /* a new pair since the last take */
    /* What may be wrong with it, to be set between calls. */
    bool frozen;                               /* a finished pair is like the last one */
    double current_gain_error, bus_gain_error; /* it shows 1 + error times what is there */
    double phase_s; /* time into the present pair: shunt first, then bus */
    double shunt_sum_as, bus_sum_vs;
} electrics_ina219_t;

/* Fails (false, unchanged) if and only if samples is not a power of two in 1..128 or a noise is
 * negative or not finite. */
bool electrics_ina219_init(electrics_ina219_t *sensor, unsigned samples, double shunt_noise_v,
                           double bus_noise_v, uint64_t seed);
/* Time of one pair of averaged conversions, s. */
double electrics_ina219_period_s(const electrics_ina219_t *sensor);
/* Lets dt_s pass at constant mean current and load voltage. A finished pair replaces the registers.
 */
void electrics_ina219_advance(electrics_ina219_t *sensor, double dt_s, double current_a,
                              double bus_v);
/* Reads the last pair in A and V and clears ready. Returns whether it was new. */
bool electrics_ina219_take(electrics_ina219_t *sensor, double *current_a, double *bus_v);

#ifdef __cplusplus
}
#endif
#endif
