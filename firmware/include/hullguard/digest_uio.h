/** @file
 *  The checksum of digest.h over the constant tables of a model's unknown-input observers, and of what tells their causes apart. */
#ifndef HULLGUARD_DIGEST_UIO_H
#define HULLGUARD_DIGEST_UIO_H

#include "hullguard/digest.h"
#include "hullguard/isolate.h"
#include "hullguard/uio.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Take the next numbers: as hg_digest_node().
 *  @param[in] uio  [uios]
 *  @retval HG_OK  that was the last one  @retval HG_E_BUSY  there are more */
hg_status hg_digest_uio(hg_digest *self, const hg_uio_config *uio, uint8_t uios, uint32_t numbers);

#if !HG_REAL_Q31
/** The same for what tells causes apart.
 *  @param[in] isolate  [isolates]
 *  @retval HG_OK  that was the last one  @retval HG_E_BUSY  there are more */
hg_status hg_digest_isolate(hg_digest *self, const hg_isolate_config *isolate, uint8_t isolates, uint32_t numbers);
#endif

#ifdef __cplusplus
}
#endif

#endif
