/** @file
 *  e2e.h: what is accepted, and what is not. */
#include "contract.h"

/* Any configuration: profile PROFILE where that is defined. */
static hg_e2e_config any_config(const uint8_t *ids, const hg_e2e_limits *limits)
{
    hg_e2e_config config = {.mode = (hg_e2e_id_mode)any_u8_in(HG_E2E_BOTH, HG_E2E_NIBBLE),
                            .data_id = any_u16(),
                            .data_ids = ids,
                            .crc = any_u8(),
                            .ignore = 0U,
                            .counter = any_u16(),
                            .nibble = any_u16(),
                            .stamp = any_u16(),
                            .resync = any_u8(),
                            .limits = limits};
#ifdef PROFILE
    config.profile = PROFILE;
#else
    config.profile = (hg_e2e_profile)any_u8_in(HG_E2E_NONE, HG_E2E_P22);
#endif
    return config;
}

/** A frame that was protected passes the check, which reads the counter, taken by the modulus, and the stamp that were written; a frame too short for its places is refused
 *  by both without a write. Bits that are not the protection's own are left as they are.
 *  Any valid configuration, identifiers, data, counter and stamp; frames of up to LENGTH bytes.
 *  @proves hg_e2e_protect hg_e2e_check hg_e2e_valid hg_e2e_modulus hg_e2e_owns
 *  @without conversion: checksums are cut to 8 and 16 bits on purpose
 *  @run deep real=f32 unwind=17 limit=150 hg_e2e_valid.0:41 LENGTH=5U PROFILE=HG_E2E_P01
 *  @run check real=f32 unwind=17 limit=150 hg_e2e_valid.0:33 LENGTH=3U PROFILE=HG_E2E_P22
 *  @run deep real=f32 unwind=17 limit=150 hg_e2e_valid.0:33 LENGTH=4U PROFILE=HG_E2E_P22
 *  @run check real=f32 unwind=17 limit=150 hg_e2e_valid.0:41 LENGTH=5U PROFILE=HG_E2E_P05
 *  @run check real=f32 unwind=17 limit=150 hg_e2e_valid.0:41 LENGTH=5U PROFILE=HG_E2E_NONE
 *  @run deep real=f32 unwind=17 limit=600 hg_e2e_valid.0:41 LENGTH=5U PROFILE=HG_E2E_P22
 *  @run deep real=f32 unwind=17 limit=1800 hg_e2e_valid.0:129 LENGTH=16U PROFILE=HG_E2E_P11
 *  @run deep real=f32 unwind=17 limit=1800 hg_e2e_valid.0:129 LENGTH=16U PROFILE=HG_E2E_P02
 *  @run deep real=f32 unwind=17 limit=1800 hg_e2e_valid.0:129 LENGTH=16U PROFILE=HG_E2E_P05 */
void proof_e2e_round(void)
{
    uint8_t ids[HG_E2E_IDS];
    uint8_t data[LENGTH];
    uint8_t before[LENGTH];
    const hg_e2e_config config = any_config(ids, &hg_e2e_limits_default);
    const uint8_t length = any_u8_in(0U, LENGTH);
    const uint8_t counter = any_u8();
    const uint8_t stamp = any_u8();
    hg_e2e_header header;
    for (uint8_t i = 0U; i < LENGTH; i++) {
        data[i] = any_u8();
        before[i] = data[i];
    }
    uint8_t *frame = TAIL(data, length);
    assume(requires_e2e_protect(&config, frame, length));
    const hg_status written = hg_e2e_protect(&config, frame, length, counter, stamp);
    prove(ensures_e2e_protect(written), "no other status");
    if (written == HG_OK) {
        if (hg_e2e_valid(&config, length)) {
            prove(hg_e2e_check(&config, frame, length, &header) == HG_OK, "what was protected passes");
            prove((config.profile == HG_E2E_NONE) || (header.counter == (counter % hg_e2e_modulus(&config))), "its counter");
            prove(header.stamp == ((config.stamp == HG_E2E_NO_STAMP) ? 0U : (stamp & 0x0FU)), "its stamp");
            const uint16_t bit = any_u16();
            assume(bit < (8U * length));
            const uint8_t changed = frame[bit / 8U] ^ TAIL(before, length)[bit / 8U];
            prove(hg_e2e_owns(&config, bit) || (((changed >> (bit % 8U)) & 1U) == 0U), "no bit that is not its own");
            reach("protected");
        }
    } else {
        prove(hg_e2e_check(&config, frame, length, &header) == HG_E_FORMAT, "as the receiver sees it");
        prove(!hg_e2e_valid(&config, length), "a valid configuration fits its frame");
        const uint8_t any = any_u8();
        prove((any >= LENGTH) || (data[any] == before[any]), "nothing written");
    }
}

/** The check accepts a frame only if it is, bit for bit, what protecting the same data with the counter and stamp that it reads would make of it; refused or not, the
 *  header is written only when it is accepted.
 *  Any valid configuration with every check on, any frame of up to LENGTH bytes.
 *  @proves hg_e2e_check hg_e2e_protect
 *  @without conversion: checksums are cut to 8 and 16 bits on purpose
 *  @run check real=f32 unwind=17 limit=150 hg_e2e_valid.0:33 LENGTH=4U PROFILE=HG_E2E_P11
 *  @run deep real=f32 unwind=17 limit=150 hg_e2e_valid.0:33 LENGTH=3U PROFILE=HG_E2E_P02
 *  @run check real=f32 unwind=17 limit=150 hg_e2e_valid.0:33 LENGTH=4U PROFILE=HG_E2E_P05
 *  @run deep real=f32 unwind=17 limit=600 hg_e2e_valid.0:33 LENGTH=4U PROFILE=HG_E2E_P02
 *  @run deep real=f32 unwind=17 limit=1800 hg_e2e_valid.0:65 LENGTH=8U PROFILE=HG_E2E_P01
 *  @run deep real=f32 unwind=17 limit=1800 hg_e2e_valid.0:65 LENGTH=8U PROFILE=HG_E2E_P22
 *  @run deep real=f32 unwind=17 limit=1800 hg_e2e_valid.0:65 LENGTH=8U PROFILE=HG_E2E_P05 */
void proof_e2e_exact(void)
{
    uint8_t ids[HG_E2E_IDS];
    uint8_t data[LENGTH];
    uint8_t again[LENGTH];
    const hg_e2e_config config = any_config(ids, &hg_e2e_limits_default);
    const uint8_t length = any_u8_in(0U, LENGTH);
    hg_e2e_header header;
    const hg_e2e_header before = header;
    for (uint8_t i = 0U; i < LENGTH; i++) {
        data[i] = any_u8();
        again[i] = data[i];
    }
    assume(requires_e2e_check(&config, TAIL(data, length), length, &header));
    const hg_status status = hg_e2e_check(&config, TAIL(data, length), length, &header);
    prove(ensures_e2e_check(&config, &header, status), "a status of the list, a counter and a stamp in range");
    if (status == HG_OK) {
        if (hg_e2e_valid(&config, length)) {
            (void)hg_e2e_protect(&config, TAIL(again, length), length, header.counter, header.stamp);
            for (uint8_t i = 0U; i < LENGTH; i++) {
                prove(again[i] == data[i], "what protecting would make");
            }
            reach("accepted");
        }
    } else {
        prove((header.counter == before.counter) && (header.crc == before.crc) && (header.stamp == before.stamp), "nothing written");
        reach("refused");
    }
}

/** A configuration is valid only with its places inside the frame and apart, tables there and limits in range, whatever stands in it; null is refused.
 *  Any configuration, with profiles, modes and limits out of range too; frames of up to LENGTH bytes. Of longer ones the loop over the bits is the same.
 *  @proves hg_e2e_valid hg_e2e_owns hg_e2e_modulus
 *  @run check real=f32 unwind=41 limit=150 LENGTH=5U
 *  @run deep real=f32 unwind=513 limit=3600 LENGTH=64U */
void proof_e2e_valid(void)
{
    uint8_t ids[HG_E2E_IDS];
    hg_e2e_limits limits;
    hg_e2e_config config = any_config(any_bool() ? ids : NULL, any_bool() ? &limits : NULL);
    config.profile = (hg_e2e_profile)any_u8();
    config.mode = (hg_e2e_id_mode)any_u8();
    const uint8_t length = any_u8();
    assume((length <= LENGTH) || (length > HG_E2E_LENGTH_MAX));
    prove(!hg_e2e_valid(NULL, length), "null");
    if (hg_e2e_valid(&config, length)) {
        const uint16_t modulus = hg_e2e_modulus(&config);
        const uint16_t bits = (uint16_t)(8U * length);
        prove((length <= HG_E2E_LENGTH_MAX) && (config.limits != NULL), "in range");
        prove((config.profile >= HG_E2E_NONE) && (config.profile <= HG_E2E_P22), "a profile that there is");
        prove((modulus == 1U) || (modulus == 15U) || (modulus == 16U) || (modulus == 256U), "values of a counter");
        prove((config.stamp == HG_E2E_NO_STAMP) || (((config.stamp % 4U) == 0U) && ((config.stamp + 4U) <= bits) && hg_e2e_owns(&config, config.stamp)), "the stamp's place");
        prove((config.profile == HG_E2E_NONE) || ((config.crc < length) && (config.counter < bits) && ((config.counter / 8U) != config.crc)), "apart");
        prove((limits.init.window >= 1U) && (limits.init.window <= 16U) && (limits.invalid.window <= 16U) && (limits.valid.window <= 16U), "windows");
        reach("valid");
    }
}

/** No stale and no repeated frame is accepted: after a frame with the counter a, one with the counter b is in sequence just when the way from a on to b,
 *  round the counter's end, is 1 .. step (a whole turn for a counter that has not moved in another frame); lost is one less; the last good frame once more is refused without a change; after a
 *  jump `resync` frames in sequence are refused.
 *  Any profile, any two counters, any step, resynchronisation or none.
 *  @proves hg_e2e_sequence hg_e2e_repeated hg_e2e_receiver_start hg_e2e_modulus
 *  @run check real=f32 unwind=2 limit=150 PROFILE=HG_E2E_P01
 *  @run check real=f32 unwind=2 limit=150 PROFILE=HG_E2E_P22
 *  @run check real=f32 unwind=2 limit=150 PROFILE=HG_E2E_P05
 *  @run deep real=f32 unwind=2 limit=3600 */
void proof_e2e_sequence(void)
{
    uint8_t ids[HG_E2E_IDS];
    hg_e2e_config config = any_config(ids, &hg_e2e_limits_default);
    config.ignore = any_u8();
    const uint32_t modulus = hg_e2e_modulus(&config);
    const uint32_t turns[] = {0U, 1U, 15U, 16U, 256U, 15U, 16U}; /* of NONE, P01, P02, P05, P11, P22 */
    prove(modulus == turns[config.profile], "the values of its counter");
    const uint32_t a = any_u8();
    const uint32_t b = any_u8();
    assume((a < modulus) && (b < modulus));
    const bool first = any_bool();
    hg_e2e_receiver self = {.crc = any_u16(), .counter = (uint8_t)a, .stamp = any_u8_in(0U, 15U), .resync = any_u8(), .seen = true};
    if (first) {
        hg_e2e_receiver_start(&self);
        prove((!self.seen) && (self.resync == 0U), "no frame seen");
    }
    const hg_e2e_receiver before = self;
    const hg_e2e_header header = {.stamp = any_u8_in(0U, 15U), .counter = (uint8_t)b, .crc = any_u16()};
    const uint16_t step = any_u16();
    hg_e2e_progress progress = {.lost = 0xA5U, .continues = false};
    const bool counted = (config.profile != HG_E2E_NONE) && ((config.ignore & HG_E2E_IGNORE_COUNTER) == 0U);
    const bool twice = counted && before.seen && (header.counter == before.counter) && (header.crc == before.crc) && (header.stamp == before.stamp);
    prove(hg_e2e_repeated(&config, &self, &header) == twice, "the last good frame once more");
    const hg_status status = hg_e2e_sequence(&config, &self, &header, step, &progress);
    const uint32_t moved = first ? 1U : ((b > a) ? (b - a) : ((b + modulus) - a));
    if (!counted) {
        prove((status == HG_OK) && (progress.lost == 0U) && (!progress.continues), "nothing is known without a counter");
    } else if (twice) {
        prove((status == HG_E_REPEATED) && (self.counter == before.counter) && (self.crc == before.crc) && (self.resync == before.resync), "nothing changed");
        reach("repeated");
    } else {
        const bool in_sequence = (moved <= step) && (before.resync == 0U);
        prove((status == HG_OK) == in_sequence, "accepted just when it can be new");
        prove((status == HG_OK) || (status == HG_E_SEQUENCE), "no other status");
        prove((status != HG_OK) || ((progress.lost == (moved - 1U)) && (progress.continues == ((!first) && (moved == 1U)))), "frames lost");
        prove(self.seen && (self.counter == header.counter) && (self.crc == header.crc) && (self.stamp == header.stamp), "the next is compared with this one");
        if (moved > step) {
            prove(self.resync == config.resync, "a jump begins the resynchronisation");
            reach("a jump");
        }
        if (status == HG_OK) {
            reach("accepted");
        }
    }
}

static uint8_t ones(uint16_t bits, uint8_t window)
{
    uint8_t count = 0U;
    for (uint8_t i = 0U; i < 16U; i++) {
        count += ((i < window) && (((bits >> i) & 1U) != 0U)) ? 1U : 0U;
    }
    return count;
}

/** A link is trusted only after as many good frames, and no more damaged ones, than its limits say in the last events; it loses that trust in the event that breaks them; a
 *  machine that was not started stays so.
 *  Any valid limits, any state, any event.
 *  @proves hg_e2e_machine_step hg_e2e_machine_start
 *  @without conversion: windows are cut to 16 bits on purpose
 *  @run check real=f32 unwind=18 limit=150 */
void proof_e2e_machine(void)
{
    const hg_e2e_limit one = {.window = any_u8_in(1U, 16U), .ok = any_u8(), .error = any_u8()};
    const hg_e2e_limit two = {.window = any_u8_in(1U, 16U), .ok = any_u8(), .error = any_u8()};
    const hg_e2e_limit three = {.window = any_u8_in(1U, 16U), .ok = any_u8(), .error = any_u8()};
    assume((one.ok <= one.window) && (one.error <= one.window) && (two.ok <= two.window) && (two.error <= two.window) && (three.ok <= three.window) && (three.error <= three.window));
    const hg_e2e_limits limits = {.init = one, .valid = two, .invalid = three, .clear = any_bool()};
    hg_e2e_machine self;
    hg_e2e_machine_start(&self);
    prove((self.state == HG_E2E_NODATA) && (self.ok == 0U) && (self.error == 0U), "no data");
    const hg_e2e_machine before = {.state = (hg_e2e_state)any_u8(), .ok = any_u16(), .error = any_u16()};
    const hg_status event = (hg_status)any_i8();
    self = before;
    const uint16_t ok = (uint16_t)((uint16_t)(before.ok << 1U) | ((event == HG_OK) ? 1U : 0U));
    const bool damaged = (event == HG_E_CRC) || (event == HG_E_FORMAT);
    const uint16_t error = (uint16_t)((uint16_t)(before.error << 1U) | (damaged ? 1U : 0U));
    const hg_e2e_state state = hg_e2e_machine_step(&self, &limits, event);
    prove(state == self.state, "the state after it");
    if ((state == HG_E2E_VALID) && (before.state == HG_E2E_INVALID)) {
        prove((ones(ok, three.window) >= three.ok) && (ones(error, three.window) <= three.error), "trust wants good frames");
        reach("trusted again");
    }
    if ((state == HG_E2E_VALID) && (before.state == HG_E2E_VALID)) {
        prove((ones(ok, two.window) >= two.ok) && (ones(error, two.window) <= two.error), "and keeps wanting them");
        reach("still trusted");
    }
    prove((before.state != HG_E2E_NODATA) || (state == HG_E2E_NODATA) || ((state == HG_E2E_INIT) && (!damaged) && (event != HG_E_EMPTY)), "a frame ends NODATA");
    prove((before.state != HG_E2E_DEINIT) || (state == HG_E2E_DEINIT), "not started");
    prove((state != HG_E2E_VALID) || (before.state == HG_E2E_VALID) || (before.state == HG_E2E_INIT) || (before.state == HG_E2E_INVALID), "one change at most");
}
