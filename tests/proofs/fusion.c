/** @file
 *  fusion.h, consistency.h: event-triggered fusion of a small plant. Numbers are any, NaN and infinity among them; sizes are those of a run. */
#include "proof.h"

#include "hullguard/consistency.h"

#define SLOTS (DEPTH + 1U)
#define REALS HG_FUSION_REALS(STATES, 0U, SENSORS, DEPTH)

typedef struct {
    hg_real         A[STATES * STATES];
    hg_real         Q[STATES * STATES];
    hg_real         x0[STATES];
    hg_real         P0[STATES * STATES];
    uint8_t         select[SENSORS];
    hg_real         R[SENSORS];
    hg_real         range[SENSORS];
    hg_real         origin[STATES];
    hg_real         level[SENSORS];
    hg_real         relax[SENSORS];
    hg_real         early[SENSORS];
    hg_fusion_table table;
} tables;

typedef struct {
    hg_fusion_slot   slot[SLOTS];
    hg_fusion_entry  entry[SLOTS * SENSORS];
    hg_fusion_sensor sensor[SENSORS];
    hg_fusion_record record[SENSORS];
    int32_t          origin[STATES];
    hg_real          real[REALS];
} storage;

static hg_fusion_config any_config(tables *t)
{
    hg_fusion_config config;
    config.states = STATES;
    config.inputs = 0U;
    config.sensors = SENSORS;
    config.depth = DEPTH;
    config.A = t->A;
    config.B = NULL;
    config.Q = t->Q;
    config.x0 = t->x0;
    config.P0 = t->P0;
    config.select = t->select;
    config.C = NULL;
    config.R = t->R;
    config.range = t->range;
    config.origin = any_bool() ? t->origin : NULL;
    config.rates = 1U;
    config.tables = 1U;
    t->table = (hg_fusion_table){.alive = any_u16(), .level = t->level, .relax = t->relax, .early = t->early};
    config.table = &t->table;
    return config;
}

/** A filter takes any measurements, stamps and counters, and keeps to its memory: statuses of the closed lists, as many samples held as it has room for; a value twice, of a sample that
 *  is not held, or out of range is refused.
 *  STATES states, SENSORS sensors, DEPTH past samples, counters of up to MODULUS values; any tables that hg_fusion_valid() accepts; SAMPLES samples after a start, a frame each, and whatever a frame can say of the past.
 *  @proves hg_fusion_start hg_fusion_valid hg_fusion_reset hg_fusion_open hg_fusion_due hg_fusion_receive hg_fusion_unwrap hg_fusion_local hg_fusion_number hg_fusion_recall
 *  @proves hg_fusion_exclude hg_fusion_alive
 *  @without conversion unsigned-overflow: sample indices and counters are meant to wrap, turns and origins are rounded to integers within bounds that only the numbers know
 *  @run deep real=f32 unwind=4 limit=3600 hg_fusion_recall.0:9 hg_fusion_start.1:6 take_stock.0:5 STATES=1U SENSORS=1U DEPTH=0U SAMPLES=1U MODULUS=4U ANY_NUMBERS
 *  @run deep real=f32 unwind=5 limit=7200 hg_fusion_recall.0:9 hg_fusion_start.1:6 take_stock.0:17 STATES=2U SENSORS=2U DEPTH=2U SAMPLES=2U MODULUS=16U */
void proof_fusion(void)
{
    tables t;
    storage s;
    const hg_fusion_config config = any_config(&t);
    const hg_fusion_memory memory = {.slot = s.slot, .entry = s.entry, .sensor = s.sensor, .record = s.record, .origin = s.origin, .real = s.real};
    hg_fusion self;
    const hg_status started = hg_fusion_start(&self, &config, &memory);
    prove((started == HG_OK) == hg_fusion_valid(&config), "what is valid starts");
    prove((hg_fusion_start(NULL, &config, &memory) == HG_E_ARGUMENT) && (hg_fusion_start(&self, NULL, &memory) == HG_E_ARGUMENT) && (hg_fusion_start(&self, &config, NULL) == HG_E_ARGUMENT),
          "null pointers");
    assume((started == HG_OK) && (config.modulus <= MODULUS));
    prove(t.select[0] < STATES, "a state that there is");
    hg_real y;
    hg_real period;
    for (uint8_t k = 0U; k < SAMPLES; k++) {
        const uint8_t i = any_u8_in(0U, SENSORS - 1U);
        const uint8_t stamp = any_u8();
        const hg_status opened = hg_fusion_open(&self, NULL);
        prove(opened == HG_OK, "opened");
        prove(hg_fusion_open(&self, NULL) == HG_E_BUSY, "once");
        hg_fusion_number(&self, any_u32());
        const hg_status due = hg_fusion_due(&self, i, y, y);
        prove((due == HG_OK) || (due == HG_E_EMPTY) || (due == HG_E_NUMERIC), "no other status");
        const hg_real near = hg_fusion_unwrap(&self, i, stamp, hg_fusion_local(&self, i, stamp, y), period);
        const hg_status booked = hg_fusion_receive(&self, i, stamp, any_u8(), near);
        prove((booked == HG_OK) || (booked == HG_E_STAMP) || (booked == HG_E_REPEATED) || (booked == HG_E_NUMERIC), "no other status");
        if (booked == HG_OK) {
            prove(hg_fusion_receive(&self, i, stamp, any_u8(), near) == HG_E_REPEATED, "one value a sample");
            reach("a frame");
        }
        const hg_status recalled = hg_fusion_recall(&self, i, any_u8(), any_u8(), y);
        prove((recalled == HG_OK) || (recalled == HG_E_STAMP), "no other status");
        hg_fusion_exclude(&self, i, any_bool());
        if ((k + 1U) < SAMPLES) { /* the last is closed by proof_fusion_close() */
            (void)hg_fusion_close(&self);
        }
        prove((self.held <= SLOTS) && (self.newest < SLOTS), "samples that there is room for");
        prove((hg_fusion_alive(&self) >> SENSORS) == 0U, "sensors that there are");
    }
    hg_fusion_reset(&self);
    reach("end");
}

/** Closing a sample filters it in once; the filter stays finite or begins again, and says so.
 *  STATES states, SENSORS sensors, DEPTH past samples; any tables that hg_fusion_valid() accepts; a start and a sample with any frame of it, or none.
 *  @proves hg_fusion_close hg_fusion_open hg_fusion_receive hg_fusion_reset
 *  @without conversion unsigned-overflow: sample indices and counters are meant to wrap, turns and origins are rounded to integers within bounds that only the numbers know
 *  @run deep real=f32 unwind=4 limit=3600 hg_fusion_start.1:6 take_stock.0:5 STATES=1U SENSORS=1U DEPTH=0U MODULUS=4U ANY_NUMBERS
 *  @run deep real=f32 unwind=4 limit=3600 hg_fusion_start.1:6 take_stock.0:5 STATES=1U SENSORS=1U DEPTH=1U MODULUS=4U ANY_NUMBERS */
void proof_fusion_close(void)
{
    tables t;
    storage s;
    const hg_fusion_config config = any_config(&t);
    const hg_fusion_memory memory = {.slot = s.slot, .entry = s.entry, .sensor = s.sensor, .record = s.record, .origin = s.origin, .real = s.real};
    hg_fusion self;
    hg_real y;
    assume((hg_fusion_start(&self, &config, &memory) == HG_OK) && (config.modulus <= MODULUS));
    prove(hg_fusion_close(&self) == HG_E_STATE, "no sample is open");
    prove(hg_fusion_open(&self, NULL) == HG_OK, "opened");
    if (any_bool()) {
        (void)hg_fusion_receive(&self, 0U, (uint8_t)(self.k & 15U), any_u8(), y);
    }
    const hg_status closed = hg_fusion_close(&self);
    prove((closed == HG_OK) || (closed == HG_E_NUMERIC), "no other status");
    prove(hg_fusion_close(&self) == HG_E_STATE, "closed once");
    prove((self.held <= SLOTS) && (self.newest < SLOTS), "samples that there is room for");
    hg_fusion_reset(&self);
    reach("end");
}

/** A consistency test keeps to its memory and blames only sensors that there are, whatever the filter's records are.
 *  STATES states, SENSORS sensors, ONSETS hypotheses; any numbers and records; one sample in any state.
 *  @proves hg_consistency_start hg_consistency_reset hg_consistency_step
 *  @run check real=f32 unwind=6 limit=150 STATES=1U SENSORS=2U ONSETS=1U ANY_NUMBERS
 *  @run deep real=f32 unwind=10 limit=3600 STATES=3U SENSORS=3U ONSETS=3U */
void proof_consistency(void)
{
    tables t;
    hg_fusion_record record[SENSORS];
    hg_real gain[SENSORS * STATES];
    hg_real least[SENSORS];
    hg_consistency_sum sum[ONSETS * SENSORS];
    hg_consistency_sensor sensor[SENSORS];
    hg_real real[HG_CONSISTENCY_REALS(STATES, SENSORS, ONSETS)];
    const hg_fusion_config filter = any_config(&t);
    for (uint8_t i = 0U; i < SENSORS; i++) {
        record[i].gain = &gain[i * STATES];
        record[i].value = any_bool();
        assume(t.select[i] < STATES);
    }
    const hg_fusion fusion = {.config = &filter, .record = record, .excluded = any_u16()};
    hg_consistency_config config;
    config.onsets = ONSETS;
    config.least = any_bool() ? least : NULL;
    const hg_consistency_memory memory = {.sum = sum, .sensor = sensor, .real = real};
    hg_consistency self;
    const hg_status started = hg_consistency_start(&self, &config, &fusion, &memory);
    prove((started == HG_OK) || (started == HG_E_CONFIG), "no other status");
    prove((hg_consistency_start(NULL, &config, &fusion, &memory) == HG_E_ARGUMENT) && (hg_consistency_start(&self, NULL, &fusion, &memory) == HG_E_ARGUMENT) &&
              (hg_consistency_start(&self, &config, NULL, &memory) == HG_E_ARGUMENT) && (hg_consistency_start(&self, &config, &fusion, NULL) == HG_E_ARGUMENT),
          "null pointers");
    assume(started == HG_OK);
    prove((self.next == real) && (self.f == &real[STATES]), "its parts, one after another");
    hg_real next[STATES];
    hg_real f[ONSETS * SENSORS * STATES];
    self.next = next;
    self.f = f;
    hg_consistency_reset(&self);
    self.onset = any_u8_in(0U, ONSETS - 1U);
    self.since = any_u8_in(0U, config.stride);
    self.leader = any_u8_in(0U, SENSORS - 1U);
    self.leads = any_u8();
    self.rests = any_u8();
    const uint16_t blamed = hg_consistency_step(&self);
    prove((blamed >> SENSORS) == 0U, "sensors that there are");
    prove((self.onset < ONSETS) && (self.leader < SENSORS), "hypotheses that there are");
    if (blamed != 0U) {
        reach("blamed");
    }
}
