/** @file
 *  detector_node in virtual time: its own source, main and all, on a loopback bus in place of hal/socketcan. A run is exact to the
 *  microsecond and takes none.
 *      virtual_node FRAMES HELD_US OPTION ...   FRAMES: a file of lines "TIME_US ID FLAGS HEX", in order of time, numbers decimal, FLAGS of can.h,
 *                                               HEX "-" for no data; the process is held up for HELD_US whenever it has found that there is no
 *                                               frame more; the options are detector_node's
 *  After what detector_node says come the frames it sent, a line each: "sent TIME_US ID HEX". */
int detector_node_main(int argc, char **argv);
#define main detector_node_main
#include "../../firmware/apps/detector_node.c"
#undef main

#include "loopback.h"

#define DEPTH 8192U

static hg_loopback_bus bus;
static hg_loopback node_end, listener;
static hg_loopback_slot node_slots[DEPTH], listener_slots[DEPTH];
static hg_hal_filter node_filter[FILTERS_MAX]; /* the node's own go with its stack */
static const char *frames_name;
static uint64_t held_us;
static hg_hal_ops held_ops;

/* Every frame of the file, under way from the beginning. */
static bool put_frames(void)
{
    FILE *file = fopen(frames_name, "r");
    char hex[(2U * HG_CAN_DATA_MAX) + 1U];
    uint64_t at_us;
    unsigned id;
    unsigned flags;
    bool good = file != NULL;
    while (good && (fscanf(file, "%" SCNu64 " %u %u %128s", &at_us, &id, &flags, hex) == 4)) {
        hg_can_frame frame = {.id = id, .flags = (uint8_t)flags};
        for (const char *at = hex; (at[0] != '-') && (at[0] != '\0'); at += 2) {
            unsigned byte = 0U;
            good = good && (sscanf(at, "%2x", &byte) == 1);
            frame.data[frame.length] = (uint8_t)byte;
            frame.length++;
        }
        hg_loopback_set_latency(&bus, (uint32_t)at_us);
        good = good && (hg_loopback_put(&bus, &frame) == HG_OK) && (node_end.report.lost == 0U);
    }
    if (file != NULL) {
        good = (feof(file) != 0) && good;
        (void)fclose(file);
    }
    hg_loopback_set_latency(&bus, 0U);
    return good;
}

hg_status hg_socketcan_open(hg_socketcan *self, const char *interface, const hg_socketcan_options *wanted)
{
    (void)interface;
    self->error_call = "";
    memcpy(node_filter, wanted->filters, wanted->filter_count * sizeof node_filter[0]);
    const bool good = (hg_loopback_bus_start(&bus, 0U) == HG_OK) &&
                      (hg_loopback_start(&node_end, &bus, node_slots, DEPTH, node_filter, wanted->filter_count) == HG_OK) && put_frames() &&
                      (hg_loopback_start(&listener, &bus, listener_slots, DEPTH, NULL, 0U) == HG_OK);
    return good ? HG_OK : HG_E_IO;
}

static hg_status held_receive(void *self, hg_can_frame *frame, uint64_t *time_us)
{
    const hg_hal inner = hg_loopback_hal(self);
    const hg_status status = hg_hal_receive(&inner, frame, time_us);
    if (status == HG_E_EMPTY) {
        hg_loopback_set_time(&bus, hg_hal_now_us(&inner) + held_us);
    }
    return status;
}

hg_hal hg_socketcan_hal(hg_socketcan *self)
{
    (void)self;
    hg_hal hal = hg_loopback_hal(&node_end);
    held_ops = *hal.ops;
    held_ops.receive = held_receive;
    hal.ops = &held_ops;
    return hal;
}

void hg_socketcan_close(hg_socketcan *self)
{
    (void)self;
}

int main(int argc, char **argv)
{
    if (argc < 3) {
        (void)fputs("usage: virtual_node FRAMES HELD_US OPTION ...\n", stderr);
        return EXIT_INPUT;
    }
    frames_name = argv[1];
    held_us = strtoull(argv[2], NULL, 10);
    argv[2] = argv[0];
    const int result = detector_node_main(argc - 2, &argv[2]);
    const hg_hal hal = hg_loopback_hal(&listener);
    hg_can_frame frame;
    uint64_t at_us;
    while (hg_hal_receive(&hal, &frame, &at_us) == HG_OK) {
        (void)printf("sent %" PRIu64 " %" PRIu32 " ", at_us, frame.id);
        for (uint8_t i = 0U; i < frame.length; i++) {
            (void)printf("%02x", (unsigned)frame.data[i]);
        }
        (void)puts("");
    }
    return result;
}
