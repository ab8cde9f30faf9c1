/* What it is for: a plant driven by the chip's controller with given settings, in one call.
 * What it owns: the walk from console lines to a controller, and the rows that come back.
 * What it never does: judge what it sees. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "chip_settings.h"
#include "loop.h"
#include "plant.h"

#define EXPORT __attribute__((visibility("default")))
#define ROW_S  1.0

EXPORT int chip_drive(const plant_t *plant, const char *lines, const int *pattern, size_t rows,
                      size_t on_rows, double *temperature_c, double *austenite, char *message,
                      size_t message_size);

/* The plant from where it is (cold), driven by the firmware's defaults with these console lines:
 * pattern[n] on for on_rows seconds, then off; rows[r] of temperature_c and austenite (n each) are
 * what it truly has after r seconds. 0 done; -1 a line is refused, -2 the controller refuses the
 * settings (message says which). */
int chip_drive(const plant_t *plant, const char *lines, const int *pattern, size_t rows,
               size_t on_rows, double *temperature_c, double *austenite, char *message,
               size_t message_size)
{
    settings_t settings;
    if (!chip_settings(&settings, plant_rows(plant), plant_columns(plant), lines, message,
                       message_size)) {
        return -1;
    }
    settings.controller.policy.policy = DRIVE_POLICY_PRECOMPENSATE;
    uint16_t bad = UINT16_MAX;
    loop_t *loop = loop_create(&settings.controller, plant, NULL, 1u, &bad);
    if (loop == NULL) {
        (void)snprintf(message, message_size, "%s",
                       bad == UINT16_MAX ? "settings" : parameter_row(bad).name);
        return -2;
    }
    /* It is told that they are cold, as by `model cold`: old and new settings begin knowing the
     * same. */
    controller_set_temperature(loop_controller(loop),
                               (int16_t)lround(plant_ambient_c(loop_plant(loop)) * 128.0));
    const int springs = plant_spring_count(plant);
    bool on[CONTROLLER_MAX_SPRINGS] = {false};
    for (int k = 0; k < springs; k++) {
        on[k] = pattern[k] != 0;
    }
    controller_set_pattern(loop_controller(loop), on);
    for (size_t r = 0; r < rows; r++) {
        if (r == on_rows) {
            controller_stop(loop_controller(loop));
        }
        loop_advance(loop, ROW_S);
        for (int k = 0; k < springs; k++) {
            const size_t cell = r * (size_t)springs + (size_t)k;
            temperature_c[cell] = plant_temperature_c(loop_plant(loop), k);
            austenite[cell] = plant_austenite(loop_plant(loop), k);
        }
    }
    loop_destroy(loop);
    return 0;
}
