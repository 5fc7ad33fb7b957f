/** @file
 *  The fusion models that are compiled into an image, each with the one static storage that a node's copy of its filter needs. */
#ifndef HULLGUARD_APPS_TRACKER_MODELS_H
#define HULLGUARD_APPS_TRACKER_MODELS_H

#include "hullguard/tracker.h"

#include <stddef.h>

typedef struct {
    const char              *name;
    const hg_tracker_config *config;
    const char *const       *sensor;         /* [sensors] names */
    uint32_t                 sample_time_us; /* between two ticks, microseconds */
    hg_status              (*start)(hg_tracker **tracker, hg_start how);
} tracker_model;

/** A model by its number, 0, 1, ..; null behind the last one. */
const tracker_model *tracker_model_at(size_t index);

/** A model by its name; null when it is not compiled in. */
const tracker_model *tracker_model_find(const char *name);

#endif
