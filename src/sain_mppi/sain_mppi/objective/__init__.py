"""What a sequence of pushes costs, and which are worth trying. Imports nothing of this package."""
