"""Pictures of episodes and plans. Imports nothing of this package."""
