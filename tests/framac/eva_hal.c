/* What of a board is plain C: the frames that it takes and passes on, loopback, the receive queue, and what controllers with registers do alike, over registers that
   say anything. */
#include "drive.h"

#include "board/controller.h"
#include "hal.h"
#include "loopback/loopback.h"

volatile int any;

#define DEPTH 4U
#define FILTERS 2U

static hg_hal_filter any_filter(void)
{
    hg_hal_filter filter;
    Frama_C_make_unknown((char *)&filter, sizeof filter);
    return filter;
}

static uint64_t any_time(void)
{
    return Frama_C_unsigned_long_long_interval(0U, UINT64_MAX);
}

/* Any call of hal.h. */
static void call(const hg_hal *hal)
{
    hg_can_frame frame;
    hg_hal_report report;
    uint64_t time_us;
    switch (any) {
    case 0:
        any_frame(&frame);
        (void)hg_hal_send(hal, &frame);
        break;
    case 1:
        (void)hg_hal_receive(hal, &frame, maybe() ? &time_us : NULL);
        break;
    case 2:
        hg_hal_state(hal, &report);
        break;
    case 3:
        (void)hg_hal_now_us(hal);
        break;
    default:
        (void)hg_hal_wait(hal, any_time());
        break;
    }
}

/* What a tester does to a bus. */
static void spoil(hg_loopback_bus *bus, hg_loopback *a, hg_loopback *b)
{
    hg_can_frame frame;
    any_frame(&frame);
    (void)hg_loopback_put(bus, &frame);
    hg_loopback_set_time(bus, any_time());
    hg_loopback_set_latency(bus, (uint32_t)any);
    hg_loopback_set_busy(a, (uint32_t)any);
    hg_loopback_set_bus(b, maybe() ? HG_BUS_OFF : HG_BUS_ACTIVE);
    if (maybe()) {
        hg_loopback_stop(a);
    }
}

static void run_loopback(void)
{
    static hg_loopback_bus bus;
    static hg_loopback a;
    static hg_loopback b;
    static hg_loopback_slot of_a[DEPTH];
    static hg_loopback_slot of_b[DEPTH];
    const hg_hal_filter filters[FILTERS] = {any_filter(), any_filter()};
    if ((hg_loopback_bus_start(&bus, (uint32_t)any) == HG_OK) && (hg_loopback_start(&a, &bus, of_a, DEPTH, filters, FILTERS) == HG_OK) &&
        (hg_loopback_start(&b, &bus, of_b, DEPTH, NULL, 0U) == HG_OK)) {
        const hg_hal hal[] = {hg_loopback_hal(&a), hg_loopback_hal(&b)};
        while (maybe()) {
            call(&hal[0]);
            call(&hal[1]);
            spoil(&bus, &a, &b);
        }
    }
}

/* Registers that say anything. */
static bool set_up(const hg_controller_place *at)
{
    (void)at;
    return maybe();
}

static hg_status read_frame(const hg_controller_place *at, hg_can_frame *frame)
{
    (void)at;
    any_frame(frame);
    return maybe() ? HG_OK : (maybe() ? HG_E_EMPTY : (maybe() ? HG_E_FORMAT : HG_E_ID));
}

static bool write_frame(const hg_controller_place *at, const hg_can_frame *frame)
{
    (void)at;
    (void)frame;
    return maybe();
}

static hg_bus_state bus_state(const hg_controller_place *at)
{
    (void)at;
    return maybe() ? HG_BUS_ACTIVE : HG_BUS_OFF;
}

static void order(const hg_controller_place *at)
{
    (void)at;
}

static void run_controller(void)
{
    static const hg_controller_type type = {.fd = true, .set_up = set_up, .read = read_frame, .write = write_frame, .state = bus_state, .reported = set_up,
                                            .overflowed = set_up, .rejoin = order, .withdraw = order};
    static hg_queue_slot slots[DEPTH];
    static hg_controller controller;
    const hg_hal_filter filters[FILTERS] = {any_filter(), any_filter()};
    const hg_controller_options options = {.place = {.type = &type, .base = 4U}, .now_us = any_time, .filters = filters, .filter_count = FILTERS, .slots = slots, .depth = DEPTH};
    if (hg_controller_start(&controller, &options) == HG_OK) {
        const hg_hal hal = hg_controller_hal(&controller);
        while (maybe()) {
            call(&hal);
            if (maybe()) {
                hg_controller_stop(&controller);
            }
        }
    }
}

int main(void)
{
    run_loopback();
    run_controller();
    return 0;
}
