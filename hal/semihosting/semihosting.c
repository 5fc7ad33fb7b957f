#include "semihosting/semihosting.h"

#include <stdint.h>

/* "Semihosting for AArch32 and AArch64", operations; RISC-V has the same. */
#define SYS_WRITE0 0x04U
#define SYS_EXIT_EXTENDED 0x20U
#define APPLICATION_EXIT 0x20026U
#define PIECE 64U

/* Not a leaf for the inliner: the three instructions of RISC-V must lie in one page, and one place is easier to set a breakpoint at. */
#if defined(__riscv)
__attribute__((noinline)) static void call(uint32_t operation, const void *argument)
{
    register uint32_t a0 __asm__("a0") = operation;
    register const void *a1 __asm__("a1") = argument;
    __asm__ volatile(".option push\n\t.option norvc\n\t.balign 16\n\tslli x0, x0, 0x1f\n\tebreak\n\tsrai x0, x0, 7\n\t.option pop"
                     : "+r"(a0) : "r"(a1) : "memory");
}
#elif defined(__ARM_ARCH_PROFILE) && (__ARM_ARCH_PROFILE == 'M')
__attribute__((noinline)) static void call(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
}
#elif defined(__arm__)
__attribute__((noinline)) static void call(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("svc 0x123456" : "+r"(r0) : "r"(r1) : "memory", "lr");
}
#else
#error "no semihosting on this processor"
#endif

void hg_semihosting_write(const char *text, size_t length)
{
    char piece[PIECE + 1U];
    size_t n = 0U;

    for (size_t i = 0U; i < length; i++) {
        piece[n] = text[i];
        n++;
        if ((n == PIECE) || ((i + 1U) == length)) {
            piece[n] = '\0';
            call(SYS_WRITE0, piece);
            n = 0U;
        }
    }
}

_Noreturn void hg_semihosting_exit(int status)
{
    const uint32_t reason[2] = {APPLICATION_EXIT, (uint32_t)status};

    for (;;) {
        call(SYS_EXIT_EXTENDED, reason);
    }
}
