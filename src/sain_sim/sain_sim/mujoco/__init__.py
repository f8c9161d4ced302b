"""A world in MuJoCo, an optional extra. May import `world` and `arm`."""
