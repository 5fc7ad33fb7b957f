#include "models.h"

#include "battery_cell.h"
#include "battery_pack.h"
#include "cubic_suspension.h"
#include "dc_motor.h"
#include "openacc.h"
#include "platoon.h"
#include "platoon_bank.h"
#include "quadratic_sensor.h"
#include "suspension.h"
#include "suspension_published.h"
#include "two_state.h"

#include <string.h>

/* One line a model: its name as its generated header writes it, in lower and in upper case. */
#define MODELS(X)                                                                                                          \
    X(platoon, PLATOON) X(platoon_bank, PLATOON_BANK) X(openacc, OPENACC) X(suspension, SUSPENSION)                        \
    X(suspension_published, SUSPENSION_PUBLISHED) X(cubic_suspension, CUBIC_SUSPENSION)                                    \
    X(quadratic_sensor, QUADRATIC_SENSOR) X(two_state, TWO_STATE) X(battery_cell, BATTERY_CELL)            \
    X(dc_motor, DC_MOTOR) X(battery_pack, BATTERY_PACK)

#define STORAGE(name, NAME)                                                     \
    static hg_##name##_node name##_node;                                        \
    static const char *const name##_group[] = HG_##NAME##_GROUP_NAMES;          \
    static hg_status name##_selftest(void)                                      \
    {                                                                           \
        return hg_##name##_selftest(&name##_node);                              \
    }                                                                           \
    static hg_status name##_start(hg_node **node, hg_start how)                 \
    {                                                                           \
        *node = &name##_node.node;                                              \
        return hg_##name##_node_start(&name##_node, how);                       \
    }
MODELS(STORAGE)

#define ENTRY(name, NAME) {#name, &hg_##name##_config, name##_group, HG_##NAME##_SAMPLE_TIME_US, name##_selftest, name##_start},
static const app_model models[] = {MODELS(ENTRY)};

const app_model *app_model_at(size_t index)
{
    return (index < (sizeof models / sizeof models[0])) ? &models[index] : NULL;
}

const app_model *app_model_find(const char *name)
{
    size_t i = 0U;
    while ((app_model_at(i) != NULL) && (strcmp(app_model_at(i)->name, name) != 0)) {
        i++;
    }
    return app_model_at(i);
}

hg_status app_model_selftest(const app_model *model)
{
    return model->selftest();
}

hg_status app_model_start(const app_model *model, hg_node **node, hg_start how)
{
    return model->start(node, how);
}
