/* The contract suite on a SocketCAN interface: rig_socketcan [INTERFACE], vcan0 unless said otherwise. Needs the right to configure the
 * network (it takes the interface down and up, and gives it a queue with room for one frame); with-vcan has it. */
#define _GNU_SOURCE
#include "rig.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "socketcan/socketcan.h"

typedef struct {
    rig          base;
    const char  *interface;
    int          wire;        /* a raw socket of our own: writes what no board would */
    hg_socketcan node;
    hg_socketcan peer;
} socketcan_rig;

_Static_assert(offsetof(socketcan_rig, base) == 0U, "a rig is cast to its first member and back");

static socketcan_rig *mine(rig *self)
{
    return (socketcan_rig *)(void *)self;
}

static void open_board(hg_socketcan *board, const char *interface, const hg_socketcan_options *options)
{
    if (hg_socketcan_open(board, interface, options) != HG_OK) {
        fail_msg("%s: %s: %s", interface, board->error_call, strerror(board->error_number));
    }
}

static void rig_open(rig *self, const hg_hal_filter *filters, size_t count)
{
    socketcan_rig *const r = mine(self);
    const hg_socketcan_options node = {.filters = filters, .filter_count = count, .depth = RIG_DEPTH};
    const hg_socketcan_options peer = {.depth = RIG_FLOOD};
    const struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = (int)if_nametoindex(r->interface)};
    const int on = 1;

    open_board(&r->node, r->interface, &node);
    open_board(&r->peer, r->interface, &peer);
    self->node = hg_socketcan_hal(&r->node);
    self->peer = hg_socketcan_hal(&r->peer);
    assert_true(r->node.depth >= RIG_DEPTH);
    r->wire = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
    assert_true(r->wire >= 0);
    assert_int_equal(setsockopt(r->wire, SOL_CAN_RAW, CAN_RAW_FILTER, NULL, 0), 0);
    assert_int_equal(setsockopt(r->wire, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on), 0);
    assert_int_equal(bind(r->wire, (const struct sockaddr *)&address, sizeof address), 0);
}

static void rig_close(rig *self)
{
    socketcan_rig *const r = mine(self);

    hg_socketcan_close(&r->node);
    hg_socketcan_close(&r->peer);
    (void)close(r->wire);
}

static bool write_raw(int wire, const hg_can_frame *frame)
{
    struct canfd_frame raw = {.len = frame->length};
    const size_t size = ((frame->flags & HG_CAN_FD) != 0U) ? CANFD_MTU : CAN_MTU;

    raw.can_id = frame->id;
    raw.can_id |= ((frame->flags & HG_CAN_EXTENDED) != 0U) ? CAN_EFF_FLAG : 0U;
    raw.can_id |= ((frame->flags & HG_CAN_REMOTE) != 0U) ? CAN_RTR_FLAG : 0U;
    memcpy(raw.data, frame->data, frame->length);
    return write(wire, &raw, size) == (ssize_t)size;
}

static void rig_put(rig *self, const hg_can_frame *frame)
{
    assert_true(write_raw(mine(self)->wire, frame));
}

static void rig_put_later(rig *self, const hg_can_frame *frame, uint32_t delay_us)
{
    const pid_t child = fork();

    assert_true(child >= 0);
    if (child == 0) {
        (void)usleep(delay_us);
        _exit(write_raw(mine(self)->wire, frame) ? 0 : 1);
    }
}

static void rig_report(rig *self, hg_bus_state state)
{
    struct can_frame raw = {.can_id = CAN_ERR_FLAG | CAN_ERR_CRTL, .can_dlc = CAN_ERR_DLC};

    if (state == HG_BUS_OFF) {
        raw.can_id = CAN_ERR_FLAG | CAN_ERR_BUSOFF;
    } else if (state == HG_BUS_PASSIVE) {
        raw.data[1] = CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_PASSIVE;
    } else if (state == HG_BUS_WARNING) {
        raw.data[1] = CAN_ERR_CRTL_TX_WARNING;
    } else {
        raw.can_id = CAN_ERR_FLAG | CAN_ERR_RESTARTED;
    }
    assert_int_equal(write(mine(self)->wire, &raw, sizeof raw), (ssize_t)sizeof raw);
}

static void command(const char *format, const char *interface)
{
    char line[160];

    (void)snprintf(line, sizeof line, "PATH=$PATH:/usr/sbin:/sbin; ");
    const size_t used = strlen(line);
    (void)snprintf(line + used, sizeof line - used, format, interface);
    assert_int_equal(system(line), 0);
}

/* One frame waits for ten seconds in the interface's queue, so the next one finds no room, as on a bus where nobody acknowledges. */
static void rig_full(rig *self, bool full)
{
    const hg_can_frame frame = {.id = 0x7FFU};

    if (full) {
        command("tc qdisc add dev %s root netem delay 10s limit 1", mine(self)->interface);
        rig_put(self, &frame);
    } else {
        command("tc qdisc del dev %s root", mine(self)->interface);
    }
}

static void rig_link(rig *self, bool up)
{
    struct ifreq request;
    int pending = 0;
    socklen_t size = sizeof pending;

    memset(&request, 0, sizeof request);
    memcpy(request.ifr_name, mine(self)->interface, strlen(mine(self)->interface));
    request.ifr_flags = (short)(up ? IFF_UP : 0);
    assert_int_equal(ioctl(mine(self)->wire, SIOCSIFFLAGS, &request), 0);
    (void)getsockopt(mine(self)->wire, SOL_SOCKET, SO_ERROR, &pending, &size);   /* the outage is no news to us */
}

/* From another process, after the wait has begun. */
static void rig_stop(rig *self)
{
    const pid_t child = fork();

    assert_true(child >= 0);
    if (child == 0) {
        (void)usleep(20000);
        hg_socketcan_stop(&mine(self)->node);
        _exit(0);
    }
}

/* --- what only this backend has ------------------------------------------------------------------------------------------------------- */

static void open_says_what_failed(void **state)
{
    static const hg_hal_filter bad = {0x800U, HG_CAN_ID_EXTENDED, 0U};
    const socketcan_rig *const r = *state;
    const hg_socketcan_options filter = {.filters = &bad, .filter_count = 1U};
    const hg_socketcan_options deep = {.depth = HG_SOCKETCAN_DEPTH_MAX + 1U};
    const hg_socketcan_options absent = {.filter_count = 1U};
    hg_socketcan board;

    assert_int_equal(hg_socketcan_open(NULL, r->interface, NULL), HG_E_ARGUMENT);
    assert_int_equal(hg_socketcan_open(&board, NULL, NULL), HG_E_ARGUMENT);
    assert_int_equal(hg_socketcan_open(&board, "", NULL), HG_E_ARGUMENT);
    assert_int_equal(hg_socketcan_open(&board, "sixteen-letters.", NULL), HG_E_ARGUMENT);
    assert_int_equal(hg_socketcan_open(&board, r->interface, &filter), HG_E_ARGUMENT);
    assert_int_equal(hg_socketcan_open(&board, r->interface, &deep), HG_E_ARGUMENT);
    assert_int_equal(hg_socketcan_open(&board, r->interface, &absent), HG_E_ARGUMENT);
    assert_int_equal(hg_socketcan_open(&board, "absent0", NULL), HG_E_BUS);
    assert_string_equal(board.error_call, "if_nametoindex");
    assert_int_equal(board.error_number, ENODEV);
    assert_int_equal(hg_socketcan_open(&board, "lo", NULL), HG_E_IO);   /* an interface, but not of CAN */
    assert_string_equal(board.error_call, "bind");
    assert_int_equal(board.error_number, ENODEV);
    assert_int_equal(board.can, -1);
    hg_socketcan_close(&board);
}

static void close_leaves_no_descriptor_open(void **state)
{
    const socketcan_rig *const r = *state;
    const int before = dup(STDIN_FILENO);
    hg_socketcan board;

    assert_int_equal(close(before), 0);
    for (int i = 0; i < 3; i++) {
        open_board(&board, r->interface, &(hg_socketcan_options){.stop_on_signal = true});
        hg_socketcan_close(&board);
        hg_socketcan_close(&board);
    }
    assert_int_equal(hg_socketcan_open(&board, "lo", NULL), HG_E_IO);
    const int after = dup(STDIN_FILENO);
    assert_int_equal(after, before);
    assert_int_equal(close(after), 0);
}

static void signals_stop_only_until_close(void **state)
{
    const socketcan_rig *const r = *state;
    hg_socketcan board;

    open_board(&board, r->interface, &(hg_socketcan_options){.stop_on_signal = true});
    const hg_hal hal = hg_socketcan_hal(&board);
    assert_int_equal(hg_hal_wait(&hal, 0U), HG_E_EMPTY);
    assert_int_equal(kill(getpid(), SIGTERM), 0);
    assert_int_equal(hg_hal_wait(&hal, HG_HAL_FOREVER), HG_E_IO);
    assert_int_equal(hg_hal_wait(&hal, 0U), HG_E_IO);
    hg_socketcan_close(&board);   /* the signal that was taken must not end us now */
    sigset_t blocked;
    assert_int_equal(sigprocmask(SIG_BLOCK, NULL, &blocked), 0);
    assert_int_equal(sigismember(&blocked, SIGTERM) | sigismember(&blocked, SIGINT), 0);
}

static void set_mtu(const char *interface, int mtu)
{
    command("ip link set %s down", interface);
    command((mtu == (int)CAN_MTU) ? "ip link set %s mtu 16" : "ip link set %s mtu 72", interface);
    command("ip link set %s up", interface);
}

static void classic_only_neither_sends_nor_hears_fd(void **state)
{
    socketcan_rig *const r = *state;
    const hg_can_frame fd = {.id = 1U, .flags = HG_CAN_FD, .length = 12U};
    const hg_can_frame classic = {.id = 2U, .length = 1U};
    hg_can_frame got;
    hg_socketcan old;
    hg_socketcan both;

    open_board(&old, r->interface, &(hg_socketcan_options){.classic_only = true});
    open_board(&both, r->interface, NULL);
    const hg_hal a = hg_socketcan_hal(&old);
    const hg_hal b = hg_socketcan_hal(&both);
    assert_int_equal(hg_hal_send(&a, &fd), HG_E_FORMAT);
    assert_int_equal(hg_hal_send(&b, &fd), HG_OK);
    assert_int_equal(hg_hal_send(&b, &classic), HG_OK);
    assert_int_equal(hg_hal_wait(&a, hg_hal_now_us(&a) + 5000000U), HG_OK);
    assert_int_equal(hg_hal_receive(&a, &got, NULL), HG_OK);
    assert_int_equal(got.id, classic.id);
    set_mtu(r->interface, 16);
    assert_int_equal(hg_hal_send(&b, &fd), HG_E_FORMAT);   /* the interface is a classic one now */
    assert_string_equal(both.error_call, "send");
    assert_int_equal(hg_hal_send(&b, &classic), HG_OK);
    set_mtu(r->interface, 72);
    hg_socketcan_close(&old);
    hg_socketcan_close(&both);
}

static void opens_an_interface_that_is_down(void **state)
{
    socketcan_rig *const r = *state;
    const hg_can_frame frame = {.id = 3U, .length = 1U};
    hg_hal_report report;
    hg_socketcan board;

    command("ip link set %s down", r->interface);
    open_board(&board, r->interface, NULL);
    const hg_hal hal = hg_socketcan_hal(&board);
    hg_hal_state(&hal, &report);
    assert_int_equal(report.bus, HG_BUS_OFF);
    assert_int_equal(hg_hal_send(&hal, &frame), HG_E_BUS);
    command("ip link set %s up", r->interface);
    assert_int_equal(hg_hal_send(&hal, &frame), HG_OK);
    hg_socketcan_close(&board);
}

static int own_tests(socketcan_rig *r)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_prestate(open_says_what_failed, r), cmocka_unit_test_prestate(close_leaves_no_descriptor_open, r),
        cmocka_unit_test_prestate(signals_stop_only_until_close, r), cmocka_unit_test_prestate(classic_only_neither_sends_nor_hears_fd, r),
        cmocka_unit_test_prestate(opens_an_interface_that_is_down, r),
    };

    return cmocka_run_group_tests_name("socketcan alone", tests, NULL, NULL);
}

int main(int argc, char **argv)
{
    static const rig_ops ops = {rig_open, rig_close, rig_put, rig_put_later, rig_report, rig_full, rig_link, rig_stop};
    socketcan_rig r = {.base = {.ops = &ops}, .interface = (argc > 1) ? argv[1] : "vcan0"};
    const int failures = contract_run("socketcan", &r.base) + own_tests(&r);

    while (wait(NULL) > 0) {
    }
    return failures;
}
