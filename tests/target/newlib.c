/* What newlib asks of a board: memory for printing numbers with a point, and what to do where it gives up. Its own ways would bring all of
 * stdio with them. */

#include <errno.h>
#include <stddef.h>
#include <stdint.h>

#include "start/start.h"

#define HEAP_MAX 2048 /* bytes */

void *_sbrk(ptrdiff_t more);
_Noreturn void abort(void);
_Noreturn void __assert_func(const char *file, int line, const char *function, const char *expression);

void *_sbrk(ptrdiff_t more)
{
    static uint64_t heap[HEAP_MAX / sizeof(uint64_t)];
    static ptrdiff_t used;
    if ((more > ((ptrdiff_t)HEAP_MAX - used)) || (more < -used)) {
        errno = ENOMEM;
        return (void *)UINTPTR_MAX;
    }
    used += more;
    return (uint8_t *)heap + (used - more);
}

_Noreturn void abort(void)
{
    hg_stop();
}

_Noreturn void __assert_func(const char *file, int line, const char *function, const char *expression)
{
    (void)file;
    (void)line;
    (void)function;
    (void)expression;
    hg_stop();
}
