"""Episodes of random pushes, written as a data set. May import `world`."""
