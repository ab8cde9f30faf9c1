/* Figures of the on-chip model: cycles and bytes on the Mega, and how far fixed point is from
 * double.
 *
 *   bench_thermal_model [--sets N] [--json FILE]      N parameter sets of an hour each, default 200
 */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "comparison.h"
#include "figures.h"

#define STEPS_AN_HOUR 36000u

#ifdef AVR_RUNNER
typedef struct {
    const char *name;
    const char *figure;
    const char *unit;
} counted_t;

static const counted_t counted[] = {
    {"step_typical",
     "thermal_model_step, 9 springs, 20 couplings, shared air, plate, phase at rest", "cycles"},
    {"step_nine_transforming", "the same, all nine springs transforming at once", "cycles"},
    {"step_worst", "the same, worst step of a whole loop (all nine turn round at once)", "cycles"},
    {"step_every_effect", "the same with radiation, rising loss and wake", "cycles"},
    {"set_fan", "thermal_model_set_fan, on a change", "cycles"},
    {"power_to_hold", "thermal_model_power_to_hold_uw", "cycles"},
    {"step_float", "the same network in float, without phase", "cycles"},
    {"ram_bytes", "thermal_model_t, 9 springs", "bytes"},
};

/* Adds what the runner says of one ELF. False if it fails. */
static bool count_cycles(const char *elf)
{
    char command[1024];
    snprintf(command, sizeof command, "'%s' '%s' 2>/dev/null", AVR_RUNNER, elf);
    FILE *pipe = popen(command, "r");
    if (pipe == NULL) {
        return false;
    }
    char line[256];
    while (fgets(line, sizeof line, pipe) != NULL) {
        char name[64];
        double least, most;
        int fields = sscanf(line, "%63s %lf %lf", name, &least, &most);
        for (size_t k = 0; fields >= 2 && k < sizeof counted / sizeof counted[0]; k++) {
            if (strcmp(name, counted[k].name) == 0) {
                figures_add(counted[k].figure, fields == 3 ? most : least, counted[k].unit, "");
            }
        }
    }
    return pclose(pipe) == 0;
}

/* Flash of a library as the linker would take it whole. */
static bool add_flash(const char *archive, const char *figure)
{
    char command[1024];
    snprintf(command, sizeof command, "avr-size -t '%s' 2>/dev/null | tail -1", archive);
    FILE *pipe = popen(command, "r");
    if (pipe == NULL) {
        return false;
    }
    double text = 0.0, data = 0.0;
    bool read = fscanf(pipe, "%lf %lf", &text, &data) == 2;
    if (pclose(pipe) != 0 || !read) {
        return false;
    }
    figures_add(figure, text + data, "bytes", "");
    return true;
}
#endif

int main(int argc, char **argv)
{
    const char *json = NULL;
    unsigned long sets = 200;
    for (int k = 1; k < argc; k += 2) {
        char *end = NULL;
        if (k + 1 < argc && strcmp(argv[k], "--json") == 0) {
            json = argv[k + 1];
        } else if (k + 1 < argc && strcmp(argv[k], "--sets") == 0 &&
                   (sets = strtoul(argv[k + 1], &end, 10)) > 0 && sets <= 100000 && *end == '\0') {
        } else {
            fprintf(stderr, "usage: %s [--sets 1..100000] [--json FILE]\n", argv[0]);
            return 2;
        }
    }
#ifdef AVR_RUNNER
    if (!count_cycles(THERMAL_MODEL_ELF) ||
        !add_flash(THERMAL_MODEL_ARCHIVE, "flash of lib/thermal_model, everything in it")) {
        fprintf(stderr,
                "the programs for the simulated Mega cannot be run: build the avr target\n");
        return 1;
    }
#else
    printf("without avr-gcc and libsimavr there are no cycle counts\n");
#endif
    for (int latent = 0; latent < 2; latent++) {
        comparison_t result =
            compare_fixed_with_double(0, (uint32_t)sets, STEPS_AN_HOUR, latent == 1);
        const char *what = latent == 1 ? "with latent heat" : "phase without latent heat";
        char figure[120];
        snprintf(figure, sizeof figure, "fixed point against double, %lu sets x 1 h, %s: rms", sets,
                 what);
        figures_add(figure, result.rms_c, "degC", "<= 0.05");
        snprintf(figure, sizeof figure, "fixed point against double, %lu sets x 1 h, %s: max", sets,
                 what);
        figures_add(figure, result.max_c, "degC", "<= 0.15");
        snprintf(figure, sizeof figure,
                 "largest error after the two remembered a turn differently, %s", what);
        figures_add(figure, result.max_parted_c, "degC", "");
        snprintf(figure, sizeof figure, "share of samples after that, %s", what);
        figures_add(figure, 1e6 * (double)result.parted / (double)result.samples, "ppm", "");
    }
    return json == NULL || figures_save(json, "build/host/bench/thermal_model/bench_thermal_model")
               ? 0
               : 1;
}
