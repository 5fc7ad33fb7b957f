#include "hullguard/hold.h"

#include <stddef.h>

#define GOOD_IN_ROW 2U /* frames after which the sender's level is known: it follows from two successive ones */

static uint8_t width_of(const hg_hold_config *config)
{
    return HG_SIZE(HG_ONLY_GROUP_SIGNALS, config->trigger->width);
}

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
    bool valid = (config->trigger != NULL) && hg_trigger_valid(config->trigger) && HG_SIZE_FITS(HG_ONLY_GROUP_SIGNALS, config->trigger->width);
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

hg_status hg_hold_start(hg_hold *self, const hg_hold_config *config, int32_t *codes, hg_real *reals)
{
    if ((self == NULL) || (config == NULL) || (codes == NULL) || (reals == NULL)) {
        return HG_E_ARGUMENT;
    }
    if (!tables_valid(config)) {
        return HG_E_CONFIG;
    }
    const uint8_t width = config->trigger->width;
    self->config = config;
    self->sent = codes;
    self->previous = &codes[width];
    self->value = reals;
    self->promise = &reals[width];
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
        self->value[g] = config->middle[g];
        self->promise[g] = HG_REAL_MAX;
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

/* What there is to know of a signal from its last frame alone. The sender would speak if the true value were further away than it promised. */
static void take(hg_hold *self, uint8_t g)
{
    const hg_hold_config *config = self->config;
    if (self->sent[g] == HG_CODE_INVALID) {
        self->holes = true;
        self->value[g] = config->middle[g];
        self->promise[g] = HG_REAL_MAX; /* nothing */
    } else {
        const hg_code_scale *scale = &config->scale[g];
        self->value[g] = hg_code_value(scale, self->sent[g]);
        self->promise[g] = hg_real_add(hg_real_of_code(scale->resolution, scale->exponent, threshold(self, g)), config->half[g]);
    }
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
    for (uint8_t g = 0U; g < trigger->width; g++) {
        self->previous[g] = self->sent[g];
        self->sent[g] = code[g];
    }
    self->recovering = self->seen && (!whole);
    self->seen = true;
    self->good = whole ? GOOD_IN_ROW : 1U;
    self->level = whole ? hg_trigger_level(trigger, self->sent, self->previous) : 0U;
    /* Until the next frame, or until one is known to be lost and nothing is promised. */
    self->silence = silence(self);
    self->holes = false;
    for (uint8_t g = 0U; g < trigger->width; g++) {
        take(self, g);
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
    return &config->slew[((uint32_t)age - 1U) * width_of(config)];
}

/* The last value, and how far the true one can be from it by now: as far as it may have `moved`, but within the `limit`. Is a radius smaller by that? */
static bool set_held(const hg_hold *self, const hg_real *moved, const hg_real *limit, hg_real *value, hg_real *radius)
{
    const uint8_t width = width_of(self->config);
    bool limited = false;
    for (uint8_t g = 0U; g < width; g++) {
        const hg_real widest = moved[g];
        const hg_real least = limit[g];
        const bool tighter = least < widest;
        radius[g] = tighter ? least : widest;
        value[g] = self->value[g];
        limited = limited || tighter;
    }
    return limited;
}

/* The radii of signals without a value. */
static void set_unknown(const hg_hold *self, hg_real *radius)
{
    const hg_hold_config *config = self->config;
    for (uint8_t g = 0U; g < width_of(config); g++) {
        if (self->sent[g] == HG_CODE_INVALID) {
            radius[g] = config->span[g];
        }
    }
}

/* How far a signal may have moved since the last good frame, when the sender's silence says nothing. */
static const hg_real *moved_since(const hg_hold_config *config, uint8_t age)
{
    const hg_real *moved = config->span;
    if (age == 0U) {
        moved = config->half;
    } else if ((width_of(config) > 0U) && (age <= horizon(config))) { /* a bare tick has no tables, and no place in one */
        moved = slew(config, age);
    } else {
        /* stale */
    }
    return moved;
}

void hg_hold_step(hg_hold *self, hg_real *value, hg_real *radius, uint8_t *rewind)
{
    const hg_hold_config *config = self->config;
    const bool was_in_doubt = self->doubt;
    const bool fresh = self->fresh;
    const uint8_t older = (self->age < UINT8_MAX) ? (uint8_t)(self->age + 1U) : UINT8_MAX;
    const uint8_t age = fresh ? 0U : older;
    const bool lost = self->lost || (age >= config->trigger->interval_max); /* the sender speaks at least this often */
    const hg_real *moved = moved_since(config, age);
    /* What is not to be trusted is compared as well, with itself: a sample costs the same with a frame and without. */
    const bool trusted = (!lost) && (age > self->silence);
    const bool conditional = set_held(self, moved, trusted ? self->promise : moved, value, radius);
    if (self->holes) {
        set_unknown(self, radius);
    }
    if (lost) {
        self->good = 0U;
    }
    const bool newly_lost = was_in_doubt && lost && (!fresh);
    if (newly_lost) {
        self->gap_age = age;
    }
    self->gap = fresh && self->gap;
    *rewind = 0U;
    if (newly_lost || self->gap) {
        /* It is within 1 .. interval_max; what stands in a memory that failed may be any number, and the tables end there. */
        if ((uint8_t)(self->gap_age - 1U) >= config->trigger->interval_max) {
            self->gap_age = config->trigger->interval_max;
        }
        *rewind = (uint8_t)(self->gap_age - 1U);
    }
    self->doubt = (!fresh) && (!lost) && (was_in_doubt || conditional);
    self->age = age;
    self->lost = lost;
    self->fresh = false;
}

/* The value that was held in between: after a frame that revealed the loss, that of the one before it. */
static const int32_t *held_before(const hg_hold *self)
{
    return self->gap ? self->previous : self->sent;
}

void hg_hold_past(const hg_hold *self, uint8_t lag, hg_real *radius)
{
    const hg_hold_config *config = self->config;
    const int32_t *held = held_before(self);
    for (uint8_t g = 0U; g < config->trigger->width; g++) {
        radius[g] = (held[g] == HG_CODE_INVALID) ? config->span[g] : slew(config, (uint8_t)(self->gap_age - lag))[g];
    }
}

void hg_hold_rewrite(const hg_hold *self, hg_ring *ring, uint8_t first, uint8_t lags)
{
    const hg_hold_config *config = self->config;
    const int32_t *held = held_before(self);
    const uint8_t width = width_of(config);
    const int32_t back = HG_SIZE(HG_ONLY_WIDTH, ring->width);
    const int32_t end = back * (int32_t)HG_SIZE(HG_ONLY_HISTORY, ring->length);
    for (uint8_t g = 0U; g < width; g++) {
        if (held[g] != HG_CODE_INVALID) { /* else the radius was that of the range already */
            int32_t place = ((int32_t)ring->newest * back) + (int32_t)first + (int32_t)g;
            const hg_real *moved = &slew(config, self->gap_age)[g];
            for (uint8_t lag = lags; lag > 0U; lag--) {
                place += (place >= back) ? -back : (end - back);
                moved = &moved[-(int32_t)width];
                ring->data[place] = *moved;
            }
        }
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
