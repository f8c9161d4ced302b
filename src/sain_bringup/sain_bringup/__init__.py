"""The whole graph: launch files, settings, and the closed loop as a person runs it."""
