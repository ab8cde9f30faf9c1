#include "ina219.h"

#include <math.h>
#include <stdlib.h>

#define CONFIG_RESET       0x399Fu
#define CONFIG_RESET_BIT   0x8000u
#define MODE_SHUNT         1u
#define MODE_BUS           2u
#define MODE_CONTINUOUS    4u
#define BUS_FULL_SCALE_16V 4000u
#define BUS_FULL_SCALE_32V 8000u

static uint8_t mode_of(const ina219_t *sensor)
{
    return (uint8_t)(sensor->config & 7u);
}

/* Modes 0 (power-down) and 4 (ADC off) convert nothing. */
static bool converts(uint8_t mode)
{
    return (mode & (MODE_SHUNT | MODE_BUS)) != 0;
}

uint32_t ina219_conversion_us(uint8_t adc_setting)
{
    static const uint32_t single_us[4] = {84, 148, 276, 532};
    static const uint32_t averaged_us[8] = {532, 1060, 2130, 4260, 8510, 17020, 34050, 68100};
    return (adc_setting & 8u) != 0 ? averaged_us[adc_setting & 7u] : single_us[adc_setting & 3u];
}

/* Below 12 bits the lowest bits of a result are not resolved. */
static long resolution_step(uint8_t adc_setting)
{
    return (adc_setting & 8u) != 0 ? 1 : 1L << (3u - (adc_setting & 3u));
}

static uint8_t adc_setting(const ina219_t *sensor)
{
    unsigned shift = sensor->phase == INA219_CONVERTS_BUS ? 7u : 3u;
    return (uint8_t)((sensor->config >> shift) & 0xFu);
}

static void begin_conversion(ina219_t *sensor, ina219_phase_t phase, const ina219_inputs_t *now)
{
    sensor->phase = phase;
    sensor->window_start = *now;
    if (phase == INA219_IDLE) {
        sensor->conversion_end_cycle = INA219_NEVER;
    } else {
        sensor->conversion_end_cycle =
            now->cycle + (uint64_t)ina219_conversion_us(adc_setting(sensor)) * INA219_CYCLES_PER_US;
    }
}

static void begin_sequence(ina219_t *sensor, const ina219_inputs_t *now)
{
    uint8_t mode = mode_of(sensor);
    if (!converts(mode)) {
        begin_conversion(sensor, INA219_IDLE, now);
    } else if ((mode & MODE_SHUNT) != 0) {
        begin_conversion(sensor, INA219_CONVERTS_SHUNT, now);
    } else {
        begin_conversion(sensor, INA219_CONVERTS_BUS, now);
    }
}

void ina219_power_on(ina219_t *sensor, const ina219_inputs_t *now)
{
    ina219_t before = *sensor;
    *sensor = (ina219_t){.config = CONFIG_RESET,
                         .absent = before.absent,
                         .stale = before.stale,
                         .shunt_frozen = before.shunt_frozen,
                         .bus_frozen = before.bus_frozen,
                         .shunt_gain_error = before.shunt_gain_error,
                         .bus_gain_error = before.bus_gain_error,
                         .shunt_noise_v = before.shunt_noise_v,
                         .bus_noise_v = before.bus_noise_v,
                         .noise = before.noise};
    begin_sequence(sensor, now);
}

static long quantised(double value, double lsb, long step, long minimum, long maximum)
{
    double scaled = value / lsb;
    if (scaled >= (double)maximum) {
        return maximum;
    }
    if (scaled <= (double)minimum) {
        return minimum;
    }
    return lround(scaled / (double)step) * step;
}

/* Current and power follow from the two voltages and the calibration (SBOS448G, equations 4 and 5).
 */
static void calculate(ina219_t *sensor)
{
    long current = (long)sensor->shunt_10uv * (long)sensor->calibration / 4096;
    long power = labs(current) * (long)sensor->bus_4mv / 5000;
    sensor->overflow = current > INT16_MAX || current < INT16_MIN || power > UINT16_MAX;
    sensor->current = (int16_t)(current > INT16_MAX   ? INT16_MAX
                                : current < INT16_MIN ? INT16_MIN
                                                      : current);
    sensor->power = (uint16_t)(power > UINT16_MAX ? UINT16_MAX : power);
}

/* A mean over a window, with the gain error and the noise of as many conversions as it held. */
static double mean_v(ina219_t *sensor, double sum_v_cycles, double cycles, double gain_error,
                     double noise_v)
{
    uint8_t setting = adc_setting(sensor);
    double samples = (setting & 8u) != 0 ? (double)(1u << (setting & 7u)) : 1.0;
    double mean = (1.0 + gain_error) * sum_v_cycles / cycles;
    return noise_v > 0.0 ? mean + electrics_noise_normal(&sensor->noise) * noise_v / sqrt(samples)
                         : mean;
}

/* The result of the conversion that ends now, in its register. */
static void take_result(ina219_t *sensor, const ina219_inputs_t *now, double cycles)
{
    long step = resolution_step(adc_setting(sensor));
    if (sensor->phase == INA219_CONVERTS_SHUNT) {
        long full_scale = 4000L << ((sensor->config >> 11) & 3u);
        double mean = mean_v(sensor, now->shunt_v_cycles - sensor->window_start.shunt_v_cycles,
                             cycles, sensor->shunt_gain_error, sensor->shunt_noise_v);
        sensor->shunt_10uv = (int16_t)quantised(mean, 10e-6, step, -full_scale, full_scale);
    } else {
        long full_scale = (sensor->config & 0x2000u) != 0 ? BUS_FULL_SCALE_32V : BUS_FULL_SCALE_16V;
        double mean = mean_v(sensor, now->bus_v_cycles - sensor->window_start.bus_v_cycles, cycles,
                             sensor->bus_gain_error, sensor->bus_noise_v);
        sensor->bus_4mv = (uint16_t)quantised(mean, 4e-3, step, 0, full_scale);
    }
}

void ina219_conversion_ended(ina219_t *sensor, const ina219_inputs_t *now)
{
    if (sensor->phase == INA219_IDLE) {
        return;
    }
    double cycles = (double)(now->cycle - sensor->window_start.cycle);
    uint8_t mode = mode_of(sensor);
    bool last_of_sequence = sensor->phase == INA219_CONVERTS_BUS || (mode & MODE_BUS) == 0;
    if (!sensor->stale && cycles > 0) {
        const bool shunt = sensor->phase == INA219_CONVERTS_SHUNT;
        if (!(shunt ? sensor->shunt_frozen : sensor->bus_frozen)) {
            take_result(sensor, now, cycles);
        }
        sensor->conversions++;
        if (last_of_sequence) {
            calculate(sensor);
            sensor->ready = true;
        }
    }
    if (!last_of_sequence) {
        begin_conversion(sensor, INA219_CONVERTS_BUS, now);
    } else if ((mode & MODE_CONTINUOUS) != 0) {
        begin_sequence(sensor, now);
    } else {
        begin_conversion(sensor, INA219_IDLE, now);
    }
}

bool ina219_begin(ina219_t *sensor, bool read)
{
    (void)read;
    sensor->byte_count = 0;
    return !sensor->absent;
}

static void write_register(ina219_t *sensor, uint16_t value, const ina219_inputs_t *now)
{
    if (sensor->pointer == INA219_REGISTER_CALIBRATION) {
        sensor->calibration = (uint16_t)(value & 0xFFFEu); /* FS0 is a void bit, always 0 */
    } else if (sensor->pointer == INA219_REGISTER_CONFIG) {
        if ((value & CONFIG_RESET_BIT) != 0) {
            ina219_power_on(sensor, now);
            return;
        }
        sensor->config = (uint16_t)(value & 0x3FFFu);
        if (mode_of(sensor) != 0 && mode_of(sensor) != 4) {
            sensor->ready = false;
        }
        begin_sequence(sensor, now);
    }
}

void ina219_write(ina219_t *sensor, uint8_t byte, const ina219_inputs_t *now)
{
    if (sensor->byte_count == 0) {
        sensor->pointer = byte;
    } else if (sensor->byte_count == 1) {
        sensor->shift = (uint16_t)(byte << 8);
    } else if (sensor->byte_count == 2) {
        write_register(sensor, (uint16_t)(sensor->shift | byte), now);
    }
    if (sensor->byte_count < 3) {
        sensor->byte_count++;
    }
}

static uint16_t register_value(ina219_t *sensor)
{
    switch (sensor->pointer) {
    case INA219_REGISTER_CONFIG:
        return sensor->config;
    case INA219_REGISTER_SHUNT:
        return (uint16_t)sensor->shunt_10uv;
    case INA219_REGISTER_BUS:
        return (uint16_t)((unsigned)sensor->bus_4mv << 3 | (sensor->ready ? 2u : 0u) |
                          (sensor->overflow ? 1u : 0u));
    case INA219_REGISTER_POWER:
        sensor->ready = false; /* the documented way to clear CNVR */
        return sensor->power;
    case INA219_REGISTER_CURRENT:
        return (uint16_t)sensor->current;
    case INA219_REGISTER_CALIBRATION:
        return sensor->calibration;
    default:
        return 0;
    }
}

uint8_t ina219_read(ina219_t *sensor)
{
    uint8_t byte = 0xFF;
    if (sensor->byte_count == 0) {
        sensor->shift = register_value(sensor);
        byte = (uint8_t)(sensor->shift >> 8);
    } else if (sensor->byte_count == 1) {
        byte = (uint8_t)sensor->shift;
    }
    if (sensor->byte_count < 3) {
        sensor->byte_count++;
    }
    return byte;
}
