"""What people look at: the report of a run, the report of a design, the live table."""
