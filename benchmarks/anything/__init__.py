"""The protocol of Push Anything, played by the whole graph with a simulated arm."""
