/* What it is for: `TEST(what_it_shows) { ... }`: a test that runs because it is written.
 * What it owns: main, and the order: that of a program's files, and of the tests in each.
 * What it never does: leave one out, or need a list of them. */
#ifndef RUN_TESTS_H
#define RUN_TESTS_H

#include <stddef.h>

#include "unity.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct test test_t;
struct test {
    void (*run)(void);
    const char *name, *file;
    int line;
    test_t *next;
};

void add_test(test_t *test);

/* All that were added; returns what main does. A program without a main has one that does this. */
int run_tests(void);

#define TEST(what_it_shows)                                                                        \
    static void what_it_shows(void);                                                               \
    __attribute__((constructor)) static void add_##what_it_shows(void)                             \
    {                                                                                              \
        static test_t test = {what_it_shows, #what_it_shows, __FILE__, __LINE__, NULL};            \
        add_test(&test);                                                                           \
    }                                                                                              \
    static void what_it_shows(void)

/* What a test says beside its line where it fails: the row of its table, or whatever it is at. */
void row(size_t n);
void here(const char *format, ...) __attribute__((format(printf, 1, 2)));
void say_where(void); /* it is said: the line of a test that failed */

#define ROWS(table) (sizeof(table) / sizeof *(table))

#ifdef __cplusplus
}
#endif
#endif
