#include "campaign.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#define SHIFT_K 8.0
/* Worth SHIFT_K on average: a little less on heating than on cooling. */
#define LOAD_MPA (SHIFT_K * 0.5 * (WORLD_HEATING_MPA_PER_K + WORLD_COOLING_MPA_PER_K))

typedef void alter_t(run_case_t *run, random_t *random, double value);

static int count(const run_case_t *run)
{
    return run->world.rows * run->world.columns;
}

static int any_spring(const run_case_t *run, random_t *random)
{
    return (int)random_uniform(random, 0.0, count(run));
}

static int any_driven(const run_case_t *run, random_t *random)
{
    int spring = any_spring(run, random);
    while (!run->on[spring]) {
        spring = (spring + 1) % count(run);
    }
    return spring;
}

static void add_event(run_case_t *run, world_event_kind_t kind, double time_s, int spring,
                      double value)
{
    run->world.event[run->world.events++] = (world_event_t){kind, time_s, spring, value};
}

static void as_declared(run_case_t *run, random_t *random, double value)
{
    (void)run;
    (void)random;
    (void)value;
}

/* It was in use until a while ago: some springs are still austenite, all are warm. */
static void half_warm(run_case_t *run, random_t *random, double value)
{
    (void)value;
    for (int k = 0; k < count(run); k++) {
        run->world.spring[k].start_c = random_uniform(random, 35.0, 86.0);
        run->world.spring[k].was_austenite = random_uniform(random, 0.0, 1.0) < 0.5;
    }
}

static void temperature_coefficient(run_case_t *run, random_t *random, double value)
{
    (void)value;
    double martensite_per_k = random_uniform(random, -0.0003, 0.0012);
    double austenite_per_k = random_uniform(random, -0.0003, 0.0012); /* its own */
    for (int k = 0; k < count(run); k++) {
        run->world.spring[k].martensite_per_k = martensite_per_k;
        run->world.spring[k].austenite_per_k = austenite_per_k;
    }
}

static void other_alloy(run_case_t *run, random_t *random, double value)
{
    (void)value;
    for (int k = 0; k < count(run); k++) {
        double shift_k = random_uniform(random, -SHIFT_K, SHIFT_K);
        alloy_t *alloy = &run->world.spring[k].alloy;
        alloy->martensite_finish_c += shift_k;
        alloy->martensite_start_c += shift_k;
        alloy->austenite_start_c += shift_k;
        alloy->austenite_finish_c += shift_k;
    }
}

/* Fingers: each spring is pressed or released once, and half of them go back later. */
static void load_steps(run_case_t *run, random_t *random, double earliest_s, double latest_s)
{
    for (int k = 0; k < count(run); k++) {
        double time_s = random_uniform(random, earliest_s, latest_s);
        add_event(run, WORLD_STRESS_MPA, time_s, k, random_uniform(random, -LOAD_MPA, LOAD_MPA));
        if (random_uniform(random, 0.0, 1.0) < 0.5) {
            add_event(run, WORLD_STRESS_MPA, time_s + random_uniform(random, 5.0, 200.0), k, 0.0);
        }
    }
}

static void load_heating(run_case_t *run, random_t *random, double value)
{
    (void)value;
    load_steps(run, random, 2.0, 40.0);
}

static void load_holding(run_case_t *run, random_t *random, double value)
{
    (void)value;
    load_steps(run, random, 150.0, 400.0);
}

static void ratio(run_case_t *run, random_t *random, double value)
{
    (void)random;
    for (int k = 0; k < count(run); k++) {
        world_spring_t *spring = &run->world.spring[k]; /* what the drawing made of 1.25 stays */
        spring->austenite_ohm *= value / 1.25;
        spring->r_phase_ohm *= value / 1.25;
    }
}

static void loss(run_case_t *run, random_t *random, double value)
{
    double batch = random_uniform(random, -1.0, 1.0);
    for (int k = 0; k < count(run); k++) {
        double own = random_uniform(random, -1.0, 1.0);
        world_spring_t *spring = &run->world.spring[k];
        double factor = 1.0 + value * (0.6 * batch + 0.4 * own);
        spring->loss_w_per_k *= factor;
        spring->crimp_w_per_k *= factor;
        spring->radiating_m2 *= factor;
    }
}

static void couplings(run_case_t *run, random_t *random, double value)
{
    run->world.orthogonal_w_per_k *= pow(value, random_uniform(random, -1.0, 1.0));
    run->world.diagonal_w_per_k *= pow(value, random_uniform(random, -1.0, 1.0));
}

static void sensor_errors(run_case_t *run, random_t *random, double value)
{
    for (int k = 0; k < count(run); k++) {
        ina219_t *sensor = &run->world.spring[k].sensor;
        sensor->current_gain = 1.0 + random_uniform(random, -value, value);
        sensor->voltage_gain = 1.0 + random_uniform(random, -value, value);
        sensor->current_offset_a = random_uniform(random, -0.005, 0.005);
        sensor->voltage_offset_v = random_uniform(random, -0.008, 0.008);
    }
}

static void sensor_noise(run_case_t *run, random_t *random, double value)
{
    (void)random;
    for (int k = 0; k < count(run); k++) {
        run->world.spring[k].sensor.current_noise_a *= value;
        run->world.spring[k].sensor.voltage_noise_v *= value;
    }
}

static void slow_noise(run_case_t *run, random_t *random, double value)
{
    (void)random;
    for (int k = 0; k < count(run); k++) {
        run->world.spring[k].sensor.slow_voltage_noise_v = value;
    }
}

/* Half of them while the springs still heat. */
static double fault_s(const run_case_t *run, random_t *random)
{
    bool early = random_uniform(random, 0.0, 1.0) < 0.5;
    return random_uniform(random, 1.0, early ? 90.0 : 0.7 * run->seconds);
}

static void freezing(run_case_t *run, random_t *random, double value)
{
    (void)value;
    double time_s = fault_s(run, random);
    int spring = any_driven(run, random);
    double registers = floor(random_uniform(random, 0.0, 3.0));
    add_event(run, WORLD_SENSOR_FREEZE, time_s, spring, registers);
}

static void lying(run_case_t *run, random_t *random, double value)
{
    double time_s = fault_s(run, random);
    bool current = random_uniform(random, 0.0, 1.0) < 0.5;
    add_event(run, current ? WORLD_SENSOR_CURRENT_GAIN : WORLD_SENSOR_VOLTAGE_GAIN, time_s,
              any_driven(run, random), random_uniform(random, 1.0 - value, 1.0 + value));
}

static void shunt(run_case_t *run, random_t *random, double value)
{
    run->world.spring[any_driven(run, random)].sensor.current_gain = value;
}

static void swapped(run_case_t *run, random_t *random, double value)
{
    (void)value;
    int a = any_driven(run, random);
    int b = (a + 1 + (int)random_uniform(random, 0.0, count(run) - 1)) % count(run);
    add_event(run, WORLD_SENSOR_SWAP, 0.0, a, b);
}

static void contacts(run_case_t *run, random_t *random, double value)
{
    for (int k = 0; k < count(run); k++) {
        double time_s = fault_s(run, random);
        if (random_uniform(random, 0.0, 1.0) < 0.5) {
            add_event(run, WORLD_CONTACT_OHM, time_s, k, random_uniform(random, 0.0, value));
        } else { /* the same within a quarter of an hour */
            add_event(run, WORLD_CONTACT_OHM_PER_S, time_s, k,
                      random_uniform(random, 0.0, value) / 900.0);
        }
    }
}

static void supply(run_case_t *run, random_t *random, double value)
{
    (void)value;
    run->world.supply_v = random_uniform(random, 4.2, 5.5);
}

static void law(run_case_t *run, random_t *random, double value)
{
    (void)random;
    for (int k = 0; k < count(run); k++) {
        run->world.spring[k].alloy.law = (kinetics_law_t)value;
    }
}

static void gusts(run_case_t *run, random_t *random, double value)
{
    run->world.gust_every_s = random_uniform(random, 10.0, 60.0);
    run->world.gust_lasts_s = random_uniform(random, 1.0, 20.0);
    run->world.gust_factor = random_uniform(random, 1.2, value);
}

static void ambient(run_case_t *run, random_t *random, double value)
{
    double wrong_k = random_uniform(random, 0.0, 1.0) < 0.5 ? -value : value;
    run->world.ambient_c = run->world.ambient_setting_c + wrong_k;
    for (int k = 0; k < count(run); k++) {
        run->world.spring[k].start_c = run->world.ambient_c;
    }
}

static void reset(run_case_t *run, random_t *random, double value)
{
    (void)value;
    run->reset_s = random_uniform(random, 120.0, 300.0);
    run->reset_gap_s = random_uniform(random, 0.5, 15.0);
}

static void room(run_case_t *run, random_t *random, double value)
{
    (void)value;
    /* nine held springs give off some 3 W: the air warms by 5 to 15 K, the plate by up to 10 */
    run->world.air_w_per_k = random_uniform(random, 0.2, 0.6);
    run->world.air_j_per_k = random_uniform(random, 0.1, 1.0);
    run->world.plate_w_per_k = random_uniform(random, 0.02, 0.06);
    run->world.plate_j_per_k = random_uniform(random, 5.0, 40.0);
}

/* The crimps are heat sinks: the ends are twice to four times as much below the middle. */
static void cold_ends(run_case_t *run, random_t *random, double value)
{
    double factor = random_uniform(random, 2.0, value);
    for (int k = 0; k < count(run); k++) {
        world_spring_t *spring = &run->world.spring[k];
        double more_w_per_k = (factor - 1.0) * spring->crimp_w_per_k;
        spring->crimp_w_per_k += more_w_per_k;
        spring->loss_w_per_k += 2.0 * more_w_per_k;
    }
}

static run_command_t *add_command(run_case_t *run, double time_s)
{
    run_command_t *command = &run->command[run->commands++];
    command->time_s = time_s;
    memcpy(command->on, run->on, sizeof command->on);
    return command;
}

static void patterns(run_case_t *run, random_t *random, double value)
{
    (void)value;
    double s = 120.0;
    while (s < run->seconds && run->commands < RUN_COMMANDS_MAX) {
        run_command_t *c = add_command(run, s);
        for (int k = 0; k < count(run); k++) {
            c->on[k] = random_uniform(random, 0.0, 1.0) < 0.5;
        }
        s += random_uniform(random, 20.0, 120.0);
    }
}

static void pauses(run_case_t *run, random_t *random, double value)
{
    (void)value;
    double s = random_uniform(random, 100.0, 200.0);
    while (s < run->seconds - 120.0) {
        run_command_t *c = add_command(run, s);
        memset(c->on, 0, sizeof c->on);
        s += random_uniform(random, 3.0, 120.0);
        (void)add_command(run, s);
        s += random_uniform(random, 100.0, 200.0);
    }
}

static void gain_steps(run_case_t *run, random_t *random, double value)
{
    for (int k = 0; k < count(run); k++) {
        add_event(run,
                  random_uniform(random, 0.0, 1.0) < 0.5 ? WORLD_SENSOR_CURRENT_GAIN
                                                         : WORLD_SENSOR_VOLTAGE_GAIN,
                  fault_s(run, random), k,
                  random_uniform(random, 0.0, 1.0) < 0.5 ? 1.0 - value : 1.0 + value);
    }
}

static void wandering(run_case_t *run, random_t *random, double value)
{
    for (int k = 0; k < count(run); k++) {
        double s = 0.0, wanders = 0.0;
        for (int i = 0; i < 28; i++) {
            s += run->seconds / 28.0;
            wanders = wanders * 0.7 + random_uniform(random, -value, value);
            double jumps = random_uniform(random, -0.3 * value, 0.3 * value);
            add_event(run, WORLD_SENSOR_VOLTAGE_GAIN, s, k, 1.0 + wanders + jumps);
        }
    }
}

static void crimp(run_case_t *run, random_t *random, double value)
{
    for (int n = 0; n < 3; n++) {
        int k = any_driven(run, random);
        double s = fault_s(run, random);
        for (int i = 0; i < 36; i++) {
            add_event(run, WORLD_CONTACT_OHM, s, k,
                      i % 2 == 0 ? random_uniform(random, 0.005, value) : 0.002);
            double span = random_uniform(random, 0.0, 1.0);
            s += 0.02 + 60.0 * span * span * span;
        }
    }
}

static void everything(run_case_t *run, random_t *random, double value)
{
    temperature_coefficient(run, random, 0.0);
    sensor_errors(run, random, 0.02);
    loss(run, random, value);
    other_alloy(run, random, 0.0);
    room(run, random, 0.0);
    load_steps(run, random, 20.0, 500.0);
}

static const struct {
    const char *name;
    alter_t *alter;
    double value;
    bool structural;
    const char *says;
} worlds[] = {
    {"declared", as_declared, 0.0, false, "everything within 15 % of its declaration, cold"},
    {"half_warm", half_warm, 0.0, false, "power-on at 35 to 86 degC, half still austenite"},
    {"coefficient", temperature_coefficient, 0.0, true,
     "resistance -0.0003 to +0.0012 per K, each phase its own"},
    {"alloy", other_alloy, 0.0, true, "transformation off by up to 8 K, each spring its own"},
    {"load_heating", load_heating, 0.0, true, "loads worth up to 8 K either way while heating"},
    {"load_holding", load_holding, 0.0, true, "the same while holding"},
    {"ratio_0.85", ratio, 0.85, true, "R_A/R_M 0.85 where 1.25 is declared"},
    {"ratio_1.00", ratio, 1.00, true, "R_A/R_M 1.00"},
    {"ratio_1.05", ratio, 1.05, true, "R_A/R_M 1.05"},
    {"ratio_1.40", ratio, 1.40, true, "R_A/R_M 1.40"},
    {"loss", loss, 0.30, false, "loss off by up to 30 % more"},
    {"couplings", couplings, 2.0, false, "couplings x 0.5 to 2"},
    {"sensor", sensor_errors, 0.03, false, "gain off by 3 %, offsets by 5 mA and 8 mV"},
    {"noisy", sensor_noise, 4.0, false, "sensor noise x 4"},
    {"slow_noise", slow_noise, 0.001, false, "noise of 1 mV that lasts for a second"},
    {"noiseless", sensor_noise, 0.0, false, "no sensor noise at all: only its steps"},
    {"shunt", shunt, 0.5, true, "a driven spring's shunt is half of the declared one"},
    {"freezing", freezing, 0.0, true, "a driven spring's sensor freezes, or one of its registers"},
    {"supply", supply, 0.0, false, "supply 4.2 to 5.5 V"},
    {"linear", law, KINETICS_LINEAR, true, "linear kinetics"},
    {"exponential", law, KINETICS_EXPONENTIAL, true, "exponential kinetics (Tanaka)"},
    {"preisach", law, KINETICS_PREISACH, true, "Preisach: closed minor loops"},
    {"r_phase", law, KINETICS_R_PHASE, true, "an intermediate R-phase, its resistance peak"},
    {"gusts", gusts, 2.0, true, "gusts: loss to the air x 1.2 to 2"},
    {"ambient", ambient, 10.0, true, "ambient 10 K off the setting"},
    {"reset", reset, 0.0, false, "power off and on in mid-hold"},
    {"lying", lying, 0.3, true, "a sensor's current or voltage scaled by up to 30 %"},
    {"swapped", swapped, 0.0, true, "two sensors swapped"},
    {"contacts", contacts, 0.02, true, "contacts step or drift by up to 20 mohm"},
    {"room", room, 0.0, true, "shared air and a plate under the crimps"},
    {"cold_ends", cold_ends, 4.0, true, "crimps carry off 2 to 4 times as much"},
    {"patterns", patterns, 0.0, true, "another pattern every 20 to 120 s"},
    {"pauses", pauses, 0.0, true, "switched off for 3 to 120 s, again and again"},
    {"gain_steps", gain_steps, 0.05, true, "each sensor's current or voltage steps by 5 %"},
    {"loose_crimp", crimp, 0.03, true, "contacts of up to 30 mohm that come and go"},
    {"wandering", wandering, 0.003, true, "voltages read wander by about 0.5 %"},
    {"together", everything, 0.2, true, "coefficient, sensor, loss, alloy, room and loads"},
};

int campaign_worlds(void)
{
    return (int)(sizeof worlds / sizeof worlds[0]);
}

const char *campaign_name(int world)
{
    return worlds[world].name;
}

const char *campaign_says(int world)
{
    return worlds[world].says;
}

bool campaign_is_structural(int world)
{
    return worlds[world].structural;
}

void campaign_draw_pattern(run_case_t *run, random_t *random)
{
    int left = count(run), wanted = 1 + (int)random_uniform(random, 0.0, left);
    for (int k = 0; left > 0; k++, left--) {
        run->on[k] = random_uniform(random, 0.0, left) < wanted;
        wanted -= run->on[k];
    }
}

void campaign_draw(int world, uint64_t seed, int array, double seconds, run_case_t *run)
{
    memset(run, 0, sizeof *run);
    run->seconds = seconds;
    world_parameters_default(&run->world);
    controller_settings_default(&run->settings);
    uint64_t specimen = seed * 1000003u + (uint64_t)array;
    random_t random = random_seeded(specimen, 2);
    campaign_draw_pattern(run, &random);
    world_draw(&run->world, specimen, CAMPAIGN_TOLERANCE);
    worlds[world].alter(run, &random, worlds[world].value);
}
