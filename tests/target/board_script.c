/** @file
 *  A board for firmware/apps/detector_main.c: a clock that jumps from event to event, platoon's senders on a plant at rest, and a story that is
 *  told by when things happen. When it is over the board asks the application to stop and judges the verdict frames it has sent. */

#include "bare.h"
#include "console.h"
#include "platoon.h"

#define PERIOD_US HG_PLATOON_SAMPLE_TIME_US
#define SILENCE_FROM 100U /* frames are lost in 100 .. 119: more than a stamp can tell, and only the deadline closes the samples */
#define SILENCE_TO 120U
#define STALL_AT 200U     /* the processor stands still for 20 samples: the clock goes on, frames are lost, nobody closes samples */
#define STALL_TO 220U
#define OLD 247U          /* the closing frame of this sample comes once more 13 later: by stamp and counter it could be of 263 */
#define REPLAY_AT 260U
#define FAULT_AT 320U
#define END_AT 360U
#define BIAS_CODE 5000    /* of the first signal: 5 m */

typedef enum { TOLD_NOTHING = 0, STARTED, HEALTHY, STALE, ANEW, HEALTHY_AGAIN, FOUND, WRONG } chapter; /* of what the verdicts tell */

typedef struct {
    hg_platoon_senders senders;
    hg_can_frame       frame[HG_PLATOON_GROUPS + 1U];
    hg_can_frame       old;
    uint8_t            frames;   /* waiting */
    uint8_t            taken;
    uint64_t           now_us;
    uint32_t           k;        /* the plant's next sample */
    chapter            told;
} script;

static void say(const char *text, size_t length)
{
    console_write(text, length);
}
#define SAY(text) say(text "\n", sizeof(text))

/* The next thing that the verdicts should tell, or nothing new. */
static chapter next_chapter(const script *self, const hg_verdict *verdict)
{
    const bool stale = (verdict->bus & 3U) == (unsigned)HG_BUS_STALE;
    chapter told = self->told;
    if ((told == HEALTHY_AGAIN) && (verdict->plant == HG_PLANT_STARTING)) {
        told = WRONG; /* the old frame was believed, and the detector had to begin again */
    } else if (verdict->plant == HG_PLANT_CONFIRMED) {
        told = ((told >= HEALTHY_AGAIN) && (self->k > FAULT_AT)) ? FOUND : WRONG;
    } else if ((told == TOLD_NOTHING) && (verdict->plant == HG_PLANT_STARTING)) {
        told = STARTED;
    } else if ((told == STARTED) && (verdict->plant == HG_PLANT_NONE)) {
        told = HEALTHY;
    } else if ((told == HEALTHY) && stale && (self->k > SILENCE_FROM) && (self->k <= SILENCE_TO)) {
        told = STALE;
    } else if ((told == STALE) && (verdict->plant == HG_PLANT_STARTING) && (self->k > STALL_AT)) {
        told = ANEW;
    } else if ((told == ANEW) && (verdict->plant == HG_PLANT_NONE)) {
        told = HEALTHY_AGAIN;
    } else {
        /* a heartbeat */
    }
    return told;
}

static hg_status script_send(void *object, const hg_can_frame *frame)
{
    script *const self = object;
    hg_verdict verdict;
    bool reply;
    if ((self->told != WRONG) && (frame->id == hg_platoon_config.verdict->id)) {
        const hg_status status = hg_verdict_read(hg_platoon_config.verdict, frame, &verdict, &reply);
        self->told = (status == HG_OK) ? next_chapter(self, &verdict) : WRONG;
    }
    return HG_OK;
}

static hg_status script_receive(void *object, hg_can_frame *frame, uint64_t *time_us)
{
    script *const self = object;
    if (self->taken == self->frames) {
        return HG_E_EMPTY;
    }
    *frame = self->frame[self->taken];
    *time_us = self->now_us;
    self->taken++;
    return HG_OK;
}

static void script_state(void *object, hg_hal_report *out)
{
    (void)object;
    *out = (hg_hal_report){.bus = HG_BUS_ACTIVE};
}

static uint64_t script_now_us(void *object)
{
    const script *const self = object;
    return self->now_us;
}

/* The frames of the plant's next sample; those that are lost move the senders' counters all the same. */
static void speak(script *self)
{
    const bool lost = ((self->k >= SILENCE_FROM) && (self->k < SILENCE_TO)) || ((self->k >= STALL_AT) && (self->k < STALL_TO));
    self->frames = 0U;
    self->taken = 0U;
    if (self->k == REPLAY_AT) {
        self->frame[0] = self->old;
        self->frames = 1U;
    }
    for (uint8_t g = 0U; g < HG_PLATOON_GROUPS; g++) {
        hg_real value[HG_PLATOON_SIGNALS] = {HG_REAL_ZERO};
        if ((g == (uint8_t)HG_PLATOON_GROUP_MEASUREMENT) && (self->k >= FAULT_AT)) {
            value[0] = hg_code_value(&hg_platoon_config.message[g].scale[0], BIAS_CODE);
        }
        if ((hg_sender_step(&self->senders.sender[g], self->k, value, &self->frame[self->frames]) == HG_OK) && (!lost)) {
            self->frames++;
        }
    }
    if (self->k == OLD) {
        self->old = self->frame[self->frames - 1U]; /* the closing group is the last one */
    }
    self->k++;
}

static hg_status script_wait(void *object, uint64_t until_us)
{
    script *const self = object;
    hg_status woke = HG_OK;
    while ((self->taken == self->frames) && (woke == HG_OK) && (self->k < END_AT)) {
        const uint64_t next_us = ((uint64_t)self->k + 1U) * PERIOD_US;
        const bool stalled = (self->k >= STALL_AT) && (self->k <= STALL_TO); /* wakes with a frame before it, which goes first */
        if ((until_us < next_us) && (!stalled)) {
            self->now_us = (until_us > self->now_us) ? until_us : self->now_us;
            woke = HG_E_EMPTY;
        } else {
            self->now_us = next_us;
            speak(self);
        }
    }
    if (self->k >= END_AT) {
        woke = HG_E_IO;
        if (self->told == FOUND) {
            SAY("the verdicts tell the story");
        } else {
            SAY("the verdicts tell another story");
        }
    }
    return woke;
}

hg_status hg_board_start(hg_hal *board)
{
    static script self;
    static const hg_hal_ops ops = {script_send, script_receive, script_state, script_now_us, script_wait};
    SAY("board starts");
    *board = (hg_hal){.ops = &ops, .self = &self};
    return hg_platoon_senders_start(&self.senders);
}
