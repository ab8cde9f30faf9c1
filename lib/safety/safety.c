#include "safety.h"

#include <stddef.h>
#include <string.h>

#include "fixed_point.h"
#include "invariant.h"
#include "text.h"

#define TICKS_PER_SECOND 50

/* sensor_status; a sensor with any other answers */
#define STATUS_ABSENT 1u
#define STATUS_BUS    2u

/* Electrical conditions, bits of safety_spring_t.suspects; their order is that of blame. */
#define OVER_CURRENT    1u
#define OPEN            2u
#define SHORT           4u
#define HIGH_RESISTANCE 8u

bool safety_check(const safety_parameters_t *p, uint16_t *bad)
{
    if (!parameter_check(PARAMETER_PART_SAFETY, p, bad)) {
        return false;
    }
    if (p->resistance_maximum_mohm != 0 &&
        p->resistance_maximum_mohm <= p->resistance_minimum_mohm) {
        if (bad != NULL) {
            *bad = PARAMETER_resistance_maximum_ohm;
        }
        return false;
    }
    return true;
}

bool safety_apply(safety_t *safety, const safety_parameters_t *parameters, uint16_t *bad)
{
    if (!safety_check(parameters, bad)) {
        return false;
    }
    safety->parameters = *parameters;
    safety->temperature_trip_c7 = fixed_point_c7_from_cc(parameters->temperature_trip_cc);
    return true;
}

bool safety_init(safety_t *safety, const safety_parameters_t *parameters, uint8_t springs,
                 uint16_t *bad)
{
    if (springs == 0 || springs > SAFETY_MAX_SPRINGS) {
        return false;
    }
    if (!safety_check(parameters, bad)) {
        return false;
    }
    memset(safety, 0, sizeof *safety);
    safety->springs = springs;
    return safety_apply(safety, parameters, bad);
}

static void latch_board(safety_t *safety, safety_fault_t fault)
{
    if (safety->board_fault == SAFETY_FAULT_NONE) {
        safety->board_fault = (uint8_t)fault;
    }
}

static void latch(safety_spring_t *spring, safety_fault_t fault)
{
    if (spring->fault == SAFETY_FAULT_NONE) {
        spring->fault = (uint8_t)fault;
    }
}

safety_fault_t safety_resistance_fault(const safety_parameters_t *p, uint16_t current_ma,
                                       int16_t voltage_mv)
{
    /* without a division: u against i R */
    const uint16_t positive_mv = voltage_mv > 0 ? (uint16_t)voltage_mv : 0u;
    const uint32_t voltage_uv = fixed_point_mac_u16(0, positive_mv, 1000u);
    if (voltage_uv < fixed_point_mac_u16(0, current_ma, p->resistance_minimum_mohm)) {
        return SAFETY_FAULT_SHORT_SPRING;
    }
    return p->resistance_maximum_mohm != 0 &&
                   voltage_uv > fixed_point_mac_u16(0, current_ma, p->resistance_maximum_mohm)
               ? SAFETY_FAULT_HIGH_RESISTANCE
               : SAFETY_FAULT_NONE;
}

static uint8_t find_electrical(const safety_parameters_t *p, const safety_sample_t *s)
{
    int16_t current_ma = s->current_ma;
    uint8_t found = 0;
    if (s->expected_ma >= p->check_current_ma && current_ma < (int16_t)(s->expected_ma >> 2) &&
        !s->may_be_dead) {
        found |= OPEN;
    }
    if (current_ma <= 0) {
        return found;
    }
    uint16_t amount_ma = (uint16_t)current_ma;
    if (amount_ma > p->over_current_ma) {
        found |= OVER_CURRENT;
    }
    if (amount_ma >= p->check_current_ma) {
        const safety_fault_t fault = safety_resistance_fault(p, amount_ma, s->voltage_mv);
        if (fault == SAFETY_FAULT_SHORT_SPRING) {
            found |= SHORT;
        } else if (fault == SAFETY_FAULT_HIGH_RESISTANCE) {
            found |= HIGH_RESISTANCE;
        }
    }
    return found;
}

static void latch_suspects(safety_spring_t *spring)
{
    if ((spring->suspects & OVER_CURRENT) != 0) {
        latch(spring, SAFETY_FAULT_OVER_CURRENT);
    }
    if ((spring->suspects & OPEN) != 0) {
        latch(spring, SAFETY_FAULT_OPEN_SPRING);
    }
    if ((spring->suspects & SHORT) != 0) {
        latch(spring, SAFETY_FAULT_SHORT_SPRING);
    }
    if ((spring->suspects & HIGH_RESISTANCE) != 0) {
        latch(spring, SAFETY_FAULT_HIGH_RESISTANCE);
    }
}

static void count_electrical(safety_t *safety, safety_spring_t *spring, uint8_t found)
{
    uint8_t still = spring->suspects & found;
    if (still == 0) { /* none, or another one: counted anew */
        still = found;
        spring->electrical = 0;
    }
    spring->suspects = still;
    if (still != 0 && ++spring->electrical >= safety->parameters.bad_samples) {
        spring->electrical = safety->parameters.bad_samples;
        latch_suspects(spring);
    }
}

#define NOT_FROZEN INT16_MIN /* the sensor ends far above */

static bool flows_without_duty(const safety_parameters_t *p, const safety_sample_t *sample)
{
    return sample->off && sample->current_ma > (int16_t)p->stuck_on_ma;
}

static bool is_frozen(const safety_parameters_t *p, const safety_spring_t *s,
                      const safety_sample_t *sample)
{
    return sample->current_ma == s->frozen_ma && sample->current_ma != NOT_FROZEN &&
           (s->fault == SAFETY_FAULT_SENSOR_MISMATCH ||
            (flows_without_duty(p, sample) && sample->current_ma <= (int16_t)p->over_current_ma));
}

/* Of a driven spring: a stage's mean voltage is its duty's share of the supply, whatever hangs on
 * it; an open one may have more, but no current. */
static bool flows_beyond_duty(const safety_parameters_t *p, const safety_sample_t *sample)
{
    return sample->current_ma > (int16_t)p->over_current_ma && sample->voltage_mv > 0 &&
           (uint16_t)sample->voltage_mv > sample->most_mv;
}

/* What no fault before it may hide: whatever else is wrong, only the supply's switch helps. */
static void count_stuck(safety_t *safety, safety_spring_t *s, const safety_sample_t *sample)
{
    const safety_parameters_t *p = &safety->parameters;
    const uint8_t limit =
        p->bad_samples < SAFETY_STUCK_TICKS ? p->bad_samples : (uint8_t)SAFETY_STUCK_TICKS;
    if (!flows_without_duty(p, sample) && !flows_beyond_duty(p, sample)) {
        if (s->stuck != 0 && ++s->unstuck > SAFETY_FORGET_TICKS) {
            s->unstuck = 1;
            s->stuck--;
        }
        return;
    }
    s->unstuck = 0;
    if (++s->stuck >= limit) {
        s->stuck = limit;
        s->fault = SAFETY_FAULT_STUCK_ON;
        safety->board_fault = SAFETY_FAULT_STUCK_ON;
    }
}

static void take_reading(safety_t *safety, safety_spring_t *s, const safety_sample_t *sample)
{
    s->frozen = 0;
    if (s->fault == SAFETY_FAULT_NONE && !sample->off) {
        s->frozen_ma = sample->current_ma;
    } else if (sample->current_ma != s->frozen_ma) {
        s->frozen_ma = NOT_FROZEN;
    }
    count_electrical(safety, s, find_electrical(&safety->parameters, sample));
    count_stuck(safety, s, sample);
}

static void take_frozen(safety_t *safety, safety_spring_t *s)
{
    if (++s->frozen >= safety->parameters.bad_samples) {
        s->frozen = safety->parameters.bad_samples;
        latch(s, SAFETY_FAULT_SENSOR_MISMATCH);
    }
}

bool safety_tick_spring(safety_t *safety, uint8_t spring, const safety_sample_t *sample)
{
    safety_spring_t *s = &safety->spring[spring];
    uint8_t limit = safety->parameters.bad_samples;
    uint8_t status = sample->sensor_status;
    safety->answered = safety->answered || (status != STATUS_ABSENT && status != STATUS_BUS);
    const bool reads = status == 0 && !is_frozen(&safety->parameters, s, sample);
    if (status == 0) {
        s->sensor = 0;
        if (reads) {
            take_reading(safety, s, sample);
        } else {
            take_frozen(safety, s);
        }
    } else if (++s->sensor >= limit) { /* nothing is known: the electrical count stays */
        s->sensor = limit;
        latch(s, (safety_fault_t)(SAFETY_FAULT_SENSOR_ABSENT + (status <= 4 ? status - 1 : 0)));
    }
    if (sample->temperature_c7 <= safety->temperature_trip_c7) {
        s->temperature = 0;
    } else if (++s->temperature >= limit) {
        s->temperature = limit;
        latch(s, SAFETY_FAULT_OVER_TEMPERATURE);
    }

    INVARIANT(s->sensor <= limit && s->temperature <= limit);
    INVARIANT(s->fault < SAFETY_FAULT_COUNT);

    if (sample->expected_ma == 0) {
        s->on_s = 0;
    } else if (safety->second_ticks == 0) {
        const uint16_t most_s = safety->parameters.maximum_on_s;
        if (most_s != 0 && s->on_s >= most_s) {
            latch(s, SAFETY_FAULT_ON_TIME);
        } else if (s->on_s < UINT16_MAX) {
            s->on_s++;
        }
    }
    return reads;
}

/* The bus hangs, or has come off. Springs have faults of their own by then, as a rule; but a switch
 * that has welded heats on, and no reading shows it. */
static void count_blind(safety_t *safety)
{
    if (safety->answered) {
        safety->blind = 0;
    } else if (++safety->blind >= SAFETY_BLIND_TICKS) {
        safety->blind = SAFETY_BLIND_TICKS;
        latch_board(safety, SAFETY_FAULT_NO_SENSOR);
    }
    safety->answered = false;
}

void safety_tick_board(safety_t *safety, uint32_t sum_ma)
{
    const safety_parameters_t *p = &safety->parameters;
    count_blind(safety);
    if (sum_ma <= p->supply_limit_ma) {
        safety->supply_count = 0;
    } else if (++safety->supply_count >= p->bad_samples) {
        safety->supply_count = p->bad_samples;
        latch_board(safety, SAFETY_FAULT_SUPPLY_CURRENT);
    }
    safety->second_ticks = (uint8_t)(safety->second_ticks + 1);
    if (safety->second_ticks >= TICKS_PER_SECOND) {
        safety->second_ticks = 0;
    }
}

bool safety_allows(const safety_t *safety, uint8_t spring)
{
    return !safety->locked && safety->board_fault == SAFETY_FAULT_NONE &&
           safety->spring[spring].fault == SAFETY_FAULT_NONE;
}

bool safety_cuts_supply(const safety_t *safety)
{
    bool cuts = safety->board_fault == SAFETY_FAULT_STUCK_ON || safety->blind >= SAFETY_BLIND_TICKS;
    for (uint8_t k = 0; k < safety->springs; k++) {
        cuts = cuts || safety->spring[k].fault == SAFETY_FAULT_OVER_TEMPERATURE;
    }
    return cuts;
}

bool safety_doubts_supply(const safety_t *safety)
{
    bool doubts = false;
    for (uint8_t k = 0; k < safety->springs; k++) {
        doubts = doubts || (safety->spring[k].stuck != 0 && safety->spring[k].unstuck == 0 &&
                            safety->spring[k].sensor == 0);
    }
    return doubts;
}

safety_fault_t safety_fault(const safety_t *safety, uint8_t spring)
{
    return (safety_fault_t)safety->spring[spring].fault;
}

safety_fault_t safety_board_fault(const safety_t *safety)
{
    return (safety_fault_t)safety->board_fault;
}

const char *safety_fault_name(safety_fault_t fault)
{
    static const char names[] FLASH_MEMORY = "none\0"
                                             "over_current\0"
                                             "open_spring\0"
                                             "short_spring\0"
                                             "high_resistance\0"
                                             "sensor_absent\0"
                                             "sensor_bus\0"
                                             "sensor_stale\0"
                                             "sensor_reset\0"
                                             "over_temperature\0"
                                             "on_time\0"
                                             "stuck_on\0"
                                             "supply_current\0"
                                             "emergency_stop\0"
                                             "limit_trip\0"
                                             "sensor_mismatch\0"
                                             "host_silent\0"
                                             "no_sensor\0"
                                             "unknown";
    return text_item(names, (uint8_t)(fault < SAFETY_FAULT_COUNT ? fault : SAFETY_FAULT_COUNT));
}

void safety_clear(safety_t *safety)
{
    safety->board_fault = SAFETY_FAULT_NONE;
    safety->supply_count = 0;
    safety->blind = 0;
    for (uint8_t k = 0; k < safety->springs; k++) {
        const int16_t frozen_ma = safety->spring[k].frozen_ma;
        safety->spring[k] = (safety_spring_t){.frozen_ma = frozen_ma};
    }
}

void safety_trip(safety_t *safety, uint8_t spring, safety_fault_t fault)
{
    latch(&safety->spring[spring], fault);
    if (fault == SAFETY_FAULT_STUCK_ON) {
        latch_board(safety, fault);
    }
}

void safety_host_silent(safety_t *safety)
{
    latch_board(safety, SAFETY_FAULT_HOST_SILENT);
}

void safety_emergency_stop(safety_t *safety)
{
    latch_board(safety, SAFETY_FAULT_EMERGENCY_STOP);
}

void safety_lock(safety_t *safety)
{
    safety->locked = true;
}

void safety_unlock(safety_t *safety)
{
    safety->locked = false;
}

bool safety_is_locked(const safety_t *safety)
{
    return safety->locked;
}
