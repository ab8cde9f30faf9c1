#include "figures.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define MOST 64

static struct {
    char figure[120];
    double value;
    char unit[24];
    char target[40];
} rows[MOST];
static int count;

const char *figures_json(int argc, char **argv, const char *program)
{
    if (argc == 3 && strcmp(argv[1], "--json") == 0) {
        return argv[2];
    }
    if (argc != 1) {
        const int help = argc == 2 && strcmp(argv[1], "--help") == 0;
        fprintf(help ? stdout : stderr, "usage: %s [--json FILE]\n", program);
        exit(help ? 0 : 2);
    }
    return NULL;
}

void figures_add(const char *figure, double value, const char *unit, const char *target)
{
    if (count == MOST) {
        fprintf(stderr, "figures: more than %d\n", MOST);
        exit(1);
    }
    (void)snprintf(rows[count].figure, sizeof rows[count].figure, "%s", figure);
    rows[count].value = value;
    (void)snprintf(rows[count].unit, sizeof rows[count].unit, "%s", unit);
    (void)snprintf(rows[count].target, sizeof rows[count].target, "%s", target);
    printf("%-76s %12.5g %-12s %s\n", rows[count].figure, value, unit, target);
    (void)fflush(stdout);
    count++;
}

double figures_cpu_s(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

bool figures_save(const char *path, const char *command)
{
    char unfinished[4096];
    if (snprintf(unfinished, sizeof unfinished, "%s.part", path) >= (int)sizeof unfinished) {
        fprintf(stderr, "%.40s...: the name is too long\n", path);
        return false;
    }
    FILE *file = fopen(unfinished, "w");
    if (file == NULL) {
        fprintf(stderr, "%s: %s\n", path, strerror(errno));
        return false;
    }
    (void)fputs("[\n", file);
    for (int k = 0; k < count; k++) {
        fprintf(file,
                "  {\"figure\": \"%s\", \"value\": %.10g, \"unit\": \"%s\", \"target\": \"%s\", "
                "\"command\": \"%s\"}%s\n",
                rows[k].figure, rows[k].value, rows[k].unit, rows[k].target, command,
                k + 1 < count ? "," : "");
    }
    (void)fputs("]\n", file);
    bool written = ferror(file) == 0;
    written = fclose(file) == 0 && written;
    if (!written || rename(unfinished, path) != 0) {
        fprintf(stderr, "%s: %s\n", path, strerror(errno));
        (void)remove(unfinished);
        return false;
    }
    return true;
}
