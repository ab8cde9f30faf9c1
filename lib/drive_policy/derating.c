#include "derating.h"

#define HORIZON_S       6.0f /* heat from a neighbour still arrives so long after its current ends */
#define UNDRIVEN_BAND_K 5.0f

float derating_share(float temperature_c, float limit_c, float band_k)
{
    const float below_k = limit_c - temperature_c;
    if (below_k >= band_k) { /* as a rule: no division */
        return 1.0f;
    }
    return below_k > 0.0f ? below_k / band_k : 0.0f;
}

float derating_severity(float highest_c, float rise_k_per_s, float limit_c)
{
    return 1.0f - derating_share(highest_c + HORIZON_S * rise_k_per_s, limit_c, UNDRIVEN_BAND_K);
}

uint16_t derating_overload_ma(uint16_t budget_ma, uint16_t continuous_ma,
                              uint16_t overload_quarters, uint16_t allowed_quarters)
{
    const uint16_t free_quarters = allowed_quarters / 2u;
    if (budget_ma <= continuous_ma || overload_quarters <= free_quarters) {
        return budget_ma;
    }
    const uint16_t excess_ma = (uint16_t)(budget_ma - continuous_ma);
    const uint16_t over = (uint16_t)(overload_quarters - free_quarters);
    const uint16_t away_ma =
        (uint16_t)(over >= free_quarters ? excess_ma : (uint32_t)excess_ma * over / free_quarters);
    return (uint16_t)(budget_ma - away_ma);
}
