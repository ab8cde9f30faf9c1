#include "run_tests.h"

#include <stdarg.h>
#include <stdio.h>

static test_t *first;
static test_t **last = &first;
static char where[200];

void add_test(test_t *test)
{
    *last = test;
    last = &test->next;
}

void here(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(where, sizeof where, format, arguments);
    va_end(arguments);
}

void row(size_t n)
{
    here("row %u", (unsigned)n);
}

void say_where(void)
{
    if (where[0] != '\0') {
        printf("    here: %s\n", where);
    }
}

int run_tests(void)
{
    UnityBegin(__FILE__);
    for (test_t *test = first; test != NULL; test = test->next) {
        Unity.TestFile = test->file;
        const UNITY_COUNTER_TYPE failures = Unity.TestFailures;
        where[0] = '\0';
        UnityDefaultTestRun(test->run, test->name, test->line);
        if (Unity.TestFailures > failures) {
            say_where();
        }
    }
    return UNITY_END();
}

__attribute__((weak)) void setUp(void) {}

__attribute__((weak)) void tearDown(void) {}

__attribute__((weak)) int main(void)
{
    return run_tests();
}
