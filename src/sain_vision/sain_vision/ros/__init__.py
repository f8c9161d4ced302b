"""The nodes that see: topics and parameters only."""
