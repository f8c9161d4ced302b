"""Bullet, the default engine, and MuJoCo, an optional extra. May import `world` and `arm`."""
