"""A test laboratory: an arm and bodies in MuJoCo, with physics that no model of ours has."""
