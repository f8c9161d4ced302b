"""Explicit randomness: every generator comes from a seed and a path of names or numbers.

``generator(7, "collect", 12)`` is the same stream on every machine and in every process,
and independent of ``generator(7, "collect", 13)``: work can be split over workers at will.
"""

import hashlib

import numpy as np


def generator(seed: int, *path: str | int) -> np.random.Generator:
    """Return the random generator that belongs to a seed and a path below it."""
    return np.random.Generator(np.random.PCG64(seed_sequence(seed, *path)))


def seed_sequence(seed: int, *path: str | int) -> np.random.SeedSequence:
    """Return numpy's seed sequence for a seed and a path below it."""
    if seed < 0:
        raise ValueError(f"seed is {seed}; it must not be negative")
    words = [int.from_bytes(hashlib.sha256(str(part).encode()).digest()[:4]) for part in path]
    return np.random.SeedSequence([seed, *words])
