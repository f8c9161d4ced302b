"""Data sets, errors and pictures behind published results."""
