#include "swarm.h"

#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "campaign.h"

#define MPA_PER_K (0.5 * (WORLD_HEATING_MPA_PER_K + WORLD_COOLING_MPA_PER_K))
#define RAMP      16   /* events that make up a change that takes its time */
#define TELLS     0.08 /* change of resistance between the phases that tells them apart */
/* A step of the surroundings from which a spring must come back; what is drawn goes beyond. */
#define LEAST_LOSS     (-0.35)
#define MOST_LOSS      0.40
#define MOST_AMBIENT_K 12.0
#define SUPPLY_A       14.5 /* of the board's 15, which regulation needs some of */
#define HOLD_K         5.0  /* a hold, above martensite start */

typedef struct {
    swarm_case_t *swarm;
    run_case_t *run;
    random_t random;
} draw_t;

static double uniform(draw_t *draw, double low, double high)
{
    return random_uniform(&draw->random, low, high);
}

static bool chance(draw_t *draw, double probability)
{
    return uniform(draw, 0.0, 1.0) < probability;
}

static int count(const draw_t *draw)
{
    return draw->run->world.rows * draw->run->world.columns;
}

static int any_driven(draw_t *draw)
{
    int spring = (int)uniform(draw, 0.0, count(draw));
    while (!draw->run->on[spring]) {
        spring = (spring + 1) % count(draw);
    }
    return spring;
}

static void say(draw_t *draw, const char *format, ...)
{
    char *says = draw->swarm->says;
    size_t length = strlen(says);
    va_list values;
    va_start(values, format);
    (void)vsnprintf(says + length, SWARM_SAYS_MAX - length, format, values);
    va_end(values);
    length = strlen(says);
    (void)snprintf(says + length, SWARM_SAYS_MAX - length, "; ");
}

static void happens(draw_t *draw, world_event_kind_t kind, double time_s, int spring, double value)
{
    world_parameters_t *world = &draw->run->world;
    if (world->events < WORLD_EVENTS_MAX) {
        world->event[world->events++] = (world_event_t){kind, time_s, spring, value};
    }
    draw->swarm->steps = true;
}

/* At once where lasts_s is 0. */
static void changes(draw_t *draw, world_event_kind_t kind, double time_s, double lasts_s,
                    int spring, double from, double to)
{
    const int parts = lasts_s > 0.0 ? RAMP : 1;
    for (int i = 1; i <= parts; i++) {
        happens(draw, kind, time_s + lasts_s * (i - 1) / RAMP, spring,
                from + (to - from) * i / parts);
    }
}

/* What the array is, as built. */

static void size(draw_t *draw)
{
    static const int sizes[][2] = {{1, 1}, {1, 2}, {2, 2}, {2, 3}, {1, 4}, {2, 4}, {3, 2}, {1, 9}};
    const int *chosen = sizes[(int)uniform(draw, 0.0, sizeof sizes / sizeof sizes[0])];
    draw->run->world.rows = chosen[0];
    draw->run->world.columns = chosen[1];
    say(draw, "%d x %d", chosen[0], chosen[1]);
}

/* An alloy that the user has measured and typed. */
static void told(draw_t *draw)
{
    const double up_k = uniform(draw, 5.0, 25.0), down_k = uniform(draw, 5.0, 25.0);
    const double finish_c = uniform(draw, 92.0, 100.0), gap_k = uniform(draw, 3.0, 14.0);
    controller_settings_t *settings = &draw->run->settings;
    alloy_t alloy = {KINETICS_COSINE, 0.0, 0.0, 0.0, finish_c};
    alloy.austenite_start_c = finish_c - up_k;
    alloy.martensite_start_c = alloy.austenite_start_c - gap_k;
    alloy.martensite_finish_c = alloy.martensite_start_c - down_k;
    settings->model.martensite_finish_cc = (int16_t)lround(100.0 * alloy.martensite_finish_c);
    settings->model.martensite_start_cc = (int16_t)lround(100.0 * alloy.martensite_start_c);
    settings->model.austenite_start_cc = (int16_t)lround(100.0 * alloy.austenite_start_c);
    settings->model.austenite_finish_cc = (int16_t)lround(100.0 * alloy.austenite_finish_c);
    for (int k = 0; k < WORLD_SPRINGS_MAX; k++) {
        draw->run->world.spring[k].alloy = alloy;
    }
    draw->swarm->told = true;
    say(draw, "told: M %.1f %.1f, A %.1f %.1f degC", alloy.martensite_finish_c,
        alloy.martensite_start_c, alloy.austenite_start_c, alloy.austenite_finish_c);
}

static void kinetics(draw_t *draw)
{
    static const char *const names[] = {"cosine",   "linear",  "exponential",
                                        "Preisach", "R-phase", "play"};
    kinetics_law_t law = (kinetics_law_t)uniform(draw, KINETICS_LINEAR, KINETICS_PLAY);
    if (draw->swarm->second) {
        law = KINETICS_PLAY;
        draw->run->world.convection = WORLD_CONVECTION_CHURCHILL;
    }
    for (int k = 0; k < count(draw); k++) {
        draw->run->world.spring[k].alloy.law = law;
    }
    say(draw, "%s", names[law]);
}

static void widths(draw_t *draw)
{
    if (draw->swarm->told) {
        return;
    }
    const double up = uniform(draw, 0.5, 1.5), down = uniform(draw, 0.5, 1.5);
    for (int k = 0; k < count(draw); k++) {
        alloy_t *alloy = &draw->run->world.spring[k].alloy;
        alloy->austenite_finish_c =
            alloy->austenite_start_c + up * (alloy->austenite_finish_c - alloy->austenite_start_c);
        alloy->martensite_finish_c =
            alloy->martensite_start_c -
            down * (alloy->martensite_start_c - alloy->martensite_finish_c);
    }
    say(draw, "widths x %.2f up, x %.2f down", up, down);
}

/* Each branch away from the other, or towards it: no further than they are apart. */
static void hysteresis(draw_t *draw)
{
    double wider_k = uniform(draw, -4.0, 5.0);
    for (int k = 0; k < count(draw); k++) {
        alloy_t *alloy = &draw->run->world.spring[k].alloy;
        const double gap_k = alloy->austenite_start_c - alloy->martensite_start_c;
        const double own_k = fmax(wider_k, 0.5 * (1.0 - gap_k));
        alloy->martensite_finish_c -= own_k;
        alloy->martensite_start_c -= own_k;
        alloy->austenite_start_c += own_k;
        alloy->austenite_finish_c += own_k;
    }
    say(draw, "hysteresis %+.1f K each way", wider_k);
}

static void alloy(draw_t *draw)
{
    const double all_k = uniform(draw, -6.0, 6.0), each_k = uniform(draw, 0.0, 3.0);
    for (int k = 0; k < count(draw); k++) {
        alloy_t *alloy = &draw->run->world.spring[k].alloy;
        const double shift_k = all_k + uniform(draw, -each_k, each_k);
        alloy->martensite_finish_c += shift_k;
        alloy->martensite_start_c += shift_k;
        alloy->austenite_start_c += shift_k;
        alloy->austenite_finish_c += shift_k;
    }
    say(draw, "alloy %+.1f K, each +-%.1f", all_k, each_k);
}

static void heats(draw_t *draw)
{
    const double latent = uniform(draw, 0.6, 1.4), capacity = uniform(draw, 0.8, 1.25);
    for (int k = 0; k < count(draw); k++) {
        draw->run->world.spring[k].latent_heat_j *= latent;
        draw->run->world.spring[k].heat_capacity_j_per_k *= capacity;
    }
    say(draw, "latent heat x %.2f, capacity x %.2f", latent, capacity);
}

static void coefficients(draw_t *draw)
{
    const double martensite_per_k = uniform(draw, -0.0003, 0.0012);
    const double austenite_per_k = uniform(draw, -0.0003, 0.0012);
    for (int k = 0; k < count(draw); k++) {
        draw->run->world.spring[k].martensite_per_k = martensite_per_k;
        draw->run->world.spring[k].austenite_per_k = austenite_per_k;
    }
    say(draw, "coefficients %+.5f, %+.5f per K", martensite_per_k, austenite_per_k);
}

static void resistances(draw_t *draw)
{
    const double batch = uniform(draw, 0.85, 1.15);
    for (int k = 0; k < count(draw); k++) {
        world_spring_t *spring = &draw->run->world.spring[k];
        const double factor = batch * uniform(draw, 0.95, 1.05);
        spring->martensite_ohm *= factor;
        spring->austenite_ohm *= factor;
        spring->r_phase_ohm *= factor;
    }
    say(draw, "resistances x %.2f", batch);
}

/* Of austenite to martensite, where 1.25 is declared. */
static void ratio(draw_t *draw)
{
    const double value = uniform(draw, 0.85, 1.40);
    for (int k = 0; k < count(draw); k++) {
        draw->run->world.spring[k].austenite_ohm *= value / 1.25;
        draw->run->world.spring[k].r_phase_ohm *= value / 1.25;
    }
    say(draw, "R_A/R_M %.2f", value);
}

static void scale_loss(world_spring_t *spring, double factor)
{
    spring->loss_w_per_k *= factor;
    spring->crimp_w_per_k *= factor;
    spring->radiating_m2 *= factor;
}

static void losses(draw_t *draw)
{
    const double batch = uniform(draw, 0.8, 1.2);
    for (int k = 0; k < count(draw); k++) {
        scale_loss(&draw->run->world.spring[k], batch * uniform(draw, 0.9, 1.1));
    }
    say(draw, "losses x %.2f from the beginning", batch);
}

static void cold_ends(draw_t *draw)
{
    const double factor = uniform(draw, 1.5, 4.0);
    for (int k = 0; k < count(draw); k++) {
        world_spring_t *spring = &draw->run->world.spring[k];
        const double more_w_per_k = (factor - 1.0) * spring->crimp_w_per_k;
        spring->crimp_w_per_k += more_w_per_k;
        spring->loss_w_per_k += 2.0 * more_w_per_k;
    }
    say(draw, "crimps x %.1f", factor);
}

static void couplings(draw_t *draw)
{
    const double orthogonal = pow(2.0, uniform(draw, -1.0, 1.0));
    const double diagonal = pow(2.0, uniform(draw, -1.0, 1.0));
    draw->run->world.orthogonal_w_per_k *= orthogonal;
    draw->run->world.diagonal_w_per_k *= diagonal;
    say(draw, "couplings x %.2f, x %.2f", orthogonal, diagonal);
}

static void air_and_plate(draw_t *draw)
{
    world_parameters_t *world = &draw->run->world;
    world->air_w_per_k = uniform(draw, 0.2, 0.8);
    world->air_j_per_k = uniform(draw, 0.1, 1.0);
    world->plate_w_per_k = uniform(draw, 0.02, 0.1);
    world->plate_j_per_k = uniform(draw, 5.0, 40.0);
    say(draw, "air %.2f W/K, plate %.3f W/K", world->air_w_per_k, world->plate_w_per_k);
}

static void room(draw_t *draw)
{
    const double wrong_k = uniform(draw, -10.0, 10.0);
    draw->run->world.ambient_c += wrong_k;
    for (int k = 0; k < count(draw); k++) {
        draw->run->world.spring[k].start_c += wrong_k;
    }
    say(draw, "room %+.1f K off what is told", wrong_k);
}

static void fan(draw_t *draw)
{
    draw->run->fan_percent = (uint8_t)uniform(draw, 15.0, 60.0);
    draw->run->world.fan_loss_factor *= uniform(draw, 0.85, 1.15);
    say(draw, "fan %u %%", draw->run->fan_percent);
}

static void half_warm(draw_t *draw)
{
    for (int k = 0; k < count(draw); k++) {
        world_spring_t *spring = &draw->run->world.spring[k];
        spring->start_c = uniform(draw, spring->start_c, spring->alloy.austenite_start_c - 1.0);
        spring->was_austenite = chance(draw, 0.5);
    }
    say(draw, "half warm at power-on");
}

/* Sensors and supply. */

static void gains(draw_t *draw)
{
    const double share = uniform(draw, 0.005, 0.03);
    for (int k = 0; k < count(draw); k++) {
        ina219_t *sensor = &draw->run->world.spring[k].sensor;
        sensor->current_gain = 1.0 + uniform(draw, -share, share);
        sensor->voltage_gain = 1.0 + uniform(draw, -share, share);
        sensor->current_offset_a = uniform(draw, -0.005, 0.005);
        sensor->voltage_offset_v = uniform(draw, -0.008, 0.008);
    }
    say(draw, "gains +-%.1f %%, offsets", 100.0 * share);
}

static void noise(draw_t *draw)
{
    const double factor = chance(draw, 0.1) ? 0.0 : pow(4.0, uniform(draw, -1.0, 1.0));
    const double slow_v = chance(draw, 0.4) ? uniform(draw, 0.0, 0.001) : 0.0;
    for (int k = 0; k < count(draw); k++) {
        ina219_t *sensor = &draw->run->world.spring[k].sensor;
        sensor->current_noise_a *= factor;
        sensor->voltage_noise_v *= factor;
        sensor->slow_voltage_noise_v = slow_v;
    }
    say(draw, "noise x %.2f, slow %.2f mV", factor, 1000.0 * slow_v);
}

static void supply(draw_t *draw)
{
    draw->run->world.supply_v = uniform(draw, 4.2, 5.5);
    say(draw, "supply %.2f V", draw->run->world.supply_v);
}

static void diodes(draw_t *draw)
{
    run_case_t *run = draw->run;
    run->world.freewheel_v = uniform(draw, 0.30, 0.45);
    const double declared_v = run->world.freewheel_v + uniform(draw, -0.05, 0.05);
    draw->swarm->diode = chance(draw, 0.5) ? SWARM_DECLARED : SWARM_UNDECLARED;
    if (draw->swarm->diode == SWARM_DECLARED) {
        run->settings.current.freewheel_mv = (uint16_t)lround(1000.0 * declared_v);
    }
    say(draw, "diodes of %.2f V, %.2f declared", run->world.freewheel_v,
        1e-3 * run->settings.current.freewheel_mv);
}

/* What happens. */

static double moment_s(draw_t *draw)
{
    return uniform(draw, 60.0, 0.75 * draw->run->seconds);
}

static void supply_step(draw_t *draw)
{
    const double to_v = uniform(draw, 4.4, 5.4), at_s = moment_s(draw);
    happens(draw, WORLD_SUPPLY_V, at_s, 0, to_v);
    say(draw, "supply to %.2f V at %.0f s", to_v, at_s);
}

static void gusts(draw_t *draw)
{
    world_parameters_t *world = &draw->run->world;
    world->gust_every_s = uniform(draw, 10.0, 120.0);
    world->gust_lasts_s = uniform(draw, 1.0, 20.0);
    world->gust_factor = uniform(draw, 1.1, 1.8);
    draw->swarm->steps = true;
    say(draw, "gusts x %.2f, %.0f s of %.0f s", world->gust_factor, world->gust_lasts_s,
        world->gust_every_s);
}

static void contacts(draw_t *draw)
{
    const double most_ohm = uniform(draw, 0.004, 0.02);
    for (int k = 0; k < count(draw); k++) {
        if (chance(draw, 0.5)) {
            continue;
        }
        if (chance(draw, 0.5)) {
            happens(draw, WORLD_CONTACT_OHM, moment_s(draw), k, uniform(draw, 0.0, most_ohm));
        } else {
            happens(draw, WORLD_CONTACT_OHM_PER_S, moment_s(draw), k,
                    uniform(draw, 0.0, most_ohm) / draw->run->seconds);
        }
    }
    say(draw, "contacts to %.1f mohm", 1000.0 * most_ohm);
}

static void loose_crimp(draw_t *draw)
{
    const int k = any_driven(draw);
    double s = moment_s(draw);
    say(draw, "crimp of %d loose from %.0f s", k + 1, s);
    for (int i = 0; i < 30; i++) {
        happens(draw, WORLD_CONTACT_OHM, s, k, i % 2 == 0 ? uniform(draw, 0.005, 0.03) : 0.002);
        const double span = uniform(draw, 0.0, 1.0);
        s += 0.02 + 60.0 * span * span * span;
    }
}

static void gain_steps(draw_t *draw)
{
    const double share = uniform(draw, 0.005, 0.05);
    for (int k = 0; k < count(draw); k++) {
        if (chance(draw, 0.3)) {
            happens(draw, chance(draw, 0.5) ? WORLD_SENSOR_CURRENT_GAIN : WORLD_SENSOR_VOLTAGE_GAIN,
                    moment_s(draw), k, 1.0 + (chance(draw, 0.5) ? share : -share));
        }
    }
    say(draw, "gains step by %.1f %%", 100.0 * share);
}

static void wandering(draw_t *draw)
{
    const double share = uniform(draw, 0.0005, 0.003);
    for (int k = 0; k < count(draw); k++) {
        const double gain = draw->run->world.spring[k].sensor.voltage_gain;
        double s = 0.0, wanders = 0.0;
        for (int i = 0; i < 24; i++) {
            s += draw->run->seconds / 24.0;
            wanders = wanders * 0.7 + uniform(draw, -share, share);
            happens(draw, WORLD_SENSOR_VOLTAGE_GAIN, s, k, gain * (1.0 + wanders));
        }
    }
    say(draw, "voltages wander by %.2f %%", 100.0 * share);
}

static void press(draw_t *draw, int k, double at_s, double shift_k, double back_s)
{
    happens(draw, WORLD_STRESS_MPA, at_s, k, shift_k * MPA_PER_K);
    if (back_s > 0.0) {
        happens(draw, WORLD_STRESS_MPA, back_s, k, 0.0);
    }
}

/* A finger on one spring, something on several, a hand over all. */
static void load(draw_t *draw)
{
    const double kind = uniform(draw, 0.0, 1.0);
    const double at_s = chance(draw, 0.2) ? uniform(draw, 2.0, 40.0) : moment_s(draw);
    const double back_s = chance(draw, 0.35) ? at_s + uniform(draw, 5.0, 200.0) : 0.0;
    const double shift_k = uniform(draw, -8.0, 8.0);
    if (kind < 0.4) {
        const int k = any_driven(draw);
        press(draw, k, at_s, shift_k, back_s);
        say(draw, "load on %d: %+.1f K at %.0f s", k + 1, shift_k, at_s);
    } else if (kind < 0.65) {
        for (int k = 0; k < count(draw); k++) {
            if (chance(draw, 0.5)) {
                press(draw, k, fmax(at_s + uniform(draw, -60.0, 60.0), 1.0),
                      uniform(draw, -8.0, 8.0), back_s > 0.0 ? back_s + 60.0 : 0.0);
            }
        }
        say(draw, "loads, each its own, +-8 K, about %.0f s", at_s);
    } else {
        for (int k = 0; k < count(draw); k++) {
            press(draw, k, at_s, shift_k * uniform(draw, 0.8, 1.0), back_s);
        }
        say(draw, "a hand over all: %+.1f K at %.0f s", shift_k, at_s);
    }
    if (back_s > 0.0) {
        say(draw, "lifted at %.0f s", back_s);
    } else {
        draw->swarm->group = SWARM_LOAD;
    }
}

/* The factor on what moving air carries off, for a change of the whole loss 60 K above the air:
 * crimps and radiation stay as they are, and what rises of itself does not add up with a draught
 * (WORLD_CONVECTION_CHURCHILL). */
static double moved(const world_parameters_t *world, int k, double change)
{
    const world_spring_t *spring = &world->spring[k];
    const double crimps_w_per_k = 2.0 * spring->crimp_w_per_k;
    const double free = 0.95; /* of what it is WORLD_LOSS_RISE_K above */
    const double convection_w_per_k =
        free * (spring->loss_w_per_k - crimps_w_per_k - 8.7 * spring->radiating_m2);
    const double all_w_per_k = convection_w_per_k + crimps_w_per_k + 7.7 * spring->radiating_m2;
    const double factor = fmax(1.0 + change * all_w_per_k / convection_w_per_k, 0.3);
    const bool blends = world->convection == WORLD_CONVECTION_CHURCHILL && factor > 1.0;
    return blends ? cbrt(1.0 + pow(free, 3.0) * (pow(factor, 3.0) - 1.0)) : factor;
}

/* A draught, a door, a fan that nobody told of, the heating of the room: it stays. 'change' is that
 * of the whole loss, of which a draught moves the convection. */
static void surroundings(draw_t *draw)
{
    swarm_case_t *swarm = draw->swarm;
    const double kind = uniform(draw, 0.0, 1.0);
    const double at_s = uniform(draw, 150.0, 600.0);
    const double lasts_s = chance(draw, 0.5) ? 0.0 : uniform(draw, 5.0, 60.0);
    const double spread = chance(draw, 0.4) ? 0.3 : 0.0;
    const double change = uniform(draw, -0.35, 0.45), ambient_k = uniform(draw, -12.0, 12.0);
    bool judged = true;
    if (kind < 0.75) {
        swarm->loss_change = change;
        for (int k = 0; k < count(draw); k++) {
            const double own = change * (1.0 - spread * uniform(draw, 0.0, 1.0));
            changes(draw, WORLD_LOSS_FACTOR, at_s, lasts_s, k, 1.0,
                    moved(&draw->run->world, k, own));
        }
        judged = change >= LEAST_LOSS && change <= MOST_LOSS;
        say(draw, "LOSSES %+.0f %%%s at %.0f s", 100.0 * change,
            spread > 0.0 ? " or less of it" : "", at_s);
    }
    if (kind >= 0.6) {
        const double from_c = draw->run->world.ambient_c;
        swarm->ambient_change_k = ambient_k;
        changes(draw, WORLD_AMBIENT_C, at_s, lasts_s, 0, from_c, from_c + ambient_k);
        judged = judged && fabs(ambient_k) <= MOST_AMBIENT_K;
        say(draw, "ROOM %+.1f K at %.0f s", ambient_k, at_s);
    }
    say(draw, "within %.0f s", lasts_s);
    swarm->group = SWARM_SURROUNDINGS;
    if (judged) {
        draw->run->step_s = at_s;
        draw->run->stepped_s = at_s + lasts_s;
    }
}

static void broken_sensor(draw_t *draw)
{
    const double kind = uniform(draw, 0.0, 1.0), at_s = uniform(draw, 1.0, 500.0);
    const int k = any_driven(draw);
    draw->swarm->broken[k] = true;
    if (kind < 0.4) {
        happens(draw, WORLD_SENSOR_FREEZE, at_s, k, floor(uniform(draw, 0.0, 3.0)));
        say(draw, "sensor %d freezes at %.0f s", k + 1, at_s);
    } else if (kind < 0.8) {
        const double gain = 1.0 + (chance(draw, 0.5) ? 1.0 : -1.0) * uniform(draw, 0.08, 0.30);
        happens(draw, chance(draw, 0.5) ? WORLD_SENSOR_CURRENT_GAIN : WORLD_SENSOR_VOLTAGE_GAIN,
                at_s, k, gain);
        say(draw, "sensor %d lies from %.0f s: x %.2f", k + 1, at_s, gain);
    } else if (kind < 0.9 || count(draw) == 1) {
        draw->run->world.spring[k].sensor.current_gain = 0.5;
        say(draw, "sensor %d has another shunt", k + 1);
    } else {
        const int other = (k + 1 + (int)uniform(draw, 0.0, count(draw) - 1)) % count(draw);
        happens(draw, WORLD_SENSOR_SWAP, 0.0, k, other);
        draw->swarm->broken[other] = true;
        say(draw, "sensors %d and %d swapped", k + 1, other + 1);
    }
}

static void habits(draw_t *draw)
{
    double s = uniform(draw, 120.0, 400.0);
    for (int i = 0; i < 3 && s < draw->run->seconds; i++) {
        run_command_t *command = &draw->run->command[draw->run->commands++];
        command->time_s = s;
        for (int k = 0; k < count(draw); k++) {
            command->on[k] = chance(draw, 0.5);
        }
        s += uniform(draw, 30.0, 400.0);
    }
    draw->swarm->steps = true;
    say(draw, "%d other patterns from %.0f s", draw->run->commands, draw->run->command[0].time_s);
}

static void reset(draw_t *draw)
{
    draw->run->reset_s = uniform(draw, 120.0, 500.0);
    draw->run->reset_gap_s = uniform(draw, 0.5, 15.0);
    draw->swarm->steps = true;
    say(draw, "reset at %.0f s for %.1f s", draw->run->reset_s, draw->run->reset_gap_s);
}

/* Of a spring whose level changes: fully, not at all, or between. */
static void ask_for_a_level(draw_t *draw, run_command_t *command, int k)
{
    const double kind = uniform(draw, 0.0, 1.0);
    const double level_permille = uniform(draw, 150.0, 900.0);
    command->on[k] = kind < 0.8;
    command->level_permille[k] = kind < 0.45 ? (uint16_t)level_permille : 0;
}

/* Of all springs one level, or of some each its own. Before the last pattern, and the power that
 * goes off, nothing is asked for: what the board starts with is not theirs. */
static void levels(draw_t *draw)
{
    run_case_t *run = draw->run;
    const run_command_t *last = run->commands > 0 ? &run->command[run->commands - 1] : NULL;
    const double from_s = fmax(last != NULL ? last->time_s : 0.0, run->reset_s + run->reset_gap_s);
    double s = from_s + uniform(draw, 60.0, 300.0);
    const int times = (int)uniform(draw, 2.0, 8.0);
    for (int i = 0; i < times && s < run->seconds; i++) {
        run_command_t *command = &run->command[run->commands++];
        memcpy(command->on, last != NULL ? last->on : run->on, sizeof command->on);
        if (last != NULL) {
            memcpy(command->level_permille, last->level_permille, sizeof command->level_permille);
        }
        command->time_s = s;
        const int first = (int)uniform(draw, 0.0, count(draw));
        const bool all = chance(draw, 0.4);
        ask_for_a_level(draw, command, first);
        for (int k = 0; k < count(draw); k++) {
            if (all) {
                command->on[k] = command->on[first];
                command->level_permille[k] = command->level_permille[first];
            } else if (k != first && chance(draw, 0.3)) {
                ask_for_a_level(draw, command, k);
            }
        }
        say(draw, "%.0f s: %s %d %.0f %%", s, all ? "all, as" : "some,", first + 1,
            !command->on[first]                   ? 0.0
            : command->level_permille[first] != 0 ? 0.1 * command->level_permille[first]
                                                  : 100.0);
        draw->swarm->levels = draw->swarm->steps = true;
        last = command;
        s += uniform(draw, 10.0, 250.0);
    }
}

/* Of a user who asks for nothing else, of springs that were never fully on since power-on. */
static void first_level(draw_t *draw)
{
    run_case_t *run = draw->run;
    if (run->commands != 0 || run->reset_gap_s > 0.0) {
        return;
    }
    run_command_t *const level = &run->command[run->commands++];
    run_command_t *const fully = &run->command[run->commands++];
    memcpy(level->on, run->on, sizeof level->on);
    memcpy(fully->on, run->on, sizeof fully->on);
    fully->time_s = uniform(draw, 60.0, 400.0);
    const double level_permille = uniform(draw, 150.0, 900.0);
    for (int k = 0; k < count(draw); k++) {
        level->level_permille[k] = run->on[k] ? (uint16_t)level_permille : 0;
    }
    draw->swarm->levels = draw->swarm->steps = true;
    say(draw, "at first %.0f %%, fully at %.0f s", 0.1 * level_permille, fully->time_s);
}

typedef struct {
    double probability;
    void (*draw)(draw_t *draw);
    const char *says;
} disturbance_t;

/* Before a specimen is drawn of what is declared. */
static const disturbance_t declared[] = {
    {0.15, size, "another size: 1 x 1 to 2 x 4, 1 x 9"},
    {0.25, told, "told to the board: an alloy with widths of 5 to 25 K each, 3 to 14 K between"},
};
/* In this order; the place in the list is a sequence of random numbers: add at the end. */
static const disturbance_t drawn[] = {
    {0.60, kinetics,
     "another law: linear, exponential, Preisach, R-phase (second truth: all, play)"},
    {0.40, widths, "where no alloy is told: widths 10 +- 5 K, each branch its own"},
    {0.30, hysteresis, "hysteresis 4 K narrower to 5 K wider each way"},
    {0.30, alloy, "transformation off by up to 6 K, each spring up to 3 K more"},
    {0.30, heats, "latent heat x 0.6 to 1.4, heat capacity x 0.8 to 1.25"},
    {0.45, coefficients, "resistance -0.0003 to +0.0012 per K, each phase its own"},
    {0.30, resistances, "resistances x 0.85 to 1.15, each 5 % more"},
    {0.12, ratio, "R_A/R_M 0.85 to 1.4"},
    {0.40, losses, "losses x 0.8 to 1.2, each 10 % more, from the beginning"},
    {0.15, cold_ends, "crimps carry off 1.5 to 4 times as much"},
    {0.40, couplings, "couplings x 0.5 to 2"},
    {0.35, air_and_plate, "shared air and a plate under the crimps"},
    {0.30, room, "room up to 10 K off what is told"},
    {0.10, fan, "fan at 15 to 60 %, told; its effect off by 15 %"},
    {0.08, half_warm, "warm at power-on, half still austenite"},
    {0.30, gains, "gains off by up to 3 %, offsets of 5 mA and 8 mV"},
    {0.35, noise, "noise x 0.25 to 4, or none; slow noise of up to 1 mV"},
    {0.30, supply, "supply 4.2 to 5.5 V"},
    {0.08, supply_step, "supply steps to 4.4 to 5.4 V"},
    {0.15, gusts, "gusts: losses x 1.1 to 1.8 for seconds, every 10 to 120 s"},
    {0.12, contacts, "contacts step or drift by up to 20 mohm, half of them"},
    {0.03, loose_crimp, "a contact of up to 30 mohm comes and goes"},
    {0.06, gain_steps, "gains step by up to 5 %, a third of them"},
    {0.06, wandering, "voltages read wander by up to 0.5 %"},
    {0.30, load, "loads worth up to 8 K on one spring, several, or all; a third is lifted again"},
    {0.35, surroundings, "losses -35 to +45 %, the room +-12 K, or both: for good"},
    {0.03, broken_sensor, "a sensor freezes, lies by 8 to 30 %, is of another shunt, or swapped"},
    {0.06, habits, "up to three other patterns"},
    {0.04, reset, "power off and on"},
    {0.40, diodes, "diodes that drop 0.30 to 0.45 V, declared within 0.05 V or, half of them, not"},
    {0.20, levels, "a user of levels: 15 to 90 %, fully, off, of some or all"},
    {0.10, first_level, "or only a level of all at first, then fully"},
};
#define DECLARED ((int)(sizeof declared / sizeof declared[0]))
#define DRAWN    ((int)(sizeof drawn / sizeof drawn[0]))

enum { STREAM_PATTERN = 20, STREAM_SECOND, STREAM_ROOM, STREAM_DECLARED = 40, STREAM_DRAWN = 60 };

static void let_each_be_drawn(draw_t *draw, const disturbance_t *list, int length,
                              uint64_t specimen, int stream)
{
    for (int i = 0; i < length; i++) {
        draw->random = random_seeded(specimen, (uint64_t)(stream + i));
        /* a second truth is one in all its laws */
        const bool always = draw->swarm->second && list[i].draw == kinetics;
        if (chance(draw, list[i].probability) || always) {
            list[i].draw(draw);
            draw->swarm->drawn |= UINT64_C(1) << (list == declared ? i : DECLARED + i);
        }
    }
}

/* What a spring needs in the worst that lasts: with the fan, in the draught, in the colder room. */
static double hold_a(const swarm_case_t *swarm, int k)
{
    const world_parameters_t *world = &swarm->run.world;
    const world_spring_t *spring = &world->spring[k];
    const double fan = 1.0 + (world->fan_loss_factor - 1.0) * swarm->run.fan_percent / 100.0;
    const double often = world->gust_every_s > 0.0
                             ? world->gust_lasts_s / (world->gust_lasts_s + world->gust_every_s)
                             : 0.0;
    const double gusts = 1.0 + often * (world->gust_factor - 1.0);
    const double loss_w_per_k =
        spring->loss_w_per_k * fan * gusts * (1.0 + fmax(swarm->loss_change, 0.0));
    const double rise_k = spring->alloy.martensite_start_c + HOLD_K - world->ambient_c -
                          fmin(swarm->ambient_change_k, 0.0);
    return sqrt(loss_w_per_k * rise_k / spring->austenite_ohm);
}

/* No more springs are asked for than the supply can hold: what physics forbids is no figure of the
 * controller. */
static void ask_for_what_can_be_held(swarm_case_t *swarm, bool on[])
{
    double sum_a = 0.0;
    for (int k = 0; k < swarm->run.world.rows * swarm->run.world.columns; k++) {
        const double a = on[k] ? hold_a(swarm, k) : 0.0;
        on[k] = on[k] && sum_a + a <= SUPPLY_A;
        sum_a += on[k] ? a : 0.0;
    }
}

static bool resistance_tells(const world_parameters_t *world)
{
    for (int k = 0; k < world->rows * world->columns; k++) {
        const world_spring_t *spring = &world->spring[k];
        if (fabs(spring->austenite_ohm / spring->martensite_ohm - 1.0) < TELLS) {
            return false;
        }
    }
    return true;
}

void swarm_draw(uint64_t seed, int index, double seconds, swarm_case_t *swarm)
{
    memset(swarm, 0, sizeof *swarm);
    run_case_t *run = &swarm->run;
    draw_t draw = {swarm, run, {0}};
    const uint64_t specimen = seed * 1000003u + (uint64_t)index;
    run->seconds = seconds;
    world_parameters_default(&run->world);
    controller_settings_default(&run->settings);
    draw.random = random_seeded(specimen, STREAM_SECOND);
    swarm->second = chance(&draw, 1.0 / 3.0);
    draw.random = random_seeded(specimen, STREAM_ROOM);
    run->world.ambient_c = run->world.ambient_setting_c = uniform(&draw, 12.0, 30.0);
    let_each_be_drawn(&draw, declared, DECLARED, specimen, STREAM_DECLARED);
    draw.random = random_seeded(specimen, STREAM_PATTERN);
    campaign_draw_pattern(run, &draw.random);
    world_draw(&run->world, specimen, CAMPAIGN_TOLERANCE);
    say(&draw, "room %.1f degC", run->world.ambient_c);
    let_each_be_drawn(&draw, drawn, DRAWN, specimen, STREAM_DRAWN);
    ask_for_what_can_be_held(swarm, run->on);
    for (int i = 0; i < run->commands; i++) {
        ask_for_what_can_be_held(swarm, run->command[i].on);
    }
    swarm->tells = resistance_tells(&run->world);
}

const char *swarm_says(int disturbance, double *probability)
{
    if (disturbance >= DECLARED + DRAWN) {
        return NULL;
    }
    const disturbance_t *one =
        disturbance < DECLARED ? &declared[disturbance] : &drawn[disturbance - DECLARED];
    *probability = one->probability;
    return one->says;
}
