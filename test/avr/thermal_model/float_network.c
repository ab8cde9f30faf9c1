#include "float_network.h"

#include <stdint.h>

#define STEP_S 0.1f

static float temperature_c[9];
static float power_w[9];
static float air_c;
static float plate_c;

void float_network_reset(void)
{
    for (uint8_t i = 0; i < 9; i++) {
        temperature_c[i] = 40.0f + (float)i;
        power_w[i] = 0.39f;
    }
    air_c = 30.0f;
    plate_c = 25.0f;
}

void float_network_step(void)
{
    float flow_w[9];
    float air_w = -0.06f * (air_c - 20.0f);
    float plate_w = -0.02f * (plate_c - 20.0f);
    for (uint8_t i = 0; i < 9; i++) {
        float loss_w = 0.0058f * (temperature_c[i] - air_c);
        float down_w = 0.0005f * (temperature_c[i] - plate_c);
        air_w += loss_w;
        plate_w += down_w;
        flow_w[i] = power_w[i] - loss_w - down_w;
    }
    for (uint8_t row = 0; row < 3; row++) {
        for (uint8_t column = 0; column < 3; column++) {
            uint8_t i = (uint8_t)(3 * row + column);
            for (uint8_t k = 0; k < 4; k++) { /* east, south-west, south, south-east */
                uint8_t r = (uint8_t)(row + (k > 0));
                uint8_t c = k == 0 ? (uint8_t)(column + 1) : (uint8_t)(column + k - 2);
                if (r < 3 && c < 3) {
                    uint8_t j = (uint8_t)(3 * r + c);
                    float g = (k & 1) != 0 ? 0.000293f : 0.000586f;
                    float through_w = g * (temperature_c[i] - temperature_c[j]);
                    flow_w[i] -= through_w;
                    flow_w[j] += through_w;
                }
            }
        }
    }
    for (uint8_t i = 0; i < 9; i++) {
        temperature_c[i] += flow_w[i] * (STEP_S / 0.3f);
    }
    air_c += air_w * (STEP_S / 0.05f);
    plate_c += plate_w * (STEP_S / 20.0f);
}
