"""Files that somebody else may have made: how much of them is read. May import `errors` alone."""
