#ifndef HOLD_TESTS_H
#define HOLD_TESTS_H

/* The tests of hold_tests.c, between UNITY_BEGIN and UNITY_END. */
void run_hold_tests(void);

#endif
