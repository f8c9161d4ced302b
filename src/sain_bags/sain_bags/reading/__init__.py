"""Bags as they are read. May import `writing`, `bag` and `mcap`."""
