"""gym-pusht as a world, a scenario and models of SAIN."""
