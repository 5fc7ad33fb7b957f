/** @file
 *  trigger.h: when a sender speaks. Tables, signals and state are any. */
#include "proof.h"

#include "hullguard/trigger.h"

/* Tables of any content for WIDTH channels at most; what is behind their ends is out of bounds. */
typedef struct {
    uint8_t  silence[LEVELS];
    uint16_t delta[LEVELS * WIDTH];
    int32_t  sigma[LEVELS * WIDTH];
    int32_t  activity[LEVELS * WIDTH];
    int32_t  zero[WIDTH];
} tables;

static hg_trigger_config config_of(const tables *t)
{
    const uint8_t width = any_u8_in(0U, WIDTH);
    const uint8_t levels = any_u8_in(1U, LEVELS);
    const size_t n = (size_t)width * levels;
    return (hg_trigger_config){.width = width,
                               .levels = levels,
                               .interval_max = any_u8(),
                               .silence = TAIL(t->silence, levels),
                               .delta = TAIL(t->delta, n),
                               .sigma = TAIL(t->sigma, n),
                               .activity = TAIL(t->activity, n),
                               .zero = TAIL(t->zero, width)};
}

/** A trigger that has started speaks first, and then after 1 .. interval_max samples, whatever the codes are and whatever valid tables it has; its level stays in range,
 *  what it has sent is what it was given; a silent one leaves its codes as they are.
 *  Any tables of WIDTH channels and LEVELS levels at most; any state that a start and samples can leave (level and age in range), any codes.
 *  @proves hg_trigger_start hg_trigger_step hg_trigger_valid
 *  @run check real=f32 unwind=5 limit=150 WIDTH=2U LEVELS=2U */
void proof_trigger_step(void)
{
    tables t;
    int32_t sent[WIDTH];
    int32_t code[WIDTH];
    hg_trigger self;
    const hg_trigger_config config = config_of(&t);
    if (hg_trigger_start(&self, &config, TAIL(sent, config.width)) == HG_OK) {
        prove(hg_trigger_valid(&config), "what starts is valid");
        prove(hg_trigger_step(&self, TAIL(code, config.width)) == HG_OK, "the first sample is sent");
        prove((self.age == 0U) && (self.level == 0U), "it begins with the quietest level");
        self.level = any_u8_in(0U, (uint8_t)(config.levels - 1U));
        self.age = any_u8_in(0U, (uint8_t)(config.interval_max - 1U));
        const uint8_t age = self.age;
        int32_t before[WIDTH];
        for (uint8_t g = 0U; g < config.width; g++) {
            self.sent[g] = any_i32();
            before[g] = self.sent[g];
            TAIL(code, config.width)[g] = any_i32();
        }
        const hg_status status = hg_trigger_step(&self, TAIL(code, config.width));
        prove((status == HG_OK) || (status == HG_E_EMPTY), "no other status");
        prove(self.age < config.interval_max, "never silent for interval_max samples");
        prove((status == HG_OK) || (self.age == (age + 1U)), "silence ages");
        prove((status != HG_OK) || (self.age == 0U), "an event is of age 0");
        prove(self.level < config.levels, "the level is in range");
        for (uint8_t g = 0U; g < config.width; g++) {
            prove(self.sent[g] == ((status == HG_OK) ? TAIL(code, config.width)[g] : before[g]), "sent is what was sent last");
        }
        if (status == HG_OK) {
            reach("an event");
        } else {
            reach("silence");
        }
    } else {
        reach("tables that are refused");
    }
}

/** The threshold that sender and receiver compute is 0 for what was sent as invalid, else sigma and the share delta / 65536 of the distance from zero, rounded down and saturated: never negative, and no
 *  larger for a smaller distance.
 *  Any tables of WIDTH channels and LEVELS levels at most, delta up to SHARE; any code up to RANGE from zero.
 *  @proves hg_trigger_threshold
 *  @run check real=f32 unwind=5 limit=90 WIDTH=1U LEVELS=1U SHARE=255U RANGE=1023
 *  @run deep real=f32 unwind=5 limit=3600 WIDTH=1U LEVELS=1U SHARE=65535U RANGE=4294967295LL */
void proof_trigger_threshold(void)
{
    tables t;
    const hg_trigger_config config = config_of(&t);
    assume((config.interval_max >= 1U) && (config.width > 0U) && hg_trigger_valid(&config));
    const uint8_t level = any_u8_in(0U, (uint8_t)(config.levels - 1U));
    const uint8_t channel = any_u8_in(0U, (uint8_t)(config.width - 1U));
    const int32_t sent = any_i32();
    const int32_t threshold = hg_trigger_threshold(&config, level, channel, sent);
    const size_t i = ((size_t)level * config.width) + channel;
    const int64_t apart = (int64_t)sent - config.zero[channel];
    assume((config.delta[i] <= SHARE) && (apart <= RANGE) && (apart >= -RANGE));
    const uint64_t relative = ((uint64_t)config.delta[i] * (uint32_t)((apart < 0) ? -apart : apart)) >> 16U;
    const int64_t exact = config.sigma[i] + (int64_t)relative;
    prove((sent == HG_CODE_INVALID) ? (threshold == 0) : (threshold == ((exact > INT32_MAX) ? INT32_MAX : exact)), "the header's equation");
    prove(threshold >= 0, "a distance");
    reach("end");
}

/** The level follows from two frames alone and is the highest that some channel's activity reaches; a channel that is or was invalid reaches every one.
 *  Any tables of WIDTH channels and LEVELS levels at most, any codes.
 *  @proves hg_trigger_level
 *  @run check real=f32 unwind=4 limit=150 WIDTH=2U LEVELS=3U */
void proof_trigger_level(void)
{
    tables t;
    int32_t sent[WIDTH];
    int32_t previous[WIDTH];
    const hg_trigger_config config = config_of(&t);
    const uint8_t level = hg_trigger_level(&config, TAIL(sent, config.width), TAIL(previous, config.width));
    prove(level < config.levels, "the level is in range");
    for (uint8_t l = 1U; l < config.levels; l++) {
        bool reached = false;
        for (uint8_t g = 0U; g < config.width; g++) {
            const int32_t now = TAIL(sent, config.width)[g];
            const int32_t before = TAIL(previous, config.width)[g];
            const int64_t apart = (int64_t)now - before;
            const bool invalid = (now == HG_CODE_INVALID) || (before == HG_CODE_INVALID);
            reached = reached || invalid || (((apart < 0) ? -apart : apart) >= config.activity[((size_t)l * config.width) + g]);
        }
        prove((!reached) || (level >= l), "no lower than what is reached");
        prove(reached || (level != l), "only what is reached");
    }
    if (level > 0U) {
        reach("an active channel");
    }
}

/** Null pointers are refused, and so are tables out of range, without a write.
 *  Any null pointers.
 *  @proves hg_trigger_start
 *  @run check real=f32 unwind=4 limit=150 WIDTH=2U LEVELS=2U */
void proof_trigger_start(void)
{
    tables t;
    int32_t sent[WIDTH];
    hg_trigger self;
    hg_trigger_config config = config_of(&t);
    config.width = any_bool() ? config.width : any_u8_in(HG_GROUP_SIGNALS_MAX + 1U, UINT8_MAX);
    config.levels = any_bool() ? config.levels : (any_bool() ? 0U : any_u8_in(HG_LEVELS_MAX + 1U, UINT8_MAX));
    config.silence = any_bool() ? config.silence : NULL;
    config.delta = any_bool() ? config.delta : NULL;
    config.sigma = any_bool() ? config.sigma : NULL;
    config.activity = any_bool() ? config.activity : NULL;
    config.zero = any_bool() ? config.zero : NULL;
    hg_trigger *where = any_bool() ? &self : NULL;
    const hg_trigger_config *tables = any_bool() ? &config : NULL;
    const bool room = config.width <= WIDTH;
    int32_t *codes = any_bool() ? (room ? TAIL(sent, config.width) : sent) : NULL;
    const hg_status status = hg_trigger_start(where, tables, codes);
    prove((status == HG_E_ARGUMENT) == ((where == NULL) || (tables == NULL) || (codes == NULL)), "null pointers");
    if (status == HG_OK) {
        prove(room && (config.levels >= 1U) && (config.levels <= LEVELS) && (config.silence != NULL) && (config.interval_max >= 1U), "what is started is in range");
        prove((config.width == 0U) || ((config.delta != NULL) && (config.sigma != NULL) && (config.activity != NULL) && (config.zero != NULL)), "and its tables are there");
        reach("a start");
    }
    if (status == HG_E_CONFIG) {
        reach("a refusal");
    }
}
