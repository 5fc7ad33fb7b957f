/** @file
 *  predict.h: what the plant's model says between frames, by hand and against the same equations in double precision. */
#include "support.h"

#include "hullguard/predict.h"

#define SIGNALS 4U /* the input, the group's two signals, one more input */
#define FIRST 1U
#define ORDER 2U
#define WIDTH 2U
#define INPUTS 2U
#define HORIZON 3U
#define SETTLE 3U
#define REALS (HG_PREDICT_REALS(ORDER, INPUTS, WIDTH))

static const uint8_t input_list[INPUTS] = {3U, 0U};
static const hg_real known_table[INPUTS] = {R(0.5), R(0.25)};
static const hg_real correct_table[ORDER * WIDTH] = {R(1), R(0), R(0), R(0.5)};
static const hg_real state_table[ORDER * ORDER] = {R(0.5), R(1), R(0), R(0.5)};
static const hg_real drive_table[ORDER * INPUTS] = {R(1), R(0), R(0), R(-2)};
static const hg_real output_table[WIDTH * ORDER] = {R(1), R(0), R(1), R(1)};
static const hg_real direct_table[WIDTH * INPUTS] = {R(0), R(0.25), R(0), R(0)};
static const hg_real fresh_table[WIDTH] = {R(0.125), R(0.25)};
static const hg_real radius_table[HORIZON * WIDTH] = {R(1), R(2), R(3), R(4), R(5), R(6)};
static const hg_predict_config usual = {.group = 7U, .first = FIRST, .order = ORDER, .width = WIDTH, .inputs = INPUTS, .input = input_list,
                                        .known = known_table, .correct = {ORDER, WIDTH, 0, correct_table},
                                        .state = {ORDER, ORDER, 0, state_table}, .drive = {ORDER, INPUTS, 0, drive_table},
                                        .output = {WIDTH, ORDER, 0, output_table}, .direct = {WIDTH, INPUTS, 0, direct_table},
                                        .fresh = fresh_table, .horizon = HORIZON, .radius = radius_table, .settle = SETTLE};

typedef struct {
    hg_predict self;
    hg_real    memory[REALS + 1U];
    hg_real    value[SIGNALS];  /* as the holds know them */
    hg_real    radius[SIGNALS];
    hg_real    out[WIDTH + 1U];
    hg_real    wide[WIDTH + 1U];
} rig;

static void begin(rig *p, const hg_predict_config *config)
{
    (void)memset(p, 0x5A, sizeof(*p));
    arm(p->memory, COUNT(p->memory));
    assert_true(hg_predict_valid(config, SIGNALS));
    assert_status(HG_OK, hg_predict_start(&p->self, config, p->memory));
    for (size_t g = 0U; g < SIGNALS; g++) {
        p->value[g] = R(0);
        p->radius[g] = R(0);
    }
    p->radius[1] = R(0.125);
    p->radius[2] = R(0.25);
}

static void step(rig *p, uint8_t age)
{
    arm(p->out, COUNT(p->out));
    arm(p->wide, COUNT(p->wide));
    hg_predict_step(&p->self, age, p->value, p->radius, p->out, p->wide);
    assert_untouched(&p->out[WIDTH], 1U);
    assert_untouched(&p->wide[WIDTH], 1U);
    assert_untouched(&p->memory[REALS], 1U);
    assert_true(hg_linalg_finite(p->self.x, ORDER));
}

static bool held(const rig *p)
{
    bool same = true;
    for (size_t g = 0U; g < WIDTH; g++) {
        same = same && (memcmp(&p->out[g], &p->value[FIRST + g], sizeof(hg_real)) == 0);
        same = same && (memcmp(&p->wide[g], &p->radius[FIRST + g], sizeof(hg_real)) == 0);
    }
    return same;
}

/* After a frame the held radii are wider than any prediction. */
static void frame(rig *p, double a, double b)
{
    p->value[1] = R(a);
    p->value[2] = R(b);
    p->radius[1] = fresh_table[0];
    p->radius[2] = fresh_table[1];
    step(p, 0U);
    assert_true(held(p)); /* in the sample of a frame nothing is better */
    p->radius[1] = R(100);
    p->radius[2] = R(100);
}

/* Frames until there is a prediction. */
static void settle(rig *p)
{
    for (uint32_t k = 0U; k <= SETTLE; k++) {
        frame(p, 0.0, 0.0);
    }
}

/* No size may be 0, though the tables agree about it; 1 is one. */
static void nothing_is_no_size(void **state)
{
    (void)state;
    hg_predict_config c = usual;
    c.order = c.correct.rows = c.state.rows = c.state.cols = c.drive.rows = c.output.cols = 0U;
    assert_false(hg_predict_valid(&c, SIGNALS));
    c = usual;
    c.width = c.correct.cols = c.output.rows = c.direct.rows = 0U;
    assert_false(hg_predict_valid(&c, SIGNALS));
    c = usual;
    c.inputs = c.drive.cols = c.direct.cols = 0U;
    assert_false(hg_predict_valid(&c, SIGNALS));
    c = usual;
    c.order = c.correct.rows = c.state.rows = c.state.cols = c.drive.rows = c.output.cols = 1U;
    c.width = c.correct.cols = c.output.rows = c.direct.rows = 1U;
    c.inputs = c.drive.cols = c.direct.cols = 1U;
    assert_true(hg_predict_valid(&c, SIGNALS));
    c.first = SIGNALS - 1U;
    assert_true(hg_predict_valid(&c, SIGNALS));
    c.first = SIGNALS;
    assert_false(hg_predict_valid(&c, SIGNALS));
}

/* Five states that move on by one place: none is overwritten before it has been read. */
static void a_state_of_many_moves_as_one(void **state)
{
    (void)state;
    static const hg_real turn[5U * 5U] = {R(0), R(1), R(0), R(0), R(0), R(0), R(0), R(1), R(0), R(0), R(0), R(0), R(0), R(1), R(0),
                                          R(0), R(0), R(0), R(0), R(1), R(1), R(0), R(0), R(0), R(1)};
    static const hg_real none[5] = {R(0)};
    static const hg_real gain[5] = {R(1), R(2), R(4), R(8), R(16)};
    static const hg_real first[5] = {R(1)};
    static const hg_real wide[1] = {R(1)};
    static const uint8_t input = 3U;
    const hg_predict_config c = {.first = FIRST, .order = 5U, .width = 1U, .inputs = 1U, .input = &input, .known = known_table, .correct = {5U, 1U, 0, gain},
        .state = {5U, 5U, 0, turn}, .drive = {5U, 1U, 0, none}, .output = {1U, 5U, 0, first}, .direct = {1U, 1U, 0, none}, .fresh = fresh_table, .horizon = 1U,
        .radius = wide, .settle = SETTLE};
    hg_predict self;
    hg_real memory[HG_PREDICT_REALS(5, 1, 1)];
    const hg_real radius[SIGNALS] = {R(0)};
    double x[5] = {0.0, 0.0, 0.0, 0.0, 0.0};
    assert_true(hg_predict_valid(&c, SIGNALS));
    assert_status(HG_OK, hg_predict_start(&self, &c, memory));
    for (int k = 0; k < 12; k++) {
        const hg_real value[SIGNALS] = {R(0), R((k * k) % 7), R(0), R(0)};
        hg_real out[1];
        hg_real out_radius[1];
        hg_predict_step(&self, 0U, value, radius, out, out_radius);
        const double wrong = (double)value[1] - x[0];
        double next[5];
        for (size_t i = 0U; i < 5U; i++) {
            next[i] = x[(i + 1U) % 5U] + ((double)gain[(i + 1U) % 5U] * wrong);
        }
        next[4] += x[4] + ((double)gain[4] * wrong); /* the last stays as well */
        (void)memcpy(x, next, sizeof(x));
        for (size_t i = 0U; i < 5U; i++) {
            assert_real(x[i], self.x[i]);
        }
    }
}

static void start_tells_null(void **state)
{
    (void)state;
    hg_predict self;
    hg_real memory[REALS];
    arm(memory, REALS);
    assert_status(HG_E_ARGUMENT, hg_predict_start(NULL, &usual, memory));
    assert_status(HG_E_ARGUMENT, hg_predict_start(&self, NULL, memory));
    assert_status(HG_E_ARGUMENT, hg_predict_start(&self, &usual, NULL));
    assert_untouched(memory, REALS);
    assert_status(HG_OK, hg_predict_start(&self, &usual, memory));
    assert_real(0.0, self.x[0]);
    assert_real(0.0, self.x[1]);
}

static void validity_looks_at_every_number_and_table(void **state)
{
    (void)state;
    assert_true(hg_predict_valid(&usual, SIGNALS));
    hg_predict_config c[21];
    for (size_t i = 0U; i < COUNT(c); i++) {
        c[i] = usual;
    }
    c[0].order = 0U;
    c[1].width = 0U;
    c[2].inputs = 0U;
    c[3].horizon = 0U;
    c[4].horizon = 255U;
    c[5].input = NULL;
    c[6].known = NULL;
    c[7].fresh = NULL;
    c[8].radius = NULL;
    c[9].correct.rows = 1U;
    c[10].correct.cols = 1U;
    c[11].correct.data = NULL;
    c[12].state.rows = 1U;
    c[13].drive.cols = 1U;
    c[14].output.cols = 1U;
    c[15].direct.data = NULL;
    c[16].first = (uint8_t)(SIGNALS - WIDTH + 1U);
    c[17].first = 254U; /* the sum does not wrap */
    c[18].state.exponent = 1;
    c[19].output.rows = 1U;
    c[20].direct.exponent = 1;
    for (size_t i = 0U; i < COUNT(c); i++) {
        assert_false(hg_predict_valid(&c[i], SIGNALS));
    }
    c[3].horizon = 1U;
    c[4].horizon = 254U;
    c[16].first = (uint8_t)(SIGNALS - WIDTH);
    assert_true(hg_predict_valid(&c[3], SIGNALS));
    assert_true(hg_predict_valid(&c[4], SIGNALS));
    assert_true(hg_predict_valid(&c[16], SIGNALS));
    for (size_t i = 0U; i < INPUTS; i++) {
        uint8_t places[INPUTS] = {0U, 0U};
        hg_predict_config d = usual;
        d.input = places;
        assert_true(hg_predict_valid(&d, SIGNALS));
        places[i] = SIGNALS;
        assert_false(hg_predict_valid(&d, SIGNALS));
    }
}

static void samples_compute_by_hand(void **state)
{
    (void)state;
    rig p;
    begin(&p, &usual);
    settle(&p);
    assert_real(0.0, p.self.x[0]);
    p.value[0] = R(1); /* second input */
    p.value[3] = R(4); /* first input */
    frame(&p, 8.0, 2.0);
    /* predicted (1/4, 0); x = (7.75, 1), then x = (0.5 * 7.75 + 1 + 4, 0.5 - 2) */
    assert_real(8.875, p.self.x[0]);
    assert_real(-1.5, p.self.x[1]);
    p.value[0] = R(2);
    p.value[3] = R(0);
    step(&p, 1U);
    assert_real(9.375, p.out[0]);
    assert_real(7.375, p.out[1]);
    assert_real(1.0, p.wide[0]);
    assert_real(2.0, p.wide[1]);
    p.value[0] = R(0);
    step(&p, 2U); /* x = (0.5 * 8.875 - 1.5, -0.75 - 4) */
    assert_real(2.9375, p.out[0]);
    assert_real(-1.8125, p.out[1]);
    assert_real(3.0, p.wide[0]);
    assert_real(4.0, p.wide[1]);
}

static void nothing_is_predicted_before_it_has_settled(void **state)
{
    (void)state;
    rig p;
    begin(&p, &usual);
    for (int k = 0; k < 20; k++) {
        step(&p, 255U); /* no frame ever */
        assert_true(held(&p));
        assert_int_equal(0, p.self.k);
    }
    for (uint32_t frames = 1U; frames <= (SETTLE + 2U); frames++) {
        hg_predict_reset(&p.self);
        for (uint32_t k = 0U; k < frames; k++) {
            frame(&p, 1.0, 1.0);
        }
        step(&p, 1U);
        assert_int_equal(frames <= SETTLE, held(&p));
    }
}

static void only_a_frame_after_settling_begins_a_prediction(void **state)
{
    (void)state;
    rig p;
    begin(&p, &usual);
    frame(&p, 0.0, 0.0);
    for (uint8_t age = 1U; age <= HORIZON; age++) { /* settled by the last of these, in samples */
        step(&p, age);
        assert_true(held(&p));
    }
    assert_int_equal(SETTLE + 1U, p.self.k);
    frame(&p, 0.0, 0.0);
    step(&p, 1U);
    assert_false(held(&p));
}

static void a_prediction_ends_with_its_horizon(void **state)
{
    (void)state;
    rig p;
    begin(&p, &usual);
    settle(&p);
    for (uint8_t age = 1U; age <= HORIZON; age++) {
        step(&p, age);
        assert_false(held(&p));
        assert_real(radius_table[((age - 1U) * WIDTH) + 1U], p.wide[1]);
    }
    step(&p, HORIZON + 1U);
    assert_true(held(&p));
    frame(&p, 0.0, 0.0);
    step(&p, 1U);
    assert_true(held(&p)); /* settling anew */
}

static void the_tighter_one_is_taken_signal_by_signal(void **state)
{
    (void)state;
    rig p;
    begin(&p, &usual);
    settle(&p);
    p.value[1] = R(7);
    p.value[2] = R(8);
    p.radius[1] = R(1); /* as tight as the prediction: held */
    p.radius[2] = R(2.5);
    step(&p, 1U);
    assert_real(7.0, p.out[0]);
    assert_real(1.0, p.wide[0]);
    assert_real(0.0, p.out[1]);
    assert_real(2.0, p.wide[1]);
    p.radius[1] = R(3.5);
    p.radius[2] = R(0.5);
    step(&p, 2U);
    assert_real(0.0, p.out[0]);
    assert_real(3.0, p.wide[0]);
    assert_real(8.0, p.out[1]);
    assert_real(0.5, p.wide[1]);
}

static void an_input_that_is_not_known_ends_the_prediction(void **state)
{
    (void)state;
    const uint8_t place[INPUTS] = {3U, 0U};
    for (size_t i = 0U; i < INPUTS; i++) {
        for (uint8_t age = 0U; age <= HORIZON; age++) {
            rig p;
            begin(&p, &usual);
            settle(&p);
            for (uint8_t j = 1U; j < age; j++) {
                p.radius[place[i]] = known_table[i]; /* just known */
                step(&p, j);
                assert_false(held(&p));
            }
            p.radius[place[i]] = known_table[i] * R(1.001);
            if (age == 0U) {
                frame(&p, 5.0, 5.0); /* a frame does not help: x moves on with an unknown input */
            } else {
                step(&p, age);
                assert_true(held(&p));
            }
            assert_int_equal(0, p.self.k);
            p.radius[place[i]] = R(0);
            step(&p, 1U);
            assert_true(held(&p));
            for (uint32_t k = 0U; k < SETTLE; k++) {
                frame(&p, 0.0, 0.0);
            }
            step(&p, 1U);
            assert_false(held(&p));
        }
    }
}

static void a_frame_without_a_value_ends_the_prediction(void **state)
{
    (void)state;
    for (size_t g = 0U; g < WIDTH; g++) {
        rig p;
        begin(&p, &usual);
        settle(&p);
        p.radius[1] = fresh_table[0];
        p.radius[2] = fresh_table[1];
        step(&p, 0U); /* at the radius of a frame */
        p.radius[1 + g] = fresh_table[g] * R(1.001);
        assert_int_equal(SETTLE + 2U, p.self.k);
        step(&p, 0U);
        assert_true(held(&p));
        assert_int_equal(0, p.self.k);
        p.radius[1 + g] = R(100);
        step(&p, 1U);
        assert_true(held(&p));
    }
}

static void numbers_that_are_not_finite_never_enter_the_state(void **state)
{
    (void)state;
    const hg_real bad[] = {REAL_NAN, REAL_INF, -REAL_INF, HG_REAL_MAX, -HG_REAL_MAX};
    const uint8_t place[] = {0U, 1U, 2U, 3U};
    for (size_t i = 0U; i < COUNT(bad); i++) {
        for (size_t g = 0U; g < COUNT(place); g++) {
            for (uint8_t age = 0U; age < 2U; age++) {
                rig p;
                begin(&p, &usual);
                settle(&p);
                p.radius[1] = fresh_table[0];
                p.radius[2] = fresh_table[1];
                p.value[place[g]] = bad[i];
                for (int k = 0; k < 4; k++) {
                    step(&p, age);
                }
                p.value[place[g]] = R(0);
                for (int k = 0; k < 2000; k++) { /* what was only large must fade */
                    frame(&p, 0.0, 0.0);
                }
                step(&p, 1U);
                assert_real(0.0, p.out[0]);
                assert_real(1.0, p.wide[0]);
            }
        }
    }
}

static void a_prediction_that_overflows_is_not_used(void **state)
{
    (void)state;
    rig p;
    begin(&p, &usual);
    settle(&p);
    p.self.x[0] = HG_REAL_MAX;
    p.self.x[1] = HG_REAL_MAX; /* the second output is their sum */
    step(&p, 1U);
    assert_true(held(&p));
    assert_int_equal(0, p.self.k); /* and so is the next state */
    assert_real(0.0, p.self.x[0]);
}

static void radii_that_are_no_numbers_end_the_prediction(void **state)
{
    (void)state;
    for (size_t g = 0U; g < SIGNALS; g++) {
        rig p;
        begin(&p, &usual);
        settle(&p);
        p.radius[1] = fresh_table[0];
        p.radius[2] = fresh_table[1];
        p.radius[g] = REAL_NAN;
        step(&p, 0U);
        assert_true(held(&p));
        assert_int_equal(0, p.self.k);
    }
}

static void the_count_saturates(void **state)
{
    (void)state;
    hg_predict_config c = usual;
    c.settle = UINT16_MAX;
    rig p;
    begin(&p, &c);
    for (uint32_t k = 0U; k < (uint32_t)UINT16_MAX; k++) {
        assert_int_equal(k, p.self.k);
        frame(&p, 0.0, 0.0);
    }
    step(&p, 1U);
    assert_true(held(&p));
    for (int i = 0; i < 3; i++) {
        frame(&p, 0.0, 0.0);
        step(&p, 1U);
        assert_false(held(&p));
        assert_int_equal(UINT16_MAX, p.self.k);
    }
}

static void reset_forgets_all(void **state)
{
    (void)state;
    rig p;
    begin(&p, &usual);
    for (uint32_t k = 0U; k < 7U; k++) { /* an odd number: the two state vectors have changed places */
        frame(&p, 5.0, 5.0);
    }
    hg_predict_reset(&p.self);
    assert_int_equal(0, p.self.k);
    assert_real(0.0, p.self.x[0]);
    assert_real(0.0, p.self.x[1]);
    step(&p, 1U);
    assert_true(held(&p));
}

/* The header's equations in double precision, with random frames, unknown inputs and missing values. */
typedef struct {
    double   x[ORDER];
    double   u[INPUTS];
    double   y[WIDTH];
    uint32_t k;
    bool     sure;
} reference;

static void reference_outputs(reference *e, const rig *p)
{
    for (size_t i = 0U; i < INPUTS; i++) {
        e->u[i] = (double)p->value[input_list[i]];
    }
    for (size_t g = 0U; g < WIDTH; g++) {
        e->y[g] = 0.0;
        for (size_t i = 0U; i < ORDER; i++) {
            e->y[g] += (double)output_table[(g * ORDER) + i] * e->x[i];
        }
        for (size_t i = 0U; i < INPUTS; i++) {
            e->y[g] += (double)direct_table[(g * INPUTS) + i] * e->u[i];
        }
    }
}

static void reference_moves(reference *e, const rig *p, bool frame_here)
{
    double next[ORDER];
    for (size_t i = 0U; frame_here && (i < ORDER); i++) {
        for (size_t g = 0U; g < WIDTH; g++) {
            e->x[i] += (double)correct_table[(i * WIDTH) + g] * ((double)p->value[FIRST + g] - e->y[g]);
        }
    }
    e->sure = frame_here ? (e->k >= SETTLE) : e->sure;
    for (size_t i = 0U; i < ORDER; i++) {
        next[i] = 0.0;
        for (size_t j = 0U; j < ORDER; j++) {
            next[i] += (double)state_table[(i * ORDER) + j] * e->x[j];
        }
        for (size_t j = 0U; j < INPUTS; j++) {
            next[i] += (double)drive_table[(i * INPUTS) + j] * e->u[j];
        }
    }
    (void)memcpy(e->x, next, sizeof(next));
    e->k++;
}

static void predictions_follow_the_definition(void **state)
{
    (void)state;
    uint32_t random = seed_of_run(91U);
    rig p;
    reference e = {.k = 0U};
    begin(&p, &usual);
    uint8_t age = 255U;
    unsigned predicted = 0U;
    for (int k = 0; k < 20000; k++) {
        age = ((draw(&random) % 3U) == 0U) ? 0U : ((age < 255U) ? (uint8_t)(age + 1U) : 255U);
        const bool unknown = (draw(&random) % 40U) == 0U;
        const bool invalid = (age == 0U) && ((draw(&random) % 20U) == 0U);
        p.value[0] = R((double)draw_between(&random, -8, 8) / 4.0);
        p.value[3] = R((double)draw_between(&random, -8, 8) / 4.0);
        p.radius[0] = (unknown && ((draw(&random) % 2U) == 0U)) ? R(0.26) : R(0.25);
        p.radius[3] = (unknown && (p.radius[0] <= known_table[1])) ? R(0.6) : R(0.125);
        if (age == 0U) {
            p.value[1] = R((double)draw_between(&random, -8, 8) / 4.0);
            p.value[2] = R((double)draw_between(&random, -8, 8) / 4.0);
        }
        p.radius[1] = (age == 0U) ? (invalid ? R(100) : fresh_table[0]) : R((double)draw_between(&random, 0, 14) / 2.0);
        p.radius[2] = (age == 0U) ? fresh_table[1] : R((double)draw_between(&random, 0, 14) / 2.0);
        step(&p, age);
        reference_outputs(&e, &p);
        const bool following = (age <= HORIZON) && (!unknown) && (!invalid);
        for (size_t g = 0U; g < WIDTH; g++) {
            const bool usable = following && (age >= 1U) && e.sure;
            const hg_real own = usable ? radius_table[((age - 1U) * WIDTH) + g] : HG_REAL_MAX;
            if (own < p.radius[FIRST + g]) {
                assert_near(e.y[g], p.out[g], 1e-4);
                assert_real(own, p.wide[g]);
                predicted++;
            } else {
                assert_real(p.value[FIRST + g], p.out[g]);
                assert_real(p.radius[FIRST + g], p.wide[g]);
            }
        }
        if (following) {
            reference_moves(&e, &p, age == 0U);
        } else {
            (void)memset(&e, 0, sizeof(e));
        }
    }
    assert_true(predicted > 1000U);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_is_no_size),
        cmocka_unit_test(a_state_of_many_moves_as_one),
        cmocka_unit_test(start_tells_null),
        cmocka_unit_test(validity_looks_at_every_number_and_table),
        cmocka_unit_test(samples_compute_by_hand),
        cmocka_unit_test(nothing_is_predicted_before_it_has_settled),
        cmocka_unit_test(only_a_frame_after_settling_begins_a_prediction),
        cmocka_unit_test(a_prediction_ends_with_its_horizon),
        cmocka_unit_test(the_tighter_one_is_taken_signal_by_signal),
        cmocka_unit_test(an_input_that_is_not_known_ends_the_prediction),
        cmocka_unit_test(a_frame_without_a_value_ends_the_prediction),
        cmocka_unit_test(numbers_that_are_not_finite_never_enter_the_state),
        cmocka_unit_test(a_prediction_that_overflows_is_not_used),
        cmocka_unit_test(radii_that_are_no_numbers_end_the_prediction),
        cmocka_unit_test(the_count_saturates),
        cmocka_unit_test(reset_forgets_all),
        cmocka_unit_test(predictions_follow_the_definition),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
