/** @file
 *  A checksum over a model's constant tables, number by number: has the flash kept what was generated? It follows the configuration as the
 *  library does, so that neither padding nor the place of a table in memory counts, and takes every number lowest byte first: the same tables have
 *  the same digest on every processor, for each number type its own. The generated NAME.h says what it must be (HG_NAME_DIGEST), and NAME_node_start()
 *  refuses to start with HG_E_DIGEST where it is not.
 *
 *  Flash may also fail later. A walk in the background takes a few numbers a call:
 *
 *      hg_digest walk;
 *      hg_digest_start(&walk);
 *      every sample:    switch (NAME_check(&walk, 64U)) { HG_E_BUSY: go on   HG_OK: all good, start again   HG_E_DIGEST: stop using verdicts }
 *
 *  The checksum is CRC-32C (crc32c.h), whose promises hold for the numbers of a walk, one behind another. A wrong bit in a number that says how long a
 *  table is changes what is taken: the digest then differs but for a chance of one in 2^32 (tests/host/test_trust.py flips every bit of a model), and the walk
 *  may read behind that table before it can tell, as far as the wrong number says. How many tables there are is looked at first (head), so that a
 *  wrong number leads to no pointer that is not there; a pointer that is wrong itself may lead anywhere. On a processor that traps there the trap is
 *  what shows the fault. Code is not looked at.
 *  Not reentrant per instance; safe in interrupt context. */
#ifndef HULLGUARD_DIGEST_H
#define HULLGUARD_DIGEST_H

#include "hullguard/node.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {       /* RAM: one a walk */
    uint32_t crc;      /* of what has been taken; when the walk has ended, the digest */
    uint32_t done;     /* numbers taken */
    uint32_t skip;     /* of this call: numbers to pass over, and */
    uint32_t left;     /* to take */
} hg_digest;

/** Begin a walk. */
void hg_digest_start(hg_digest *self);

/** CRC-32C of the numbers that say how many tables there are, which of the optional ones, and how large a node's memory is. */
uint32_t hg_digest_node_head(const hg_node_config *config);

/** Take the next numbers of a detector node's tables.
 *  @param[in] head     what hg_digest_node_head() must find (HG_NAME_DIGEST_HEAD): only then is anything else followed
 *  @param[in] numbers  how many, >= 1; UINT32_MAX: all
 *  @retval HG_OK        that was the last one: self->crc is the digest; hg_digest_start() before the next walk
 *  @retval HG_E_BUSY    there are more
 *  @retval HG_E_DIGEST  the head is another; nothing was taken
 *  Cost: a few operations a table of the model, and of each row of a table of scales or fields, and 4 to 8 table look-ups a number. */
hg_status hg_digest_node(hg_digest *self, const hg_node_config *config, uint32_t head, uint32_t numbers);

/* ---- Parts of a walk: what this one, digest_tracker.h and digest_uio.h are made of ---- */

/** Begin a call that takes so many numbers. */
void hg_digest_open(hg_digest *self, uint32_t numbers);

/** End it.
 *  @retval HG_OK      there were no more
 *  @retval HG_E_BUSY  there are more */
hg_status hg_digest_close(const hg_digest *self);

/** Numbers of a table, each with its 1, 2 or 4 bytes, or those of hg_real. @param[in] x  [count], may be null without one */
void hg_digest_number(hg_digest *self, uint32_t x);
void hg_digest_bytes(hg_digest *self, const uint8_t *x, uint32_t count);
void hg_digest_halves(hg_digest *self, const uint16_t *x, uint32_t count);
void hg_digest_codes(hg_digest *self, const int32_t *x, uint32_t count);
void hg_digest_masks(hg_digest *self, const uint32_t *x, uint32_t count);
void hg_digest_reals(hg_digest *self, const hg_real *x, uint32_t count);

/** Numbers of a message's tables, of a generator's, of a threshold's. */
void hg_digest_message(hg_digest *self, const hg_message *message);
void hg_digest_residual(hg_digest *self, const hg_residual_config *config);
void hg_digest_hull(hg_digest *self, const hg_hull_config *config);
#if HG_WITH_POLYNOMIAL
/** Of a statistical judge's. */
void hg_digest_statistic(hg_digest *self, const hg_statistic_config *config);
#endif

#ifdef __cplusplus
}
#endif

#endif
