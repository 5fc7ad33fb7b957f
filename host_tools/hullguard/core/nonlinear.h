/** @file
 *  A nonlinear plant of the emulator: functions as programs for a stack, noise of any named kind. No expansion is in it: it is what a filter's polynomials stand for. */
#ifndef HULLGUARD_NONLINEAR_H
#define HULLGUARD_NONLINEAR_H

#include "hullguard/hullguard.h"

typedef struct hgh_nonlinear hgh_nonlinear;

#if !HG_REAL_Q31

#define HGH_STACK 64 /* values that a program keeps at a time, at most */

/* Operations: a constant or a variable (states, then inputs) by its place; two operands; one. */
enum {
    HGH_OP_CONSTANT = 0, HGH_OP_VARIABLE = 1, HGH_OP_ADD = 2, HGH_OP_SUBTRACT = 3, HGH_OP_MULTIPLY = 4, HGH_OP_DIVIDE = 5, HGH_OP_POWER = 6, HGH_OP_NEGATE = 7,
    HGH_OP_SIN = 8, HGH_OP_COS = 9, HGH_OP_TAN = 10, HGH_OP_ATAN = 11, HGH_OP_EXP = 12, HGH_OP_LOG = 13, HGH_OP_SQRT = 14, HGH_OP_TANH = 15
};

typedef struct {
    int32_t        length;
    const int32_t *code;     /* [length][2] operation, place */
    const double  *constant;
} hgh_program;

struct hgh_nonlinear {                 /* x+ = f(x, u) + w, y = h(x, u) + v */
    const hgh_program          *f;     /* [n] */
    const hgh_program          *h;     /* [m] */
    const hgh_polynomial_noise *w;     /* [n] */
    const hgh_polynomial_noise *v;     /* [m] */
    const double               *x0;    /* [n] mean and */
    const double               *p0;    /* [n] standard deviations of the initial state, normal */
};

/** A program's value. @param[in] x [n]  @param[in] u  what variables from n on are */
double hgh_program_value(const hgh_program *program, int32_t n, const double *x, const double *u);

void   hgh_nonlinear_start(const hgh_nonlinear *self, int32_t n, hgh_random *random, double *x);
double hgh_nonlinear_state(const hgh_nonlinear *self, int32_t n, int32_t i, const double *x, const double *u, hgh_random *random);  /* of the next sample */
double hgh_nonlinear_output(const hgh_nonlinear *self, int32_t n, int32_t i, const double *x, const double *u, hgh_random *random);

#endif
#endif
