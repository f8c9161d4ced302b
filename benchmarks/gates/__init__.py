"""What `benchmarks.gates` measures: structure, speed, one push, closed loops."""
