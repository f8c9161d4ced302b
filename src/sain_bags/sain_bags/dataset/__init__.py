"""Pushes become rows, and rows a data set on disk."""
