/** @file
 *  The threshold by a zonotope, an alternative to hull.h with a state of fixed size: the set in which e = T x - z of a residual generator
 *  lies without a fault, moved on sample by sample (methods, platoon, section 5). In modal coordinates e = S e~ it is
 *
 *      Z(k+1) = reduce([Lam Z, P diag(radius), B'], q)        J = |Q Z| 1 + |direct| radius + bias
 *
 *  with Lam = S^-1 G' S block diagonal, P the event errors' and B' the disturbances' columns, Q the residuals' rows. Disturbances and the
 *  initial set do not depend on data: they may be columns of Z, as published, or, much tighter for the same q, rows of the bias tables.
 *
 *  The set is kept as columns and, around their sum, a spread: a disc for each block of Lam with decay > 0 (two rows, a complex pair),
 *  an interval for each row of the others. The spread holds what has no direction: rounding, table mismatch, what happened before the set
 *  was last forgotten and, with HG_REDUCTION_BALL, the columns that had to go. Discs shrink by the norm of their block: a box would have
 *  to be boxed again after each turn, and grows without bound where |Lam| has a row sum above 1 and q is small.
 *
 *  Sound with HG_REDUCTION_BOX and _BALL: J is never below the exact sum of section 6, in float32 and float64. Each rounding is covered:
 *  - Lam c, S itself, and the generator's own arithmetic err in a row by at most a share of the sum of all magnitudes, size(k) =
 *    sum |c|1 + sum spread: growth[] size goes into the spread each step. It includes what the sums of columns and size itself lose;
 *  - products that underflow err by less than always[], which goes in as well;
 *  - decay[], outer[], direct[] and bias are rounded up, and these, with output[], are made larger by more than any sum of so many terms
 *    can lose; output_growth[] size covers that output[] is rounded to nearest.
 *  A set that overflows is forgotten: J is HG_REAL_MAX for `recover` samples, by when even radii of HG_REAL_MAX have shrunk to a part of
 *  always[]; only then do columns entered since count. Not reentrant per instance; safe in interrupt context; no allocation. */
#ifndef HULLGUARD_ZONOTOPE_H
#define HULLGUARD_ZONOTOPE_H

#include "hullguard/hull.h"
#include "hullguard/real.h"
#include "hullguard/status.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What becomes of the columns beyond q. */
typedef enum {
    HG_REDUCTION_TRUNCATE = 1, /* dropped, all but the q largest in Euclid's norm, as published: NOT an outer bound, it raises false alarms; to compare with */
    HG_REDUCTION_BOX      = 2, /* the q - order for which a box would lose most (|c|1 - |c|inf) stay, order columns box the others */
    HG_REDUCTION_BALL     = 3  /* the q for which a box would lose most stay, the others go into the spread */
} hg_reduction;

typedef struct {                  /* flash: one a generator, generated */
    uint8_t        order;         /* s: rows, 1 .. 255 */
    uint8_t        residuals;     /* 1 .. 255 */
    uint8_t        width;         /* signals read, 0 .. 255 */
    uint8_t        disturbances;  /* columns that enter every sample, 0 .. 255 */
    uint8_t        initial;       /* columns of the set at a start, 0 .. columns + width + disturbances */
    uint8_t        columns;       /* q, 1 .. 255; HG_REDUCTION_BOX: >= order */
    uint8_t        blocks;        /* of Lam, 1 .. order */
    hg_reduction   reduction;
    const uint8_t *signal;        /* [width] their places in the ring's rows */
    const uint8_t *block;         /* [blocks] rows of each, 1 .. order; their sum is order */
    const hg_real *state;         /* the blocks of Lam one after another, each square and row-major */
    const hg_real *input;         /* [width][order] P, one signal's column after another */
    const hg_real *disturbance;   /* [disturbances][order] B', one column after another */
    const hg_real *rest;          /* [initial][order] columns after a start within the initial range */
    const hg_real *moving;        /* [initial][order] columns after a start anywhere in the state range */
    const hg_real *output;        /* [residuals][order] Q */
    const hg_real *outer;         /* [residuals][order] >= 0: of a spread of 1; |Q|, of a disc Euclid's norm and 0 */
    const hg_real *direct;        /* [residuals][width] >= 0 */
    uint16_t       settle;        /* rows of the bias tables, >= 1; the last holds for good */
    const hg_real *bias_rest;     /* [settle][residuals] >= 0: what is at once, or depends on no data, after a start within the initial range */
    const hg_real *bias_moving;   /* [settle][residuals] >= 0: after a start anywhere in the state range */
    const hg_real *decay;         /* [blocks] 0 .. < 1: Euclid's norm of a block of two rows that has a disc; 0 of others */
    const hg_real *always;        /* [order] >= 0: into the spread every sample; of a disc twice the same */
    const hg_real *growth;        /* [order] >= 0: share of size(k) into the spread every sample; of a disc twice the same */
    const hg_real *output_growth; /* [residuals] >= 0: share of size(k) in J */
    uint16_t       recover;       /* samples until a set that overflowed is forgotten; UINT16_MAX: not before a reset */
    uint16_t       ready_rest;    /* samples until the initial state is a small part of J, after a start at rest */
    uint16_t       ready_moving;  /* the same after a start in a moving plant */
} hg_zonotope_config;

typedef struct {                       /* RAM: one a generator */
    const hg_zonotope_config *config;
    hg_real                  *column;  /* [q + fresh][order] */
    hg_real                  *score;   /* [q + fresh] scratch */
    hg_real                  *spread;  /* [order] half width of each interval; of a disc its radius, twice */
    hg_real                  *scratch; /* [order] */
    hg_real                   size;    /* size(k), finite */
    uint16_t                  count;   /* columns in use */
    uint16_t                  lost;    /* samples until a set that overflowed is forgotten */
    uint16_t                  k;       /* samples since the start, saturated */
    hg_start                  how;
} hg_zonotope;

/** Memory of one generator, numbers. fresh = width + disturbances. */
#define HG_ZONOTOPE_REALS(order, columns, fresh) \
    ((((uint32_t)(columns) + (uint32_t)(fresh)) * ((uint32_t)(order) + 1U)) + (2U * (uint32_t)(order)))

/** Are sizes and tables within the ranges above, for a ring of this width? Cost: width + blocks comparisons. */
bool hg_zonotope_valid(const hg_zonotope_config *config, uint8_t ring_width);

/** Begin at the sample after this call.
 *  @param[in] memory  [HG_ZONOTOPE_REALS(order, columns, width + disturbances)], owned by the caller
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_CONFIG    hg_zonotope_valid() says no */
hg_status hg_zonotope_start(hg_zonotope *self, const hg_zonotope_config *config, const hg_ring *ring, hg_start how, hg_real *memory);

/** Begin again. */
void hg_zonotope_reset(hg_zonotope *self, hg_start how);

/** A past sample's radii turn out to have been larger: e(k) may be off by the columns Lam^(lag-1) P increase more.
 *  To be called between the push of the newest sample's radii and hg_zonotope_step() for it, once for each (sample, signals) that is
 *  rewritten, in any order and as often as it turns out larger again; reads no ring. It is then as sound as radii that had been as
 *  large from the start. Samples before the start or the last reset belong to the initial set: lag > samples since then is ignored, and
 *  so is lag 0, which the step reads itself.
 *  @param[in] lag       samples before the newest, >= 1
 *  @param[in] first     first signal, a place in the ring's rows   @param[in] count  signals from there
 *  @param[in] increase  [count] new radius - radius used so far; finite. What is negative counts as 0: a set is never made smaller
 *  Cost: lag x count x sum of block squares multiplications, and a selection as in hg_zonotope_step(). */
void hg_zonotope_widen(hg_zonotope *self, uint8_t lag, uint8_t first, uint8_t count, const hg_real *increase);

/** Threshold of this sample, whose radii are the newest row of the ring; then the set moves on with them.
 *  @param[out] J  [residuals] > 0 where the bias is; HG_REAL_MAX where it is larger
 *  Cost, N = q + width + disturbances: N (residuals order + sum of block squares) multiplications, and for the selection at most
 *  2 N (1 + log2 q) comparisons and half as many swaps of two columns, whatever the data are: it is a heap. */
void hg_zonotope_step(hg_zonotope *self, const hg_ring *ring, hg_real *J);

/** Has the initial state become a small part of J, and is the set a bounded one? */
bool hg_zonotope_ready(const hg_zonotope *self);

#ifdef __cplusplus
}
#endif

#endif
