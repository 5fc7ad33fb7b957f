/** @file
 *  Compile-time options. Define HG_CONFIG_HEADER to a quoted header name to set them in one place of your own.
 *  None of them changes an equation; they bound what a model may ask for and choose the number type. */
#ifndef HULLGUARD_CONFIG_H
#define HULLGUARD_CONFIG_H

#ifdef HG_CONFIG_HEADER
#include HG_CONFIG_HEADER
#endif

/* Number type of every signal, radius and table: exactly one of the three is 1. float32 is the default; float64 is for host studies;
   Q31 is fixed point for cores without an FPU (real.h). */
#ifndef HG_REAL_F64
#define HG_REAL_F64 0
#endif
#ifndef HG_REAL_Q31
#define HG_REAL_Q31 0 /* fixed point */
#endif
#ifndef HG_REAL_F32
#define HG_REAL_F32 (1 - HG_REAL_F64 - HG_REAL_Q31) /* what the others leave */
#endif
#if (HG_REAL_F32 + HG_REAL_F64 + HG_REAL_Q31) != 1
#error "choose exactly one number type: HG_REAL_F32, HG_REAL_F64 or HG_REAL_Q31"
#endif

/* Parts of the detector that a model may do without: 0 leaves them out of the image, and a model that needs one is refused at its start. */
#ifndef HG_WITH_ZONOTOPE
#define HG_WITH_ZONOTOPE (1 - HG_REAL_Q31) /* its columns have no range that could be proven in fixed point */
#endif
#ifndef HG_WITH_BANK
#define HG_WITH_BANK 1 /* bank.h */
#endif
#ifndef HG_WITH_PREDICT
#define HG_WITH_PREDICT 1 /* predict.h */
#endif
#ifndef HG_WITH_MISMATCH
#define HG_WITH_MISMATCH 1 /* mismatch.h */
#endif
#ifndef HG_WITH_MODES
#define HG_WITH_MODES 1 /* of a hull (hull.h) */
#endif
#ifndef HG_WITH_POLYNOMIAL
#define HG_WITH_POLYNOMIAL (1 - HG_REAL_Q31) /* its moments have no range that could be proven in fixed point */
#endif
#ifndef HG_WITH_DIGEST
#define HG_WITH_DIGEST 1 /* of a model's tables, checked by its NAME_node_start() (digest.h) */
#endif
#ifndef HG_WITH_FREEZE
#define HG_WITH_FREEZE 1 /* the last samples before a confirmed alarm, read over the bus (freeze.h) */
#endif
#if HG_REAL_Q31 && HG_WITH_ZONOTOPE
#error "the zonotope is for the float types: a model for HG_REAL_Q31 has its threshold by the hull"
#endif
#if HG_REAL_Q31 && HG_WITH_POLYNOMIAL
#error "the polynomial filter is for the float types"
#endif

/* Senders of one model, the closing one included. The verdict frame has two bits of bus health for each: at most 8. */
#ifndef HG_GROUPS_MAX
#define HG_GROUPS_MAX 8U
#endif
#if (HG_GROUPS_MAX < 1U) || (HG_GROUPS_MAX > 8U)
#error "HG_GROUPS_MAX: 1 .. 8"
#endif

/* Signals in one frame. Bounds two local arrays of 4 bytes each; a 64-byte FD frame seldom holds more than 31 of 16 bits. */
#ifndef HG_GROUP_SIGNALS_MAX
#define HG_GROUP_SIGNALS_MAX 32U
#endif
#if (HG_GROUP_SIGNALS_MAX < 1U) || (HG_GROUP_SIGNALS_MAX > 255U)
#error "HG_GROUP_SIGNALS_MAX: 1 .. 255"
#endif

/* Levels of the adaptive trigger. */
#ifndef HG_LEVELS_MAX
#define HG_LEVELS_MAX 8U
#endif
#if (HG_LEVELS_MAX < 1U) || (HG_LEVELS_MAX > 255U)
#error "HG_LEVELS_MAX: 1 .. 255"
#endif

/* Residual generators in one detector; their alarms are bits of one 32-bit word. */
#ifndef HG_GENERATORS_MAX
#define HG_GENERATORS_MAX 32U
#endif
#if (HG_GENERATORS_MAX < 1U) || (HG_GENERATORS_MAX > 32U)
#error "HG_GENERATORS_MAX: 1 .. 32"
#endif

/* Sizes that are the same in all tables of the one model that a library is built for: the compiler then knows how often each loop runs, and a
   model of another size is refused at its start. 0: as the tables say. */
#ifndef HG_ONLY_GROUPS
#define HG_ONLY_GROUPS 0U
#endif
#ifndef HG_ONLY_GROUP_SIGNALS
#define HG_ONLY_GROUP_SIGNALS 0U /* of each group */
#endif
#ifndef HG_ONLY_WIDTH
#define HG_ONLY_WIDTH 0U /* of the signal vector, sent and derived */
#endif
#ifndef HG_ONLY_HISTORY
#define HG_ONLY_HISTORY 0U /* rows of the ring of radii */
#endif
#ifndef HG_ONLY_GENERATORS
#define HG_ONLY_GENERATORS 0U /* residual generators */
#endif
#ifndef HG_ONLY_JUDGED
#define HG_ONLY_JUDGED 0U /* generators and banks */
#endif
#ifndef HG_ONLY_ORDER
#define HG_ONLY_ORDER 0U /* of each generator */
#endif
#ifndef HG_ONLY_RESIDUALS
#define HG_ONLY_RESIDUALS 0U /* of each generator */
#endif
#ifndef HG_ONLY_READ
#define HG_ONLY_READ 0U /* signals that each generator reads, and its threshold */
#endif
#ifndef HG_ONLY_IN_ORDER
#define HG_ONLY_IN_ORDER 0U /* 1: each generator reads the whole signal vector in its order, and so does its threshold */
#endif
/* A size by its option and its place in a table; and does the one fit the other? */
#define HG_SIZE(only, entry) (((only) != 0U) ? (uint8_t)(only) : (entry))
#define HG_SIZE_FITS(only, entry) (((only) == 0U) || ((entry) == (only)))

/* States of a fusion filter. Memory and time grow with the square and the cube of the number in use, not with this bound. */
#ifndef HG_FUSION_STATES_MAX
#define HG_FUSION_STATES_MAX 32U
#endif
#if (HG_FUSION_STATES_MAX < 1U) || (HG_FUSION_STATES_MAX > 255U)
#error "HG_FUSION_STATES_MAX: 1 .. 255"
#endif

/* Scalar sensors of a fusion filter; sets of them are bits of one 16-bit word. */
#ifndef HG_FUSION_SENSORS_MAX
#define HG_FUSION_SENSORS_MAX 16U
#endif
#if (HG_FUSION_SENSORS_MAX < 1U) || (HG_FUSION_SENSORS_MAX > 16U)
#error "HG_FUSION_SENSORS_MAX: 1 .. 16"
#endif

#endif
