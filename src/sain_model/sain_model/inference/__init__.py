"""What pushes say about the physics: its kind, its named parameters and how certain they are."""
