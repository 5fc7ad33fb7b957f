/** @file
 *  From reset to main(): what every image without an operating system does, after the few instructions that are its processor's own
 *  (stack pointer, FPU). Those call hg_start(). */
#ifndef HULLGUARD_START_H
#define HULLGUARD_START_H

/** Fill static memory, call main(), and hand what it returns to hg_end(). */
_Noreturn void hg_start(void);

/** What becomes of an exception without a handler: nothing, for ever. A program may define its own. */
_Noreturn void hg_stop(void);

/** What becomes of a program that has ended: nothing, for ever. A program may define its own. @param[in] status  of main() */
_Noreturn void hg_end(int status);

#endif
