/** @file
 *  From reset to main(): what every image without an operating system does, after the few instructions that are its processor's own
 *  (stack pointer, FPU). Those call hg_start(). */
#ifndef HULLGUARD_START_H
#define HULLGUARD_START_H

/** Fill static memory and call main(); stay here should it return. */
_Noreturn void hg_start(void);

/** What an exception without a handler does: nothing, for ever. A program may have one of its own. */
_Noreturn void hg_stop(void);

#endif
