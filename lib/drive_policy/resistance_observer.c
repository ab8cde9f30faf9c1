#include "resistance_observer.h"

#include "fixed_point.h"

#define LEAST_MA          150u
#define SCALE_LOWEST      2048
#define SCALE_HIGHEST     60000
#define NOISE_FLOOR_UV    3600u /* of one reading: about one step of the sensor */
#define LEARNT_ENOUGH     4u
#define PLAUSIBLE_LOWEST  (-250)
#define PLAUSIBLE_HIGHEST 1350
#define CURRENT_LIMIT_MA  3200u
#define THROUGH_HIGHEST   (1ul << 30) /* Q13 */

static int32_t clamp(int32_t value, int32_t low, int32_t high)
{
    return value < low ? low : value > high ? high : value;
}

void resistance_alloy_prepare(resistance_alloy_t *alloy, uint32_t martensite_uohm,
                              uint32_t austenite_uohm)
{
    /* 15 bits of 1000000 / R_M by long division, R_M scaled by powers of two until the quotient is
     * in 1..2 */
    uint32_t rest = 1000000ul;
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
    /* 1000 permille / (ratio_A - 1) */
    alloy->phase_gain = change == 0 || martensite_uohm / change >= 50u
                            ? 0
                            : (uint16_t)fixed_point_multiply_divide(1000u, martensite_uohm, change);
    alloy->falls = !rises;
    uint32_t highest = RESISTANCE_OBSERVER_ONE_Q14;
    if (rises) {
        highest = (uint32_t)fixed_point_multiply_divide(highest, austenite_uohm, martensite_uohm);
    }
    alloy->highest_q14 = highest > UINT16_MAX ? UINT16_MAX : (uint16_t)highest;
    uint32_t floor_ma = (uint32_t)NOISE_FLOOR_UV * 1000u / martensite_uohm;
    alloy->noise_floor_ma = floor_ma > 4095u ? 4095u : (uint16_t)floor_ma;
}

void resistance_observer_reset(resistance_observer_t *observer)
{
    *observer = (resistance_observer_t){.slow_q22 = (uint32_t)RESISTANCE_OBSERVER_ONE_Q14 << 8,
                                        .ratio_q14 = RESISTANCE_OBSERVER_ONE_Q14,
                                        .inverse_q14 = RESISTANCE_OBSERVER_ONE_Q14,
                                        .scale_q14 = RESISTANCE_OBSERVER_ONE_Q14};
}

/* a b / 2^14, at most UINT16_MAX. */
static inline uint16_t product_q14(uint16_t a, uint16_t b)
{
    uint32_t product = fixed_point_mac_u16(0, a, b);
    return (uint8_t)(product >> 24) >= 64u ? UINT16_MAX : (uint16_t)((product << 2) >> 16);
}

/* Current that the window's voltage would drive through the declared martensite, Q13 mA. */
static uint32_t through_q13(const resistance_alloy_t *alloy, uint16_t voltage_sum_mv)
{
    uint32_t through = fixed_point_mac_u16(0, voltage_sum_mv, alloy->gain_mantissa);
    int8_t shift = (int8_t)(13 - alloy->gain_shift);
    for (; shift > 0 && through < THROUGH_HIGHEST; shift--) {
        through <<= 1;
    }
    for (; shift < 0; shift++) {
        through >>= 1;
    }
    return through < THROUGH_HIGHEST ? through : THROUGH_HIGHEST;
}

static int16_t as_permille(const resistance_alloy_t *alloy, uint16_t size_q14, bool above)
{
    uint16_t permille = product_q14(alloy->phase_gain, size_q14);
    if (above != alloy->falls) {
        return permille > 3000u ? 3000 : (int16_t)permille;
    }
    return permille > 2000u ? -2000 : (int16_t) - (int16_t)permille;
}

static inline void refresh_phase(resistance_observer_t *observer, const resistance_alloy_t *alloy)
{
    uint16_t ratio = product_q14(observer->ratio_q14, observer->scale_q14);
    bool above = ratio >= RESISTANCE_OBSERVER_ONE_Q14;
    observer->phase_permille = as_permille(alloy,
                                           above ? (uint16_t)(ratio - RESISTANCE_OBSERVER_ONE_Q14)
                                                 : (uint16_t)(RESISTANCE_OBSERVER_ONE_Q14 - ratio),
                                           above);
}

/* One Newton step of 1 / ratio, from the last value. */
static inline void refresh_inverse(resistance_observer_t *observer)
{
    uint16_t inverse = observer->inverse_q14;
    uint16_t product = product_q14(inverse, observer->ratio_q14); /* 1 when right */
    if (product >= 2u * RESISTANCE_OBSERVER_ONE_Q14) {
        inverse = inverse >> 1;
    } else {
        inverse = product_q14((uint16_t)(2u * RESISTANCE_OBSERVER_ONE_Q14 - product), inverse);
    }
    observer->inverse_q14 = inverse != 0 ? inverse : 1u;
}

/* A ratio of fraction bits, after an error (Q13) over a norm: gain is 2^25 over it, Q0 for a ratio
 * in Q14. */
static inline uint32_t corrected(uint32_t ratio, int32_t error_q13, uint32_t gain, uint32_t one)
{
    int32_t sum = (int32_t)ratio + (int32_t)(((int64_t)(error_q13 >> 8) * gain) >> 16);
    if (sum < (int32_t)(one >> 3)) {
        return one >> 3;
    }
    return sum > (int32_t)(3u * one) ? 3u * one : (uint32_t)sum;
}

bool resistance_observer_update(resistance_observer_t *observer, const resistance_alloy_t *alloy,
                                bool judges)
{
    uint8_t readings = observer->readings;
    uint16_t sum_ma = observer->current_sum_ma;
    uint16_t sum_mv = observer->voltage_sum_mv;
    observer->readings = 0;
    observer->current_sum_ma = 0;
    observer->voltage_sum_mv = 0;
    if (readings < RESISTANCE_OBSERVER_LEAST_READINGS || sum_ma < (uint16_t)(LEAST_MA * readings)) {
        return false;
    }
    uint16_t gain = 0x8000; /* 2^25 over the norm, which is at least 2^10 */
    for (uint8_t high = (uint8_t)((uint8_t)(sum_ma >> 8) >> 2); high != 0; high = high >> 1) {
        gain = gain >> 1;
    }
    uint32_t through = through_q13(alloy, sum_mv);
    int32_t fast = (int32_t)(through - (fixed_point_mac_u16(0, observer->ratio_q14, sum_ma) >> 1));
    uint16_t slow_q14 = (uint16_t)(observer->slow_q22 >> 8);
    int32_t slow = (int32_t)(through - (fixed_point_mac_u16(0, slow_q14, sum_ma) >> 1));
    observer->ratio_q14 =
        (uint16_t)corrected(observer->ratio_q14, fast, gain, RESISTANCE_OBSERVER_ONE_Q14);
    observer->slow_q22 = corrected(observer->slow_q22, slow, (uint32_t)gain << 4,
                                   (uint32_t)RESISTANCE_OBSERVER_ONE_Q14 << 8);

    /* a steady ramp has a steady misfit: noise is what changes from one window to the next */
    int16_t misfit = (int16_t)(fast >> 16); /* 8 mA */
    int16_t change = (int16_t)(misfit - observer->misfit);
    observer->misfit = misfit;
    if (judges) {
        uint16_t size = (uint16_t)(change < 0 ? -change : change);
        observer->noise = (uint16_t)(observer->noise - (observer->noise >> 2) + size);
        uint16_t limit = (uint16_t)((sum_ma >> 9) + (alloy->noise_floor_ma >> 1) * readings);
        observer->noisy = observer->noise > (observer->noisy ? limit >> 1 : limit);
    }
    refresh_inverse(observer);
    refresh_phase(observer, alloy);
    return true;
}

void resistance_observer_restart_average(resistance_observer_t *observer)
{
    observer->slow_q22 = (uint32_t)observer->ratio_q14 << 8;
}

void resistance_observer_learn_martensite(resistance_observer_t *observer,
                                          const resistance_alloy_t *alloy)
{
    int32_t error = RESISTANCE_OBSERVER_ONE_Q14 -
                    (int32_t)product_q14(observer->ratio_q14, observer->scale_q14);
    error >>= observer->learnt < LEARNT_ENOUGH ? 1 : 3;
    observer->scale_q14 = (uint16_t)clamp(observer->scale_q14 + error, SCALE_LOWEST, SCALE_HIGHEST);
    if (observer->learnt < UINT8_MAX) {
        observer->learnt++;
    }
    refresh_phase(observer, alloy);
}

int16_t resistance_observer_drift_permille(const resistance_observer_t *observer,
                                           const resistance_alloy_t *alloy, uint16_t reference_q14)
{
    uint16_t slow_q14 = (uint16_t)(observer->slow_q22 >> 8);
    bool rises = slow_q14 >= reference_q14;
    uint16_t size =
        rises ? (uint16_t)(slow_q14 - reference_q14) : (uint16_t)(reference_q14 - slow_q14);
    return as_permille(alloy, product_q14(size, observer->scale_q14), rises);
}

bool resistance_observer_is_plausible(const resistance_observer_t *observer,
                                      const resistance_alloy_t *alloy)
{
    return alloy->phase_gain != 0 && observer->learnt >= LEARNT_ENOUGH && !observer->noisy &&
           observer->phase_permille >= PLAUSIBLE_LOWEST &&
           observer->phase_permille <= PLAUSIBLE_HIGHEST;
}

/* Square root of 24 bits, rounded down: two bits of the square, from the top, make one of the
 * root; the first four of it in 8 bits. */
static uint16_t root(uint32_t square)
{
    uint8_t bits = (uint8_t)(square >> 16);
    uint8_t small = 0;
    uint8_t small_rest = 0;
    for (uint8_t pair = 4; pair != 0; pair--) {
        small_rest = (uint8_t)(small_rest << 2 | bits >> 6);
        bits = (uint8_t)(bits << 2);
        uint8_t trial = (uint8_t)((uint8_t)(small << 2) | 1u);
        small = (uint8_t)(small << 1);
        if (small_rest >= trial) {
            small_rest = (uint8_t)(small_rest - trial);
            small |= 1u;
        }
    }
    uint16_t low = (uint16_t)square;
    uint16_t rest = small_rest;
    uint16_t twice = (uint16_t)(small << 1); /* the root so far */
    for (uint8_t pair = 8; pair != 0; pair--) {
        rest = (uint16_t)((uint16_t)(rest << 2) | (uint8_t)((uint8_t)(low >> 8) >> 6));
        low = (uint16_t)(low << 2);
        twice = (uint16_t)(twice << 1);
        if (rest > twice) {
            rest = (uint16_t)(rest - twice - 1u);
            twice = (uint16_t)(twice + 2u);
        }
    }
    return twice >> 1;
}

uint16_t resistance_current_for_power_ma(const resistance_alloy_t *alloy, uint16_t inverse_q14,
                                         uint16_t power_64uw)
{
    /* i^2 (mA^2) = 64 1000 P / (R_M ratio) */
    uint16_t conductance = product_q14(alloy->gain_mantissa, inverse_q14);
    uint32_t square = fixed_point_mac_u16(0, power_64uw, conductance);
    int8_t shift = (int8_t)(alloy->gain_shift - 6);
    if (shift < 0) {
        return CURRENT_LIMIT_MA;
    }
    for (; shift > 0; shift--) {
        square >>= 1;
    }
    if (square >= (uint32_t)CURRENT_LIMIT_MA * CURRENT_LIMIT_MA) {
        return CURRENT_LIMIT_MA;
    }
    return root(square);
}
