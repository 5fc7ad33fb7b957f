#include "host.h"

#if !HG_REAL_Q31

#include <math.h>

static double of_two(int32_t operation, double a, double b)
{
    switch (operation) {
    case HGH_OP_ADD:
        return a + b;
    case HGH_OP_SUBTRACT:
        return a - b;
    case HGH_OP_MULTIPLY:
        return a * b;
    case HGH_OP_DIVIDE:
        return a / b;
    default:
        return pow(a, b);
    }
}

static double of_one(int32_t operation, double a)
{
    switch (operation) {
    case HGH_OP_NEGATE:
        return -a;
    case HGH_OP_SIN:
        return sin(a);
    case HGH_OP_COS:
        return cos(a);
    case HGH_OP_TAN:
        return tan(a);
    case HGH_OP_ATAN:
        return atan(a);
    case HGH_OP_EXP:
        return exp(a);
    case HGH_OP_LOG:
        return log(a);
    case HGH_OP_SQRT:
        return sqrt(a);
    default:
        return tanh(a);
    }
}

double hgh_program_value(const hgh_program *program, int32_t n, const double *x, const double *u)
{
    double stack[HGH_STACK] = {0.0};
    int32_t top = -1;
    for (int32_t k = 0; k < program->length; k++) {
        const int32_t operation = program->code[2 * k];
        const int32_t place = program->code[2 * k + 1];
        if (operation == HGH_OP_CONSTANT) {
            stack[++top] = program->constant[place];
        } else if (operation == HGH_OP_VARIABLE) {
            stack[++top] = (place < n) ? x[place] : u[place - n];
        } else if (operation <= HGH_OP_POWER) {
            top--;
            stack[top] = of_two(operation, stack[top], stack[top + 1]);
        } else {
            stack[top] = of_one(operation, stack[top]);
        }
    }
    return stack[0];
}

void hgh_nonlinear_start(const hgh_nonlinear *self, int32_t n, hgh_random *random, double *x)
{
    for (int32_t i = 0; i < n; i++) {
        const hgh_polynomial_noise prior = {.kind = HGH_NOISE_NORMAL, .scale = self->p0[i]};
        x[i] = self->x0[i] + hgh_noise_draw(&prior, random);
    }
}

double hgh_nonlinear_state(const hgh_nonlinear *self, int32_t n, int32_t i, const double *x, const double *u, hgh_random *random)
{
    return hgh_program_value(&self->f[i], n, x, u) + hgh_noise_draw(&self->w[i], random);
}

double hgh_nonlinear_output(const hgh_nonlinear *self, int32_t n, int32_t i, const double *x, const double *u, hgh_random *random)
{
    return hgh_program_value(&self->h[i], n, x, u) + hgh_noise_draw(&self->v[i], random);
}

#endif
