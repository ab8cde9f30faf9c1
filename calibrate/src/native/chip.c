/* What it is for: the on-chip model and the settings table, in calls that Python can make.
 * What it owns: the walk from a plant to console lines, and a whole log through the on-chip model.
 * What it never does: hold a formula or a setting's name of its own. */
#include <math.h>
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

EXPORT int chip_export(const plant_t *plant, int row, int column, int rows, int columns, char *text,
                       size_t text_size, char *message, size_t message_size);
EXPORT int chip_simulate(const char *lines, int array_rows, int array_columns, size_t rows,
                         const double *time_s, int mode, const double *drive,
                         const double *command_power_w, const double *fan, const double *ambient_c,
                         const double *first_c, double *temperature_c, double *austenite,
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

/* Console lines `$name=value` of every setting of the thermal model that these springs of the plant
 * map to (chip_mapping_from_part); 0 done, else chip_mapping's status, or -10 where the text is too
 * small. message as chip_mapping_from_plant. */
int chip_export(const plant_t *plant, int row, int column, int rows, int columns, char *text,
                size_t text_size, char *message, size_t message_size)
{
    settings_t settings;
    settings_default(&settings);
    const chip_mapping_status_t status = chip_mapping_from_part(
        plant, row, column, rows, columns, &settings.controller.model, message, message_size);
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

/* A log on its way through the model: what the rows say, and where the model stands between them.
 */
typedef struct {
    thermal_model_t model;
    size_t springs;
    size_t rows;
    const double *time_s;
    plant_drive_mode_t mode;
    const double *drive;
    const double *command_power_w;
    const double *fan;
    const double *ambient_c;
    double step_s;
    long long steps;
    size_t row; /* whose inputs hold */
    double before_c[THERMAL_MODEL_MAX_SPRINGS];
    double after_c[THERMAL_MODEL_MAX_SPRINGS];
} replay_t;

static int16_t c7(double temperature_c)
{
    return (int16_t)lround(fmin(fmax(temperature_c, -40.0), 215.0) * 128.0);
}

/* As the board would know it: v x i; i^2 R of the model's own phase where no voltage was logged; a
 * share of the command's power where only that was. */
static double power_w(const replay_t *replay, size_t k)
{
    const double drive = replay->drive[replay->row * replay->springs + k];
    switch (replay->mode) {
    case PLANT_DRIVE_POWER:
        return drive;
    case PLANT_DRIVE_CURRENT:
        return drive * drive * thermal_model_resistance_uohm(&replay->model, (uint8_t)k) * 1e-6;
    default:
        return drive * replay->command_power_w[k];
    }
}

static void read_temperatures(const replay_t *replay, double *to)
{
    for (size_t k = 0; k < replay->springs; k++) {
        to[k] = thermal_model_temperature_c7(&replay->model, (uint8_t)k) / 128.0;
    }
}

/* One step of the chip with the mean power of the rows that it covers. */
static void step(replay_t *replay)
{
    const double begin = (double)replay->steps * replay->step_s;
    const double end = begin + replay->step_s;
    double energy_j[THERMAL_MODEL_MAX_SPRINGS] = {0.0};
    for (double from = begin; from < end - 1e-12;) {
        while (replay->row + 1 < replay->rows &&
               replay->time_s[replay->row + 1] - replay->time_s[0] <= from + 1e-12) {
            replay->row++;
        }
        double to = end;
        if (replay->row + 1 < replay->rows) {
            to = fmin(end, replay->time_s[replay->row + 1] - replay->time_s[0]);
        }
        for (size_t k = 0; k < replay->springs; k++) {
            energy_j[k] += power_w(replay, k) * (to - from);
        }
        from = to;
    }
    thermal_model_set_ambient(&replay->model, c7(replay->ambient_c[replay->row]));
    thermal_model_set_fan(&replay->model, (uint8_t)lround(replay->fan[replay->row] * 100.0));
    uint32_t power_uw[THERMAL_MODEL_MAX_SPRINGS] = {0};
    for (size_t k = 0; k < replay->springs; k++) {
        power_uw[k] = (uint32_t)llround(fmin(fmax(energy_j[k] / replay->step_s * 1e6, 0.0), 4e9));
    }
    memcpy(replay->before_c, replay->after_c, sizeof replay->before_c);
    thermal_model_step(&replay->model, power_uw);
    read_temperatures(replay, replay->after_c);
    replay->steps++;
}

/* A log through the on-chip model as console lines over the firmware's defaults set it: drive[rows
 * * n] (W, A or 0..1 by mode, and command_power_w[n]) holds from its row to the next; first_c[n]
 * starts it; temperature_c and austenite (rows * n) out, temperatures between two steps
 * interpolated. 0 done; -1 a line is refused, -2 the model refuses the settings (message says
 * which). */
int chip_simulate(const char *lines, int array_rows, int array_columns, size_t rows,
                  const double *time_s, int mode, const double *drive,
                  const double *command_power_w, const double *fan, const double *ambient_c,
                  const double *first_c, double *temperature_c, double *austenite, char *message,
                  size_t message_size)
{
    settings_t settings;
    if (!chip_settings(&settings, array_rows, array_columns, lines, message, message_size)) {
        return -1;
    }
    const thermal_model_parameters_t *parameters = &settings.controller.model;
    static _Thread_local replay_t replay;
    replay = (replay_t){.springs = (size_t)parameters->rows * parameters->columns,
                        .rows = rows,
                        .time_s = time_s,
                        .mode = (plant_drive_mode_t)mode,
                        .drive = drive,
                        .command_power_w = command_power_w,
                        .fan = fan,
                        .ambient_c = ambient_c,
                        .step_s = 1e-3 * parameters->step_ms};
    uint16_t bad = 0;
    if (thermal_model_init(&replay.model, parameters, &bad) != THERMAL_MODEL_OK) {
        (void)snprintf(message, message_size, "%s", parameter_row(bad).name);
        return -2;
    }
    thermal_model_set_ambient(&replay.model, c7(ambient_c[0]));
    thermal_model_reset(&replay.model, c7(ambient_c[0]));
    for (size_t k = 0; k < replay.springs; k++) {
        thermal_model_set_temperature(&replay.model, (uint8_t)k, c7(first_c[k]));
    }
    read_temperatures(&replay, replay.after_c);
    for (size_t row = 0; row < rows; row++) {
        const double now_s = time_s[row] - time_s[0];
        while ((double)replay.steps * replay.step_s <= now_s + 1e-9) {
            step(&replay);
        }
        /* The step that covers the row: from steps - 1 to steps. */
        const double fraction = now_s / replay.step_s - (double)(replay.steps - 1);
        for (size_t k = 0; k < replay.springs; k++) {
            const size_t cell = row * replay.springs + k;
            temperature_c[cell] =
                replay.before_c[k] + fraction * (replay.after_c[k] - replay.before_c[k]);
            austenite[cell] = thermal_model_austenite(&replay.model, (uint8_t)k) /
                              (double)THERMAL_MODEL_AUSTENITE_FULL;
        }
    }
    return 0;
}
