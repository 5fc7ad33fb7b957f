#include "hullguard/linalg.h"

#include <stddef.h>

/* Sums of two rows, which share what is read of the vector. */
typedef struct {
    hg_acc first;
    hg_acc second;
} hg_pair;

static inline void add_rows(hg_pair *sum, const hg_real *first, const hg_real *second, const hg_real *x, uint8_t cols)
{
    for (uint8_t j = 0U; j < cols; j++) {
        sum->first = hg_acc_mac(sum->first, first[j], x[j]);
        sum->second = hg_acc_mac(sum->second, second[j], x[j]);
    }
}

void hg_linalg_apply(const hg_matrix *m, const hg_real *x, const hg_matrix *n, const hg_real *y, hg_real *out)
{
    const hg_real *a = m->data;
    const hg_real *b = n->data;
    for (uint16_t i = 0U; i < m->rows; i += 2U) { /* 16 bits: 255 rows are passed by 256 */
        /* An odd last row goes twice, once for nothing: the cost does not depend on where it is. */
        const bool two = (i + 1U) < m->rows;
        hg_pair sum = {.first = hg_acc_zero(), .second = hg_acc_zero()};
        add_rows(&sum, a, two ? &a[m->cols] : a, x, m->cols);
        add_rows(&sum, b, two ? &b[n->cols] : b, y, n->cols);
        out[i] = hg_acc_real(sum.first, m->exponent);
        if (two) {
            out[i + 1U] = hg_acc_real(sum.second, m->exponent);
            a = &a[2U * (uint16_t)m->cols];
            b = &b[2U * (uint16_t)n->cols];
        }
    }
}

bool hg_linalg_fits(const hg_matrix *m, const hg_matrix *n, uint8_t rows, uint8_t m_cols, uint8_t n_cols)
{
    const bool shapes = (m->rows == rows) && (n->rows == rows) && (m->cols == m_cols) && (n->cols == n_cols);
    return shapes && (m->exponent == n->exponent) && hg_exponent_valid(m->exponent) && (m->data != NULL) && (n->data != NULL);
}

bool hg_linalg_finite(const hg_real *x, uint16_t n)
{
    hg_real defects = HG_REAL_ZERO;
    for (uint16_t i = 0U; i < n; i++) {
        defects += hg_real_defect(x[i]);
    }
    return (defects >= HG_REAL_ZERO) && (defects <= HG_REAL_ZERO); /* false for NaN */
}
