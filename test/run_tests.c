#include "run_tests.h"

static test_t *first;
static test_t **last = &first;

void add_test(test_t *test)
{
    *last = test;
    last = &test->next;
}

int run_tests(void)
{
    UnityBegin(__FILE__);
    for (test_t *test = first; test != NULL; test = test->next) {
        Unity.TestFile = test->file;
        UnityDefaultTestRun(test->run, test->name, test->line);
    }
    return UNITY_END();
}

__attribute__((weak)) void setUp(void) {}

__attribute__((weak)) void tearDown(void) {}

__attribute__((weak)) int main(void)
{
    return run_tests();
}
