/** @file
 *  The two matrix operations an observer needs. Matrices are constant, row-major, and carry the power of two they are scaled by
 *  (exponent; 0 for the float types). Reentrant, safe in interrupt context, no allocation. */
#ifndef HULLGUARD_LINALG_H
#define HULLGUARD_LINALG_H

#include "hullguard/real.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    uint8_t        rows;
    uint8_t        cols;
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

/** Do m and n fit hg_linalg_apply(): same rows and valid exponent, these dimensions, both tables present? Constant time. */
bool hg_linalg_fits(const hg_matrix *m, const hg_matrix *n, uint8_t rows, uint8_t m_cols, uint8_t n_cols);

/** Are all n numbers finite? Cost: n subtractions and additions. */
bool hg_linalg_finite(const hg_real *x, uint16_t n);

#if HG_REAL_F32 || HG_REAL_F64
/** The square root of a positive number, the same bits on every target; of 0 a number below 1e-20. Constant time: 75 scalings by 4 (float64: 540), 6 divisions. */
hg_real hg_linalg_root(hg_real x);
#endif

#ifdef __cplusplus
}
#endif

#endif
