"""gym-pusht as a world for the agent, with a model of its physics."""
