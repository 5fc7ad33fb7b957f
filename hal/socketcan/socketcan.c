#define _GNU_SOURCE   /* struct canfd_frame's neighbours, timerfd, signalfd: Linux only by nature */
#include "socketcan.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <signal.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

#define FRAME_COST 1024U   /* bytes of receive buffer charged for a frame, rounded up: Linux 6.1 charges 768 */

enum { FROM_CAN, FROM_TIMER, FROM_STOP };   /* epoll's user data */

_Static_assert(CANFD_MAX_DLEN == HG_CAN_DATA_MAX, "a frame's data has the same size on both sides");

static hg_status failed(hg_socketcan *self, const char *call, hg_status status)
{
    self->error_call = call;
    self->error_number = errno;
    return status;
}

/* --- time -------------------------------------------------------------------------------------------------------------------------- */

static uint64_t to_ns(const struct timespec *time)
{
    return ((uint64_t)time->tv_sec * 1000000000U) + (uint64_t)time->tv_nsec;
}

static uint64_t clock_ns(clockid_t clock)
{
    struct timespec now;

    (void)clock_gettime(clock, &now);   /* fails for unknown clocks only */
    return to_ns(&now);
}

static uint64_t socketcan_now_us(void *object)
{
    (void)object;
    return clock_ns(CLOCK_MONOTONIC) / 1000U;
}

/* The kernel stamps with the wall clock, which may be set at any time; only the age of a stamp is taken from it. The wall clock is read
 * first: if we are held up between the two, a frame seems younger than it is, but never older than what was sent before it. */
static uint64_t arrival_us(hg_socketcan *self, const struct timespec *stamp)
{
    const uint64_t wall = clock_ns(CLOCK_REALTIME);
    const uint64_t now = clock_ns(CLOCK_MONOTONIC);
    const uint64_t then = to_ns(stamp);
    const uint64_t age = ((then != 0U) && (then < wall)) ? (wall - then) : 0U;
    const uint64_t time_us = (age < now) ? ((now - age) / 1000U) : 0U;

    if (time_us > self->last_us) {
        self->last_us = time_us;
    }
    return self->last_us;
}

/* --- bus state --------------------------------------------------------------------------------------------------------------------- */

static bool is_up(const hg_socketcan *self)
{
    struct ifreq request;

    memset(&request, 0, sizeof request);
    request.ifr_ifindex = self->ifindex;
    return (ioctl(self->can, SIOCGIFNAME, &request) == 0) && (ioctl(self->can, SIOCGIFFLAGS, &request) == 0)
        && (((unsigned)request.ifr_flags & (unsigned)IFF_UP) != 0U);
}

static void interface_down(hg_socketcan *self)
{
    self->down = true;
    self->report.bus = HG_BUS_OFF;
}

/* The kernel announces that an interface goes down, but not that it is back. */
static void look_whether_up(hg_socketcan *self)
{
    if (self->down && is_up(self)) {
        self->down = false;
        self->report.bus = HG_BUS_ACTIVE;
    }
}

static void take_error_report(hg_socketcan *self, const struct canfd_frame *raw)
{
    const unsigned problem = ((raw->can_id & CAN_ERR_CRTL) != 0U) ? raw->data[1] : 0U;

    hg_hal_count(&self->report.errors, 1U);
    if ((raw->can_id & CAN_ERR_BUSOFF) != 0U) {
        self->report.bus = HG_BUS_OFF;
    } else if ((problem & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0U) {
        self->report.bus = HG_BUS_PASSIVE;
    } else if ((problem & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0U) {
        self->report.bus = HG_BUS_WARNING;
    } else if (((problem & CAN_ERR_CRTL_ACTIVE) != 0U) || ((raw->can_id & CAN_ERR_RESTARTED) != 0U)) {
        self->report.bus = HG_BUS_ACTIVE;
    } else {
        /* Errors of single frames (bit, stuff, acknowledge): the state is reported by itself when it changes. */
    }
}

/* A frame from the bus: a controller that receives it is on the bus, whoever said otherwise before. Any process of this host can write an
 * error frame, and none may silence this one for good. */
static void heard(hg_socketcan *self)
{
    if ((self->report.bus == HG_BUS_OFF) && (!self->down)) {
        self->report.bus = HG_BUS_ACTIVE;
    }
}

static void socketcan_state(void *object, hg_hal_report *out)
{
    hg_socketcan *const self = object;

    look_whether_up(self);
    *out = self->report;
}

/* --- send -------------------------------------------------------------------------------------------------------------------------- */

static void to_kernel(struct canfd_frame *raw, const hg_can_frame *frame)
{
    memset(raw, 0, sizeof *raw);
    raw->can_id = frame->id;
    raw->can_id |= ((frame->flags & HG_CAN_EXTENDED) != 0U) ? CAN_EFF_FLAG : 0U;
    raw->can_id |= ((frame->flags & HG_CAN_REMOTE) != 0U) ? CAN_RTR_FLAG : 0U;
    raw->flags = ((frame->flags & HG_CAN_BRS) != 0U) ? (__u8)CANFD_BRS : (__u8)0U;
    raw->len = frame->length;
    memcpy(raw->data, frame->data, frame->length);
}

static hg_status send_result(hg_socketcan *self)
{
    switch (errno) {
    case ENETDOWN:
    case ENETUNREACH:
    case ENODEV:
    case ENXIO:
        (void)failed(self, "send", HG_E_BUS);
        interface_down(self);
        look_whether_up(self);   /* the socket keeps the error of an outage that may be over */
        return (self->report.bus == HG_BUS_OFF) ? HG_E_BUS : HG_E_BUSY;
    case EINVAL:
    case EMSGSIZE:
        return failed(self, "send", HG_E_FORMAT);   /* FD to an interface whose MTU is that of classic CAN */
    case ENOBUFS:
    case EAGAIN:
    case EINTR:
        return HG_E_BUSY;
    default:
        return failed(self, "send", HG_E_IO);
    }
}

static hg_status try_send(hg_socketcan *self, const hg_can_frame *frame)
{
    const bool fd = (frame->flags & HG_CAN_FD) != 0U;
    const size_t size = fd ? CANFD_MTU : CAN_MTU;
    const struct timespec pause = {0, (long)HG_SOCKETCAN_RETRY_US * 1000L};
    struct canfd_frame raw;
    hg_status status = HG_E_BUSY;

    if (!hg_hal_sendable(frame) || (fd && self->classic_only)) {
        return HG_E_FORMAT;
    }
    look_whether_up(self);
    if (self->report.bus == HG_BUS_OFF) {
        return HG_E_BUS;
    }
    to_kernel(&raw, frame);
    for (unsigned i = 0U; (i < self->send_tries) && (status == HG_E_BUSY); i++) {
        if (i > 0U) {
            (void)clock_nanosleep(CLOCK_MONOTONIC, 0, &pause, NULL);   /* POLLOUT says nothing about a full interface queue */
        }
        const ssize_t written = send(self->can, &raw, size, MSG_NOSIGNAL);
        if (written == (ssize_t)size) {
            status = HG_OK;
        } else {
            status = (written < 0) ? send_result(self) : HG_E_IO;
        }
    }
    return status;
}

static hg_status socketcan_send(void *object, const hg_can_frame *frame)
{
    hg_socketcan *const self = object;
    const hg_status status = try_send(self, frame);

    hg_hal_count((status == HG_OK) ? &self->report.sent : &self->report.refused, 1U);
    return status;
}

/* --- receive ----------------------------------------------------------------------------------------------------------------------- */

/* Read size, not flags, tells the formats apart. False: contradicts itself. */
static bool from_kernel(hg_can_frame *frame, const struct canfd_frame *raw, size_t size)
{
    const bool fd = size == CANFD_MTU;
    const bool extended = (raw->can_id & CAN_EFF_FLAG) != 0U;
    const bool remote = (raw->can_id & CAN_RTR_FLAG) != 0U;

    if ((!fd && (size != CAN_MTU)) || (raw->len > (fd ? HG_CAN_DATA_MAX : HG_CAN_CLASSIC_MAX)) || (fd && remote)) {
        return false;
    }
    memset(frame, 0, sizeof *frame);
    frame->id = raw->can_id & (extended ? CAN_EFF_MASK : CAN_SFF_MASK);
    frame->flags = (uint8_t)((extended ? HG_CAN_EXTENDED : 0U) | (remote ? HG_CAN_REMOTE : 0U) | (fd ? HG_CAN_FD : 0U)
                             | ((fd && ((raw->flags & CANFD_BRS) != 0U)) ? HG_CAN_BRS : 0U));
    frame->length = raw->len;
    if (!remote) {
        memcpy(frame->data, raw->data, raw->len);
    }
    return true;
}

/* One read. *stamp and the drop count come beside the data. */
static ssize_t read_raw(hg_socketcan *self, struct canfd_frame *raw, struct timespec *stamp)
{
    struct iovec part = {raw, sizeof *raw};
    union {
        struct cmsghdr header;
        unsigned char  bytes[CMSG_SPACE(sizeof(struct timespec)) + CMSG_SPACE(sizeof(uint32_t))];
    } control;
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1U, .msg_control = &control, .msg_controllen = sizeof control};
    const ssize_t size = recvmsg(self->can, &message, MSG_DONTWAIT);

    if (size < 0) {
        return size;
    }
    for (struct cmsghdr *c = CMSG_FIRSTHDR(&message); c != NULL; c = CMSG_NXTHDR(&message, c)) {
        if ((c->cmsg_level == SOL_SOCKET) && (c->cmsg_type == SO_TIMESTAMPNS)) {
            memcpy(stamp, CMSG_DATA(c), sizeof *stamp);
        } else if ((c->cmsg_level == SOL_SOCKET) && (c->cmsg_type == SO_RXQ_OVFL)) {
            uint32_t total;
            memcpy(&total, CMSG_DATA(c), sizeof total);
            hg_hal_count(&self->report.lost, total - self->kernel_lost);
            self->kernel_lost = total;
        } else {
            /* Nothing else was asked for. */
        }
    }
    return size;
}

static hg_status receive_result(hg_socketcan *self)
{
    if ((errno != EAGAIN) && (errno != EINTR)) {
        return failed(self, "recvmsg", HG_E_IO);
    }
    look_whether_up(self);
    return (self->report.bus == HG_BUS_OFF) ? HG_E_BUS : HG_E_EMPTY;
}

static hg_status socketcan_receive(void *object, hg_can_frame *frame, uint64_t *time_us)
{
    hg_socketcan *const self = object;

    for (unsigned i = 0U; i < HG_SOCKETCAN_BURST; i++) {
        struct canfd_frame raw;
        struct timespec stamp = {0, 0};
        const ssize_t size = read_raw(self, &raw, &stamp);

        if ((size < 0) && ((errno == ENETDOWN) || (errno == ENODEV))) {
            interface_down(self);   /* told once, ahead of frames that are still queued */
            continue;
        }
        if (size < 0) {
            return receive_result(self);
        }
        if (((size_t)size >= CAN_MTU) && ((raw.can_id & CAN_ERR_FLAG) != 0U)) {
            take_error_report(self, &raw);
        } else if (!from_kernel(frame, &raw, (size_t)size)) {
            hg_hal_count(&self->report.malformed, 1U);
        } else {
            const uint64_t time = arrival_us(self, &stamp);
            if (time_us != NULL) {
                *time_us = time;
            }
            hg_hal_count(&self->report.received, 1U);
            heard(self);
            return HG_OK;
        }
    }
    return HG_E_EMPTY;   /* a flood of errors must not hold up the caller's deadline; wait returns at once */
}

/* --- wait -------------------------------------------------------------------------------------------------------------------------- */

static hg_status socketcan_wait(void *object, uint64_t until_us)
{
    hg_socketcan *const self = object;
    struct itimerspec at;
    struct epoll_event ready[3];
    int count;

    memset(&at, 0, sizeof at);   /* all zero disarms: no deadline */
    if (until_us != HG_HAL_FOREVER) {
        const uint64_t seconds = until_us / 1000000U;
        at.it_value.tv_sec = (time_t)((seconds > INT32_MAX) ? INT32_MAX : seconds);   /* 68 years will do */
        at.it_value.tv_nsec = (long)((until_us % 1000000U) * 1000U) + ((until_us == 0U) ? 1L : 0L);
    }
    if (timerfd_settime(self->timer, TFD_TIMER_ABSTIME, &at, NULL) != 0) {
        return failed(self, "timerfd_settime", HG_E_IO);
    }
    do {
        count = epoll_wait(self->epoll, ready, 3, -1);
    } while ((count < 0) && (errno == EINTR));   /* a signal that means to stop says so through the stop descriptor */
    if (count < 0) {
        return failed(self, "epoll_wait", HG_E_IO);
    }
    hg_status status = HG_E_EMPTY;
    for (int i = 0; i < count; i++) {
        if (ready[i].data.u32 == (uint32_t)FROM_STOP) {
            return HG_E_IO;
        }
        if (ready[i].data.u32 == (uint32_t)FROM_CAN) {
            status = HG_OK;
        }
    }
    return status;
}

void hg_socketcan_stop(hg_socketcan *self)
{
    const int saved = errno;
    const uint64_t one = 1U;
    const ssize_t written = write(self->stop, &one, sizeof one);   /* fails only when already asked more often than can be counted */

    (void)written;
    errno = saved;
}

/* --- open and close ---------------------------------------------------------------------------------------------------------------- */

static bool set_option(hg_socketcan *self, int level, int name, const void *value, size_t size, const char *what)
{
    if (setsockopt(self->can, level, name, value, (socklen_t)size) != 0) {
        (void)failed(self, what, HG_E_IO);
        return false;
    }
    return true;
}

static bool set_filters(hg_socketcan *self, const hg_socketcan_options *options)
{
    struct can_filter list[HG_SOCKETCAN_FILTERS_MAX];

    if (options->filters == NULL) {
        return true;   /* the socket's default: all data and remote frames */
    }
    for (size_t i = 0U; i < options->filter_count; i++) {
        const hg_hal_filter *const from = &options->filters[i];
        list[i].can_id = from->id & from->mask;
        list[i].can_id |= ((from->flags & HG_CAN_EXTENDED) != 0U) ? CAN_EFF_FLAG : 0U;
        list[i].can_id |= ((from->flags & HG_CAN_REMOTE) != 0U) ? CAN_RTR_FLAG : 0U;
        list[i].can_mask = from->mask | CAN_EFF_FLAG | CAN_RTR_FLAG;   /* without the flags the twins would pass */
    }
    return set_option(self, SOL_CAN_RAW, CAN_RAW_FILTER, (options->filter_count > 0U) ? list : NULL,
                      options->filter_count * sizeof list[0], "CAN_RAW_FILTER");
}

/* The kernel doubles what is asked, and clips it unless the process may pass the limit. */
static bool set_depth(hg_socketcan *self, uint32_t depth)
{
    const int bytes = (int)(depth * (FRAME_COST / 2U));
    int granted = 0;
    socklen_t size = sizeof granted;

    if ((setsockopt(self->can, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes) != 0)
        && !set_option(self, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes, "SO_RCVBUF")) {
        return false;
    }
    if (getsockopt(self->can, SOL_SOCKET, SO_RCVBUF, &granted, &size) != 0) {
        (void)failed(self, "SO_RCVBUF", HG_E_IO);
        return false;
    }
    self->depth = (uint32_t)granted / FRAME_COST;
    if (self->depth > depth) {
        self->depth = depth;
    }
    return true;
}

static bool open_socket(hg_socketcan *self, const hg_socketcan_options *options)
{
    const int on = 1;
    const int off = 0;
    const can_err_mask_t errors = CAN_ERR_MASK;
    struct sockaddr_can address;

    self->can = socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
    if (self->can < 0) {
        (void)failed(self, "socket", HG_E_IO);
        return false;
    }
    if (!set_filters(self, options) || !set_depth(self, (options->depth == 0U) ? HG_SOCKETCAN_DEPTH : options->depth)
        || !set_option(self, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors, "CAN_RAW_ERR_FILTER")
        || !set_option(self, SOL_CAN_RAW, CAN_RAW_LOOPBACK, &on, sizeof on, "CAN_RAW_LOOPBACK")
        || !set_option(self, SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, &off, sizeof off, "CAN_RAW_RECV_OWN_MSGS")
        || !set_option(self, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, options->classic_only ? &off : &on, sizeof on, "CAN_RAW_FD_FRAMES")
        || !set_option(self, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on, "SO_TIMESTAMPNS")
        || !set_option(self, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on, "SO_RXQ_OVFL")) {
        return false;
    }
    memset(&address, 0, sizeof address);
    address.can_family = AF_CAN;
    address.can_ifindex = self->ifindex;
    if (bind(self->can, (const struct sockaddr *)&address, sizeof address) != 0) {
        (void)failed(self, "bind", HG_E_IO);
        return false;
    }
    return true;
}

static void stop_signals(sigset_t *set)
{
    (void)sigemptyset(set);
    (void)sigaddset(set, SIGINT);
    (void)sigaddset(set, SIGTERM);
}

static bool watch(hg_socketcan *self, int descriptor, int from)
{
    struct epoll_event event;

    memset(&event, 0, sizeof event);
    event.events = EPOLLIN;
    event.data.u32 = (uint32_t)from;
    if (epoll_ctl(self->epoll, EPOLL_CTL_ADD, descriptor, &event) != 0) {
        (void)failed(self, "epoll_ctl", HG_E_IO);
        return false;
    }
    return true;
}

static bool open_wait(hg_socketcan *self, bool stop_on_signal)
{
    sigset_t set;

    self->epoll = epoll_create1(EPOLL_CLOEXEC);
    self->timer = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    self->stop = eventfd(0U, EFD_NONBLOCK | EFD_CLOEXEC);
    if ((self->epoll < 0) || (self->timer < 0) || (self->stop < 0)) {
        (void)failed(self, "epoll_create1, timerfd_create or eventfd", HG_E_IO);
        return false;
    }
    if (!watch(self, self->can, FROM_CAN) || !watch(self, self->timer, FROM_TIMER) || !watch(self, self->stop, FROM_STOP)) {
        return false;
    }
    if (!stop_on_signal) {
        return true;
    }
    stop_signals(&set);
    self->signals = signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
    if (self->signals < 0) {
        (void)failed(self, "signalfd", HG_E_IO);
        return false;
    }
    (void)sigprocmask(SIG_BLOCK, &set, NULL);
    return watch(self, self->signals, FROM_STOP);
}

static bool options_valid(const hg_socketcan_options *options)
{
    if ((options->filter_count > HG_SOCKETCAN_FILTERS_MAX) || (options->depth > HG_SOCKETCAN_DEPTH_MAX)
        || ((options->filters == NULL) && (options->filter_count > 0U))) {
        return false;
    }
    for (size_t i = 0U; i < options->filter_count; i++) {
        if (!hg_hal_filter_valid(&options->filters[i])) {
            return false;
        }
    }
    return true;
}

hg_status hg_socketcan_open(hg_socketcan *self, const char *interface, const hg_socketcan_options *options)
{
    static const hg_socketcan_options defaults;

    if (self == NULL) {
        return HG_E_ARGUMENT;
    }
    memset(self, 0, sizeof *self);
    self->error_call = "";
    self->can = self->epoll = self->timer = self->stop = self->signals = -1;
    if (options == NULL) {
        options = &defaults;
    }
    if ((interface == NULL) || (interface[0] == '\0') || (strlen(interface) >= IFNAMSIZ) || !options_valid(options)) {
        return HG_E_ARGUMENT;
    }
    self->classic_only = options->classic_only;
    self->send_tries = (options->send_tries == 0U) ? (uint8_t)HG_SOCKETCAN_TRIES : options->send_tries;
    self->ifindex = (int)if_nametoindex(interface);
    if (self->ifindex == 0) {
        return failed(self, "if_nametoindex", HG_E_BUS);
    }
    if (!open_socket(self, options) || !open_wait(self, options->stop_on_signal)) {
        hg_socketcan_close(self);
        return HG_E_IO;
    }
    self->report.bus = HG_BUS_ACTIVE;
    if (!is_up(self)) {
        interface_down(self);
    }
    return HG_OK;
}

hg_hal hg_socketcan_hal(hg_socketcan *self)
{
    static const hg_hal_ops ops = {socketcan_send, socketcan_receive, socketcan_state, socketcan_now_us, socketcan_wait};

    return (hg_hal){&ops, self};
}

static void close_one(int *descriptor)
{
    if (*descriptor >= 0) {
        (void)close(*descriptor);   /* not tried again on EINTR: Linux has closed it by then */
        *descriptor = -1;
    }
}

void hg_socketcan_close(hg_socketcan *self)
{
    if (self->signals >= 0) {
        struct signalfd_siginfo pending;
        sigset_t set;
        /* A signal that has done its work must not strike once it is unblocked. */
        while (read(self->signals, &pending, sizeof pending) > 0) {
        }
        stop_signals(&set);
        (void)sigprocmask(SIG_UNBLOCK, &set, NULL);
    }
    close_one(&self->signals);
    close_one(&self->can);
    close_one(&self->epoll);
    close_one(&self->timer);
    close_one(&self->stop);
}
