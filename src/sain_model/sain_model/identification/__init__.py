"""What pushes tell of the planar prior: its structure, its parameters and how sure they are."""
