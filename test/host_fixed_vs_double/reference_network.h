/* What it is for: the network of thermal_model.h in double precision, finely integrated, to
 * measure the chip's form against.
 * What it owns: its own equations, written from docs and papers, with the true cosine; nothing
 * shared with lib/.
 * What it never does: fixed point. */
#ifndef REFERENCE_NETWORK_H
#define REFERENCE_NETWORK_H

#include "thermal_model.h"

#define REFERENCE_MAX 64

typedef struct {
    double enthalpy_k; /* temperature plus latent heat over heat capacity */
    double temperature_c;
    double turn_c;  /* furthest point of the branch it is on */
    double shift_c; /* of all four transformation temperatures */
    double amplitude;
    int heating; /* branch: 1 austenite = 1 - amplitude S, 0 austenite = amplitude S */
} reference_spring_t;

typedef struct {
    thermal_model_parameters_t p;
    int n;
    double ambient_c;
    double fan; /* 0..1 */
    double air_c;
    double plate_c;
    reference_spring_t spring[REFERENCE_MAX];
} reference_network_t;

void reference_reset(reference_network_t *network, const thermal_model_parameters_t *parameters,
                     double temperature_c);
/* Advances by seconds in `substeps` midpoint steps with the power held. */
void reference_advance(reference_network_t *network, const double power_w[], double seconds,
                       int substeps);
double reference_austenite(const reference_network_t *network, int spring);

#endif
