/** @file
 *  What a call can answer. HG_OK is 1 and every error is negative, so that memory that was never written (0) is not success.
 *  The list is closed: each function names the members it can return, and nothing else comes from it. */
#ifndef HULLGUARD_STATUS_H
#define HULLGUARD_STATUS_H

#ifdef __cplusplus
extern "C" {
#endif

/* What a call answers. */
typedef enum {
    HG_OK           = 1,   /* done, as the function says */
    HG_E_ARGUMENT   = -1,  /* a null pointer or a number outside the stated range, at start */
    HG_E_SIZE       = -2,  /* the memory handed over is smaller than the configuration needs */
    HG_E_CONFIG     = -3,  /* constant tables contradict each other, or are not of this library */
    HG_E_NUMERIC    = -4,  /* a value is not finite or outside its declared range */
    HG_E_FORMAT     = -5,  /* a frame of wrong length or kind (remote, extended, FD, error) */
    HG_E_ID         = -6,  /* no message of this model has the frame's identifier */
    HG_E_CRC        = -7,  /* the end-to-end checksum is wrong */
    HG_E_REPEATED   = -8,  /* the sequence counter did not move: a duplicate */
    HG_E_STAMP      = -9,  /* stamped with another sample than the one being collected: early or late */
    HG_E_EMPTY      = -10, /* nothing to read or nothing to send */
    HG_E_BUSY       = -11, /* no room now; the same call may succeed later */
    HG_E_BUS        = -12, /* the bus is off or the interface is down */
    HG_E_IO         = -13, /* the operating system or the controller refused; the backend's state says more */
    HG_E_SEQUENCE   = -14, /* the sequence counter jumped further than the sender can have counted */
    HG_E_STATE      = -15, /* a good frame of a link that has had too many bad ones to be trusted yet, or a request that does not fit the state */
    HG_E_DIGEST     = -16, /* a checksum is wrong: constant tables are not as they were generated (digest.h), or memory is not as it was sealed (guard.h) */
    HG_E_SELFTEST   = -17  /* the self-test's result is not the stored one: tables, code or processor are not as they were (selftest.h) */
} hg_status;

#ifdef __cplusplus
}
#endif

#endif
