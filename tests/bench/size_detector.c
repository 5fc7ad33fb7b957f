/** @file
 *  A program with a model's detector alone, from the holds to the decision, for who has a bus and a protection of frames already. Linked and
 *  measured, never run. The detector's tables are static in the model, hence the inclusion: what no detector needs is left out by the linker. */

#include "size_port.h"

#include RECORD_MODEL

static struct {
    hg_detector detector;
    hg_hold     hold[sizeof(hold) / sizeof(hold[0])];
#if RECORD_GENERATORS > 0U
    hg_residual residual[RECORD_GENERATORS];
#if RECORD_ZONOTOPES > 0U
    hg_zonotope zonotope[RECORD_GENERATORS];
#else
    hg_hull     hull[RECORD_GENERATORS];
#endif
#endif
#if RECORD_PREDICTORS > 0U
    hg_predict  predict[RECORD_PREDICTORS];
#endif
#if RECORD_BANKS > 0U
    hg_bank     bank[RECORD_BANKS];
    hg_acc      sum[RECORD_SUMS];
#endif
    hg_alarm    alarm[RECORD_GENERATORS + RECORD_BANKS];
    int32_t     code[HG_HOLD_CODES(RECORD_SIGNALS)];
    hg_real     real[RECORD_REALS];
} all;

static const hg_detector_memory memory = {
    .hold = all.hold,
#if RECORD_GENERATORS > 0U
    .residual = all.residual,
#if RECORD_ZONOTOPES > 0U
    .zonotope = all.zonotope,
#else
    .hull = all.hull,
#endif
#endif
#if RECORD_PREDICTORS > 0U
    .predict = all.predict,
#endif
#if RECORD_BANKS > 0U
    .bank = all.bank,
    .sum = all.sum,
    .sums = RECORD_SUMS,
#endif
    .alarm = all.alarm,
    .code = all.code,
    .codes = HG_HOLD_CODES(RECORD_SIGNALS),
    .real = all.real,
    .reals = RECORD_REALS,
};

int main(void)
{
    int32_t code[HG_GROUP_SIGNALS_MAX];
    hg_finding finding;
    uint8_t group;
    if (hg_detector_start(&all.detector, &detector, &memory, HG_START_MOVING) != HG_OK) {
        return 1;
    }
    while (port_take(&group, sizeof(group))) {
        if (port_take(code, sizeof(code))) {
            (void)hg_detector_receive(&all.detector, group, code, true);
        } else {
            (void)hg_detector_lose(&all.detector, group);
        }
        if (hg_detector_step(&all.detector, &finding) == HG_OK) {
            port_give(&finding, sizeof(finding));
        }
    }
    return 0;
}
