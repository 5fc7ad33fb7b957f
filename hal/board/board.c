/* What of board.h every board does alike: its controllers and their queues. */
#include "board.h"

static hg_controller controllers[HG_BOARD_CONTROLLERS];
static hg_queue_slot slots[HG_BOARD_CONTROLLERS][HG_BOARD_DEPTH];
static void (*idle)(void);

void hg_board_set_idle(void (*function)(void))
{
    idle = function;
}

hg_status hg_board_can(uint8_t number, const hg_hal_filter *filters, size_t count, hg_hal *hal)
{
    hg_controller_options options = {.now_us = hg_board_now_us, .idle = idle, .filters = filters, .filter_count = count, .depth = HG_BOARD_DEPTH};

    if ((number >= HG_BOARD_CONTROLLERS) || (hal == NULL)) {
        return HG_E_ARGUMENT;
    }
    if (!hg_board_place(number, &options.place)) {
        return HG_E_BUS;
    }
    options.slots = slots[number];
    const hg_status status = hg_controller_start(&controllers[number], &options);
    if (status == HG_OK) {
        *hal = hg_controller_hal(&controllers[number]);
    }
    return status;
}

void hg_board_service(uint8_t number)
{
    hg_controller_interrupt(&controllers[number]);
}

void hg_board_stop(uint8_t number)
{
    hg_controller_stop(&controllers[number]);
}
