/* What it is for: one spring as it is, its sensor, and the estimator that reads it.
 * What it owns: the truth: temperature, phase (straight lines over temperature, as a rule not the
 * model's cosine), resistance. What it never does: decide, but for the plain heating and hold
 * below. */
#ifndef ONE_SPRING_H
#define ONE_SPRING_H

#include "../fakes/belief_inside.h"

#define TICK_S 0.02

typedef struct {
    double capacity_j_per_k, loss_w_per_k, latent_j;
    double martensite_ohm; /* at 20 degC */
    double ratio;          /* austenite over martensite, at one temperature */
    double rise_per_k;     /* of martensite */
    double apart_per_k;    /* austenite's, beyond that */
    double shift_k;        /* of all four transformation temperatures */
    double contact_ohm;    /* in series, read with it */
    double noise_v;        /* evenly within +- so much, of one reading of the voltage */
    double slow_noise_v;   /* standard deviation of a noise of it that lasts for a second */
    double temperature_c, austenite;
} truth_t;

extern truth_t truth;
extern spring_estimator_t estimator;
extern thermal_model_t model;
#define BELIEF spring_estimator_of(&estimator, 0)
#define LEARNT spring_estimator_learnt(&estimator, 0)
/* What nobody else may see. */
#define INSIDE (*belief_inside(&estimator, 0))

/* The declared spring at 20 degC, and an estimator that knows nothing of it. */
void power_comes_on(void);
/* And that it is told that the spring is cold. */
void begin_cold(void);

/* One tick with a current; true in a tick in which the estimator had its turn. */
bool tick(double current_a);
void ticks(double current_a, double seconds);
/* 3 A until it has transformed as far as the estimator knows, or so long; then a hold begins. */
void heat_then_hold(double most_s);
/* Current that holds it where the estimator has `margin_k` above martensite start, with the dither
 * of the drive. */
double hold_current_a(double margin_k);
void hold(double margin_k, double seconds);
double resistance_ohm(void);
double distance_k(void); /* true, to the true martensite start */

#endif
