"""A world in PyBullet."""
