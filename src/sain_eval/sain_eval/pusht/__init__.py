"""gym-pusht, the Push-T that everybody knows, as a world for the agent. May import `loop`."""
