/* A program on a bare processor: its console, its exit status, what an exception does, and whether the stack grew into the variables. */

#include "console.h"
#include "semihosting/semihosting.h"
#include "start/start.h"

#include <stdbool.h>
#include <stdint.h>

#define EXIT_EXCEPTION 99
#define EXIT_STACK 98
#define GUARD_WORDS 16U
#define GUARD 0xA5C3F10EUL

extern uint32_t hg_bss_end[]; /* behind the variables: the stack comes down to here */

/* Nothing tells a processor without memory protection that its stack is full. Every program here prints something first. */
static void put_guard(void)
{
    static bool there;
    for (size_t i = 0U; (!there) && (i < GUARD_WORDS); i++) {
        hg_bss_end[i] = GUARD;
    }
    there = true;
}

static bool guard_intact(void)
{
    bool intact = true;
    for (size_t i = 0U; i < GUARD_WORDS; i++) {
        intact = intact && (hg_bss_end[i] == GUARD);
    }
    return intact;
}

void console_write(const char *text, size_t length)
{
    put_guard();
    hg_semihosting_write(text, length);
}

_Noreturn void hg_stop(void)
{
    static const char text[] = "exception\n";
    console_write(text, sizeof(text) - 1U);
    hg_semihosting_exit(EXIT_EXCEPTION);
}

_Noreturn void hg_end(int status)
{
    static const char text[] = "the stack has grown into the variables\n";
    if (!guard_intact()) {
        console_write(text, sizeof(text) - 1U);
        hg_semihosting_exit(EXIT_STACK);
    }
    hg_semihosting_exit(status);
}
