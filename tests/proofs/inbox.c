/** @file
 *  node.h: from a receive interrupt to the main loop. */
#include "proof.h"

#include "hullguard/node.h"

/** Frames leave the inbox in the order they came, none twice and none lost but those that were refused and counted, wherever its counters stand when they wrap.
 *  Any power of two of places up to LENGTH, any counters that agree, any OPERATIONS puts and gets.
 *  @proves hg_inbox_start hg_inbox_put hg_inbox_get
 *  @without conversion: written - read is meant to wrap at 256
 *  @run check real=f32 unwind=7 limit=150 LENGTH=2U OPERATIONS=6U */
void proof_inbox(void)
{
    hg_can_frame memory[LENGTH];
    hg_inbox self;
    const uint8_t length = any_u8();
    const bool power = (length == 2U) || (length == 4U) || (length == 8U) || (length == 16U) || (length == 32U) || (length == 64U) || (length == 128U);
    prove((hg_inbox_start(&self, memory, length) == HG_OK) == power, "a power of two, 2 .. 128");
    prove((hg_inbox_start(NULL, memory, length) == HG_E_ARGUMENT) && (hg_inbox_start(&self, NULL, length) == HG_E_ARGUMENT), "null pointers");
    assume(power && (length <= LENGTH));
    (void)hg_inbox_start(&self, TAIL(memory, length), length);
    self.written = any_u8();
    self.read = self.written;
    self.overflow = any_u16();
    const uint16_t overflow = self.overflow;
    uint32_t in = 0U;
    uint32_t out = 0U;
    uint32_t refused = 0U;
    for (uint8_t i = 0U; i < OPERATIONS; i++) {
        hg_can_frame frame;
        if (any_bool()) {
            frame.id = in;
            const hg_status status = hg_inbox_put(&self, &frame);
            prove((status == HG_OK) == ((in - out) < length), "room for as many as it is long");
            prove((status == HG_OK) || (status == HG_E_BUSY), "no other status");
            in += (status == HG_OK) ? 1U : 0U;
            refused += (status == HG_OK) ? 0U : 1U;
        } else {
            const hg_status status = hg_inbox_get(&self, &frame);
            prove((status == HG_OK) == (in > out), "something while there is something");
            prove((status == HG_OK) || (status == HG_E_EMPTY), "no other status");
            prove((status != HG_OK) || (frame.id == out), "in their order");
            out += (status == HG_OK) ? 1U : 0U;
        }
    }
    prove(self.overflow == (((overflow + refused) > UINT16_MAX) ? UINT16_MAX : (overflow + refused)), "what was refused is counted");
    if ((refused > 0U) && (out > 1U)) {
        reach("a full inbox that is emptied");
    }
}
