/* The node of eva_small.c in fixed point: that no sum of tables as these overflows is part of what is shown. */
#include "eva_small.c"
