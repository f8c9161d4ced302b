"""What an episode starts from: its world, its start, its pushes. May import `world`."""
