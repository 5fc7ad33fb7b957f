/** @file
 *  The part of CMocka that the unit tests use, for processors for which there is none: the same sources run there unchanged. As CMocka's own
 *  header it wants setjmp.h, stdarg.h, stddef.h and stdint.h before it. A test that uses more of CMocka does not compile here. */
#ifndef HULLGUARD_TESTS_TARGET_CMOCKA_H
#define HULLGUARD_TESTS_TARGET_CMOCKA_H

typedef void (*CMUnitTestFunction)(void **state);
typedef int (*CMFixtureFunction)(void **state);

struct CMUnitTest {
    const char        *name;
    CMUnitTestFunction test_func;
};

#define cmocka_unit_test(function) {#function, (function)}

#define cmocka_run_group_tests(tests, setup, teardown) run_tests(#tests, (tests), sizeof(tests) / sizeof((tests)[0]), (setup), (teardown))

/** @param[in] setup, teardown  before the first test and behind the last one; null: nothing. One that does not answer 0 fails the group. */
int run_tests(const char *group, const struct CMUnitTest *tests, size_t count, CMFixtureFunction setup, CMFixtureFunction teardown);

void print_message(const char *format, ...) __attribute__((format(printf, 1, 2)));
void print_error(const char *format, ...) __attribute__((format(printf, 1, 2)));

_Noreturn void _fail(const char *file, int line);
void check_true(int good, const char *what, const char *file, int line);
void check_integers(intmax_t a, intmax_t b, const char *file, int line);
void check_range(uintmax_t x, uintmax_t low, uintmax_t high, const char *file, int line);
void check_bytes(const void *a, const void *b, size_t length, const char *file, int line);

#define fail() _fail(__FILE__, __LINE__)
#define assert_true(x) check_true((x) ? 1 : 0, #x, __FILE__, __LINE__)
#define assert_false(x) check_true((x) ? 0 : 1, "not " #x, __FILE__, __LINE__)
#define assert_int_equal(a, b) check_integers((intmax_t)(a), (intmax_t)(b), __FILE__, __LINE__)
#define assert_ptr_equal(a, b) check_integers((intmax_t)(uintptr_t)(a), (intmax_t)(uintptr_t)(b), __FILE__, __LINE__)
#define assert_in_range(x, low, high) check_range((uintmax_t)(x), (uintmax_t)(low), (uintmax_t)(high), __FILE__, __LINE__)
#define assert_memory_equal(a, b, length) check_bytes((a), (b), (length), __FILE__, __LINE__)

#endif
