#include "model_board.h"

#include <stdio.h>
#include <stdlib.h>

static uint64_t now_us;

hg_queue_slot model_slots[HG_BOARD_CONTROLLERS][HG_BOARD_DEPTH];
void        (*model_idle)(void);

void hg_board_set_idle(void (*function)(void))
{
    model_idle = function;
}

void hg_board_say(const char *text)
{
    (void)fputs(text, stdout);
}

uint64_t hg_board_now_us(void)
{
    now_us++;
    return now_us;
}

int hg_board_key(void)
{
    return -1;
}

_Noreturn void hg_board_leave(uint32_t status)
{
    exit((int)status);
}
