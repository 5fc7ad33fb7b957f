#include "hullguard/node.h"

#include <stddef.h>

#define STAMP_MASK 0x0FU

hg_status hg_sender_start(hg_sender *self, const hg_sender_config *config, int32_t *codes)
{
    if ((self == NULL) || (config == NULL) || (codes == NULL) || (config->message == NULL) || (config->trigger == NULL)) {
        return HG_E_ARGUMENT;
    }
    if ((!hg_frame_valid(config->message)) || (config->message->width != config->trigger->width)) {
        return HG_E_CONFIG;
    }
    self->config = config;
    self->code = &codes[config->trigger->width];
    self->counter = 0U;
    return hg_trigger_start(&self->trigger, config->trigger, codes);
}

hg_status hg_sender_step(hg_sender *self, uint32_t k, const hg_real *value, hg_can_frame *frame)
{
    const hg_message *message = self->config->message;
    for (uint8_t g = 0U; g < message->width; g++) {
        self->code[g] = hg_code_encode(&message->scale[g], value[g]);
    }
    hg_status status = hg_trigger_step(&self->trigger, self->code);
    if (status == HG_OK) {
        hg_frame_pack(message, self->code, frame);
        status = hg_e2e_protect(message->e2e, frame->data, frame->length, self->counter, (uint8_t)(k & STAMP_MASK));
        self->counter = (uint8_t)((self->counter + 1U) % hg_e2e_modulus(message->e2e));
    }
    return status;
}
