/* What it is for: small seeded random numbers, the same on every machine.
 * What it owns: one 64-bit state (Vigna's splitmix64).
 * What it never does: read a clock; nor pass for cryptography. */
#ifndef WORLDS_RANDOM_H
#define WORLDS_RANDOM_H

#include <math.h>
#include <stdint.h>

typedef struct {
    uint64_t state;
} random_t;

/* Neighbouring seeds and streams give unrelated sequences. */
static inline random_t random_seeded(uint64_t seed, uint64_t stream)
{
    return (random_t){seed * 0x9E3779B97F4A7C15u ^ (stream + 1u) * 0xD1B54A32D192ED03u};
}

static inline uint64_t random_bits(random_t *random)
{
    uint64_t z = random->state += 0x9E3779B97F4A7C15u;
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
    z = (z ^ z >> 27) * 0x94D049BB133111EBu;
    return z ^ z >> 31;
}

/* low <= x < high */
static inline double random_uniform(random_t *random, double low, double high)
{
    return low + (high - low) * ((double)(random_bits(random) >> 11) * 0x1p-53);
}

/* Mean 0, standard deviation 1: the sum of four uniforms, as good as normal out to 2.5, and never
 * beyond 3.47: what a sensor's noise needs, without a logarithm. */
static inline double random_noise(random_t *random)
{
    uint64_t bits = random_bits(random);
    double sum = (double)(bits & 0xFFFFu) + (double)(bits >> 16 & 0xFFFFu) +
                 (double)(bits >> 32 & 0xFFFFu) + (double)(bits >> 48);
    return (sum * 0x1p-16 - 2.0) * 1.7320508075688772; /* variance of four uniforms: 1/3 */
}

/* Time to the next event of a Poisson process. */
static inline double random_interval_s(random_t *random, double mean_s)
{
    return -mean_s * log(1.0 - random_uniform(random, 0.0, 1.0));
}

#endif
