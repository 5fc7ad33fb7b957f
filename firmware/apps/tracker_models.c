#include "tracker_models.h"

#include "fusion5.h"
#include "fusion5_fast.h"
#include "tracking.h"

#include <string.h>

/* One line a model: its name as its generated header writes it, in lower and in upper case. */
#define MODELS(X) X(fusion5, FUSION5) X(fusion5_fast, FUSION5_FAST) X(tracking, TRACKING)

#define STORAGE(name, NAME)                                                     \
    static hg_##name##_tracker name##_storage;                                  \
    static const char *const name##_sensor[] = HG_##NAME##_SENSOR_NAMES;        \
    static hg_status name##_start(hg_tracker **tracker, hg_start how)           \
    {                                                                           \
        *tracker = &name##_storage.tracker;                                     \
        return hg_##name##_tracker_start(&name##_storage, how);                 \
    }
MODELS(STORAGE)

#define ENTRY(name, NAME) {#name, &hg_##name##_config, name##_sensor, HG_##NAME##_SAMPLE_TIME_US, name##_start},
static const tracker_model models[] = {MODELS(ENTRY)};

const tracker_model *tracker_model_at(size_t index)
{
    return (index < (sizeof models / sizeof models[0])) ? &models[index] : NULL;
}

const tracker_model *tracker_model_find(const char *name)
{
    size_t i = 0U;
    while ((tracker_model_at(i) != NULL) && (strcmp(tracker_model_at(i)->name, name) != 0)) {
        i++;
    }
    return tracker_model_at(i);
}
