/** @file
 *  Functions whose instructions one can count by hand, and one whose stack: what counting and stack bounds are tested with. Cortex-M. */

#include "console.h"

#include <stdint.h>

void known_straight(void);
void known_loop(void);
void known_outer(void);
void known_tail(void);
void known_begins_with_loop(void);
void known_jumps_before_next(void);
void known_next(void);
void known_calls_next(void);

/* clang-format off */
__attribute__((naked, noinline)) void known_straight(void)          /* 11 */
{
    __asm__ volatile("nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop\n bx lr");
}

__attribute__((naked, noinline)) void known_loop(void)              /* 1 + 5 x 2 + 1 = 12 */
{
    __asm__ volatile("movs r0, #5\n 1: subs r0, r0, #1\n bne 1b\n bx lr");
}

__attribute__((naked, noinline)) void known_outer(void)             /* 5, and 11 + 12 + 11 of callees */
{
    __asm__ volatile("push {r4, lr}\n bl known_straight\n bl known_loop\n bl known_straight\n pop {r4, pc}");
}

__attribute__((naked, noinline)) void known_tail(void)              /* 2, and 11 of who returns for it */
{
    __asm__ volatile("nop\n b known_straight");
}

__attribute__((naked, noinline)) void known_begins_with_loop(void)  /* 1 call of 4 x 2 + 1 = 9, not 4 calls */
{
    __asm__ volatile("subs r0, r0, #1\n bne known_begins_with_loop\n bx lr");
}

__attribute__((naked, noinline)) void known_jumps_before_next(void) /* 3, and 3 + 2: behind its jump stands a function, and no place to return to */
{
    __asm__ volatile("nop\n nop\n b.w known_calls_next");
}

__attribute__((naked, noinline)) void known_next(void)              /* 2 */
{
    __asm__ volatile("nop\n bx lr");
}

__attribute__((naked, noinline)) void known_calls_next(void)        /* 3, and 2 */
{
    __asm__ volatile("push {r4, lr}\n bl known_next\n pop {r4, pc}");
}
/* clang-format on */

int main(void)
{
    for (unsigned k = 0U; k < 3U; k++) {
        known_outer();
        known_tail();
    }
    __asm__ volatile("movs r0, #4\n bl known_begins_with_loop" ::: "r0", "r1", "r2", "r3", "r12", "lr", "cc", "memory");
    known_jumps_before_next();
    console_write("known ends\n", 11U);
    return 0;
}
