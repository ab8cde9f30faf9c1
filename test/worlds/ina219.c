#include "ina219.h"

static double measured(double true_value, double gain, double offset, double noise, double step,
                       double low, double high)
{
    double value = true_value * gain + offset + noise;
    return step * round(fmin(fmax(value, low), high) / step);
}

void ina219_read(ina219_t *sensor, random_t *random, double current_a, double voltage_v,
                 int16_t *current_ma, int16_t *voltage_mv)
{
    /* Drawn even if frozen: the other sensors' noise does not depend on this one's fault. */
    double current_noise_a = sensor->current_noise_a * random_noise(random);
    double voltage_noise_v = sensor->voltage_noise_v * random_noise(random);
    if (sensor->slow_voltage_noise_v > 0.0) {
        const double share = 0.02 / INA219_SLOW_S;
        sensor->slow_v +=
            sqrt(share * (2.0 - share)) * sensor->slow_voltage_noise_v * random_noise(random) -
            share * sensor->slow_v;
        voltage_noise_v += sensor->slow_v;
    }
    double a = measured(current_a, sensor->current_gain, sensor->current_offset_a, current_noise_a,
                        INA219_CURRENT_STEP_A, -INA219_CURRENT_MAX_A, INA219_CURRENT_MAX_A);
    double v = measured(voltage_v, sensor->voltage_gain, sensor->voltage_offset_v, voltage_noise_v,
                        INA219_VOLTAGE_STEP_V, 0.0, INA219_VOLTAGE_MAX_V);
    if (!sensor->current_frozen) {
        *current_ma = (int16_t)lround(1000.0 * a);
    }
    if (!sensor->voltage_frozen) {
        *voltage_mv = (int16_t)lround(1000.0 * v);
    }
}
