/** @file
 *  Which mutant a mutated library is; included before each of its files. */
#ifndef HULLGUARD_TESTS_MUTATION_RUNTIME_H
#define HULLGUARD_TESTS_MUTATION_RUNTIME_H

extern unsigned hg_mutant;         /* 0: none */
extern unsigned char *hg_reached;  /* [number]: where the mutants are that a program comes by; NULL: not asked */

static inline int hg_is_mutant(unsigned number)
{
    if (hg_reached != (unsigned char *)0) {
        hg_reached[number] = 1U;
    }
    return hg_mutant == number;
}

#endif
