"""A world in MuJoCo."""
