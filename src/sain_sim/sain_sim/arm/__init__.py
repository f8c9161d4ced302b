"""The Panda with its stick, and the PyBullet client. Imports nothing of this package."""
