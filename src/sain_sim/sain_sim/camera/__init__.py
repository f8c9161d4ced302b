"""What a camera reports, and pictures of a world. May import `world`."""
