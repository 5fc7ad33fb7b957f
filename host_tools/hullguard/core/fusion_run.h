/** @file
 *  Runs of a fusion filter in C: an emulated linear plant with normal noise, sensors that decide by the library's triggers, frames as they are on the wire,
 *  losses and delays, and every node's copy of the filter. Truth is computed in double whatever hg_real is. Runs of one seed see the same plant and the
 *  same noise whatever else differs between them. */
#ifndef HULLGUARD_FUSION_RUN_H
#define HULLGUARD_FUSION_RUN_H

#include "hullguard/hullguard.h"

enum { HGH_SEND_TRIGGER = 1, HGH_SEND_ALWAYS = 2, HGH_SEND_RANDOM = 3, HGH_SEND_DECIMATED = 4 };
enum { HGH_LOSS_ALL = 1, HGH_LOSS_CENTRE = 2 };
enum { HGH_SENSOR_GOOD = 0, HGH_SENSOR_DEAD = 1, HGH_SENSOR_BIASED = 2, HGH_SENSOR_FROZEN = 3 };

typedef struct {
    const hg_fusion_config      *centre;       /* the filter that is judged */
    const hg_fusion_config      *sensor;       /* of the sensors' nodes */
    const hg_consistency_config *consistency;  /* beside the centre, or null */
    const hg_variance_config    *variance;     /* [m] or null: sensors that send by their own variance trigger */
    double                       converter;    /* resolution of the codes it sees, signal units */
    int32_t                      nodes;        /* 1: one filter for all; 2: centre and one for all sensors; m + 1: one each */
    const double                *A;            /* n x n, the true plant */
    const double                *q;            /* [n] standard deviations of its noise a sample */
    const double                *C;            /* m x n */
    const double                *sigma;        /* [m] standard deviations of the sensors */
    const double                *x0;           /* [n] mean and */
    const double                *p0;           /* [n] standard deviations of the initial state */
    int64_t                      samples;
    int64_t                      skip;         /* first samples that do not count for rates and bits */
    int32_t                      send;         /* HGH_SEND_* */
    const double                *rate;         /* [m] of HGH_SEND_RANDOM and HGH_SEND_DECIMATED */
    int32_t                      lossy;        /* HGH_LOSS_*: who does not hear a lost frame */
    double                       loss;         /* probability that a frame is lost */
    double                       late;         /* probability that it is heard one sample late, by all but its sender */
    int32_t                      recall;       /* 1: every frame of 16 bits says which of the 8 samples before had one, and the last of their values */
    double                       resolution;   /* of 16-bit values on the wire, signal units, which wrap round; 0: float32, relative to the sender's origin */
    double                       outlier;      /* probability of an outlier and */
    double                       outlier_size; /* its size, standard deviations of the sensor */
    int64_t                      jump_at;      /* sample in which the state jumps, negative for never */
    const double                *jump;         /* [n] or null */
    int32_t                      fault;        /* HGH_SENSOR_* */
    int32_t                      fault_sensor;
    int64_t                      fault_at;     /* first faulty sample */
    double                       fault_size;   /* bias, signal units */
    int32_t                      exclude;      /* 1: a blamed sensor is taken out; 0: the blame is counted, and judging begins anew */
    uint64_t                     seed;
} hgh_fusion_config;

typedef struct {
    double  *error2;    /* [samples][n] squared errors of the centre's estimate, summed over runs */
    double  *nees;      /* [samples] normalised estimation error squared, summed over runs */
    double  *sent;      /* [m] frames after skip */
    int64_t *blamed_at; /* [runs] sample of the first blame, -1 for none */
    int32_t *blamed;    /* [runs] bits of the sensors blamed then */
    double   bits;      /* on the wire after skip, exact */
    int64_t  blames;    /* all of them */
    int64_t  unequal;   /* samples in which nodes' settled states were not equal to the bit */
    uint64_t hash;      /* FNV-1a of the centre's settled states, over all samples and runs */
    int64_t  origins;   /* steps that the origin has moved, over all runs and states */
    int64_t  resets;    /* of all nodes */
    double   largest;   /* |x|, of the last run's local state */
} hgh_fusion_result;

/** Runs first .. first + count - 1, added to what the arrays hold; false when a configuration is refused. */
bool hgh_fusion_batch(const hgh_fusion_config *config, int64_t first, int64_t count, hgh_fusion_result *result);

#endif
