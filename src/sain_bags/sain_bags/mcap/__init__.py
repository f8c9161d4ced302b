"""MCAP files: their chunks, indexes and damage. Imports nothing of this package."""
