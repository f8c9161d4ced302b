"""Hostile files, and the commands that read them; see `benchmarks.hostile_files`."""
