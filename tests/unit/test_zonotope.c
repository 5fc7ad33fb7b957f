/** @file
 *  zonotope.h: thresholds of a set of columns and a spread, against a sum over the whole past in double precision. */
#include "support.h"

#include "hullguard/zonotope.h"

#define SIGNALS 4U
#define S 3U
#define IN 2U
#define ND 2U
#define N0 2U
#define OUT 2U
#define Q_MOST 44U
#define REALS HG_ZONOTOPE_REALS(S, Q_MOST, IN + ND)

/* A pair of poles and a single one. Small dyadic numbers: short runs are exact in float32 too. */
static const uint8_t signal_list[IN] = {3U, 1U};
static const uint8_t block_list[2] = {2U, 1U};
static const hg_real lam[5] = {R(0.5), R(-0.25), R(0.25), R(0.5), R(-0.75)};
static const hg_real input[IN * S] = {R(1), R(-2), R(0.5), R(0.25), R(1), R(-1)};
static const hg_real disturbance[ND * S] = {R(0.125), R(0), R(-0.25), R(0), R(0.5), R(0.125)};
static const hg_real rest[N0 * S] = {R(1), R(0), R(1), R(0), R(-1), R(0.5)};
static const hg_real moving[N0 * S] = {R(8), R(0), R(8), R(0), R(-8), R(4)};
static const hg_real output[OUT * S] = {R(1), R(0.5), R(-1), R(0), R(2), R(1)};
static const hg_real outer[OUT * S] = {R(1.25), R(0), R(1), R(2), R(0), R(1)};
static const hg_real direct[OUT * IN] = {R(0.5), R(0), R(0.25), R(1)};
static const hg_real bias_rest[2 * OUT] = {R(1), R(2), R(0.5), R(0.25)};
static const hg_real bias_moving[2 * OUT] = {R(16), R(32), R(0.5), R(0.25)};
static const hg_real decay[2] = {R(0.5625), R(0)};
static const hg_real none[8] = {R(0)};

static hg_zonotope_config usual(void)
{
    const hg_zonotope_config config = {.order = S,
                                       .residuals = OUT,
                                       .width = IN,
                                       .disturbances = ND,
                                       .initial = N0,
                                       .columns = Q_MOST,
                                       .blocks = 2U,
                                       .reduction = HG_REDUCTION_BOX,
                                       .signal = signal_list,
                                       .block = block_list,
                                       .state = lam,
                                       .input = input,
                                       .disturbance = disturbance,
                                       .rest = rest,
                                       .moving = moving,
                                       .output = output,
                                       .outer = outer,
                                       .direct = direct,
                                       .settle = 2U,
                                       .bias_rest = bias_rest,
                                       .bias_moving = bias_moving,
                                       .decay = decay,
                                       .always = none,
                                       .growth = none,
                                       .output_growth = none,
                                       .recover = 5U,
                                       .ready_rest = 2U,
                                       .ready_moving = 4U};
    return config;
}

typedef struct {
    hg_zonotope self;
    hg_ring    ring;
    hg_real     past[SIGNALS * 2U];
    hg_real     memory[REALS + 1U];
    hg_real     J[OUT];
} rig;

static void start_rig(rig *r, const hg_zonotope_config *config, hg_start how)
{
    arm(r->memory, COUNT(r->memory));
    assert_status(HG_OK, hg_ring_start(&r->ring, SIGNALS, 2U, r->past));
    assert_status(HG_OK, hg_zonotope_start(&r->self, config, &r->ring, how, r->memory));
}

/* Radii of signals 3 and 1, which are the generator's first and second; the others are not its business. */
static void push(rig *r, double first, double second)
{
    const hg_real radius[SIGNALS] = {R(1e6), R(second), R(1e6), R(first)};
    assert_status(HG_OK, hg_ring_push(&r->ring, radius));
}

static void step(rig *r, double first, double second)
{
    push(r, first, second);
    hg_zonotope_step(&r->self, &r->ring, r->J);
}

/* Lam^j c in double. */
static void move(double *c, unsigned j)
{
    for (unsigned i = 0U; i < j; i++) {
        const double a = c[0];
        c[0] = ((double)lam[0] * a) + ((double)lam[1] * c[1]);
        c[1] = ((double)lam[2] * a) + ((double)lam[3] * c[1]);
        c[2] *= (double)lam[4];
    }
}

static double seen(unsigned i, const hg_real *column, double factor, unsigned j)
{
    double c[S] = {(double)column[0], (double)column[1], (double)column[2]};
    move(c, j);
    double sum = 0.0;
    for (unsigned m = 0U; m < S; m++) {
        sum += (double)output[(i * S) + m] * c[m];
    }
    return factor * fabs(sum);
}

/* The exact sum of section 6 at sample k; radius[k][0 .. 1]. */
static double exact(unsigned i, unsigned k, double (*radius)[IN], bool at_rest)
{
    const unsigned row = (k < 1U) ? 0U : 1U;
    double J = (double)(at_rest ? bias_rest : bias_moving)[(row * OUT) + i];
    for (unsigned g = 0U; g < IN; g++) {
        J += (double)direct[(i * IN) + g] * radius[k][g];
        for (unsigned j = 1U; j <= k; j++) {
            J += seen(i, &input[g * S], radius[k - j][g], j - 1U);
        }
    }
    for (unsigned j = 1U; j <= k; j++) {
        for (unsigned d = 0U; d < ND; d++) {
            J += seen(i, &disturbance[d * S], 1.0, j - 1U);
        }
    }
    for (unsigned c = 0U; c < N0; c++) {
        J += seen(i, &(at_rest ? rest : moving)[c * S], 1.0, k);
    }
    return J;
}

static void start_tells_null_and_bad_tables(void **state)
{
    (void)state;
    rig r;
    const hg_zonotope_config good = usual();
    assert_status(HG_OK, hg_ring_start(&r.ring, SIGNALS, 2U, r.past));
    assert_status(HG_E_ARGUMENT, hg_zonotope_start(NULL, &good, &r.ring, HG_START_REST, r.memory));
    assert_status(HG_E_ARGUMENT, hg_zonotope_start(&r.self, NULL, &r.ring, HG_START_REST, r.memory));
    assert_status(HG_E_ARGUMENT, hg_zonotope_start(&r.self, &good, NULL, HG_START_REST, r.memory));
    assert_status(HG_E_ARGUMENT, hg_zonotope_start(&r.self, &good, &r.ring, HG_START_REST, NULL));
    assert_true(hg_zonotope_valid(&good, SIGNALS));
    assert_false(hg_zonotope_valid(&good, 3U));
    static const uint8_t empty_block[2] = {0U, 3U};
    static const uint8_t short_blocks[2] = {2U, 2U};
    static const uint8_t outside[IN] = {0U, SIGNALS};
    static const hg_real negative[2] = {R(-0.5), R(0)};
    static const hg_real growing[2] = {R(1), R(0)};
    static const hg_real wrong_place[2] = {R(0), R(0.5)};
    static const hg_real no_number[2] = {REAL_NAN, R(0)};
    hg_zonotope_config c[34];
    for (size_t i = 0U; i < COUNT(c); i++) {
        c[i] = good;
    }
    size_t n = 0U;
    c[n++].order = 0U;
    c[n++].residuals = 0U;
    c[n++].columns = 0U;
    c[n - 1U].reduction = HG_REDUCTION_BALL;
    c[n++].columns = S - 1U;
    c[n].initial = 4U;
    c[n].disturbances = 0U;
    c[n].reduction = HG_REDUCTION_TRUNCATE;
    c[n++].columns = 1U;
    c[n++].settle = 0U;
    (void)memset(&c[n++].reduction, 0, sizeof(c[0].reduction));
    c[n++].blocks = 0U;
    c[n++].blocks = 1U;
    c[n++].block = NULL;
    c[n++].block = empty_block;
    c[n].decay = none;
    c[n++].block = empty_block;
    c[n++].block = short_blocks;
    c[n++].decay = NULL;
    c[n++].decay = negative;
    c[n++].decay = growing;
    c[n++].decay = wrong_place;
    c[n++].decay = no_number;
    c[n++].state = NULL;
    c[n++].output = NULL;
    c[n++].outer = NULL;
    c[n++].bias_rest = NULL;
    c[n++].bias_moving = NULL;
    c[n++].always = NULL;
    c[n++].growth = NULL;
    c[n++].output_growth = NULL;
    c[n++].disturbance = NULL;
    c[n++].rest = NULL;
    c[n++].moving = NULL;
    c[n++].signal = NULL;
    c[n++].input = NULL;
    c[n++].direct = NULL;
    c[n++].signal = outside;
    c[n].order = 0U;
    c[n++].blocks = 0U;
    assert_count(COUNT(c), n);
    arm(r.memory, COUNT(r.memory));
    for (size_t i = 0U; i < COUNT(c); i++) {
        assert_false(hg_zonotope_valid(&c[i], SIGNALS));
        assert_status(HG_E_CONFIG, hg_zonotope_start(&r.self, &c[i], &r.ring, HG_START_REST, r.memory));
    }
    assert_untouched(r.memory, COUNT(r.memory));
    hg_zonotope_config bare = good;
    bare.width = 0U;
    bare.signal = NULL;
    bare.input = NULL;
    bare.direct = NULL;
    bare.disturbances = 0U;
    bare.disturbance = NULL;
    bare.initial = 0U;
    bare.rest = NULL;
    bare.moving = NULL;
    bare.columns = S;
    assert_true(hg_zonotope_valid(&bare, 1U));
}

static void without_reduction_it_is_the_exact_sum(void **state)
{
    (void)state;
    for (int how = 0; how < 2; how++) {
        for (int reduction = (int)HG_REDUCTION_TRUNCATE; reduction <= (int)HG_REDUCTION_BALL; reduction++) {
            rig r;
            hg_zonotope_config config = usual();
            config.reduction = (hg_reduction)reduction;
            double radius[8][IN];
            start_rig(&r, &config, (how == 1) ? HG_START_REST : HG_START_MOVING);
            for (unsigned k = 0U; k < 8U; k++) {
                radius[k][0] = (k == 3U) ? 0.0 : (0.25 * (double)k);
                radius[k][1] = (k == 5U) ? 0.0 : 2.0;
                step(&r, radius[k][0], radius[k][1]);
                for (unsigned i = 0U; i < OUT; i++) {
                    assert_near(exact(i, k, radius, how == 1), r.J[i], 1e-5);
                }
            }
            /* Of 8 samples one first and one second radius were 0, and k = 0 had none of the first: no columns for them. */
            assert_int_equal(N0 + 6U + 7U + (8U * ND), r.self.count);
            assert_untouched(&r.memory[REALS], 1U);
        }
    }
}

static void nothing_to_read_is_only_bias(void **state)
{
    (void)state;
    rig r;
    hg_zonotope_config bare = usual();
    bare.width = 0U;
    bare.disturbances = 0U;
    bare.initial = 0U;
    bare.columns = S;
    start_rig(&r, &bare, HG_START_REST);
    for (unsigned k = 0U; k < 5U; k++) {
        step(&r, 3.0, 3.0);
        assert_real(bias_rest[(k == 0U) ? 0U : OUT], r.J[0]);
        assert_int_equal(0, r.self.count);
    }
}

/* Scores of a column as the header has them. */
static double worth(const hg_real *c, hg_reduction reduction)
{
    double sum = 0.0;
    double largest = 0.0;
    double squares = 0.0;
    for (unsigned m = 0U; m < S; m++) {
        sum += fabs((double)c[m]);
        largest = fmax(largest, fabs((double)c[m]));
        squares += (double)c[m] * (double)c[m];
    }
    return (reduction == HG_REDUCTION_TRUNCATE) ? squares : (sum - largest);
}

/* A start with random initial columns reduces at once: what stays, what is dropped and what encloses it can all be seen. */
static void a_reduction_keeps_the_columns_worth_most(void **state)
{
    (void)state;
    uint32_t seed = seed_of_run(42U);
    for (unsigned round = 0U; round < 400U; round++) {
        rig r;
        static hg_real many[30U * S];
        hg_zonotope_config config = usual();
        config.reduction = (hg_reduction)draw_between(&seed, (int)HG_REDUCTION_TRUNCATE, (int)HG_REDUCTION_BALL);
        config.columns = (uint8_t)draw_between(&seed, (int)S, 28);
        config.initial = (uint8_t)draw_between(&seed, config.columns + 1, config.columns + 3);
        config.initial = (config.initial > 30U) ? 30U : config.initial;
        config.rest = many;
        const double scale = (draw_between(&seed, 0, 1) == 0) ? 1.0 : ldexp(1.0, -20); /* small ones differ too */
        for (size_t i = 0U; i < COUNT(many); i++) {
            many[i] = R(scale * draw_between(&seed, -64, 64) / 8.0);
        }
        const unsigned keep = config.columns - ((config.reduction == HG_REDUCTION_BOX) ? S : 0U);
        start_rig(&r, &config, HG_START_REST);
        assert_int_equal(config.columns, r.self.count);
        /* No fewer than `keep` columns are worth as much as the least of those kept, and each kept one is one of them. */
        double least = 1e30;
        double total[S] = {0.0, 0.0, 0.0};
        double kept[S] = {0.0, 0.0, 0.0};
        for (unsigned i = 0U; i < keep; i++) {
            least = fmin(least, worth(&r.self.column[(size_t)i * S], config.reduction));
            for (unsigned m = 0U; m < S; m++) {
                kept[m] += fabs((double)r.self.column[(i * S) + m]);
            }
        }
        unsigned better = 0U;
        for (unsigned i = 0U; i < config.initial; i++) {
            better += (worth(&many[(size_t)i * S], config.reduction) > least) ? 1U : 0U;
            for (unsigned m = 0U; m < S; m++) {
                total[m] += fabs((double)many[(i * S) + m]);
            }
        }
        assert_true((keep == 0U) || (better < keep));
        for (unsigned m = 0U; m < S; m++) {
            const double gone = total[m] - kept[m];
            if (config.reduction == HG_REDUCTION_BOX) {
                assert_near(gone, r.self.column[((keep + m) * S) + m], 1e-4);
                assert_near(gone, r.self.column[(keep * S) + m] + r.self.column[((keep + 1U) * S) + m] + r.self.column[((keep + 2U) * S) + m], 1e-4);
                assert_real(0.0, r.self.spread[m]);
            } else if (config.reduction == HG_REDUCTION_TRUNCATE) {
                assert_real(0.0, r.self.spread[m]);
            } else if (m == 2U) {
                assert_near(gone, r.self.spread[m], 1e-4);
            } else {
                assert_true((double)r.self.spread[m] >= (gone - 1e-4));
                assert_real(r.self.spread[0], r.self.spread[m]);
            }
        }
        assert_untouched(&r.memory[REALS], 1U);
    }
}

static void columns_worth_the_same_stay_in_their_order(void **state)
{
    (void)state;
    static const hg_real alike[7U * S] = {R(1), R(2), R(0), R(2), R(-1), R(0), R(0), R(1), R(2), R(-2), R(0), R(1), R(1), R(0), R(-2), R(0), R(2), R(1), R(2), R(1), R(0)};
    for (int reduction = (int)HG_REDUCTION_TRUNCATE; reduction <= (int)HG_REDUCTION_BALL; reduction++) {
        for (uint8_t columns = 6U; columns <= 7U; columns++) {
            rig r;
            hg_zonotope_config config = usual();
            config.reduction = (hg_reduction)reduction;
            config.columns = columns;
            config.initial = 7U;
            config.rest = alike;
            start_rig(&r, &config, HG_START_REST);
            const bool boxed = (columns == 6U) && (config.reduction == HG_REDUCTION_BOX); /* seven fit into seven: nothing is boxed */
            assert_memory_equal(alike, r.self.column, (columns - (boxed ? S : 0U)) * S * sizeof(hg_real));
        }
    }
}

/* The disc around one column holds it in every direction and is at most 2 % too large. */
static void a_disc_is_as_large_as_its_column(void **state)
{
    (void)state;
    for (unsigned step_ = 0U; step_ < 720U; step_++) {
        const double angle = (double)step_ * 3.14159265358979 / 360.0;
        rig r;
        hg_zonotope_config config = usual();
        const hg_real two[2U * S] = {R(1e3), R(1e3), R(1e3), R(5.0 * cos(angle)), R(5.0 * sin(angle)), R(0)};
        config.reduction = HG_REDUCTION_BALL;
        config.columns = 1U;
        config.rest = two;
        start_rig(&r, &config, HG_START_REST);
        assert_true((double)r.self.spread[0] >= (5.0 * (1.0 - 1e-7)));
        assert_true((double)r.self.spread[0] <= 5.0986);
    }
}

/* Tables as a design widens them, by more than a sum of so many terms can lose. */
static void widened(hg_real *to, const hg_real *from, size_t n)
{
    for (size_t i = 0U; i < n; i++) {
        to[i] = R((double)from[i] * (1.0 + 4e-6));
    }
}

static double size_of_all(const hg_zonotope *self)
{
    double sum = 0.0;
    for (size_t i = 0U; i < ((size_t)self->count * S); i++) {
        sum += fabs((double)self->column[i]);
    }
    for (size_t m = 0U; m < S; m++) {
        sum += fabs((double)self->spread[m]);
    }
    return sum;
}

/* Random runs that reduce all the time: sound reductions stay above the exact sum, the published one does not. */
static void sound_reductions_are_never_below_the_exact_sum(void **state)
{
    (void)state;
    uint32_t seed = seed_of_run(7U);
    static const hg_real growth[S] = {R(2e-5), R(2e-5), R(2e-5)};
    static const hg_real output_growth[OUT] = {R(8e-6), R(8e-6)};
    static const hg_real always[S] = {R(1e-6), R(1e-6), R(1e-6)};
    hg_real wide_direct[COUNT(direct)];
    hg_real wide_outer[COUNT(outer)];
    hg_real wide_bias[COUNT(bias_rest)];
    widened(wide_direct, direct, COUNT(direct));
    widened(wide_outer, outer, COUNT(outer));
    widened(wide_bias, bias_rest, COUNT(bias_rest));
    unsigned below = 0U;
    for (unsigned round = 0U; round < 60U; round++) {
        rig r;
        hg_zonotope_config config = usual();
        config.reduction = (hg_reduction)(1U + (round % 3U));
        config.columns = (uint8_t)draw_between(&seed, (int)S, 10);
        config.growth = growth;
        config.output_growth = output_growth;
        config.always = always;
        config.direct = wide_direct;
        config.outer = wide_outer;
        config.bias_rest = wide_bias;
        const double size = ldexp(1.0, draw_between(&seed, -10, 10));
        double radius[60][IN];
        start_rig(&r, &config, HG_START_REST);
        for (unsigned k = 0U; k < 60U; k++) {
            assert_near(size_of_all(&r.self), r.self.size, 1e-5 * size_of_all(&r.self)); /* what rounding is a share of */
            for (unsigned g = 0U; g < IN; g++) {
                radius[k][g] = (draw_between(&seed, 0, 3) == 0) ? 0.0 : (double)R(size * (double)draw_between(&seed, 0, 1000) / 1000.0);
            }
            step(&r, radius[k][0], radius[k][1]);
            for (unsigned i = 0U; i < OUT; i++) {
                const double sum = exact(i, k, radius, true);
                if (config.reduction == HG_REDUCTION_TRUNCATE) {
                    below += ((double)r.J[i] < sum) ? 1U : 0U;
                } else {
                    assert_true((double)r.J[i] >= sum);
                    assert_true((double)r.J[i] <= (8.0 * sum));
                }
            }
        }
        assert_untouched(&r.memory[REALS], 1U);
    }
    assert_true(below > 500U);
}

/* always[] and growth[] enter by their definition: e.g. s+ = decay s + always + growth size. */
static void errors_go_into_the_spread(void **state)
{
    (void)state;
    rig r;
    hg_zonotope_config config = usual();
    static const hg_real always[S] = {R(1), R(1), R(2)};
    static const hg_real growth[S] = {R(0.125), R(0.125), R(0.25)};
    static const hg_real output_growth[OUT] = {R(0.5), R(2)};
    config.disturbances = 0U;
    config.always = always;
    config.growth = growth;
    config.output_growth = output_growth;
    config.initial = 0U;
    start_rig(&r, &config, HG_START_REST);
    step(&r, 0.0, 0.0);
    assert_real(1.0, r.J[0]);
    assert_real(4.0, r.self.size); /* always alone */
    step(&r, 2.0, 0.0);
    assert_real(0.5 + 1.0 + (1.25 + 2.0) + (0.5 * 4.0), r.J[0]);
    assert_real(0.25 + 0.5 + (2.0 + 2.0) + (2.0 * 4.0), r.J[1]);
    const double met = 4.0 + 7.0; /* what was there, and |2 input|1 */
    assert_near(0.5625 + 1.0 + (0.125 * met), r.self.spread[0], 1e-6);
    assert_near(0.5625 + 1.0 + (0.125 * met), r.self.spread[1], 1e-6);
    assert_near(1.5 + 2.0 + (0.25 * met), r.self.spread[2], 1e-6);
}

/* A block without a disc is moved on by its magnitudes, also one of two rows that is no pair. */
static void intervals_move_on_by_magnitudes(void **state)
{
    (void)state;
    rig r;
    hg_zonotope_config config = usual();
    config.decay = none;
    config.disturbances = 0U;
    config.reduction = HG_REDUCTION_BALL;
    config.columns = 1U;
    config.initial = 2U;
    static const hg_real two[2U * S] = {R(1), R(0), R(2), R(0), R(-1), R(0.5)};
    config.rest = two;
    start_rig(&r, &config, HG_START_REST);
    /* (0, -1, 0.5) is worth more than (1, 0, 2)? 0.5 against 1: the second goes. */
    assert_real(0.0, r.self.spread[0]);
    assert_real(1.0, r.self.spread[1]);
    assert_real(0.5, r.self.spread[2]);
    step(&r, 0.0, 0.0);
    assert_real(0.25, r.self.spread[0]);
    assert_real(0.5, r.self.spread[1]);
    assert_real(0.375, r.self.spread[2]);
    /* Every row a block of its own: the first three numbers of the table. */
    static const uint8_t rows[S] = {1U, 1U, 1U};
    static const hg_real three[2U * S] = {R(1), R(0), R(2), R(0.25), R(-1), R(0.5)};
    config.blocks = S;
    config.block = rows;
    config.rest = three;
    start_rig(&r, &config, HG_START_REST);
    step(&r, 0.0, 0.0);
    assert_real(0.125, r.self.spread[0]);
    assert_real(0.25, r.self.spread[1]);
    assert_real(0.125, r.self.spread[2]);
    assert_real(0.5, r.self.column[0]);
    assert_real(0.0, r.self.column[1]);
    assert_real(0.5, r.self.column[2]);
}

/* Nothing but the columns of the beginning, as many as there may be: right behind them lies the spread. */
static void a_full_set_leaves_the_spread_alone(void **state)
{
    (void)state;
    rig r;
    static const hg_real always[S] = {R(1), R(1), R(2)};
    hg_zonotope_config config = usual();
    config.width = 0U;
    config.disturbances = 0U;
    config.initial = 1U;
    config.columns = 1U;
    config.reduction = HG_REDUCTION_BALL;
    config.always = always;
    start_rig(&r, &config, HG_START_REST);
    step(&r, 0.0, 0.0);
    step(&r, 0.0, 0.0);
    assert_real(1.5625, r.self.spread[0]);
    assert_real(1.5625, r.self.spread[1]);
    assert_real(3.5, r.self.spread[2]);
}

static void a_late_radius_is_as_good_as_one_from_the_start(void **state)
{
    (void)state;
    for (unsigned lag = 1U; lag < 6U; lag++) {
        rig a;
        rig b;
        const hg_zonotope_config config = usual();
        start_rig(&a, &config, HG_START_REST);
        start_rig(&b, &config, HG_START_REST);
        const unsigned late = 6U - lag;
        for (unsigned k = 0U; k < 6U; k++) {
            step(&a, 1.0 + ((k == late) ? 3.0 : 0.0), 0.5 + ((k == late) ? 0.25 : 0.0));
            step(&b, 1.0, 0.5);
        }
        push(&a, 1.0, 0.5);
        push(&b, 1.0, 0.5);
        /* Places 1 .. 3 of the ring's rows; place 2 is none of the generator's. In two parts, and out of order. */
        const hg_real increase[3] = {R(0.25), R(1e30), R(2)};
        const hg_real again[1] = {R(1)};
        hg_zonotope_widen(&b.self, (uint8_t)lag, 3U, 1U, again);
        hg_zonotope_widen(&b.self, (uint8_t)lag, 1U, 3U, increase);
        for (unsigned k = 0U; k < 4U; k++) {
            hg_zonotope_step(&a.self, &a.ring, a.J);
            hg_zonotope_step(&b.self, &b.ring, b.J);
            for (unsigned i = 0U; i < OUT; i++) {
                assert_near(a.J[i], b.J[i], 2e-5);
            }
            push(&a, 1.0, 0.5);
            push(&b, 1.0, 0.5);
        }
    }
}

static void a_late_radius_that_changes_nothing(void **state)
{
    (void)state;
    rig r;
    const hg_zonotope_config config = usual();
    const hg_real more[SIGNALS] = {R(9), R(9), R(9), R(9)};
    const hg_real less[SIGNALS] = {R(-9), R(0), R(-9), R(-9)};
    start_rig(&r, &config, HG_START_REST);
    hg_zonotope_widen(&r.self, 1U, 0U, SIGNALS, more); /* before the first sample */
    assert_int_equal(N0, r.self.count);
    step(&r, 1.0, 1.0);
    step(&r, 1.0, 1.0);
    const uint16_t count = r.self.count;
    const hg_real size = r.self.size;
    hg_zonotope_widen(&r.self, 0U, 0U, SIGNALS, more);
    hg_zonotope_widen(&r.self, 3U, 0U, SIGNALS, more);
    hg_zonotope_widen(&r.self, 1U, 0U, SIGNALS, less);
    hg_zonotope_widen(&r.self, 1U, 0U, 1U, more); /* before and behind its signals */
    hg_zonotope_widen(&r.self, 1U, 2U, 1U, more);
    const hg_real between[5] = {R(0), R(9), R(0), R(9), R(9)}; /* only of the place that is none of its */
    hg_zonotope_widen(&r.self, 1U, 1U, 3U, between);
    assert_int_equal(count, r.self.count);
    assert_real(size, r.self.size);
    hg_zonotope_widen(&r.self, 2U, 0U, SIGNALS, more);
    assert_int_equal(count + 2U, r.self.count);
}

static void late_radii_stay_within_memory_and_add_their_rounding(void **state)
{
    (void)state;
    rig r;
    hg_zonotope_config config = usual();
    static const hg_real growth[S] = {R(0.5), R(0.5), R(0.5)};
    const hg_real more[SIGNALS] = {R(1), R(1), R(1), R(1)};
    config.columns = S;
    config.disturbances = 0U;
    for (int reduction = (int)HG_REDUCTION_TRUNCATE; reduction <= (int)HG_REDUCTION_BALL; reduction++) {
        config.reduction = (hg_reduction)reduction;
        config.growth = none;
        start_rig(&r, &config, HG_START_REST);
        arm(&r.memory[HG_ZONOTOPE_REALS(S, S, IN)], REALS - HG_ZONOTOPE_REALS(S, S, IN));
        for (unsigned k = 0U; k < 20U; k++) {
            push(&r, 1.0, 1.0);
            for (uint8_t lag = 1U; lag < 10U; lag++) {
                hg_zonotope_widen(&r.self, lag, 0U, SIGNALS, more);
                assert_true(r.self.count <= S);
            }
            hg_zonotope_step(&r.self, &r.ring, r.J);
        }
        assert_untouched(&r.memory[HG_ZONOTOPE_REALS(S, S, IN)], REALS - HG_ZONOTOPE_REALS(S, S, IN));
    }
    config.reduction = HG_REDUCTION_TRUNCATE;
    start_rig(&r, &config, HG_START_REST);
    step(&r, 0.0, 0.0);
    step(&r, 0.0, 0.0);
    config.growth = growth;
    const hg_real one[1] = {R(1)};
    hg_zonotope_widen(&r.self, 2U, 3U, 1U, one);
    /* |(1, -2, 0.5)|1 and |Lam of it|1 */
    assert_near(0.5 * (3.5 + (1.0 + 0.75 + 0.375)), r.self.spread[2], 1e-6);
    const double before = (double)r.self.spread[2];
    hg_zonotope_widen(&r.self, 1U, 0U, SIGNALS, more); /* of both signals: |(1, -2, 0.5)|1 and |(0.25, 1, -1)|1 */
    assert_near(before + (0.5 * (3.5 + 2.25)), r.self.spread[2], 1e-6);
}

static void a_set_that_overflows_is_forgotten_and_heals_in_time(void **state)
{
    (void)state;
    const hg_real most = HG_REAL_MAX;
    rig r;
    hg_zonotope_config config = usual();
    for (int late = 0; late < 2; late++) {
        start_rig(&r, &config, HG_START_REST);
        step(&r, 1.0, 1.0);
        if (late == 0) {
            step(&r, (double)most, (double)most);
            assert_int_equal(0, r.self.count);
            assert_real(0.0, r.self.size);
            step(&r, 1.0, 1.0);
        } else {
            push(&r, 1.0, 1.0);
            hg_zonotope_widen(&r.self, 1U, 3U, 1U, &most);
            hg_zonotope_step(&r.self, &r.ring, r.J);
        }
        for (unsigned k = 0U; k < 5U; k++) {
            assert_real(HG_REAL_MAX, r.J[0]);
            assert_real(HG_REAL_MAX, r.J[1]);
            assert_int_equal(5U - k - 1U, r.self.lost);
            assert_int_equal(k == 4U, hg_zonotope_ready(&r.self));
            for (size_t i = 0U; i < ((size_t)r.self.count * S); i++) {
                assert_true(hg_real_finite(r.self.column[i]));
            }
            step(&r, 1.0, 1.0);
        }
        assert_true((double)r.J[0] < 50.0);
    }
    config.recover = UINT16_MAX;
    start_rig(&r, &config, HG_START_REST);
    step(&r, (double)most, 0.0);
    for (unsigned k = 0U; k < 70000U; k++) {
        step(&r, 0.0, 0.0);
    }
    assert_real(HG_REAL_MAX, r.J[0]);
    assert_false(hg_zonotope_ready(&r.self));
    config.recover = UINT16_MAX - 1U; /* long, and not for ever */
    start_rig(&r, &config, HG_START_REST);
    step(&r, (double)most, 0.0);
    for (unsigned k = 0U; k < config.recover; k++) {
        assert_false(hg_zonotope_ready(&r.self));
        step(&r, 0.0, 0.0);
    }
    assert_true(hg_zonotope_ready(&r.self));
    hg_zonotope_reset(&r.self, HG_START_REST);
    step(&r, 0.0, 0.0);
    assert_true((double)r.J[0] < 50.0);
}

/* Entries still fit, what is seen of them does not: even infinity less infinity is no excuse. */
static void a_threshold_that_overflows_is_the_largest_number(void **state)
{
    (void)state;
    rig r;
    hg_zonotope_config config = usual();
    const double large = (double)HG_REAL_MAX / 64.0;
    const hg_real wide[OUT * S] = {R(1e3), R(1e3), R(0), R(1e3), R(0), R(0)};
    const hg_real apart[S] = {R(large), R(-large), R(0)};
    config.initial = 1U;
    config.rest = apart;
    config.output = wide;
    start_rig(&r, &config, HG_START_REST);
    step(&r, 0.0, 0.0);
    assert_real(HG_REAL_MAX, r.J[0]);
    assert_real(HG_REAL_MAX, r.J[1]);
    assert_int_equal(0, r.self.lost);
    for (unsigned k = 0U; k < 3000U; k++) {
        step(&r, 0.0, 0.0);
    }
    assert_true((double)r.J[1] < 1e4);
}

static void readiness_counts_samples_and_never_wraps(void **state)
{
    (void)state;
    rig r;
    hg_zonotope_config config = usual();
    config.columns = S;
    start_rig(&r, &config, HG_START_REST);
    for (int k = 0; k < 5; k++) {
        assert_int_equal(k >= 2, hg_zonotope_ready(&r.self));
        step(&r, 0.0, 0.0);
    }
    hg_zonotope_reset(&r.self, HG_START_MOVING);
    for (int k = 0; k < 70000; k++) {
        assert_int_equal(k >= 4, hg_zonotope_ready(&r.self));
        step(&r, 0.0, 0.0);
        assert_true((double)r.J[0] >= ((k == 0) ? 16.0 : 0.5));
    }
    assert_int_equal(65535, r.self.k);
    assert_true((double)r.J[0] < 4.0);
}

static void reset_forgets_all(void **state)
{
    (void)state;
    rig r;
    const hg_zonotope_config config = usual();
    hg_real first[OUT];
    start_rig(&r, &config, HG_START_MOVING);
    step(&r, 1.0, 1.0);
    (void)memcpy(first, r.J, sizeof(first));
    for (int k = 0; k < 50; k++) {
        step(&r, 9.0, 9.0);
    }
    hg_zonotope_reset(&r.self, HG_START_MOVING);
    step(&r, 1.0, 1.0);
    assert_memory_equal(first, r.J, sizeof(first));
}

/* 255 of everything, one row a block: places and counts stay within 16 bits and the memory the macro says. */
static void the_largest_set_stays_within_its_memory(void **state)
{
    (void)state;
    enum { MOST = 255 };
    static hg_real table[MOST * MOST];
    static uint8_t ones[MOST];
    static uint8_t places[MOST];
    static hg_real memory[HG_ZONOTOPE_REALS(MOST, MOST, 2U * MOST) + 1U];
    static hg_real past[2U * MOST];
    static hg_real radius[MOST];
    static hg_real J[MOST + 1];
    hg_ring ring;
    hg_zonotope self;
    for (size_t i = 0U; i < COUNT(table); i++) {
        table[i] = R((double)(i % 7U) / 4096.0);
    }
    for (size_t i = 0U; i < MOST; i++) {
        ones[i] = 1U;
        places[i] = (uint8_t)i;
        radius[i] = R(1);
    }
    static const hg_real zero[MOST];
    hg_zonotope_config config = usual();
    config.order = MOST;
    config.residuals = MOST;
    config.width = MOST;
    config.disturbances = MOST;
    config.initial = MOST;
    config.columns = MOST;
    config.blocks = MOST;
    config.signal = places;
    config.block = ones;
    config.state = table;
    config.input = table;
    config.disturbance = table;
    config.rest = table;
    config.moving = table;
    config.output = table;
    config.outer = table;
    config.direct = table;
    config.settle = 1U;
    config.bias_rest = table;
    config.bias_moving = table;
    config.decay = zero;
    config.always = zero;
    config.growth = zero;
    config.output_growth = zero;
    J[MOST] = CANARY;
    for (int reduction = (int)HG_REDUCTION_TRUNCATE; reduction <= (int)HG_REDUCTION_BALL; reduction++) {
        config.reduction = (hg_reduction)reduction;
        arm(memory, COUNT(memory));
        assert_status(HG_OK, hg_ring_start(&ring, MOST, 2U, past));
        assert_status(HG_OK, hg_zonotope_start(&self, &config, &ring, HG_START_MOVING, memory));
        for (unsigned k = 0U; k < 3U; k++) {
            assert_status(HG_OK, hg_ring_push(&ring, radius));
            hg_zonotope_step(&self, &ring, J);
            assert_int_equal(MOST, self.count);
        }
        assert_untouched(&memory[COUNT(memory) - 1U], 1U);
        assert_untouched(&J[MOST], 1U);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(start_tells_null_and_bad_tables),
        cmocka_unit_test(without_reduction_it_is_the_exact_sum),
        cmocka_unit_test(nothing_to_read_is_only_bias),
        cmocka_unit_test(a_reduction_keeps_the_columns_worth_most),
        cmocka_unit_test(columns_worth_the_same_stay_in_their_order),
        cmocka_unit_test(a_disc_is_as_large_as_its_column),
        cmocka_unit_test(sound_reductions_are_never_below_the_exact_sum),
        cmocka_unit_test(errors_go_into_the_spread),
        cmocka_unit_test(intervals_move_on_by_magnitudes),
        cmocka_unit_test(a_full_set_leaves_the_spread_alone),
        cmocka_unit_test(a_late_radius_is_as_good_as_one_from_the_start),
        cmocka_unit_test(a_late_radius_that_changes_nothing),
        cmocka_unit_test(late_radii_stay_within_memory_and_add_their_rounding),
        cmocka_unit_test(a_set_that_overflows_is_forgotten_and_heals_in_time),
        cmocka_unit_test(a_threshold_that_overflows_is_the_largest_number),
        cmocka_unit_test(readiness_counts_samples_and_never_wraps),
        cmocka_unit_test(reset_forgets_all),
        cmocka_unit_test(the_largest_set_stays_within_its_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
