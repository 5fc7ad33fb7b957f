/** @file
 *  The tables of the shipped model MODEL: firmware/models/MODEL.c. They are part of the proof, so that every layout and size is a constant. */
#ifndef HULLGUARD_MODEL_TABLES_H
#define HULLGUARD_MODEL_TABLES_H

#define TEXT_OF(x) #x
#define TEXT(x) TEXT_OF(x)
#define JOIN_OF(a, b, c) a##b##c
#define JOIN(a, b, c) JOIN_OF(a, b, c)

#define SOURCE TEXT(MODEL.c)
#include SOURCE

#define MODEL_CONFIG JOIN(hg_, MODEL, _config)

#endif
