"""Costs, sampling and the search over push sequences. Imports nothing of this package."""
