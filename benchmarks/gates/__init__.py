"""What `benchmarks.gates` measures: speed, one push, closed loops."""
