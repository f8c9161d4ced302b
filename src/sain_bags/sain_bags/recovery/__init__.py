"""A whole bag from a damaged one. May import `bag` and `mcap`."""
