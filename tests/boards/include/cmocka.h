/** @file
 *  As much of CMocka as tests/contract/contract.c uses, for images without operating system. A failed check ends its test; so does skip(). */
#ifndef HULLGUARD_TESTS_BOARDS_CMOCKA_H
#define HULLGUARD_TESTS_BOARDS_CMOCKA_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

struct CMUnitTest {
    const char *name;
    void      (*test_func)(void **state);
    int       (*setup_func)(void **state);
    int       (*teardown_func)(void **state);
    void       *initial_state;
};

/** Print what failed and end the test. */
_Noreturn void check_failed(const char *what, uint32_t line);

/** End the test: this board cannot show what it is about. */
_Noreturn void check_skip(const char *why);

/** Run them all; the number that failed. */
int check_run(const char *name, const struct CMUnitTest *tests, size_t count);

#define CHECK(good, what)                          \
    do {                                           \
        if (!(good)) {                             \
            check_failed(what, (uint32_t)__LINE__); \
        }                                          \
    } while (false)
#define assert_true(a) CHECK(a, #a)
#define assert_int_equal(a, b) CHECK((int64_t)(a) == (int64_t)(b), #a " == " #b)
#define assert_in_range(a, low, high) CHECK(((a) >= (low)) && ((a) <= (high)), #a " in " #low " .. " #high)
#define assert_memory_equal(a, b, size) CHECK(memcmp(a, b, size) == 0, #a " like " #b)
#define cmocka_run_group_tests_name(name, tests, setup, teardown) check_run(name, tests, sizeof(tests) / sizeof((tests)[0]))

#endif
