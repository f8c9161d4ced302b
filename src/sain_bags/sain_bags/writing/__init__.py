"""Bags as they are recorded and split. May import `bag` and `mcap`."""
