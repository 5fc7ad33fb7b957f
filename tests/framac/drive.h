/* What the drivers share. Each runs one generated model: started in every way, then for ever any call of the node in any order, with any frame. Every
   array that the model's storage type has is an object of its own here, so that an access beyond one of them shows: inside one struct it would be
   an access to its neighbour. */
#ifndef HULLGUARD_FRAMAC_DRIVE_H
#define HULLGUARD_FRAMAC_DRIVE_H

#include "hullguard/hullguard.h"

#include <stddef.h>

#include "__fc_builtin.h"

extern volatile int any; /* another unknown number at each read */
extern volatile hg_real any_real; /* the same of the library's type, in floating point NaN and infinity too */

#define LENGTH(type, member) (sizeof(((type *)0)->member) / sizeof(((type *)0)->member[0]))
#define LENGTH_OF(array) (sizeof(array) / sizeof((array)[0]))

static inline bool maybe(void)
{
    return any != 0;
}

static inline hg_start any_start(void)
{
    return maybe() ? HG_START_REST : HG_START_MOVING;
}

static inline void any_frame(hg_can_frame *frame)
{
    Frama_C_make_unknown((char *)frame, sizeof *frame);
}

/* One call of a node, whichever. */
static inline void call_node(hg_node *node)
{
    hg_can_frame frame;
    hg_can_frame out[2];
    hg_verdict verdict;
    switch (any) {
    case 0:
        any_frame(&frame);
        (void)hg_node_receive(node, &frame);
        break;
    case 1:
        hg_node_overdue(node);
        break;
    case 2:
        hg_node_expect(node, (uint32_t)any);
        break;
    case 3:
        hg_node_outage(node);
        break;
    default:
        if (hg_node_step(node, &verdict) == HG_OK) {
            (void)hg_node_report(node, &verdict, maybe(), out);
        }
        break;
    }
}

#endif
