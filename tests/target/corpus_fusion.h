/** @file
 *  The fusion filter's part of the corpus (corpus.c). */
#ifndef HULLGUARD_TESTS_CORPUS_FUSION_H
#define HULLGUARD_TESTS_CORPUS_FUSION_H

#include <stdint.h>

/** A hash over every number of a filter and of the test beside it, after so many samples of a random walk; 0 when the library refused something. */
uint64_t corpus_fusion(uint32_t samples);

#endif
