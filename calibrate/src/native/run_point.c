/* What it is for: one point of a sweep: a plant under the controller, a pattern on and then off.
 * What it owns: the walk from console lines to a controller, and what is kept of each second.
 * What it never does: judge what it sees, or know what was varied. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "chip_settings.h"
#include "loop.h"
#include "plant.h"

#define EXPORT __attribute__((visibility("default")))
#define ROW_S  1.0

EXPORT int chip_run(const plant_t *plant, const char *lines, const int *pattern, double fan,
                    uint64_t seed, size_t rows, size_t on_rows, double *temperature_c,
                    double *austenite, double *power_w, double *sum_a, char *message,
                    size_t message_size);

/* The plant from where it is (cold, and the controller is told so), driven by the firmware's
 * defaults with these console lines: pattern[n] on for on_rows seconds, then off; the fan at 0..1
 * throughout; seed is the sensors' noise. Row r is what is true after r + 1 seconds:
 * temperature_c, austenite (n each), power_w and sum_a (one each). 0 done; -1 a line is refused,
 * -2 the controller refuses the settings (message says which). */
int chip_run(const plant_t *plant, const char *lines, const int *pattern, double fan, uint64_t seed,
             size_t rows, size_t on_rows, double *temperature_c, double *austenite, double *power_w,
             double *sum_a, char *message, size_t message_size)
{
    settings_t settings;
    if (!chip_settings(&settings, plant_rows(plant), plant_columns(plant), lines, message,
                       message_size)) {
        return -1;
    }
    uint16_t bad = UINT16_MAX;
    loop_t *loop = loop_create(&settings.controller, plant, NULL, seed, &bad);
    if (loop == NULL) {
        (void)snprintf(message, message_size, "%s",
                       bad == UINT16_MAX ? "settings" : parameter_row(bad).name);
        return -2;
    }
    controller_t *controller = loop_controller(loop);
    controller_set_temperature(controller,
                               (int16_t)lround(plant_ambient_c(loop_plant(loop)) * 128.0));
    const size_t springs = (size_t)plant_spring_count(plant);
    bool on[CONTROLLER_MAX_SPRINGS] = {false};
    for (size_t k = 0; k < springs; k++) {
        on[k] = pattern[k] != 0;
    }
    (void)controller_set_fan(controller, (uint8_t)lround(fan * 100.0));
    controller_set_pattern(controller, on);
    for (size_t r = 0; r < rows; r++) {
        if (r == on_rows) {
            controller_stop(controller);
        }
        loop_advance(loop, ROW_S);
        power_w[r] = 0.0;
        for (size_t k = 0; k < springs; k++) {
            const size_t cell = r * springs + k;
            temperature_c[cell] = plant_temperature_c(loop_plant(loop), (int)k);
            austenite[cell] = plant_austenite(loop_plant(loop), (int)k);
            power_w[r] += plant_power_w(loop_plant(loop), (int)k);
        }
        sum_a[r] = loop_sum_current_a(loop);
    }
    loop_destroy(loop);
    return 0;
}
