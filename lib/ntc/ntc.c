#include "ntc.h"

#include "flash_memory.h"

#define LOWEST_C (-20)
#define STEP_C   5
#define POINTS   21

/* 1/16 of the converter's steps at -20, -15, ... 80 degC: 16384 r / (r + 1) with
 * r = exp(3950 K (1/T - 1/298.15 K)). */
static const uint16_t curve[POINTS] FLASH_MEMORY = {14964, 14520, 13983, 13351, 12628, 11823, 10954,
                                                    10043, 9114,  8192,  7301,  6458,  5677,  4965,
                                                    4326,  3760,  3262,  2828,  2452,  2127,  1847};

static uint16_t point(uint8_t index)
{
    uint16_t value;
    flash_copy(&value, &curve[index], sizeof value);
    return value;
}

bool ntc_temperature_c7(uint16_t adc, int16_t *temperature_c7)
{
    const uint16_t fine = (uint16_t)(adc << 4);
    if (adc > 1023u || fine > point(0) || fine < point(POINTS - 1)) {
        return false;
    }
    uint8_t at = 0;
    while (at < POINTS - 2 && fine < point((uint8_t)(at + 1u))) {
        at++;
    }
    const uint16_t span = (uint16_t)(point(at) - point((uint8_t)(at + 1u)));
    const uint32_t into = (uint32_t)(point(at) - fine) * (STEP_C * 128u);
    *temperature_c7 = (int16_t)((LOWEST_C + STEP_C * at) * 128 + (int16_t)(into / span));
    return true;
}
