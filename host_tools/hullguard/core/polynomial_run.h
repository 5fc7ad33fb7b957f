/** @file
 *  Runs of a polynomial filter in C: a plant of polynomials, noise of any named kind, measurements always or send-on-delta, faults. Truth is computed in
 *  double whatever hg_real is. Runs of one seed see the same noise whatever else differs between them. */
#ifndef HULLGUARD_POLYNOMIAL_RUN_H
#define HULLGUARD_POLYNOMIAL_RUN_H

#include "hullguard/hullguard.h"

enum {
    HGH_NOISE_NORMAL = 1,
    HGH_NOISE_EXPONENTIAL = 2,
    HGH_NOISE_UNIFORM = 3,
    HGH_NOISE_ATOMS = 4,
    HGH_NOISE_LAPLACE = 5,
    HGH_NOISE_STUDENT = 6,     /* value[0]: degrees of freedom */
    HGH_NOISE_CONTAMINATED = 7 /* normal; value[0]: share of the numbers that are value[1] times as wide */
};
enum { HGH_PLANT_GOOD = 0, HGH_PLANT_ACTUATOR = 1, HGH_PLANT_SENSOR = 2 };

#define HGH_POLYNOMIAL_STATISTICS 3 /* plain, joint, drift */

typedef struct {
    int32_t       kind;   /* HGH_NOISE_* */
    double        scale;  /* of a uniform one half of its width, of a normal and an exponential one its standard deviation, else that of the usual density */
    int32_t       atoms;
    const double *value;  /* [atoms] */
    const double *below;  /* [atoms] probability of this atom and those before it */
} hgh_polynomial_noise;

/** One draw; takes two numbers of the stream, whatever the kind. */
double hgh_noise_draw(const hgh_polynomial_noise *noise, hgh_random *random);

typedef struct {
    const hg_polynomial_config *config;
    const double               *f;        /* coefficients of config->f and */
    const double               *h;        /* of config->h in double */
    const hgh_polynomial_noise *w;        /* [n] */
    const hgh_polynomial_noise *v;        /* [p] */
    const double               *x0;       /* [n] mean and */
    const double               *p0;       /* [n] standard deviations of the initial state */
    int64_t                     samples;
    int64_t                     skip;     /* first samples in which alarms do not count */
    int32_t                     fault;    /* HGH_PLANT_* */
    int64_t                     fault_at; /* first faulty sample */
    const double               *size;     /* [n] added to x+, or [p] added to y */
    const double               *delta;    /* [p] a sensor sends when its value has moved further; 0: always */
    uint64_t                    seed;
} hgh_polynomial_config;

typedef struct {
    double  *error2;   /* [samples][n] squared errors, summed over runs */
    double  *ekf2;     /* [samples][n] of the auxiliary filter */
    double  *variance; /* [samples][n] what the filter says they are */
    int64_t *first;    /* [runs][statistics] first sample from fault_at on above its level, -1 for none */
    int64_t  alarms[HGH_POLYNOMIAL_STATISTICS]; /* samples above it, from skip to the fault */
    int64_t  sent;     /* values, of runs samples p */
    int64_t  dropped;
    int64_t  held;
    int64_t  restarts;
} hgh_polynomial_result;

/** Runs first .. first + count - 1, added to what the arrays hold; false when the configuration is refused. */
bool hgh_polynomial_batch(const hgh_polynomial_config *config, int64_t first, int64_t count, hgh_polynomial_result *result);

#endif
