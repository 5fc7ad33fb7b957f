/** @file
 *  A target in a plane and its five sensors, as the method has them: values with outliers, silence, lost and late frames, an origin that moves. Sensors and
 *  centre may be different processors, and their filters must be equal to the bit. */
#include "corpus_fusion.h"

#include "hullguard/consistency.h"
#include "hullguard/fusion.h"

#include <stdbool.h>
#include <string.h>

#define STATES 4U
#define SENSORS 5U
#define DEPTH 2U
#define ONSETS 3U
#define FNV_BASIS 0xCBF29CE484222325ULL
#define FNV_PRIME 0x100000001B3ULL

static const hg_real A[STATES * STATES] = {1.0F, 0.1F, 0.0F, 0.0F, 0.0F, 1.0F, 0.0F, 0.0F, 0.0F, 0.0F, 1.0F, 0.1F, 0.0F, 0.0F, 0.0F, 1.0F};
static const hg_real Q[STATES * STATES] = {0.0F, 0.0F, 0.0F, 0.0F, 0.0F, 0.01F, 0.0F, 0.0F, 0.0F, 0.0F, 0.0F, 0.0F, 0.0F, 0.0F, 0.0F, 0.01F};
static const hg_real P0[STATES * STATES] = {4.0F, 0.0F, 0.0F, 0.0F, 0.0F, 1.0F, 0.0F, 0.0F, 0.0F, 0.0F, 4.0F, 0.0F, 0.0F, 0.0F, 0.0F, 1.0F};
static const hg_real x0[STATES] = {0.0F, 1.0F, 0.0F, 0.5F};
static const hg_real R[SENSORS] = {0.01F, 0.04F, 0.0225F, 0.0625F, 0.0324F};
static const hg_real range[SENSORS] = {1e6F, 1e6F, 1e6F, 1e6F, 1e6F};
static const hg_real least[SENSORS] = {0.25F, 0.5F, 0.375F, 0.625F, 0.45F};
static const hg_real level[SENSORS] = {0.62F, 2.92F, 0.158F, 0.552F, 0.61F};
static const hg_real relax[2U * SENSORS] = {0.237F, 1.88F, 0.0544F, 0.206F, 0.23F, 0.619F, 2.44F, 0.656F, 0.598F, 0.615F};
static const hg_real early[2U * SENSORS] = {0.7F, 3.1F, 0.9F, 0.8F, 0.8F, 0.9F, 4.1F, 1.1F, 1.0F, 1.0F};
static const hg_real step[STATES] = {16.0F, 0.0F, 16.0F, 0.0F};
static const uint8_t place[SENSORS] = {0U, 0U, 2U, 2U, 1U};
static const hg_fusion_table table[1] = {{.alive = 31U, .level = level, .relax = relax, .early = early}};
static const hg_fusion_config config = {.states = STATES, .sensors = SENSORS, .depth = DEPTH, .delay = 1U, .heartbeat = 10U, .watchdog = 30U, .modulus = 16U,
                                        .trigger = HG_FUSION_INNOVATION, .A = A, .Q = Q, .x0 = x0, .P0 = P0, .select = place, .R = R, .range = range,
                                        .huber = 3.0F, .origin = step, .rates = 2U, .rate_step = 0.15F, .loss = 0.05F, .smoothing = 0.0078125F,
                                        .tables = 1U, .table = table};
static const hg_consistency_config judging = {.onsets = ONSETS, .stride = 8U, .least = least, .limit = 24.0F, .confirm = 10U, .repeats = 3U, .rest = 0U};

static hg_fusion_slot slots[DEPTH + 1U];
static hg_fusion_entry entries[(DEPTH + 1U) * SENSORS];
static hg_fusion_sensor sensors[SENSORS];
static hg_fusion_record records[SENSORS];
static int32_t origin[STATES];
static hg_real reals[HG_FUSION_REALS(STATES, 0U, SENSORS, DEPTH)];
static hg_consistency_sum sums[ONSETS * SENSORS];
static hg_consistency_sensor scores[SENSORS];
static hg_real responses[HG_CONSISTENCY_REALS(STATES, SENSORS, ONSETS)];

static uint32_t draw(uint32_t *state)
{
    uint32_t x = *state;
    x ^= x << 13U;
    x ^= x >> 17U;
    x ^= x << 5U;
    *state = x;
    return x;
}

static uint64_t hash_reals(uint64_t hash, const hg_real *x, size_t n)
{
    for (size_t i = 0U; i < n; i++) {
        uint32_t bits;
        (void)memcpy(&bits, &x[i], sizeof(bits));
        for (unsigned shift = 0U; shift < 32U; shift += 8U) {
            hash = (hash ^ ((bits >> shift) & 0xFFU)) * FNV_PRIME;
        }
    }
    return hash;
}

/* A sensor's frame, as often as its trigger wants: one in 8 is lost, one in 4 late. Positions are whole 1/1024 m, so that they are the same everywhere. */
static void sense(hg_fusion *filter, uint32_t *random, uint8_t i, int32_t truth, hg_real *late, bool *waits)
{
    static uint8_t counter[SENSORS];
    const uint8_t stamp = (uint8_t)(filter->k & 15U);
    const int32_t noise = (int32_t)(draw(random) % 401U) - 200;
    const int32_t odd = ((draw(random) % 128U) == 0U) ? 4096 : 0;
    const int32_t moved = origin[place[i]] * 16 * 1024;
    const hg_real y = (hg_real)(truth + noise + odd - moved) * 0x1p-10F;
    if (*waits) {
        (void)hg_fusion_receive(filter, i, (uint8_t)((stamp + 15U) & 15U), counter[i], *late);
        *waits = false;
    }
    if (hg_fusion_due(filter, i, y, 0.0F) == HG_OK) {
        counter[i] = (uint8_t)((counter[i] + 1U) & 15U);
        *waits = (draw(random) % 4U) == 0U;
        *late = y;
        if ((!*waits) && ((draw(random) % 8U) != 0U)) {
            (void)hg_fusion_receive(filter, i, stamp, counter[i], y);
        }
    }
}

uint64_t corpus_fusion(uint32_t samples)
{
    static hg_fusion filter;
    static hg_consistency judge;
    const hg_fusion_memory memory = {.slot = slots, .entry = entries, .sensor = sensors, .record = records, .origin = origin, .real = reals};
    const hg_consistency_memory beside = {.sum = sums, .sensor = scores, .real = responses};
    if ((hg_fusion_start(&filter, &config, &memory) != HG_OK) || (hg_consistency_start(&judge, &judging, &filter, &beside) != HG_OK)) {
        return 0U;
    }
    uint32_t random = 0x2545F491UL;
    uint64_t hash = FNV_BASIS;
    int32_t truth[STATES] = {0, 1024, 0, 512}; /* 1/1024 m and m/s */
    hg_real late[SENSORS] = {0.0F};
    bool waits[SENSORS] = {false};
    for (uint32_t k = 0U; k < samples; k++) {
        truth[1] += (int32_t)(draw(&random) % 201U) - 100;
        truth[3] += (int32_t)(draw(&random) % 201U) - 100;
        truth[0] += truth[1] / 10;
        truth[2] += truth[3] / 10;
        if (hg_fusion_open(&filter, x0) != HG_OK) {
            return 0U;
        }
        for (uint8_t i = 0U; i < SENSORS; i++) {
            sense(&filter, &random, i, truth[place[i]], &late[i], &waits[i]);
        }
        if (hg_fusion_close(&filter) != HG_OK) {
            return 0U;
        }
        const hg_real blamed = (hg_real)hg_consistency_step(&judge);
        hash = hash_reals(hash_reals(hash, filter.x, STATES), filter.P, (size_t)STATES * STATES);
        hash = hash_reals(hash, &blamed, 1U);
        for (uint8_t i = 0U; i < SENSORS; i++) {
            hash = hash_reals(hash_reals(hash, &scores[i].score, 1U), &sensors[i].loss, 1U);
        }
        if (blamed > 0.0F) {
            hg_consistency_reset(&judge);
        }
    }
    return hash;
}
