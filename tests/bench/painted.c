/** @file
 *  How much stack the program of drive.c really takes: paints the stack, runs it, and looks how far the paint is gone. Prints bytes, in hexadecimal,
 *  of all that is below this main. */

#include "console.h"

#include <stdint.h>

#define BELOW 64U    /* bytes under this frame that painting itself may use */
#define PAINT 0xB5D36C1AUL
#define WORDS 1024U

extern uint32_t hg_bss_end[];
int drive_main(void);

int main(void)
{
    uint32_t *const top = (uint32_t *)(((uintptr_t)__builtin_frame_address(0) - BELOW) & ~(uintptr_t)3U);
    uint32_t *low = &top[-(int)WORDS];
    char text[] = "stack 0000\n";
    if (low <= hg_bss_end) {
        return 1;
    }
    for (uint32_t *p = low; p < top; p++) {
        *p = PAINT;
    }
    const int status = drive_main();
    while ((low < top) && (*low == PAINT)) {
        low++;
    }
    const uintptr_t used = (uintptr_t)__builtin_frame_address(0) - (uintptr_t)low;
    for (unsigned i = 0U; i < 4U; i++) {
        text[6U + i] = "0123456789abcdef"[(used >> (12U - (4U * i))) & 15U];
    }
    console_write(text, sizeof(text) - 1U);
    return status;
}
