"""Pushes with a robot arm: its whole way is planned and checked before anything moves."""
