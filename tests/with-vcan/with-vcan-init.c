/* Process 1 of the User-Mode-Linux guest that with-vcan boots. Its root file system is the host's, through hostfs.
 *
 * From the kernel's command line (init's environment): wv_dir, a folder on the host; wv_n, how many vcan interfaces to make.
 * The folder holds the job:  argv  the command    env  its environment    cwd  its working folder   (a NUL after each word)
 * and receives:              up    CLOCK_REALTIME in us when the command starts    rc  its exit status
 * Serial lines: ttyS0 carries the command's stdout, ttyS1 its stderr (it sees pipes, no terminal); a byte that comes in on ttyS0 is the
 * number of a signal for the command's process group. What goes wrong here is written to stderr, the console, and powers the guest off.
 *
 * Built static, so that it needs nothing of the guest but the kernel. */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <linux/if_link.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/reboot.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/utsname.h>
#include <sys/wait.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

typedef struct {
    int   out[2];      /* serial lines for the command's stdout and stderr */
    int   from[2];     /* pipes from the command, -1 when closed */
    int   null;
    pid_t child;
    bool  ended;
} guest;

static _Noreturn void power_off(void)
{
    sync();
    (void)reboot(RB_POWER_OFF);
    _exit(1);
}

static _Noreturn void die(const char *what)
{
    (void)fprintf(stderr, "with-vcan-init: %s: %s\n", what, strerror(errno));
    power_off();
}

/* --- the job's folder -------------------------------------------------------------------------------------------------------------- */

static int open_in(const char *dir, const char *name, int flags)
{
    char path[4200];

    (void)snprintf(path, sizeof path, "%s/%s", dir, name);
    const int fd = open(path, flags | O_CLOEXEC, 0600);
    if (fd < 0) {
        die(path);
    }
    return fd;
}

/* Words with a NUL after each, as a vector that ends with a null pointer. Mapped, because a command line may have any length. */
static char **words(const char *dir, const char *name)
{
    struct stat info;
    const int fd = open_in(dir, name, O_RDONLY);

    if (fstat(fd, &info) != 0) {
        die(name);
    }
    const size_t size = (size_t)info.st_size;
    char *text = mmap(NULL, size + 1U, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    char **list = mmap(NULL, (size + 1U) * sizeof *list, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if ((text == MAP_FAILED) || (list == MAP_FAILED)) {
        die(name);
    }
    for (size_t have = 0U; have < size;) {
        const ssize_t got = read(fd, text + have, size - have);
        if (got <= 0) {
            die(name);
        }
        have += (size_t)got;
    }
    (void)close(fd);
    size_t count = 0U;
    for (char *word = text; word < (text + size); word += strlen(word) + 1U) {
        list[count++] = word;
    }
    return list;
}

static void note(const char *dir, const char *name, long long value)
{
    const int fd = open_in(dir, name, O_WRONLY | O_CREAT | O_TRUNC);

    if (dprintf(fd, "%lld\n", value) < 0) {
        die(name);
    }
    (void)close(fd);
}

/* --- the machine ------------------------------------------------------------------------------------------------------------------- */

static void mount_all(void)
{
    static const char *const table[][2] = {{"proc", "/proc"}, {"sysfs", "/sys"}, {"devtmpfs", "/dev"}, {"devpts", "/dev/pts"},
                                           {"tmpfs", "/dev/shm"}, {"tmpfs", "/run"}};

    for (size_t i = 0U; i < (sizeof table / sizeof table[0]); i++) {
        if (strncmp(table[i][1], "/dev/", 5U) == 0) {
            (void)mkdir(table[i][1], 0755);   /* in the guest's own devtmpfs, never on the host */
        }
        if ((mount(table[i][0], table[i][1], table[i][0], 0U, NULL) != 0) && (errno != EBUSY)) {
            die(table[i][1]);
        }
    }
    if ((symlink("/proc/self/fd", "/dev/fd") != 0) || (symlink("fd/0", "/dev/stdin") != 0) || (symlink("fd/1", "/dev/stdout") != 0)
        || (symlink("fd/2", "/dev/stderr") != 0)) {
        die("/dev/fd");
    }
}

/* There is no modprobe in the guest, so in order of dependence. What is absent is built in, or this kernel does not have it. */
static void load_modules(void)
{
    static const char *const modules[] = {
        "net/can/can", "net/can/can-raw", "net/can/can-bcm", "net/can/can-gw", "net/can/can-isotp", "net/can/j1939/can-j1939",
        "drivers/net/can/dev/can-dev", "drivers/net/can/vcan", "drivers/net/can/vxcan", "drivers/net/can/slcan/slcan",
        "net/sched/sch_netem",
    };
    struct utsname kernel;

    (void)uname(&kernel);
    for (size_t i = 0U; i < (sizeof modules / sizeof modules[0]); i++) {
        char path[512];
        (void)snprintf(path, sizeof path, "/usr/lib/uml/modules/%s/kernel/%s.ko", kernel.release, modules[i]);
        const int fd = open(path, O_RDONLY | O_CLOEXEC);
        if (fd < 0) {
            continue;
        }
        if ((syscall(SYS_finit_module, fd, "", 0) != 0) && (errno != EEXIST)) {
            die(path);
        }
        (void)close(fd);
    }
}

/* --- the network, by netlink, because starting ip would cost more than the rest of the boot ----------------------------------------- */

typedef union {
    struct nlmsghdr header;
    char            bytes[512];
} request;

static void add_attribute(request *q, unsigned short type, const void *data, size_t size)
{
    struct rtattr attribute = {.rta_type = type, .rta_len = (unsigned short)RTA_LENGTH(size)};
    char *const at = q->bytes + NLMSG_ALIGN(q->header.nlmsg_len);

    memcpy(at, &attribute, sizeof attribute);
    if (size > 0U) {
        memcpy(at + RTA_LENGTH(0), data, size);
    }
    q->header.nlmsg_len = NLMSG_ALIGN(q->header.nlmsg_len) + (__u32)RTA_ALIGN(RTA_LENGTH(size));
}

static void add_vcan(int netlink, const char *name)
{
    static const unsigned mtu = 72U;   /* lets CAN FD frames through */
    union {
        struct nlmsghdr header;
        struct {
            struct nlmsghdr header;
            struct nlmsgerr error;
        } reply;
        char bytes[1024];
    } answer;
    const struct ifinfomsg info = {.ifi_flags = IFF_UP, .ifi_change = IFF_UP};
    /* IFLA_LINKINFO wraps the attribute IFLA_INFO_KIND = "vcan" */
    const struct {
        struct rtattr kind;
        char          name[4];
    } link = {{(unsigned short)RTA_LENGTH(4), IFLA_INFO_KIND}, {'v', 'c', 'a', 'n'}};
    request q;

    memset(&q, 0, sizeof q);
    q.header.nlmsg_type = RTM_NEWLINK;
    q.header.nlmsg_flags = NLM_F_REQUEST | NLM_F_CREATE | NLM_F_EXCL | NLM_F_ACK;
    q.header.nlmsg_len = NLMSG_LENGTH(sizeof info);
    memcpy(q.bytes + NLMSG_HDRLEN, &info, sizeof info);
    add_attribute(&q, IFLA_IFNAME, name, strlen(name) + 1U);
    add_attribute(&q, IFLA_MTU, &mtu, sizeof mtu);
    add_attribute(&q, IFLA_LINKINFO, &link, sizeof link);
    if ((send(netlink, &q, q.header.nlmsg_len, 0) < 0) || (recv(netlink, &answer, sizeof answer, 0) < 0)) {
        die("netlink");
    }
    if ((answer.header.nlmsg_type == NLMSG_ERROR) && (answer.reply.error.error != 0)) {
        errno = -answer.reply.error.error;
        die(name);
    }
}

static void network(int count)
{
    struct ifreq loopback = {.ifr_name = "lo", .ifr_flags = IFF_UP | IFF_RUNNING};
    const int any = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    const int netlink = socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC, NETLINK_ROUTE);

    if ((any < 0) || (netlink < 0)) {
        die("socket");
    }
    (void)ioctl(any, SIOCSIFFLAGS, &loopback);   /* no use to CAN; a guest without it is still good */
    for (int i = 0; i < count; i++) {
        char name[IFNAMSIZ];
        (void)snprintf(name, sizeof name, "vcan%d", i);
        add_vcan(netlink, name);
    }
    (void)close(any);
    (void)close(netlink);
}

/* --- the command ------------------------------------------------------------------------------------------------------------------- */

static int open_serial(const char *device, int flags)
{
    struct termios mode;
    const int fd = open(device, flags | O_NOCTTY | O_CLOEXEC);

    if ((fd < 0) || (tcgetattr(fd, &mode) != 0)) {
        die(device);
    }
    cfmakeraw(&mode);
    (void)tcsetattr(fd, TCSANOW, &mode);
    return fd;
}

static _Noreturn void run(const guest *g, const char *dir, const int *pipes, const sigset_t *mask)
{
    char **const argv = words(dir, "argv");
    char **const env = words(dir, "env");
    char **const cwd = words(dir, "cwd");

    (void)signal(SIGCHLD, SIG_DFL);
    (void)sigprocmask(SIG_SETMASK, mask, NULL);
    (void)setsid();
    (void)dup2(g->null, STDIN_FILENO);
    (void)dup2(pipes[0], STDOUT_FILENO);
    (void)dup2(pipes[1], STDERR_FILENO);
    if ((cwd[0] == NULL) || (chdir(cwd[0]) != 0)) {
        perror("with-vcan: working folder");
        _exit(125);
    }
    environ = env;   /* before execvp, which looks into PATH */
    (void)execvp(argv[0], argv);
    const int why = errno;
    (void)fprintf(stderr, "with-vcan: %s: %s\n", argv[0], strerror(why));
    _exit((why == ENOENT) ? 127 : 126);
}

static void on_child(int number)
{
    (void)number;   /* interrupts ppoll, no more */
}

static void reap(guest *g, const char *dir, int options)
{
    int status;

    for (;;) {
        const pid_t who = waitpid(-1, &status, options);
        if ((who < 0) && (errno == EINTR)) {
            continue;
        }
        if (who <= 0) {
            return;
        }
        if (who == g->child) {
            g->ended = true;
            note(dir, "rc", WIFSIGNALED(status) ? (128 + WTERMSIG(status)) : WEXITSTATUS(status));
            (void)kill(-1, SIGKILL);   /* what it left running would keep the pipes open */
        }
    }
}

static void write_all(int fd, const char *bytes, size_t count)
{
    while (count > 0U) {
        const ssize_t written = write(fd, bytes, count);
        if ((written < 0) && (errno != EINTR)) {
            return;   /* nobody reads it any more */
        }
        if (written > 0) {
            bytes += written;
            count -= (size_t)written;
        }
    }
}

static void pass_signals(const guest *g, int control)
{
    unsigned char number;

    if ((read(control, &number, 1U) == 1) && !g->ended) {
        (void)kill(-g->child, (int)number);
    }
}

/* Until the command's pipes are closed, by it or by its end. SIGCHLD is let in only while polling, so that none is missed. */
static void relay(guest *g, const char *dir, const sigset_t *mask)
{
    char buffer[32768];

    while ((g->from[0] >= 0) || (g->from[1] >= 0)) {
        struct pollfd list[3] = {{g->from[0], POLLIN, 0}, {g->from[1], POLLIN, 0}, {g->out[0], POLLIN, 0}};
        reap(g, dir, WNOHANG);
        if (ppoll(list, 3U, NULL, mask) < 0) {
            continue;
        }
        if ((list[2].revents & POLLIN) != 0) {
            pass_signals(g, g->out[0]);
        }
        for (size_t i = 0U; i < 2U; i++) {
            if ((g->from[i] < 0) || (list[i].revents == 0)) {
                continue;
            }
            const ssize_t got = read(g->from[i], buffer, sizeof buffer);
            if (got > 0) {
                write_all(g->out[i], buffer, (size_t)got);
            } else {
                g->from[i] = -1;
            }
        }
    }
    reap(g, dir, 0);   /* it may have closed its output and gone on */
    (void)tcdrain(g->out[0]);
    (void)tcdrain(g->out[1]);
}

static void start(guest *g, const char *dir, const sigset_t *mask)
{
    int out[2];
    int err[2];
    struct timespec now;

    if ((pipe2(out, O_CLOEXEC) != 0) || (pipe2(err, O_CLOEXEC) != 0)) {
        die("pipe2");
    }
    (void)clock_gettime(CLOCK_REALTIME, &now);
    note(dir, "up", ((long long)now.tv_sec * 1000000LL) + ((long long)now.tv_nsec / 1000LL));
    g->child = fork();
    if (g->child < 0) {
        die("fork");
    }
    if (g->child == 0) {
        const int pipes[2] = {out[1], err[1]};
        run(g, dir, pipes, mask);
    }
    (void)close(out[1]);
    (void)close(err[1]);
    g->from[0] = out[0];
    g->from[1] = err[0];
}

int main(void)
{
    const char *const dir = getenv("wv_dir");
    const char *const count = getenv("wv_n");
    guest g = {.ended = false};
    sigset_t block;
    sigset_t open_mask;

    mount_all();
    g.null = open("/dev/null", O_RDWR | O_CLOEXEC);
    const int console = open("/dev/console", O_WRONLY | O_NOCTTY | O_CLOEXEC);
    (void)dup2(g.null, STDIN_FILENO);
    (void)dup2(g.null, STDOUT_FILENO);
    (void)dup2((console < 0) ? g.null : console, STDERR_FILENO);
    if ((dir == NULL) || (count == NULL)) {
        errno = EINVAL;
        die("wv_dir, wv_n");
    }
    load_modules();
    network(atoi(count));
    g.out[0] = open_serial("/dev/ttyS0", O_RDWR);
    g.out[1] = open_serial("/dev/ttyS1", O_WRONLY);

    (void)sigemptyset(&block);
    (void)sigaddset(&block, SIGCHLD);
    (void)sigprocmask(SIG_BLOCK, &block, &open_mask);
    (void)signal(SIGCHLD, on_child);
    start(&g, dir, &open_mask);
    relay(&g, dir, &open_mask);
    power_off();
}
