"""Requests answered without middleware. May import `dynamics`."""
