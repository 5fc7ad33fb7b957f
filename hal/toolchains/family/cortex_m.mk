# Cortex-M.
CROSS_cortex_m := arm-none-eabi-
LIBC_cortex_m  := newlib
START_cortex_m := hal/cortex_m/start.c
