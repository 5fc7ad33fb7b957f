/* Registers of the first core, as hal/ctucan/board.c has placed it. */
#include "contract_rig.h"

#include <stdint.h>

#include <cmocka.h>

#define CORE 0x40000000UL
#define MODE 0x04UL
#define TX_COMMAND 0x74UL
#define TX_PRIORITY 0x78UL
#define ENABLE (1UL << 22)
#define READY_ALL 0xF02UL
#define ABORT_ALL 0xF04UL

const char *const contract_name = "ctucan";
const bool contract_classic = false;

static volatile uint32_t *word_at(uintptr_t address)
{
    return (volatile uint32_t *)address;
}

/* The emulator leaves buffers of priority 0 ready for ever, as a bus does on which nobody acknowledges. */
void contract_full(bool full)
{
    if (full) {
        *word_at(CORE + TX_PRIORITY) = 0U;
    }
    *word_at(CORE + TX_COMMAND) = full ? READY_ALL : ABORT_ALL;
}

void contract_link(bool up)
{
    const uint32_t mode = *word_at(CORE + MODE);

    *word_at(CORE + MODE) = up ? (mode | ENABLE) : (mode & ~ENABLE);
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
