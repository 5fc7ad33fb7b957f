/** @file
 *  The messages of the shipped models: firmware/models/MODEL.c. */
#include "proof.h"

#include "hullguard/node.h"
#include "model_tables.h"

/** Every measurement and control message of the model is valid, and every code that its senders can send comes out of the frame as it went in, protection and stamp beside it.
 *  All messages of the model, any codes, counter and stamp.
 *  @proves hg_frame_pack hg_frame_unpack hg_frame_valid hg_e2e_protect hg_e2e_check
 *  @without conversion: bytes and checksums are cut on purpose
 *  @run check real=f32 unwind=65 limit=150 hg_e2e_valid.0:513 MODEL=platoon
 *  @run deep real=f32 unwind=65 limit=150 hg_e2e_valid.0:513 MODEL=openacc
 *  @run check real=f32 unwind=65 limit=150 hg_e2e_valid.0:513 MODEL=suspension
 *  @run check real=f32 unwind=65 limit=150 hg_e2e_valid.0:513 MODEL=battery_cell
 *  @run check real=q31 unwind=65 limit=150 hg_e2e_valid.0:513 MODEL=platoon
 *  @run deep real=q31 unwind=65 limit=600 hg_e2e_valid.0:513 MODEL=platoon_bank
 *  @run deep real=f32 unwind=65 limit=600 hg_e2e_valid.0:513 MODEL=two_state
 *  @run deep real=f32 unwind=65 limit=600 hg_e2e_valid.0:513 MODEL=quadratic_sensor
 *  @run deep real=f32 unwind=65 limit=600 hg_e2e_valid.0:513 MODEL=cubic_suspension
 *  @run deep real=f32 unwind=65 limit=600 hg_e2e_valid.0:513 MODEL=suspension_published */
void proof_models_round(void)
{
    const hg_node_config *config = &MODEL_CONFIG;
    for (uint8_t i = 0U; i < config->detector->groups; i++) {
        const hg_message *message = &config->message[i];
        prove(hg_frame_valid(message), "a valid message");
        int32_t code[HG_GROUP_SIGNALS_MAX];
        int32_t read[HG_GROUP_SIGNALS_MAX];
        hg_can_frame frame;
        hg_e2e_header header;
        for (uint8_t g = 0U; g < message->width; g++) {
            code[g] = any_i32();
            assume((code[g] == HG_CODE_INVALID) || hg_code_valid(&message->scale[g], code[g]));
        }
        hg_frame_pack(message, code, &frame);
        prove(hg_e2e_protect(message->e2e, frame.data, frame.length, any_u8(), any_u8()) == HG_OK, "protected");
        prove(hg_e2e_check(message->e2e, frame.data, frame.length, &header) == HG_OK, "and good");
        prove(hg_frame_unpack(message, &frame, read) == HG_OK, "and read");
        for (uint8_t g = 0U; g < message->width; g++) {
            prove(read[g] == code[g], "as it went in");
        }
    }
    reach("end");
}
