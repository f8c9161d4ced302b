"""The learner in a graph."""
