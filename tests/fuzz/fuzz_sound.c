/* Soundness of the whole node: the adversary of tests/unit/test_adversary.c, all of whose decisions come from the input instead of a random number. Before the
 * plant is faulty no alarm may be confirmed; when the link is well again, a fault is found. */
#include "fuzz.h"

#include <math.h>

/* What that file takes from CMocka and support.h, in terms of invariants. */
#define HULLGUARD_TESTS_SUPPORT_H
#define COUNT(array) (sizeof(array) / sizeof((array)[0]))
#define R(x) ((hg_real)(x))
#define CANARY R(-12345.5)
#define CANARY_CODE 0x5A5A5A5A
#define assert_true(holds) require(61U, (holds))
#define assert_status(expected, call) require(61U, (call) == (expected))
#define assert_int_equal(expected, actual) require(61U, (int)(expected) == (int)(actual))
#define assert_codes_untouched(x, n) require(62U, ((n) == 1U) && (*(x) == CANARY_CODE))
#define assert_untouched(x, n) require(62U, ((n) == 1U) && (*(x) <= CANARY) && (*(x) >= CANARY))
#define print_error(...) ((void)fprintf(stderr, __VA_ARGS__))
#define fail() violated(60U, "no alarm is confirmed while the plant is healthy", __FILE__, __LINE__)
#define seed_of_run(usual) (usual)
struct CMUnitTest {
    void (*run)(void **state);
};
#define cmocka_unit_test(name) {name}
#define cmocka_run_group_tests(tests, up, down) ((tests)[0].run == NULL)

static source input;

/* The next bytes of the input; behind its end the generator of support.h. */
static uint32_t draw(uint32_t *state)
{
    uint32_t x = (*state == 0U) ? 0x9E3779B9U : *state;
    x ^= x << 13U;
    x ^= x >> 17U;
    x ^= x << 5U;
    *state = x;
    return more(&input) ? take16(&input) : x;
}

static int32_t draw_between(uint32_t *state, int32_t low, int32_t high)
{
    const int64_t span = ((int64_t)high - (int64_t)low) + 1;
    return (int32_t)((int64_t)low + ((int64_t)draw(state) % span));
}

static void arm(hg_real *x, size_t n)
{
    for (size_t i = 0U; i < n; i++) {
        x[i] = CANARY;
    }
}

static void arm_codes(int32_t *x, size_t n)
{
    for (size_t i = 0U; i < n; i++) {
        x[i] = CANARY_CODE;
    }
}

#define main adversary_main
int adversary_main(void);
#include "../unit/test_adversary.c"
#undef main

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    input = (source){.data = data, .left = size};
    const uint8_t link = take_below(&input, COUNT(kinds));
    const uint8_t how = take8(&input);
    against(&kinds[link], 1U + (how >> 1U), (link >= STAMPED) || ((how & 1U) != 0U));
    return 0;
}
