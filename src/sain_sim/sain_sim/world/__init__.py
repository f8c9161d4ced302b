"""What is true: bodies, parameters, pushes and refusals. May import `arm`."""
