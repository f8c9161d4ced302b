"""From images and poses to scenes; no simulator is imported."""
