/* What it is for: the chip's fixed point against the plant's double precision, over random
 * parameter sets and an hour of random drive each. What it owns: the drawing of sets and drives,
 * seeded. What it never does: choose sets by their outcome. */
#ifndef COMPARISON_H
#define COMPARISON_H

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    double rms_c; /* over all samples */
    double max_c;
    /* The law itself is discontinuous in one place: a spring that cools to within a hair of
     * martensite start either forgets how far it had been heated or does not. Where chip and
     * reference fell on different sides of that: */
    uint64_t parted;     /* samples since, in that spring and set, until both agree again: the heat
                          * that one gave and the other kept outlasts their phases */
    double max_parted_c; /* largest error in those; max_c is over the others */
    uint64_t samples;
    double highest_c;   /* temperature reached: the drive must have exercised the range */
    double transformed; /* share of samples with a phase between 0.02 and 0.98 */
} comparison_t;

/* `latent` false: sets without latent heat (the phase still runs; it moves no heat). */
comparison_t compare_fixed_with_double(uint32_t first_set, uint32_t sets, uint32_t steps,
                                       bool latent);

#endif
