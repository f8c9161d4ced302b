"""What decides push after push: goals, progress, fallback. May import all but `ros`."""
