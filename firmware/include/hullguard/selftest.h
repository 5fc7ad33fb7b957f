/** @file
 *  Self-test before the start: a stored drive through receive, codec, protection, hold, generators, thresholds and decision, in the node's own memory, with
 *  the bits of every value, radius, r and J and every verdict compared with what the library computed on the host when the model was designed. It
 *  shows a processor, a compiler, a table or an instruction that is not as it was then; not what this drive does not use.
 *
 *  The drive: from codes at rest on, every signal moves by up to `spread` codes a sample (a xorshift generator, so that 4 bytes stand for the whole
 *  sequence), and no alarm may come; from sample `fault` on one signal is wrong by `size` codes, and an alarm must be confirmed. A group speaks as often as
 *  its trigger lets it, the closing one every sample. The generated NAME_selftest() starts the node for it; NAME_node_start() afterwards begins anew.
 *  Not reentrant per instance; not for interrupt context: it makes hundreds of steps. */
#ifndef HULLGUARD_SELFTEST_H
#define HULLGUARD_SELFTEST_H

#include "hullguard/node.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {                /* flash: one a model, generated */
    hg_start       how;         /* the node is started so */
    uint16_t       samples;     /* of the drive, the faulty ones included */
    uint16_t       fault;       /* the first faulty one */
    uint8_t        signal;      /* place of the faulty signal */
    uint8_t        spread;      /* codes, 0 .. 127 */
    int32_t        size;        /* codes added to it; never beyond its range */
    const int32_t *code;        /* [signals] at rest */
    uint32_t       digest;      /* CRC-32C over what the drive must give (crc32c.h), for this number type */
} hg_selftest_config;

/* What a drive gave. */
typedef struct {
    uint32_t digest;   /* CRC-32C over it */
    bool     quiet;    /* no alarm before the fault */
    bool     found;    /* confirmed in the last sample */
} hg_selftest_result;

/** Make the drive. @param[in,out] node  just started, by config->how; not to be used afterwards but for a start
 *  Cost: samples steps of the node. */
void hg_selftest_drive(hg_node *node, const hg_selftest_config *config, hg_selftest_result *result);

/** The same, compared.
 *  @retval HG_OK          all as stored
 *  @retval HG_E_SELFTEST  something is not */
hg_status hg_selftest_run(hg_node *node, const hg_selftest_config *config);

#ifdef __cplusplus
}
#endif

#endif
