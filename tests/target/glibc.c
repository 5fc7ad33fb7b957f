/* The C library's sin and cos in double keep the rounding mode by an instruction of POWER9 (mffscrni), which older processors take for another
 * and QEMU 7.2 for an illegal one in 32 bits. The tests need a direction only, and those in single precision do without. */

#include <math.h>

void sincos(double x, double *sine, double *cosine);

void sincos(double x, double *sine, double *cosine)
{
    *sine = (double)sinf((float)x);
    *cosine = (double)cosf((float)x);
}

double sin(double x)
{
    return (double)sinf((float)x);
}

double cos(double x)
{
    return (double)cosf((float)x);
}
