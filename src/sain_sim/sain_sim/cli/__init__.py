"""The command lines. May import `collecting`."""
