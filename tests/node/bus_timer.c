/** @file
 *  Both ends of a bus in real time, for test_timing.py; all times are CLOCK_MONOTONIC, microseconds.
 *      bus_timer send PERIOD_US TICKS DROP   the platoon's senders, at rest: a sample every period, by absolute sleep; DROP > 0: every
 *                                            DROP-th closing frame is protected and counted like all others, but not sent
 *      bus_timer watch PERIOD_US             the reference: a timer of its own, and the closing frames that arrive. A gap is more than one
 *                                            and a half periods between two of its wake-ups, or between two successive closing frames
 *      bus_timer echo INTERFACE              answers each closing frame with a frame of its own, as soon as detector_node could: the same loop
 *                                            on the same board, without a detector
 *  A closing frame that was never sent is no gap: the frames around it are not successive. */
#define _POSIX_C_SOURCE 200809L

#include "platoon.h"
#include "socketcan.h"

#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define SECOND_US 1000000U
#define TRIES_MAX 200U
#define ECHO_ID 0x7A0U

typedef struct {
    uint64_t first_us, last_us; /* 0: none yet */
    uint64_t count;
    uint64_t longest_us;
} series;

static hg_socketcan can;

static int fail(const char *what)
{
    (void)fprintf(stderr, "bus_timer: %s (%s: %s)\n", what, can.error_call, strerror(can.error_number));
    return EXIT_FAILURE;
}

static hg_status open_bus(const char *interface, const hg_hal_filter *filters, size_t count)
{
    const hg_socketcan_options options = {.filters = filters, .filter_count = count, .depth = 8192U, .stop_on_signal = true};
    return hg_socketcan_open(&can, interface, &options);
}

static void sleep_until(uint64_t us)
{
    const struct timespec at = {.tv_sec = (time_t)(us / SECOND_US), .tv_nsec = (long)(us % SECOND_US) * 1000L};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL) != 0) {
        /* a signal: sleep on */
    }
}

static bool sent(const hg_hal *hal, const hg_can_frame *frame)
{
    hg_status status = HG_E_BUSY;
    for (unsigned i = 0U; (i < TRIES_MAX) && (status == HG_E_BUSY); i++) {
        status = hg_hal_send(hal, frame);
    }
    return status == HG_OK;
}

static int send_ticks(uint64_t period_us, uint64_t ticks, uint64_t drop)
{
    static hg_platoon_senders senders;
    static const hg_real rest[HG_PLATOON_SIGNALS] = {0};
    const uint8_t order[HG_PLATOON_GROUPS] = {HG_PLATOON_GROUP_MEASUREMENT, HG_PLATOON_GROUP_CONTROL};
    uint64_t frames[HG_PLATOON_GROUPS] = {0U};
    uint64_t dropped = 0U;
    uint64_t worst_us = 0U;
    hg_can_frame frame;
    if ((open_bus("vcan0", NULL, 0U) != HG_OK) || (hg_platoon_senders_start(&senders) != HG_OK)) {
        return fail("cannot start");
    }
    const hg_hal hal = hg_socketcan_hal(&can);
    const uint64_t begin_us = ((hg_hal_now_us(&hal) / period_us) + 2U) * period_us; /* on the watcher's beat */
    for (uint64_t k = 0U; k < ticks; k++) {
        sleep_until(begin_us + (k * period_us));
        const uint64_t late_us = hg_hal_now_us(&hal) - (begin_us + (k * period_us));
        worst_us = (late_us > worst_us) ? late_us : worst_us;
        for (size_t i = 0U; i < HG_PLATOON_GROUPS; i++) {
            const uint8_t group = order[i];
            if (hg_sender_step(&senders.sender[group], (uint32_t)k, rest, &frame) != HG_OK) {
                continue;
            }
            if ((group == HG_PLATOON_GROUP_CONTROL) && (drop > 0U) && ((k % drop) == (drop - 1U))) {
                dropped++;
            } else if (sent(&hal, &frame)) {
                frames[group]++;
            } else {
                return fail("a frame found no room");
            }
        }
    }
    (void)printf("begin_us %" PRIu64 "\nticks %" PRIu64 "\nmeasurement %" PRIu64 "\ncontrol %" PRIu64 "\ndropped %" PRIu64 "\nlate_us %" PRIu64 "\n",
                 begin_us, ticks, frames[HG_PLATOON_GROUP_MEASUREMENT], frames[HG_PLATOON_GROUP_CONTROL], dropped, worst_us);
    return EXIT_SUCCESS;
}

/* The next event of a series; `successive` says whether nothing that should lie between is missing. */
static void add(series *self, const char *name, uint64_t at_us, bool successive, uint64_t period_us)
{
    if (self->count == 0U) {
        self->first_us = at_us;
    } else if (successive) {
        const uint64_t gap_us = at_us - self->last_us;
        self->longest_us = (gap_us > self->longest_us) ? gap_us : self->longest_us;
        if ((2U * gap_us) > (3U * period_us)) {
            (void)printf("gap %s %" PRIu64 " %" PRIu64 "\n", name, self->last_us, at_us);
        }
    } else {
        /* frames are missing between them */
    }
    self->last_us = at_us;
    self->count++;
}

static hg_hal_filter closing_frames(void)
{
    return (hg_hal_filter){.id = hg_platoon_config.message[HG_PLATOON_GROUP_CONTROL].id, .mask = HG_CAN_ID_EXTENDED, .flags = 0U};
}

static int echo(const char *interface)
{
    const hg_hal_filter filter = closing_frames();
    hg_can_frame frame;
    uint64_t at_us;
    if (open_bus(interface, &filter, 1U) != HG_OK) {
        return fail("cannot open the interface");
    }
    const hg_hal hal = hg_socketcan_hal(&can);
    (void)puts("ready");
    (void)fflush(stdout);
    while (hg_hal_wait(&hal, HG_HAL_FOREVER) != HG_E_IO) {
        while (hg_hal_receive(&hal, &frame, &at_us) == HG_OK) {
            frame.id = ECHO_ID;
            if (!sent(&hal, &frame)) {
                return fail("a frame found no room");
            }
        }
    }
    return EXIT_SUCCESS;
}

static int watch(uint64_t period_us)
{
    const hg_hal_filter filter = closing_frames();
    series wakes = {0U};
    series ticks = {0U};
    uint8_t stamp = 0U;
    hg_can_frame frame;
    uint64_t at_us;
    if (open_bus("vcan0", &filter, 1U) != HG_OK) {
        return fail("cannot open vcan0");
    }
    const hg_hal hal = hg_socketcan_hal(&can);
    uint64_t next_us = ((hg_hal_now_us(&hal) / period_us) + 1U) * period_us;
    hg_status status = HG_OK;
    (void)puts("ready");
    (void)fflush(stdout);
    while (status != HG_E_IO) {
        while (hg_hal_receive(&hal, &frame, &at_us) == HG_OK) {
            const uint8_t now = (uint8_t)(frame.data[1] >> 4U);
            add(&ticks, "tick", at_us, ((stamp + 1U) & 0x0FU) == now, period_us);
            stamp = now;
        }
        const uint64_t now_us = hg_hal_now_us(&hal);
        if (now_us >= next_us) {
            add(&wakes, "wake", now_us, true, period_us);
            next_us = ((now_us / period_us) + 1U) * period_us;
        }
        status = hg_hal_wait(&hal, next_us);
    }
    hg_hal_report report;
    hg_hal_state(&hal, &report);
    (void)printf("wakes %" PRIu64 "\nlongest_wake_us %" PRIu64 "\nticks %" PRIu64 "\nlongest_tick_us %" PRIu64 "\nfirst_us %" PRIu64
                 "\nlast_us %" PRIu64 "\nlost %" PRIu32 "\n", wakes.count, wakes.longest_us, ticks.count, ticks.longest_us, ticks.first_us,
                 ticks.last_us, report.lost);
    return EXIT_SUCCESS;
}

int main(int argc, char **argv)
{
    const uint64_t period_us = (argc > 2) ? strtoull(argv[2], NULL, 10) : 0U;
    int result = 2;
    if ((period_us > 0U) && (argc == 5) && (strcmp(argv[1], "send") == 0)) {
        result = send_ticks(period_us, strtoull(argv[3], NULL, 10), strtoull(argv[4], NULL, 10));
    } else if ((period_us > 0U) && (argc == 3) && (strcmp(argv[1], "watch") == 0)) {
        result = watch(period_us);
    } else if ((argc == 3) && (strcmp(argv[1], "echo") == 0)) {
        result = echo(argv[2]);
    } else {
        (void)fputs("usage: bus_timer send PERIOD_US TICKS DROP | bus_timer watch PERIOD_US | bus_timer echo INTERFACE\n", stderr);
    }
    hg_socketcan_close(&can);
    return result;
}
