/** @file
 *  The two matrix operations an observer needs. Matrices are constant, row-major, and carry the power of two they are scaled by
 *  (exponent; 0 for the float types). Reentrant, safe in interrupt context, no allocation. */
#ifndef HULLGUARD_LINALG_H
#define HULLGUARD_LINALG_H

#include "hullguard/real.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A constant matrix. */
typedef struct {
    uint8_t        rows;     /* 0 .. 255 */
    uint8_t        cols;     /* 0 .. 255 */
    int8_t         exponent; /* the matrix is data * 2^exponent; hg_exponent_valid() */
    const hg_real *data;     /* rows x cols, row-major */
} hg_matrix;

/** out = m x + n y, the one shape behind state update and residual (platoon, section 3).
 *  @param[in]  m    rows x m.cols
 *  @param[in]  x    [m.cols]
 *  @param[in]  n    rows x n.cols, same rows and exponent as m
 *  @param[in]  y    [n.cols]
 *  @param[out] out  [m.rows]; must not overlap x or y
 *  Summed in index order, first m then n, so that every target rounds alike. Cost: rows (m.cols + n.cols) multiplications. */
void hg_linalg_apply(const hg_matrix *m, const hg_real *x, const hg_matrix *n, const hg_real *y, hg_real *out);

/* Rows that are summed side by side share what is read of the vector: four where that many sums find room in registers. */
typedef struct {
    hg_acc a; /* of the first row */
    hg_acc b; /* the second */
    hg_acc c; /* the third */
    hg_acc d; /* the fourth */
} hg_linalg_sums;

/* Four empty sums. */
static inline hg_linalg_sums hg_linalg_no_sums(void)
{
    hg_linalg_sums none;
    none.a = hg_acc_zero();
    none.b = hg_acc_zero();
    none.c = hg_acc_zero();
    none.d = hg_acc_zero();
    return none;
}

/* Four rows of a table, the first at `row`, times x [cols]: added to four sums. */
static inline void hg_linalg_add_four(hg_linalg_sums *sum, const hg_real *row, const hg_real *x, uint8_t cols)
{
    const hg_real *a = row;
    const hg_real *b = &row[cols];
    const hg_real *c = &b[cols];
    const hg_real *d = &c[cols];
    for (uint8_t j = 0U; j < cols; j++) {
        sum->a = hg_acc_mac(sum->a, a[j], x[j]);
        sum->b = hg_acc_mac(sum->b, b[j], x[j]);
        sum->c = hg_acc_mac(sum->c, c[j], x[j]);
        sum->d = hg_acc_mac(sum->d, d[j], x[j]);
    }
}

/* The same for two rows and the first two sums. */
static inline void hg_linalg_add_two(hg_linalg_sums *sum, const hg_real *row, const hg_real *x, uint8_t cols)
{
    const hg_real *b = &row[cols];
    for (uint8_t j = 0U; j < cols; j++) {
        sum->a = hg_acc_mac(sum->a, row[j], x[j]);
        sum->b = hg_acc_mac(sum->b, b[j], x[j]);
    }
}

/* The same for one row: the sum with it. */
static inline hg_acc hg_linalg_add_one(hg_acc sum, const hg_real *row, const hg_real *x, uint8_t cols)
{
    hg_acc total = sum;
    for (uint8_t j = 0U; j < cols; j++) {
        total = hg_acc_mac(total, row[j], x[j]);
    }
    return total;
}

/* hg_linalg_apply() for who knows the sizes. */
static inline void hg_linalg_rows(const hg_matrix *m, const hg_real *x, const hg_matrix *n, const hg_real *y, hg_real *out, uint8_t rows,
                                  uint8_t m_cols, uint8_t n_cols)
{
    const hg_real *a = m->data;
    const hg_real *b = n->data;
    uint8_t i = 0U;
    while ((HG_REAL_Q31 == 0) && ((uint8_t)(rows - i) >= 4U)) {
        hg_linalg_sums sum = hg_linalg_no_sums();
        hg_linalg_add_four(&sum, a, x, m_cols);
        hg_linalg_add_four(&sum, b, y, n_cols);
        out[i] = hg_acc_real(sum.a, m->exponent);
        out[i + 1U] = hg_acc_real(sum.b, m->exponent);
        out[i + 2U] = hg_acc_real(sum.c, m->exponent);
        out[i + 3U] = hg_acc_real(sum.d, m->exponent);
        a = &a[4U * (uint16_t)m_cols];
        b = &b[4U * (uint16_t)n_cols];
        i += 4U;
    }
    while ((uint8_t)(rows - i) >= 2U) {
        hg_linalg_sums sum = hg_linalg_no_sums();
        hg_linalg_add_two(&sum, a, x, m_cols);
        hg_linalg_add_two(&sum, b, y, n_cols);
        out[i] = hg_acc_real(sum.a, m->exponent);
        out[i + 1U] = hg_acc_real(sum.b, m->exponent);
        a = &a[2U * (uint16_t)m_cols];
        b = &b[2U * (uint16_t)n_cols];
        i += 2U;
    }
    if (i < rows) {
        out[i] = hg_acc_real(hg_linalg_add_one(hg_linalg_add_one(hg_acc_zero(), a, x, m_cols), b, y, n_cols), m->exponent);
    }
}

/** Do m and n fit hg_linalg_apply(): same rows and valid exponent, these dimensions, both tables present? Constant time. */
bool hg_linalg_fits(const hg_matrix *m, const hg_matrix *n, uint8_t rows, uint8_t m_cols, uint8_t n_cols);

/** Are all n numbers finite? Cost: n subtractions and additions. */
static inline bool hg_linalg_finite(const hg_real *x, uint16_t n)
{
    hg_real defects = HG_REAL_ZERO;
    for (uint16_t i = 0U; i < n; i++) {
        defects += hg_real_defect(x[i]);
    }
    return (defects >= HG_REAL_ZERO) && (defects <= HG_REAL_ZERO); /* false for NaN */
}

/** Is a list of n places 0, 1, .., as HG_ONLY_IN_ORDER says? Cost: n comparisons. */
static inline bool hg_linalg_in_order(const uint8_t *place, uint8_t n)
{
    bool ordered = true;
    for (uint8_t i = 0U; i < n; i++) {
        ordered = ordered && (place[i] == i);
    }
    return ordered;
}

#if HG_REAL_F32 || HG_REAL_F64
/** The square root of a positive number, the same bits on every target; of 0 a number below 1e-20. Constant time: 75 scalings by 4 (float64: 540), 6 divisions. */
hg_real hg_linalg_root(hg_real x);
#endif

#ifdef __cplusplus
}
#endif

#endif
