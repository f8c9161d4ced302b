"""Pushes that inform most."""
