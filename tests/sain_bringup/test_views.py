"""The views for RViz and Foxglove: they name what these have and what the graph publishes."""
