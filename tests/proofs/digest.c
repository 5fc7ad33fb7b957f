/** @file
 *  digest.h, digest_tracker.h, digest_uio.h: the checksum over constant tables. Numbers are any; sizes are those of a run. */
#include "any_node.h"

#include "hullguard/digest_uio.h"

/* Tables of NUMBERS numbers of each kind, or of a length that is not theirs where there is none. */
typedef struct {
    uint8_t  byte[NUMBERS];
    uint16_t half[NUMBERS];
    int32_t  code[NUMBERS];
    uint32_t mask[NUMBERS];
    hg_real  real[NUMBERS];
} tables;

static void take(hg_digest *self, const tables *t, uint32_t count, bool there)
{
#if KIND == 1U
    hg_digest_bytes(self, there ? TAIL(t->byte, count) : NULL, count);
#elif KIND == 2U
    hg_digest_halves(self, there ? TAIL(t->half, count) : NULL, count);
#elif KIND == 3U
    hg_digest_codes(self, there ? TAIL(t->code, count) : NULL, count);
#elif KIND == 4U
    hg_digest_masks(self, there ? TAIL(t->mask, count) : NULL, count);
#else
    hg_digest_reals(self, there ? TAIL(t->real, count) : NULL, count);
#endif
}

/** A walk in portions takes each number once and gives the checksum of a walk in one go, whatever the checksum is and wherever the portions end; a table that is not there has no numbers, whatever is said of its
 *  length.
 *  A number and a table of up to NUMBERS numbers of 1, 2 or 4 bytes or of reals, KIND; portions of any size.
 *  @proves hg_digest_start hg_digest_open hg_digest_close hg_digest_number hg_digest_bytes hg_digest_halves hg_digest_codes hg_digest_masks hg_digest_reals
 *  @stub hg_crc32c
 *  @without conversion unsigned-overflow: codes go as words of 32 bits, done is meant to wrap
 *  @run deep real=f32 unwind=6 limit=90 KIND=1U NUMBERS=2U
 *  @run deep real=f32 unwind=6 limit=90 KIND=2U NUMBERS=2U
 *  @run deep real=f32 unwind=6 limit=90 KIND=3U NUMBERS=2U
 *  @run deep real=f32 unwind=6 limit=90 KIND=4U NUMBERS=2U
 *  @run check real=f32 unwind=6 limit=90 KIND=5U NUMBERS=2U */
void proof_digest_walk(void)
{
    tables t;
    const uint32_t head = any_u32();
    const uint32_t count = any_u8_in(0U, NUMBERS);
    const bool there = any_bool();
    hg_digest self;
    hg_digest whole;
    hg_digest_start(&self);
    hg_digest_start(&whole);
    hg_digest_open(&whole, UINT32_MAX);
    hg_digest_number(&whole, head);
    take(&whole, &t, count, there);
    prove(hg_digest_close(&whole) == HG_OK, "the last one");
    prove(whole.done == (there ? (count + 1U) : 1U), "all of them");
    hg_status status = HG_E_BUSY;
    for (uint8_t i = 0U; (i < (NUMBERS + 2U)) && (status == HG_E_BUSY); i++) {
        hg_digest_open(&self, any_u8_in(1U, UINT8_MAX));
        hg_digest_number(&self, head);
        take(&self, &t, count, there);
        status = hg_digest_close(&self);
        prove((status == HG_OK) || (status == HG_E_BUSY), "no other status");
    }
    prove(status == HG_OK, "at least one number a portion");
    prove((self.crc == whole.crc) && (self.done == whole.done), "the same digest");
    reach("end");
}

/** Of any walk, the numbers of a table that this call takes are those that no call before has taken, and no more than it may.
 *  A table of up to NUMBERS numbers, any place in a walk.
 *  @proves hg_digest_bytes hg_digest_halves hg_digest_codes hg_digest_masks hg_digest_reals
 *  @stub hg_crc32c
 *  @without conversion unsigned-overflow: codes go as words of 32 bits, done is meant to wrap
 *  @run check real=f32 unwind=5 limit=90 NUMBERS=3U */
void proof_digest_take(void)
{
    tables t;
    const uint32_t count = any_u8_in(0U, NUMBERS);
    const bool there = any_bool();
    hg_digest self;
    assume(self.done <= (UINT32_MAX - NUMBERS));
    const hg_digest before = self;
    const uint8_t *byte = there ? TAIL(t.byte, count) : NULL;
    const uint16_t *half = there ? TAIL(t.half, count) : NULL;
    const int32_t *code = there ? TAIL(t.code, count) : NULL;
    const uint32_t *mask = there ? TAIL(t.mask, count) : NULL;
    const hg_real *real = there ? TAIL(t.real, count) : NULL;
    assume(requires_digest(byte, count) && requires_digest(half, count) && requires_digest(code, count) && requires_digest(mask, count) && requires_digest(real, count));
    switch (any_u8()) {
    case 1U:
        hg_digest_bytes(&self, byte, count);
        break;
    case 2U:
        hg_digest_halves(&self, half, count);
        break;
    case 3U:
        hg_digest_codes(&self, code, count);
        break;
    case 4U:
        hg_digest_masks(&self, mask, count);
        break;
    default:
        hg_digest_reals(&self, real, count);
        break;
    }
    prove(ensures_digest(&self, &before, there, count), "each once");
    reach("end");
}

/** A walk over a node's tables reads each table as far as its sizes say, and no further; a head that is another is refused before anything is followed.
 *  A node of GROUPS groups of WIDTH signals, protected by PROTECTION, with predictors, mismatch, generators by hulls (COLUMNS 0) or by zonotopes, a bank, and POLYNOMIALS filters; any place in a walk, any portion.
 *  @proves hg_digest_node hg_digest_node_head hg_digest_message hg_digest_residual hg_digest_hull hg_digest_statistic
 *  @stub hg_digest_bytes hg_digest_halves hg_digest_codes hg_digest_masks hg_digest_reals
 *  @stub hg_crc32c
 *  @without conversion unsigned-overflow: flags and exponents go as words of 32 bits
 *  @run deep real=f32 unwind=40 limit=90 PROTECTION=1U GROUPS=2U WIDTH=1U PREDICTORS=1U STATES=1U GENERATORS=2U RESIDUALS=1U BANKS=1U HISTORY=2U HORIZON=2U COLUMNS=0U POLYNOMIALS=0U
 *  @run deep real=f32 unwind=40 limit=150 PROTECTION=1U GROUPS=6U WIDTH=1U PREDICTORS=1U STATES=1U GENERATORS=2U RESIDUALS=1U BANKS=1U HISTORY=2U HORIZON=2U COLUMNS=0U POLYNOMIALS=0U
 *  @run deep real=f32 unwind=30 limit=90 PROTECTION=1U GROUPS=1U WIDTH=1U PREDICTORS=0U STATES=0U GENERATORS=1U RESIDUALS=1U BANKS=0U HISTORY=1U HORIZON=1U COLUMNS=0U POLYNOMIALS=1U
 *  @run check real=f32 unwind=40 limit=90 PROTECTION=3U GROUPS=2U WIDTH=1U PREDICTORS=1U STATES=1U GENERATORS=2U RESIDUALS=1U BANKS=1U HISTORY=2U HORIZON=2U COLUMNS=1U POLYNOMIALS=0U
 *  @run deep real=f32 unwind=40 limit=150 PROTECTION=3U GROUPS=6U WIDTH=1U PREDICTORS=1U STATES=1U GENERATORS=2U RESIDUALS=1U BANKS=1U HISTORY=2U HORIZON=2U COLUMNS=1U POLYNOMIALS=0U */
void proof_digest_node(void)
{
    const hg_node_config *config = any_node_config();
    hg_digest self;
    assume(valid_signals(config->detector) && valid_judges(config->detector));
    const uint32_t head = any_u32();
    const hg_digest before = self;
    const hg_status status = hg_digest_node(&self, config, head, any_u32());
    prove((status == HG_OK) || (status == HG_E_BUSY) || (status == HG_E_DIGEST), "a status of the list");
    prove((status == HG_E_DIGEST) == (head != hg_digest_node_head(config)), "the head is looked at");
    prove((status != HG_E_DIGEST) || ((self.crc == before.crc) && (self.done == before.done)), "nothing taken");
    hg_digest_message(&self, &config->message[0]);
    hg_digest_residual(&self, &config->detector->residual[0]);
#if COLUMNS == 0U
    hg_digest_hull(&self, &config->detector->hull[0]);
#endif
#if POLYNOMIALS > 0
    hg_digest_statistic(&self, &config->detector->polynomial[0]);
#endif
    if (status == HG_OK) {
        reach("the end of a walk");
    }
}

/** A walk over the tables of unknown-input observers, and over those of what tells causes apart, reads each as far as its sizes say.
 *  Two observers of sizes RESIDUALS and ORDER and two isolations; any place in a walk, any portion.
 *  @proves hg_digest_uio hg_digest_isolate
 *  @stub hg_digest_bytes hg_digest_halves hg_digest_codes hg_digest_masks hg_digest_reals
 *  @stub hg_crc32c
 *  @without conversion unsigned-overflow: flags and exponents go as words of 32 bits
 *  @run check real=f32 unwind=40 limit=90 GROUPS=6U WIDTH=1U PREDICTORS=1U STATES=1U GENERATORS=2U RESIDUALS=1U BANKS=1U HISTORY=2U HORIZON=2U COLUMNS=0U POLYNOMIALS=0U */
void proof_digest_uio(void)
{
    hg_uio_config *uio = any_array(hg_uio_config, GENERATORS);
    hg_isolate_config *isolate = any_array(hg_isolate_config, GENERATORS);
    const hg_residual_config *residual = any_residuals();
    const hg_hull_config *hull = any_hulls();
    for (uint8_t i = 0U; i < GENERATORS; i++) {
        uio[i] = (hg_uio_config){.actuators = any_u8(), .sensors = any_u8(), .unknown = any_u8(), .states = any_u8(), .observer = residual[i], .hull = hull[i]};
        assume(hg_hull_valid(&hull[i], ALL, HISTORY));
        isolate[i].estimates = 2U;
        isolate[i].sensors = 1U;
        isolate[i].components = 2U;
        isolate[i].sensor = any_array(uint8_t, 1U);
        isolate[i].sensor_limit = any_array(hg_real, 1U);
        isolate[i].whole = any_array(hg_real, 4U);
        isolate[i].excitation = any_array(hg_real, 2U);
    }
    hg_digest self;
    const hg_status observers = hg_digest_uio(&self, uio, GENERATORS, any_u32());
    prove((observers == HG_OK) || (observers == HG_E_BUSY), "no other status");
    const hg_status causes = hg_digest_isolate(&self, isolate, GENERATORS, any_u32());
    prove((causes == HG_OK) || (causes == HG_E_BUSY), "no other status");
    reach("end");
}
