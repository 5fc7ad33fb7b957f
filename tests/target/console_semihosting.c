/* A program on a bare processor: its console, its exit status, and what an exception does. */

#include "console.h"
#include "semihosting/semihosting.h"
#include "start/start.h"

#define EXIT_EXCEPTION 99

void console_write(const char *text, size_t length)
{
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
    hg_semihosting_exit(status);
}
