#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "console.h"

#define LINE_MAX_BYTES 256

static jmp_buf failed;

__attribute__((format(printf, 1, 0))) static void print(const char *format, va_list arguments)
{
    char text[LINE_MAX_BYTES];
    const int length = vsnprintf(text, sizeof(text), format, arguments);
    if (length > 0) {
        console_write(text, (length < LINE_MAX_BYTES) ? (size_t)length : (size_t)(LINE_MAX_BYTES - 1));
    }
}

void print_message(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    print(format, arguments);
    va_end(arguments);
}

void print_error(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    print(format, arguments);
    va_end(arguments);
}

_Noreturn void _fail(const char *file, int line)
{
    print_error("%s:%d: error: failure\n", file, line);
    longjmp(failed, 1);
}

void check_true(int good, const char *what, const char *file, int line)
{
    if (good == 0) {
        print_error("%s\n", what);
        _fail(file, line);
    }
}

/* Newlib's small printf knows no %jx. */
static void print_hex(uintmax_t x)
{
    print_error(" 0x%lx%08lx", (unsigned long)(x >> 32U), (unsigned long)(x & 0xFFFFFFFFU));
}

void check_integers(intmax_t a, intmax_t b, const char *file, int line)
{
    if (a != b) {
        print_error("not equal:");
        print_hex((uintmax_t)a);
        print_hex((uintmax_t)b);
        print_error("\n");
        _fail(file, line);
    }
}

void check_range(uintmax_t x, uintmax_t low, uintmax_t high, const char *file, int line)
{
    if ((x < low) || (x > high)) {
        print_error("not in range:");
        print_hex(x);
        print_error("\n");
        _fail(file, line);
    }
}

void check_bytes(const void *a, const void *b, size_t length, const char *file, int line)
{
    if (memcmp(a, b, length) != 0) {
        print_error("%lu bytes differ\n", (unsigned long)length);
        _fail(file, line);
    }
}

/* Nothing that changes between setjmp and longjmp lives in this function. */
static bool passes(const struct CMUnitTest *test, void **state)
{
    if (setjmp(failed) != 0) {
        return false;
    }
    test->test_func(state);
    return true;
}

int run_tests(const char *group, const struct CMUnitTest *tests, size_t count, CMFixtureFunction setup, CMFixtureFunction teardown)
{
    unsigned failures = 0U;
    void *state = NULL;
    if ((setup != NULL) && (setup(&state) != 0)) {
        print_error("%s: the set-up failed\n", group);
        return 1;
    }
    print_message("[==========] %s: Running %u test(s).\n", group, (unsigned)count);
    for (size_t i = 0U; i < count; i++) {
        print_message("[ RUN      ] %s\n", tests[i].name);
        const bool good = passes(&tests[i], &state);
        print_message(good ? "[       OK ] %s\n" : "[  FAILED  ] %s\n", tests[i].name);
        failures += good ? 0U : 1U;
    }
    print_message("[  PASSED  ] %u test(s).\n", (unsigned)count - failures);
    if ((teardown != NULL) && (teardown(&state) != 0)) {
        print_error("%s: the clean-up failed\n", group);
        return 1;
    }
    return (failures == 0U) ? 0 : 1;
}
