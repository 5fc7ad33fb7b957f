/* Power-up in a memory that holds anything: every model's node, senders, filter and observers are started in memory full of 0x00, 0xFF, 0xA5 and noise, and then
 * driven alike. Verdicts, frames, values, radii, residuals and thresholds must be the same to the bit. And what was never started: memory of zeros refuses
 * where the headers say so. */
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "battery_cell.h"
#include "cubic_suspension.h"
#include "fusion5.h"
#include "fusion5_fast.h"
#include "openacc.h"
#include "platoon.h"
#include "platoon_bank.h"
#include "quadratic_sensor.h"
#include "suspension.h"
#include "suspension_published.h"
#include "suspension_published_uio.h"
#include "suspension_uio.h"
#include "tracking.h"
#include "two_state.h"

#define SAMPLES 200U
#define PATTERNS 6U

static uint32_t noise_state;

static uint32_t noise(void)
{
    noise_state ^= noise_state << 13U;
    noise_state ^= noise_state >> 17U;
    noise_state ^= noise_state << 5U;
    return noise_state;
}

static void fill(void *memory, size_t size, unsigned pattern)
{
    static const uint8_t bytes[] = {0x00U, 0xFFU, 0xA5U, 0x7FU};
    uint8_t *to = memory;
    noise_state = 0x1234567U + pattern;
    for (size_t i = 0U; i < size; i++) {
        to[i] = (pattern < sizeof(bytes)) ? bytes[pattern] : (uint8_t)(noise() >> 11U);
    }
}

static uint64_t mix(uint64_t hash, const void *data, size_t size)
{
    const uint8_t *from = data;
    for (size_t i = 0U; i < size; i++) {
        hash = (hash ^ from[i]) * 0x100000001B3ULL;
    }
    return hash;
}

static uint64_t mix_frame(uint64_t hash, const hg_can_frame *frame)
{
    hash = mix(hash, &frame->id, sizeof(frame->id));
    hash = mix(hash, &frame->flags, 1U);
    hash = mix(hash, &frame->length, 1U);
    return mix(hash, frame->data, frame->length);
}

/* Readings that wander, now and then none; the bus loses one frame in 16 and damages one. */
static uint64_t speak(hg_node *node, hg_sender *sender, uint32_t k, uint64_t hash)
{
    hg_real value[HG_GROUP_SIGNALS_MAX];
    for (uint8_t g = 0U; g < node->config->detector->groups; g++) {
        const hg_hold_config *hold = &node->config->detector->hold[g];
        for (uint8_t i = 0U; i < hold->trigger->width; i++) {
            const float share = (float)(int32_t)(noise() >> 8U) / 16777216.0F;
            value[i] = hold->middle[i] + ((share - 0.5F) * hold->span[i] * (((k % 50U) > 40U) ? 0.5F : 0.01F));
        }
        hg_can_frame frame;
        if (hg_sender_step(&sender[g], k, value, &frame) == HG_OK) {
            const uint32_t fate = noise() % 16U;
            frame.data[fate % 8U] ^= (fate == 1U) ? 4U : 0U;
            hash = mix_frame(hash, &frame);
            if (fate != 0U) {
                const hg_status status = hg_node_receive(node, &frame);
                hash = mix(hash, &status, sizeof(status));
            }
        }
    }
    return hash;
}

static uint64_t steps(hg_node *node, uint64_t hash)
{
    hg_verdict v;
    while (hg_node_step(node, &v) == HG_OK) {
        const hg_detector *d = &node->detector;
        hg_can_frame out[2];
        const uint8_t frames = hg_node_report(node, &v, false, out);
        for (uint8_t i = 0U; i < frames; i++) {
            hash = mix_frame(hash, &out[i]);
        }
        hash = mix(hash, &v.k, sizeof(v.k));
        hash = mix(hash, &v.candidates, sizeof(v.candidates));
        hash = mix(hash, d->value, d->config->width * sizeof(hg_real));
        hash = mix(hash, d->radius, d->config->width * sizeof(hg_real));
        hash = mix(hash, d->r, d->config->residuals * sizeof(hg_real));
        hash = mix(hash, d->J, d->config->residuals * sizeof(hg_real));
    }
    return hash;
}

#define NODE(name, observer, follow)                                                       \
    static uint64_t drive_##name(unsigned pattern)                                         \
    {                                                                                      \
        static hg_##name##_node self;                                                      \
        static hg_##name##_senders senders;                                                \
        uint64_t hash = 0xCBF29CE484222325ULL;                                             \
        fill(&self, sizeof(self), pattern);                                                \
        fill(&senders, sizeof(senders), pattern);                                          \
        if ((hg_##name##_node_start(&self, HG_START_MOVING) != HG_OK) || (hg_##name##_senders_start(&senders) != HG_OK)) { \
            return 0U;                                                                     \
        }                                                                                  \
        observer;                                                                          \
        noise_state = 99U;                                                                 \
        for (uint32_t k = 0U; k < SAMPLES; k++) {                                          \
            hash = speak(&self.node, senders.sender, k, hash);                             \
            if ((k % 37U) == 36U) {                                                        \
                hg_node_overdue(&self.node);                                               \
            }                                                                              \
            hash = steps(&self.node, hash);                                                \
            follow;                                                                        \
        }                                                                                  \
        return hash;                                                                       \
    }

/* An observer beside it, in memory as rubbish as the node's. */
#define BEGIN_UIO(name)                                                                    \
    static hg_##name##_uio uio;                                                            \
    fill(&uio, sizeof(uio), pattern);                                                      \
    if (hg_##name##_uio_start(&uio, &self.node.detector, HG_START_MOVING) != HG_OK) {      \
        return 0U;                                                                         \
    }
#define FOLLOW_UIO(name)                                                                   \
    (void)hg_##name##_uio_follow(&uio, &self.node.detector);                               \
    hash = mix(hash, uio.estimate, sizeof(uio.estimate));                                  \
    hash = mix(hash, uio.radius, sizeof(uio.radius))

NODE(platoon, (void)0, (void)0)
NODE(platoon_bank, (void)0, (void)0)
NODE(openacc, (void)0, (void)0)
NODE(cubic_suspension, (void)0, (void)0)
NODE(quadratic_sensor, (void)0, (void)0)
NODE(two_state, (void)0, (void)0)
NODE(battery_cell, (void)0, (void)0)
NODE(suspension, BEGIN_UIO(suspension), FOLLOW_UIO(suspension))
NODE(suspension_published, BEGIN_UIO(suspension_published), FOLLOW_UIO(suspension_published))

static uint64_t drive_filter(hg_tracker *tracker, hg_fusion_sender *sender)
{
    const hg_tracker_config *config = tracker->config;
    uint64_t hash = 0xCBF29CE484222325ULL;
    uint32_t digest = HG_TRACKER_DIGEST;
    hg_verdict v;
    hg_can_frame frame;
    for (uint32_t k = 0U; k < SAMPLES; k++) {
        for (uint8_t i = 0U; i < config->fusion->sensors; i++) {
            const hg_real y = (hg_real)((float)(int32_t)(noise() >> 16U) / 65536.0F);
            if ((hg_fusion_sender_step(&sender[i], y, (hg_real)1, false, &frame) == HG_OK) && ((noise() % 16U) != 0U)) {
                const hg_status status = hg_tracker_receive(tracker, &frame);
                hash = mix(mix_frame(hash, &frame), &status, sizeof(status));
            }
        }
        hg_frame_pack(config->tick, NULL, &frame);
        (void)hg_e2e_protect(config->tick->e2e, frame.data, frame.length, (uint8_t)(k % 16U), (uint8_t)(k % 16U));
        (void)hg_tracker_receive(tracker, &frame);
        while (hg_tracker_step(tracker, &v) == HG_OK) {
            hg_can_frame out[2];
            const uint8_t frames = hg_tracker_report(tracker, &v, false, out);
            for (uint8_t i = 0U; i < frames; i++) {
                hash = mix_frame(hash, &out[i]);
            }
            digest = hg_tracker_digest(&tracker->fusion, digest);
            hash = mix(hash, tracker->value, 2U * config->fusion->states * sizeof(hg_real));
        }
    }
    return mix(hash, &digest, sizeof(digest));
}

#define FILTER(name)                                                                       \
    static uint64_t drive_##name(unsigned pattern)                                         \
    {                                                                                      \
        static hg_##name##_tracker self;                                                   \
        static hg_fusion_sender sender[HG_FUSION_SENSORS_MAX];                             \
        fill(&self, sizeof(self), pattern);                                                \
        fill(sender, sizeof(sender), pattern);                                             \
        if (hg_##name##_tracker_start(&self, HG_START_REST) != HG_OK) {                    \
            return 0U;                                                                     \
        }                                                                                  \
        for (uint8_t i = 0U; i < self.tracker.config->fusion->sensors; i++) {              \
            (void)hg_fusion_sender_start(&sender[i], &self.tracker, i);                    \
        }                                                                                  \
        noise_state = 99U;                                                                 \
        return drive_filter(&self.tracker, sender);                                        \
    }
FILTER(fusion5)
FILTER(fusion5_fast)
FILTER(tracking)

/* e2e.h: a machine that was not started, in zeroed memory, stays in DEINIT, whatever comes. */
static bool refuses(void)
{
    static hg_e2e_machine machine;
    bool stays = true;
    for (unsigned i = 0U; i < 40U; i++) {
        stays = stays && (hg_e2e_machine_step(&machine, &hg_e2e_limits_default, HG_OK) == HG_E2E_DEINIT);
    }
    return stays;
}

int main(void)
{
    static const struct {
        const char *name;
        uint64_t (*drive)(unsigned pattern);
    } all[] = {{"platoon", drive_platoon}, {"platoon_bank", drive_platoon_bank}, {"openacc", drive_openacc}, {"cubic_suspension", drive_cubic_suspension},
               {"quadratic_sensor", drive_quadratic_sensor}, {"two_state", drive_two_state}, {"battery_cell", drive_battery_cell}, {"suspension", drive_suspension},
               {"suspension_published", drive_suspension_published}, {"fusion5", drive_fusion5}, {"fusion5_fast", drive_fusion5_fast}, {"tracking", drive_tracking}};
    int failed = refuses() ? 0 : 1;
    for (size_t m = 0U; m < (sizeof(all) / sizeof(all[0])); m++) {
        const uint64_t clean = all[m].drive(0U);
        for (unsigned pattern = 1U; pattern < PATTERNS; pattern++) {
            if ((clean == 0U) || (all[m].drive(pattern) != clean)) {
                (void)printf("FAILED garbage: %s started in memory of pattern %u behaves otherwise than in zeros\n", all[m].name, pattern);
                failed = 1;
            }
        }
    }
    if (failed == 0) {
        (void)printf("  ok  power-up in garbage: %zu models, %u patterns, %u samples each, the same to the bit\n", sizeof(all) / sizeof(all[0]), PATTERNS - 1U, SAMPLES);
    }
    return failed;
}
