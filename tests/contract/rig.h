/** @file
 *  What the contract suite needs of a backend: a board under test (node), a second one on the same bus (peer), and a hand on the wire.
 *  A rig's first member is this struct; contract.c knows nothing else of it. Every function asserts that it succeeds. */
#ifndef HULLGUARD_TESTS_CONTRACT_RIG_H
#define HULLGUARD_TESTS_CONTRACT_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "hal.h"

#define RIG_DEPTH 64U            /* frames every rig's node must hold */
#define RIG_FLOOD 1500U          /* frames that no rig's node can hold */

typedef struct rig rig;

typedef struct {
    void (*open)(rig *self, const hg_hal_filter *filters, size_t count);  /* node with these filters, peer without any */
    void (*close)(rig *self);
    void (*put)(rig *self, const hg_can_frame *frame);                    /* as a stranger, with lengths that send refuses */
    void (*put_later)(rig *self, const hg_can_frame *frame, uint32_t delay_us);
    void (*report)(rig *self, hg_bus_state state);                        /* let the node's controller report this state */
    void (*full)(rig *self, bool full);                                   /* whether the node's send finds no room */
    void (*link)(rig *self, bool up);                                     /* the node's way to the bus */
    void (*stop)(rig *self);
} rig_ops;

struct rig {
    const rig_ops *ops;
    bool           classic;   /* its controllers have no CAN FD */
    hg_hal         node;
    hg_hal         peer;
};

/** Run the suite; the number of failed tests. */
int contract_run(const char *name, rig *self);

#endif
