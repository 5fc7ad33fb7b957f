#include "hullguard/hold.h"

#include <stddef.h>

#define GOOD_IN_ROW 2U /* frames after which the sender's level is known: it follows from two successive ones */

static uint8_t horizon(const hg_hold_config *config)
{
    return (uint8_t)(config->trigger->interval_max + config->margin);
}

/* A radius: what is not one here would be in every threshold. */
static bool radii_valid(const hg_real *radius, uint16_t n)
{
    bool valid = true;
    for (uint16_t i = 0U; i < n; i++) {
        valid = valid && hg_real_finite(radius[i]) && (radius[i] >= HG_REAL_ZERO);
    }
    return valid;
}

static bool tables_valid(const hg_hold_config *config)
{
    bool valid = (config->trigger != NULL) && hg_trigger_valid(config->trigger);
    valid = valid && (((uint16_t)config->trigger->interval_max + config->margin) < UINT8_MAX);
    if (valid && (config->trigger->width > 0U)) {
        const uint8_t width = config->trigger->width;
        valid = (config->scale != NULL) && (config->half != NULL) && (config->slew != NULL) && (config->span != NULL) &&
                (config->middle != NULL);
        for (uint8_t g = 0U; valid && (g < width); g++) {
            valid = hg_code_exponent_valid(config->scale[g].exponent);
        }
        valid = valid && radii_valid(config->half, width) && radii_valid(config->span, width) &&
                radii_valid(config->slew, (uint16_t)((uint16_t)horizon(config) * width));
    }
    return valid;
}

hg_status hg_hold_start(hg_hold *self, const hg_hold_config *config, int32_t *codes)
{
    if ((self == NULL) || (config == NULL) || (codes == NULL)) {
        return HG_E_ARGUMENT;
    }
    if (!tables_valid(config)) {
        return HG_E_CONFIG;
    }
    const uint8_t width = config->trigger->width;
    self->config = config;
    self->sent = codes;
    self->previous = &codes[width];
    self->promise = &codes[2U * (uint16_t)width];
    self->age = UINT8_MAX;
    self->good = 0U;
    self->level = 0U;
    self->silence = 0U;
    self->holes = true;
    self->seen = false;
    self->recovering = false;
    self->fresh = false;
    self->lost = false;
    self->doubt = false;
    self->gap = false;
    self->gap_age = 0U;
    for (uint8_t g = 0U; g < width; g++) {
        self->sent[g] = HG_CODE_INVALID;
        self->previous[g] = HG_CODE_INVALID;
        self->promise[g] = 0;
    }
    return HG_OK;
}

/* Longest silent time and threshold that the sender may be using: its level's, or over all levels while that is not known. */
static uint8_t silence(const hg_hold *self)
{
    const hg_trigger_config *trigger = self->config->trigger;
    uint8_t longest = 0U;
    for (uint8_t l = 0U; l < trigger->levels; l++) {
        const bool possible = (self->good < GOOD_IN_ROW) || (l == self->level);
        longest = (possible && (trigger->silence[l] > longest)) ? trigger->silence[l] : longest;
    }
    return longest;
}

static int32_t threshold(const hg_hold *self, uint8_t g)
{
    const hg_trigger_config *trigger = self->config->trigger;
    int32_t widest = 0;
    for (uint8_t l = 0U; l < trigger->levels; l++) {
        const bool possible = (self->good < GOOD_IN_ROW) || (l == self->level);
        const int32_t one = possible ? hg_trigger_threshold(trigger, l, g, self->sent[g]) : 0;
        widest = (one > widest) ? one : widest;
    }
    return widest;
}

hg_status hg_hold_receive(hg_hold *self, const int32_t *code, bool continues)
{
    if (self->fresh) {
        return HG_E_REPEATED;
    }
    const hg_trigger_config *trigger = self->config->trigger;
    /* Silence beyond interval_max has set lost: the counter may have run round since, and its continuing proves nothing. */
    const bool whole = continues && (!self->lost) && (self->good > 0U);
    self->gap = self->doubt && (!whole);
    self->gap_age = (self->age < UINT8_MAX) ? (uint8_t)(self->age + 1U) : UINT8_MAX;
    bool holes = false;
    for (uint8_t g = 0U; g < trigger->width; g++) {
        self->previous[g] = self->sent[g];
        self->sent[g] = code[g];
        holes = holes || (code[g] == HG_CODE_INVALID);
    }
    self->holes = holes;
    self->recovering = self->seen && (!whole);
    self->seen = true;
    self->good = whole ? GOOD_IN_ROW : 1U;
    self->level = whole ? hg_trigger_level(trigger, self->sent, self->previous) : 0U;
    /* Until the next frame, or until one is known to be lost and nothing is promised. */
    self->silence = silence(self);
    for (uint8_t g = 0U; g < trigger->width; g++) {
        self->promise[g] = threshold(self, g);
    }
    self->lost = false;
    self->fresh = true;
    return HG_OK;
}

void hg_hold_lose(hg_hold *self)
{
    self->lost = true;
}

static const hg_real *slew(const hg_hold_config *config, uint8_t age)
{
    return &config->slew[((uint32_t)age - 1U) * config->trigger->width];
}

/* The last value, and how far the true one can be from it by now. */
static void set_slewed(const hg_hold *self, const hg_real *moved, hg_real *value, hg_real *radius)
{
    const hg_code_scale *scale = self->config->scale;
    const uint8_t width = self->config->trigger->width;
    for (uint8_t g = 0U; g < width; g++) {
        value[g] = hg_code_value(&scale[g], self->sent[g]);
        radius[g] = moved[g];
    }
}

/* The same of signals without a value. */
static void set_unknown(const hg_hold *self, hg_real *value, hg_real *radius)
{
    const hg_hold_config *config = self->config;
    for (uint8_t g = 0U; g < config->trigger->width; g++) {
        if (self->sent[g] == HG_CODE_INVALID) {
            value[g] = config->middle[g];
            radius[g] = config->span[g];
        }
    }
}

/* The sender would have spoken if the true value were further away than it promised. Was a radius made smaller by that? */
static bool rely_on_silence(const hg_hold *self, bool trusted, hg_real *radius)
{
    const hg_hold_config *config = self->config;
    const hg_code_scale *scale = config->scale;
    const uint8_t width = config->trigger->width;
    bool relied = false;
    for (uint8_t g = 0U; g < width; g++) {
        const hg_real promised = hg_real_add(hg_real_of_code(scale[g].resolution, scale[g].exponent, self->promise[g]), config->half[g]);
        /* What is not to be trusted is compared as well, with 0: a sample costs the same with a frame and without. */
        const hg_real limit = (trusted && (self->sent[g] != HG_CODE_INVALID)) ? radius[g] : HG_REAL_ZERO;
        const bool tighter = promised < limit;
        radius[g] = tighter ? promised : radius[g];
        relied = relied || tighter;
    }
    return relied;
}

void hg_hold_step(hg_hold *self, hg_real *value, hg_real *radius, uint8_t *rewind)
{
    const hg_hold_config *config = self->config;
    const bool was_in_doubt = self->doubt;
    if (self->fresh) {
        self->age = 0U;
    } else if (self->age < UINT8_MAX) {
        self->age++;
    } else {
        /* nothing known for so long that counting on would not say more */
    }
    const bool stale = self->age > horizon(config);
    if ((!self->fresh) && (self->age >= config->trigger->interval_max)) {
        self->lost = true; /* the sender speaks at least this often */
    }
    if (self->lost) {
        self->good = 0U;
    }
    const bool held = (!stale) && (!self->fresh);
    set_slewed(self, stale ? config->span : (held ? slew(config, self->age) : config->half), value, radius);
    if (self->holes) {
        set_unknown(self, value, radius);
    }
    bool conditional = false;
    if (config->trigger->interval_max > 1U) { /* else the sender is never silent */
        conditional = rely_on_silence(self, held && (!self->lost) && (self->age > self->silence), radius);
    }
    const bool newly_lost = was_in_doubt && self->lost && (!self->fresh);
    if (newly_lost) {
        self->gap_age = self->age;
    }
    *rewind = (newly_lost || (self->fresh && self->gap)) ? (uint8_t)(self->gap_age - 1U) : 0U;
    self->doubt = (!self->fresh) && (!self->lost) && (was_in_doubt || conditional);
    self->gap = self->fresh && self->gap;
    self->fresh = false;
}

void hg_hold_past(const hg_hold *self, uint8_t lag, hg_real *radius)
{
    const hg_hold_config *config = self->config;
    /* After a frame that revealed the loss, the value held in between is the one before it. */
    const int32_t *held = self->gap ? self->previous : self->sent;
    for (uint8_t g = 0U; g < config->trigger->width; g++) {
        radius[g] = (held[g] == HG_CODE_INVALID) ? config->span[g] : slew(config, (uint8_t)(self->gap_age - lag))[g];
    }
}

uint8_t hg_hold_age(const hg_hold *self)
{
    return self->age;
}

hg_bus_health hg_hold_health(const hg_hold *self)
{
    hg_bus_health health = HG_BUS_GOOD;
    if (!self->seen) {
        health = HG_BUS_ABSENT;
    } else if (self->age > horizon(self->config)) {
        health = HG_BUS_STALE;
    } else if (self->lost || self->recovering) {
        health = HG_BUS_LOSSY;
    } else {
        /* good */
    }
    return health;
}
