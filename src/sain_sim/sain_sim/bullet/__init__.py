"""A world in PyBullet, the default engine. May import `world` and `arm`."""
