"""How kernels are compiled, and where they run. Imports nothing of this package."""
