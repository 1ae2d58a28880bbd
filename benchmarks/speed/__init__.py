"""Time and memory of the core, and their parts."""
