/** @file
 *  A CAN frame as the library and every HAL backend hand it around: classic up to 8 bytes, FD up to 64. */
#ifndef HULLGUARD_CAN_H
#define HULLGUARD_CAN_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define HG_CAN_DATA_MAX 64U          /* bytes; CAN FD */
#define HG_CAN_CLASSIC_MAX 8U        /* bytes; classic CAN */
#define HG_CAN_ID_STANDARD 0x7FFUL   /* largest 11-bit identifier */
#define HG_CAN_ID_EXTENDED 0x1FFFFFFFUL /* largest 29-bit identifier */

#define HG_CAN_EXTENDED 0x01U        /* 29-bit identifier */
#define HG_CAN_REMOTE 0x02U          /* remote request: carries no data */
#define HG_CAN_FD 0x04U              /* CAN FD format */
#define HG_CAN_BRS 0x08U             /* FD with bit-rate switch */
#define HG_CAN_ERROR 0x10U           /* an error report of the controller, not a frame from the bus */

typedef struct {
    uint32_t id;                     /* 11 or 29 bits, without flag bits */
    uint8_t  flags;                  /* HG_CAN_* */
    uint8_t  length;                 /* bytes of data[], 0 .. HG_CAN_DATA_MAX */
    uint8_t  data[HG_CAN_DATA_MAX];  /* in the order on the bus */
} hg_can_frame;

#ifdef __cplusplus
}
#endif

#endif
