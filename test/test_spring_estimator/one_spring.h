/* What it is for: one spring that takes up a tenth more heat than is declared, its sensor, and the
 * estimator that reads it. What it owns: the truth: a model of its own. What it never does: judge
 * what is believed (that is test/worlds' and host_drive's), or decide, but for the plain heating
 * and hold below. */
#ifndef ONE_SPRING_H
#define ONE_SPRING_H

#include "../fakes/belief_inside.h"

#define TICK_S 0.02

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

/* One tick with a current. */
void tick(double current_a);
void ticks(double current_a, double seconds);
/* 3 A until it has transformed as far as the estimator knows, or so long; then a hold begins. */
void heat_then_hold(double most_s);
/* Current that holds it where the estimator has `margin_k` above martensite start, with the dither
 * of the drive. */
double hold_current_a(double margin_k);
void hold(double margin_k, double seconds);

#endif
