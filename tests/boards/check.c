/* The runner behind include/cmocka.h: the compiler's own setjmp, the board's console. */
#include <cmocka.h>

#include "board.h"

enum { PASSED = 0, FAILED = 1, SKIPPED = 2 };

static void *out_of_test[5];
static volatile int outcome;

static _Noreturn void leave_test(int how)
{
    outcome = how;
    __builtin_longjmp(out_of_test, 1);
}

_Noreturn void check_failed(const char *what, uint32_t line)
{
    hg_board_say("line ");
    hg_board_say_number(line);
    hg_board_say(" does not hold: ");
    hg_board_say(what);
    hg_board_say("\n");
    leave_test(FAILED);
}

_Noreturn void check_skip(const char *why)
{
    hg_board_say(why);
    hg_board_say(": ");
    leave_test(SKIPPED);
}

static int run_one(const struct CMUnitTest *test)
{
    void *state = test->initial_state;

    outcome = PASSED;
    if (__builtin_setjmp(out_of_test) == 0) {
        (void)test->setup_func(&state);
        test->test_func(&state);
    }
    (void)test->teardown_func(&state);
    return outcome;
}

int check_run(const char *name, const struct CMUnitTest *tests, size_t count)
{
    static const char *const said[] = {"ok ", "FAILED ", "skipped "};
    uint32_t times[3] = {0U};

    for (size_t i = 0U; i < count; i++) {
        const int how = run_one(&tests[i]);
        hg_board_say(said[how]);
        hg_board_say(tests[i].name);
        hg_board_say("\n");
        times[how]++;
    }
    hg_board_say(name);
    for (size_t i = 0U; i < 3U; i++) {
        hg_board_say(" ");
        hg_board_say(said[i]);
        hg_board_say_number(times[i]);
    }
    hg_board_say("\n");
    return (int)times[FAILED];
}
