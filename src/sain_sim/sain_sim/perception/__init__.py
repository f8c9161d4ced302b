"""Bodies as a camera reports them: poses become scenes with ids. May import `world`."""
