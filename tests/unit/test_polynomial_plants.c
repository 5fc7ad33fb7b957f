/** @file
 *  polynomial.h, one sample at a time, against its equations in double precision with dense matrices: several states and outputs that know of one another, skewed
 *  noise, degrees 1 to 3, with and without the bound of what is cut off; measurements, silences and outputs that are not there. Before each sample the reference
 *  takes the filter's state over, so that what is compared is the one step. */
#include "support.h"

#include "polynomial_rig.h"

#define ROWS_MAX 14U
#define WIDE_MAX 11U
#define STATES_MAX 3U
#define OUTPUTS_MAX 2U

typedef struct {
    double c[STATES_MAX], Pe[STATES_MAX][STATES_MAX], z[WIDE_MAX], P[WIDE_MAX][WIDE_MAX], M[WIDE_MAX][WIDE_MAX], mean[OUTPUTS_MAX]; /* of the prediction */
    double x[STATES_MAX], Px[STATES_MAX][STATES_MAX], ekf[STATES_MAX]; /* of this sample */
    double plain, threshold, joint, drift;
    bool   held;
} belief;

typedef struct { /* one step's polynomials, and what follows from them */
    double H[OUTPUTS_MAX][RING_MAX], eta[OUTPUTS_MAX], L[STATES_MAX][OUTPUTS_MAX];
    double q[ROWS_MAX][RING_MAX], A[ROWS_MAX][WIDE_MAX], N[ROWS_MAX][ROWS_MAX], J[ROWS_MAX][ROWS_MAX], APA[ROWS_MAX][ROWS_MAX], slack[ROWS_MAX];
    double Y[ROWS_MAX], r[ROWS_MAX], Delta[ROWS_MAX], S[ROWS_MAX][ROWS_MAX];
    bool   used[ROWS_MAX];
} scratch;

/* ---- polynomials ---- */

static void multiply(const rig *p, double *a, const double *b)
{
    static double out[RING_MAX];
    memset(out, 0, sizeof out);
    for (uint16_t i = 0U; i < p->config.ring; i++) {
        for (uint16_t j = 0U; (fabs(a[i]) > 0.0) && (j < (p->start[i + 1U] - p->start[i])); j++) {
            out[p->product[p->start[i] + j]] += a[i] * b[j];
        }
    }
    memcpy(a, out, sizeof out);
}

/* Row i of a map with polynomials in place of the states. */
static void of_map(const rig *p, const hg_polynomial_map *map, uint8_t i, double shift[STATES_MAX][RING_MAX], double *out)
{
    memset(out, 0, RING_MAX * sizeof *out);
    for (uint16_t k = (i == 0U) ? 0U : map->end[i - 1U]; k < map->end[i]; k++) {
        double term[RING_MAX] = {(double)map->coefficient[k]};
        for (uint8_t w = 0U; w < map->width; w++) {
            if (map->factor[(k * map->width) + w] != HG_POLYNOMIAL_NONE) {
                multiply(p, term, shift[map->factor[(k * map->width) + w]]);
            }
        }
        for (uint16_t m = 0U; m < p->config.ring; m++) {
            out[m] += term[m];
        }
    }
}

/* Products of the variables' polynomials by their exponents. */
static void of_monomial(const rig *p, const monomial *m, uint8_t variables, double (*variable)[RING_MAX], double *out)
{
    memset(out, 0, RING_MAX * sizeof *out);
    out[0] = 1.0;
    for (uint8_t v = 0U; v < variables; v++) {
        for (uint8_t e = 0U; e < m->exponent[v]; e++) {
            multiply(p, out, variable[v]);
        }
    }
}

/* ---- linear algebra ---- */

/* X S = B for the rows and columns that are used; what is not used is 0. */
static void solve(double (*S)[ROWS_MAX], const bool *used, size_t n, const double *b, double *x)
{
    double a[ROWS_MAX][ROWS_MAX + 1U];
    for (size_t i = 0U; i < n; i++) {
        for (size_t j = 0U; j < n; j++) {
            a[i][j] = (used[i] && used[j]) ? S[i][j] : ((i == j) ? 1.0 : 0.0);
        }
        a[i][n] = used[i] ? b[i] : 0.0;
    }
    for (size_t i = 0U; i < n; i++) {
        for (size_t l = 0U; l < n; l++) {
            const double part = (l == i) ? 0.0 : (a[l][i] / a[i][i]);
            for (size_t j = i; (l != i) && (j <= n); j++) {
                a[l][j] -= part * a[i][j];
            }
        }
    }
    for (size_t i = 0U; i < n; i++) {
        x[i] = a[i][n] / a[i][i];
    }
}

static double split(double mean)
{
    return fmax(fmin(sqrt(fmax(mean, 0.0)), 10.0), 1e-4);
}

/* ---- the equations of the header, in their order ---- */

static void auxiliary(const rig *p, belief *b, scratch *s, const double *y, const double *radius)
{
    const hg_polynomial_config *c = &p->config;
    static double shift[STATES_MAX][RING_MAX]; /* static: a board's stack is small */
    double S[ROWS_MAX][ROWS_MAX];
    bool fresh_of[OUTPUTS_MAX];
    memset(shift, 0, sizeof shift);
    for (uint8_t l = 0U; l < c->states; l++) {
        shift[l][0] = b->c[l];
        shift[l][1U + l] = 1.0;
    }
    for (uint8_t j = 0U; j < c->outputs; j++) {
        of_map(p, &c->h, j, shift, s->H[j]);
        s->eta[j] = isfinite(radius[j]) ? (y[j] - s->H[j][0]) : 0.0;
        s->H[j][0] = 0.0;
        s->H[j][1U + (2U * c->states) + j] += 1.0;
        fresh_of[j] = radius[j] <= (double)c->fresh[j];
    }
    for (uint8_t i = 0U; i < c->outputs; i++) {
        for (uint8_t j = 0U; j < c->outputs; j++) {
            S[i][j] = (i == j) ? (double)c->R[i] : 0.0;
            for (uint8_t k = 0U; k < c->states; k++) {
                for (uint8_t l = 0U; l < c->states; l++) {
                    S[i][j] += s->H[i][1U + k] * b->Pe[k][l] * s->H[j][1U + l];
                }
            }
        }
        if (fresh_of[i]) {
            b->mean[i] += (double)c->weight * ((s->eta[i] / sqrt(S[i][i])) - b->mean[i]);
        }
    }
    for (uint8_t l = 0U; l < c->states; l++) {
        double PH[OUTPUTS_MAX] = {0.0};
        for (uint8_t j = 0U; j < c->outputs; j++) {
            for (uint8_t k = 0U; k < c->states; k++) {
                PH[j] += b->Pe[l][k] * s->H[j][1U + k];
            }
        }
        solve(S, fresh_of, c->outputs, PH, s->L[l]);
        b->ekf[l] = b->c[l];
        for (uint8_t j = 0U; j < c->outputs; j++) {
            b->ekf[l] += s->L[l][j] * s->eta[j];
        }
    }
}

static void predict_auxiliary(const rig *p, belief *b, scratch *s)
{
    const hg_polynomial_config *c = &p->config;
    static double shift[STATES_MAX][RING_MAX];
    static double xi[STATES_MAX][RING_MAX];
    double Pe[STATES_MAX][STATES_MAX];
    memset(shift, 0, sizeof shift);
    for (uint8_t l = 0U; l < c->states; l++) {
        shift[l][0] = b->ekf[l];
        shift[l][1U + l] = 1.0;
        for (uint8_t j = 0U; j < c->outputs; j++) {
            for (uint16_t m = 0U; m < c->ring; m++) {
                shift[l][m] -= s->L[l][j] * s->H[j][m];
            }
        }
    }
    for (uint8_t l = 0U; l < c->states; l++) {
        of_map(p, &c->f, l, shift, xi[l]);
        b->c[l] = xi[l][0];
        xi[l][0] = 0.0;
        xi[l][1U + c->states + l] += 1.0;
    }
    for (uint8_t i = 0U; i < c->states; i++) {
        for (uint8_t j = 0U; j < c->states; j++) {
            Pe[i][j] = (i == j) ? (double)c->Q[i] : 0.0;
            for (uint8_t k = 0U; k < c->states; k++) {
                for (uint8_t l = 0U; l < c->states; l++) {
                    Pe[i][j] += xi[i][1U + k] * b->Pe[k][l] * xi[j][1U + l];
                }
            }
            for (uint8_t k = 0U; k < c->outputs; k++) {
                Pe[i][j] += xi[i][1U + (2U * c->states) + k] * (double)c->R[k] * xi[j][1U + (2U * c->states) + k];
            }
        }
    }
    memcpy(b->Pe, Pe, sizeof Pe);
    for (uint8_t a = 0U; a < c->lifted; a++) {
        of_monomial(p, &p->state[a + 1U], c->states, xi, s->q[a]);
    }
    for (uint8_t a = 0U; a < c->measured; a++) {
        of_monomial(p, &p->output[a + 1U], c->outputs, s->H, s->q[c->lifted + a]);
    }
}

/* A, N and what is cut off. */
static void moments(const rig *p, const belief *b, scratch *s)
{
    const hg_polynomial_config *c = &p->config;
    const size_t rows = (size_t)c->lifted + c->measured;
    double far[STATES_MAX];
    size_t cutting = 0U;
    for (size_t a = 0U; a < rows; a++) {
        memset(s->A[a], 0, sizeof s->A[a]);
        for (uint16_t i = 0U; i < c->lower; i++) {
            s->A[a][p->moment[i]] += s->q[a][i] * (double)p->mean[p->noise[i]];
        }
        for (size_t d = 0U; d < rows; d++) {
            s->N[a][d] = 0.0;
            for (uint16_t i = 0U; i < c->lower; i++) {
                for (uint16_t j = 0U; (fabs(s->q[a][i]) > 0.0) && (j < c->lower); j++) {
                    s->N[a][d] += (double)p->covariance[(p->noise[i] * c->noises) + p->noise[j]] * b->M[p->moment[i]][p->moment[j]] * s->q[a][i] * s->q[d][j];
                }
            }
        }
    }
    for (uint8_t l = 0U; l < c->states; l++) {
        far[l] = fmin((double)c->reach * sqrt(fmax(b->P[l][l], 0.0)), (double)p->box[l]);
    }
    for (size_t a = 0U; a < rows; a++) {
        bool cuts = false; /* whatever that is worth */
        s->slack[a] = 0.0;
        for (uint16_t i = c->lower; c->bounded && (i < c->ring); i++) {
            const uint16_t cut = (uint16_t)(i - c->lower);
            const double times_state = (p->cut_state[cut] == HG_POLYNOMIAL_NONE) ? 1.0 : far[p->cut_state[cut]];
            cuts = cuts || (fabs(s->q[a][i]) > 0.0);
            s->slack[a] += fabs(s->q[a][i]) * (double)p->cut_scale[cut] * times_state * sqrt(fmax(b->M[p->cut_moment[cut]][p->cut_moment[cut]], 0.0));
        }
        cutting += cuts ? 1U : 0U;
    }
    for (size_t a = 0U; a < rows; a++) {
        s->slack[a] *= s->slack[a] * (double)cutting;
    }
}

/* M+, then J. Result: 1 + e. */
static double joint_covariance(const rig *p, belief *b, scratch *s)
{
    const hg_polynomial_config *c = &p->config;
    const size_t lifted = c->lifted;
    const size_t rows = lifted + c->measured;
    double M[WIDE_MAX][WIDE_MAX] = {{1.0}};
    double mean = 0.0;
    for (size_t a = 0U; a < rows; a++) {
        for (size_t d = 0U; d < rows; d++) {
            double sum = 0.0;
            s->APA[a][d] = 0.0;
            for (size_t i = 0U; i <= lifted; i++) {
                for (size_t j = 0U; j <= lifted; j++) {
                    sum += s->A[a][i] * b->M[i][j] * s->A[d][j];
                    s->APA[a][d] += ((i > 0U) && (j > 0U)) ? (s->A[a][i] * b->P[i - 1U][j - 1U] * s->A[d][j]) : 0.0;
                }
            }
            if ((a < lifted) && (d < lifted)) {
                M[a + 1U][d + 1U] = sum + s->N[a][d];
            }
        }
        if (a < lifted) {
            for (size_t i = 0U; i <= lifted; i++) {
                M[a + 1U][0] += s->A[a][i] * b->M[i][0];
            }
            M[0][a + 1U] = M[a + 1U][0];
        }
        const double whole = s->APA[a][a] + s->N[a][a];
        mean += (whole > 0.0) ? (s->slack[a] / (whole * (double)rows)) : 0.0;
    }
    const double e = c->bounded ? split(mean) : 0.0;
    for (size_t a = 0U; a < rows; a++) {
        for (size_t d = 0U; d < rows; d++) {
            s->J[a][d] = ((1.0 + e) * s->APA[a][d]) + s->N[a][d] + ((c->bounded && (a == d)) ? ((1.0 + (1.0 / e)) * s->slack[a]) : 0.0);
        }
    }
    memcpy(b->M, M, sizeof M);
    return 1.0 + e;
}

/* r, Delta, which are used, and S. Result: 1 + d. */
static double residuals(const rig *p, const belief *b, scratch *s, const double *radius)
{
    const hg_polynomial_config *c = &p->config;
    double mean = 0.0;
    size_t silent = 0U;
    size_t used = 0U;
    for (uint8_t k = 0U; k < c->measured; k++) {
        double most = 1.0;
        s->Y[k] = 1.0;
        s->used[k] = true;
        for (uint8_t j = 0U; j < c->outputs; j++) {
            const bool there = isfinite(radius[j]);
            const bool is_fresh = radius[j] <= (double)c->fresh[j];
            for (uint8_t e = 0U; e < p->output[k + 1U].exponent[j]; e++) {
                s->Y[k] *= s->eta[j];
                most *= fabs(s->eta[j]) + ((there && !is_fresh) ? radius[j] : 0.0);
                s->used[k] = s->used[k] && (is_fresh || (there && ((radius[j] * radius[j]) < s->J[c->lifted + j][c->lifted + j])));
            }
        }
        s->r[k] = s->Y[k];
        for (size_t i = 0U; i <= c->lifted; i++) {
            s->r[k] -= s->A[c->lifted + k][i] * b->z[i];
        }
        s->Delta[k] = most - fabs(s->Y[k]);
        if (s->used[k]) {
            used++;
            silent += (s->Delta[k] > 0.0) ? 1U : 0U;
            mean += s->Delta[k] * s->Delta[k] / s->J[c->lifted + k][c->lifted + k];
        }
    }
    const double d = (silent > 0U) ? split(mean * (double)silent / (double)used) : 0.0;
    for (uint8_t k = 0U; k < c->measured; k++) {
        for (uint8_t i = 0U; i < c->measured; i++) {
            s->S[k][i] = (1.0 + d) * s->J[c->lifted + k][c->lifted + i];
        }
        s->S[k][k] += (silent > 0U) ? ((1.0 + (1.0 / d)) * (double)silent * s->Delta[k] * s->Delta[k]) : 0.0;
    }
    return 1.0 + d;
}

static double dot(const double *a, const double *b, size_t n)
{
    double sum = 0.0;
    for (size_t i = 0U; i < n; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

static void compare(const rig *p, belief *b, scratch *s, const double *radius)
{
    const hg_polynomial_config *c = &p->config;
    double trace = 0.0, square = 0.0, wide = 0.0, t[ROWS_MAX];
    b->drift = 0.0;
    for (uint8_t j = 0U; j < c->outputs; j++) {
        if (isfinite(radius[j])) {
            trace += s->J[c->lifted + j][c->lifted + j];
            square += s->r[j] * s->r[j];
            wide += (radius[j] <= (double)c->fresh[j]) ? 0.0 : (radius[j] * radius[j]);
        }
        b->drift = fmax(b->drift, b->mean[j] * b->mean[j] * (2.0 - (double)c->weight) / (double)c->weight);
    }
    b->plain = sqrt(square);
    b->threshold = ((double)c->kappa * sqrt(trace)) + sqrt(wide);
    solve(s->S, s->used, c->judged, s->r, t);
    b->joint = 0.0;
    for (uint8_t k = 0U; k < c->judged; k++) {
        b->joint += s->used[k] ? (t[k] * s->r[k]) : 0.0;
    }
}

static void update(const rig *p, belief *b, scratch *s, double bound, double wider, const double *before)
{
    const hg_polynomial_config *c = &p->config;
    const size_t lifted = c->lifted;
    double K[WIDE_MAX][ROWS_MAX], Kx[STATES_MAX][ROWS_MAX], of_J[WIDE_MAX][ROWS_MAX], of_P[STATES_MAX][ROWS_MAX];
    double z[WIDE_MAX] = {1.0};
    double left = 0.0;
    double w = wider;
    bool   none = false; /* a variance below 0 */
    b->held = false;
    for (size_t a = 0U; a < lifted; a++) {
        for (size_t k = 0U; k < c->measured; k++) {
            of_J[a][k] = s->used[k] ? (w * s->J[a][lifted + k]) : 0.0;
        }
        solve(s->S, s->used, c->measured, of_J[a], K[a]);
        none = none || (((w * s->J[a][a]) - dot(K[a], of_J[a], c->measured)) < -(1e-5 * w * s->J[a][a]));
    }
    for (size_t a = 0U; a < c->states; a++) {
        for (size_t k = 0U; k < c->measured; k++) {
            of_P[a][k] = 0.0;
            for (size_t i = 0U; s->used[k] && (i < lifted); i++) {
                of_P[a][k] += w * bound * b->P[a][i] * s->A[lifted + k][i + 1U];
            }
        }
        solve(s->S, s->used, c->measured, of_P[a], Kx[a]);
        const double alone = bound * b->P[a][a];
        const double after = (w * alone) - dot(Kx[a], of_P[a], c->measured);
        none = none || (after < -(1e-5 * alone));
        left += (alone > 0.0) ? (after / alone) : 1.0;
    }
    if (none || ((w > 1.0) && (left >= (double)c->states))) {
        b->held = true;
        memset(K, 0, sizeof K);
        memset(Kx, 0, sizeof Kx);
        w = 1.0;
    }
    for (size_t a = 0U; a < c->states; a++) {
        b->x[a] = before[a] + b->z[a + 1U] + dot(Kx[a], s->r, c->measured);
        for (size_t d = 0U; d < c->states; d++) {
            const double sum = (w * bound * b->P[a][d]) - dot(Kx[a], of_P[d], c->measured);
            b->Px[a][d] = (a == d) ? fmax(sum, 0.0) : sum;
        }
    }
    for (size_t a = 0U; a < lifted; a++) {
        z[a + 1U] = dot(s->A[a], b->z, lifted + 1U) + dot(K[a], s->r, c->measured);
    }
    for (size_t a = 0U; a < lifted; a++) {
        for (size_t d = 0U; d < lifted; d++) {
            const double sum = (w * s->J[a][d]) - dot(K[a], of_J[d], c->measured);
            b->P[a][d] = (a == d) ? fmax(sum, 0.0) : sum;
        }
    }
    memcpy(b->z, z, sizeof z);
}

static void reference_step(const rig *p, belief *b, const double *y, const double *radius)
{
    static scratch s;
    double before[STATES_MAX];
    memset(&s, 0, sizeof s);
    memcpy(before, b->c, sizeof before);
    auxiliary(p, b, &s, y, radius);
    predict_auxiliary(p, b, &s);
    moments(p, b, &s);
    const double bound = joint_covariance(p, b, &s);
    const double wider = residuals(p, b, &s, radius);
    compare(p, b, &s, radius);
    update(p, b, &s, bound, wider, before);
}

/* ---- both, side by side ---- */

static size_t place_of(size_t a, size_t b)
{
    return (a > b) ? (((a * (a + 1U)) / 2U) + b) : (((b * (b + 1U)) / 2U) + a);
}

static void take_over(const rig *p, belief *b)
{
    const hg_polynomial *self = &p->self;
    const size_t n = p->config.states;
    const size_t lifted = p->config.lifted;
    for (size_t a = 0U; a < n; a++) {
        b->c[a] = (double)self->c[a];
        for (size_t d = 0U; d < n; d++) {
            b->Pe[a][d] = (double)self->Pe[(a * n) + d];
        }
    }
    for (size_t a = 0U; a <= lifted; a++) {
        b->z[a] = (double)self->z[a];
        for (size_t d = 0U; d <= lifted; d++) {
            b->M[a][d] = (double)self->M[place_of(a, d)];
            if ((a < lifted) && (d < lifted)) {
                b->P[a][d] = (double)self->P[place_of(a, d)];
            }
        }
    }
    for (size_t j = 0U; j < p->config.outputs; j++) {
        b->mean[j] = (double)self->mean[j];
    }
}

/* Relative to the roots of the diagonals, as an entry of a covariance is. */
#define assert_entry(expected, actual, da, db) assert_near((expected), (actual), tolerance *(0.01 + sqrt(fabs((da) * (db)))))

static void check(const rig *p, const belief *b, double tolerance)
{
    const hg_polynomial *self = &p->self;
    const size_t n = p->config.states;
    const size_t lifted = p->config.lifted;
    for (size_t a = 0U; a < n; a++) {
        assert_near(b->x[a], self->x[a], tolerance * (1.0 + fabs(b->x[a])));
        assert_near(b->ekf[a], self->ekf[a], tolerance * (1.0 + fabs(b->ekf[a])));
        assert_near(b->c[a], self->c[a], tolerance * (1.0 + fabs(b->c[a])));
        for (size_t d = 0U; d < n; d++) {
            assert_entry(b->Px[a][d], self->Px[(a * n) + d], b->Px[a][a], b->Px[d][d]);
            assert_entry(b->Pe[a][d], self->Pe[(a * n) + d], b->Pe[a][a], b->Pe[d][d]);
        }
    }
    for (size_t a = 0U; a <= lifted; a++) {
        assert_near(b->z[a], self->z[a], tolerance * (1.0 + fabs(b->z[a])));
        for (size_t d = 0U; d <= lifted; d++) {
            assert_entry(b->M[a][d], self->M[place_of(a, d)], b->M[a][a], b->M[d][d]);
            if ((a < lifted) && (d < lifted)) {
                assert_entry(b->P[a][d], self->P[place_of(a, d)], b->P[a][a], b->P[d][d]);
            }
        }
    }
    assert_near(b->plain, self->judgement.plain, tolerance * (1.0 + b->plain));
    assert_near(b->threshold, self->judgement.threshold, tolerance * (1.0 + b->threshold));
    assert_near(b->joint, self->judgement.joint, 5.0 * tolerance * (1.0 + b->joint));
    assert_near(b->drift, self->judgement.drift, tolerance * (1.0 + b->drift));
}

typedef enum {
    USUAL   = 1,
    TURNED  = 2, /* the first output with the other sign */
    CERTAIN = 3  /* the last state is known and stays so, and no output is needed for it */
} kind;

/* x1+ = 0.5 x1 + 0.25 x2 - 0.1 x1^3, x2+ = -0.25 x1 + 0.5 x2 + 0.1 x1 x2, x3+ = 0.25 x3 + 0.2 x1; y1 = x1 + 0.2 x2^2, y2 = x2 - 0.3 x1 + 0.1 */
static void set_up(rig *p, uint8_t n, uint8_t outputs, uint8_t mu, bool bounded, kind which)
{
    static const uint8_t of_first[] = {0U, 1U, 2U}, none = HG_POLYNOMIAL_NONE;
    memset(p, 0, sizeof *p);
    p->normal = mu > 2U; /* its skewed noise has no moments beyond the fourth */
    p->config = (hg_polynomial_config){.states = n, .outputs = outputs, .degree = mu, .bounded = bounded, .f = {3U, p->f_end, p->f, p->f_factor},
        .h = {3U, p->h_end, p->h, p->h_factor}, .start = p->start, .product = p->product, .parent = p->parent, .factor = p->factor, .noise = p->noise,
        .moment = p->moment, .mean = p->mean, .covariance = p->covariance, .cut_moment = p->cut_moment, .cut_state = p->cut_state, .cut_scale = p->cut_scale,
        .box = p->box, .reach = R(3), .x0 = p->x0, .P0 = p->P0, .M0 = p->M0, .Q = p->Q, .R = p->r, .range = p->range, .fresh = p->fresh, .kappa = R(4.47),
        .joint = R(20), .weight = R(0.125), .drift = R(9)};
    const struct {
        uint8_t row, factor[3];
        double  coefficient;
    } f[] = {{0U, {of_first[0], none, none}, 0.5}, {0U, {of_first[1], none, none}, 0.25}, {0U, {0U, 0U, 0U}, -0.1}, {1U, {0U, none, none}, -0.25}, {1U, {1U, none, none}, 0.5},
             {1U, {0U, 1U, none}, 0.1}, {2U, {2U, none, none}, 0.25}, {2U, {0U, none, none}, 0.2}},
      h[] = {{0U, {0U, none, none}, 1.0}, {0U, {1U, 1U, none}, 0.2}, {1U, {1U, none, none}, 1.0}, {1U, {0U, none, none}, -0.3}, {1U, {none, none, none}, 0.1}};
    uint16_t terms = 0U;
    for (size_t i = 0U; i < COUNT(f); i++) {
        bool there = (f[i].row < n) && ((f[i].factor[0] < n) || (f[i].factor[0] == none)) && ((f[i].factor[1] < n) || (f[i].factor[1] == none));
        there = there && ((which != CERTAIN) || (f[i].row != (n - 1U)) || (f[i].factor[0] == (n - 1U)));
        if (there) {
            p->f[terms] = R(f[i].coefficient);
            memcpy(&p->f_factor[3U * terms], f[i].factor, 3U);
            terms++;
            p->f_end[f[i].row] = terms;
        }
    }
    terms = 0U;
    for (size_t i = 0U; i < COUNT(h); i++) {
        bool there = (h[i].row < outputs) && ((h[i].factor[0] < n) || (h[i].factor[0] == none)) && ((h[i].factor[1] < n) || (h[i].factor[1] == none));
        there = there && ((which != CERTAIN) || (h[i].factor[0] != (n - 1U)));
        if (there) {
            p->h[terms] = R(((which == TURNED) && (h[i].row == 0U)) ? -h[i].coefficient : h[i].coefficient);
            memcpy(&p->h_factor[3U * terms], h[i].factor, 3U);
            terms++;
            p->h_end[h[i].row] = terms;
        }
    }
    for (uint8_t l = 0U; l < n; l++) {
        p->x0[l] = R(0.25 - (0.5 * l));
        p->P0[(l * n) + l] = R(0.5 + (0.25 * l));
        p->Q[l] = R(0.125 + (0.0625 * l));
        p->box[l] = R(0.75 + l);
    }
    for (uint8_t j = 0U; j < outputs; j++) {
        p->r[j] = R(0.25 + (0.25 * j));
        p->range[j] = R(1000);
        p->fresh[j] = R(0.0625 * j);
    }
    if (which == CERTAIN) {
        p->P0[(n * n) - 1U] = R(0);
        p->Q[n - 1U] = R(0);
    }
    make_tables(p);
    /* What stands behind a list, and in places that nobody reads, would be seen. */
    p->r[outputs] = R(7);
    p->Q[n] = R(7);
    p->box[n] = R(7);
    p->noise[p->config.lower] = (uint8_t)((mu > 1U) ? (1U + n + outputs) : (1U + n)); /* of w, or its square, which has a mean */
    p->cut_scale[p->config.ring - p->config.lower] = R(7);
    p->cut_state[p->config.ring - p->config.lower] = none;
    for (uint8_t k = 0U; k < outputs; k++) {
        p->factor[p->config.lifted + k] = (uint8_t)((k + 1U) % outputs);
    }
    if (!bounded) {
        p->config.cut_moment = NULL;
        p->config.cut_state = NULL;
        p->config.cut_scale = NULL;
        p->config.box = NULL;
        p->config.reach = R(0);
    }
    arm(p->memory, REALS_MAX);
    assert_status(HG_OK, hg_polynomial_start(&p->self, &p->config, p->memory, REALS_MAX));
}

static void every_step_is_that_of_the_equations(void **state)
{
    (void)state;
    static const struct {
        uint8_t n, outputs, mu;
        bool    bounded;
        kind    which;
    } sizes[] = {{2U, 2U, 2U, false, USUAL}, {2U, 2U, 2U, true, USUAL},  {1U, 2U, 3U, false, USUAL},  {2U, 1U, 3U, true, USUAL},   {3U, 2U, 1U, false, USUAL},
                 {3U, 2U, 1U, true, USUAL},  {1U, 1U, 1U, true, USUAL},  {1U, 1U, 3U, true, USUAL},   {1U, 1U, 1U, true, TURNED},  {2U, 2U, 2U, true, TURNED},
                 {1U, 1U, 2U, true, TURNED}, {2U, 1U, 1U, true, TURNED}, {2U, 2U, 2U, true, CERTAIN}, {2U, 1U, 1U, true, CERTAIN}, {3U, 2U, 1U, false, CERTAIN}};
    static const double radii[] = {0.0, 0.03125, 0.25, 1.0, 30.0, (double)INFINITY};
    uint32_t seed = seed_of_run(51U);
    uint32_t held = 0U;
    for (size_t i = 0U; i < COUNT(sizes); i++) {
        rig *p = fresh(0U);
        set_up(p, sizes[i].n, sizes[i].outputs, sizes[i].mu, sizes[i].bounded, sizes[i].which);
        const uint32_t length = hg_polynomial_reals(sizes[i].n, sizes[i].outputs, sizes[i].mu, sizes[i].bounded);
        for (uint32_t k = 0U; k < 40U; k++) {
            belief b;
            double y[OUTPUTS_MAX], radius[OUTPUTS_MAX];
            hg_real y_of[OUTPUTS_MAX], radius_of[OUTPUTS_MAX];
            for (size_t j = 0U; j < sizes[i].outputs; j++) {
                y[j] = draw_between(&seed, -128, 128) / 64.0;
                radius[j] = radii[(draw_between(&seed, 0, 1) == 0) ? 0U : (uint32_t)draw_between(&seed, 0, (int32_t)COUNT(radii) - 1)];
                y_of[j] = R(y[j]);
                radius_of[j] = R(radius[j]);
            }
            if (((k % 8U) == 3U) && (sizes[i].mu == 1U)) { /* as rounding may leave them: they count as 0 where a root is drawn */
                p->self.M[2] = R(-1e-6);
            } else if (((k % 8U) == 5U) && (p->config.lifted == 1U)) {
                p->self.P[0] = R(-1e-6);
            } else {
                /* as they come */
            }
            memset(&b, 0, sizeof b);
            take_over(p, &b);
            const uint16_t before = p->self.held;
            assert_status(HG_OK, hg_polynomial_step(&p->self, y_of, radius_of));
            assert_untouched(&p->memory[length], 16U);
            reference_step(p, &b, y, radius);
            assert_int_equal(b.held, p->self.held != before);
            held += b.held ? 1U : 0U;
            check(p, &b, 5e-4);
        }
        assert_count(0U, p->self.restarts);
        assert_count(0U, p->self.dropped);
    }
    assert_true(held > 5U);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_step_is_that_of_the_equations),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
