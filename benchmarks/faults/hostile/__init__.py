"""Hostile files, and the commands that read them; see `benchmarks.faults.hostile_files`."""
