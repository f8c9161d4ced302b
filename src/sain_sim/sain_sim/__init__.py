"""The simulated worlds in two engines, the collection of data, and the simulator's node."""
