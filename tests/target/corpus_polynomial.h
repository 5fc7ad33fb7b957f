/** @file
 *  The polynomial filter's part of the corpus (corpus.c). */
#ifndef HULLGUARD_TESTS_CORPUS_POLYNOMIAL_H
#define HULLGUARD_TESTS_CORPUS_POLYNOMIAL_H

#include <stdint.h>

/** A hash over every number of every filter of polynomial_tables.py, each after so many samples; 0 when the library refused something. */
uint64_t corpus_polynomial(uint32_t samples);

#endif
