"""`hullguard freeze`: what an ECU has kept of the samples around a confirmed alarm."""
