/** @file
 *  Access to registers of 32 bits, by address and number. HG_REGISTERS_MODELLED is 1 where a test plays the device. */
#ifndef HULLGUARD_HAL_BOARD_REGISTERS_H
#define HULLGUARD_HAL_BOARD_REGISTERS_H

#include <stdint.h>

#ifndef HG_REGISTERS_MODELLED
#define HG_REGISTERS_MODELLED 0
#endif

#if HG_REGISTERS_MODELLED

uint32_t hg_register_read(uintptr_t base, uint32_t number);
void     hg_register_write(uintptr_t base, uint32_t number, uint32_t value);

#else

static inline uint32_t hg_register_read(uintptr_t base, uint32_t number)
{
    return ((volatile uint32_t *)base)[number];
}

static inline void hg_register_write(uintptr_t base, uint32_t number, uint32_t value)
{
    ((volatile uint32_t *)base)[number] = value;
}

#endif

#endif
