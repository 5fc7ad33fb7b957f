#include "start/start.h"

#include <stdint.h>

/* Places that image.ld defines. */
extern uint32_t hg_data_begin[];
extern uint32_t hg_data_end[];
extern const uint32_t hg_data_image[];
extern uint32_t hg_bss_begin[];
extern uint32_t hg_bss_end[];

int main(void);

__attribute__((weak)) _Noreturn void hg_stop(void)
{
    for (;;) {
    }
}

__attribute__((weak)) _Noreturn void hg_end(int status)
{
    (void)status;
    hg_stop();
}

_Noreturn void hg_start(void)
{
    const uint32_t *from = hg_data_image;
    for (uint32_t *to = hg_data_begin; to != hg_data_end; to++) {
        *to = *from;
        from++;
    }
    for (uint32_t *to = hg_bss_begin; to != hg_bss_end; to++) {
        *to = 0U;
    }
    hg_end(main());
}
