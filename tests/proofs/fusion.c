/** @file
 *  fusion.h, consistency.h: event-triggered fusion of a small plant. Numbers are any, NaN and infinity among them; sizes are those of a run. */
#include "any_fusion.h"

/** What starts is a filter that samples can leave, with valid tables alone; its parts share its memory without a gap. Null pointers are refused.
 *  STATES states, SENSORS sensors, DEPTH past samples; tables of any content.
 *  @proves hg_fusion_start hg_fusion_valid
 *  @run check real=f32 unwind=37 limit=90 STATES=6U SENSORS=5U DEPTH=2U MODULUS=256U ANY_SHARES
 *  @run deep real=f64 unwind=6 limit=90 STATES=1U SENSORS=2U DEPTH=2U MODULUS=256U ANY_NUMBERS */
void proof_fusion_start(void)
{
    const hg_fusion_config config = any_fusion_config();
    const hg_fusion_memory memory = {.slot = any_array(hg_fusion_slot, SLOTS), .entry = any_array(hg_fusion_entry, SLOTS * SENSORS), .sensor = any_array(hg_fusion_sensor, SENSORS),
                                     .record = any_array(hg_fusion_record, SENSORS), .origin = any_array(int32_t, STATES), .real = any_array(hg_real, FUSION_REALS)};
    hg_fusion self;
    prove((hg_fusion_start(NULL, &config, &memory) == HG_E_ARGUMENT) && (hg_fusion_start(&self, NULL, &memory) == HG_E_ARGUMENT) && (hg_fusion_start(&self, &config, NULL) == HG_E_ARGUMENT),
          "null pointers");
    prove(ensures_fusion_valid(&config, hg_fusion_valid(&config)), "sizes that the library is made for");
    assume(requires_fusion_start(&config, &memory));
    const hg_status status = hg_fusion_start(&self, &config, &memory);
    prove(ensures_fusion_start(&self, &config, &memory, status), "what is valid starts, as samples can leave it, no number twice");
    if (status == HG_OK) {
        prove(&self.record[SENSORS - 1U].gain[STATES] == &memory.real[FUSION_REALS], "to the last one");
        reach("a start");
    }
}

/** A filter takes any measurements, stamps and counters, NaN and infinity among them, in any state, and is again one that samples can leave; a value twice, of a sample that is not held, or
 *  out of range is refused.
 *  STATES states, SENSORS sensors, DEPTH past samples, the newest sample in place NEWEST, above DEPTH: in any; counters of up to MODULUS values; any tables that hg_fusion_valid() accepts,
 *  whatever a frame can say.
 *  @proves hg_fusion_due hg_fusion_receive hg_fusion_unwrap hg_fusion_local hg_fusion_number hg_fusion_recall hg_fusion_exclude hg_fusion_alive
 *  @without conversion unsigned-overflow: sample indices and counters are meant to wrap, turns and origins are rounded to integers within bounds that only the numbers know
 *  @run check real=f32 unwind=6 limit=90 hg_fusion_recall.0:9 NEWEST=9U STATES=2U SENSORS=2U DEPTH=1U MODULUS=256U ANY_SHARES
 *  @run deep real=f32 unwind=7 limit=1800 hg_fusion_recall.0:9 NEWEST=0U STATES=6U SENSORS=5U DEPTH=2U MODULUS=256U ANY_SHARES
 *  @run deep real=f32 unwind=7 limit=1800 hg_fusion_recall.0:9 NEWEST=1U STATES=6U SENSORS=5U DEPTH=2U MODULUS=256U ANY_SHARES
 *  @run deep real=f32 unwind=7 limit=1800 hg_fusion_recall.0:9 NEWEST=2U STATES=6U SENSORS=5U DEPTH=2U MODULUS=256U ANY_SHARES */
void proof_fusion_frame(void)
{
    const hg_fusion_config config = any_fusion_config();
    assume(hg_fusion_valid(&config));
    hg_fusion self = any_fusion(&config);
    self.newest = (NEWEST <= DEPTH) ? NEWEST : any_u8();
    assume(started_fusion(&self));
    const uint8_t i = any_u8_in(0U, SENSORS - 1U);
    const uint8_t stamp = any_u8();
    hg_real y;
    hg_real period;
    const hg_fusion before = self;
    assume(requires_fusion_sensor(&self, i));
    if (any_bool()) {
        const hg_real near = hg_fusion_unwrap(&self, i, stamp, hg_fusion_local(&self, i, stamp, y), period);
        const hg_status booked = hg_fusion_receive(&self, i, stamp, any_u8(), near);
        prove(ensures_fusion_receive(&self, &before, booked), "a status of the list, as samples can leave it");
        prove((booked != HG_OK) || (hg_real_abs(near) <= config.range[i]), "in range");
        prove((booked != HG_OK) || (hg_fusion_receive(&self, i, stamp, any_u8(), near) == HG_E_REPEATED), "one value a sample");
        if (booked == HG_OK) {
            reach("a frame");
        }
    } else {
        const hg_status recalled = hg_fusion_recall(&self, i, stamp, any_u8(), y);
        prove((recalled == HG_OK) || (recalled == HG_E_STAMP), "no other status");
        const hg_status due = hg_fusion_due(&self, i, y, period);
        prove(ensures_fusion_due(&self, due), "no other status");
        if (recalled == HG_OK) {
            reach("a frame of the past");
        }
    }
    hg_fusion_number(&self, any_u32());
    const bool out = any_bool();
    hg_fusion_exclude(&self, i, out);
    prove((((uint32_t)self.excluded >> i) & 1U) == (out ? 1U : 0U), "out, or back in");
    prove((hg_fusion_alive(&self) >> SENSORS) == 0U, "sensors that there are");
    prove(started_fusion(&self), "as samples can leave it");
}

/** A filter begun again holds no sample, and is one that samples can leave.
 *  As above; any state.
 *  @proves hg_fusion_reset
 *  @run check real=f32 unwind=37 limit=90 STATES=6U SENSORS=5U DEPTH=2U MODULUS=256U ANY_SHARES */
void proof_fusion_reset(void)
{
    const hg_fusion_config config = any_fusion_config();
    assume(hg_fusion_valid(&config));
    hg_fusion self = any_fusion(&config);
    assume(started_fusion(&self));
    const hg_fusion before = self;
    hg_fusion_reset(&self);
    prove(ensures_fusion_reset(&self, &before), "begun again");
    prove((self.sensor[SENSORS - 1U].age == config.heartbeat) && (self.resets == before.resets), "every sensor has to speak, and counters go on");
    reach("end");
}

/** A sample is opened once, with a place and a prediction of its own; a filter is again one that samples can leave.
 *  As above; any state.
 *  @proves hg_fusion_open
 *  @without conversion unsigned-overflow: sample indices and counters are meant to wrap, turns and origins are rounded to integers within bounds that only the numbers know
 *  @run check real=f32 unwind=6 limit=90 NEWEST=9U STATES=1U SENSORS=2U DEPTH=1U MODULUS=256U ANY_SHARES
 *  @run deep real=f32 unwind=7 limit=1800 copy.0:37 NEWEST=0U STATES=6U SENSORS=5U DEPTH=2U MODULUS=256U ANY_SHARES
 *  @run deep real=f32 unwind=7 limit=1800 copy.0:37 NEWEST=1U STATES=6U SENSORS=5U DEPTH=2U MODULUS=256U ANY_SHARES
 *  @run deep real=f32 unwind=7 limit=1800 copy.0:37 NEWEST=2U STATES=6U SENSORS=5U DEPTH=2U MODULUS=256U ANY_SHARES */
void proof_fusion_open(void)
{
    const hg_fusion_config config = any_fusion_config();
    assume(hg_fusion_valid(&config));
    hg_fusion self = any_fusion(&config);
    self.newest = (NEWEST <= DEPTH) ? NEWEST : any_u8();
    assume(started_fusion(&self));
    const hg_fusion before = self;
    const hg_status status = hg_fusion_open(&self, NULL);
    prove(ensures_fusion_open(&self, &before, status), "once, the next, as samples can leave it");
    if (status == HG_OK) {
        prove((self.held == ((before.held < SLOTS) ? (before.held + 1U) : SLOTS)), "one more is held");
        prove(self.slot[self.newest].entry[SENSORS - 1U].known == HG_FUSION_NOTHING, "of which nothing is known");
        reach("a sample");
    }
}

/** Closing a sample filters it in once; the filter stays finite or begins again, and says so; it is again one that samples can leave, its loss rates between 0 and 1.
 *  As above; any state, with any frames booked.
 *  @proves hg_fusion_close
 *  @stub hg_linalg_root
 *  @without conversion unsigned-overflow: sample indices and counters are meant to wrap, turns and origins are rounded to integers within bounds that only the numbers know
 *  @run check real=f32 unwind=6 limit=90 STATES=1U SENSORS=1U DEPTH=0U MODULUS=2U ANY_SHARES
 *  @run deep real=f32 unwind=6 limit=1800 STATES=1U SENSORS=1U DEPTH=0U MODULUS=3U ANY_SHARES
 *  @run deep real=f32 unwind=6 limit=1800 STATES=1U SENSORS=1U DEPTH=1U MODULUS=2U ANY_SHARES
 *  @run deep real=f32 unwind=6 limit=3600 STATES=2U SENSORS=2U DEPTH=1U MODULUS=4U ANY_SHARES */
void proof_fusion_close(void)
{
    const hg_fusion_config config = any_fusion_config();
    assume(hg_fusion_valid(&config));
    hg_fusion self = any_fusion(&config);
    assume(started_fusion(&self));
    const hg_fusion before = self;
    const hg_status status = hg_fusion_close(&self);
    prove(ensures_fusion_close(&self, &before, status), "a sample that is open, once, as samples can leave it");
    prove((status != HG_OK) || (hg_real_finite(self.x[STATES - 1U]) && hg_real_finite(self.P[0])), "a finite estimate");
    if (status == HG_OK) {
        reach("a sample");
    }
    if (status == HG_E_NUMERIC) {
        reach("a state that is lost");
    }
}

/** A consistency test keeps to its memory and blames only sensors that there are, whatever the filter's records are.
 *  STATES states, SENSORS sensors, ONSETS hypotheses; any numbers and records; one sample in any state.
 *  @proves hg_consistency_start hg_consistency_reset hg_consistency_step
 *  @run check real=f32 unwind=6 limit=150 STATES=1U SENSORS=2U ONSETS=1U ANY_NUMBERS
 *  @run deep real=f32 unwind=10 limit=3600 STATES=3U SENSORS=3U ONSETS=3U */
void proof_consistency(void)
{
    hg_fusion_record record[SENSORS];
    hg_real gain[SENSORS * STATES];
    hg_real least[SENSORS];
    hg_consistency_sum sum[ONSETS * SENSORS];
    hg_consistency_sensor sensor[SENSORS];
    hg_real real[HG_CONSISTENCY_REALS(STATES, SENSORS, ONSETS)];
    const hg_fusion_config filter = any_fusion_config();
    for (uint8_t i = 0U; i < SENSORS; i++) {
        record[i].gain = &gain[i * STATES];
        record[i].value = any_bool();
        assume((filter.select == NULL) || (filter.select[i] < STATES));
    }
    const hg_fusion fusion = {.config = &filter, .record = record, .excluded = any_u16()};
    hg_consistency_config config;
    config.onsets = ONSETS;
    config.least = any_bool() ? least : NULL;
    const hg_consistency_memory memory = {.sum = sum, .sensor = sensor, .real = real};
    hg_consistency self;
    assume(requires_consistency_start(&config, &fusion, &memory));
    const hg_status started = hg_consistency_start(&self, &config, &fusion, &memory);
    prove(ensures_consistency_start(&self, &config, &fusion, &memory, started), "as samples can leave it");
    prove((hg_consistency_start(NULL, &config, &fusion, &memory) == HG_E_ARGUMENT) && (hg_consistency_start(&self, NULL, &fusion, &memory) == HG_E_ARGUMENT) &&
              (hg_consistency_start(&self, &config, NULL, &memory) == HG_E_ARGUMENT) && (hg_consistency_start(&self, &config, &fusion, NULL) == HG_E_ARGUMENT),
          "null pointers");
    assume(started == HG_OK);
    hg_real next[STATES];
    hg_real f[ONSETS * SENSORS * STATES];
    self.next = next;
    self.f = f;
    const hg_consistency begun = self;
    assume(requires_consistency_reset(&self));
    hg_consistency_reset(&self);
    prove(ensures_consistency_reset(&self, &begun), "begun again");
    self.onset = any_u8();
    self.since = any_u8();
    self.leader = any_u8();
    self.leads = any_u8();
    self.rests = any_u8();
    self.blamed = any_u16();
    const hg_consistency before = self;
    assume(requires_consistency_step(&self));
    const uint16_t blamed = hg_consistency_step(&self);
    prove(ensures_consistency_step(&self, &before, blamed), "sensors and hypotheses that there are");
    if (blamed != 0U) {
        reach("blamed");
    }
}
