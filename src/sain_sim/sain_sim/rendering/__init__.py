"""Pictures of a world from its recording. May import `world`."""
