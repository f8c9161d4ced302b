"""Dataset as they are loaded, cut into windows and batched. May import `network`."""
