"""How weights are learned, and what is written beside them. May import `evaluation`."""
