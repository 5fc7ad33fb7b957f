/** @file
 *  A sensor ECU without operating system: the measurement group of the platoon model, trigger and frame on the target. Its samples come from the
 *  console, where a real one would read its converters: a line a sample, one float32 a signal as eight hexadecimal digits, separated by a
 *  blank. Each is answered, when its frame stands in the controller, by a line: `sent` or `silent` (or `unsent`: no room, or no bus), and
 *  the group's last sent codes, which is what the detector's hold has to have, as eight digits each.
 *
 *  Prints `ready` when it listens. `q` ends. Anything else in a line is not taken for a reading: it is answered with `what`. */
#include "board.h"
#include "platoon.h"

#include <string.h>

#define GROUP HG_PLATOON_GROUP_MEASUREMENT
#define WIDTH_MAX HG_GROUP_SIGNALS_MAX
#define DIGITS 8U
#define LINE_MAX ((DIGITS + 1U) * WIDTH_MAX)
#define OFFER_MAX_US 50000U /* longest time one frame is offered to a controller that has no room: a sample is worth no more */
#define EXIT_BUS 3U
#define EXIT_FAILED 1U
#define DIGIT_BAD 16U

typedef struct {
    hg_hal    hal;
    hg_sender sender;
    int32_t   codes[2U * WIDTH_MAX];
    hg_real   value[WIDTH_MAX];
    uint32_t  k;
} app;

static uint32_t digit(char c)
{
    if ((c >= '0') && (c <= '9')) {
        return (uint32_t)c - (uint32_t)'0';
    }
    return ((c >= 'a') && (c <= 'f')) ? (((uint32_t)c - (uint32_t)'a') + 10U) : DIGIT_BAD;
}

/* The bits of one number; false when the text is not eight digits and an end. */
static bool read_number(const char *text, char end, hg_real *value)
{
    uint32_t bits = 0U;
    for (size_t i = 0U; i < DIGITS; i++) {
        const uint32_t next = digit(text[i]);
        if (next == DIGIT_BAD) {
            return false;
        }
        bits = (bits << 4) | next;
    }
    _Static_assert(sizeof(*value) == sizeof(bits), "readings are float32");
    (void)memcpy(value, &bits, sizeof(bits));
    return text[DIGITS] == end;
}

static bool read_line(app *self, const char *line)
{
    const uint8_t width = self->sender.config->message->width;
    bool good = true;
    for (uint8_t g = 0U; good && (g < width); g++) {
        const char end = ((g + 1U) < width) ? ' ' : '\0';
        good = read_number(&line[(DIGITS + 1U) * g], end, &self->value[g]);
    }
    return good;
}

static void say_code(int32_t code)
{
    static const char digits[] = "0123456789abcdef";
    char text[DIGITS + 2U] = {' '};
    uint32_t rest = (uint32_t)code;
    for (size_t i = DIGITS; i > 0U; i--) {
        text[i] = digits[rest & 0xFU];
        rest >>= 4;
    }
    hg_board_say(text);
}

static const char *send_frame(const app *self, const hg_can_frame *frame)
{
    const uint64_t until_us = hg_hal_now_us(&self->hal) + OFFER_MAX_US;
    hg_status status = hg_hal_send(&self->hal, frame);
    while ((status == HG_E_BUSY) && (hg_hal_now_us(&self->hal) < until_us)) {
        status = hg_hal_send(&self->hal, frame);
    }
    return (status == HG_OK) ? "sent" : "unsent"; /* a frame that is lost is seen by the next one's counter */
}

static void make_sample(app *self)
{
    hg_can_frame frame;
    const bool speaks = hg_sender_step(&self->sender, self->k, self->value, &frame) == HG_OK;
    self->k++;
    hg_board_say(speaks ? send_frame(self, &frame) : "silent");
    for (uint8_t g = 0U; g < self->sender.config->message->width; g++) {
        say_code(self->sender.trigger.sent[g]);
    }
    hg_board_say("\n");
}

static void take_line(app *self, const char *line)
{
    if (read_line(self, line)) {
        make_sample(self);
    } else {
        hg_board_say("what\n");
    }
}

/* Lines until `q`. A line that is too long keeps its beginning: it is no reading either way. */
static void run(app *self)
{
    char line[LINE_MAX + 1U] = {0};
    size_t length = 0U;
    int key = hg_board_key();
    while (key != 'q') {
        if (key == '\n') {
            take_line(self, line);
            (void)memset(line, 0, sizeof(line));
            length = 0U;
        } else if ((key >= 0) && (length < LINE_MAX)) {
            line[length] = (char)key;
            length++;
        } else {
            /* nothing has come, or the line is full */
        }
        key = hg_board_key();
    }
}

int main(void)
{
    static app self;
    static const hg_hal_filter nothing;
    if (hg_board_can(0U, &nothing, 0U, &self.hal) != HG_OK) {
        hg_board_say("no CAN controller\n");
        return EXIT_BUS;
    }
    if (hg_sender_start(&self.sender, &hg_platoon_sender[GROUP], self.codes) != HG_OK) {
        hg_board_say("model does not start: generate its tables again\n");
        return EXIT_FAILED;
    }
    hg_board_say("ready\n");
    run(&self);
    return 0;
}
