#include "resistance_observer.h"

#define LEAST_SUM_MA      (150u * RESISTANCE_OBSERVER_WINDOW)
#define MOST_MOVE_MA      100
#define HIGHEST_MA        3275  /* five of them, four quarters each, fit 16 bits */
#define HIGHEST_MV        13107 /* five fit 16 bits */
#define RATIO_LOWEST      2048u
#define RATIO_HIGHEST     60000u
#define NOISE_FLOOR_MV    18u /* summed over a window: 3.6 mV each, about one step of the sensor */
#define LEARNT_ENOUGH     10u
#define PLAUSIBLE_LOWEST  (-250)
#define PLAUSIBLE_HIGHEST 1350
#define CURRENT_LIMIT_MA  3200u

static int32_t clamp(int32_t value, int32_t low, int32_t high)
{
    return value < low ? low : value > high ? high : value;
}

void resistance_alloy_prepare(resistance_alloy_t *alloy, uint32_t martensite_uohm,
                              uint32_t austenite_uohm)
{
    /* 15 bits of 4000000 / R_M by long division, R_M scaled by powers of two until the quotient is
     * in 1..2 */
    uint32_t rest = 4000000ul;
    uint32_t divisor = martensite_uohm;
    int8_t shift = 14;
    while (rest < divisor) {
        rest <<= 1;
        shift++;
    }
    while (rest - divisor >= divisor) {
        divisor <<= 1;
        shift--;
    }
    uint16_t mantissa = 0;
    for (uint8_t bit = 0; bit < 15; bit++) {
        mantissa = (uint16_t)(mantissa << 1);
        if (rest >= divisor) {
            rest -= divisor;
            mantissa |= 1u;
        }
        rest <<= 1;
    }
    alloy->gain_mantissa = mantissa;
    alloy->gain_shift = shift;

    bool rises = austenite_uohm > martensite_uohm;
    uint32_t change = rises ? austenite_uohm - martensite_uohm : martensite_uohm - austenite_uohm;
    /* 1000 permille / (ratio_A - 1) / 2^14 in Q12 is 250 R_M / (R_A - R_M) */
    if (change == 0 || martensite_uohm / change >= 50u) {
        alloy->phase_gain_q12 = 0;
    } else {
        int16_t gain = (int16_t)(250ul * martensite_uohm / change);
        alloy->phase_gain_q12 = (int16_t)(rises ? gain : -gain);
    }
    uint32_t floor = shift >= 0 ? ((uint32_t)NOISE_FLOOR_MV * mantissa) >> shift : UINT16_MAX;
    alloy->noise_floor = floor > UINT16_MAX ? UINT16_MAX : (uint16_t)floor;
}

void resistance_observer_reset(resistance_observer_t *observer)
{
    *observer = (resistance_observer_t){.slow_q22 = (uint32_t)RESISTANCE_OBSERVER_ONE_Q14 << 8,
                                        .ratio_q14 = RESISTANCE_OBSERVER_ONE_Q14,
                                        .scale_q14 = RESISTANCE_OBSERVER_ONE_Q14};
}

void resistance_observer_take(resistance_observer_t *observer, int16_t current_ma,
                              int16_t voltage_mv)
{
    if (current_ma < 0 || voltage_mv < 0 || observer->readings >= RESISTANCE_OBSERVER_WINDOW) {
        return;
    }
    uint16_t ma = current_ma > HIGHEST_MA ? HIGHEST_MA : (uint16_t)current_ma;
    uint16_t mv = voltage_mv > HIGHEST_MV ? HIGHEST_MV : (uint16_t)voltage_mv;
    if (observer->readings == 0) {
        observer->first_ma = ma;
    }
    observer->last_ma = ma;
    observer->current_sum_ma = (uint16_t)(observer->current_sum_ma + ma);
    observer->voltage_sum_mv = (uint16_t)(observer->voltage_sum_mv + mv);
    observer->readings++;
}

/* Voltage less ratio times current, both as quarter mA through the declared martensite. */
static int32_t misfit(uint32_t through_q2, uint16_t ratio_q14, uint16_t sum_q2)
{
    int32_t error = (int32_t)(through_q2 - (((uint32_t)ratio_q14 * sum_q2) >> 14));
    return clamp(error, -32767, 32767);
}

bool resistance_observer_update(resistance_observer_t *observer, const resistance_alloy_t *alloy)
{
    int16_t move_ma = (int16_t)(observer->last_ma - observer->first_ma);
    bool complete = observer->readings == RESISTANCE_OBSERVER_WINDOW &&
                    observer->current_sum_ma >= LEAST_SUM_MA && move_ma <= MOST_MOVE_MA &&
                    move_ma >= -MOST_MOVE_MA;
    uint16_t sum_q2 = (uint16_t)(observer->current_sum_ma << 2);
    uint32_t product = (uint32_t)observer->voltage_sum_mv * alloy->gain_mantissa;
    observer->readings = 0;
    observer->current_sum_ma = 0;
    observer->voltage_sum_mv = 0;
    if (!complete) {
        return false;
    }
    uint32_t through_q2 = alloy->gain_shift >= 0 ? product >> alloy->gain_shift : UINT16_MAX;
    if (through_q2 > (uint32_t)INT32_MAX >> 1) {
        through_q2 = (uint32_t)INT32_MAX >> 1;
    }
    uint8_t norm = 0;
    while (sum_q2 >> norm != 0) {
        norm++;
    }

    int32_t fast = misfit(through_q2, observer->ratio_q14, sum_q2);
    int32_t slow = misfit(through_q2, (uint16_t)(observer->slow_q22 >> 8), sum_q2);
    int32_t ratio = observer->ratio_q14 + ((fast * RESISTANCE_OBSERVER_ONE_Q14) >> norm >> 1);
    observer->ratio_q14 = (uint16_t)clamp(ratio, RATIO_LOWEST, RATIO_HIGHEST);
    int32_t average = (int32_t)observer->slow_q22 + (((slow * 16384) >> norm) * 8);
    observer->slow_q22 =
        (uint32_t)clamp(average, (int32_t)RATIO_LOWEST << 8, (int32_t)RATIO_HIGHEST << 8);

    uint16_t size = (uint16_t)(fast < 0 ? -fast : fast);
    observer->noise = (uint16_t)(observer->noise - (observer->noise >> 3) + (size >> 3));
    uint16_t limit = (uint16_t)(sum_q2 >> 7);
    limit = limit > UINT16_MAX - alloy->noise_floor ? UINT16_MAX
                                                    : (uint16_t)(limit + alloy->noise_floor);
    if (observer->learnt != 0) { /* before, the misfit is that of the start */
        observer->noisy = observer->noise > (observer->noisy ? limit >> 1 : limit);
    }
    return true;
}

void resistance_observer_restart_average(resistance_observer_t *observer)
{
    observer->slow_q22 = (uint32_t)observer->ratio_q14 << 8;
}

static int32_t normalised(const resistance_observer_t *observer, int32_t ratio_q14)
{
    return (ratio_q14 * observer->scale_q14) >> 14;
}

void resistance_observer_learn_martensite(resistance_observer_t *observer)
{
    int32_t error = RESISTANCE_OBSERVER_ONE_Q14 - normalised(observer, observer->ratio_q14);
    error >>= observer->learnt < LEARNT_ENOUGH ? 1 : 4;
    observer->scale_q14 = (uint16_t)clamp(observer->scale_q14 + error, RATIO_LOWEST, RATIO_HIGHEST);
    if (observer->learnt < UINT8_MAX) {
        observer->learnt++;
    }
}

static int16_t as_permille(const resistance_alloy_t *alloy, int32_t ratio_q14)
{
    int32_t phase = (clamp(ratio_q14, -65535, 65535) * alloy->phase_gain_q12) >> 12;
    return (int16_t)clamp(phase, -2000, 3000);
}

int16_t resistance_observer_phase_permille(const resistance_observer_t *observer,
                                           const resistance_alloy_t *alloy)
{
    return as_permille(alloy, normalised(observer, observer->ratio_q14) -
                                  (int32_t)RESISTANCE_OBSERVER_ONE_Q14);
}

int16_t resistance_observer_drift_permille(const resistance_observer_t *observer,
                                           const resistance_alloy_t *alloy, uint16_t reference_q14)
{
    int32_t drift = (int32_t)(observer->slow_q22 >> 8) - (int32_t)reference_q14;
    return as_permille(alloy, normalised(observer, clamp(drift, -32767, 32767)));
}

bool resistance_observer_is_plausible(const resistance_observer_t *observer,
                                      const resistance_alloy_t *alloy)
{
    int16_t phase = resistance_observer_phase_permille(observer, alloy);
    return alloy->phase_gain_q12 != 0 && observer->learnt >= LEARNT_ENOUGH && !observer->noisy &&
           phase >= PLAUSIBLE_LOWEST && phase <= PLAUSIBLE_HIGHEST;
}

/* Square root rounded down, bit by bit; 12 bits. */
static uint16_t root(uint32_t square)
{
    uint16_t result = 0;
    for (uint16_t bit = 2048; bit != 0; bit = (uint16_t)(bit >> 1)) {
        uint16_t trial = (uint16_t)(result | bit);
        if ((uint32_t)trial * trial <= square) {
            result = trial;
        }
    }
    return result;
}

uint16_t resistance_current_for_power_ma(const resistance_alloy_t *alloy, uint16_t inverse_q14,
                                         uint16_t power_64uw)
{
    /* i^2 (mA^2) = 64000 P / (R_M ratio): the alloy's gain times 16 */
    uint32_t conductance = ((uint32_t)alloy->gain_mantissa * inverse_q14) >> 14;
    if (conductance > UINT16_MAX) {
        conductance = UINT16_MAX;
    }
    uint32_t square = (uint32_t)power_64uw * (uint16_t)conductance;
    int8_t shift = (int8_t)(alloy->gain_shift - 4);
    if (shift < 0) {
        return CURRENT_LIMIT_MA;
    }
    square >>= shift;
    if (square >= (uint32_t)CURRENT_LIMIT_MA * CURRENT_LIMIT_MA) {
        return CURRENT_LIMIT_MA;
    }
    return root(square);
}

uint16_t resistance_inverse_q14(uint16_t inverse_q14, uint16_t ratio_q14)
{
    uint32_t product = ((uint32_t)inverse_q14 * ratio_q14) >> 14; /* 1 when right */
    if (product >= 2u * RESISTANCE_OBSERVER_ONE_Q14) {
        return (uint16_t)(inverse_q14 >> 1 != 0 ? inverse_q14 >> 1 : 1u);
    }
    uint32_t next = ((2u * RESISTANCE_OBSERVER_ONE_Q14 - product) * inverse_q14) >> 14;
    return next > UINT16_MAX ? UINT16_MAX : next == 0 ? 1u : (uint16_t)next;
}
