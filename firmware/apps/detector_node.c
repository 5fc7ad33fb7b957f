/** @file
 *  A detector ECU on Linux: a model's node (hullguard/node.h, or hullguard/tracker.h of a fusion filter) on a CAN interface (hal/socketcan).
 *
 *  In lockstep every closing frame is answered with a verdict and no clock is looked at. Otherwise a deadline timer watches the closing
 *  frames: it is set anew by each one, and a sample whose closing frame is overdue is closed without it. Where time and steps have come
 *  apart by more than a stamp can tell, as after the process was stopped, the node is told of an outage. */
#define _POSIX_C_SOURCE 200809L

#include "socketcan.h"
#include "units.h"

#include <errno.h>
#include <getopt.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define VERSION "0.1.0"
#define EXIT_FAILED 1
#define EXIT_INPUT 2
#define EXIT_BUS 3

#define SECOND_US 1000000U
#define PERIOD_MAX_MS 3600000.0
#define MISSES_MAX 4096U           /* entries of the timing file; more are counted only */
#define STAMPS_AHEAD 7U            /* samples without a closing frame that the next one's stamp still tells (node.h) */
#define BEHIND_MAX 255U            /* overdue samples caught up with; by then every group is stale (hold.h) */
#define PAUSE_FIRST_US 250U        /* of a send's backoff, doubled each time */
#define PAUSE_ALL_MAX_US 50000U    /* longest time one frame is offered to a bus that has no room */
#define FILTERS_MAX (HG_FUSION_SENSORS_MAX + 1U) /* every sensor and the tick; of a detector every group, and requests */

_Static_assert((HG_GROUPS_MAX + 1U) <= FILTERS_MAX, "a filter for every group, and for requests");
_Static_assert(FILTERS_MAX <= HG_SOCKETCAN_FILTERS_MAX, "a filter for every sensor and the tick");

typedef struct {
    app_unit         unit;         /* of the model, started or not */
    const char      *interface;
    const char      *timing;       /* file name or null */
    const char      *health;       /* the same */
    hg_start         how;
    bool             lockstep;
    bool             status;
    uint64_t         period_us;    /* between two closing frames */
    uint64_t         slack_us;     /* how much later than that a closing frame may be */
    uint64_t         samples;      /* 0: without end */
} options;

typedef struct {
    uint64_t due_us;               /* when the closing frame was overdue */
    uint64_t noticed_us;           /* when this program saw it */
    uint32_t k;
} miss;

typedef struct {
    options      options;
    hg_socketcan can;
    hg_hal       hal;
    hg_verdict   verdict;          /* of the last step */
    uint64_t     deadline_us;      /* HG_HAL_FOREVER: no closing frame is waited for */
    uint64_t     status_us;        /* time of the next status line */
    uint64_t     steps;
    uint64_t     unsent;           /* frames that found no room or no bus */
    uint64_t     missed;           /* deadlines since the first closing frame */
    uint64_t     outages;          /* told to the node */
    uint64_t     closing_us;       /* arrival of the last accepted closing frame */
    uint64_t     closing_steps;    /* `steps` after its own */
    uint32_t     received;         /* frames at the last status line */
    bool         ticking;          /* has a closing frame come? */
} app;

static miss misses[MISSES_MAX];

/* ---- options ---- */

static const char usage[] =
    "usage: detector_node [options]\n"
    "  --model NAME       model to run (platoon)\n"
    "  --interface NAME   CAN interface (vcan0)\n"
    "  --lockstep         answer every closing frame with a verdict, use no timer\n"
    "  --rest             the plant starts within its initial range at sample 0, which is waited for; without it, the plant may be\n"
    "                     anywhere in its operating range, and a bus without closing frames is reported from the start\n"
    "  --period MS        time between two closing frames (the model's sample time)\n"
    "  --deadline MS      how much later a closing frame may be before the sample is closed without it (half the period)\n"
    "  --samples N        stop after N samples (0: never)\n"
    "  --status           print a line of status every second\n"
    "  --timing FILE      when done, write the missed deadlines to FILE\n"
    "  --health FILE      when done, write every counter of every group to FILE; of a fusion filter the digest of its states, too\n"
    "  --list             print the models compiled in, each with its hash, and end\n"
    "  --help, --version\n"
    "Prints 'ready' when it listens. SIGINT and SIGTERM end it. Exit status: 0 done, 1 failed, 2 bad option, 3 the bus cannot be opened.\n";

static const char *real_name(void)
{
    return (sizeof(hg_real) == sizeof(float)) ? "f32" : "f64";
}

static int refuse(const char *what, const char *value, const char *cure)
{
    (void)fprintf(stderr, "detector_node: %s '%s': %s\n", what, value, cure);
    return EXIT_INPUT;
}

static int refuse_model(const char *name)
{
    (void)fprintf(stderr, "detector_node: --model '%s': not compiled in; choose one of:", name);
    app_unit known;
    for (size_t i = 0U; app_unit_at(&known, i); i++) {
        (void)fprintf(stderr, " %s", app_unit_name(&known));
    }
    (void)fprintf(stderr, "\n");
    return EXIT_INPUT;
}

/* Milliseconds, fractions allowed, as microseconds; false when it is no such number. */
static bool read_ms(const char *text, double least, uint64_t *us)
{
    char *end = NULL;
    const double ms = strtod(text, &end);
    const bool good = (end != text) && (*end == '\0') && (ms >= least) && (ms <= PERIOD_MAX_MS);
    *us = good ? (uint64_t)((ms * 1000.0) + 0.5) : 0U;
    return good;
}

static bool read_count(const char *text, uint64_t *count)
{
    char *end = NULL;
    errno = 0;
    *count = strtoull(text, &end, 10);
    return (text[0] >= '0') && (text[0] <= '9') && (*end == '\0') && (errno == 0);
}

enum {
    OPTION_MODEL = 256, /* above every character: there are no short options */
    OPTION_INTERFACE,
    OPTION_LOCKSTEP,
    OPTION_REST,
    OPTION_PERIOD,
    OPTION_DEADLINE,
    OPTION_SAMPLES,
    OPTION_STATUS,
    OPTION_TIMING,
    OPTION_HEALTH,
    OPTION_LIST,
    OPTION_HELP,
    OPTION_VERSION
};

static void list_models(void)
{
    app_unit known;
    for (size_t i = 0U; app_unit_at(&known, i); i++) {
        (void)printf("%s %08lx\n", app_unit_name(&known), (unsigned long)app_unit_hash(&known));
    }
}

/* -1: go on; else the exit status. */
static int take_option(options *self, int option, const char *value)
{
    switch (option) {
    case OPTION_MODEL:
        return app_unit_find(&self->unit, value) ? -1 : refuse_model(value);
    case OPTION_INTERFACE:
        self->interface = value;
        return -1;
    case OPTION_LOCKSTEP:
        self->lockstep = true;
        return -1;
    case OPTION_REST:
        self->how = HG_START_REST;
        return -1;
    case OPTION_PERIOD:
        return read_ms(value, 0.001, &self->period_us) ? -1 : refuse("--period", value, "milliseconds, 0.001 .. 3600000");
    case OPTION_DEADLINE:
        return read_ms(value, 0.0, &self->slack_us) ? -1 : refuse("--deadline", value, "milliseconds, 0 .. 3600000");
    case OPTION_SAMPLES:
        return read_count(value, &self->samples) ? -1 : refuse("--samples", value, "a whole number, 0 for no end");
    case OPTION_STATUS:
        self->status = true;
        return -1;
    case OPTION_TIMING:
        self->timing = value;
        return -1;
    case OPTION_HEALTH:
        self->health = value;
        return -1;
    case OPTION_LIST:
        list_models();
        return EXIT_SUCCESS;
    case OPTION_HELP:
        (void)fputs(usage, stdout);
        return EXIT_SUCCESS;
    case OPTION_VERSION:
        (void)printf("detector_node %s (%s)\n", VERSION, real_name());
        return EXIT_SUCCESS;
    default:
        return EXIT_INPUT;
    }
}

static int read_options(options *self, int argc, char **argv)
{
    static const struct option known[] = {
        {"model", required_argument, NULL, OPTION_MODEL},       {"interface", required_argument, NULL, OPTION_INTERFACE},
        {"lockstep", no_argument, NULL, OPTION_LOCKSTEP},       {"rest", no_argument, NULL, OPTION_REST},
        {"period", required_argument, NULL, OPTION_PERIOD},     {"deadline", required_argument, NULL, OPTION_DEADLINE},
        {"samples", required_argument, NULL, OPTION_SAMPLES},   {"status", no_argument, NULL, OPTION_STATUS},
        {"timing", required_argument, NULL, OPTION_TIMING},     {"help", no_argument, NULL, OPTION_HELP},
        {"version", no_argument, NULL, OPTION_VERSION},         {"list", no_argument, NULL, OPTION_LIST},
        {"health", required_argument, NULL, OPTION_HEALTH},
        {NULL, 0, NULL, 0},
    };
    *self = (options){.interface = "vcan0", .how = HG_START_MOVING, .slack_us = UINT64_MAX};
    (void)app_unit_at(&self->unit, 0U);
    int result = -1;
    int option = 0;
    opterr = 0; /* errors are told here, in the words of all others */
    while ((result == -1) && (option != -1)) {
        option = getopt_long(argc, argv, ":", known, NULL);
        if (option == '?') {
            result = refuse("option", argv[optind - 1], "unknown; see detector_node --help");
        } else if (option == ':') {
            result = refuse("option", argv[optind - 1], "needs a value; see detector_node --help");
        } else if (option != -1) {
            result = take_option(self, option, optarg);
        } else {
            /* all read */
        }
    }
    if ((result == -1) && (optind < argc)) {
        result = refuse("argument", argv[optind], "not expected; see detector_node --help");
    }
    self->period_us = ((self->period_us == 0U) && (result == -1)) ? app_unit_sample_time_us(&self->unit) : self->period_us;
    self->slack_us = (self->slack_us == UINT64_MAX) ? (self->period_us / 2U) : self->slack_us;
    return result;
}

/* ---- bus ---- */

static int refuse_bus(const app *self, hg_status status)
{
    const char *name = self->options.interface;
    const int number = self->can.error_number;
    if (status == HG_E_ARGUMENT) {
        return refuse("--interface", name, "an interface's name has 1 .. 15 characters");
    }
    if (status == HG_E_BUS) {
        (void)fprintf(stderr, "detector_node: no CAN interface '%s': name one with --interface, or make it: "
                              "ip link add %s type vcan && ip link set %s up\n", name, name, name);
    } else if (number == EAFNOSUPPORT) {
        (void)fprintf(stderr, "detector_node: this kernel has no CAN (%s: %s): load can_raw, or run under with-vcan\n",
                      self->can.error_call, strerror(number));
    } else {
        (void)fprintf(stderr, "detector_node: CAN interface '%s' cannot be opened (%s: %s): check the user's rights and limits\n",
                      name, self->can.error_call, strerror(number));
    }
    return EXIT_BUS;
}

static hg_hal_filter filter_of(const hg_message *message)
{
    return (hg_hal_filter){.id = message->id, .mask = HG_CAN_ID_EXTENDED, .flags = message->flags & HG_CAN_EXTENDED};
}

/* Only the groups' frames and requests are of interest: the kernel drops all others. */
static hg_status open_bus(app *self)
{
    hg_hal_filter filter[FILTERS_MAX];
    const hg_message *request = app_unit_request(&self->options.unit);
    uint8_t count = app_unit_links(&self->options.unit);
    for (uint8_t i = 0U; i < count; i++) {
        filter[i] = filter_of(app_unit_message(&self->options.unit, i));
    }
    if (request != NULL) {
        filter[count] = filter_of(request);
        count++;
    }
    const hg_socketcan_options wanted = {.filters = filter, .filter_count = count, .stop_on_signal = true};
    const hg_status status = hg_socketcan_open(&self->can, self->options.interface, &wanted);
    if (status == HG_OK) {
        self->hal = hg_socketcan_hal(&self->can);
    }
    return status;
}

static void pause_us(uint64_t us)
{
    const struct timespec time = {.tv_sec = (time_t)(us / SECOND_US), .tv_nsec = (long)(us % SECOND_US) * 1000L};
    (void)nanosleep(&time, NULL); /* a signal may cut it short: the next try comes sooner */
}

/* A frame is offered for a quarter of a period at most: the next sample must not wait for this one's verdict. */
static void send_frame(app *self, const hg_can_frame *frame)
{
    uint64_t left_us = self->options.period_us / 4U;
    left_us = ((left_us > PAUSE_ALL_MAX_US) || self->options.lockstep) ? PAUSE_ALL_MAX_US : left_us;
    uint64_t next_us = PAUSE_FIRST_US;
    hg_status status = hg_hal_send(&self->hal, frame);
    while ((status == HG_E_BUSY) && (next_us <= left_us)) {
        pause_us(next_us);
        left_us -= next_us;
        next_us *= 2U;
        status = hg_hal_send(&self->hal, frame);
    }
    self->unsent += (status == HG_OK) ? 0U : 1U; /* the heartbeat says it again */
}

/* ---- node ---- */

static bool finished(const app *self)
{
    return (self->options.samples > 0U) && (self->steps >= self->options.samples);
}

/* What answers requests for the freeze frame. */
static void answer(app *self)
{
    hg_can_frame frame;
    while (app_unit_freeze(&self->options.unit, &frame) == HG_OK) {
        send_frame(self, &frame);
    }
}

static void make_steps(app *self)
{
    hg_can_frame frame[APP_FRAMES_MAX];
    app_unit *unit = &self->options.unit;
    while ((!finished(self)) && (app_unit_step(unit, &self->verdict) == HG_OK)) {
        const bool reply = self->options.lockstep && (app_unit_due(unit) == 0U);
        const uint8_t frames = app_unit_report(unit, &self->verdict, reply, frame);
        for (uint8_t i = 0U; i < frames; i++) {
            send_frame(self, &frame[i]);
        }
        self->steps++;
    }
    answer(self);
}

/* Has this node fallen behind its sender by more samples than a stamp can tell? Frames that waited for a stopped process carry the time of
 * their arrival. Any frame of the model tells, not the closing one alone: a measurement could be booked to a sample 16 earlier. */
static uint64_t samples_behind(const app *self, uint64_t at_us)
{
    const uint64_t period_us = self->options.period_us;
    const uint64_t elapsed = ((at_us - self->closing_us) + (period_us / 2U)) / period_us;
    const uint64_t closed = (self->steps - self->closing_steps) + 1U;
    return (elapsed > closed) ? (elapsed - closed) : 0U;
}

/* The frame's time of arrival says how far ahead of this node its sender can be; without a clock nothing is said. */
static void look_at_clock(app *self, uint64_t at_us)
{
    if (self->options.lockstep || (!app_unit_closed(&self->options.unit)) || (at_us < self->closing_us)) {
        return;
    }
    const uint64_t behind = samples_behind(self, at_us);
    app_unit_expect(&self->options.unit, (behind > STAMPS_AHEAD) ? STAMPS_AHEAD : (uint32_t)behind);
    if (behind > STAMPS_AHEAD) {
        app_unit_outage(&self->options.unit);
        self->outages++;
    }
}

static void take_frame(app *self, const hg_can_frame *frame, uint64_t at_us)
{
    look_at_clock(self, at_us);
    const app_unit *unit = &self->options.unit;
    if (app_unit_receive(unit, frame) == HG_E_BUSY) {
        make_steps(self);
        (void)app_unit_receive(unit, frame);
    }
    const bool closing = app_unit_due(unit) > 0U; /* also one whose numbers could not be used */
    make_steps(self);
    if (closing) { /* the next one is expected a period later */
        self->ticking = true;
        self->closing_us = at_us;
        self->closing_steps = self->steps;
        self->deadline_us = self->options.lockstep ? HG_HAL_FOREVER : (at_us + self->options.period_us + self->options.slack_us);
    }
}

/* Sample by sample. `now_us` is from before the frames were taken: what has arrived in time is never overtaken by the timer, even where this process was held up. */
static void look_at_deadline(app *self, uint64_t now_us)
{
    if (now_us < self->deadline_us) {
        return;
    }
    if (self->ticking) {
        if (self->missed < MISSES_MAX) {
            misses[self->missed] = (miss){.due_us = self->deadline_us, .noticed_us = now_us, .k = app_unit_k(&self->options.unit)};
        }
        self->missed++;
    }
    app_unit_overdue(&self->options.unit);
    make_steps(self);
    const uint64_t behind_us = now_us - self->deadline_us;
    self->deadline_us += self->options.period_us;
    if (behind_us > (BEHIND_MAX * self->options.period_us)) { /* this process was stopped for long */
        self->deadline_us = now_us + self->options.period_us;
    }
}

/* ---- what is told ---- */

static void print_status(app *self)
{
    static const char *const plant[] = {"starting", "none", "provisional", "confirmed"};
    static const char *const bus[] = {"absent", "good", "lossy", "stale"};
    static const char *const can[] = {"unknown", "active", "warning", "passive", "off"};
    const app_unit *unit = &self->options.unit;
    hg_hal_report report;
    hg_hal_state(&self->hal, &report);
    (void)printf("k=%" PRIu32 " plant=%s candidates=0x%" PRIX32, self->verdict.k, plant[self->verdict.plant], self->verdict.candidates);
    for (uint8_t i = 0U; i < app_unit_links(unit); i++) {
        const hg_link_health *health = app_unit_health(unit, i);
        const unsigned refused = (unsigned)health->crc + health->format + health->repeated + health->early + health->late + health->sequence + health->untrusted + health->numeric;
        (void)printf(" %s=%s/good:%u/lost:%u/refused:%u", app_unit_link(unit, i), bus[app_unit_bus(unit, &self->verdict, i)],
                     (unsigned)health->good, (unsigned)health->lost, refused);
    }
    (void)printf(" frames_per_s=%" PRIu32 " missed=%" PRIu64 " outages=%" PRIu64 " unsent=%" PRIu64 " can=%s errors=%" PRIu32
                 " dropped=%" PRIu32 " malformed=%" PRIu32 "\n", report.received - self->received, self->missed, self->outages,
                 self->unsent, can[report.bus], report.errors, report.lost, report.malformed);
    (void)fflush(stdout);
    self->received = report.received;
}

/* Opens a file that an option names; null, and a line, when it cannot be. */
static FILE *open_file(const char *option, const char *name)
{
    FILE *file = fopen(name, "w");
    if (file == NULL) {
        (void)fprintf(stderr, "detector_node: %s '%s': %s; name a file that can be written\n", option, name, strerror(errno));
    }
    return file;
}

static bool close_file(FILE *file)
{
    const bool good = ferror(file) == 0;
    return (fclose(file) == 0) && good;
}

static bool write_timing(const app *self)
{
    FILE *file = (self->options.timing != NULL) ? open_file("--timing", self->options.timing) : NULL;
    if (file == NULL) {
        return self->options.timing == NULL;
    }
    (void)fprintf(file, "# samples %" PRIu64 " missed %" PRIu64 " outages %" PRIu64 "\n# k due_us noticed_us (CLOCK_MONOTONIC)\n",
                  self->steps, self->missed, self->outages);
    for (uint64_t i = 0U; (i < self->missed) && (i < MISSES_MAX); i++) {
        (void)fprintf(file, "%" PRIu32 " %" PRIu64 " %" PRIu64 "\n", misses[i].k, misses[i].due_us, misses[i].noticed_us);
    }
    return close_file(file);
}

static bool write_health(const app *self)
{
    FILE *file = (self->options.health != NULL) ? open_file("--health", self->options.health) : NULL;
    if (file == NULL) {
        return self->options.health == NULL;
    }
    const app_unit *unit = &self->options.unit;
    for (uint8_t i = 0U; i < app_unit_links(unit); i++) {
        const hg_link_health *h = app_unit_health(unit, i);
        const struct {
            const char *name;
            uint16_t    count;
        } counters[] = {{"good", h->good}, {"lost", h->lost}, {"crc", h->crc}, {"format", h->format}, {"repeated", h->repeated}, {"early", h->early},
                        {"late", h->late}, {"sequence", h->sequence}, {"untrusted", h->untrusted}, {"numeric", h->numeric}, {"invalid", h->invalid}};
        for (size_t j = 0U; j < (sizeof(counters) / sizeof(counters[0])); j++) {
            (void)fprintf(file, "%s.%s %u\n", app_unit_link(unit, i), counters[j].name, (unsigned)counters[j].count);
        }
    }
    if (unit->tracker != NULL) {
        (void)fprintf(file, "state.digest %08" PRIx32 "\n", unit->digest);
    }
    return close_file(file);
}

/* ---- the loop ---- */

static uint64_t wake_time(const app *self)
{
    return (self->options.status && (self->status_us < self->deadline_us)) ? self->status_us : self->deadline_us;
}

static int run(app *self)
{
    hg_can_frame frame;
    uint64_t at_us;
    while (!finished(self)) {
        if (hg_hal_wait(&self->hal, wake_time(self)) == HG_E_IO) {
            return EXIT_SUCCESS; /* asked to stop */
        }
        const uint64_t now_us = hg_hal_now_us(&self->hal);
        hg_status status = HG_OK;
        while ((!finished(self)) && (status == HG_OK)) {
            status = hg_hal_receive(&self->hal, &frame, &at_us);
            if (status == HG_OK) {
                take_frame(self, &frame, at_us);
            }
        }
        if (status == HG_E_IO) {
            (void)fprintf(stderr, "detector_node: CAN interface '%s' failed (%s: %s): start again when it is back\n",
                          self->options.interface, self->can.error_call, strerror(self->can.error_number));
            return EXIT_BUS;
        }
        if (!finished(self)) {
            look_at_deadline(self, now_us);
        }
        if (self->options.status && (hg_hal_now_us(&self->hal) >= self->status_us)) {
            print_status(self);
            self->status_us += SECOND_US;
        }
    }
    return EXIT_SUCCESS;
}

static int start(app *self)
{
    const hg_status opened = open_bus(self);
    if (opened != HG_OK) {
        return refuse_bus(self, opened);
    }
    const hg_status tested = app_unit_selftest(&self->options.unit);
    if (tested != HG_OK) {
        (void)fprintf(stderr, "detector_node: model '%s' fails its self-test (status %d): tables, library or processor are not as the model was designed with; "
                              "generate its tables again and build anew\n", app_unit_name(&self->options.unit), (int)tested);
        return EXIT_FAILED;
    }
    const hg_status started = app_unit_start(&self->options.unit, self->options.how);
    if (started != HG_OK) {
        (void)fprintf(stderr, "detector_node: model '%s' does not start (status %d): generate its tables again\n",
                      app_unit_name(&self->options.unit), (int)started);
        return EXIT_FAILED;
    }
    const uint64_t now_us = hg_hal_now_us(&self->hal);
    /* A start at rest waits for sample 0 as long as it takes; in a moving plant a bus that stays silent has to be reported. */
    const bool waits = self->options.lockstep || (self->options.how == HG_START_REST);
    self->deadline_us = waits ? HG_HAL_FOREVER : (now_us + self->options.period_us + self->options.slack_us);
    self->status_us = now_us + SECOND_US;
    (void)puts("ready");
    (void)fflush(stdout);
    return -1;
}

int main(int argc, char **argv)
{
    static app self;
    int result = read_options(&self.options, argc, argv);
    if (result != -1) {
        return result;
    }
    (void)signal(SIGPIPE, SIG_IGN); /* a reader of the status lines that goes away must not end the node */
    result = start(&self);
    if (result == -1) {
        result = run(&self);
        if (self.options.status) {
            print_status(&self);
        }
        const bool timed = write_timing(&self);
        if (((!write_health(&self)) || (!timed)) && (result == EXIT_SUCCESS)) {
            result = EXIT_FAILED;
        }
    }
    hg_socketcan_close(&self.can);
    return result;
}
