/* What it is for: the estimator's rules one at a time, from beliefs that are written down.
 * What it owns: tables of what must come of them.
 * What it never does: live a spring's life (test_spring_estimator.c does). */
#ifndef RULES_H
#define RULES_H

void run_rules(void);
void run_law(void);
void run_watch(void);

#endif
