"""A simulated camera: lens, blur, exposure, noise and tags, over what a given renderer draws."""
