"""The command lines. May import every other room but `ros`."""
