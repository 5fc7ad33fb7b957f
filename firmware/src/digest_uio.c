#include "hullguard/digest_uio.h"

hg_status hg_digest_uio(hg_digest *self, const hg_uio_config *uio, uint8_t uios, uint32_t numbers)
{
    hg_digest_open(self, numbers);
    for (uint8_t i = 0U; i < uios; i++) {
        const uint32_t number[] = {uio[i].actuators, uio[i].sensors, uio[i].unknown, uio[i].states};
        hg_digest_masks(self, number, (uint32_t)(sizeof(number) / sizeof(number[0])));
        hg_digest_residual(self, &uio[i].observer);
        hg_digest_hull(self, &uio[i].hull);
    }
    return hg_digest_close(self);
}

#if !HG_REAL_Q31
static void isolation(hg_digest *self, const hg_isolate_config *config)
{
    const uint32_t number[] = {
        config->estimates, config->actuator, config->sensors, config->components, config->settle, config->release, config->block, config->blocks,
    };
    const hg_real real[] = {config->limit, config->low_pass, config->explained, config->steady};
    hg_digest_masks(self, number, (uint32_t)(sizeof(number) / sizeof(number[0])));
    hg_digest_reals(self, real, (uint32_t)(sizeof(real) / sizeof(real[0])));
    hg_digest_bytes(self, config->sensor, config->sensors);
    hg_digest_reals(self, config->sensor_limit, config->sensors);
    hg_digest_reals(self, config->whole, (uint32_t)config->components * config->estimates);
    hg_digest_reals(self, config->excitation, config->components);
}

hg_status hg_digest_isolate(hg_digest *self, const hg_isolate_config *isolate, uint8_t isolates, uint32_t numbers)
{
    hg_digest_open(self, numbers);
    for (uint8_t i = 0U; i < isolates; i++) {
        isolation(self, &isolate[i]);
    }
    return hg_digest_close(self);
}
#endif
