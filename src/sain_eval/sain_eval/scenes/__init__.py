"""Scenarios: where bodies and goals stand. Imports nothing of this package."""
