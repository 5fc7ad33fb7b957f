#include "hullguard/linalg.h"

#include <stddef.h>

/* Sums of two rows, which share what is read of the vector. */
typedef struct {
    hg_acc first;
    hg_acc second;
} hg_rows;

/* Two rows from here on. Returns the next ones. */
static inline const hg_real *add_rows(hg_rows *sum, const hg_real *first, const hg_real *x, uint8_t cols)
{
    const hg_real *upper = first;
    const hg_real *const end = &first[cols];
    const hg_real *lower = end;
    const hg_real *value = x;
    /* deviation: misra-c2012-14.1: what is counted is pointers, whatever they point at */
    /* cppcheck-suppress misra-c2012-14.1 */
    while (upper != end) {
        sum->first = hg_acc_mac(sum->first, *upper, *value);
        sum->second = hg_acc_mac(sum->second, *lower, *value);
        upper++;
        lower++;
        value++;
    }
    return lower;
}

static inline hg_acc add_row(hg_acc sum, const hg_real *row, const hg_real *x, uint8_t cols)
{
    hg_acc total = sum;
    for (uint8_t j = 0U; j < cols; j++) {
        total = hg_acc_mac(total, row[j], x[j]);
    }
    return total;
}

void hg_linalg_apply(const hg_matrix *m, const hg_real *x, const hg_matrix *n, const hg_real *y, hg_real *out)
{
    const hg_real *a = m->data;
    const hg_real *b = n->data;
    const uint8_t rows = m->rows;
    uint8_t i = 0U;
    while ((uint8_t)(i + 1U) < rows) {
        hg_rows sum = {.first = hg_acc_zero(), .second = hg_acc_zero()};
        a = add_rows(&sum, a, x, m->cols);
        b = add_rows(&sum, b, y, n->cols);
        out[i] = hg_acc_real(sum.first, m->exponent);
        out[i + 1U] = hg_acc_real(sum.second, m->exponent);
        i += 2U;
    }
    if (i < rows) {
        out[i] = hg_acc_real(add_row(add_row(hg_acc_zero(), a, x, m->cols), b, y, n->cols), m->exponent);
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

#if HG_REAL_F32 || HG_REAL_F64

#if HG_REAL_F64 /* scalings by 4 that take any number to 1 .. 4 */
#define SCALINGS 540U
#else
#define SCALINGS 75U
#endif

/* Powers of 4 off, which is exact, then Newton's iteration from above. */
hg_real hg_linalg_root(hg_real x)
{
    hg_real scaled = x;
    hg_real scale = HG_REAL_C(1.0);
    for (uint16_t i = 0U; i < SCALINGS; i++) {
        if (scaled >= HG_REAL_C(4.0)) {
            scaled *= HG_REAL_C(0.25);
            scale *= HG_REAL_C(2.0);
        } else if (scaled < HG_REAL_C(1.0)) {
            scaled *= HG_REAL_C(4.0);
            scale *= HG_REAL_C(0.5);
        } else {
            /* within 1 .. 4, where it stays */
        }
    }
    hg_real y = HG_REAL_C(2.0);
    for (uint8_t i = 0U; i < 6U; i++) { /* off by at most 1 at first, then by 0.25, 0.025, 3e-4, 5e-8, 1e-15 and rounding */
        y = HG_REAL_C(0.5) * (y + (scaled / y));
    }
    return y * scale;
}

#endif
