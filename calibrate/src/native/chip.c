/* What it is for: the on-chip model and the settings table, in calls that Python can make.
 * What it owns: the walk from a plant to console lines, and a whole log through the on-chip model.
 * What it never does: hold a formula or a setting's name of its own. */
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "chip_mapping.h"
#include "chip_settings.h"
#include "plant.h"
#include "settings.h"
#include "text.h"
#include "thermal_model.h"

#define EXPORT __attribute__((visibility("default")))

EXPORT int chip_export(const plant_t *plant, char *text, size_t text_size, char *message,
                       size_t message_size);
EXPORT int chip_simulate(const char *lines, int array_rows, int array_columns, size_t rows,
                         const double *time_s, const double *power_w, const double *fan,
                         const double *ambient_c, const double *first_c, double *temperature_c,
                         char *message, size_t message_size);

static bool append(char *text, size_t size, size_t *used, const char *line)
{
    const size_t length = strlen(line);
    if (*used + length + 1 > size) {
        return false;
    }
    memcpy(text + *used, line, length + 1);
    *used += length;
    return true;
}

/* Console lines `$name=value` of every setting of the thermal model that this plant maps to; 0
 * done, else chip_mapping's status, or -10 where the text is too small. message as
 * chip_mapping_from_plant. */
int chip_export(const plant_t *plant, char *text, size_t text_size, char *message,
                size_t message_size)
{
    settings_t settings;
    settings_default(&settings);
    const chip_mapping_status_t status =
        chip_mapping_from_plant(plant, &settings.controller.model, message, message_size);
    if (status != CHIP_MAPPING_OK) {
        return (int)status;
    }
    const size_t springs =
        (size_t)settings.controller.model.rows * settings.controller.model.columns;
    size_t used = 0;
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        const parameter_row_t row = parameter_row(k);
        if (row.part != PARAMETER_PART_MODEL) {
            continue;
        }
        for (uint8_t element = 0; element < row.count; element++) {
            if (row.count > 1 && element >= springs) {
                break;
            }
            char value[TEXT_DECIMAL_SIZE];
            char name[SETTINGS_NAME_SIZE];
            char line[SETTINGS_NAME_SIZE + TEXT_DECIMAL_SIZE + 8];
            (void)text_format_decimal(settings_get(&settings, k, element), row.decimals, value);
            settings_name(k, element, name);
            (void)snprintf(line, sizeof line, "$%s=%s\n", name, value);
            if (!append(text, text_size, &used, line)) {
                return -10;
            }
        }
    }
    return 0;
}

/* A log through the on-chip model as console lines over the firmware's defaults set it:
 * power_w[rows * n] holds from its row to the next; first_c[n] starts it; temperature_c[rows * n]
 * out. 0 done; -1 a line is refused, -2 the model refuses the settings (message says which). */
int chip_simulate(const char *lines, int array_rows, int array_columns, size_t rows,
                  const double *time_s, const double *power_w, const double *fan,
                  const double *ambient_c, const double *first_c, double *temperature_c,
                  char *message, size_t message_size)
{
    settings_t settings;
    if (!chip_settings(&settings, array_rows, array_columns, lines, message, message_size)) {
        return -1;
    }
    const thermal_model_parameters_t *parameters = &settings.controller.model;
    static _Thread_local thermal_model_t model;
    uint16_t bad = 0;
    if (thermal_model_init(&model, parameters, &bad) != THERMAL_MODEL_OK) {
        (void)snprintf(message, message_size, "%s", parameter_row(bad).name);
        return -2;
    }
    const size_t n = (size_t)parameters->rows * parameters->columns;
    const double step_s = 1e-3 * parameters->step_ms;
    thermal_model_set_ambient(&model, (int16_t)(ambient_c[0] * 128.0));
    thermal_model_reset(&model, (int16_t)(ambient_c[0] * 128.0));
    for (size_t k = 0; k < n; k++) {
        thermal_model_set_temperature(&model, (uint8_t)k, (int16_t)(first_c[k] * 128.0));
    }
    double done_s = time_s[0];
    for (size_t row = 0; row < rows; row++) {
        for (size_t k = 0; k < n; k++) {
            temperature_c[row * n + k] = thermal_model_temperature_c7(&model, (uint8_t)k) / 128.0;
        }
        if (row + 1 == rows) {
            break;
        }
        uint32_t power_uw[THERMAL_MODEL_MAX_SPRINGS] = {0};
        for (size_t k = 0; k < n; k++) {
            const double power = power_w[row * n + k];
            power_uw[k] = power > 0.0 ? (uint32_t)(power * 1e6 + 0.5) : 0u;
        }
        thermal_model_set_ambient(&model, (int16_t)(ambient_c[row] * 128.0));
        thermal_model_set_fan(&model, (uint8_t)(fan[row] * 100.0 + 0.5));
        while (done_s + 0.5 * step_s < time_s[row + 1]) {
            thermal_model_step(&model, power_uw);
            done_s += step_s;
        }
    }
    return 0;
}
