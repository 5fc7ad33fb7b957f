/** @file
 *  Polynomial filter for faults of nonlinear plants (methods, polynomial): beside the state it estimates the state's Kronecker powers, and so uses the third
 *  and higher moments of the noise, which a Kalman filter cannot. Its gain comes from skewed noise; for a linear plant with normal noise it is the Kalman filter.
 *  Statistical: its thresholds hold with a probability (Chebyshev), not always.
 *
 *      x+ = f(x) + w,  y = h(x) + v,  f and h polynomials, w and v white, independent, without mean, their moments known up to 2 mu          (2.2)
 *
 *  An auxiliary extended Kalman filter gives the point c to expand about. With xi = x - c, nu = (w, v), H = h(c + xi) - h(c) + v and its gain L
 *
 *      xi+ = f(c' + xi - L H) - f(c') + w,   c' = c + L (y - h(c)),   c+ = f(c'),   eta = y - h(c) = H                                      (2.3, form FPF)
 *
 *  is a polynomial in (xi, nu) alone: no measurement is in it, so its moments are unconditional. Its powers to degree mu, X = [xi; xi^2; ..], and those of
 *  eta, Y, have coefficients q; what is linear in X makes A, C, U, V, and
 *
 *      N    = sum over monomials b, b' of nu: Cov(nu^b, nu^b') q_b M q_b',   M = E[1; X][1; X]'
 *      J    = (1 + e) [A; C] P [A; C]' + (1 + 1/e) diag(s^2) + N,   s a bound of what the powers cut off are worth; e and s are 0 in the plain form
 *      r    = Y - C X - V,   K = Jxy Jyy^-1,   X+ = A X + U + K r,   P+ = Jxx - K Jyy K',   M+ = A M A' + .. + N
 *
 *  What is equal in the Kronecker power is kept once (x1 x2 = x2 x1): N = C(n + mu, mu) - 1 lifted states. Three statistics stand side by side:
 *
 *      plain  ||y - its prediction|| > kappa sqrt(tr S11) + ||radius||            the source's J_th; P <= 1 / kappa^2; very conservative
 *      joint  J2^2 = r' S^-1 r over [y; y^2] > its level                          P <= judged / level; for abrupt faults of a sensor
 *      drift  EWMA of the EKF's standardised innovations, squared > its level     for slow and small biases: the better residual keeps less of one
 *
 *  Measurements are (value, radius): |true measurement - value| <= radius. Up to `fresh` the error is part of v's moments. Beyond, the sensor is silent: the
 *  auxiliary filter leaves it out, since c must not depend on what is not known; the lifted filter takes of it what its radius is still worth, with Delta the
 *  bound |Y - Y of the true measurement| <= Delta and J <- (1 + d) J + (1 + 1/d) m diag(0, Delta^2); and leaves it out where its radius is above what is
 *  predicted of it, or where that would not make the state's covariance smaller. The radius counts in the threshold.
 *
 *  Definiteness: Jyy is divided by its diagonal's roots and factored (Cholesky); a component whose pivot is not above HG_POLYNOMIAL_PIVOT says nothing new and is
 *  left out; an update that leaves a negative variance is not made. Both are counted.
 *
 *  Scale the states so that they are O(1) (host: design/polynomial.py). Float only: a fixed-point build leaves this module out. Not reentrant per
 *  instance; safe in interrupt context; no allocation. */
#ifndef HULLGUARD_POLYNOMIAL_H
#define HULLGUARD_POLYNOMIAL_H

#include "hullguard/linalg.h"
#include "hullguard/real.h"
#include "hullguard/status.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Smallest pivot of a covariance divided by its diagonal. */
#if HG_REAL_F64
#define HG_POLYNOMIAL_PIVOT HG_REAL_C(1e-10)
#else
#define HG_POLYNOMIAL_PIVOT HG_REAL_C(1e-5)
#endif

#define HG_POLYNOMIAL_NONE 255U /* no index */

/* Rows of polynomials in the states: sums of terms, each a coefficient times at most `width` states. */
typedef struct {
    uint8_t         width;       /* 1 .. 255 */
    const uint16_t *end;         /* [rows] row i has the terms end[i - 1] .. end[i] - 1 */
    const hg_real  *coefficient; /* [terms] */
    const uint8_t  *factor;      /* terms x width: states, after the last HG_POLYNOMIAL_NONE */
} hg_polynomial_map;

/* Monomials are in graded order: by degree, then the larger exponent of the first variable that differs first. In this order index 1 + i is variable i. */
typedef struct {                   /* flash: generated */
    uint8_t           states;      /* n >= 1 */
    uint8_t           outputs;     /* p >= 1 */
    uint8_t           degree;      /* mu: 1 .. 3 */
    bool              bounded;     /* keep degree mu + 1 for the remainder's bound? */
    uint8_t           lifted;      /* N = C(n + mu, mu) - 1 */
    uint8_t           measured;    /* C(p + mu, mu) - 1; lifted + measured <= 254 */
    uint8_t           judged;      /* of them, how many make J2: C(p + min(mu, 2), min(mu, 2)) - 1 */
    uint8_t           noises;      /* monomials of nu: C(n + p + mu, mu) <= 255 */
    uint16_t          ring;        /* monomials of (xi, w, v): C(2 n + p + mu, mu), bounded mu + 1 in place of mu; C(4 n + 2 p + mu, mu) <= 65535 */
    uint16_t          lower;       /* those of degree <= mu */
    hg_polynomial_map f;           /* n rows */
    hg_polynomial_map h;           /* p rows */
    const uint16_t   *start;       /* [ring + 1] */
    const uint16_t   *product;     /* [start[ring]] product[start[i] + j]: index of monomial i times monomial j, for all j with which it is in the ring */
    const uint8_t    *parent;      /* [lifted + measured] lifted monomial a is monomial parent[a] (of its own kind, counted from 0) */
    const uint8_t    *factor;      /* [lifted + measured]   times variable factor[a]; not read below n, p: those are the variables */
    const uint8_t    *noise;       /* [lower] monomial of nu and */
    const uint8_t    *moment;      /* [lower] monomial of xi, 0 for 1, that this monomial is the product of */
    const hg_real    *mean;        /* [noises] E nu^b */
    const hg_real    *covariance;  /* noises x noises */
    const uint8_t    *cut_moment;  /* [ring - lower] monomial cut off = this one of xi, */
    const uint8_t    *cut_state;   /* [ring - lower]   times this state or HG_POLYNOMIAL_NONE, */
    const hg_real    *cut_scale;   /* [ring - lower]   times one of nu: sqrt(E nu^2b); the three are not read when not bounded */
    const hg_real    *box;         /* [n] > 0 and */
    hg_real           reach;       /* > 0: |xi_l| is at most reach standard deviations, and box[l]; both not read when not bounded */
    const hg_real    *x0;          /* [n] before the first sample: mean, */
    const hg_real    *P0;          /* n x n covariance, and */
    const hg_real    *M0;          /* (N + 1) x (N + 1) E [1; X][1; X]' */
    const hg_real    *Q;           /* [n] variances of w >= 0 */
    const hg_real    *R;           /* [p] of v > 0 */
    const hg_real    *range;       /* [p] > 0: |y| is at most this, or the sample is refused */
    const hg_real    *fresh;       /* [p] >= 0: radius up to which the value is a measurement */
    hg_real           kappa;       /* > 0 */
    hg_real           joint;       /* > 0: level of J2^2 */
    hg_real           weight;      /* of one sample in the EWMA, 0 < weight <= 1 */
    hg_real           drift;       /* > 0: level of its square, in its own variances */
} hg_polynomial_config;

/** Monomials of so many variables up to a degree: C(variables + degree, degree), or UINT32_MAX when it does not fit. Cost: degree divisions. */
uint32_t hg_polynomial_count(uint32_t variables, uint32_t degree);

/** Numbers of RAM; UINT32_MAX for a size that the configuration cannot express. */
uint32_t hg_polynomial_reals(uint8_t states, uint8_t outputs, uint8_t degree, bool bounded);

/** Numbers of a symmetric matrix of so many rows. */
#define HG_POLYNOMIAL_HALF(rows) (((rows) * ((rows) + 1U)) / 2U)

/** Numbers that two phases of a step share: polynomials of the states first, then [U A; V C] and J. */
#define HG_POLYNOMIAL_BEFORE(states, ring) (((uint32_t)(states) + 1U) * (uint32_t)(ring))
#define HG_POLYNOMIAL_AFTER(lifted, rows) (((rows) * ((uint32_t)(lifted) + 1U)) + HG_POLYNOMIAL_HALF(rows))
#define HG_POLYNOMIAL_LARGER(a, b) (((a) > (b)) ? (a) : (b))

/** The same as a constant, for static memory: lifted, measured and ring as in the configuration. */
#define HG_POLYNOMIAL_REALS(states, outputs, lifted, measured, ring) \
    (((uint32_t)(states) * ((2U * (uint32_t)(states)) + (uint32_t)(outputs) + 3U)) + (4U * (uint32_t)(outputs)) + \
     HG_POLYNOMIAL_HALF((uint32_t)(lifted)) + HG_POLYNOMIAL_HALF((uint32_t)(lifted) + 1U) + (2U * ((uint32_t)(lifted) + 1U)) + \
     (((uint32_t)(lifted) + (uint32_t)(measured)) * ((uint32_t)(ring) + 2U)) + ((uint32_t)(measured) * ((uint32_t)(measured) + 4U)) + \
     HG_POLYNOMIAL_LARGER(HG_POLYNOMIAL_BEFORE(states, ring), HG_POLYNOMIAL_AFTER(lifted, (uint32_t)(lifted) + (uint32_t)(measured))))

/* Which statistic is above its level: bits. */
#define HG_POLYNOMIAL_PLAIN 1U
#define HG_POLYNOMIAL_JOINT 2U
#define HG_POLYNOMIAL_DRIFT 4U

typedef struct {             /* of the last sample; what is beyond a number is HG_REAL_MAX */
    hg_real plain;           /* ||r||, measurement units, of the outputs there are */
    hg_real threshold;       /* kappa sqrt(tr S11) + ||radius|| */
    hg_real joint;           /* J2^2 */
    hg_real drift;           /* the largest of all outputs */
    uint8_t above;           /* HG_POLYNOMIAL_* bits */
} hg_polynomial_judgement;

typedef struct {                         /* RAM; half: the lower half of a symmetric matrix of so many rows, row after row */
    const hg_polynomial_config *config;
    hg_real                *x;           /* [n] estimate of the last sample, with its measurement */
    hg_real                *Px;          /* n x n, its covariance */
    hg_real                *ekf;         /* [n] the auxiliary filter's estimate of it */
    hg_real                *c;           /* [n] point of expansion for the next sample and */
    hg_real                *Pe;          /* n x n, its covariance by the auxiliary filter */
    hg_real                *z;           /* [N + 1] prediction of [1; X], */
    hg_real                *P;           /* half N, its covariance, and */
    hg_real                *M;           /* half N + 1, unconditional second moments */
    hg_real                *mean;        /* [p] EWMA */
    hg_real                *eta;         /* [p], */
    hg_real                *radius;      /* [p], */
    hg_real                *width;       /* [p], */
    hg_real                *L;           /* n x p, */
    hg_real                *slack;       /* [N + measured], */
    hg_real                *weigh;       /* [N + measured], */
    hg_real                *next;        /* [N + 1], */
    hg_real                *root;        /* measured x measured, */
    hg_real                *scale;       /* [measured], */
    hg_real                *r;           /* [measured], */
    hg_real                *t;           /* [measured], */
    hg_real                *Delta;       /* [measured], */
    hg_real                *poly;        /* (N + measured) x ring: powers of xi+, then of eta; then in their place */
    hg_real                *AP;          /* (N + measured) x N, */
    hg_real                *gain;        /* N x measured, */
    hg_real                *filtered;    /* n x measured, */
    hg_real                *shift;       /* n x ring, */
    hg_real                *term;        /* [ring], and then in the place of these two */
    hg_real                *A;           /* (N + measured) x (N + 1) [U A; V C], */
    hg_real                *J;           /* half N + measured: scratch */
    hg_polynomial_judgement judgement;
    uint16_t                dropped;     /* components left out because of their pivot, */
    uint16_t                held;        /* updates not made, and */
    uint16_t                restarts;    /* times the state was not finite; all saturate */
} hg_polynomial;

/** Are sizes and tables within the ranges above? Cost: p + ring comparisons. */
bool hg_polynomial_valid(const hg_polynomial_config *config);

/** Begin: the prediction for the first sample is x0, P0.
 *  @param[in] memory  [length], owned by the caller
 *  @retval HG_OK          ready for hg_polynomial_step()
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_CONFIG    hg_polynomial_valid() says no
 *  @retval HG_E_SIZE      length is below HG_POLYNOMIAL_REALS() */
hg_status hg_polynomial_start(hg_polynomial *self, const hg_polynomial_config *config, hg_real *memory, uint32_t length);

/** Begin again; the counters go on. */
void hg_polynomial_reset(hg_polynomial *self);

/** One sample: x, Px, ekf and judgement are of it, everything else is the prediction for the next.
 *  @param[in] y       [p]
 *  @param[in] radius  [p] >= 0, or infinity: nothing is known of this output, and its y is not read
 *  @retval HG_OK          done
 *  @retval HG_E_NUMERIC   a value that is not finite or out of range, or a radius below 0 or NaN: nothing changed; or the state was not finite any more:
 *                         it has begun again (restarts has counted), and nothing is above its level
 *  Cost, multiplications: for N, N + measured of every pair of the lower monomials whose parts of the noise are correlated, and lower (N + measured)^2 / 2; for the powers at
 *  most start[ring] of every row and of every factor of f and h; for J and M+ about 2 (N + measured) N^2. */
hg_status hg_polynomial_step(hg_polynomial *self, const hg_real *y, const hg_real *radius);

#ifdef __cplusplus
}
#endif

#endif
