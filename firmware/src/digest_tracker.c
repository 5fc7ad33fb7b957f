#include "hullguard/digest_tracker.h"

#include "hullguard/crc32c.h"

#include <stddef.h>

#if !HG_REAL_Q31

static void fusion(hg_digest *self, const hg_fusion_config *config)
{
    const hg_real real[] = {config->huber, config->rate_step, config->loss, config->smoothing};
    const uint32_t n = config->states;
    const uint32_t m = config->sensors;
    const uint32_t early = (config->delay > 0U) ? config->rates : 0U; /* else not there */
    hg_digest_reals(self, real, (uint32_t)(sizeof(real) / sizeof(real[0])));
    hg_digest_reals(self, config->A, n * n);
    hg_digest_reals(self, config->B, n * config->inputs);
    hg_digest_reals(self, config->Q, n * n);
    hg_digest_reals(self, config->x0, n);
    hg_digest_reals(self, config->P0, n * n);
    if (config->select != NULL) {
        hg_digest_bytes(self, config->select, m);
    } else {
        hg_digest_reals(self, config->C, m * n);
    }
    hg_digest_reals(self, config->R, m);
    hg_digest_reals(self, config->range, m);
    hg_digest_reals(self, config->origin, (config->origin != NULL) ? n : 0U);
    for (uint8_t t = 0U; t < config->tables; t++) {
        hg_digest_number(self, config->table[t].alive);
        hg_digest_reals(self, config->table[t].level, m);
        hg_digest_reals(self, config->table[t].relax, config->rates * m);
        hg_digest_reals(self, config->table[t].early, early * m);
    }
}

static void consistency(hg_digest *self, const hg_consistency_config *config, uint8_t sensors)
{
    const uint32_t number[] = {config->onsets, config->stride, config->confirm, config->repeats, config->rest};
    hg_digest_masks(self, number, (uint32_t)(sizeof(number) / sizeof(number[0])));
    hg_digest_reals(self, config->least, sensors);
    hg_digest_reals(self, &config->limit, 1U);
}

uint32_t hg_digest_tracker_head(const hg_tracker_config *config)
{
    const hg_fusion_config *f = config->fusion;
    const uint32_t number[] = {
        config->heartbeat, config->interval, config->model_hash, (config->consistency != NULL) ? 1U : 0U,
        f->states, f->inputs, f->sensors, f->depth, f->delay, f->heartbeat, f->watchdog, f->modulus,
        (uint32_t)f->trigger, f->rates, f->tables, (f->select != NULL) ? 1U : 0U, (f->origin != NULL) ? 1U : 0U,
    };
    uint32_t crc = 0U;
    for (uint8_t i = 0U; i < (uint8_t)(sizeof(number) / sizeof(number[0])); i++) {
        crc = hg_crc32c(crc, number[i], 4U);
    }
    return crc;
}

hg_status hg_digest_tracker(hg_digest *self, const hg_tracker_config *config, uint32_t head, uint32_t numbers)
{
    if (hg_digest_tracker_head(config) != head) {
        return HG_E_DIGEST; /* before any pointer is followed that may not be there */
    }
    hg_digest_open(self, numbers);
    hg_digest_number(self, head);
    fusion(self, config->fusion);
    if (config->consistency != NULL) {
        consistency(self, config->consistency, config->fusion->sensors);
    }
    for (uint8_t i = 0U; i < config->fusion->sensors; i++) {
        hg_digest_message(self, config->source[i].message);
        hg_digest_number(self, config->source[i].wraps ? 1U : 0U);
    }
    hg_digest_message(self, config->tick);
    hg_digest_message(self, config->verdict);
    hg_digest_message(self, config->status);
    for (uint8_t j = 0U; j < config->fusion->states; j++) {
        hg_digest_message(self, &config->estimate[j]);
    }
    return hg_digest_close(self);
}
#endif
