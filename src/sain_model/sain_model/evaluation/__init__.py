"""Errors, intervals, coverage and open loops, in tables and plots. May import `dynamics`."""
