/** @file
 *  The models that are compiled into an image, each with the one static storage its detector node needs. */
#ifndef HULLGUARD_APPS_MODELS_H
#define HULLGUARD_APPS_MODELS_H

#include "hullguard/node.h"

#include <stddef.h>

typedef struct {
    const char           *name;
    const hg_node_config *config;
    const char *const    *group;          /* [groups] names */
    uint32_t              sample_time_us; /* between two closing frames, microseconds */
    hg_status           (*selftest)(void);
    hg_status           (*start)(hg_node **node, hg_start how);
} app_model;

/** A model by its name; null when it is not compiled in. */
const app_model *app_model_find(const char *name);

/** A model by its number, 0, 1, ..; null behind the last one. */
const app_model *app_model_at(size_t index);

/** Test the model's tables, the library and this processor in the memory of its node, which must be started afterwards.
 *  Result: as NAME_selftest() of the model's generated header. */
hg_status app_model_selftest(const app_model *model);

/** Start the model's detector node. It lives in static memory: starting again begins anew.
 *  @param[out] node  the node, valid with HG_OK
 *  Result: as NAME_node_start() of the model's generated header. */
hg_status app_model_start(const app_model *model, hg_node **node, hg_start how);

#endif
