"""What a recording has of the graph: columns of messages, pushes, goals, episodes."""
