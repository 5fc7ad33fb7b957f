"""Many runs: false alarms, delays, losses."""
