#include "hullguard/linalg.h"

#include <stddef.h>

void hg_linalg_apply(const hg_matrix *m, const hg_real *x, const hg_matrix *n, const hg_real *y, hg_real *out)
{
    hg_linalg_rows(m, x, n, y, out, m->rows, m->cols, n->cols);
}

bool hg_linalg_fits(const hg_matrix *m, const hg_matrix *n, uint8_t rows, uint8_t m_cols, uint8_t n_cols)
{
    const bool shapes = (m->rows == rows) && (n->rows == rows) && (m->cols == m_cols) && (n->cols == n_cols);
    return shapes && (m->exponent == n->exponent) && hg_exponent_valid(m->exponent) && (m->data != NULL) && (n->data != NULL);
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
