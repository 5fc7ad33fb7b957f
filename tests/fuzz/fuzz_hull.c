/* hull.h and zonotope.h side by side over one generator of any poles: errors within their radii, disturbances within 1, an initial state within its set, and a
 * residual computed in double precision, which neither threshold may be below; then radii of any finite size, which no number may leave finite ground by. */
#include "fuzz.h"

#include <math.h>

#include "hullguard/hull.h"
#include "hullguard/zonotope.h"

#define SIGNALS 2U
#define ORDER 3U
#define OUT 2U
#define LENGTH 12U
#define Q 8U
#define REALS HG_ZONOTOPE_REALS(ORDER, Q, SIGNALS + 1U)
#define WIDE (1.0 + 0x1p-14) /* more than a sum of so many terms can lose in float32 */

typedef struct {                 /* s(k+1) = Lam s + B e + Bd d,  r = C s + D e; in double precision */
    double   lam[5];             /* the blocks, one after another */
    double   rho[2];             /* their norms */
    double   B[SIGNALS][ORDER];
    double   Bd[ORDER];
    double   x0[ORDER];
    double   C[OUT][ORDER];
    double   D[OUT][SIGNALS];
    double   s[ORDER];
} generator;

typedef struct {
    uint8_t  signal[SIGNALS];
    uint8_t  taps[SIGNALS];
    uint8_t  block[2];
    hg_real  weight[OUT * SIGNALS * (LENGTH + 1U)];
    hg_real  rest[OUT];
    hg_real  left[OUT];
    hg_real  bias[OUT];
    hg_real  decay[OUT];
    hg_real  lam[5];
    hg_real  input[SIGNALS * ORDER];
    hg_real  disturbance[ORDER];
    hg_real  initial[ORDER];
    hg_real  output[OUT * ORDER];
    hg_real  outer[OUT * ORDER];
    hg_real  direct[OUT * SIGNALS];
    hg_real  nothing[OUT];
    hg_real  shrink[2];
    hg_real  always[ORDER];
    hg_real  growth[ORDER];
    hg_hull_config     hull;
    hg_zonotope_config zonotope;
} tables;

typedef struct {
    generator   g;
    tables      t;
    hg_ring     ring;
    hg_real     rows[HG_RING_REALS(SIGNALS, LENGTH)];
    hg_hull     hull;
    hg_real     hull_memory[HG_HULL_REALS(OUT, 0U)];
    hg_zonotope zonotope;
    hg_real     zonotope_memory[REALS];
    uint8_t     hidden;          /* samples until a radius that was told too small is corrected, 0: none is */
    uint8_t     age;             /* of that sample */
    hg_real     increase[SIGNALS];
} rig;

static double number(source *s)
{
    return (double)(int8_t)take8(s) / 16.0;
}

/* A pair of poles and a single one. */
static void take_generator(source *s, generator *g)
{
    (void)memset(g, 0, sizeof(*g));
    const double a = (double)(int8_t)take8(s) / 190.0;
    const double b = (double)(int8_t)take8(s) / 190.0;
    g->lam[0] = a;
    g->lam[1] = -b;
    g->lam[2] = b;
    g->lam[3] = a;
    g->lam[4] = (double)(int8_t)take8(s) / 132.0;
    g->rho[0] = hypot(a, b);
    g->rho[1] = fabs(g->lam[4]);
    for (unsigned m = 0U; m < ORDER; m++) {
        for (unsigned i = 0U; i < SIGNALS; i++) {
            g->B[i][m] = number(s);
        }
        g->Bd[m] = number(s) / 16.0;
        g->x0[m] = number(s);
        for (unsigned i = 0U; i < OUT; i++) {
            g->C[i][m] = number(s);
        }
    }
    for (unsigned i = 0U; i < OUT; i++) {
        g->D[i][0] = number(s);
        g->D[i][1] = number(s);
    }
}

static void turn(const generator *g, double *x)
{
    const double first = (g->lam[0] * x[0]) + (g->lam[1] * x[1]);
    x[1] = (g->lam[2] * x[0]) + (g->lam[3] * x[1]);
    x[0] = first;
    x[2] *= g->lam[4];
}

static double dot(const double *c, const double *x)
{
    return (c[0] * x[0]) + (c[1] * x[1]) + (c[2] * x[2]);
}

/* |C Lam^j x| is at most this times the largest norm to the j. */
static double reach(const double *c, const double *x)
{
    return (hypot(c[0], c[1]) * hypot(x[0], x[1])) + (fabs(c[2]) * fabs(x[2]));
}

/* Weights in pairs of residuals: signal after signal, [taps + 1][2]. */
static void make_hull(tables *t, const generator *g)
{
    const double slow = fmax(fmax(g->rho[0], g->rho[1]), 0.5) * WIDE;
    unsigned at = 0U;
    for (unsigned n = 0U; n < SIGNALS; n++) {
        double x[ORDER] = {g->B[n][0], g->B[n][1], g->B[n][2]};
        for (unsigned lag = 0U; lag < t->taps[n]; lag++) {
            for (unsigned i = 0U; i < OUT; i++) {
                t->weight[at + i] = (hg_real)(fabs((lag == 0U) ? g->D[i][n] : dot(g->C[i], x)) * WIDE);
            }
            at += OUT;
            if (lag > 0U) {
                turn(g, x);
            }
        }
        for (unsigned i = 0U; i < OUT; i++) {
            const double tail = (t->taps[n] == 0U) ? fmax(fabs(g->D[i][n]), reach(g->C[i], g->B[n]) / slow)
                                                   : (reach(g->C[i], g->B[n]) * pow(slow, (double)t->taps[n] - 1.0));
            t->weight[at + i] = (hg_real)(tail * WIDE);
        }
        at += OUT;
    }
    for (unsigned i = 0U; i < OUT; i++) {
        const double always = (reach(g->C[i], g->Bd) / (1.0 - slow)) + 1.0e-30;
        t->bias[i] = (hg_real)(always * WIDE);
        t->rest[i] = (hg_real)((fabs(dot(g->C[i], g->x0)) + always) * WIDE);
        t->left[i] = (hg_real)(reach(g->C[i], g->x0) * WIDE);
        t->decay[i] = (hg_real)slow;
    }
    t->hull = (hg_hull_config){.residuals = OUT, .width = SIGNALS, .signal = t->signal, .taps = t->taps, .weight = t->weight, .settle = 1U, .rest = t->rest,
                               .rest_left = t->left, .moving = t->rest, .moving_left = t->left, .bias = t->bias, .decay = t->decay};
}

static void make_zonotope(tables *t, const generator *g, hg_reduction reduction, uint8_t columns, bool disc)
{
    for (unsigned m = 0U; m < 5U; m++) {
        t->lam[m] = (hg_real)g->lam[m];
    }
    for (unsigned m = 0U; m < ORDER; m++) {
        for (unsigned n = 0U; n < SIGNALS; n++) {
            t->input[(n * ORDER) + m] = (hg_real)g->B[n][m];
        }
        t->disturbance[m] = (hg_real)g->Bd[m];
        t->initial[m] = (hg_real)g->x0[m];
        t->always[m] = (hg_real)1.0e-32;
        t->growth[m] = (hg_real)1.0e-5;
        for (unsigned i = 0U; i < OUT; i++) {
            t->output[(i * ORDER) + m] = (hg_real)g->C[i][m];
            t->outer[(i * ORDER) + m] = (hg_real)(fabs(g->C[i][m]) * WIDE);
        }
    }
    for (unsigned i = 0U; i < OUT; i++) {
        if (disc) {
            t->outer[i * ORDER] = (hg_real)(hypot(g->C[i][0], g->C[i][1]) * WIDE);
            t->outer[(i * ORDER) + 1U] = HG_REAL_ZERO;
        }
        t->direct[(i * SIGNALS)] = (hg_real)(fabs(g->D[i][0]) * WIDE);
        t->direct[(i * SIGNALS) + 1U] = (hg_real)(fabs(g->D[i][1]) * WIDE);
        t->nothing[i] = (hg_real)1.0e-5; /* shares of size, and with no unit the least bias */
    }
    t->shrink[0] = disc ? (hg_real)(g->rho[0] * WIDE) : HG_REAL_ZERO;
    t->zonotope = (hg_zonotope_config){.order = ORDER, .residuals = OUT, .width = SIGNALS, .disturbances = 1U, .initial = 1U, .columns = columns, .blocks = 2U,
                                       .reduction = reduction, .signal = t->signal, .block = t->block, .state = t->lam, .input = t->input,
                                       .disturbance = t->disturbance, .rest = t->initial, .moving = t->initial, .output = t->output, .outer = t->outer,
                                       .direct = t->direct, .settle = 1U, .bias_rest = t->nothing, .bias_moving = t->nothing, .decay = t->shrink,
                                       .always = t->always, .growth = t->growth, .output_growth = t->nothing, .recover = 40U};
}

static void begin(source *s, rig *r)
{
    (void)memset(r, 0, sizeof(*r));
    take_generator(s, &r->g);
    r->t.signal[0] = take_below(s, 2U);
    r->t.signal[1] = (uint8_t)(1U - r->t.signal[0]);
    r->t.block[0] = 2U;
    r->t.block[1] = 1U;
    r->t.taps[0] = take_below(s, LENGTH);
    r->t.taps[1] = take_below(s, LENGTH);
    make_hull(&r->t, &r->g);
    const bool disc = ((take8(s) & 1U) != 0U) && (r->g.rho[0] > 0.0);
    make_zonotope(&r->t, &r->g, ((take8(s) & 1U) != 0U) ? HG_REDUCTION_BOX : HG_REDUCTION_BALL, (uint8_t)(ORDER + take_below(s, (Q - ORDER) + 1U)), disc);
    require(50U, hg_ring_start(&r->ring, SIGNALS, LENGTH, r->rows) == HG_OK);
    require(50U, hg_hull_start(&r->hull, &r->t.hull, &r->ring, HG_START_REST, r->hull_memory) == HG_OK);
    require(50U, hg_zonotope_start(&r->zonotope, &r->t.zonotope, &r->ring, HG_START_REST, r->zonotope_memory) == HG_OK);
    const double share = (double)(int8_t)take8(s) / 128.0;
    for (unsigned m = 0U; m < ORDER; m++) {
        r->g.s[m] = share * r->g.x0[m];
    }
}

/* Nothing but finite numbers is kept, whatever the radii are. */
static void check_finite(const rig *r, const hg_real *hull, const hg_real *zonotope)
{
    const hg_zonotope *z = &r->zonotope;
    require(51U, all_finite(hull, OUT) && all_finite(zonotope, OUT) && all_finite(r->hull_memory, HG_HULL_REALS(OUT, 0U)));
    require(51U, all_finite(z->column, (size_t)z->count * ORDER) && all_finite(z->spread, ORDER) && hg_real_finite(z->size));
    for (unsigned i = 0U; i < OUT; i++) {
        require(51U, (hull[i] >= HG_REAL_ZERO) && (zonotope[i] >= HG_REAL_ZERO));
    }
    require(51U, z->count <= r->t.zonotope.columns);
}

/* A radius that was told too small is told anew: to the hull by its ring, to the zonotope by a column. */
static void correct(rig *r)
{
    for (uint8_t n = 0U; n < SIGNALS; n++) {
        hg_real told = hg_ring_row(&r->ring, r->age)[n];
        told += r->increase[n];
        hg_ring_rewrite(&r->ring, r->age, n, 1U, &told);
    }
    hg_zonotope_widen(&r->zonotope, r->age, 0U, SIGNALS, r->increase);
}

/* How late a radius may be corrected: it must still be in the taps of every signal. */
static uint8_t latest(const rig *r)
{
    return (r->t.taps[0] < r->t.taps[1]) ? r->t.taps[0] : r->t.taps[1];
}

static void one(source *s, rig *r)
{
    hg_real told[SIGNALS];
    hg_real hull[OUT];
    hg_real zonotope[OUT];
    double e[SIGNALS];
    const uint8_t what = take8(s);
    const bool hide = ((what & 7U) == 7U) && (r->hidden == 0U) && (latest(r) > 2U);
    for (uint8_t n = 0U; n < SIGNALS; n++) { /* the ring's order */
        const hg_real radius = (hg_real)ldexp((double)take_below(s, 129U), (int)take_below(s, 60U) - 40);
        const hg_real beyond = hide ? (hg_real)ldexp((double)take_below(s, 129U), (int)take_below(s, 20U) - 10) : HG_REAL_ZERO;
        told[n] = ((what & 8U) != 0U) ? HG_REAL_ZERO : radius;
        e[n] = ((double)told[n] + (double)beyond) * ((double)(int8_t)take8(s) / 128.0);
        if (hide) {
            r->increase[n] = (hg_real)((double)beyond * WIDE);
        }
    }
    require(50U, hg_ring_push(&r->ring, told) == HG_OK);
    r->age = (r->hidden > 0U) ? (uint8_t)(r->age + 1U) : 0U;
    if (r->hidden > 0U) {
        r->hidden--;
        if (r->hidden == 0U) {
            correct(r);
        }
    }
    if (hide) {
        r->hidden = (uint8_t)(1U + take_below(s, (unsigned)latest(r) - 1U));
        r->age = 0U;
    }
    hg_hull_step(&r->hull, &r->ring, hull);
    hg_zonotope_step(&r->zonotope, &r->ring, zonotope);
    check_finite(r, hull, zonotope);
    const double d = (double)(int8_t)take8(s) / 128.0;
    for (unsigned i = 0U; i < OUT; i++) {
        const double residual = fabs(dot(r->g.C[i], r->g.s) + (r->g.D[i][0] * e[r->t.signal[0]]) + (r->g.D[i][1] * e[r->t.signal[1]]));
        require(52U, (r->hidden > 0U) || (residual <= (double)hull[i]));
        require(53U, (r->hidden > 0U) || (residual <= (double)zonotope[i]));
    }
    turn(&r->g, r->g.s);
    for (unsigned m = 0U; m < ORDER; m++) {
        r->g.s[m] += (r->g.B[0][m] * e[r->t.signal[0]]) + (r->g.B[1][m] * e[r->t.signal[1]]) + (r->g.Bd[m] * d);
    }
}

/* Radii of any size, and late ones of any size. */
static void any(source *s, rig *r)
{
    hg_real radius[SIGNALS];
    hg_real hull[OUT];
    hg_real zonotope[OUT];
    radius[0] = hg_real_abs(take_finite(s));
    radius[1] = hg_real_abs(take_finite(s));
    require(50U, hg_ring_push(&r->ring, radius) == HG_OK);
    if ((take8(s) & 3U) == 0U) {
        radius[0] = take_finite(s);
        radius[1] = take_finite(s);
        hg_zonotope_widen(&r->zonotope, take8(s), take_below(s, 3U), take_below(s, 3U), radius);
    }
    hg_hull_step(&r->hull, &r->ring, hull);
    hg_zonotope_step(&r->zonotope, &r->ring, zonotope);
    check_finite(r, hull, zonotope);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    source s = {.data = data, .left = size};
    static rig r;
    begin(&s, &r);
    const bool lawful = (take8(&s) & 3U) != 0U;
    for (unsigned i = 0U; more(&s) && (i < 200U); i++) {
        if (lawful) {
            one(&s, &r);
        } else {
            any(&s, &r);
        }
    }
    return 0;
}
