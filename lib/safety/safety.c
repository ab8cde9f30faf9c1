#include "safety.h"

#include <stddef.h>
#include <string.h>

#include "fixed_point.h"
#include "flash_memory.h"

#define TICKS_PER_SECOND 50
#define QUICK_LIMIT_MOHM 999u

/* What is looked for in each tick of each spring. Each has a counter of bad ticks in a row. */
typedef enum {
    CHECK_OVER_CURRENT = 0,
    CHECK_OPEN,
    CHECK_SHORT,
    CHECK_HIGH_RESISTANCE,
    CHECK_STUCK_ON,
    CHECK_SENSOR,
    CHECK_TEMPERATURE
} check_t;

#define BIT(check) ((uint8_t)(1u << (check)))
#define ELECTRICAL                                                                                 \
    (BIT(CHECK_OVER_CURRENT) | BIT(CHECK_OPEN) | BIT(CHECK_SHORT) | BIT(CHECK_HIGH_RESISTANCE) |   \
     BIT(CHECK_STUCK_ON))

/* Which fault each check latches; CHECK_SENSOR adds the sensor's status to the first of four. */
static const uint8_t check_fault[SAFETY_SPRING_CHECKS] = {
    SAFETY_FAULT_OVER_CURRENT,    SAFETY_FAULT_OPEN_SPRING, SAFETY_FAULT_SHORT_SPRING,
    SAFETY_FAULT_HIGH_RESISTANCE, SAFETY_FAULT_STUCK_ON,    SAFETY_FAULT_SENSOR_ABSENT,
    SAFETY_FAULT_OVER_TEMPERATURE};

static bool refuse(uint16_t *bad, size_t offset)
{
    if (bad != NULL) {
        *bad = (uint16_t)offset;
    }
    return false;
}

static bool within(uint16_t value, uint16_t low, uint16_t high)
{
    return value >= low && value <= high;
}

void safety_parameters_default(safety_parameters_t *parameters)
{
    *parameters = (safety_parameters_t){.over_current_ma = 3150,
                                        .supply_limit_ma = 15000,
                                        .check_current_ma = 300,
                                        .resistance_minimum_mohm = 80,
                                        .resistance_maximum_mohm = 500,
                                        .stuck_on_ma = 100,
                                        .temperature_trip_cc = 13000,
                                        .maximum_on_s = 0,
                                        .bad_samples = 5};
}

bool safety_check(const safety_parameters_t *p, uint16_t *bad)
{
    if (!within(p->over_current_ma, 100, 3200)) {
        return refuse(bad, offsetof(safety_parameters_t, over_current_ma));
    }
    if (!within(p->supply_limit_ma, 100, 60000)) {
        return refuse(bad, offsetof(safety_parameters_t, supply_limit_ma));
    }
    if (!within(p->check_current_ma, 50, 3200)) {
        return refuse(bad, offsetof(safety_parameters_t, check_current_ma));
    }
    if (p->resistance_minimum_mohm > 10000) {
        return refuse(bad, offsetof(safety_parameters_t, resistance_minimum_mohm));
    }
    if (p->resistance_maximum_mohm > 10000 ||
        (p->resistance_maximum_mohm != 0 &&
         p->resistance_maximum_mohm <= p->resistance_minimum_mohm)) {
        return refuse(bad, offsetof(safety_parameters_t, resistance_maximum_mohm));
    }
    if (!within(p->stuck_on_ma, 10, 3200)) {
        return refuse(bad, offsetof(safety_parameters_t, stuck_on_ma));
    }
    if (p->temperature_trip_cc < 0 || p->temperature_trip_cc > 25000) {
        return refuse(bad, offsetof(safety_parameters_t, temperature_trip_cc));
    }
    if (!within(p->bad_samples, 1, 250)) {
        return refuse(bad, offsetof(safety_parameters_t, bad_samples));
    }
    return true;
}

/* Bounds of the quick look: a reading within them is within the exact ones, too. Of the voltage
 * over the current, in 1/65536 ohm. */
static void prepare_quick(safety_t *safety)
{
    const safety_parameters_t *p = &safety->parameters;
    uint16_t low_mohm = p->resistance_minimum_mohm;
    uint16_t high_mohm = p->resistance_maximum_mohm;
    if (high_mohm == 0 || high_mohm > QUICK_LIMIT_MOHM) {
        high_mohm = QUICK_LIMIT_MOHM;
    }
    safety->quick_low_q16 = (uint16_t)((low_mohm * 65536ul + 999u) / 1000u);
    safety->quick_high_q16 = (uint16_t)(high_mohm * 65536ul / 1000u);
    /* a lower bound that does not fit: no current that says something is looked at quickly */
    uint16_t most_ma =
        low_mohm > QUICK_LIMIT_MOHM ? (uint16_t)(p->check_current_ma - 1u) : UINT16_MAX;
    safety->quick_ma = most_ma < p->over_current_ma ? most_ma : p->over_current_ma;
}

bool safety_apply(safety_t *safety, const safety_parameters_t *parameters, uint16_t *bad)
{
    if (!safety_check(parameters, bad)) {
        return false;
    }
    safety->parameters = *parameters;
    /* 1/100 degC to Q9.7: 128 / 100 */
    safety->temperature_trip_c7 = (int16_t)((int32_t)parameters->temperature_trip_cc * 32 / 25);
    prepare_quick(safety);
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

static void latch(safety_t *safety, uint8_t spring, safety_fault_t fault)
{
    if (fault >= SAFETY_FAULT_STUCK_ON && fault <= SAFETY_FAULT_EMERGENCY_STOP) {
        latch_board(safety, fault);
    }
    if (safety->fault[spring] == SAFETY_FAULT_NONE) {
        safety->fault[spring] = (uint8_t)fault;
    }
}

static uint8_t find_electrical(const safety_parameters_t *p, const safety_sample_t *s)
{
    int16_t current_ma = s->current_ma;
    uint8_t found = 0;
    if (s->expected_ma >= p->check_current_ma && current_ma < (int16_t)(s->expected_ma >> 2)) {
        found |= BIT(CHECK_OPEN);
    }
    if (current_ma <= 0) {
        return found;
    }
    uint16_t amount_ma = (uint16_t)current_ma;
    if (amount_ma > p->over_current_ma) {
        found |= BIT(CHECK_OVER_CURRENT);
    }
    if (s->expected_ma == 0 && amount_ma > p->stuck_on_ma) {
        found |= BIT(CHECK_STUCK_ON);
    }
    if (amount_ma >= p->check_current_ma) {
        /* resistance against its limits without a division: u against i R */
        uint32_t voltage_uv = s->voltage_mv > 0 ? (uint32_t)(uint16_t)s->voltage_mv * 1000u : 0u;
        if (voltage_uv < (uint32_t)amount_ma * p->resistance_minimum_mohm) {
            found |= BIT(CHECK_SHORT);
        }
        if (p->resistance_maximum_mohm != 0 &&
            voltage_uv > (uint32_t)amount_ma * p->resistance_maximum_mohm) {
            found |= BIT(CHECK_HIGH_RESISTANCE);
        }
    }
    return found;
}

static void count_found(safety_t *safety, uint8_t spring, uint8_t found, uint8_t known,
                        uint8_t sensor_status)
{
    uint8_t limit = safety->parameters.bad_samples;
    uint8_t *count = safety->count[spring];
    uint8_t counting = safety->counting[spring];
    uint8_t to_do = (found | counting) & known; /* where nothing is known the count stays */
    for (uint8_t check = 0; to_do != 0; check++, to_do >>= 1) {
        if ((to_do & 1u) == 0) {
            continue;
        }
        if ((found & BIT(check)) == 0) {
            count[check] = 0;
        } else if (++count[check] >= limit) {
            count[check] = limit;
            uint8_t fault = check_fault[check];
            if (check == CHECK_SENSOR) {
                fault = (uint8_t)(fault + (sensor_status <= 4 ? sensor_status - 1 : 0));
            }
            latch(safety, spring, (safety_fault_t)fault);
        }
    }
    safety->counting[spring] = (uint8_t)((counting & (uint8_t)~known) | found);
}

/* A few compares that only a sample without any fault passes, in 16 bits. False says nothing. */
static bool looks_good(const safety_t *safety, const safety_sample_t *s)
{
    const safety_parameters_t *p = &safety->parameters;
    if (s->sensor_status != 0 || s->temperature_c7 > safety->temperature_trip_c7) {
        return false;
    }
    uint16_t expected_ma = s->expected_ma;
    int16_t current_ma = s->current_ma;
    uint16_t amount_ma = current_ma > 0 ? (uint16_t)current_ma : 0;
    if (expected_ma == 0) {
        if (amount_ma > p->stuck_on_ma) {
            return false;
        }
    } else if (expected_ma >= p->check_current_ma && current_ma < (int16_t)(expected_ma >> 2)) {
        return false;
    }
    if (amount_ma > safety->quick_ma) {
        return false;
    }
    if (amount_ma < p->check_current_ma) {
        return true;
    }
    uint16_t below_mv = fixed_point_high_u16(amount_ma, safety->quick_low_q16);
    uint16_t most_mv = fixed_point_high_u16(amount_ma, safety->quick_high_q16);
    return s->voltage_mv > (int16_t)below_mv && s->voltage_mv <= (int16_t)most_mv;
}

static __attribute__((noinline)) void look_closely(safety_t *safety, uint8_t spring,
                                                   const safety_sample_t *sample)
{
    const safety_parameters_t *p = &safety->parameters;
    uint8_t known = BIT(CHECK_SENSOR) | BIT(CHECK_TEMPERATURE);
    uint8_t found = 0;
    if (sample->sensor_status == 0) {
        known |= ELECTRICAL;
        found = find_electrical(p, sample);
    } else {
        found |= BIT(CHECK_SENSOR);
    }
    if (sample->temperature_c7 > safety->temperature_trip_c7) {
        found |= BIT(CHECK_TEMPERATURE);
    }

    count_found(safety, spring, found, known, sample->sensor_status);
}

void safety_tick_spring(safety_t *safety, uint8_t spring, const safety_sample_t *sample)
{
    const safety_parameters_t *p = &safety->parameters;
    /* A good tick after a good tick changes no count. */
    if (safety->counting[spring] != 0 || !looks_good(safety, sample)) {
        look_closely(safety, spring, sample);
    }

    if (sample->expected_ma == 0) {
        safety->on_s[spring] = 0;
    } else if (safety->second_ticks == 0 && safety->on_s[spring] < UINT16_MAX) {
        safety->on_s[spring]++;
        if (p->maximum_on_s != 0 && safety->on_s[spring] > p->maximum_on_s) {
            latch(safety, spring, SAFETY_FAULT_ON_TIME);
        }
    }
}

void safety_tick_board(safety_t *safety, uint32_t sum_ma)
{
    const safety_parameters_t *p = &safety->parameters;
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
           safety->fault[spring] == SAFETY_FAULT_NONE;
}

safety_fault_t safety_fault(const safety_t *safety, uint8_t spring)
{
    return (safety_fault_t)safety->fault[spring];
}

safety_fault_t safety_board_fault(const safety_t *safety)
{
    return (safety_fault_t)safety->board_fault;
}

const char *safety_fault_name(safety_fault_t fault)
{
    switch (fault) {
    case SAFETY_FAULT_NONE:
        return FLASH_TEXT("none");
    case SAFETY_FAULT_OVER_CURRENT:
        return FLASH_TEXT("over_current");
    case SAFETY_FAULT_OPEN_SPRING:
        return FLASH_TEXT("open_spring");
    case SAFETY_FAULT_SHORT_SPRING:
        return FLASH_TEXT("short_spring");
    case SAFETY_FAULT_HIGH_RESISTANCE:
        return FLASH_TEXT("high_resistance");
    case SAFETY_FAULT_SENSOR_ABSENT:
        return FLASH_TEXT("sensor_absent");
    case SAFETY_FAULT_SENSOR_BUS:
        return FLASH_TEXT("sensor_bus");
    case SAFETY_FAULT_SENSOR_STALE:
        return FLASH_TEXT("sensor_stale");
    case SAFETY_FAULT_SENSOR_RESET:
        return FLASH_TEXT("sensor_reset");
    case SAFETY_FAULT_OVER_TEMPERATURE:
        return FLASH_TEXT("over_temperature");
    case SAFETY_FAULT_ON_TIME:
        return FLASH_TEXT("on_time");
    case SAFETY_FAULT_STUCK_ON:
        return FLASH_TEXT("stuck_on");
    case SAFETY_FAULT_SUPPLY_CURRENT:
        return FLASH_TEXT("supply_current");
    case SAFETY_FAULT_EMERGENCY_STOP:
        return FLASH_TEXT("emergency_stop");
    case SAFETY_FAULT_LIMIT_TRIP:
        return FLASH_TEXT("limit_trip");
    case SAFETY_FAULT_COUNT:
        break;
    }
    return FLASH_TEXT("unknown");
}

void safety_clear(safety_t *safety)
{
    safety->board_fault = SAFETY_FAULT_NONE;
    safety->supply_count = 0;
    memset(safety->fault, 0, sizeof safety->fault);
    memset(safety->count, 0, sizeof safety->count);
    memset(safety->counting, 0, sizeof safety->counting);
    memset(safety->on_s, 0, sizeof safety->on_s);
}

void safety_trip_limit(safety_t *safety, uint8_t spring)
{
    latch(safety, spring, SAFETY_FAULT_LIMIT_TRIP);
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
