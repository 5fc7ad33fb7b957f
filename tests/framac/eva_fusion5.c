/* A fusion filter on a bus: a node's copy, its consistency test, and the sensor's side with its triggers. */
#include "drive.h"
#include "fusion5.h"

volatile int any;
volatile hg_real any_real;

static hg_fusion5_tracker application; /* as an application has it: started, and no more */
static hg_tracker tracker;
static hg_fusion_slot slot[HG_FUSION5_DEPTH + 1U];
static hg_fusion_entry entry[(HG_FUSION5_DEPTH + 1U) * HG_FUSION5_SENSORS];
static hg_fusion_sensor sensor[HG_FUSION5_SENSORS];
static hg_fusion_record record[HG_FUSION5_SENSORS];
static int32_t origin[HG_FUSION5_STATES];
static hg_real real[LENGTH(hg_fusion5_tracker, real)];
static hg_consistency_sum sum[LENGTH(hg_fusion5_tracker, sum)];
static hg_consistency_sensor judged[HG_FUSION5_SENSORS];
static hg_real response[LENGTH(hg_fusion5_tracker, response)];
static hg_link link[HG_FUSION5_SENSORS + 1U];
static hg_real estimate[2U * HG_FUSION5_STATES];

static void call_tracker(void)
{
    hg_can_frame frame;
    hg_can_frame out[2];
    hg_verdict verdict;
    hg_fusion_sender sender;
    const uint8_t one = (uint8_t)Frama_C_unsigned_int_interval(0U, HG_FUSION5_SENSORS - 1U);
    switch (any) {
    case 0:
        any_frame(&frame);
        (void)hg_tracker_receive(&tracker, &frame);
        break;
    case 1:
        hg_tracker_overdue(&tracker);
        break;
    case 2:
        hg_tracker_expect(&tracker, (uint32_t)any);
        break;
    case 3:
        hg_tracker_outage(&tracker);
        break;
    case 4:
        if (hg_fusion_sender_start(&sender, &tracker, one) == HG_OK) {
            sender.counter = (uint8_t)any;
            (void)hg_fusion_sender_step(&sender, any_real, any_real, maybe(), &frame);
        }
        break;
    case 5:
        (void)hg_tracker_estimate(&tracker, (uint8_t)Frama_C_unsigned_int_interval(0U, HG_FUSION5_STATES - 1U), &frame);
        break;
    case 6:
        (void)hg_tracker_digest(&tracker.fusion, (uint32_t)any);
        (void)hg_tracker_health(&tracker, (uint8_t)Frama_C_unsigned_int_interval(0U, HG_FUSION5_SENSORS));
        break;
    default:
        if (hg_tracker_step(&tracker, &verdict) == HG_OK) {
            (void)hg_tracker_report(&tracker, &verdict, maybe(), out);
        }
        break;
    }
}

int main(void)
{
    const hg_tracker_memory memory = {
        .fusion = {.slot = slot, .entry = entry, .sensor = sensor, .record = record, .origin = origin, .real = real},
        .consistency = {.sum = sum, .sensor = judged, .real = response},
        .link = link,
        .real = estimate,
    };
    (void)hg_fusion5_tracker_start(&application, any_start());
    if (hg_tracker_start(&tracker, &hg_fusion5_config, &memory, any_start()) == HG_OK) {
        while (maybe()) {
            call_tracker();
        }
    }
    return 0;
}
