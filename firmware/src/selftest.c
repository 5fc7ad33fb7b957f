#include "hullguard/selftest.h"

#include "hullguard/crc32c.h"

#include <stddef.h>

#define SEED 0x2545F491U
#define STAMP_MASK 0x0FU

/* Marsaglia, Xorshift RNGs, 2003. */
static uint32_t draw(uint32_t *random)
{
    *random ^= *random << 13U;
    *random ^= *random >> 17U;
    *random ^= *random << 5U;
    return *random;
}

static int32_t clamped(const hg_code_scale *scale, int32_t code)
{
    const int32_t above = (code > scale->minimum) ? code : scale->minimum;
    return (above < scale->maximum) ? above : scale->maximum;
}

/* The codes of a group's signals in sample k; first is the place of the first one. */
static void move(const hg_selftest_config *config, const hg_message *message, uint32_t first, uint32_t k, uint32_t *random, int32_t *code)
{
    const uint32_t span = (2U * (uint32_t)config->spread) + 1U;
    for (uint8_t g = 0U; g < message->width; g++) {
        const uint32_t place = first + g;
        const uint32_t drawn = draw(random) % span;
        const int32_t moved = (int32_t)drawn - (int32_t)config->spread;
        const int32_t wrong = ((place == config->signal) && (k >= config->fault)) ? config->size : 0;
        code[g] = clamped(&message->scale[g], config->code[place] + moved + wrong);
    }
}

/* Samples from one frame of a group to its next: what no level of its trigger forbids. */
static uint32_t every(const hg_node *node, uint8_t group)
{
    const hg_trigger_config *trigger = node->config->detector->hold[group].trigger;
    uint32_t longest = 0U;
    for (uint8_t l = 0U; l < trigger->levels; l++) {
        longest = (trigger->silence[l] > longest) ? trigger->silence[l] : longest;
    }
    return longest + 1U;
}

static void speak(hg_node *node, uint8_t group, const int32_t *code, uint32_t k)
{
    const hg_message *message = &node->config->message[group];
    const uint32_t period = every(node, group);
    hg_can_frame frame;
    if ((k % period) == 0U) {
        const uint8_t counter = (uint8_t)((k / period) % hg_e2e_modulus(message->e2e));
        hg_frame_pack(message, code, &frame);
        (void)hg_e2e_protect(message->e2e, frame.data, frame.length, counter, (uint8_t)(k & STAMP_MASK));
        (void)hg_node_receive(node, &frame); /* a refusal shows in what follows */
    }
}

static uint32_t reals(uint32_t crc, const hg_real *x, uint32_t count)
{
    uint32_t now = crc;
    for (uint32_t i = 0U; i < count; i++) {
        now = hg_crc32c_real(now, x[i]);
    }
    return now;
}

/* What a step has found. */
static uint32_t taken(const hg_node *node, const hg_verdict *verdict, uint32_t crc)
{
    const hg_detector *detector = &node->detector;
    const uint32_t width = detector->config->width;
    const uint32_t residuals = detector->config->residuals;
    uint32_t now = hg_crc32c(crc, verdict->k, 4U);
    now = hg_crc32c(now, verdict->candidates, 4U);
    now = hg_crc32c(now, verdict->bus, 2U);
    now = hg_crc32c(now, (uint32_t)verdict->plant, 1U);
    now = hg_crc32c(now, (uint32_t)verdict->basis, 1U);
    now = reals(now, detector->value, width);
    now = reals(now, detector->radius, width);
    now = reals(now, detector->r, residuals);
    return reals(now, detector->J, residuals);
}

void hg_selftest_drive(hg_node *node, const hg_selftest_config *config, hg_selftest_result *result)
{
    int32_t code[HG_GROUP_SIGNALS_MAX];
    int32_t closing[HG_GROUP_SIGNALS_MAX];
    uint32_t random = SEED;
    *result = (hg_selftest_result){.digest = 0U, .quiet = true, .found = false};
    for (uint32_t k = 0U; k < config->samples; k++) {
        uint32_t first = 0U;
        hg_verdict verdict;
        for (uint8_t i = 0U; i < node->config->detector->groups; i++) {
            const hg_message *message = &node->config->message[i];
            if (i == node->config->closing) { /* it speaks last */
                move(config, message, first, k, &random, closing);
            } else {
                move(config, message, first, k, &random, code);
                speak(node, i, code, k);
            }
            first += message->width;
        }
        speak(node, node->config->closing, closing, k);
        while (hg_node_step(node, &verdict) == HG_OK) {
            result->digest = taken(node, &verdict, result->digest);
            result->quiet = result->quiet && ((k >= config->fault) || (verdict.plant <= HG_PLANT_NONE));
            result->found = verdict.plant == HG_PLANT_CONFIRMED;
        }
    }
}

hg_status hg_selftest_run(hg_node *node, const hg_selftest_config *config)
{
    hg_selftest_result result;
    hg_selftest_drive(node, config, &result);
    return (result.quiet && result.found && (result.digest == config->digest)) ? HG_OK : HG_E_SELFTEST;
}
