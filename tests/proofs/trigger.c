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
 *  @run check real=f32 unwind=5 limit=60 WIDTH=2U LEVELS=2U */
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
