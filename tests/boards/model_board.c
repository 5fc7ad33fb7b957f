#include "model_board.h"

#include <stdio.h>
#include <stdlib.h>

static uint64_t now_us;

hg_hal model_hal[HG_BOARD_CONTROLLERS];

/* ---- the board ---- */

bool hg_board_place(uint8_t number, hg_controller_place *place)
{
    *place = (hg_controller_place){.type = model.type, .base = MODEL_BASE(number)};
    return true;
}

void hg_board_say(const char *text)
{
    (void)fputs(text, stdout);
}

uint64_t hg_board_now_us(void)
{
    now_us++;
    return now_us;
}

int hg_board_key(void)
{
    return -1;
}

_Noreturn void hg_board_leave(uint32_t status)
{
    exit((int)status);
}

/* ---- the hand on controller 0 ---- */

void contract_link(bool up)
{
    model_line *const line = model_line_of(0U);

    line->fault = up ? model.active : model.off;
    line->warning = false;
}

void contract_report(hg_bus_state state)
{
    const uint32_t told[] = {[HG_BUS_UNKNOWN] = model.off, [HG_BUS_ACTIVE] = model.active, [HG_BUS_WARNING] = model.active, [HG_BUS_PASSIVE] = model.passive, [HG_BUS_OFF] = model.off};
    model_line *const line = model_line_of(0U);

    line->fault = told[state];
    line->warning = state == HG_BUS_WARNING;
    line->events |= model.error;
}

/* ---- what every controller with registers does, and no emulator shows ---- */

int model_open(void **state)
{
    hg_hal *const hal = *state;

    hg_board_set_idle(NULL);
    for (uint8_t i = 0U; i < HG_BOARD_CONTROLLERS; i++) {
        assert_int_equal(hg_board_can(i, NULL, 0U, &hal[i]), HG_OK);
    }
    return 0;
}

int model_close(void **state)
{
    (void)state;
    return 0;
}

hg_controller_options model_options(void)
{
    static hg_queue_slot slots[2];
    hg_controller_options options = {.now_us = hg_board_now_us, .slots = slots, .depth = 2U};

    (void)hg_board_place(0U, &options.place);
    return options;
}

static void start_refuses_what_cannot_be(void **state)
{
    static const hg_hal_filter bad = {.id = 0x800U};
    hg_controller controller;
    const hg_controller_options good = model_options();
    hg_controller_options options[] = {good, good, good, good, good, good, good, good};

    (void)state;
    options[0].place.type = NULL;
    options[1].place.base = 0U;
    options[2].place.base += 2U;
    options[3].now_us = NULL;
    options[4].slots = NULL;
    options[5].depth = 3U;
    options[6].filters = &bad;
    options[6].filter_count = 1U;
    options[7].filter_count = 1U;
    for (size_t i = 0U; i < (sizeof options / sizeof options[0]); i++) {
        assert_int_equal(hg_controller_start(&controller, &options[i]), HG_E_ARGUMENT);
    }
    assert_int_equal(hg_controller_start(NULL, &good), HG_E_ARGUMENT);
    assert_int_equal(hg_controller_start(&controller, NULL), HG_E_ARGUMENT);
    assert_int_equal(hg_controller_start(&controller, &good), HG_OK);
    assert_int_equal(hg_board_can(HG_BOARD_CONTROLLERS, NULL, 0U, model_hal), HG_E_ARGUMENT);
    assert_int_equal(hg_board_can(0U, NULL, 0U, NULL), HG_E_ARGUMENT);
}

/* What waited is of samples long gone: it never comes. */
static void bus_off_heals_after_a_pause(void **state)
{
    const hg_hal *const hal = *state;
    const hg_can_frame old = {.id = 5U, .length = 1U};
    const hg_can_frame young = {.id = 6U, .length = 1U};
    hg_can_frame got;
    hg_hal_report report;

    model_line_of(0U)->acknowledged = false;
    assert_int_equal(hg_hal_send(&hal[0], &old), HG_OK);
    assert_int_equal(model_pending(0U), 1);
    model_line_of(0U)->fault = model.off;
    model_line_of(0U)->acknowledged = true;
    assert_int_equal(hg_hal_wait(&hal[0], hg_hal_now_us(&hal[0]) + (HG_CONTROLLER_RESTART_US / 2U)), HG_E_EMPTY);
    hg_hal_state(&hal[0], &report);
    assert_int_equal(report.bus, HG_BUS_OFF);
    assert_int_equal(hg_hal_wait(&hal[0], hg_hal_now_us(&hal[0]) + HG_CONTROLLER_RESTART_US), HG_E_EMPTY);
    hg_hal_state(&hal[0], &report);
    assert_int_equal(report.bus, HG_BUS_ACTIVE);
    assert_int_equal(model_pending(0U), 0);
    assert_int_equal(hg_hal_send(&hal[0], &young), HG_OK);
    assert_int_equal(hg_hal_receive(&hal[1], &got, NULL), HG_OK);
    assert_int_equal(got.id, young.id);
    assert_int_equal(hg_hal_receive(&hal[1], &got, NULL), HG_E_EMPTY);
}

int contract_own(void)
{
    const struct CMUnitTest tests[] = {MODEL_TEST(start_refuses_what_cannot_be), MODEL_TEST(bus_off_heals_after_a_pause)};

    return cmocka_run_group_tests_name("registers modelled", tests, NULL, NULL) + model_own();
}
