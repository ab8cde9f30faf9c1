#include "chip_settings.h"

#include <stdio.h>
#include <string.h>

#define LINE_SIZE 96u

static bool assign(settings_t *settings, char *line)
{
    char *value = strchr(line, '=');
    if (line[0] != '$' || value == NULL) {
        return line[0] == '#' || line[0] == '\0';
    }
    *value = '\0';
    return settings_assign(settings, line + 1, value + 1) == SETTINGS_OK;
}

bool chip_settings(settings_t *settings, int rows, int columns, const char *lines, char *message,
                   size_t size)
{
    settings_default(settings);
    if (rows < 1 || columns < 1 || rows > CONTROLLER_MAX_SPRINGS ||
        columns > CONTROLLER_MAX_SPRINGS / rows) {
        (void)snprintf(message, size, "%d x %d springs: a board has %d", rows, columns,
                       CONTROLLER_MAX_SPRINGS);
        return false;
    }
    settings->controller.model.rows = (uint8_t)rows;
    settings->controller.model.columns = (uint8_t)columns;
    for (const char *at = lines; *at != '\0';) {
        const size_t length = strcspn(at, "\n");
        char line[LINE_SIZE];
        (void)snprintf(line, sizeof line, "%.*s", (int)length, at);
        if (length >= sizeof line || !assign(settings, line)) {
            (void)snprintf(message, size, "%.*s", (int)length, at);
            return false;
        }
        at += length + (at[length] == '\n' ? 1u : 0u);
    }
    const thermal_model_parameters_t *model = &settings->controller.model;
    if (model->rows != rows || model->columns != columns) {
        (void)snprintf(message, size, "$rows=%d $columns=%d: the array is %d x %d", model->rows,
                       model->columns, rows, columns);
        return false;
    }
    return true;
}
