/** @file
 *  An unknown-input observer: what the plant's state, its unknown inputs and its faults are, each with a radius (methods, suspension).
 *
 *      x' = A x + B u + G f      y = C x      f: unknown inputs (a road) and faults, of actuators through columns of B, of sensors through states
 *                                             of their own; rank CG = columns of G
 *
 *  The observer H = G (CG)^+, F = (I - HC) A - K1 C, K = K1 + F H forgets x(0) and never sees f. On an ECU (section 1.4) y is taken as linear
 *  between samples, so that no gain is larger than about 1, and f is what moves the state beyond the model, one sample late and low-passed:
 *
 *      z(k+1) = Fd z(k) + K0 y(k) + K1d y(k+1) + Bz u(k)                    xhat(k) = z(k) + H y(k)
 *      fhat(k) = fhat(k-1) + a (Gd^+ (xhat(k) - Ad xhat(k-1) - Bd u(k-1)) - fhat(k-1))          a: 0 < a <= 1, one an entry of f; 1: no low pass
 *
 *  with Bz = int_0^Ts e^(F s) ds (I - HC) B, which is 0 where u acts through columns of G. Neither y(k+1) nor xhat(k-1) has to be kept, and nothing
 *  is differentiated at run time: with s(k) = z(k) - K1d y(k) and g(k) = (1-a) fhat(k-1) - a Gd^+ (Ad xhat(k-1) + Bd u(k-1)) it is a linear
 *  system from signals to estimates,
 *
 *      s(k+1) = Fd s(k) + (Fd K1d + K0) y(k) + Bz u(k)    xhat(k) = s(k) + (K1d + H) y(k)
 *      g(k+1) = (1-a) g(k) + N xhat(k) - a Gd^+ Bd u(k)   fhat(k) = g(k) + a Gd^+ xhat(k)         N = a Gd^+ ((1-a) I - Ad)
 *
 *  (N is made offline, where its difference of nearly equal numbers costs no digits). The fault of a sensor is a state, whose estimate goes through a
 *  low pass too: p(k+1) = (1-a) p(k) + a xhat_i(k). All this is run by what runs every other linear system here: residual.h with estimates in the place
 *  of residuals, hull.h for the radii. Any other linear observer fits as well: exact in discrete time, of a reduced order, with inputs that act on z;
 *  or, where outputs tell every state, xhat = C^-1 y itself (H = C^-1, T = 0, no s): it waits for nothing, so that an error counts in its own sample only.
 *
 *  **What a radius bounds**, |estimate - truth| <= radius in every sample:
 *  - of a state: truth is x_i(k);
 *  - of a sensor's fault: truth is the low pass t(k) = t(k-1) + a (x_i(k) - t(k-1)), t = 0 before the start;
 *  - of another entry of f: truth is t(k) = t(k-1) + a (fbar(k-1) - t(k-1)), t = 0 before the start, where fbar(k-1) = Gd^+ int_0^Ts e^(A(Ts-s)) G
 *    f((k-1)Ts + s) ds is the mean over the sample interval: f(k-1) itself where f is constant in between.
 *  It holds while the signals are within their radii and disturbance, noise, and f between samples (y is not quite linear then) are within the
 *  bounds that the bias tables were made for. Event triggering, a lost or late frame, and a missing sensor are larger radii and nothing else;
 *  a radius of HG_REAL_MAX says that nothing is known;
 *  a loss that shows late is corrected where the detector rewrites its ring of radii (the hull has as many taps as any group's interval_max).
 *  Without a fault an entry's truth is 0: |fhat_i| > radius_i proves one. An alarm is raised by the detector, not here: give it a generator whose
 *  residuals are those rows of fhat that stand for faults (they come first, so that it can name the same four tables with fewer rows).
 *
 *  Beside a detector, whose signals and ring it reads, after each hg_detector_step(), or hg_node_step() that made one:
 *
 *      (void)hg_uio_follow(&uio, &node.detector, estimate, radius);
 *
 *  which begins again where the detector did: its ring holds nothing older then. What an estimate has to do with actuators, components and sensors is
 *  isolate.h's business, for floating-point hg_real only. In fixed point each estimate, its radius with it, has a unit of its own, so chosen that
 *  neither reaches it whatever codes the signals have and however wide their radii are. Not reentrant per instance; safe in interrupt context; no allocation. */
#ifndef HULLGUARD_UIO_H
#define HULLGUARD_UIO_H

#include "hullguard/detector.h"
#include "hullguard/hull.h"
#include "hullguard/real.h"
#include "hullguard/residual.h"
#include "hullguard/ring.h"
#include "hullguard/status.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {                 /* flash: generated. Estimates in this order, one a row: */
    uint8_t            actuators; /* faults of actuators, 0 .. 255 */
    uint8_t            sensors;   /* faults of sensors, 0 .. 255 */
    uint8_t            unknown;   /* unknown inputs, 0 .. 255 */
    uint8_t            states;    /* 0 .. 255; 1 .. 255 estimates together */
    hg_residual_config observer;  /* residuals = estimates; order: that of s, and one for each low pass */
    hg_hull_config     hull;      /* of the observer's impulse responses, residuals = estimates */
} hg_uio_config;

typedef struct {                 /* RAM */
    const hg_uio_config *config;
    hg_residual          observer;
    hg_hull              hull;
    uint32_t             beginnings; /* of the detector it follows: those it has seen */
} hg_uio;

/** Memory of one observer, numbers. */
#define HG_UIO_REALS(order, width, estimates, modes) (HG_RESIDUAL_REALS(order, width) + HG_HULL_REALS(estimates, modes))

/** Do the tables fit one another, and a ring of this width and length? Cost: width comparisons. */
bool hg_uio_valid(const hg_uio_config *config, uint8_t ring_width, uint8_t ring_length);

/** Begin at the sample after this call, with s = g = 0.
 *  @param[in] ring    of the radii of the whole signal vector: the detector's
 *  @param[in] how     is the plant within the initial range, or anywhere in its operating range?
 *  @param[in] memory  [HG_UIO_REALS(observer.order, observer.width, estimates, hull.modes)], owned by the caller
 *  @retval HG_OK          ready
 *  @retval HG_E_ARGUMENT  a null pointer
 *  @retval HG_E_CONFIG    hg_uio_valid() says no */
hg_status hg_uio_start(hg_uio *self, const hg_uio_config *config, const hg_ring *ring, hg_start how, hg_real *memory);

/** Begin again at the sample after this call. */
void hg_uio_reset(hg_uio *self, hg_start how);

/** One sample, whose radii are the newest row of the ring.
 *  @param[in]  value     the signal vector at this sample
 *  @param[out] estimate  [actuators + sensors + unknown + states]
 *  @param[out] radius    [the same]
 *  @retval HG_OK         both are this sample's
 *  @retval HG_E_NUMERIC  a signal it reads is not finite, or so large that the state overflows; nothing has come into the state, and it begins
 *                        again as in a moving plant: estimates are 0, radii HG_REAL_MAX in this sample
 *  Cost: (order + estimates)(order + width) + (taps x estimates x width) + modes x (width + estimates) multiplications. */
hg_status hg_uio_step(hg_uio *self, const hg_real *value, const hg_ring *ring, hg_real *estimate, hg_real *radius);

/** The sample that a detector has just closed. Started when the detector was; where the detector has begun again since, so does this, as in a moving
 *  plant, before the step.
 *  @param[out] estimate, radius  as hg_uio_step(), whose cost it has
 *  @retval HG_OK         done
 *  @retval HG_E_NUMERIC  as hg_uio_step() */
hg_status hg_uio_follow(hg_uio *self, const hg_detector *detector, hg_real *estimate, hg_real *radius);

/** Has the initial state become a small part of the radii? */
bool hg_uio_ready(const hg_uio *self);

#ifdef __cplusplus
}
#endif

#endif
