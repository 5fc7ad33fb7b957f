/** @file
 *  What the host adds to the library, in C because campaigns run it millions of times: an emulated plant with faults, one run of plant,
 *  senders, bus with losses and detector node in a single process, batches of such runs, and the exact length of frames on the wire.
 *  Everything between a reading and a verdict is the library itself. Plants are computed in double whatever hg_real is.
 *  Random numbers are streams of splitmix64, one for each purpose, keyed by (seed, run, purpose): turning one on does not move another. */
#ifndef HULLGUARD_HOST_H
#define HULLGUARD_HOST_H

#include "hullguard/hullguard.h"

#if !HG_REAL_Q31
#include "fusion_run.h"
#endif

#define HGH_STATES_MAX 64
#define HGH_SIGNALS_MAX 96
#define HGH_DISTURBANCES_MAX 192
#define HGH_FAULTS_MAX 32

/** A number of the host as the library's type; in fixed point in units of 2^unit, and its infinity for what does not fit. */
hg_real hgh_real(double x, int32_t unit);
double  hgh_number(hg_real x, int32_t unit); /* and back */

typedef struct {
    uint64_t state;
} hgh_random;

void   hgh_random_start(hgh_random *self, uint64_t seed, uint64_t run, uint64_t purpose);
double hgh_random_unit(hgh_random *self);   /* uniform in [0, 1) */
double hgh_random_signed(hgh_random *self); /* uniform in [-1, 1) */

#if !HG_REAL_Q31
#include "polynomial_run.h"
#endif
#include "nonlinear.h"

enum { HGH_BIAS = 1, HGH_DRIFT = 2, HGH_GAIN = 3, HGH_FREEZE = 4, HGH_NOISE = 5 };

typedef struct {
    int32_t signal;   /* place in the signal vector */
    int32_t actuator; /* 1: what the plant gets differs from the signal; 0: the reading differs from what the plant does */
    int32_t kind;     /* HGH_* */
    double  size;     /* signal units; drift: signal units a second; gain: factor */
    int64_t start;    /* first faulty sample */
    int64_t end;      /* first good one again; INT64_MAX for never */
} hgh_fault;

typedef struct {
    hgh_fault  fault;
    double     frozen;
    bool       held;
    hgh_random random;
} hgh_active;

typedef struct {
    int32_t    count;
    double     sample_time_s;
    hgh_active active[HGH_FAULTS_MAX];
} hgh_faults;

/** count <= HGH_FAULTS_MAX faults. */
void hgh_faults_start(hgh_faults *self, const hgh_fault *fault, int32_t count, double sample_time_s, uint64_t seed, uint64_t run);

/** The signal as the faults of this kind (actuator or not) leave it at sample k. */
double hgh_faults_apply(hgh_faults *self, int32_t actuator, int32_t signal, int64_t k, double value);

enum { HGH_REST = 0, HGH_STEPS = 1, HGH_RAMPS = 2, HGH_SINES = 3, HGH_MIXED = 4 };

typedef struct {
    int32_t kind;
    int32_t period;    /* samples */
    double  amplitude; /* input units; each input's reference bound limits it */
} hgh_reference;

typedef struct {                        /* x+ = A x + B u + Ed d, y = C x + D u + Fd d, u = held - gain (x - equilibrium) + reference */
    int32_t              n, m, p, nd, signals;
    const double        *A, *B, *C, *D, *Ed, *Fd;
    const double        *gain;          /* [p][n] or null: u is the reference alone */
    const double        *reference_bound; /* [p] */
    const double        *equilibrium;   /* [n] */
    const double        *held;          /* [p] input that holds it there */
    const double        *initial_range; /* [n] */
    const int32_t       *output;        /* [m] places of y in the signal vector */
    const int32_t       *input;         /* [p] places of u */
    const int32_t       *as_sent;       /* [p] 1: the plant applies what the wire carries */
    const hg_code_scale *scale;         /* [p] the wire of each input */
    const int32_t       *unit;          /* [p] of the library's numbers: 2^unit in fixed point, else 0 */
    double               sample_time_s;
    const hgh_nonlinear *nonlinear;     /* instead of A .. Fd, or null */
} hgh_plant_config;

typedef struct {
    const hgh_plant_config *config;
    hgh_reference           reference;
    hgh_faults              faults;
    double                  x[HGH_STATES_MAX];
    double                  u[HGH_STATES_MAX]; /* what the plant applies at this sample, faults included */
    double                  d[HGH_DISTURBANCES_MAX];
    double                  from[HGH_STATES_MAX], to[HGH_STATES_MAX]; /* of the reference, per input */
    int64_t                 k;
    hgh_random              disturbance, drive;
} hgh_plant;

/** Begin at rest within the initial range. `fault` [count] may be null with count 0. */
void hgh_plant_start(hgh_plant *self, const hgh_plant_config *config, hgh_reference reference, const hgh_fault *fault, int32_t count,
                     uint64_t seed, uint64_t run);

/** Readings of the open sample, sensor faults included; inputs are what the controller commands.
 *  @param[in]  d      [nd] disturbances in -1 .. 1, or null for random ones
 *  @param[out] value  [signals] */
void hgh_plant_read(hgh_plant *self, const double *d, double *value);

/** Move on to the next sample. */
void hgh_plant_move(hgh_plant *self);

typedef struct {
    const hg_node_config   *node;
    const hg_sender_config *sender;       /* [groups] */
    const hgh_plant_config *plant;        /* [plants] run i emulates plant i modulo plants, all of one shape; null for a replay */
    int32_t                 plants;       /* >= 1 with a plant */
    const double           *series;       /* [samples][signals] a replay's readings, or null */
    const double           *noise;        /* [signals] uniform noise added to them, or null */
    const double           *disturbance;  /* [samples][nd] instead of random ones, or null */
    const double           *initial;      /* [n] instead of a random initial state, or null */
    hgh_reference           reference;
    const hgh_fault        *fault;
    int32_t                 faults;
    int32_t                 signals;
    int64_t                 samples;
    double                  sample_time_s;
    double                  loss;         /* probability that a measurement frame is lost at the receiver */
    int64_t                 burst;        /* samples within which a loss takes all further frames of its group too; 0, 1: none */
    uint64_t                seed;
    int32_t                 start;        /* hg_start */
    const int32_t          *unit;         /* [width + residuals] of the library's numbers: 2^unit in fixed point, else 0 */
} hgh_run_config;

typedef struct {
    int64_t measurement;      /* frames of event-triggered groups */
    int64_t closing;          /* closing frames */
    int64_t verdicts;         /* verdict and status frames */
    int64_t lost;             /* measurement frames dropped on purpose */
    int64_t silent;           /* samples in the silent phase of an event group: 1 .. silence after its frame */
    int64_t bits;             /* of all frames sent, exact */
    int64_t measurement_bits;
    int64_t provisional_at;   /* first sample at or after the fault with at least a provisional alarm, -1 for never */
    int64_t confirmed_at;     /* the same, confirmed */
    int64_t false_provisional; /* episodes before the fault */
    int64_t false_confirmed;
    int64_t interval_min;     /* of event groups, samples; 0 without one */
    int64_t interval_max;
    double  margin;           /* largest |r| / J before the fault */
    double  margin_settled;   /* the same from the sample on in which even a moving start would be over: the initial state has no part in it */
    double  margin_after;     /* and from the fault on */
    uint32_t candidates;      /* at the first alarm after the fault */
    uint32_t candidates_later; /* HGH_LATER samples after it, or in the last sample of the alarm before that */
    uint32_t candidates_always; /* those that were candidates in every sample with a confirmed alarm since the fault; all ones without one */
    int32_t  plant;           /* last state */
} hgh_result;

#define HGH_LATER 10 /* samples after detection by when a fault should be told from others */

typedef struct hgh_run hgh_run; /* all state in one block */

/** Null when the configuration is refused. Freed by hgh_run_free(). */
hgh_run *hgh_run_new(const hgh_run_config *config, uint64_t run);
void     hgh_run_free(hgh_run *self);

/** Make up to `samples` steps; false when the run has ended. */
bool              hgh_run_steps(hgh_run *self, int64_t samples);
const hgh_result *hgh_run_result(const hgh_run *self);
/** Put other faults in place from here on, and forget what was found so far. */
void hgh_run_inject(hgh_run *self, const hgh_fault *fault, int32_t count);

/* What the last step saw: [signals] readings; [width] held and derived values, and radii; [signals] what the silent sender promised: the reading
 * is at most that far from the one it sent last (signal units), infinite where it sent or did not look; [residuals] r and J. */
typedef struct {
    const double *reading;
    const double *value;
    const double *radius;
    const double *promise;
    const double *r;
    const double *J;
    uint32_t      events; /* bit g: group g sent */
    uint32_t      lost;   /* bit g: and the frame was dropped */
    int32_t       plant;
    uint16_t      bus;
    int64_t       bits;
} hgh_view;
hgh_view hgh_run_view(hgh_run *self);

/** Runs first .. first + count - 1; results [count]. Returns the number of runs made, less than count when a configuration is refused. */
int64_t hgh_batch(const hgh_run_config *config, int64_t first, int64_t count, hgh_result *result);

/** Inject each fault list into a copy of one run at start, start + step, ..; a fault's start and end count from there.
 *  @param[in]  fault   [faults] one fault a variant      @param[in] horizon  samples to follow each
 *  @param[out] delay   [starts][faults] samples to the first alarm, -1 for none within the horizon */
int64_t hgh_sweep(const hgh_run_config *config, const hgh_fault *fault, int32_t faults, int64_t start, int64_t step, int64_t starts,
                  int64_t horizon, int32_t *delay);

#if HG_REAL_Q31 /* isolation is for the float types: null */
typedef struct hg_isolate_config hg_isolate_config;
typedef struct hg_isolation      hg_isolation;
#endif

/* An unknown-input observer with its own ring of radii, and the isolation of one of its estimates, sample after sample. */
typedef struct {
    const hg_uio_config     *uio;
    const hg_isolate_config *isolate; /* or null */
    const int32_t           *unit;          /* [width] of the signals in fixed point (hgh_real()) */
    const int32_t           *estimate_unit; /* [estimates] */
    int32_t                  width;   /* signals, 1 .. 255 */
    int32_t                  history; /* rows of the ring, more than the hull's taps, .. 255 */
    int32_t                  start;   /* hg_start */
} hgh_uio_config;

typedef struct hgh_uio hgh_uio;

/** Null when the configuration is refused. Freed by hgh_uio_free(). */
hgh_uio *hgh_uio_new(const hgh_uio_config *config);
void     hgh_uio_free(hgh_uio *self);

/** Make up to `samples` steps.
 *  @param[in]  value, radius    [samples][width] signals; radius may be null: 0
 *  @param[out] estimate, bound  [samples][estimates] estimates and their radii; each may be null; in fixed point HG_REAL_MAX is DBL_MAX
 *  @param[out] isolation        [samples] what isolation says after each, or null
 *  Returns the number of samples that were not refused. */
int64_t hgh_uio_steps(hgh_uio *self, const double *value, const double *radius, int64_t samples, double *estimate, double *bound,
                      hg_isolation *isolation);

#if !HG_REAL_Q31
/** [components + 1] offset and shares of the last window that was judged. */
const hg_real *hgh_uio_share(const hgh_uio *self);
#endif

/** Bits on the wire with stuff bits and interframe space, exact; nominal and data phase together for FD. */
uint32_t hgh_frame_bits(const hg_can_frame *frame);

/** Of these, the bits at the data bit rate: ESI to CRC delimiter of an FD frame that switches, else 0. */
uint32_t hgh_frame_data_bits(const hg_can_frame *frame);

#endif
