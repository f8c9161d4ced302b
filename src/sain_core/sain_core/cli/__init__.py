"""Command lines of all packages: options, entry points and tables. May import every other room."""
