"""Command line tools that take part in the graph."""
