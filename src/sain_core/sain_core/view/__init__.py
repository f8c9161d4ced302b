"""What pictures and pages show: one list of things to draw, its colours, and figures."""
