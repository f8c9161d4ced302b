"""Rows become a data set on disk. May import `transitions`."""
