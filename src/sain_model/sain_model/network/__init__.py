"""Features, the interaction network, and both compiled. May import `physics`."""
