#include "hullguard/linalg.h"

#include <stddef.h>

void hg_linalg_apply(const hg_matrix *m, const hg_real *x, const hg_matrix *n, const hg_real *y, hg_real *out)
{
    const hg_real *a = m->data;
    const hg_real *b = n->data;
    for (uint8_t i = 0U; i < m->rows; i++) {
        hg_acc sum = hg_acc_zero();
        for (uint8_t j = 0U; j < m->cols; j++) {
            sum = hg_acc_mac(sum, a[j], x[j]);
        }
        for (uint8_t j = 0U; j < n->cols; j++) {
            sum = hg_acc_mac(sum, b[j], y[j]);
        }
        out[i] = hg_acc_real(sum, m->exponent);
        a = &a[m->cols];
        b = &b[n->cols];
    }
}

bool hg_linalg_fits(const hg_matrix *m, const hg_matrix *n, uint8_t rows, uint8_t m_cols, uint8_t n_cols)
{
    const bool shapes = (m->rows == rows) && (n->rows == rows) && (m->cols == m_cols) && (n->cols == n_cols);
    return shapes && (m->exponent == n->exponent) && hg_exponent_valid(m->exponent) && (m->data != NULL) && (n->data != NULL);
}

bool hg_linalg_finite(const hg_real *x, uint16_t n)
{
    bool finite = true;
    for (uint16_t i = 0U; i < n; i++) {
        finite = finite && hg_real_finite(x[i]);
    }
    return finite;
}
