/** @file
 *  All of hullguard, in reading order. */
#ifndef HULLGUARD_H
#define HULLGUARD_H

#include "hullguard/config.h"
#include "hullguard/status.h"
#include "hullguard/real.h"
#include "hullguard/linalg.h"
#include "hullguard/code.h"
#include "hullguard/trigger.h"
#include "hullguard/hold.h"
#include "hullguard/residual.h"
#include "hullguard/ring.h"
#include "hullguard/hull.h"
#include "hullguard/zonotope.h"
#include "hullguard/bank.h"
#include "hullguard/predict.h"
#include "hullguard/mismatch.h"
#include "hullguard/polynomial.h"
#include "hullguard/statistic.h"
#include "hullguard/decision.h"
#include "hullguard/detector.h"
#include "hullguard/uio.h"
#include "hullguard/isolate.h"
#include "hullguard/fusion.h"
#include "hullguard/variance.h"
#include "hullguard/consistency.h"
#include "hullguard/e2e.h"
#include "hullguard/can.h"
#include "hullguard/frame.h"
#include "hullguard/node.h"
#include "hullguard/tracker.h"

#endif
