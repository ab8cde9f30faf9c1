/* What it is for: the paper's display as ONE set of numbers: loss, and coupling as a function of
 * pitch and fan.
 * What it owns: the spacing law and its three fitted numbers; the paper's twelve centre
 * temperatures.
 * What it never does: know what the camera saw when it fits: only COMSOL's six values went in. */
#ifndef PAPER_H
#define PAPER_H

#include "plant.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Where the hot springs are held, only conductance ratios count. The loss without the fan
 * is not fitted: it is the balance at 105 degC and 1.5 A, 0.493 W / 85 K. The other three are, by
 *     python3 bench/plant/fit_paper.py --library build/host/test/host_plant/libplant_shared.so
 * (least squares over COMSOL's six centre temperatures). Coupling is
 *     orthogonal = PAPER_ORTHOGONAL_5MM (5 mm / pitch)^PAPER_SPACING_EXPONENT, diagonal = half of
 * it, with or without the fan; the fan multiplies the loss. */
#define PAPER_LOSS_W_PER_K     0.0058
#define PAPER_FAN_FACTOR       1.8631
#define PAPER_ORTHOGONAL_5MM   3.9950e-4
#define PAPER_SPACING_EXPONENT 1.8204

double paper_loss_w_per_k(double fan);
/* pitch_mm > 0 */
double paper_orthogonal_w_per_k(double pitch_mm);
double paper_diagonal_w_per_k(double pitch_mm);

/* Gives a plant the loss and the couplings of that pitch; all else stays. PLANT_ERROR_RANGE if and
 * only if pitch_mm is not in 1..100. */
plant_status_t paper_configure(plant_t *plant, double pitch_mm);

typedef struct {
    const char *source; /* "comsol" or "camera" */
    double pitch_mm;
    double fan; /* 0 or 1 */
    double ambient_c;
    double t_hot_c;    /* the eight driven springs */
    double t_centre_c; /* the undriven centre */
} paper_case_t;

#define PAPER_CASE_COUNT 12
extern const paper_case_t paper_cases[PAPER_CASE_COUNT];

/* Centre temperature of a 3 x 3 plant in that case: hot springs held, centre undriven, steady. The
 * plant is configured, reset and run; effects that are on stay on. Fails as plant_settle does, or
 * PLANT_ERROR_SIZE if the plant is not of nine springs. */
plant_status_t paper_centre_c(plant_t *plant, const paper_case_t *which, double *centre_c);

#ifdef __cplusplus
}
#endif
#endif
