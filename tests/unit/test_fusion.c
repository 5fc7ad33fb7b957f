/** @file
 *  fusion.h: the filter by hand where it has one state, triggers and what silence says, frames that come late, are lost, or tell of the past; nodes that
 *  hear the same frames are equal to the bit. The equations on random systems are held against Eigen by the oracle. */
#include "support.h"

#include "hullguard/fusion.h"

#define STATES 2U
#define SENSORS 3U
#define INPUTS 2U
#define DEPTH 4U
#define SLOTS (DEPTH + 1U)
#define RATES 2U
#define REALS (HG_FUSION_REALS(STATES, INPUTS, SENSORS, DEPTH))

static const hg_real plant_A[STATES * STATES] = {R(1), R(0.125), R(0), R(1)};
static const hg_real plant_B[STATES * INPUTS] = {R(0), R(0.5), R(1), R(-0.25)};
static const hg_real plant_Q[STATES * STATES] = {R(0), R(0), R(0), R(0.015625)};
static const hg_real plant_x0[STATES] = {R(0), R(1)};
static const hg_real plant_P0[STATES * STATES] = {R(4), R(0), R(0), R(1)};
static const uint8_t places[SENSORS] = {0U, 0U, 1U};
static const hg_real rows[SENSORS * STATES] = {R(1), R(0), R(1), R(0), R(0), R(1)};
static const hg_real noise[SENSORS] = {R(0.0625), R(0.25), R(0.125)};
static const hg_real ranges[SENSORS] = {R(1000), R(1000), R(50)};
static const hg_real levels[SENSORS] = {R(0.5), R(1), R(2)};
static const hg_real relaxes[RATES * SENSORS] = {R(0.25), R(0.5), R(-1), R(0.75), R(1), R(-1)};
static const hg_real earlies[RATES * SENSORS] = {R(2), R(3), R(-1), R(4), R(5), R(-1)};
static const hg_real other_levels[SENSORS] = {R(100), R(0.125), R(0.25)};
static const hg_real other_relaxes[RATES * SENSORS] = {R(0.5), R(0.125), R(0.25), R(-1), R(0.5), R(0.5)};
static const hg_fusion_table table_list[2] = {{.alive = 7U, .level = levels, .relax = relaxes, .early = earlies},
                                              {.alive = 6U, .level = other_levels, .relax = other_relaxes, .early = other_relaxes}};
static const hg_fusion_config usual = {.states = STATES, .inputs = INPUTS, .sensors = SENSORS, .depth = DEPTH, .delay = 0U, .heartbeat = 5U, .watchdog = 9U,
                                       .modulus = 16U, .trigger = HG_FUSION_INNOVATION, .A = plant_A, .B = plant_B, .Q = plant_Q, .x0 = plant_x0,
                                       .P0 = plant_P0, .select = places, .C = NULL, .R = noise, .range = ranges, .huber = R(0), .origin = NULL,
                                       .rates = RATES, .rate_step = R(0.25), .loss = R(0), .smoothing = R(0.0625), .tables = 2U, .table = table_list};

typedef struct {
    hg_fusion        self;
    hg_fusion_slot   slot[SLOTS];
    hg_fusion_entry  entry[SLOTS * SENSORS];
    hg_fusion_sensor sensor[SENSORS];
    hg_fusion_record record[SENSORS];
    int32_t          origin[STATES + 1U]; /* one more, for the canary */
    hg_real          real[REALS + 1U];
} rig;

static const hg_real rest[INPUTS] = {R(0), R(0)};

static hg_fusion_memory memory_of(rig *p)
{
    const hg_fusion_memory memory = {.slot = p->slot, .entry = p->entry, .sensor = p->sensor, .record = p->record, .origin = p->origin, .real = p->real};
    return memory;
}

static void begin(rig *p, const hg_fusion_config *config)
{
    (void)memset(p, 0x5A, sizeof(*p));
    const uint32_t reals = HG_FUSION_REALS(config->states, config->inputs, config->sensors, config->depth);
    arm(p->real, COUNT(p->real));
    const hg_fusion_memory memory = memory_of(p);
    assert_status(HG_OK, hg_fusion_start(&p->self, config, &memory));
    assert_untouched(&p->real[reals], 1U);
    assert_int_equal(CANARY_CODE, p->origin[config->states]);
}

static void open(rig *p)
{
    assert_status(HG_OK, hg_fusion_open(&p->self, rest));
}

static void close(rig *p)
{
    assert_status(HG_OK, hg_fusion_close(&p->self));
    const uint32_t reals = HG_FUSION_REALS(p->self.config->states, p->self.config->inputs, p->self.config->sensors, p->self.config->depth);
    assert_untouched(&p->real[reals], 1U);
}

static uint8_t stamp(const rig *p)
{
    return (uint8_t)(p->self.k & 15U);
}

static const hg_fusion_entry *entry_of(const rig *p, uint8_t i)
{
    return &p->self.slot[p->self.newest].entry[i];
}

static void assert_same(const rig *a, const rig *b)
{
    assert_memory_equal(a->self.x, b->self.x, STATES * sizeof(hg_real));
    assert_memory_equal(a->self.P, b->self.P, STATES * STATES * sizeof(hg_real));
}

static void start_tells_null(void **state)
{
    (void)state;
    static rig p;
    hg_fusion_memory memory = memory_of(&p);
    assert_status(HG_E_ARGUMENT, hg_fusion_start(NULL, &usual, &memory));
    assert_status(HG_E_ARGUMENT, hg_fusion_start(&p.self, NULL, &memory));
    assert_status(HG_E_ARGUMENT, hg_fusion_start(&p.self, &usual, NULL));
    for (uint8_t i = 0U; i < 6U; i++) {
        memory = memory_of(&p);
        void **field[] = {(void **)&memory.slot, (void **)&memory.entry, (void **)&memory.sensor, (void **)&memory.record, (void **)&memory.origin,
                          (void **)&memory.real};
        *field[i] = NULL;
        assert_status(HG_E_ARGUMENT, hg_fusion_start(&p.self, &usual, &memory));
    }
}

static void validity_looks_at_every_number_and_table(void **state)
{
    (void)state;
    static const hg_real none[SENSORS] = {R(0), R(1), R(1)};
    static const uint8_t far[SENSORS] = {0U, STATES, 1U};
    static const hg_real steps[STATES] = {R(0), R(128)}; /* column 1 of A is not that of the unit matrix */
    static const hg_real turned[STATES * STATES] = {R(0.5), R(0), R(0), R(1)};
    static const hg_real first[STATES] = {R(128), R(0)};
    static const hg_fusion_table no_level[1] = {{.alive = 7U, .level = NULL, .relax = relaxes, .early = earlies}};
    static const hg_fusion_table no_relax[1] = {{.alive = 7U, .level = levels, .relax = NULL, .early = earlies}};
    static const hg_fusion_table no_early[1] = {{.alive = 7U, .level = levels, .relax = relaxes, .early = NULL}};
    static const hg_fusion_table second[2] = {{.alive = 7U, .level = levels, .relax = relaxes, .early = earlies}, {.alive = 6U, .level = levels, .relax = NULL, .early = earlies}};
    static const hg_real small_steps[STATES] = {R(0), R(0.5)};
    static const hg_real coupled[STATES * STATES] = {R(1), R(0), R(0.5), R(1)};
    hg_fusion_config c[42];
    for (size_t i = 0U; i < COUNT(c); i++) {
        c[i] = usual;
    }
    c[0].states = 0U;
    c[1].states = (uint8_t)(HG_FUSION_STATES_MAX + 1U);
    c[2].sensors = 0U;
    c[3].sensors = (uint8_t)(HG_FUSION_SENSORS_MAX + 1U);
    c[4].depth = 15U;
    c[5].delay = DEPTH + 1U;
    c[6].heartbeat = 0U;
    c[7].watchdog = 4U;
    c[8].watchdog = 255U;
    c[9].modulus = 1U;
    c[10].modulus = 257U;
    c[11].trigger = (hg_fusion_trigger)0;
    c[12].trigger = (hg_fusion_trigger)6;
    c[13].A = NULL;
    c[14].B = NULL;
    c[15].Q = NULL;
    c[16].x0 = NULL;
    c[17].P0 = NULL;
    c[18].select = NULL; /* and no rows */
    c[19].R = NULL;
    c[20].range = NULL;
    c[21].R = none;
    c[22].range = none;
    c[23].select = far;
    c[24].rates = 0U;
    c[25].rate_step = R(0);
    c[26].smoothing = R(-0.5);
    c[27].smoothing = R(1.5);
    c[28].loss = R(-0.5);
    c[29].loss = R(1.5);
    c[30].tables = 0U;
    c[31].table = NULL;
    c[32].tables = 1U;
    c[32].table = no_level;
    c[33].tables = 1U;
    c[33].table = no_relax;
    c[34].tables = 1U;
    c[34].table = no_early;
    c[34].delay = 1U;
    c[35].origin = steps;
    c[36].origin = first;
    c[36].A = turned;
    c[37].rate_step = REAL_NAN;
    c[38].table = second;
    c[39].origin = small_steps;
    c[40].origin = first;
    c[40].A = coupled;
    c[41].states = 0U;
    c[41].select = NULL;
    c[41].C = rows;
    for (size_t i = 0U; i < COUNT(c); i++) {
        assert_false(hg_fusion_valid(&c[i]));
    }
    static rig p;
    const hg_fusion_memory memory = memory_of(&p);
    assert_status(HG_E_CONFIG, hg_fusion_start(&p.self, &c[0], &memory));
}

static void the_limits_of_every_number_are_valid(void **state)
{
    (void)state;
    /* What stands behind a list is nothing that it could hold. */
    static const uint8_t ended[SENSORS + 1U] = {0U, 0U, 1U, STATES};
    static const hg_real ended_A[(STATES * STATES) + STATES] = {R(1), R(0.125), R(0), R(1), R(7), R(7)};
    static const hg_real ended_steps[STATES + 1U] = {R(128), R(0), R(128)};
    static const hg_real halves[SENSORS] = {R(0.5), R(0.5), R(0.5)};
    static const hg_fusion_table no_early[1] = {{.alive = 7U, .level = levels, .relax = relaxes, .early = NULL}};
    static hg_real many[HG_FUSION_SENSORS_MAX];
    static const uint8_t zeros[HG_FUSION_SENSORS_MAX] = {0U};
    for (size_t i = 0U; i < COUNT(many); i++) {
        many[i] = R(1);
    }
    hg_fusion_config c[15];
    for (size_t i = 0U; i < COUNT(c); i++) {
        c[i] = usual;
    }
    c[0].inputs = 0U;
    c[0].B = NULL;
    c[1].select = NULL;
    c[1].C = rows;
    c[2].tables = 1U;
    c[2].table = no_early; /* without delay nobody reads it */
    c[3].origin = ended_steps;
    c[3].A = ended_A;
    c[4].watchdog = 254U;
    c[5].heartbeat = 9U;
    c[6].heartbeat = 1U;
    c[7].select = ended;
    c[8].range = halves;
    c[9].states = HG_FUSION_STATES_MAX;
    c[10].sensors = HG_FUSION_SENSORS_MAX;
    c[10].R = many;
    c[10].range = many;
    c[10].select = zeros;
    c[11].modulus = 2U;
    c[12].modulus = 256U;
    c[13].smoothing = R(1);
    c[14].loss = R(1);
    for (size_t i = 0U; i < COUNT(c); i++) {
        assert_true(hg_fusion_valid(&c[i]));
    }
}

/* ---- one state: x+ = x, Q = 1, P0 = 1, R = 1 ---- */

static const hg_real one[1] = {R(1)};
static const hg_real nought[1] = {R(0)};
static const hg_real half[1] = {R(0.5)};
static const hg_real quarters[1] = {R(0.25)};
static const uint8_t place[1] = {0U};
static const hg_real thousand[1] = {R(1000)};
static const hg_fusion_table small_table[1] = {{.alive = 1U, .level = quarters, .relax = half, .early = one}};
static const hg_fusion_config small = {.states = 1U, .inputs = 0U, .sensors = 1U, .depth = 0U, .delay = 0U, .heartbeat = 200U, .watchdog = 254U, .modulus = 16U,
                                       .trigger = HG_FUSION_INNOVATION, .A = one, .B = NULL, .Q = one, .x0 = nought, .P0 = one, .select = place, .C = NULL,
                                       .R = one, .range = thousand, .huber = R(0), .origin = NULL, .rates = 1U, .rate_step = R(1), .loss = R(0),
                                       .smoothing = R(0.5), .tables = 1U, .table = small_table};

static void a_value_is_the_kalman_filters_update(void **state)
{
    (void)state;
    static rig p;
    begin(&p, &small);
    open(&p);
    assert_real(0.0, p.self.x[0]);
    assert_real(2.0, p.self.P[0]);
    assert_real(0.0, entry_of(&p, 0U)->reference);
    assert_real(3.0, entry_of(&p, 0U)->variance);
    assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, 0U, 1U, R(3)));
    close(&p);
    assert_near(2.0, p.self.x[0], 1e-6);
    assert_near(2.0 / 3.0, p.self.P[0], 1e-6);
    assert_near(3.0, p.self.record[0].residual, 0.0);
    assert_near(3.0, p.self.record[0].spread, 0.0);
    assert_near(2.0 / 3.0, p.self.record[0].gain[0], 1e-6);
    assert_true(p.self.record[0].value);
}

static void silence_narrows_and_pulls_to_the_reference(void **state)
{
    (void)state;
    static rig p;
    begin(&p, &small);
    open(&p);
    assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, 0U, 1U, R(3)));
    close(&p);
    open(&p);
    const double before = (double)p.self.P[0];
    close(&p);
    const double s = before + 1.0;
    assert_near(before - (before * before / (s * 1.5)), p.self.P[0], 1e-6); /* R' = R + s / 2: s' = 1.5 s, beta = 2/3 */
    assert_near(2.0, p.self.x[0], 1e-6);                                     /* the reference is the prediction itself */
    assert_near(1.5 * s, p.self.record[0].spread, 1e-6);
    assert_false(p.self.record[0].value);
}

/* Once another sensor has moved the estimate, silence pulls it back: the interval it stands for lies about the reference. */
static void silence_lies_about_the_reference(void **state)
{
    (void)state;
    static rig p;
    begin(&p, &usual);
    open(&p);
    for (uint8_t i = 0U; i < SENSORS; i++) {
        assert_status(HG_OK, hg_fusion_receive(&p.self, i, stamp(&p), 1U, R(0)));
    }
    close(&p);
    open(&p);
    const double x = (double)p.self.x[0];
    const double P = (double)p.self.P[0];
    assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, stamp(&p), 2U, R(5)));
    close(&p);
    const double moved = x + (P / (P + 0.0625) * (5.0 - x));
    assert_near(x - moved, p.record[1].residual, 1e-5);
    const double left = P - (P * P / (P + 0.0625));
    assert_near(moved + (left / ((left + 0.25) * 1.5) * (x - moved)), p.self.x[0], 1e-5);
}

static void each_trigger_by_its_inequality(void **state)
{
    (void)state;
    static const struct {
        hg_fusion_trigger trigger;
        double            quiet; /* |y| at which it is silent yet; P = 2, S = 3, level 0.25 */
        double            loud;
        double            dice;
    } cases[] = {{HG_FUSION_OBSERVATION, 0.49, 0.51, 0.0},
                 {HG_FUSION_INNOVATION, 0.86, 0.87, 0.0},
                 {HG_FUSION_STOCHASTIC, 3.46, 3.47, 1.0},
                 {HG_FUSION_OWN, 900.0, 1001.0, 0.0}};
    for (size_t i = 0U; i < COUNT(cases); i++) {
        static rig p;
        hg_fusion_config c = small;
        c.trigger = cases[i].trigger;
        begin(&p, &c);
        open(&p);
        assert_status(HG_OK, hg_fusion_due(&p.self, 0U, R(0), R(1))); /* the first sample always */
        assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, 0U, 1U, R(0)));
        close(&p);
        hg_fusion_slot *slot = &p.self.slot[0];
        open(&p);
        slot->entry[0].variance = R(3); /* as if P were 2 */
        for (int sign = -1; sign <= 1; sign += 2) {
            assert_status(HG_E_EMPTY, hg_fusion_due(&p.self, 0U, R(sign * cases[i].quiet), R(cases[i].dice)));
            assert_status((cases[i].trigger == HG_FUSION_OWN) ? HG_E_NUMERIC : HG_OK, hg_fusion_due(&p.self, 0U, R(sign * cases[i].loud), R(cases[i].dice)));
        }
        assert_status(HG_E_NUMERIC, hg_fusion_due(&p.self, 0U, REAL_NAN, R(1)));
        assert_status(HG_E_NUMERIC, hg_fusion_due(&p.self, 0U, REAL_INF, R(1)));
        close(&p);
        assert_status(HG_E_STATE, hg_fusion_due(&p.self, 0U, R(0), R(1)));
    }
}

static void at_its_level_a_trigger_is_silent(void **state)
{
    (void)state;
    static const struct {
        hg_fusion_trigger trigger;
        double            y; /* with level 0.25, S = 4 and dice 1 */
    } cases[] = {{HG_FUSION_OBSERVATION, 0.5}, {HG_FUSION_INNOVATION, 1.0}, {HG_FUSION_STOCHASTIC, 4.0}};
    for (size_t i = 0U; i < COUNT(cases); i++) {
        static rig p;
        hg_fusion_config c = small;
        c.trigger = cases[i].trigger;
        begin(&p, &c);
        open(&p);
        p.self.slot[0].entry[0].variance = R(4);
        p.self.slot[0].entry[0].age = 0U;
        assert_status(HG_E_EMPTY, hg_fusion_due(&p.self, 0U, R(cases[i].y), R(1)));
        assert_status(HG_OK, hg_fusion_due(&p.self, 0U, R(cases[i].y * 1.0001), R(1)));
    }
}

/* Two sensors of one state, level 1: the second is wanted only while the first one's update leaves too much. */
static void a_schedule_counts_on_the_sensors_before(void **state)
{
    (void)state;
    static const uint8_t both[2] = {0U, 0U};
    static const hg_real noises[2] = {R(1), R(1)};
    static const hg_real reach[2] = {R(1000), R(1000)};
    static const hg_real level[2] = {R(1), R(0.5)};
    static const hg_real none[2] = {R(0.5), R(0.5)};
    static const hg_fusion_table tables[1] = {{.alive = 3U, .level = level, .relax = none, .early = none}};
    static rig p;
    hg_fusion_config c = small;
    c.sensors = 2U;
    c.select = both;
    c.R = noises;
    c.range = reach;
    c.table = tables;
    c.trigger = HG_FUSION_SCHEDULED;
    begin(&p, &c);
    open(&p); /* P = 2 > 1; then 2/3 > 0.5 */
    assert_true(entry_of(&p, 0U)->expected);
    assert_true(entry_of(&p, 1U)->expected);
    hg_fusion_exclude(&p.self, 0U, true);
    close(&p);
    assert_real(2.0, p.self.P[0]); /* silence says nothing, though the table has a number */
    open(&p); /* P = 3; the first one is out and takes nothing away */
    assert_true(entry_of(&p, 1U)->expected);
    assert_status(HG_OK, hg_fusion_due(&p.self, 1U, R(0), R(0)));
    assert_status(HG_OK, hg_fusion_receive(&p.self, 1U, 1U, 0U, R(0)));
    close(&p); /* 0.75 */
    hg_fusion_exclude(&p.self, 0U, false);
    open(&p); /* 1.75, then 1.75/2.75 = 0.636 */
    assert_true(entry_of(&p, 1U)->expected);
    assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, 2U, 0U, R(0)));
    assert_status(HG_OK, hg_fusion_receive(&p.self, 1U, 2U, 1U, R(0)));
    close(&p); /* 0.389 */
    open(&p); /* 1.389; 0.581 */
    assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, 3U, 1U, R(0)));
    assert_status(HG_OK, hg_fusion_receive(&p.self, 1U, 3U, 2U, R(0)));
    close(&p);
    hg_fusion_config two = c;
    const hg_real at_it[2] = {R(2), R(0.5)};
    const hg_fusion_table exact[1] = {{.alive = 3U, .level = at_it, .relax = none, .early = none}};
    static rig q;
    two.table = exact;
    begin(&q, &two);
    open(&q); /* P = 2: not above it */
    assert_false(entry_of(&q, 0U)->expected);
    p.self.P[0] = R(-0.5); /* as if next to nothing were open */
    open(&p);
    assert_false(entry_of(&p, 0U)->expected);
    assert_status(HG_E_EMPTY, hg_fusion_due(&p.self, 0U, R(999), R(0)));
}

static void hubers_weight_bounds_the_pull_of_a_value(void **state)
{
    (void)state;
    static const double widths[] = {1e-6, 1e-3, 0.25, 0.3, 1.0, 3.0, 7.0, 1e3, 1e5};
    for (size_t i = 0U; i < COUNT(widths); i++) {
        static rig p;
        const hg_real unit = R(widths[i] * widths[i]);
        const hg_real reach[1] = {R(1e9)};
        hg_fusion_config c = small;
        c.Q = &unit;
        c.P0 = &unit;
        c.R = &unit;
        c.range = reach;
        c.huber = R(3);
        begin(&p, &c);
        open(&p);
        const double s = 3.0 * (double)unit;
        const double y = 60.0 * sqrt(s);
        assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, 0U, 1U, R(y)));
        close(&p);
        const double pulled = 2.0 * (double)unit / (sqrt(s) / 3.0 * y) * y; /* K r with K = p / (|r| sqrt(s) / gamma) */
        assert_near(pulled, p.self.x[0], 2e-6 * pulled);
        begin(&p, &c);
        open(&p);
        assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, 0U, 1U, R(2.9 * sqrt(s))));
        close(&p);
        assert_near(s, p.self.record[0].spread, 1e-6 * s); /* within gamma the whole weight */
    }
}

static void a_state_that_is_none_begins_again(void **state)
{
    (void)state;
    static const hg_real huge[1] = {HG_REAL_MAX};
    static const hg_real four[1] = {R(4)};
    static const hg_real minus[1] = {R(-3)};
    static const hg_real zero[1] = {R(0)};
    static const hg_fusion_table mute[1] = {{.alive = 1U, .level = quarters, .relax = minus, .early = minus}};
    static rig p;
    hg_fusion_config c = small;
    c.inputs = 1U;
    c.B = four;
    begin(&p, &c);
    assert_status(HG_E_NUMERIC, hg_fusion_open(&p.self, (const hg_real[]){REAL_NAN}));
    assert_status(HG_OK, hg_fusion_open(&p.self, huge));
    assert_status(HG_E_NUMERIC, hg_fusion_close(&p.self));
    assert_real(0.0, p.self.x[0]);
    assert_real(1.0, p.self.P[0]);
    assert_count(1U, p.self.resets);
    assert_count(0U, p.self.k); /* the sample counts on */
    assert_status(HG_OK, hg_fusion_open(&p.self, zero));
    assert_count(1U, p.self.k);
    close(&p);
    c = small;
    c.A = four;
    c.P0 = huge;
    begin(&p, &c);
    open(&p); /* x is 0, P is infinite */
    assert_status(HG_E_NUMERIC, hg_fusion_close(&p.self));
    c = small;
    c.P0 = minus;
    c.table = mute;
    begin(&p, &c);
    open(&p);
    assert_status(HG_E_NUMERIC, hg_fusion_close(&p.self));
    p.self.resets = UINT16_MAX;
    open(&p);
    assert_status(HG_E_NUMERIC, hg_fusion_close(&p.self));
    assert_count(UINT16_MAX, p.self.resets);
}

static void no_variance_may_be_negative_and_each_may_be_0(void **state)
{
    (void)state;
    static const hg_real unit[STATES * STATES] = {R(1), R(0), R(0), R(1)};
    static const hg_real nothing[STATES * STATES] = {R(0), R(0), R(0), R(0)};
    static const hg_real below[2][STATES * STATES] = {{R(-0.25), R(0), R(0), R(1)}, {R(1), R(0), R(0), R(-0.25)}};
    static const hg_real mute[RATES * SENSORS] = {R(-1), R(-1), R(-1), R(-1), R(-1), R(-1)};
    static const hg_fusion_table silent[1] = {{.alive = 7U, .level = levels, .relax = mute, .early = mute}};
    hg_fusion_config c = usual;
    c.A = unit;
    c.Q = nothing;
    c.tables = 1U;
    c.table = silent;
    for (size_t i = 0U; i < COUNT(below); i++) {
        static rig p;
        c.P0 = below[i];
        begin(&p, &c);
        open(&p);
        assert_status(HG_E_NUMERIC, hg_fusion_close(&p.self));
    }
    static rig p;
    c.P0 = nothing; /* all is known */
    begin(&p, &c);
    open(&p);
    close(&p);
    assert_count(0U, p.self.resets);
}

/* ---- frames ---- */

static void open_and_close_take_turns(void **state)
{
    (void)state;
    static rig p;
    begin(&p, &usual);
    assert_status(HG_E_STATE, hg_fusion_close(&p.self));
    open(&p);
    assert_status(HG_E_BUSY, hg_fusion_open(&p.self, rest));
    close(&p);
    assert_status(HG_E_STATE, hg_fusion_close(&p.self));
}

static void each_frame_has_its_status_and_counter(void **state)
{
    (void)state;
    static rig p;
    begin(&p, &usual);
    assert_status(HG_E_STAMP, hg_fusion_receive(&p.self, 0U, 0U, 0U, R(0))); /* nothing is held yet */
    open(&p);
    assert_status(HG_E_NUMERIC, hg_fusion_receive(&p.self, 2U, stamp(&p), 0U, R(50.5)));
    assert_status(HG_E_NUMERIC, hg_fusion_receive(&p.self, 2U, stamp(&p), 0U, REAL_NAN));
    assert_count(2U, p.sensor[2].refused);
    assert_status(HG_OK, hg_fusion_receive(&p.self, 2U, stamp(&p), 0U, R(50)));
    assert_status(HG_E_REPEATED, hg_fusion_receive(&p.self, 2U, stamp(&p), 0U, R(49)));
    assert_count(1U, p.sensor[2].repeated);
    assert_real(50.0, entry_of(&p, 2U)->y);
    assert_status(HG_E_STAMP, hg_fusion_receive(&p.self, 1U, (uint8_t)(stamp(&p) + 1U), 0U, R(0)));
    assert_status(HG_E_STAMP, hg_fusion_receive(&p.self, 1U, (uint8_t)(stamp(&p) + 15U), 0U, R(0)));
    assert_count(2U, p.sensor[1].late);
    close(&p);
    for (uint32_t k = 0U; k < DEPTH; k++) {
        open(&p);
        close(&p);
    }
    /* All of sample 0 is held still, but the next open gives its place away. */
    assert_status(HG_E_STAMP, hg_fusion_receive(&p.self, 1U, 0U, 0U, R(0)));
    assert_status(HG_OK, hg_fusion_receive(&p.self, 1U, 1U, 0U, R(0)));
    assert_count(4U, p.sensor[1].late); /* it is late by more than nothing */
    open(&p);
    assert_status(HG_E_STAMP, hg_fusion_receive(&p.self, 1U, 0U, 0U, R(0)));
    close(&p);
    p.sensor[1].late = UINT16_MAX - 2U;
    for (uint16_t more = 0U; more < 3U; more++) {
        assert_status(HG_E_STAMP, hg_fusion_receive(&p.self, 1U, 0U, 0U, R(0)));
        assert_count((more == 0U) ? (UINT16_MAX - 1) : UINT16_MAX, p.sensor[1].late);
    }
}

static void lost_frames_are_counted_and_make_a_rate(void **state)
{
    (void)state;
    static const uint8_t counters[] = {7U, 8U, 11U, 10U}; /* none, none, 2, and all but one of a round lost */
    for (uint16_t modulus = 15U; modulus <= 16U; modulus++) {
        static rig p;
        double loss = 0.25;
        hg_fusion_config c = usual;
        c.loss = R(0.25);
        c.smoothing = R(0.055);
        c.modulus = modulus;
        begin(&p, &c);
        const uint8_t gaps[] = {0U, 0U, 2U, (uint8_t)(modulus - 2U)};
        uint16_t lost = 0U;
        for (size_t i = 0U; i < COUNT(counters); i++) {
            open(&p);
            assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, stamp(&p), counters[i], R(0)));
            close(&p);
            const double weight = (1.0 / (16.0 + (double)i) > 0.055) ? 1.0 / (16.0 + (double)i) : 0.055;
            for (uint8_t g = 0U; g < gaps[i]; g++) {
                loss += weight * (1.0 - loss);
            }
            loss -= weight * loss;
            lost = (uint16_t)(lost + gaps[i]);
            assert_near(loss, p.sensor[0].loss, 1e-6);
            assert_count(lost, p.sensor[0].lost);
            assert_count(i + 1U, p.sensor[0].frames);
        }
        assert_count(0U, p.sensor[1].frames);
    }
}

/* The rate chooses the row: relax 0.25 at 0, 0.75 from 0.125 on, and the last row for all beyond. */
static void the_loss_rate_chooses_what_silence_is_worth(void **state)
{
    (void)state;
    static const struct {
        double loss;
        double relax;
    } cases[] = {{0.0, 0.25}, {0.12, 0.25}, {0.13, 0.75}, {0.9, 0.75}};
    for (size_t i = 0U; i < COUNT(cases); i++) {
        static rig p;
        begin(&p, &usual);
        open(&p);
        for (uint8_t s = 0U; s < SENSORS; s++) {
            assert_status(HG_OK, hg_fusion_receive(&p.self, s, stamp(&p), 1U, R(0)));
        }
        close(&p);
        p.sensor[0].loss = R(cases[i].loss);
        open(&p);
        const double s = (double)entry_of(&p, 0U)->variance;
        close(&p);
        assert_near(s * (1.0 + cases[i].relax), p.record[0].spread, 1e-6);
        assert_real(0.0, p.record[2].spread); /* its table says that silence says nothing */
    }
}

static void a_sensor_that_had_to_speak_and_did_not_was_lost(void **state)
{
    (void)state;
    static rig p;
    begin(&p, &usual);
    open(&p);
    close(&p);
    assert_real(0.0, p.record[0].spread); /* the first sample: every sensor has to */
    open(&p);
    assert_status(HG_OK, hg_fusion_due(&p.self, 0U, entry_of(&p, 0U)->reference, R(0)));
    assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, stamp(&p), 1U, R(0)));
    close(&p);
    for (uint8_t age = 1U; age < 5U; age++) {
        open(&p);
        assert_count(age, entry_of(&p, 0U)->age);
        assert_status(HG_E_EMPTY, hg_fusion_due(&p.self, 0U, entry_of(&p, 0U)->reference, R(0)));
        close(&p);
        assert_true(p.record[0].spread > R(0));
    }
    open(&p);
    assert_status(HG_OK, hg_fusion_due(&p.self, 0U, entry_of(&p, 0U)->reference, R(0)));
    close(&p);
    assert_real(0.0, p.record[0].spread);
}

static void a_dead_sensor_is_missed_and_comes_back(void **state)
{
    (void)state;
    static rig p;
    begin(&p, &usual);
    for (uint32_t k = 0U; k < 300U; k++) {
        open(&p);
        const uint32_t age = (k + 5U < 255U) ? k + 5U : 255U;
        assert_count(age, entry_of(&p, 0U)->age);
        assert_count((age <= 9U) ? 7U : 6U, hg_fusion_alive(&p.self));
        assert_true(p.self.slot[p.self.newest].table == ((age <= 9U) ? &table_list[0] : &table_list[1]));
        assert_status(HG_OK, hg_fusion_receive(&p.self, 1U, stamp(&p), (uint8_t)(k & 15U), R(0)));
        assert_status(HG_OK, hg_fusion_receive(&p.self, 2U, stamp(&p), (uint8_t)(k & 15U), R(0)));
        close(&p);
    }
    open(&p);
    assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, stamp(&p), 9U, R(1)));
    close(&p);
    assert_true(p.record[0].spread > R(0)); /* what it says counts at once */
    open(&p);
    assert_count(7U, hg_fusion_alive(&p.self));
    close(&p);
    assert_true(p.record[0].spread > R(0)); /* and its silence from then on */
}

/* Table 1 is that of sensors 1 and 2: with sensor 0 dead its silence is not used, though that of a confirmed one has a number. */
static void silence_of_a_sensor_that_its_table_leaves_out_says_nothing(void **state)
{
    (void)state;
    static rig p;
    begin(&p, &usual);
    for (uint32_t k = 0U; k < 8U; k++) {
        open(&p);
        assert_status(HG_OK, hg_fusion_receive(&p.self, 1U, stamp(&p), (uint8_t)k, R(0)));
        assert_status(HG_OK, hg_fusion_receive(&p.self, 2U, stamp(&p), (uint8_t)k, R(0)));
        close(&p);
    }
    open(&p);
    p.self.slot[p.self.newest].entry[0].known = HG_FUSION_SILENT;
    p.self.slot[p.self.newest].entry[1].known = HG_FUSION_SILENT;
    const double s = (double)entry_of(&p, 1U)->variance;
    close(&p);
    assert_real(0.0, p.record[0].spread);
    assert_near(s * 1.125, p.record[1].spread, 1e-6); /* of its table, without losses */
}

static void a_sensor_taken_out_is_heard_but_not_fused(void **state)
{
    (void)state;
    static rig p;
    hg_fusion_config c = usual;
    c.watchdog = 254U;
    begin(&p, &c);
    hg_fusion_exclude(&p.self, 0U, true);
    hg_fusion_exclude(&p.self, 0U, true); /* it is out already */
    for (uint8_t k = 0U; k < 12U; k++) {
        open(&p);
        assert_count(6U, hg_fusion_alive(&p.self));
        assert_true(p.self.slot[p.self.newest].table == (&table_list[1]));
        assert_status((entry_of(&p, 0U)->age >= 5U) ? HG_OK : HG_E_EMPTY, hg_fusion_due(&p.self, 0U, R(900), R(0)));
        if ((k % 3U) == 0U) {
            assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, stamp(&p), k, R(900)));
        }
        close(&p);
        assert_real(0.0, p.record[0].spread);
        assert_true(p.record[0].value == ((k % 3U) == 0U));
    }
    assert_real(900.0, p.slot[(p.self.newest + SLOTS - 2U) % SLOTS].entry[0].y);
    assert_count(4U, p.sensor[0].frames);
    hg_fusion_exclude(&p.self, 0U, false);
    open(&p);
    assert_count(7U, hg_fusion_alive(&p.self));
    close(&p);
}

/* ---- the past ---- */

typedef struct {
    bool    sends[SENSORS];
    hg_real y[SENSORS];
} sample;

static void draw_sample(uint32_t *seed, sample *s)
{
    for (uint8_t i = 0U; i < SENSORS; i++) {
        s->sends[i] = draw_between(seed, 0, 2) == 0;
        s->y[i] = R(draw_between(seed, -4000, 4000)) / R(1024);
    }
}

/* Frames of one sample, as far as they were sent; those that are there already are refused. */
static void tell(rig *p, uint32_t k, const sample *s)
{
    for (uint8_t i = 0U; i < SENSORS; i++) {
        if (s->sends[i]) {
            (void)hg_fusion_receive(&p->self, i, (uint8_t)(k & 15U), 0U, s->y[i]);
        }
    }
}

/* A loss rate that is known late would be another one: it is kept out of these. */
static void close_with_rate_0(rig *p)
{
    close(p);
    for (uint8_t i = 0U; i < SENSORS; i++) {
        p->sensor[i].loss = R(0);
    }
}

/* Frames up to `depth` samples late leave the state that they would have left in time. Selected and dense rows. */
static void late_frames_are_filtered_in(void **state)
{
    (void)state;
    uint32_t seed = seed_of_run(11U);
    for (uint32_t run = 0U; run < 60U; run++) {
        static rig now;
        static rig later;
        hg_fusion_config c = usual;
        c.select = ((run % 2U) == 0U) ? places : NULL;
        c.C = rows;
        c.watchdog = 254U;
        c.huber = ((run % 4U) < 2U) ? R(0) : R(2);
        begin(&now, &c);
        begin(&later, &c);
        sample past[40];
        for (uint32_t k = 0U; k < COUNT(past); k++) {
            draw_sample(&seed, &past[k]);
            open(&now);
            open(&later);
            tell(&now, k, &past[k]);
            close_with_rate_0(&now);
            const uint32_t lag = (uint32_t)draw_between(&seed, 0, (int32_t)DEPTH);
            for (uint32_t back = lag; (back <= DEPTH) && (back <= k); back++) {
                tell(&later, k - back, &past[k - back]);
            }
            close_with_rate_0(&later);
        }
        for (uint32_t back = DEPTH; back > 0U; back--) {
            tell(&later, COUNT(past) - back, &past[COUNT(past) - back]);
        }
        open(&now);
        open(&later);
        close(&now);
        close(&later);
        assert_same(&now, &later);
        for (uint8_t i = 0U; i < SENSORS; i++) {
            assert_count(entry_of(&now, i)->age, entry_of(&later, i)->age);
        }
    }
}

/* What silence is worth follows the loss rate: a sample that was filtered by the rate of its time is not filtered again without need. */
static void only_what_a_late_frame_changes_is_filtered_again(void **state)
{
    (void)state;
    uint32_t seed = seed_of_run(13U);
    static rig none; /* holds no sample, so that it cannot */
    static rig open_;
    static rig shut;
    hg_fusion_config c = usual;
    hg_fusion_config bare = usual;
    c.smoothing = R(0.5);
    c.heartbeat = 9U;
    bare.smoothing = c.smoothing;
    bare.heartbeat = 9U;
    bare.depth = 0U;
    begin(&none, &bare);
    begin(&open_, &c);
    for (uint32_t k = 0U; k < 200U; k++) {
        open(&none);
        open(&open_);
        for (uint8_t i = 0U; i < SENSORS; i++) {
            const uint8_t counter = (uint8_t)(draw(&seed) % 16U); /* many are lost, and then none */
            const hg_real y = R(draw_between(&seed, -64, 64) / 64.0);
            if (draw_between(&seed, 0, 2) == 0) {
                assert_status(HG_OK, hg_fusion_receive(&none.self, i, stamp(&none), counter, y));
                assert_status(HG_OK, hg_fusion_receive(&open_.self, i, stamp(&open_), counter, y));
            }
        }
        close(&none);
        close(&open_);
        assert_same(&none, &open_);
    }
    begin(&open_, &c);
    begin(&shut, &c);
    for (uint32_t k = 0U; k < 200U; k++) {
        const hg_real y = R(draw_between(&seed, -64, 64) / 64.0);
        const uint8_t counter = (uint8_t)(draw(&seed) % 16U);
        const uint8_t before = (uint8_t)((k + 15U) & 15U);
        const bool late = (k > 0U) && (draw_between(&seed, 0, 2) == 0);
        if (late) { /* a frame of the sample before, told before or after the next is opened */
            assert_status(HG_OK, hg_fusion_receive(&shut.self, 1U, before, 0U, y));
        }
        open(&open_);
        open(&shut);
        if (late) {
            assert_status(HG_OK, hg_fusion_receive(&open_.self, 1U, before, 0U, y));
        }
        if (draw_between(&seed, 0, 2) == 0) {
            assert_status(HG_OK, hg_fusion_receive(&open_.self, 0U, stamp(&open_), counter, y));
            assert_status(HG_OK, hg_fusion_receive(&shut.self, 0U, stamp(&shut), counter, y));
        }
        close(&open_);
        close(&shut);
        assert_same(&open_, &shut);
    }
    begin(&open_, &c);
    begin(&shut, &c);
    for (uint32_t k = 0U; k < 200U; k++) { /* one frame that is late, and then never again */
        open(&open_);
        open(&shut);
        if ((k == 0U) || (k == 3U)) {
            rig *const hears = (k == 0U) ? &open_ : &shut;
            assert_status(HG_OK, hg_fusion_receive(&hears->self, 1U, 0U, 0U, R(0.5)));
        }
        if ((k > 3U) && (draw_between(&seed, 0, 2) == 0)) {
            const uint8_t counter = (uint8_t)(draw(&seed) % 16U);
            assert_status(HG_OK, hg_fusion_receive(&open_.self, 0U, stamp(&open_), counter, R(0.25)));
            assert_status(HG_OK, hg_fusion_receive(&shut.self, 0U, stamp(&shut), counter, R(0.25)));
        }
        close(&open_);
        close(&shut);
        assert_true((k < 3U) || (memcmp(open_.self.P, shut.self.P, STATES * STATES * sizeof(hg_real)) == 0));
    }
}

/* Nodes that hear every frame within `delay`, each at its own time, agree to the bit on all that is settled: state, references, rates, ages. */
static void nodes_that_hear_at_different_times_agree(void **state)
{
    (void)state;
    uint32_t seed = seed_of_run(12U);
    for (uint8_t delay = 1U; delay <= 2U; delay++) {
        static rig node[2];
        hg_fusion_config c = usual;
        c.delay = delay;
        c.watchdog = 6U; /* sensors die and come back */
        sample past[300];
        uint8_t counter[SENSORS] = {0U, 0U, 0U};
        uint8_t numbers[300][SENSORS];
        begin(&node[0], &c);
        begin(&node[1], &c);
        for (uint32_t k = 0U; k < COUNT(past); k++) {
            draw_sample(&seed, &past[k]);
            for (uint8_t i = 0U; i < SENSORS; i++) {
                past[k].sends[i] = past[k].sends[i] && (((k / 20U) % 3U) != i);
                counter[i] = (uint8_t)(counter[i] + (past[k].sends[i] ? 1U + (draw(&seed) % 2U) : 0U));
                numbers[k][i] = counter[i] & 15U;
            }
            for (size_t j = 0U; j < COUNT(node); j++) {
                open(&node[j]);
                for (uint32_t back = 0U; (back <= delay) && (back <= k); back++) {
                    for (uint8_t i = 0U; i < SENSORS; i++) {
                        if (past[k - back].sends[i] && ((back == delay) || ((draw(&seed) % 2U) == 0U))) {
                            (void)hg_fusion_receive(&node[j].self, i, (uint8_t)((k - back) & 15U), numbers[k - back][i], past[k - back].y[i]);
                        }
                    }
                }
                close(&node[j]);
            }
            const uint32_t newest = node[0].self.newest;
            const hg_fusion_slot *a = &node[0].slot[(newest + SLOTS - delay) % SLOTS];
            const hg_fusion_slot *b = &node[1].slot[(newest + SLOTS - delay) % SLOTS];
            if (k >= delay) {
                assert_memory_equal(a->x, b->x, STATES * sizeof(hg_real));
                assert_memory_equal(a->P, b->P, STATES * STATES * sizeof(hg_real));
            }
            for (uint8_t i = 0U; i < SENSORS; i++) {
                assert_real(entry_of(&node[0], i)->reference, entry_of(&node[1], i)->reference);
                assert_real(entry_of(&node[0], i)->variance, entry_of(&node[1], i)->variance);
                assert_real(node[0].sensor[i].loss, node[1].sensor[i].loss);
                assert_count(node[0].sensor[i].lost, node[1].sensor[i].lost);
                assert_real(node[0].record[i].spread, node[1].record[i].spread);
            }
            assert_true(node[0].slot[newest].table == node[1].slot[newest].table);
        }
        assert_true(node[0].sensor[0].lost > 5U);
    }
}

/* What may still be on its way is worth the table `early`, and a sample later what it always is. */
static void silence_means_less_until_its_time_is_up(void **state)
{
    (void)state;
    static rig p;
    hg_fusion_config c = usual;
    c.delay = 1U;
    begin(&p, &c);
    for (uint32_t k = 0U; k < 3U; k++) {
        open(&p);
        for (uint8_t i = 0U; (k == 0U) && (i < SENSORS); i++) {
            assert_status(HG_OK, hg_fusion_receive(&p.self, i, stamp(&p), 0U, R(0)));
        }
        close(&p);
    }
    /* The record is that of sample 1: relax 0.25; its slot holds the prediction of that sample. */
    const hg_fusion_slot *settled = &p.slot[(p.self.newest + SLOTS - 1U) % SLOTS];
    assert_near(((double)settled->P[0] + 0.0625) * 1.25, p.record[0].spread, 1e-6);
    /* Sample 2 was filtered with 2: less information than if it were settled. */
    const double prior = (double)p.slot[p.self.newest].P[0];
    const double first = prior - (prior * prior / ((prior + 0.0625) * 3.0)); /* relax 2, */
    assert_near(first - (first * first / ((first + 0.25) * 4.0)), p.self.P[0], 1e-6); /* and 3 */
    open(&p);
    close(&p);
    const hg_fusion_slot *again = &p.slot[(p.self.newest + SLOTS - 1U) % SLOTS];
    const double s = (double)again->P[0] + 0.0625;
    assert_near(s * 1.25, p.record[0].spread, 1e-6);
}

static void a_frame_tells_of_the_past(void **state)
{
    (void)state;
    static rig p;
    static rig q;
    hg_fusion_config c = usual;
    c.heartbeat = 9U;
    begin(&p, &c);
    begin(&q, &c);
    for (uint32_t k = 0U; k < 6U; k++) {
        open(&p);
        open(&q);
        if (k == 0U) {
            assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, stamp(&p), 0U, R(1)));
            assert_status(HG_OK, hg_fusion_receive(&q.self, 0U, stamp(&q), 0U, R(1)));
        }
        if (k == 3U) { /* p loses this one */
            assert_status(HG_OK, hg_fusion_receive(&q.self, 0U, stamp(&q), 2U, R(2)));
        }
        if (k == 5U) { /* sent in samples 0, 2 and 3; 2 is lost for both */
            for (size_t j = 0U; j < 2U; j++) {
                rig *r = (j == 0U) ? &p : &q;
                assert_status(HG_OK, hg_fusion_receive(&r->self, 0U, stamp(r), 3U, R(3)));
                assert_status(HG_OK, hg_fusion_recall(&r->self, 0U, stamp(r), 0x16U, R(2)));
            }
        }
        close(&p);
        close(&q);
    }
    const hg_fusion_known expected[DEPTH] = {HG_FUSION_SILENT, HG_FUSION_VALUE, HG_FUSION_LOST, HG_FUSION_SILENT};
    for (uint32_t back = 1U; back <= DEPTH; back++) {
        const hg_fusion_entry *entry = &p.slot[(p.self.newest + SLOTS - back) % SLOTS].entry[0];
        assert_int_equal((int)expected[back - 1U], (int)entry->known);
    }
    assert_real(2.0, p.slot[(p.self.newest + SLOTS - 2U) % SLOTS].entry[0].y);
    p.sensor[0].loss = q.sensor[0].loss;
    assert_same(&p, &q);
    assert_count(2U, p.sensor[0].frames); /* what was restored came in no frame of its own */
    /* Said once more, and otherwise: what is known stays what it is. */
    assert_status(HG_OK, hg_fusion_recall(&p.self, 0U, stamp(&p), 0xFFU, R(-7)));
    for (uint32_t back = 1U; back <= DEPTH; back++) {
        assert_int_equal((int)expected[back - 1U], (int)p.slot[(p.self.newest + SLOTS - back) % SLOTS].entry[0].known);
    }
    assert_real(2.0, p.slot[(p.self.newest + SLOTS - 2U) % SLOTS].entry[0].y);
    /* Without the value, the last one is known to be lost; a frame of a sample that is not held tells nothing. */
    for (uint32_t k = 0U; k < 2U; k++) {
        open(&p);
        close(&p);
    }
    assert_status(HG_E_STAMP, hg_fusion_recall(&p.self, 0U, (uint8_t)(stamp(&p) + 1U), 0U, R(0)));
    open(&p);
    assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, stamp(&p), 5U, R(3)));
    assert_status(HG_OK, hg_fusion_recall(&p.self, 0U, stamp(&p), 0x01U, REAL_NAN));
    close(&p);
    assert_int_equal(HG_FUSION_LOST, (int)p.slot[(p.self.newest + SLOTS - 1U) % SLOTS].entry[0].known);
    /* Told when the sample is closed already: in time for the next. */
    open(&p);
    assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, stamp(&p), 6U, R(3)));
    close(&p);
    assert_status(HG_OK, hg_fusion_recall(&p.self, 0U, stamp(&p), 0xFFU, R(1)));
    open(&p);
    close(&p);
    /* Restored within `delay`, and still no frame of its own. */
    c.delay = 1U;
    begin(&q, &c);
    open(&q);
    close(&q);
    open(&q);
    assert_status(HG_OK, hg_fusion_receive(&q.self, 0U, stamp(&q), 6U, R(3)));
    assert_status(HG_OK, hg_fusion_recall(&q.self, 0U, stamp(&q), 0x01U, R(2)));
    close(&q);
    assert_true(q.record[0].value);
    assert_count(0U, q.sensor[0].frames);
    /* All eight. */
    c.delay = 0U;
    c.depth = 14U;
    static hg_fusion_slot slots[15];
    static hg_fusion_entry entries[15U * SENSORS];
    static hg_real reals[HG_FUSION_REALS(STATES, INPUTS, SENSORS, 14U)];
    const hg_fusion_memory memory = {.slot = slots, .entry = entries, .sensor = p.sensor, .record = p.record, .origin = p.origin, .real = reals};
    assert_status(HG_OK, hg_fusion_start(&p.self, &c, &memory));
    for (uint32_t k = 0U; k < 12U; k++) {
        assert_status(HG_OK, hg_fusion_open(&p.self, rest));
        assert_status(HG_OK, hg_fusion_close(&p.self));
    }
    assert_status(HG_OK, hg_fusion_recall(&p.self, 0U, 11U, 0U, REAL_NAN));
    for (uint32_t back = 0U; back < 12U; back++) {
        const bool told = (back >= 1U) && (back <= 8U);
        assert_int_equal(told ? HG_FUSION_SILENT : HG_FUSION_NOTHING, (int)slots[(p.self.newest + 15U - back) % 15U].entry[0].known);
    }
}

/* A frame that is itself late tells of what was before it, and of nothing after; other sensors' frames are none of its business. */
static void a_late_frame_tells_of_the_past_before_it(void **state)
{
    (void)state;
    static rig p;
    hg_fusion_config c = usual;
    c.heartbeat = 9U;
    begin(&p, &c);
    for (uint32_t k = 0U; k < (2U * SLOTS); k++) {
        open(&p);
        assert_status(HG_OK, hg_fusion_receive(&p.self, 1U, stamp(&p), (uint8_t)k, R(0)));
        if (k < ((2U * SLOTS) - 1U)) {
            close(&p);
        }
    }
    assert_status(HG_OK, hg_fusion_recall(&p.self, 0U, (uint8_t)(stamp(&p) + 15U), 0x01U, R(2)));
    const hg_fusion_known expected[SLOTS] = {HG_FUSION_NOTHING, HG_FUSION_NOTHING, HG_FUSION_VALUE, HG_FUSION_SILENT, HG_FUSION_SILENT};
    for (uint32_t back = 0U; back < SLOTS; back++) {
        const hg_fusion_slot *slot = &p.slot[(p.self.newest + SLOTS - back) % SLOTS];
        assert_int_equal((int)expected[back], (int)slot->entry[0].known);
        assert_int_equal((int)HG_FUSION_VALUE, (int)slot->entry[1].known);
    }
}

/* ---- the origin ---- */

#define LAG 3U /* samples that a frame is late */

/* A target that runs away: with a moving origin the estimate stays small and is the same place; frames of before a step come late and belong. */
static void the_origin_moves_and_nothing_else_does(void **state)
{
    (void)state;
    static const hg_real steps[STATES] = {R(16), R(0)};
    static const hg_real wide[SENSORS] = {R(1e6), R(1e6), R(1e6)};
    for (uint32_t run = 0U; run < 4U; run++) {
        static rig still;
        static rig moving;
        hg_fusion_config c = usual;
        c.range = wide;
        c.delay = (uint8_t)(run / 2U);
        c.select = ((run % 2U) == 0U) ? places : NULL;
        c.C = rows;
        hg_fusion_config with = c;
        with.origin = steps;
        begin(&still, &c);
        begin(&moving, &with);
        double at = (run == 3U) ? -1e5 : 0.0; /* far off from the start: many steps at once */
        hg_real before[LAG][2] = {{R(0), R(0)}, {R(0), R(0)}, {R(0), R(0)}};
        for (uint32_t k = 0U; k < 200U; k++) {
            at += 10.0;
            open(&still);
            open(&moving);
            const hg_fusion_slot *settled = &moving.slot[(moving.self.newest + SLOTS - ((k < c.delay) ? k : c.delay)) % SLOTS];
            assert_true(hg_real_abs(settled->x[0]) < R(16)); /* less than a step is left */
            assert_memory_equal(moving.slot[moving.self.newest].x, moving.self.x, STATES * sizeof(hg_real));
            const hg_real y[2] = {R(at), R(at - (16.0 * moving.origin[0]))};
            hg_real *old = before[k % LAG];
            const uint8_t prompt = (uint8_t)(k % 2U); /* of two that see the same one is heard at once, in turn, */
            if (k >= LAG) { /* and the other one when the origin has moved more than once since */
                assert_status(HG_OK, hg_fusion_receive(&still.self, prompt, (uint8_t)((k - LAG) & 15U), (uint8_t)((k - LAG) & 15U), old[0]));
                assert_status(HG_OK, hg_fusion_receive(&moving.self, prompt, (uint8_t)((k - LAG) & 15U), (uint8_t)((k - LAG) & 15U), old[1]));
            }
            assert_status(HG_OK, hg_fusion_receive(&still.self, prompt, stamp(&still), (uint8_t)(k & 15U), y[0]));
            assert_status(HG_OK, hg_fusion_receive(&moving.self, prompt, stamp(&moving), (uint8_t)(k & 15U), y[1]));
            close(&still);
            close(&moving);
            old[0] = y[0];
            old[1] = y[1];
            const double place_of = (double)moving.self.x[0] + (16.0 * moving.origin[0]);
            assert_near((double)still.self.x[0], place_of, (sizeof(hg_real) == 4U) ? 0.05 : 1e-9);
            assert_true((k < 60U) || (fabs((double)moving.self.x[0]) < 64.0));
            assert_count(0, moving.origin[1]);
        }
        assert_true((moving.origin[0] > 100) || (run == 3U));
    }
}

/* The same plant with its states the other way round: the same numbers in other places. */
static void any_state_may_have_the_origin(void **state)
{
    (void)state;
    static const hg_real turned_A[STATES * STATES] = {R(1), R(0), R(0.125), R(1)};
    static const hg_real turned_B[STATES * INPUTS] = {R(1), R(-0.25), R(0), R(0.5)};
    static const hg_real turned_Q[STATES * STATES] = {R(0.015625), R(0), R(0), R(0)};
    static const hg_real turned_x0[STATES] = {R(1), R(0)};
    static const hg_real turned_P0[STATES * STATES] = {R(1), R(0), R(0), R(4)};
    static const uint8_t turned_places[SENSORS] = {1U, 1U, 0U};
    static const hg_real steps[STATES] = {R(16), R(0)};
    static const hg_real turned_steps[STATES] = {R(0), R(16)};
    static const hg_real wide[SENSORS] = {R(1e6), R(1e6), R(1e6)};
    static rig p;
    static rig q;
    hg_fusion_config c = usual;
    c.range = wide;
    c.origin = steps;
    hg_fusion_config turned = c;
    turned.A = turned_A;
    turned.B = turned_B;
    turned.Q = turned_Q;
    turned.x0 = turned_x0;
    turned.P0 = turned_P0;
    turned.select = turned_places;
    turned.origin = turned_steps;
    begin(&p, &c);
    begin(&q, &turned);
    for (uint32_t k = 0U; k < 100U; k++) {
        open(&p);
        open(&q);
        assert_count(p.origin[0], q.origin[1]);
        const double origin = 16.0 * p.origin[0];
        const uint8_t late = (uint8_t)((k - 2U) & 15U);
        assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, stamp(&p), (uint8_t)(k & 15U), R((9.0 * k) - origin)));
        assert_status(HG_OK, hg_fusion_receive(&q.self, 0U, stamp(&q), (uint8_t)(k & 15U), R((9.0 * k) - origin)));
        if (k >= 2U) { /* of a sample with another origin */
            const hg_real local = hg_fusion_local(&p.self, 1U, late, R(9.0 * (k - 2.0)));
            assert_real(local, hg_fusion_local(&q.self, 1U, late, R(9.0 * (k - 2.0))));
            assert_status(HG_OK, hg_fusion_receive(&p.self, 1U, late, (uint8_t)((k - 2U) & 15U), local));
            assert_status(HG_OK, hg_fusion_receive(&q.self, 1U, late, (uint8_t)((k - 2U) & 15U), local));
        }
        close(&p);
        close(&q);
        assert_near(p.self.x[0], q.self.x[1], 1e-4);
        assert_near(p.self.x[1], q.self.x[0], 1e-4);
        assert_near((9.0 * k) - origin, p.self.x[0], 8.0);
    }
    assert_true(p.origin[0] > 40);
}

static void an_absolute_value_is_taken_from_the_origin_of_its_sample(void **state)
{
    (void)state;
    static const hg_real both[STATES] = {R(16), R(0)};
    static const hg_real wide[SENSORS] = {R(1e6), R(1e6), R(1e6)};
    for (uint32_t run = 0U; run < 2U; run++) {
        static rig p;
        hg_fusion_config c = usual;
        double origin_of[60];
        c.range = wide;
        c.origin = (run == 0U) ? both : NULL;
        begin(&p, &c);
        for (uint32_t k = 0U; k < COUNT(origin_of); k++) {
            open(&p);
            origin_of[k] = 16.0 * p.origin[0];
            for (uint32_t lag = 0U; lag < 15U; lag++) {
                const bool held = (lag <= k) && (lag <= DEPTH);
                const double origin = held ? origin_of[k - lag] : origin_of[k]; /* of what is not held any more the present one */
                assert_near(1000.0 - origin, hg_fusion_local(&p.self, 0U, (uint8_t)((k - lag) & 15U), R(1000)), 1e-3);
                assert_near(1000.0, hg_fusion_local(&p.self, 2U, (uint8_t)((k - lag) & 15U), R(1000)), 1e-3); /* sees no state that has an origin */
            }
            assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, stamp(&p), (uint8_t)(k & 15U), R((20.0 * k) - origin_of[k])));
            close(&p);
        }
        assert_true((run == 1U) || (p.origin[0] > 60));
    }
}

static void the_origin_takes_no_more_than_32767_steps_at_once(void **state)
{
    (void)state;
    static const hg_real tiny[1] = {R(0.0009765625)};
    static const hg_real here[1] = {R(-100)};
    static rig p;
    hg_fusion_config c = small;
    c.origin = tiny;
    c.x0 = here;
    begin(&p, &c);
    open(&p);
    assert_count(-32767, p.origin[0]);
    assert_near(-100.0 + (32767.0 / 1024.0), p.self.x[0], 1e-6);
    close(&p);
    hg_fusion_reset(&p.self);
    assert_count(0, p.origin[0]);
}

/* Whatever the origin is: the same code, the same place. Also of a sample before the origin moved. */
static void a_code_that_wraps_is_unwrapped_by_the_prediction(void **state)
{
    (void)state;
    static const hg_real steps[STATES] = {R(16), R(0)};
    static const hg_real wide[SENSORS] = {R(1e6), R(1e6), R(1e6)};
    for (int direction = -1; direction <= 1; direction += 2) {
        static rig p;
        hg_fusion_config c = usual;
        c.range = wide;
        c.origin = steps;
        begin(&p, &c);
        assert_real(3.0, hg_fusion_unwrap(&p.self, 0U, 0U, R(3), R(8))); /* nothing is held */
        hg_real last = R(0);
        for (int k = 0; k < 100; k++) {
            const double at = direction * 0.75 * k;
            const double code = at - (8.0 * floor((at + 4.0) / 8.0));
            open(&p);
            if (k > 0) {
                const double before = direction * 0.75 * (k - 1);
                const uint8_t old = (uint8_t)((k - 1) & 15);
                const hg_fusion_slot *slot = &p.slot[(p.self.newest + SLOTS - 1U) % SLOTS];
                const double origin = (16.0 * p.origin[0]) - (double)slot->shift[0];
                const hg_real y = hg_fusion_unwrap(&p.self, 0U, old, R(before - (8.0 * floor((before + 4.0) / 8.0))), R(8));
                assert_near(before, (double)y + origin, 1e-4);
                assert_real((double)last, y); /* as it was when that sample was open */
            }
            last = hg_fusion_unwrap(&p.self, 0U, stamp(&p), R(code), R(8));
            assert_real(last, hg_fusion_unwrap(&p.self, 1U, stamp(&p), R(code), R(8))); /* of the same state */
            assert_near(at, (double)last + (16.0 * p.origin[0]), 1e-4);
            assert_status(HG_OK, hg_fusion_receive(&p.self, 0U, stamp(&p), (uint8_t)(k & 15), last));
            close(&p);
        }
        assert_true(abs((int)p.origin[0]) >= 3);
        assert_real(1.0, hg_fusion_unwrap(&p.self, 0U, (uint8_t)(stamp(&p) + 1U), R(1), R(8)));
    }
}

static void of_all_that_a_code_can_stand_for_it_is_the_nearest(void **state)
{
    (void)state;
    static const double periods[] = {0.5, 1.0, 8.0};
    static rig p;
    begin(&p, &usual);
    open(&p);
    assert_real(3.0, hg_fusion_unwrap(&p.self, 0U, (uint8_t)(stamp(&p) + 15U), R(3), R(8))); /* the one sample that is held is the present one */
    const double reference = (double)entry_of(&p, 0U)->reference;
    for (size_t i = 0U; i < COUNT(periods); i++) {
        for (int code = -40; code <= 40; code++) {
            const double y = reference + (0.11 * code);
            const double found = (double)hg_fusion_unwrap(&p.self, 0U, stamp(&p), R(y), R(periods[i]));
            const double steps = (found - y) / periods[i];
            assert_true(fabs(found - reference) <= (0.5 * periods[i]) + 1e-5);
            assert_near(floor(steps + 0.5), steps, 1e-5);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(start_tells_null),
        cmocka_unit_test(validity_looks_at_every_number_and_table),
        cmocka_unit_test(the_limits_of_every_number_are_valid),
        cmocka_unit_test(a_value_is_the_kalman_filters_update),
        cmocka_unit_test(silence_narrows_and_pulls_to_the_reference),
        cmocka_unit_test(silence_lies_about_the_reference),
        cmocka_unit_test(each_trigger_by_its_inequality),
        cmocka_unit_test(at_its_level_a_trigger_is_silent),
        cmocka_unit_test(a_schedule_counts_on_the_sensors_before),
        cmocka_unit_test(hubers_weight_bounds_the_pull_of_a_value),
        cmocka_unit_test(a_state_that_is_none_begins_again),
        cmocka_unit_test(no_variance_may_be_negative_and_each_may_be_0),
        cmocka_unit_test(open_and_close_take_turns),
        cmocka_unit_test(each_frame_has_its_status_and_counter),
        cmocka_unit_test(lost_frames_are_counted_and_make_a_rate),
        cmocka_unit_test(the_loss_rate_chooses_what_silence_is_worth),
        cmocka_unit_test(a_sensor_that_had_to_speak_and_did_not_was_lost),
        cmocka_unit_test(a_dead_sensor_is_missed_and_comes_back),
        cmocka_unit_test(silence_of_a_sensor_that_its_table_leaves_out_says_nothing),
        cmocka_unit_test(a_sensor_taken_out_is_heard_but_not_fused),
        cmocka_unit_test(late_frames_are_filtered_in),
        cmocka_unit_test(only_what_a_late_frame_changes_is_filtered_again),
        cmocka_unit_test(nodes_that_hear_at_different_times_agree),
        cmocka_unit_test(silence_means_less_until_its_time_is_up),
        cmocka_unit_test(a_frame_tells_of_the_past),
        cmocka_unit_test(a_late_frame_tells_of_the_past_before_it),
        cmocka_unit_test(the_origin_moves_and_nothing_else_does),
        cmocka_unit_test(any_state_may_have_the_origin),
        cmocka_unit_test(an_absolute_value_is_taken_from_the_origin_of_its_sample),
        cmocka_unit_test(the_origin_takes_no_more_than_32767_steps_at_once),
        cmocka_unit_test(a_code_that_wraps_is_unwrapped_by_the_prediction),
        cmocka_unit_test(of_all_that_a_code_can_stand_for_it_is_the_nearest),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
