/* rig.h includes it for CMocka's sake; the stand-in beside it needs nothing of it. */
