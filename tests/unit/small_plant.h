/** @file
 *  A healthy plant for the model of small_model.h, which moves within its bounds, and its senders. */
#ifndef HULLGUARD_TESTS_SMALL_PLANT_H
#define HULLGUARD_TESTS_SMALL_PLANT_H

#include "small_model.h"

typedef struct {
    uint32_t         random;
    double           s1;
    double           s2;
    double           slope;
    hg_sender_config config[SM_GROUPS];
    hg_sender        sender[SM_GROUPS];
    int32_t          codes[SM_GROUPS][4];
} plant;

static inline void plant_sender(plant *p, uint8_t group)
{
    assert_status(HG_OK, hg_sender_start(&p->sender[group], &p->config[group], p->codes[group]));
}

static inline void plant_begin(plant *p, const hg_message *message, uint32_t seed)
{
    *p = (plant){.random = seed, .s1 = 3.0, .s2 = -2.0,
                 .config = {{.message = &message[0], .trigger = &sm_trigger_a}, {.message = &message[1], .trigger = &sm_trigger_b}}};
    plant_sender(p, 0U);
    plant_sender(p, 1U);
}

/* The next sample; value[0] is what group 0 sends, value[1] what group 1 does. */
static inline void plant_move(plant *p, bool fault, hg_real value[SM_GROUPS][2])
{
    p->slope = ((draw(&p->random) % 15U) == 0U) ? ((double)draw_between(&p->random, -3, 3) * 0.0625) : p->slope;
    p->s2 += (fabs(p->s2 + p->slope) < 40.0) ? p->slope : 0.0;
    const double move = (double)draw_between(&p->random, -16, 16) / 64.0;
    p->s1 += (fabs(p->s1 + move) < 40.0) ? move : 0.0;
    const double d = (double)draw_between(&p->random, -15, 15) / 1024.0;
    value[0][0] = R(p->s2 + d + (fault ? 4.0 : 0.0));
    value[0][1] = R(p->s1);
    value[1][0] = R(p->s2);
}

#endif
