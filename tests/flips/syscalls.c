/* Every system call of the SocketCAN backend fails once, in turn: each call that a session makes, with each errno of its manual page, short reads and writes too.
 * The answer is of the function's list, the descriptors are all closed again, what failed is named, and when the call works again so does the board. Run where
 * vcan0 exists; linked with -Wl,--wrap for each of the calls. */
#define _GNU_SOURCE
#include <dirent.h>
#include <errno.h>
#include <net/if.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/timerfd.h>

#include "socketcan.h"

#define SHORT (-1)   /* the call is made, and tells of fewer bytes */
#define GARBLED (-2) /* it tells of a frame that contradicts itself */

enum { SOCKET, IOCTL, BIND, SETSOCKOPT, GETSOCKOPT, SEND, RECVMSG, EPOLL_CREATE, EPOLL_CTL, EPOLL_WAIT, TIMERFD_CREATE, TIMERFD_SETTIME, EVENTFD, SIGNALFD, READ, CLOSE, NAMETOINDEX, CALLS };

static const struct {
    const char *name;
    int         errors[20]; /* of the manual page; 0 ends the list */
} calls[CALLS] = {
    [SOCKET] = {"socket", {EACCES, EAFNOSUPPORT, EINVAL, EMFILE, ENFILE, ENOBUFS, ENOMEM, EPROTONOSUPPORT}},
    [IOCTL] = {"ioctl", {EBADF, EFAULT, EINVAL, ENOTTY, ENODEV, ENXIO}},
    [BIND] = {"bind", {EACCES, EADDRINUSE, EBADF, EINVAL, ENOTSOCK, EADDRNOTAVAIL, EFAULT, ENOMEM, ENODEV}},
    [SETSOCKOPT] = {"setsockopt", {EBADF, EFAULT, EINVAL, ENOPROTOOPT, ENOTSOCK, ENOMEM, EPERM, ENODEV}},
    [GETSOCKOPT] = {"getsockopt", {EBADF, EFAULT, EINVAL, ENOPROTOOPT, ENOTSOCK}},
    [SEND] = {"send", {EACCES, EAGAIN, EBADF, ECONNRESET, EDESTADDRREQ, EFAULT, EINTR, EINVAL, EISCONN, EMSGSIZE, ENOBUFS, ENOMEM, ENOTCONN, ENOTSOCK, EPIPE, ENETDOWN, ENODEV, ENXIO, SHORT}},
    [RECVMSG] = {"recvmsg", {EAGAIN, EBADF, ECONNREFUSED, EFAULT, EINTR, EINVAL, ENOMEM, ENOTCONN, ENOTSOCK, ENETDOWN, ENODEV, SHORT, GARBLED}},
    [EPOLL_CREATE] = {"epoll_create1", {EINVAL, EMFILE, ENFILE, ENOMEM}},
    [EPOLL_CTL] = {"epoll_ctl", {EBADF, EEXIST, EINVAL, ENOMEM, ENOSPC, EPERM}},
    [EPOLL_WAIT] = {"epoll_wait", {EBADF, EFAULT, EINTR, EINVAL}},
    [TIMERFD_CREATE] = {"timerfd_create", {EINVAL, EMFILE, ENFILE, ENODEV, ENOMEM, EPERM}},
    [TIMERFD_SETTIME] = {"timerfd_settime", {EBADF, EFAULT, EINVAL, ECANCELED}},
    [EVENTFD] = {"eventfd", {EINVAL, EMFILE, ENFILE, ENODEV, ENOMEM}},
    [SIGNALFD] = {"signalfd", {EBADF, EINVAL, EMFILE, ENFILE, ENODEV, ENOMEM}},
    [READ] = {"read", {EAGAIN, EBADF, EFAULT, EINTR, EINVAL, EIO}},
    [CLOSE] = {"close", {EBADF, EINTR, EIO, ENOSPC}},
    [NAMETOINDEX] = {"if_nametoindex", {ENXIO, ENODEV, EMFILE, ENFILE, ENOMEM}},
};

static int  chosen = CALLS; /* call that is to fail */
static int  left;           /* calls until then */
static int  error;
static bool struck;         /* has it failed? */
static bool armed;          /* does the object under test run? */
static const char *step = "";

static bool strikes(int call)
{
    if (!armed || (call != chosen) || struck || (--left > 0)) {
        return false;
    }
    struck = true;
    errno = (error > 0) ? error : 0;
    return true;
}

#define WRAP(call, type, name, parameters, arguments)                     \
    type __real_##name parameters;                                        \
    type __wrap_##name parameters;                                        \
    type __wrap_##name parameters                                         \
    {                                                                     \
        return strikes(call) ? (type)-1 : __real_##name arguments;        \
    }
WRAP(SOCKET, int, socket, (int a, int b, int c), (a, b, c))
WRAP(BIND, int, bind, (int a, const struct sockaddr *b, socklen_t c), (a, b, c))
WRAP(SETSOCKOPT, int, setsockopt, (int a, int b, int c, const void *d, socklen_t e), (a, b, c, d, e))
WRAP(GETSOCKOPT, int, getsockopt, (int a, int b, int c, void *d, socklen_t *e), (a, b, c, d, e))
WRAP(EPOLL_CREATE, int, epoll_create1, (int a), (a))
WRAP(EPOLL_CTL, int, epoll_ctl, (int a, int b, int c, struct epoll_event *d), (a, b, c, d))
WRAP(EPOLL_WAIT, int, epoll_wait, (int a, struct epoll_event *b, int c, int d), (a, b, c, d))
WRAP(TIMERFD_CREATE, int, timerfd_create, (int a, int b), (a, b))
WRAP(TIMERFD_SETTIME, int, timerfd_settime, (int a, int b, const struct itimerspec *c, struct itimerspec *d), (a, b, c, d))
WRAP(EVENTFD, int, eventfd, (unsigned a, int b), (a, b))
WRAP(SIGNALFD, int, signalfd, (int a, const void *b, int c), (a, b, c))
WRAP(READ, ssize_t, read, (int a, void *b, size_t c), (a, b, c))

int __real_ioctl(int descriptor, unsigned long request, void *argument);
int __wrap_ioctl(int descriptor, unsigned long request, void *argument);
int __wrap_ioctl(int descriptor, unsigned long request, void *argument)
{
    return strikes(IOCTL) ? -1 : __real_ioctl(descriptor, request, argument);
}

unsigned __real_if_nametoindex(const char *name);
unsigned __wrap_if_nametoindex(const char *name);
unsigned __wrap_if_nametoindex(const char *name)
{
    return strikes(NAMETOINDEX) ? 0U : __real_if_nametoindex(name);
}

/* Linux has closed the descriptor whatever close() answers. */
int __real_close(int descriptor);
int __wrap_close(int descriptor);
int __wrap_close(int descriptor)
{
    const int done = __real_close(descriptor);
    return strikes(CLOSE) ? -1 : done;
}

ssize_t __real_send(int descriptor, const void *data, size_t size, int flags);
ssize_t __wrap_send(int descriptor, const void *data, size_t size, int flags);
ssize_t __wrap_send(int descriptor, const void *data, size_t size, int flags)
{
    if (strikes(SEND)) {
        return (error == SHORT) ? 3 : -1;
    }
    return __real_send(descriptor, data, size, flags);
}

ssize_t __real_recvmsg(int descriptor, struct msghdr *message, int flags);
ssize_t __wrap_recvmsg(int descriptor, struct msghdr *message, int flags);
ssize_t __wrap_recvmsg(int descriptor, struct msghdr *message, int flags)
{
    if (!strikes(RECVMSG)) {
        return __real_recvmsg(descriptor, message, flags);
    }
    if (error >= 0) {
        return -1;
    }
    message->msg_controllen = 0U;
    memset(message->msg_iov->iov_base, 0x5F, message->msg_iov->iov_len);
    return (error == SHORT) ? 3 : 16;
}

static void fail(const char *what)
{
    printf("FAILED %s with errno %d (%s), in %s: %s\n", (chosen < CALLS) ? calls[chosen].name : "no call", error, (error > 0) ? strerror(error) : "short or garbled", step, what);
    exit(1);
}

static void expect(bool holds, const char *what)
{
    if (!holds) {
        fail(what);
    }
}

static unsigned descriptors(void)
{
    unsigned count = 0U;
    DIR *folder = opendir("/proc/self/fd");
    if (folder == NULL) {
        fail("/proc/self/fd cannot be read");
        return 0U;
    }
    while (readdir(folder) != NULL) {
        count++;
    }
    (void)closedir(folder);
    return count;
}

static const hg_can_frame sent = {.id = 0x123U, .length = 3U, .data = {1U, 2U, 3U}};

/* Open; where that failed the object is closed, says what it was, and opens when asked again. */
static void opens(hg_socketcan *self, unsigned before)
{
    static const hg_hal_filter filter = {.id = 0x123U, .mask = HG_CAN_ID_EXTENDED};
    static const hg_socketcan_options options = {.filters = &filter, .filter_count = 1U, .stop_on_signal = true};
    step = "open";
    armed = true;
    const hg_status status = hg_socketcan_open(self, "vcan0", &options);
    armed = false;
    expect((status == HG_OK) || (status == HG_E_BUS) || (status == HG_E_IO), "a status that open does not name");
    if (status != HG_OK) {
        expect(struck, "refused without a cause");
        expect((status == HG_E_BUS) == (chosen == NAMETOINDEX), "HG_E_BUS is for a name that is not there");
        expect((self->error_call[0] != '\0') && (self->error_number == error), "what failed is not named");
        expect(descriptors() == before, "a descriptor is left open");
        hg_socketcan_close(self);
        expect(hg_socketcan_open(self, "vcan0", &options) == HG_OK, "does not open when the call works again");
    }
}

static void sends(hg_hal board, hg_hal other)
{
    hg_can_frame got;
    bool done = false;
    step = "send";
    for (unsigned i = 0U; (i < 4U) && !done; i++) {
        armed = true;
        const hg_status status = hg_hal_send(&board, &sent);
        armed = false;
        expect((status == HG_OK) || (status == HG_E_BUSY) || (status == HG_E_BUS) || (status == HG_E_FORMAT) || (status == HG_E_IO), "a status that send does not name");
        expect((status == HG_OK) || struck, "refused without a cause");
        done = status == HG_OK;
    }
    expect(done, "does not send when the call works again");
    expect(hg_hal_wait(&other, hg_hal_now_us(&other) + 2000000U) == HG_OK, "the frame has not arrived");
    expect((hg_hal_receive(&other, &got, NULL) == HG_OK) && (got.id == sent.id) && (got.length == sent.length), "another frame has arrived");
    expect(hg_hal_receive(&other, &got, NULL) == HG_E_EMPTY, "it was sent twice");
}

static void receives(hg_hal board, hg_hal other)
{
    hg_can_frame got;
    bool done = false;
    step = "receive";
    expect(hg_hal_send(&other, &sent) == HG_OK, "the other one does not send");
    for (unsigned i = 0U; (i < 6U) && !done; i++) {
        armed = true;
        const hg_status woke = hg_hal_wait(&board, hg_hal_now_us(&board) + 200000U);
        const hg_status status = hg_hal_receive(&board, &got, NULL);
        armed = false;
        expect((woke == HG_OK) || (woke == HG_E_EMPTY) || (woke == HG_E_IO), "a status that wait does not name");
        expect((woke != HG_E_IO) || (struck && (error != EINTR)), "asked to stop by nobody");
        expect((status == HG_OK) || (status == HG_E_EMPTY) || (status == HG_E_BUS) || (status == HG_E_IO), "a status that receive does not name");
        done = status == HG_OK;
    }
    expect(done && (got.id == sent.id) && (got.length == sent.length) && (memcmp(got.data, sent.data, sent.length) == 0), "does not receive when the call works again");
}

static void rests(hg_hal board)
{
    hg_hal_report report;
    step = "state and wait";
    armed = true;
    hg_hal_state(&board, &report);
    const uint64_t until = hg_hal_now_us(&board) + 2000U;
    const hg_status woke = hg_hal_wait(&board, until);
    armed = false;
    expect((woke == HG_E_EMPTY) || (struck && (error != EINTR)), "woken by nothing");
    expect((woke != HG_E_EMPTY) || (hg_hal_now_us(&board) >= until), "woken early");
    hg_hal_state(&board, &report);
    hg_hal_state(&board, &report);
    expect(report.bus == HG_BUS_ACTIVE, "the bus is not active when the call works again");
}

/* One session, in which one call fails; false: there were not so many of them. */
static bool session(int call, int nth, int how)
{
    hg_socketcan self;
    hg_socketcan other;
    hg_hal_report report;
    chosen = call;
    left = nth;
    error = how;
    struck = false;
    step = "the other board";
    expect(hg_socketcan_open(&other, "vcan0", NULL) == HG_OK, "does not open");
    const unsigned before = descriptors();
    opens(&self, before);
    const hg_hal board = hg_socketcan_hal(&self);
    const hg_hal counterpart = hg_socketcan_hal(&other);
    hg_hal_state(&board, &report);
    sends(board, counterpart);
    receives(board, counterpart);
    rests(board);
    step = "close";
    armed = true;
    hg_socketcan_close(&self);
    armed = false;
    expect(descriptors() == before, "a descriptor is left open");
    hg_socketcan_close(&other);
    return struck;
}

int main(void)
{
    unsigned sessions = 0U;
    (void)setvbuf(stdout, NULL, _IOLBF, 0);
    (void)session(CALLS, 1, 0);
    for (int call = 0; call < CALLS; call++) {
        for (unsigned e = 0U; calls[call].errors[e] != 0; e++) {
            int nth = 1;
            while (session(call, nth, calls[call].errors[e])) {
                nth++;
                sessions++;
            }
            if (nth == 1) {
                chosen = call;
                fail("the backend never makes this call");
            }
        }
    }
    printf("  ok  %u failures of %d system calls of the SocketCAN backend: answered, nothing left open, working again\n", sessions, (int)CALLS);
    return 0;
}
