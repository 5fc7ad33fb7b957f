/** @file
 *  Polynomial and fusion filters over the drives of the corpus, for counting. Exit status 1 when the library refused something. No C library is needed. */

#include "console.h"
#include "corpus_fusion.h"
#include "corpus_polynomial.h"

#include <stdbool.h>

#define SAMPLES 64U

int main(void)
{
    const bool good = (corpus_polynomial(SAMPLES) != 0U) && (corpus_fusion(SAMPLES) != 0U);
    console_write("filters end\n", 12U);
    return good ? 0 : 1;
}
