/* Registers of CAN 0. */
#include "contract_rig.h"

#include <stdint.h>

#include <cmocka.h>

#define SRR 0xFF060000UL
#define ENABLE 2UL

const char *const contract_name = "zynqmp_r5";
const bool contract_classic = true;

void contract_full(bool full)
{
    (void)full;
    check_skip("the emulated controller is never full");
}

void contract_link(bool up)
{
    *(volatile uint32_t *)(uintptr_t)SRR = up ? ENABLE : 0U;
}

void contract_report(hg_bus_state state)
{
    (void)state;
    check_skip("the emulated controller makes no errors");
}

int contract_own(void)
{
    return 0;
}
